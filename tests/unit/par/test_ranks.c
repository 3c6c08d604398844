/* Ranks as threads: messages in order, copies, ends and failures that hold nobody up, signals. */
#include <pthread.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "par/ranks.h"

enum { NUMBERS = 200, STOP = 7 };

static rx_message receive(rx_ranks *ranks, int wait)
{
    rx_message message;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_ranks_receive(ranks, wait, &message, &err), RX_OK);
    return message;
}

/* Sends back what it is sent, under the same tag, until tag STOP. */
static void echo(void *user, rx_ranks *ranks)
{
    (void)user;
    rx_message message;
    while (rx_ranks_receive(ranks, 1, &message, NULL) == RX_OK && message.tag != STOP)
        rx_ranks_give(ranks, message.from, message.tag, message.data, message.size, NULL);
    if (message.tag == STOP)
        free(message.data);
}

static rx_ranks *start(int generators, rx_rank_run run, void *user)
{
    rx_ranks *ranks = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_ranks_start(1, generators, run, user, &ranks, &err), RX_OK);
    assert_non_null(ranks);
    return ranks;
}

static void a_lone_process_is_rank_0_of_1(void **state)
{
    (void)state;
    assert_int_equal(rx_par_begin(NULL, NULL, NULL), RX_OK);
    assert_int_equal(rx_par_processes(), 1);
    assert_int_equal(rx_par_rank(), 0);
    rx_par_end(RX_OK);
}

static void ranks_are_counted(void **state)
{
    (void)state;
    rx_ranks *ranks = start(3, echo, NULL);
    assert_int_equal(rx_ranks_rank(ranks), 0);
    assert_int_equal(rx_ranks_count(ranks), 4);
    assert_int_equal(rx_ranks_trainers(ranks), 1);
    rx_ranks_stop(ranks); /* the threads see that rank 0 is gone */
    ranks = start(0, echo, NULL);
    assert_int_equal(rx_ranks_count(ranks), 2); /* someone must generate */
    rx_ranks_stop(ranks);
}

static void more_trainers_than_processes_are_refused(void **state)
{
    (void)state;
    rx_ranks *ranks = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_ranks_start(2, 1, echo, NULL, &ranks, &err), RX_USAGE);
    assert_null(ranks);
    assert_non_null(strstr(err.text, "mpiexec -n 3"));
}

static void messages_of_a_sender_arrive_in_order(void **state)
{
    (void)state;
    enum { GENERATORS = 3 };
    int next[GENERATORS + 1] = {0};
    rx_ranks *ranks = start(GENERATORS, echo, NULL);
    for (int i = 0; i < NUMBERS; i++)
        for (int to = 1; to <= GENERATORS; to++)
            assert_int_equal(rx_ranks_send(ranks, to, to, &i, sizeof i, NULL), RX_OK);
    for (int i = 0; i < GENERATORS * NUMBERS; i++) {
        rx_message message = receive(ranks, 1);
        assert_in_range(message.from, 1, GENERATORS);
        assert_int_equal(message.tag, message.from);
        assert_int_equal(message.size, sizeof i);
        assert_int_equal(*(int *)message.data, next[message.from]);
        next[message.from]++;
        free(message.data);
    }
    for (int to = 1; to <= GENERATORS; to++)
        rx_ranks_send(ranks, to, STOP, NULL, 0, NULL);
    rx_ranks_stop(ranks);
}

static void what_is_sent_is_a_copy(void **state)
{
    (void)state;
    char word[] = "before";
    rx_ranks *ranks = start(1, echo, NULL);
    assert_int_equal(rx_ranks_send(ranks, 1, 0, word, sizeof word, NULL), RX_OK);
    memcpy(word, "after.", sizeof word);
    rx_message message = receive(ranks, 1);
    assert_string_equal(message.data, "before");
    free(message.data);
    rx_ranks_stop(ranks);
}

