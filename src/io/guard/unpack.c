/* Files packed with gzip. */
#include "io/guard/guard.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

#include "base/memory.h"

enum { PIECE = 1 << 20 };

rx_status rx_fits_ask_memory(int64_t bytes, rx_error *err)
{
    void *memory = rx_alloc((size_t)bytes, 1);
    free(memory);
    return memory != NULL ? RX_OK : rx_error_memory(err, (size_t)bytes);
}

static rx_status unpack(gzFile from, const char *path, int to, char *piece, int64_t *size, rx_error *err)
{
    int64_t place = 0, most = 64 * (int64_t)PIECE; /* asked for as it grows, for a header may lie */
    while (rx_fits_walk_selected(to, *size, &place) > *size) {
        int failed = Z_OK;
        if (*size + PIECE > most) {
            most *= 2;
            rx_status status = rx_fits_ask_memory(most, err);
            if (status != RX_OK)
                return status;
        }
        const int n = gzread(from, piece, PIECE);
        gzerror(from, &failed);
        if (failed != Z_OK)
            return rx_error_at(err, RX_INPUT, path, -1, 0,
                               "cannot be read: the packed file is %s; fetch it again",
                               failed == Z_BUF_ERROR ? "cut off" : "damaged");
        if (n <= 0)
            break;
        if (write(to, piece, (size_t)n) != n)
            return rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be unpacked into memory: %s",
                               strerror(errno));
        *size += n;
    }
    return RX_OK;
}

rx_status rx_fits_unpack(const char *path, int to, int64_t *size, rx_error *err)
{
    *size = 0;
    gzFile from = gzopen(path, "rb");
    if (from == NULL)
        return rx_error_at(err, RX_INPUT, path, -1, 0, "cannot be opened: %s", strerror(errno));
    gzbuffer(from, 1 << 17);
    char *piece = RX_NEW(char, PIECE);
    rx_status status = piece != NULL ? unpack(from, path, to, piece, size, err) : rx_error_memory(err, PIECE);
    free(piece);
    gzclose(from);
    return status;
}
