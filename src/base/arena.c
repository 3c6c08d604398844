/* Chunks in a list; what is larger than one has a chunk of its own. */
#include "base/arena.h"

#include <stdint.h>
#include <stdlib.h>

#include "base/memory.h"

enum { ALIGNMENT = 64, CHUNK = 16384 };

struct rx_arena_chunk {
    struct rx_arena_chunk *before;
    size_t used, size; /* bytes behind the head, which fills the first ALIGNMENT of them */
};

void *rx_arena_take(rx_arena *arena, size_t count, size_t size)
{
    if (size > 0 && count > (SIZE_MAX - 2 * ALIGNMENT) / size)
        return NULL;
    const size_t bytes = (count * size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    struct rx_arena_chunk *chunk = arena->last;
    if (chunk == NULL || bytes > chunk->size - chunk->used) {
        const size_t room = bytes > CHUNK ? bytes : CHUNK;
        chunk = rx_alloc(ALIGNMENT + room, 1);
        if (chunk == NULL)
            return NULL;
        chunk->before = arena->last;
        chunk->size = room;
        arena->last = chunk;
    }
    unsigned char *at = (unsigned char *)chunk + ALIGNMENT + chunk->used;
    chunk->used += bytes;
    return at;
}

void rx_arena_free(rx_arena *arena)
{
    while (arena->last != NULL) {
        struct rx_arena_chunk *before = arena->last->before;
        free(arena->last);
        arena->last = before;
    }
}
