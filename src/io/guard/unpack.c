/* Files packed with gzip or bzip2, and plain ones. */
#include "io/guard/guard.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

#if RX_HAVE_BZIP2
#include <bzlib.h>
#endif

#include "base/memory.h"

enum { PIECE = 1 << 20, INPUT = 1 << 16 };

/* Could so much memory be had? Files in memory grow past every limit of a process, until the system kills
 * one. RX_SYSTEM: no. */
static rx_status ask_memory(int64_t bytes, rx_error *err)
{
    void *memory = rx_alloc((size_t)bytes, 1);
    free(memory);
    return memory != NULL ? RX_OK : rx_error_memory(err, (size_t)bytes);
}

/* Why nothing more comes: the end of what was packed, or a fault. */
typedef enum ending { GOES_ON, AT_END, CUT_OFF, DAMAGED, UNREADABLE, NO_MEMORY } ending;

typedef struct packed {
    int (*read)(struct packed *p, char *dst, int size); /* bytes; fewer at the end, which `ending` says */
    FILE *file;
    gzFile gzip;
#if RX_HAVE_BZIP2
    bz_stream bzip2;
    bool has_bzip2;
    char *input;
#endif
    ending ending;
} packed;

/* --- bzip2 --- */

#if RX_HAVE_BZIP2
static ending bzip2_begin(packed *p)
{
    p->input = p->input != NULL ? p->input : RX_NEW(char, INPUT);
    p->has_bzip2 = p->input != NULL && BZ2_bzDecompressInit(&p->bzip2, 0, 0) == BZ_OK;
    return p->has_bzip2 ? GOES_ON : NO_MEMORY;
}

static void bzip2_end(packed *p)
{
    if (p->has_bzip2)
        BZ2_bzDecompressEnd(&p->bzip2);
    p->has_bzip2 = false;
}

/* Streams may follow each other; what else stands behind one is not looked at. */
static int bzip2_read(packed *p, char *dst, int size)
{
    bz_stream *s = &p->bzip2;
    s->next_out = dst;
    s->avail_out = (unsigned)size;
    while (s->avail_out > 0 && p->ending == GOES_ON) {
        if (s->avail_in == 0) {
            s->next_in = p->input;
            s->avail_in = (unsigned)fread(p->input, 1, INPUT, p->file);
            if (s->avail_in == 0)
                p->ending = ferror(p->file) ? UNREADABLE : p->has_bzip2 ? CUT_OFF : AT_END;
        }
        if (p->ending == GOES_ON && !p->has_bzip2)
            p->ending = *s->next_in == 'B' ? bzip2_begin(p) : AT_END;
        if (p->ending != GOES_ON)
            break;
        const int code = BZ2_bzDecompress(s);
        if (code == BZ_STREAM_END)
            bzip2_end(p); /* what of the input is not used stays in the struct */
        else if (code != BZ_OK)
            p->ending = code == BZ_MEM_ERROR ? NO_MEMORY : DAMAGED;
    }
    return size - (int)s->avail_out;
}
#endif

/* --- all --- */

static int gzip_read(packed *p, char *dst, int size)
{
    int failed = Z_OK;
    const int n = gzread(p->gzip, dst, (unsigned)size);
    gzerror(p->gzip, &failed);
    if (failed != Z_OK)
        p->ending = failed == Z_BUF_ERROR   ? CUT_OFF
                    : failed == Z_MEM_ERROR ? NO_MEMORY
                    : failed == Z_ERRNO     ? UNREADABLE
                                            : DAMAGED;
    else if (n < size)
        p->ending = AT_END;
    return n;
}

static rx_status begin(packed *p, const char *path, rx_error *err)
{
    unsigned char head[2] = {0};
    errno = 0;
    p->file = fopen(path, "rb");
    if (p->file == NULL)
        return rx_error_file(err, path, "cannot be opened");
    if (fread(head, 1, sizeof head, p->file) != sizeof head || fseek(p->file, 0, SEEK_SET) != 0)
        return rx_error_file(err, path, "cannot be read");
    if (head[0] == 'B') {
#if RX_HAVE_BZIP2
        p->read = bzip2_read;
        p->ending = bzip2_begin(p);
#else
        return rx_error_at(err, RX_INPUT, path, -1, 0,
                           "is packed by bzip2, whose library this program was built without; unpack it with "
                           "bunzip2");
#endif
    } else {
        p->read = gzip_read;
        p->gzip = gzopen(path, "rb");
        if (p->gzip == NULL)
            return rx_error_file(err, path, "cannot be opened");
        gzbuffer(p->gzip, 1 << 17);
        if (head[0] == 'S' && fseeko(p->file, 0, SEEK_END) == 0) /* a plain one, whose size is known */
            return ask_memory((int64_t)ftello(p->file), err);
    }
    return RX_OK;
}

static void end(packed *p)
{
#if RX_HAVE_BZIP2
    bzip2_end(p);
    free(p->input);
#endif
    if (p->gzip != NULL)
        gzclose(p->gzip);
    if (p->file != NULL)
        fclose(p->file);
}

static rx_status fault(ending ending, const char *path, rx_error *err)
{
    if (ending == NO_MEMORY)
        return rx_error_memory(err, 0);
    if (ending == UNREADABLE)
        return rx_error_file(err, path, "cannot be read");
    return rx_error_at(err, RX_INPUT, path, -1, 0, "cannot be read: the packed file is %s; fetch it again",
                       ending == CUT_OFF ? "cut off" : "damaged");
}

static rx_status unpack(packed *from, const char *path, int to, char *piece, int64_t *size, rx_error *err)
{
    int64_t place = 0, most = 64 * (int64_t)PIECE; /* asked for as it grows, for a header may lie */
    while (rx_fits_walk_selected(to, *size, &place) > *size) {
        if (*size + PIECE > most) {
            most *= 2;
            RX_TRY(ask_memory(most, err));
        }
        const int n = from->ending == GOES_ON ? from->read(from, piece, PIECE) : 0;
        if (from->ending > AT_END)
            return fault(from->ending, path, err);
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
    packed from = {0};
    char *piece;
    *size = 0;
    RX_TRY(RX_MAKE(piece, PIECE, err));
    rx_status status = begin(&from, path, err);
    if (status == RX_OK)
        status = unpack(&from, path, to, piece, size, err);
    end(&from);
    free(piece);
    return status;
}
