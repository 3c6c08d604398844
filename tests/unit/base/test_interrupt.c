/* A blocked signal becomes an ordinary error, and takes its effect when delivered. */
#include "../near.h"

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/interrupt.h"

static void nothing_pending_is_fine(void **state)
{
    rx_error err = RX_ERROR_NONE;
    rx_interrupt_block();
    assert_false(rx_interrupt_pending());
    assert_int_equal(rx_interrupt_check(&err), RX_OK);
    assert_int_equal(err.status, RX_OK);
}

/* In a child, so that the signal's effect can be watched: it must see the signal as pending, and end by
 * it on delivery and not before. */
static void signal_ends_child_on_delivery_only(int number)
{
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        rx_error err = RX_ERROR_NONE;
        signal(number, SIG_DFL); /* a background job starts with SIGINT ignored */
        rx_interrupt_block();
        raise(number);
        if (!rx_interrupt_pending() || rx_interrupt_check(&err) != RX_INTERRUPTED ||
            err.status != RX_INTERRUPTED || err.text[0] == '\0')
            _exit(10);
        rx_interrupt_deliver();
        _exit(11);
    }
    int how = 0;
    assert_int_equal(waitpid(child, &how, 0), child);
    assert_true(WIFSIGNALED(how));
    assert_int_equal(WTERMSIG(how), number);
}

/* Those of a terminal, of shells, and of batch systems. */
static void signals_wait_for_delivery(void **state)
{
    static const int numbers[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGXCPU};
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        signal_ends_child_on_delivery_only(numbers[i]);
}

static bool at_the_third(void *user)
{
    return ++*(int *)user >= 3;
}

static void the_caller_may_stop_a_call(void **state)
{
    int asked = 0;
    rx_error err = RX_ERROR_NONE;
    err.stop = at_the_third;
    err.user = &asked;
    assert_int_equal(rx_interrupt_check(&err), RX_OK);
    assert_int_equal(rx_interrupt_check(&err), RX_OK);
    assert_int_equal(err.status, RX_OK);
    assert_int_equal(rx_interrupt_check(&err), RX_INTERRUPTED);
    assert_int_equal(err.status, RX_INTERRUPTED);
    assert_string_equal(err.text, "stopped by the caller");
    assert_int_equal(rx_interrupt_check(&err),
                     RX_INTERRUPTED); /* still, where an error was told in between */
    assert_int_equal(asked, 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_pending_is_fine),
        cmocka_unit_test(signals_wait_for_delivery),
        cmocka_unit_test(the_caller_may_stop_a_call),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
