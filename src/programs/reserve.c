/* The program's own malloc() and its like, which all libraries call: those of the C library (or of what is loaded before
 * it), and the reserve where these refuse. Not under a sanitizer, which has to be the only one to do so. */
#include "base/reserve.h"

#if defined(__has_feature)
#define RX_HAS(feature) __has_feature(feature)
#else
#define RX_HAS(feature) 0
#endif

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && !RX_HAS(address_sanitizer) &&         \
    !RX_HAS(thread_sanitizer) && !RX_HAS(memory_sanitizer)

#include <dlfcn.h>
#include <errno.h>
#include <malloc.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* Found at the first call, which comes before main() and any thread. */
static struct {
    void *(*malloc)(size_t bytes);
    void *(*calloc)(size_t n, size_t size);
    void *(*realloc)(void *old, size_t bytes);
    void *(*memalign)(size_t alignment, size_t bytes);
    void (*free)(void *ptr);
    size_t (*malloc_usable_size)(void *ptr);
    bool finding;
} next;

static void find(void *function, const char *name)
{
    void *found = dlsym(RTLD_NEXT, name);
    memcpy(function, &found, sizeof found);
}

/* false: dlsym() itself is asking for memory. */
static bool is_found(void)
{
    if (next.malloc != NULL)
        return true;
    if (next.finding)
        return false;
    next.finding = true;
    find(&next.calloc, "calloc");
    find(&next.realloc, "realloc");
    find(&next.memalign, "memalign");
    find(&next.free, "free");
    find(&next.malloc_usable_size, "malloc_usable_size");
    find(&next.malloc, "malloc");
    (void)rx_reserve_end(RX_OK, NULL); /* what dlsym() took */
    return true;
}

void *malloc(size_t bytes)
{
    void *made = is_found() ? next.malloc(bytes) : NULL;
    return made != NULL ? made : rx_reserve_take(bytes);
}

void *calloc(size_t n, size_t size)
{
    size_t bytes;
    if (__builtin_mul_overflow(n, size, &bytes)) {
        errno = ENOMEM;
        return NULL;
    }
    void *made = is_found() ? next.calloc(n, size) : NULL;
    return made != NULL ? made : rx_reserve_take(bytes);
}

void *realloc(void *old, size_t bytes)
{
    if (old == NULL)
        return malloc(bytes);
    const bool held = rx_reserve_holds(old);
    void *made = held ? malloc(bytes) : next.realloc(old, bytes);
    if (held && made != NULL) {
        memcpy(made, old, rx_reserve_size(old) < bytes ? rx_reserve_size(old) : bytes);
        rx_reserve_give(old);
    } else if (made == NULL && !held && bytes > 0 && (made = rx_reserve_take(bytes)) != NULL) {
        const size_t size = next.malloc_usable_size(old);
        memcpy(made, old, size < bytes ? size : bytes);
        next.free(old);
    }
    return made;
}

void *memalign(size_t alignment, size_t bytes)
{
    void *made = is_found() ? next.memalign(alignment, bytes) : NULL;
    return made != NULL || alignment > 64 ? made : rx_reserve_take(bytes);
}

void *aligned_alloc(size_t alignment, size_t bytes)
{
    return memalign(alignment, bytes);
}

int posix_memalign(void **dst, size_t alignment, size_t bytes)
{
    if (alignment % sizeof(void *) != 0 || alignment == 0 || (alignment & (alignment - 1)) != 0)
        return EINVAL;
    void *made = memalign(alignment, bytes);
    if (made != NULL)
        *dst = made;
    return made != NULL ? 0 : ENOMEM;
}

size_t malloc_usable_size(void *ptr)
{
    return rx_reserve_holds(ptr) ? rx_reserve_size(ptr) : is_found() ? next.malloc_usable_size(ptr) : 0;
}

void free(void *ptr)
{
    if (rx_reserve_holds(ptr))
        rx_reserve_give(ptr);
    else if (ptr != NULL)
        next.free(ptr);
}

#endif
