/* Loaded before all libraries (LD_PRELOAD): each request for memory in the process, of any library, first asks the
 * function that rx_fault_refuse points at. */
#include <errno.h>
#include <malloc.h>
#include <stdlib.h>
#include <string.h>

int (*rx_fault_refuse)(void);

void *__libc_malloc(size_t bytes);
void *__libc_calloc(size_t n, size_t size);
void *__libc_realloc(void *old, size_t bytes);
void *__libc_memalign(size_t alignment, size_t bytes);

/* What the function itself asks for is granted. */
static __thread int asking __attribute__((tls_model("initial-exec")));

static int is_refused(void)
{
    if (rx_fault_refuse == NULL || asking)
        return 0;
    asking = 1;
    const int refused = rx_fault_refuse();
    asking = 0;
    if (refused)
        errno = ENOMEM;
    return refused;
}

void *malloc(size_t bytes)
{
    return is_refused() ? NULL : __libc_malloc(bytes);
}

void *calloc(size_t n, size_t size)
{
    return is_refused() ? NULL : __libc_calloc(n, size);
}

void *realloc(void *old, size_t bytes)
{
    return is_refused() ? NULL : __libc_realloc(old, bytes);
}

void *memalign(size_t alignment, size_t bytes)
{
    return is_refused() ? NULL : __libc_memalign(alignment, bytes);
}

void *aligned_alloc(size_t alignment, size_t bytes)
{
    return memalign(alignment, bytes);
}

int posix_memalign(void **dst, size_t alignment, size_t bytes)
{
    void *made = memalign(alignment, bytes);
    if (made != NULL)
        *dst = made;
    return made != NULL ? 0 : ENOMEM;
}

char *strdup(const char *text)
{
    char *copy = malloc(strlen(text) + 1);
    return copy != NULL ? strcpy(copy, text) : NULL;
}
