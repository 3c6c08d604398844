/* Allocation: zeroed, aligned, and never a product that wrapped around. */
#include "../near.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static void memory_is_zeroed_and_aligned(void **state)
{
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
    volatile size_t huge = SIZE_MAX;
    assert_null(rx_alloc(huge / 2, 3));
    assert_null(rx_alloc(huge, 1)); /* would wrap when rounded up to the alignment */
    assert_null(rx_alloc(huge / 8 + 1, 8));
    assert_null(rx_regrow(NULL, huge / 2, 3));
}

static void regrow_keeps_the_content(void **state)
{
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

static int count_of(const unsigned char *p, size_t from, size_t to, int value)
{
    int n = 0;
    for (size_t i = from; i < to; i++)
        n += p[i] == value;
    return n;
}

/* Linux gives zeros for pages that were given back; what lies around them stays. */
static void what_is_spent_is_given_back(void **state)
{
    enum { SIZE = 1 << 20, FROM = 1000, TO = SIZE - 3000, PAGE = 1 << 16 };
    unsigned char *p = rx_alloc(SIZE, 1);
    assert_non_null(p);
    memset(p, 0xa5, SIZE);
    rx_memory_spend(p, FROM, TO);
    assert_int_equal(count_of(p, 0, FROM, 0xa5), FROM);
    assert_int_equal(count_of(p, TO, SIZE, 0xa5), SIZE - TO);
    assert_true(count_of(p, FROM, TO, 0) > TO - FROM - 2 * PAGE);
    free(p);
}

static void less_than_a_page_stays(void **state)
{
    enum { SIZE = 1 << 20, PAGE = 1 << 16 };
    unsigned char *p = rx_alloc(SIZE, 1);
    assert_non_null(p);
    memset(p, 0xa5, SIZE);
    for (size_t from = 0; from < SIZE - PAGE; from += 4099)
        rx_memory_spend(p, from, from + PAGE - 1);
    rx_memory_spend(p, 5, 5);
    rx_memory_spend(p, 0, 0);
    assert_int_equal(count_of(p, 0, SIZE, 0xa5), SIZE);
    free(p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(memory_is_zeroed_and_aligned), cmocka_unit_test(products_that_overflow_give_null),
        cmocka_unit_test(regrow_keeps_the_content),     cmocka_unit_test(what_is_spent_is_given_back),
        cmocka_unit_test(less_than_a_page_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
