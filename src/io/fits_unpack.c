/* Files packed with gzip. */
#include "io/fits_unpack.h"

#include <errno.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "base/memory.h"
#include "io/fits_walk.h"

enum { FIRST_BYTES = 1 << 20, MOST_BYTES = 1 << 30 };

/* How much to unpack next: all that is wanted, at most as much again as there is, for a header may lie. */
static size_t next_piece(size_t there, int64_t wanted)
{
    const size_t missing = (size_t)wanted - there;
    size_t most = there > FIRST_BYTES ? there : FIRST_BYTES;
    most = most < MOST_BYTES ? most : MOST_BYTES;
    return missing < FIRST_BYTES ? FIRST_BYTES : missing < most ? missing : most;
}

static rx_status unpack(gzFile file, const char *path, size_t extra, void **memory, size_t *size,
                        rx_error *err)
{
    int64_t place = 0, wanted;
    while ((wanted = rx_fits_walk_wanted(*memory, *size, &place)) > (int64_t)*size) {
        const size_t piece = next_piece(*size, wanted);
        void *more = rx_regrow(*memory, *size + piece + extra, 1);
        if (more == NULL)
            return rx_error_memory(err, *size + piece + extra);
        *memory = more;
        const int n = gzread(file, (char *)*memory + *size, (unsigned)piece);
        int failed = Z_OK;
        gzerror(file, &failed);
        if (failed != Z_OK)
            return rx_error_at(err, RX_INPUT, path, -1, 0,
                               "cannot be read: the packed file is %s; fetch it again",
                               failed == Z_BUF_ERROR ? "cut off" : "damaged");
        if (n <= 0)
            break;
        *size += (size_t)n;
    }
    return RX_OK;
}

rx_status rx_fits_unpack(const char *path, size_t extra, void **memory, size_t *size, rx_error *err)
{
    *memory = NULL;
    *size = 0;
    gzFile file = gzopen(path, "rb");
    if (file == NULL)
        return rx_error_at(err, RX_INPUT, path, -1, 0, "cannot be opened: %s", strerror(errno));
    gzbuffer(file, 1 << 17);
    rx_status status = unpack(file, path, extra, memory, size, err);
    gzclose(file);
    if (status != RX_OK) {
        free(*memory);
        *memory = NULL;
        *size = 0;
    }
    return status;
}
