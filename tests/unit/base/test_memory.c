/* Allocation: zeroed, aligned, and never a product that wrapped around. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/memory.h"

static void memory_is_zeroed_and_aligned(void **state)
{
    (void)state;
    for (size_t n = 1; n < 200; n += 7) {
        unsigned char *p = rx_alloc(n, 3);
        assert_non_null(p);
        assert_int_equal((uintptr_t)p % 64, 0);
        for (size_t i = 0; i < 3 * n; i++)
            assert_int_equal(p[i], 0);
        memset(p, 0xa5, 3 * n);
        free(p);
    }
}

static void products_that_overflow_give_null(void **state)
{
    (void)state;
    volatile size_t huge = SIZE_MAX;
    assert_null(rx_alloc(huge / 2, 3));
    assert_null(rx_alloc(huge, 1)); /* would wrap when rounded up to the alignment */
    assert_null(rx_alloc(huge / 8 + 1, 8));
    assert_null(rx_regrow(NULL, huge / 2, 3));
}

static void nothing_is_still_a_pointer(void **state)
{
    (void)state;
    void *p = rx_alloc(0, 8);
    assert_non_null(p);
    free(p);
    p = RX_NEW(double, 0);
    assert_non_null(p);
    p = rx_regrow(p, 0, 8);
    assert_non_null(p);
    free(p);
}

static void regrow_keeps_the_content(void **state)
{
    (void)state;
    int *p = rx_regrow(NULL, 4, sizeof *p);
    assert_non_null(p);
    for (int i = 0; i < 4; i++)
        p[i] = i;
    int *more = rx_regrow(p, 4000, sizeof *p);
    assert_non_null(more);
    for (int i = 0; i < 4; i++)
        assert_int_equal(more[i], i);
    free(more);
}

static void strdup_copies(void **state)
{
    (void)state;
    const char *text = "NONE,RL";
    char *copy = rx_strdup(text);
    assert_string_equal(copy, text);
    assert_ptr_not_equal(copy, text);
    free(copy);
    assert_null(rx_strdup(NULL));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(memory_is_zeroed_and_aligned),
        cmocka_unit_test(products_that_overflow_give_null),
        cmocka_unit_test(nothing_is_still_a_pointer),
        cmocka_unit_test(regrow_keeps_the_content),
        cmocka_unit_test(strdup_copies),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
