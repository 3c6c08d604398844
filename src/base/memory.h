/* Allocation that cannot overflow: zeroed, aligned to 64 bytes, freed by free(). */
#ifndef RX_BASE_MEMORY_H
#define RX_BASE_MEMORY_H

#include <stdbool.h>
#include <stddef.h>

#include "base/error.h"

/* count * size bytes, zeroed; NULL when the product overflows or memory is out.
 * A count of 0 gives a valid pointer. */
void *rx_alloc(size_t count, size_t size);

/* Typed form: RX_NEW(float, n). */
#define RX_NEW(type, count) ((type *)rx_alloc((count), sizeof(type)))

/* The same for a plane all of which will be written to: when it is large the system is asked for all of its
 * pages at once, by so many threads, which takes half the time of one after the other. */
void *rx_alloc_filled(size_t count, size_t size, int nthreads);

/* Grow (or make, when ptr is NULL) an array; old content kept, the new part is
 * not cleared. NULL on failure, ptr then still belongs to the caller. */
void *rx_regrow(void *ptr, size_t count, size_t size);

/* RX_MAKE(p, n, err): p becomes n zeroed elements of what it points at, as rx_alloc() gives them, or NULL.
 * RX_GROW(p, n, err): p is grown to n of them, as rx_regrow() does; on failure it stays as it was.
 * Either returns RX_OK or what rx_error_memory() says, for RX_TRY. */
#define RX_MAKE(ptr, count, err) rx_make(&(ptr), (count), sizeof *(ptr), (err))
#define RX_GROW(ptr, count, err) rx_grow(&(ptr), (count), sizeof *(ptr), (err))
rx_status rx_make(void *address_of_ptr, size_t count, size_t size, rx_error *err);
rx_status rx_grow(void *address_of_ptr, size_t count, size_t size, rx_error *err);

/* Bytes from .. to - 1 of a block from above are not read again before they are written: as far as they fill
 * whole pages, their memory is the system's until then. */
void rx_memory_spend(void *ptr, size_t from, size_t to);

/* What has been freed in small blocks goes back to the system, as far as its C library can make it. */
void rx_memory_trim(void);

/* Some libraries end the process where a small request is refused (FFTW's planner, OpenMP's runtime), read through the null
 * pointer (wcslib, sep), or go on without what they could not have. The programs therefore answer a request that the system
 * refuses out of a reserve, if it is small (src/programs/reserve.c), and say so here: the library's call ends as ever, and
 * everything of ours that comes next fails for want of memory: rx_alloc(), rx_interrupt_check(), the end of a tile. In a
 * process with another main program nothing does that, and it is as its allocator has it. */
void rx_memory_refuse(void);
bool rx_memory_is_refused(void);

/* The end of a tile, or of a program: what went wrong since memory was refused went wrong for want of it. The next tile
 * may have what it asks for. */
rx_status rx_memory_end(rx_status status, rx_error *err);

/* Copy of a string; NULL when memory is out or text is NULL. */
char *rx_strdup(const char *text);

#endif
