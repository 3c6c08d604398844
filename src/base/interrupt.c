/* Pending signals as an ordinary error. */
#include "base/interrupt.h"

#include <pthread.h>
#include <signal.h>

#include "base/memory.h"

/* what a terminal, a shell and batch systems send: Slurm and PBS announce the end of a job's time as they are asked
 * to, mostly by one of the users' signals, and the kernel that of its processor time */
static const int ending[] = {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGXCPU};
enum { NENDING = sizeof ending / sizeof ending[0] };

/* Signals that the parent had us ignore (nohup, background jobs) stay ignored: blocked, they would
 * become pending all the same. */
static sigset_t ending_signals(void)
{
    sigset_t set;
    sigemptyset(&set);
    for (int i = 0; i < NENDING; i++) {
        struct sigaction action;
        if (sigaction(ending[i], NULL, &action) == 0 && action.sa_handler != SIG_IGN)
            sigaddset(&set, ending[i]);
    }
    return set;
}

void rx_interrupt_block(void)
{
    sigset_t set = ending_signals();
    pthread_sigmask(SIG_BLOCK, &set, NULL);
}

void rx_interrupt_deliver(void)
{
    sigset_t set = ending_signals();
    pthread_sigmask(SIG_UNBLOCK, &set, NULL);
}

void rx_interrupt_forget(void)
{
    for (int i = 0; i < NENDING; i++)
        signal(ending[i], SIG_IGN);
}

bool rx_interrupt_pending(void)
{
    sigset_t set;
    if (sigpending(&set) != 0)
        return false;
    for (int i = 0; i < NENDING; i++)
        if (sigismember(&set, ending[i]) == 1)
            return true;
    return false;
}

rx_status rx_interrupt_check(rx_error *err)
{
    if (err != NULL && err->stop != NULL && err->stop(err->user))
        return rx_error_set(err, RX_INTERRUPTED, "stopped by the caller");
    if (rx_memory_is_refused())
        return rx_error_memory(err, 0);
    if (!rx_interrupt_pending())
        return RX_OK;
    return rx_error_set(err, RX_INTERRUPTED, "interrupted by a signal; nothing was written");
}
