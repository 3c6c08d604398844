/* As much of cmocka as tests/unit/nn/test_direct.c uses, for processors that cmocka is not installed for (tests/aarch64.sh).
 * The first failure ends the program with 1. */
#ifndef RX_TESTS_CMOCKA_H
#define RX_TESTS_CMOCKA_H

#include <stdio.h>
#include <stdlib.h>

struct CMUnitTest {
    const char *name;
    void (*run)(void **state);
};

#define cmocka_unit_test(test)                                                                               \
    {                                                                                                        \
#test, test                                                                                          \
    }
#define print_message(...) printf(__VA_ARGS__)
#define fail_msg(...) (printf("%s:%d: ", __FILE__, __LINE__), printf(__VA_ARGS__), printf("\n"), exit(1))
#define assert_true(condition) ((condition) ? (void)0 : fail_msg("not true: %s", #condition))
#define assert_false(condition) assert_true(!(condition))
#define assert_int_equal(a, b)                                                                               \
    ((long)(a) == (long)(b) ? (void)0 : fail_msg("%s: %ld, not %ld", #a, (long)(a), (long)(b)))
#define cmocka_run_group_tests(tests, setup, teardown) run_all(tests, sizeof(tests) / sizeof(tests)[0])

static int run_all(const struct CMUnitTest *tests, size_t n)
{
    void *state = NULL;
    for (size_t i = 0; i < n; i++) {
        tests[i].run(&state);
        printf("ok %s\n", tests[i].name);
    }
    return 0;
}

#endif
