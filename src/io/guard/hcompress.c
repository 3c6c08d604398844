/* The H-transform's coefficients lie in four quadrants of the plane; each sends its bit planes, from the
 * highest on, as they are or as a quadtree: a word of four bits says which quarters hold a one, and only
 * those are sent at the next level. The signs of all that are not zero follow. */
#include "io/guard/guard.h"

#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { HEADER = 2 + 3 * 4 + 8, MAX_PLANES = 64 };

typedef struct stream {
    const unsigned char *data;
    uint64_t at, end; /* in bits */
} stream;

/* The next n <= 8 bits, zeros behind the end. */
static unsigned peek(const stream *s, unsigned n)
{
    const uint64_t byte = s->at / 8;
    unsigned two = byte < s->end / 8 ? s->data[byte] * 256u : 0;
    if (byte + 1 < s->end / 8)
        two |= s->data[byte + 1];
    return two >> (16 - s->at % 8 - n) & ((1u << n) - 1);
}

static bool skip(stream *s, uint64_t n)
{
    if (s->end - s->at < n)
        return false;
    s->at += n;
    return true;
}

/* -1: the stream is at its end. */
static int take_four(stream *s)
{
    const unsigned value = peek(s, 4);
    return skip(s, 4) ? (int)value : -1;
}

/* Words of a quadtree have codes of 3 to 6 bits: 000 to 011, 1000 to 1100, 11010 to 11110, 111110, 111111. */
static int take_code(stream *s)
{
    static const struct {
        unsigned bits, first, n;
        unsigned char word[5];
    } lengths[] = {{3, 0, 4, {1, 2, 4, 8}},
                   {4, 8, 5, {3, 5, 10, 12, 15}},
                   {5, 26, 5, {6, 7, 9, 11, 13}},
                   {6, 62, 2, {0, 14}}};
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        const unsigned code = peek(s, lengths[i].bits) - lengths[i].first;
        if (code < lengths[i].n)
            return skip(s, lengths[i].bits) ? lengths[i].word[code] : -1;
    }
    return -1;
}

/* A rectangle of the plane, and room for the words of two levels of its tree. */
typedef struct quadrant {
    size_t nx, ny;         /* ny: along the rows */
    unsigned char *filled; /* nx * ny: 1 where any bit plane has a one */
    unsigned char *words, *parents;
} quadrant;

static size_t parts(size_t n, size_t size)
{
    return (n + size - 1) / size;
}

/* Has the part at (i, j) of a level a one, by the words of the level above? ny: words in its rows. */
static bool is_filled(const unsigned char *parents, size_t i, size_t j, size_t ny)
{
    return parents[i / 2 * ny + j / 2] >> (3 - 2 * (i % 2) - j % 2) & 1;
}

/* From one word for all down to one for each 2 x 2 coefficients; a level's words come in reverse. */
static bool take_tree(stream *s, quadrant *q)
{
    size_t size = 2;
    while (size < q->nx || size < q->ny)
        size *= 2;
    int word = take_code(s);
    q->words[0] = (unsigned char)word;
    for (size /= 2; size >= 2 && word >= 0; size /= 2) {
        const size_t nx = parts(q->nx, size), ny = parts(q->ny, size);
        unsigned char *parents = q->words;
        q->words = q->parents;
        q->parents = parents;
        for (size_t k = nx * ny; k > 0 && word >= 0; k--) {
            const bool sent = is_filled(parents, (k - 1) / ny, (k - 1) % ny, parts(q->ny, 2 * size));
            word = sent ? take_code(s) : 0;
            q->words[k - 1] = (unsigned char)word;
        }
    }
    return word >= 0;
}

static bool take_direct(stream *s, quadrant *q)
{
    const size_t n = parts(q->nx, 2) * parts(q->ny, 2);
    for (size_t k = 0; k < n; k++) {
        const int word = take_four(s);
        if (word < 0)
            return false;
        q->words[k] = (unsigned char)word;
    }
    return true;
}

static bool take_plane(stream *s, quadrant *q)
{
    enum { DIRECT = 0, TREE = 15 };
    const int kind = take_four(s);
    if (kind != DIRECT && kind != TREE)
        return false;
    if (kind == DIRECT ? !take_direct(s, q) : !take_tree(s, q))
        return false;
    for (size_t i = 0; i < q->nx; i++)
        for (size_t j = 0; j < q->ny; j++)
            q->filled[i * q->ny + j] |= is_filled(q->words, i, j, parts(q->ny, 2));
    return true;
}

/* *signs grows by the coefficients that are not zero. */
static bool take_quadrant(stream *s, quadrant *q, unsigned planes, uint64_t *signs)
{
    memset(q->filled, 0, q->nx * q->ny);
    for (unsigned plane = 0; plane < planes; plane++)
        if (!take_plane(s, q))
            return false;
    for (size_t k = 0; k < q->nx * q->ny; k++)
        *signs += q->filled[k];
    return true;
}

/* Four quadrants, a word of zero, and from the next byte on a bit for each sign. */
static bool take_all(stream *s, quadrant *q, size_t nx, size_t ny, const unsigned char planes[3])
{
    uint64_t signs = 0;
    for (int k = 0; k < 4; k++) {
        q->nx = k / 2 == 0 ? parts(nx, 2) : nx / 2;
        q->ny = k % 2 == 0 ? parts(ny, 2) : ny / 2;
        if (!take_quadrant(s, q, planes[(k + 1) / 2], &signs))
            return false;
    }
    return take_four(s) == 0 && skip(s, (8 - s->at % 8) % 8 + signs);
}

rx_status rx_hcompress_walk(const unsigned char *data, size_t length, int64_t pixels, size_t *used,
                            rx_error *err)
{
    uint64_t axis[2] = {0, 0};
    *used = 0;
    if (length < HEADER + 3 || data[0] != 0xdd || data[1] != 0x99)
        return RX_OK;
    for (int i = 0; i < 8; i++)
        axis[i / 4] = axis[i / 4] << 8 | data[2 + i];
    const unsigned char *planes = data + HEADER;
    /* quadrants of no pixels would make cfitsio write before its memory */
    if (pixels < 0 || axis[0] * axis[1] != (uint64_t)pixels || axis[0] < 2 || axis[1] < 2 ||
        planes[0] > MAX_PLANES || planes[1] > MAX_PLANES || planes[2] > MAX_PLANES)
        return RX_OK;
    const size_t nx = parts((size_t)axis[0], 2), ny = parts((size_t)axis[1], 2),
                 words = parts(nx, 2) * parts(ny, 2);
    unsigned char *room = rx_alloc(nx * ny + 2 * words, 1);
    if (room == NULL)
        return rx_error_memory(err, nx * ny + 2 * words);
    quadrant q = {.filled = room, .words = room + nx * ny, .parents = room + nx * ny + words};
    stream s = {.data = data, .at = 8 * (uint64_t)(HEADER + 3), .end = 8 * (uint64_t)length};
    if (take_all(&s, &q, (size_t)axis[0], (size_t)axis[1], planes))
        *used = (size_t)((s.at + 7) / 8);
    free(room);
    return RX_OK;
}