static void what_is_given_travels_without_a_copy(void **state)
{
    (void)state;
    char *word = rx_strdup("word");
    rx_ranks *ranks = start(1, echo, NULL);
    assert_int_equal(rx_ranks_give(ranks, 1, 0, word, 5, NULL), RX_OK);
    rx_message message = receive(ranks, 1);
    assert_ptr_equal(message.data, word);
    free(message.data);
    rx_ranks_stop(ranks);
}

static void nothing_there_is_said_at_once(void **state)
{
    (void)state;
    rx_ranks *ranks = start(2, echo, NULL);
    rx_message message = receive(ranks, 0);
    assert_int_equal(message.from, -1);
    assert_null(message.data);
    assert_int_equal(message.size, 0);
    rx_ranks_stop(ranks);
}

static void unread_messages_are_freed(void **state)
{
    (void)state;
    rx_ranks *ranks = start(2, echo, NULL);
    for (int i = 0; i < NUMBERS; i++)
        rx_ranks_send(ranks, 1 + i % 2, 0, &i, sizeof i, NULL);
    rx_ranks_stop(ranks); /* the leak checker says so where this is wrong */
}

/* Sends one message, then fails with an error that names a file. */
static void fail_loudly(void *user, rx_ranks *ranks)
{
    rx_error err = RX_ERROR_NONE;
    rx_ranks_send(ranks, 0, 1, "x", 2, NULL);
    rx_error_at(&err, RX_INPUT, user, 2, 7, "a table is missing; give another file");
    rx_ranks_fail(ranks, &err);
    rx_ranks_fail(ranks, &err); /* a second time says nothing more */
}

static void a_failure_reaches_who_waits_with_its_words(void **state)
{
    (void)state;
    rx_ranks *ranks = start(1, fail_loudly, "galaxies.fits");
    rx_message message = receive(ranks, 1); /* what was sent before comes first */
    assert_int_equal(message.tag, 1);
    free(message.data);
    for (int again = 0; again < 2; again++) {
        rx_error err = RX_ERROR_NONE;
        assert_int_equal(rx_ranks_receive(ranks, 1, &message, &err), RX_INPUT);
        assert_int_equal(err.status, RX_INPUT);
        assert_string_equal(err.where, "galaxies.fits");
        assert_int_equal(err.hdu, 2);
        assert_int_equal(err.line, 7);
        assert_string_equal(err.text, "a table is missing; give another file");
        assert_null(message.data);
        assert_true(rx_ranks_over(ranks));
    }
    rx_ranks_stop(ranks);
}

static void leave_silently(void *user, rx_ranks *ranks)
{
    (void)user;
    rx_ranks_send(ranks, 0, 1, "x", 2, NULL);
}

static void an_end_without_a_word_is_an_error_too(void **state)
{
    (void)state;
    rx_message message;
    rx_error err = RX_ERROR_NONE;
    rx_ranks *ranks = start(1, leave_silently, NULL);
    message = receive(ranks, 1);
    free(message.data);
    assert_int_equal(rx_ranks_receive(ranks, 1, &message, &err), RX_SYSTEM);
    assert_non_null(strstr(err.text, "rank 1 ended"));
    assert_int_equal(rx_ranks_send(ranks, 1, 1, "x", 2, NULL), RX_OK); /* to nobody */
    rx_ranks_stop(ranks);
}

static void wait_for_an_error(void *user, rx_ranks *ranks)
{
    rx_message message;
    rx_ranks_receive(ranks, 1, &message, user);
}

static void a_trainer_that_fails_tells_generators(void **state)
{
    (void)state;
    rx_error why = RX_ERROR_NONE, heard = RX_ERROR_NONE;
    rx_ranks *ranks = start(1, wait_for_an_error, &heard);
    rx_error_set(&why, RX_SYSTEM, "the disk is full");
    rx_ranks_fail(ranks, &why);
    rx_ranks_stop(ranks);
    assert_int_equal(heard.status, RX_SYSTEM);
    assert_string_equal(heard.text, "the disk is full");
}

