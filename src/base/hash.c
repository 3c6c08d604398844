/* Digests by xxHash. */
#include "base/hash.h"

#define XXH_INLINE_ALL /* no library at run time */
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "base/interrupt.h"

_Static_assert(sizeof(XXH3_state_t) <= sizeof(rx_hash) && _Alignof(XXH3_state_t) <= _Alignof(rx_hash),
               "rx_hash has room for the state of the library");

void rx_hash_begin(rx_hash *sum)
{
    memset(sum, 0, sizeof *sum);
    XXH3_128bits_reset((XXH3_state_t *)sum->state);
}

void rx_hash_add(rx_hash *sum, const void *bytes, size_t n)
{
    if (n > 0)
        XXH3_128bits_update((XXH3_state_t *)sum->state, bytes, n);
}

void rx_hash_text(const rx_hash *sum, char dst[RX_HASH_TEXT])
{
    XXH128_canonical_t digest;
    XXH128_canonicalFromHash(&digest, XXH3_128bits_digest((const XXH3_state_t *)sum->state));
    for (size_t i = 0; i < sizeof digest.digest; i++)
        snprintf(dst + 2 * i, 3, "%02x", digest.digest[i]);
}

rx_status rx_hash_file(const char *path, char dst[RX_HASH_TEXT], int *there, rx_error *err)
{
    unsigned char room[1 << 13];
    struct stat info;
    rx_hash sum;
    rx_status status = RX_OK;
    *there = 0;
    if (stat(path, &info) != 0 || !S_ISREG(info.st_mode)) /* opening a pipe would wait for its writer */
        return RX_OK;
    int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0)
        return rx_error_file(err, path, "cannot be opened");
    rx_hash_begin(&sum);
    ssize_t n;
    while (((n = read(file, room, sizeof room)) > 0 || (n < 0 && errno == EINTR)) && status == RX_OK) {
        if (n > 0)
            rx_hash_add(&sum, room, (size_t)n);
        status = rx_interrupt_check(err);
    }
    if (n < 0 && status == RX_OK)
        status = rx_error_file(err, path, "cannot be read");
    close(file);
    rx_hash_text(&sum, dst);
    *there = status == RX_OK;
    return status;
}
