/* Allocation that cannot overflow. */
#include "base/memory.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <sys/mman.h>

enum { ALIGNMENT = 64 };
/* PAGE is a multiple of every usual page size, HUGE of the next larger one, LARGE what malloc maps anew each
 * time, PART taken at a time. */
enum { PAGE = 1 << 16, HUGE = 2 << 20, LARGE = 32 << 20, PART = 8 << 20 };

/* What was in a large block is given back to the system rather than overwritten: its pages come as zeros when
 * they are first touched, and those of a plane that stays empty never do. */
static void *alloc_large(size_t bytes)
{
    bytes = (bytes + PAGE - 1) / PAGE * PAGE;
    void *ptr = aligned_alloc(PAGE, bytes);
    if (ptr != NULL && madvise(ptr, bytes, MADV_DONTNEED) != 0)
        memset(ptr, 0, bytes);
    return ptr;
}

static void *alloc_zeroed(size_t bytes, size_t alignment)
{
    bytes = (bytes + alignment - 1) / alignment * alignment;
    void *ptr = aligned_alloc(alignment, bytes);
#ifdef MADV_HUGEPAGE
    if (ptr != NULL && alignment == HUGE)
        (void)madvise(ptr, bytes, MADV_HUGEPAGE); /* a wish: the system may have none, or not be asked */
#endif
    if (ptr != NULL)
        memset(ptr, 0, bytes);
    return ptr;
}

/* Of a tile of a Mpixel or two, being given the planes page by page costs more than reading it does: these
 * ask for huge pages. Larger planes do not, as whole huge pages have to be found (and, under a hypervisor,
 * fetched) for them where small ones are at hand. */
void *rx_alloc(size_t count, size_t size)
{
    if (size != 0 && count > (SIZE_MAX - LARGE) / size)
        return NULL;
    const size_t bytes = count * size;
    if (bytes >= LARGE)
        return alloc_large(bytes);
    if (bytes >= HUGE)
        return alloc_zeroed(bytes, HUGE);
    return alloc_zeroed(bytes > 0 ? bytes : 1, ALIGNMENT);
}

void *rx_alloc_filled(size_t count, size_t size, int nthreads)
{
    char *ptr = rx_alloc(count, size);
#ifdef MADV_POPULATE_WRITE
    if (ptr == NULL || count * size < LARGE)
        return ptr;
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1)
    for (size_t at = 0; at < count * size; at += PART) /* what fails comes when it is touched */
        (void)madvise(ptr + at, count * size - at < PART ? count * size - at : PART, MADV_POPULATE_WRITE);
#else
    (void)nthreads;
#endif
    return ptr;
}

void *rx_regrow(void *ptr, size_t count, size_t size)
{
    if (size != 0 && count > SIZE_MAX / size)
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
    char *copy = malloc(bytes);
    if (copy != NULL)
        memcpy(copy, text, bytes);
    return copy;
}
