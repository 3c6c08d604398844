/* The program's own malloc() and its like, which all libraries call: those of the C library (or of what is loaded before
 * it), and a reserve where these refuse (base/memory.h). Not under a sanitizer, which has to be the only one to do so. */
#include "base/memory.h"

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
#include <pthread.h>
#include <stdalign.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

/* LARGE: what libraries have by the MB (planes, stacks of pixels) they know how to be refused; all that FFTW, wcslib
 * and OpenMP ask for at a time is below 300 kB, but sep's deblending takes 1 MB a thread, and frees what it has not when that is
 * refused. RESERVE: some of these, as we stop at our own next request. */
enum { RESERVE = 8 << 20, LARGE = 2 << 20, ALIGNMENT = 64 };

/* Block behind block of the program's zeroed data, whose pages are not there before they are touched. */
static struct {
    pthread_mutex_t lock;
    size_t used;
    int blocks;
    alignas(ALIGNMENT) char room[RESERVE];
} reserve = {.lock = PTHREAD_MUTEX_INITIALIZER};

/* What stands before every block. */
typedef union head {
    size_t bytes;
    alignas(ALIGNMENT) char room[ALIGNMENT];
} head;

/* So many bytes that hold zeros, aligned to 64; NULL for large requests, and where the reserve is used up. */
static void *take(size_t bytes)
{
    head *block = NULL;
    if (bytes >= LARGE)
        return NULL;
    const size_t size = sizeof *block + (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    pthread_mutex_lock(&reserve.lock);
    rx_memory_refuse();
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

static bool is_of_reserve(const void *ptr)
{
    return (uintptr_t)ptr >= (uintptr_t)reserve.room && (uintptr_t)ptr < (uintptr_t)reserve.room + RESERVE;
}

static size_t size_of(const void *ptr)
{
    return ((const head *)ptr - 1)->bytes;
}

/* It begins anew when all blocks have come back. */
static void give_back(void)
{
    pthread_mutex_lock(&reserve.lock);
    if (--reserve.blocks == 0)
        reserve.used = 0;
    pthread_mutex_unlock(&reserve.lock);
}

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
    (void)rx_memory_end(RX_OK, NULL); /* what dlsym() took */
    return true;
}

void *malloc(size_t bytes)
{
    void *made = is_found() ? next.malloc(bytes) : NULL;
    return made != NULL ? made : take(bytes);
}

void *calloc(size_t n, size_t size)
{
    size_t bytes;
    if (__builtin_mul_overflow(n, size, &bytes)) {
        errno = ENOMEM;
        return NULL;
    }
    void *made = is_found() ? next.calloc(n, size) : NULL;
    return made != NULL ? made : take(bytes);
}

void *realloc(void *old, size_t bytes)
{
    if (old == NULL)
        return malloc(bytes);
    const bool held = is_of_reserve(old);
    void *made = held ? malloc(bytes) : next.realloc(old, bytes);
    if (held && made != NULL) {
        memcpy(made, old, size_of(old) < bytes ? size_of(old) : bytes);
        give_back();
    } else if (made == NULL && !held && bytes > 0 && (made = take(bytes)) != NULL) {
        const size_t size = next.malloc_usable_size(old);
        memcpy(made, old, size < bytes ? size : bytes);
        next.free(old);
    }
    return made;
}

void *memalign(size_t alignment, size_t bytes)
{
    void *made = is_found() ? next.memalign(alignment, bytes) : NULL;
    return made != NULL || alignment > 64 ? made : take(bytes);
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
    return is_of_reserve(ptr) ? size_of(ptr) : is_found() ? next.malloc_usable_size(ptr) : 0;
}

void free(void *ptr)
{
    if (is_of_reserve(ptr))
        give_back();
    else if (ptr != NULL)
        next.free(ptr);
}

#endif
