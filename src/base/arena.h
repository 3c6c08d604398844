/* Small objects of one call, freed together: no `free` of each on each way out. */
#ifndef RX_BASE_ARENA_H
#define RX_BASE_ARENA_H

#include <stddef.h>

struct rx_arena_chunk;

/* All 0: empty. One thread at a time. */
typedef struct rx_arena {
    struct rx_arena_chunk *last;
} rx_arena;

/* count * size bytes, zeroed, aligned to 64 bytes, until rx_arena_free(); NULL when the product overflows or memory
 * is out. A count of 0 gives a valid pointer. */
void *rx_arena_take(rx_arena *arena, size_t count, size_t size);

/* Typed form: RX_TAKE(arena, double, n). */
#define RX_TAKE(arena, type, count) ((type *)rx_arena_take((arena), (count), sizeof(type)))

void rx_arena_free(rx_arena *arena);

#endif