static void wait_for_ever(void *user, rx_ranks *ranks)
{
    rx_message message;
    while (rx_ranks_receive(ranks, 1, &message, user) == RX_OK)
        free(message.data);
}

/* In a child: the signal comes from its generator while rank 0 waits. */
static void a_signal_ends_waiting_of_rank_0_alone(void **state)
{
    (void)state;
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) {
        rx_error err = RX_ERROR_NONE, heard = RX_ERROR_NONE;
        rx_ranks *ranks = NULL;
        rx_message message;
        signal(SIGTERM, SIG_DFL);
        rx_interrupt_block();
        if (rx_ranks_start(1, 1, wait_for_ever, &heard, &ranks, NULL) != RX_OK)
            _exit(10);
        kill(getpid(), SIGTERM);
        if (rx_ranks_receive(ranks, 1, &message, &err) != RX_INTERRUPTED || err.status != RX_INTERRUPTED)
            _exit(11);
        rx_ranks_stop(ranks);
        _exit(heard.status == RX_INTERRUPTED ? 12 : 0);
    }
    int how = 0;
    assert_int_equal(waitpid(child, &how, 0), child);
    assert_true(WIFEXITED(how));
    assert_int_equal(WEXITSTATUS(how), 0);
}

static void signals_stay_with_rank_0(void **state)
{
    (void)state;
    pid_t child = fork();
    assert_true(child >= 0);
    if (child == 0) { /* a thread that let it through would end the child here */
        rx_ranks *ranks = NULL;
        signal(SIGTERM, SIG_DFL);
        sigset_t set;
        sigemptyset(&set);
        sigaddset(&set, SIGTERM);
        pthread_sigmask(SIG_UNBLOCK, &set, NULL);
        if (rx_ranks_start(1, 2, wait_for_ever, NULL, &ranks, NULL) != RX_OK)
            _exit(10);
        pthread_sigmask(SIG_BLOCK, &set, NULL);
        kill(getpid(), SIGTERM);
        bool pending = rx_interrupt_pending();
        rx_ranks_stop(ranks);
        _exit(pending ? 0 : 11);
    }
    int how = 0;
    assert_int_equal(waitpid(child, &how, 0), child);
    assert_true(WIFEXITED(how));
    assert_int_equal(WEXITSTATUS(how), 0);
}

static void the_sum_of_one_is_itself(void **state)
{
    (void)state;
    float values[2] = {1.5f, -2};
    double more[1] = {0.25};
    rx_ranks *ranks = start(2, echo, NULL);
    assert_int_equal(rx_ranks_sum(ranks, values, 2, NULL), RX_OK);
    assert_int_equal(rx_ranks_sum_double(ranks, more, 1, NULL), RX_OK);
    assert_true(values[0] == 1.5f);
    assert_true(values[1] == -2);
    assert_true(more[0] == 0.25);
    rx_ranks_stop(ranks);
    rx_ranks_stop(NULL);
}

int main(void)
{
    alarm(120); /* whoever waits for ever ends the test */
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_lone_process_is_rank_0_of_1),
        cmocka_unit_test(ranks_are_counted),
        cmocka_unit_test(more_trainers_than_processes_are_refused),
        cmocka_unit_test(messages_of_a_sender_arrive_in_order),
        cmocka_unit_test(what_is_sent_is_a_copy),
        cmocka_unit_test(what_is_given_travels_without_a_copy),
        cmocka_unit_test(nothing_there_is_said_at_once),
        cmocka_unit_test(unread_messages_are_freed),
        cmocka_unit_test(a_failure_reaches_who_waits_with_its_words),
        cmocka_unit_test(an_end_without_a_word_is_an_error_too),
        cmocka_unit_test(a_trainer_that_fails_tells_generators),
        cmocka_unit_test(a_signal_ends_waiting_of_rank_0_alone),
        cmocka_unit_test(signals_stay_with_rank_0),
        cmocka_unit_test(the_sum_of_one_is_itself),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
