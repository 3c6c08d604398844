/* Memory for libraries. Some end the process where a small request is refused (FFTW's planner, OpenMP's runtime), read
 * through the null pointer (wcslib, sep), or go on without what they could not have. The programs therefore answer a
 * request that the system refuses out of a reserve, if it is small (src/programs/reserve.c): the library's call ends as
 * ever, and everything of ours that comes next fails for want of memory: rx_alloc(), rx_interrupt_check(), the end of
 * a tile. In a process with another main program nothing calls these, and it is as its allocator has it. */
#ifndef RX_BASE_RESERVE_H
#define RX_BASE_RESERVE_H

#include <stdbool.h>
#include <stddef.h>

#include "base/error.h"

/* So many bytes that hold zeros, aligned to 64; NULL for large requests, and where the reserve is used up. */
void *rx_reserve_take(size_t bytes);

/* Is it out of the reserve? Then it may be given back, and has at least so many bytes. */
bool rx_reserve_holds(const void *ptr);
void rx_reserve_give(void *ptr);
size_t rx_reserve_size(const void *ptr);

/* The system has refused memory, and what is done now must not go on. */
bool rx_reserve_is_needed(void);

/* The end of a tile, or of a program: what went wrong since memory was refused went wrong for want of it. The next tile
 * may have what it asks for. */
rx_status rx_reserve_end(rx_status status, rx_error *err);

#endif
