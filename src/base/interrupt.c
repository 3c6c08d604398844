/* Pending signals as an ordinary error. */
#include "base/interrupt.h"

#include <pthread.h>
#include <signal.h>

static sigset_t ending_signals(void)
{
    sigset_t set;
    sigemptyset(&set);
    sigaddset(&set, SIGINT);
    sigaddset(&set, SIGTERM);
    sigaddset(&set, SIGHUP);
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

bool rx_interrupt_pending(void)
{
    sigset_t set;
    if (sigpending(&set) != 0)
        return false;
    return sigismember(&set, SIGINT) == 1 || sigismember(&set, SIGTERM) == 1 ||
           sigismember(&set, SIGHUP) == 1;
}

rx_status rx_interrupt_check(rx_error *err)
{
    if (!rx_interrupt_pending())
        return RX_OK;
    return rx_error_set(err, RX_INTERRUPTED, "interrupted by a signal; nothing was written");
}
