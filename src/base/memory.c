/* Allocation that cannot overflow. */
#include "base/memory.h"

#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <sys/mman.h>

enum { ALIGNMENT = 64 };
/* PAGE is a multiple of every usual page size, HUGE of the next larger one, LARGE what malloc maps anew each
 * time. */
enum { PAGE = 1 << 16, HUGE = 2 << 20, LARGE = 32 << 20 };

/* One for the process, as the memory is. */
static atomic_bool is_refused;

void rx_memory_refuse(void)
{
    atomic_store(&is_refused, true);
}

bool rx_memory_is_refused(void)
{
    return atomic_load_explicit(&is_refused, memory_order_relaxed);
}

rx_status rx_memory_end(rx_status status, rx_error *err)
{
    if (atomic_exchange(&is_refused, false) && status != RX_OK && status != RX_INTERRUPTED)
        return rx_error_memory(err, 0);
    return status;
}

/* What was in a large block is given back to the system rather than overwritten: its pages come as zeros when
 * they are first touched, by the threads that fill them, and those of a plane that stays empty never do.
 *
 * Of a tile of a Mpixel or two, being given the planes page by page costs more than reading it does: these
 * ask for huge pages. Larger planes do not, as whole huge pages have to be found (and, under a hypervisor,
 * fetched) for them where small ones are at hand. */
void *rx_alloc(size_t count, size_t size)
{
    if (rx_memory_is_refused() || (size != 0 && count > (SIZE_MAX - LARGE) / size))
        return NULL;
    const size_t want = count * size > 0 ? count * size : 1;
    const size_t alignment = want >= LARGE ? PAGE : want >= HUGE ? HUGE : ALIGNMENT;
    const size_t bytes = (want + alignment - 1) / alignment * alignment;
    void *ptr = aligned_alloc(alignment, bytes);
    if (ptr != NULL && (bytes < HUGE || madvise(ptr, bytes, MADV_DONTNEED) != 0))
        memset(ptr, 0, bytes);
#ifdef MADV_HUGEPAGE
    if (ptr != NULL && alignment == HUGE)
        (void)madvise(ptr, bytes, MADV_HUGEPAGE); /* a wish: the system may have none, or not be asked */
#endif
    return ptr;
}

void *rx_alloc_filled(size_t count, size_t size, int nthreads)
{
    char *ptr = rx_alloc(count, size);
#ifdef MADV_POPULATE_WRITE
    if (ptr == NULL || count * size < HUGE)
        return ptr;
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1)
    for (size_t at = 0; at < count * size; at += HUGE) /* what fails comes when it is touched */
        (void)madvise(ptr + at, count * size - at < HUGE ? count * size - at : HUGE, MADV_POPULATE_WRITE);
#else
    (void)nthreads;
#endif
    return ptr;
}

void *rx_regrow(void *ptr, size_t count, size_t size)
{
    if (rx_memory_is_refused() || (size != 0 && count > SIZE_MAX / size))
        return NULL;
    return realloc(ptr, count * size > 0 ? count * size : 1);
}

rx_status rx_make(void *address_of_ptr, size_t count, size_t size, rx_error *err)
{
    void *made = rx_alloc(count, size);
    memcpy(address_of_ptr, &made, sizeof made);
    return made != NULL ? RX_OK : rx_error_memory(err, count * size);
}

rx_status rx_grow(void *address_of_ptr, size_t count, size_t size, rx_error *err)
{
    void *ptr;
    memcpy(&ptr, address_of_ptr, sizeof ptr);
    if ((ptr = rx_regrow(ptr, count, size)) == NULL)
        return rx_error_memory(err, count * size);
    memcpy(address_of_ptr, &ptr, sizeof ptr);
    return RX_OK;
}

void rx_memory_spend(void *ptr, size_t from, size_t to)
{
    char *block = ptr;
    const size_t begin = from + (size_t)(-(uintptr_t)(block + from) & (PAGE - 1));
    const size_t past = (size_t)((uintptr_t)(block + to) & (PAGE - 1));
    if (past < to && begin < to - past)
        (void)madvise(block + begin, to - past - begin,
                      MADV_DONTNEED); /* else it stays, which does no harm */
}

void rx_memory_trim(void)
{
#ifdef __GLIBC__
    (void)malloc_trim(0);
#endif
}

char *rx_strdup(const char *text)
{
    if (text == NULL)
        return NULL;
    size_t bytes = strlen(text) + 1;
    char *copy = rx_memory_is_refused() ? NULL : malloc(bytes);
    if (copy != NULL)
        memcpy(copy, text, bytes);
    return copy;
}
