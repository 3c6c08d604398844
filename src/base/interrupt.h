/* Ctrl-C without global state: the program blocks SIGINT, SIGTERM and SIGHUP at its
 * start, long loops ask whether one is pending and unwind as after any error, so that
 * every temporary file goes; main then unblocks and the signal takes its effect. */
#ifndef RX_BASE_INTERRUPT_H
#define RX_BASE_INTERRUPT_H

#include <stdbool.h>

#include "base/error.h"

void rx_interrupt_block(void);   /* at the start of main */
void rx_interrupt_deliver(void); /* at its end: a pending signal ends the process here */
bool rx_interrupt_pending(void);

/* RX_INTERRUPTED with a text when a signal is pending, else RX_OK. */
rx_status rx_interrupt_check(rx_error *err);

#endif
