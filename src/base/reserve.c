/* Block behind block of the program's zeroed data, whose pages are not there before they are touched. */
#include "base/reserve.h"

#include <pthread.h>
#include <stdalign.h>
#include <stdatomic.h>
#include <stdint.h>
#include <string.h>

/* LARGE: what libraries have by the MB (planes, stacks of pixels) they know how to be refused; all that FFTW, wcslib
 * and OpenMP ask for at a time is below 300 kB. RESERVE: ten of these, as we stop at our own next request. */
enum { RESERVE = 4 << 20, LARGE = 1 << 20, ALIGNMENT = 64 };

/* One for the process, as the memory is that it stands in for. */
static struct {
    pthread_mutex_t lock;
    atomic_bool needed;
    size_t used;
    int blocks;
    alignas(ALIGNMENT) char room[RESERVE];
} reserve = {.lock = PTHREAD_MUTEX_INITIALIZER};

/* What stands before every block. */
typedef union head {
    size_t bytes;
    alignas(ALIGNMENT) char room[ALIGNMENT];
} head;

void *rx_reserve_take(size_t bytes)
{
    head *block = NULL;
    if (bytes >= LARGE)
        return NULL;
    const size_t size = sizeof *block + (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    pthread_mutex_lock(&reserve.lock);
    atomic_store(&reserve.needed, true);
    if (size <= RESERVE - reserve.used) {
        block = (head *)(void *)(reserve.room + reserve.used);
        memset(block, 0, size);
        block->bytes = bytes;
        reserve.used += size;
        reserve.blocks++;
    }
    pthread_mutex_unlock(&reserve.lock);
    return block != NULL ? block + 1 : NULL;
}

bool rx_reserve_holds(const void *ptr)
{
    return (uintptr_t)ptr >= (uintptr_t)reserve.room && (uintptr_t)ptr < (uintptr_t)reserve.room + RESERVE;
}

/* It begins anew when all blocks have come back. */
void rx_reserve_give(void *ptr)
{
    (void)ptr;
    pthread_mutex_lock(&reserve.lock);
    if (--reserve.blocks == 0)
        reserve.used = 0;
    pthread_mutex_unlock(&reserve.lock);
}

size_t rx_reserve_size(const void *ptr)
{
    return ((const head *)ptr - 1)->bytes;
}

bool rx_reserve_is_needed(void)
{
    return atomic_load_explicit(&reserve.needed, memory_order_relaxed);
}

rx_status rx_reserve_end(rx_status status, rx_error *err)
{
    if (atomic_exchange(&reserve.needed, false) && status != RX_OK && status != RX_INTERRUPTED)
        return rx_error_memory(err, 0);
    return status;
}
