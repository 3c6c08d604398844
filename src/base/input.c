/* Reading from files and FIFOs. */
#include "base/input.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <stdint.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/interrupt.h"

enum { SLICE = 100 }; /* ms between two looks at the signals, which are blocked and end no call */

static ssize_t read_when_there(void *cookie, char *dst, size_t size)
{
    struct pollfd source = {.fd = (int)(intptr_t)cookie, .events = POLLIN};
    while (!rx_interrupt_pending()) {
        if (poll(&source, 1, SLICE) <= 0)
            continue;
        const ssize_t n = read(source.fd, dst, size);
        if (n >= 0 || (errno != EAGAIN && errno != EINTR))
            return n;
    }
    errno = EINTR;
    return -1;
}

static int close_source(void *cookie)
{
    return close((int)(intptr_t)cookie);
}

FILE *rx_input_open(const char *path)
{
    struct stat info = {0};
    const int file = open(path, O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC);
    FILE *stream = NULL;
    if (file < 0)
        return NULL;
    if (fstat(file, &info) == 0 && S_ISDIR(info.st_mode))
        errno = EISDIR;
    else if (S_ISREG(info.st_mode))
        stream = fdopen(file, "rb");
    else
        stream = fopencookie((void *)(intptr_t)file, "rb",
                             (cookie_io_functions_t){.read = read_when_there, .close = close_source});
    if (stream == NULL) {
        const int reason = errno;
        close(file);
        errno = reason;
    }
    return stream;
}

ssize_t rx_input_read(int file, void *dst, size_t n, int64_t place)
{
    size_t have = 0;
    while (have < n) {
        const ssize_t more = pread(file, (char *)dst + have, n - have, (off_t)(place + (int64_t)have));
        if (more < 0 && errno != EINTR)
            return -1;
        if (more == 0)
            break;
        have += more > 0 ? (size_t)more : 0;
    }
    return (ssize_t)have;
}
