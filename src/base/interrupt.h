/* Ctrl-C without global state: the program blocks the signals that end it (SIGINT, SIGTERM,
 * SIGHUP, SIGQUIT, SIGUSR1, SIGUSR2, SIGALRM, SIGXCPU) at its start, long loops ask whether one is pending
 * and unwind as after any error, so that every temporary file goes; main then unblocks and the signal takes
 * its effect. */
#ifndef RX_BASE_INTERRUPT_H
#define RX_BASE_INTERRUPT_H

#include <stdbool.h>

#include "base/error.h"

void rx_interrupt_block(void);   /* at the start of main */
void rx_interrupt_deliver(void); /* at its end: a pending signal ends the process here */
void rx_interrupt_forget(void);  /* or: what is pending has been heeded */
bool rx_interrupt_pending(void);

/* RX_INTERRUPTED with a text when the caller says stop (err->stop) or a signal is pending, else RX_OK. */
rx_status rx_interrupt_check(rx_error *err);

#endif
