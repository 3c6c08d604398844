/* Samples: memory that travels, turns of the square. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "train/sample.h"

enum { SIDE = 20, STAMP = RX_SAMPLE_KERNEL, TURNS = 8 };

/* Every pixel has a value of its own; star i stands on pixel (3 + 5 i, 4 + i), where x, w, y, blurred are
 * 1000 (i + 1) plus the number of the plane. */
static rx_sample *numbered(void)
{
    rx_sample *s = rx_sample_new(SIDE);
    assert_non_null(s);
    float *planes[4] = {s->x, s->w, s->y, s->blurred};
    for (int k = 0; k < 4; k++)
        for (int i = 0; i < SIDE * SIDE; i++)
            planes[k][i] = (float)(i + SIDE * SIDE * k) / 4096.0f;
    for (int i = 0; i < STAMP * STAMP; i++)
        s->kernel[i] = (float)i;
    s->nstars = 3;
    for (int i = 0; i < s->nstars; i++) {
        int x = 3 + 5 * i, y = 4 + i;
        s->star[i][0] = (float)x;
        s->star[i][1] = (float)y;
        s->star[i][2] = (float)(10 * i + 1);
        s->star[i][3] = (float)(10 * i + 2);
        for (int k = 0; k < 4; k++)
            planes[k][y * SIDE + x] = (float)(1000 * (i + 1) + k);
    }
    return s;
}

static size_t planes_bytes(const rx_sample *s)
{
    return (size_t)((char *)(s->kernel + STAMP * STAMP) - (char *)s->x);
}

static void test_memory(void **state)
{
    (void)state;
    for (int side = 1; side < 70; side += 7) {
        rx_sample *s = rx_sample_new(side);
        assert_non_null(s);
        assert_int_equal(s->side, side);
        float *planes[4] = {s->x, s->w, s->y, s->blurred};
        char *end = (char *)s + rx_sample_bytes(side);
        for (int k = 0; k < 4; k++) {
            assert_int_equal((uintptr_t)planes[k] % 64, 0);
            for (int i = 0; i < side * side; i++)
                planes[k][i] = (float)k;
        }
        assert_int_equal((uintptr_t)s->kernel % 64, 0);
        for (int i = 0; i < STAMP * STAMP; i++)
            s->kernel[i] = 9.0f;
        assert_true((char *)(s->kernel + STAMP * STAMP) <= end);
        for (int k = 0; k < 4; k++) /* none lies on another, nor on the header */
            for (int i = 0; i < side * side; i++)
                assert_true(planes[k][i] == (float)k);
        assert_int_equal(s->side, side);
        rx_sample_free(s);
    }
    rx_sample_free(NULL);
    assert_null(rx_sample_new(0));
}

static void test_travel(void **state)
{
    (void)state;
    rx_sample *s = numbered(), *copy = rx_sample_new(SIDE);
    memcpy(copy, s, rx_sample_bytes(SIDE));
    rx_sample_attach(copy);
    assert_ptr_not_equal(copy->x, s->x);
    assert_memory_equal(copy->x, s->x, planes_bytes(s));
    assert_memory_equal(copy->star, s->star, sizeof s->star);
    rx_sample_free(s);
    assert_true(copy->kernel[STAMP * STAMP - 1] == (float)(STAMP * STAMP - 1));
    rx_sample_free(copy);
}

static void test_turns_move_all_alike(void **state)
{
    (void)state;
    for (int turn = 0; turn < TURNS; turn++) {
        rx_sample *s = numbered();
        assert_int_equal(rx_sample_turn(s, turn, NULL), RX_OK);
        const float *planes[4] = {s->x, s->w, s->y, s->blurred};
        for (int i = 0; i < s->nstars; i++) {
            int x = (int)s->star[i][0], y = (int)s->star[i][1];
            for (int k = 0; k < 4; k++)
                assert_true(planes[k][y * SIDE + x] == (float)(1000 * (i + 1) + k));
            assert_true(s->star[i][2] == (float)(10 * i + 1));
            assert_true(s->star[i][3] == (float)(10 * i + 2));
        }
        rx_sample_free(s);
    }
}

/* A kernel has to be turned as the planes are: blurring, then turning, is turning, then blurring. */
static void test_turned_kernel_blurs_the_same(void **state)
{
    (void)state;
    for (int turn = 0; turn < TURNS; turn++) {
        rx_sample *s = rx_sample_new(SIDE);
        const int at = 7 * SIDE + 11;
        s->x[at] = 1.0f;
        for (int j = -3; j <= 3; j++)
            for (int i = -3; i <= 3; i++) {
                float value = (float)(1 + (j + 3) * 7 + i + 3);
                s->kernel[(STAMP / 2 + j) * STAMP + STAMP / 2 + i] = value;
                s->y[at + j * SIDE + i] = value; /* the point blurred */
            }
        assert_int_equal(rx_sample_turn(s, turn, NULL), RX_OK);
        for (int y = 0; y < SIDE; y++)
            for (int x = 0; x < SIDE; x++) {
                if (s->x[y * SIDE + x] != 1.0f)
                    continue;
                for (int j = -3; j <= 3; j++)
                    for (int i = -3; i <= 3; i++)
                        assert_true(s->y[(y + j) * SIDE + x + i] ==
                                    s->kernel[(STAMP / 2 + j) * STAMP + STAMP / 2 + i]);
            }
        rx_sample_free(s);
    }
}

static void test_turns_are_the_group_of_the_square(void **state)
{
    (void)state;
    rx_sample *turned[TURNS], *plain = numbered();
    for (int turn = 0; turn < TURNS; turn++) {
        turned[turn] = numbered();
        assert_int_equal(rx_sample_turn(turned[turn], turn, NULL), RX_OK);
        for (int other = 0; other < turn; other++)
            assert_memory_not_equal(turned[turn]->x, turned[other]->x, SIDE * SIDE * sizeof(float));
        int inverses = 0;
        for (int back = 0; back < TURNS; back++) {
            rx_sample *again = numbered();
            assert_int_equal(rx_sample_turn(again, turn, NULL), RX_OK);
            assert_int_equal(rx_sample_turn(again, back, NULL), RX_OK);
            if (memcmp(again->x, plain->x, planes_bytes(plain)) == 0 &&
                memcmp(again->star, plain->star, sizeof plain->star) == 0)
                inverses++;
            rx_sample_free(again);
        }
        assert_int_equal(inverses, 1);
    }
    assert_memory_equal(turned[0]->x, plain->x, planes_bytes(plain));
    for (int turn = 0; turn < TURNS; turn++)
        rx_sample_free(turned[turn]);
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_sample_turn(plain, TURNS, &err), RX_USAGE);
    assert_int_equal(rx_sample_turn(plain, -1, &err), RX_USAGE);
    rx_sample_free(plain);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_memory),
        cmocka_unit_test(test_travel),
        cmocka_unit_test(test_turns_move_all_alike),
        cmocka_unit_test(test_turned_kernel_blurs_the_same),
        cmocka_unit_test(test_turns_are_the_group_of_the_square),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
