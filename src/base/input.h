/* Opening what is read from its beginning to its end. */
#ifndef RX_BASE_INPUT_H
#define RX_BASE_INPUT_H

#include <stdio.h>

/* fopen(path, "rb"), where neither opening nor reading stops the program for good: a FIFO whose writer has not come, or
 * sleeps, and a terminal wait as one does, but no longer than until a signal is pending that ends the program: then
 * reading fails, for rx_interrupt_check() to say why. Only files have a number (fileno()) and places (fseek()).
 * NULL and errno, EISDIR for a folder, where it cannot be opened. */
FILE *rx_input_open(const char *path);

#endif
