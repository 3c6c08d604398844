/* Reading files: from their beginning to their end, or at a place. */
#ifndef RX_BASE_INPUT_H
#define RX_BASE_INPUT_H

#include <stdint.h>
#include <stdio.h>
#include <sys/types.h>

/* fopen(path, "rb"), where neither opening nor reading stops the program for good: a FIFO whose writer has not come, or
 * sleeps, and a terminal wait as one does, but no longer than until a signal is pending that ends the program: then
 * reading fails, for rx_interrupt_check() to say why. Only files have a number (fileno()) and places (fseek()).
 * NULL and errno, EISDIR for a folder, where it cannot be opened. */
FILE *rx_input_open(const char *path);

/* n bytes at that place, or as many as there are before the end; -1 with errno where reading fails. A read that brings less, or
 * that a signal ends, goes on. */
ssize_t rx_input_read(int file, void *dst, size_t n, int64_t place);

#endif
