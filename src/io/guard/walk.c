/* From header to header through a FITS file. */
#include "io/guard/guard.h"

#include <errno.h>
#include <fitsio2.h> /* ffgbyt() */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/input.h"
#include "io/cards.h"

enum { MAX_BLOCKS = 4096 };

static const char END[] = "END                                                                             ";

static bool is_key(const char *card, const char *key)
{
    return strncmp(card, key, strlen(key)) == 0 && strncmp(card + 8, "= ", 2) == 0;
}

static int64_t number(const char *card)
{
    char text[RX_CARD - 9];
    memcpy(text, card + 10, RX_CARD - 10);
    text[RX_CARD - 10] = '\0';
    return strtoll(text, NULL, 10);
}

/* What decides where the next header begins (FITS standard 4.0, section 4.4.1). */
typedef struct layout {
    int64_t bitpix, naxis, product, pcount, gcount;
    bool is_empty, is_grouped; /* NAXIS1 is 0; which does not count with random groups */
} layout;

/* The length of an axis that NAXIS counts; others may be left over. */
static void take_axis(layout *dst, const char *card)
{
    const long axis = strtol(card + 5, NULL, 10);
    const int64_t length = number(card);
    if (axis == 1 && length == 0)
        dst->is_empty = true;
    else if (axis <= dst->naxis && __builtin_mul_overflow(dst->product, length, &dst->product))
        dst->product = -1;
}

int64_t rx_fits_data_bytes(const char *cards, size_t n)
{
    layout l = {.product = 1, .gcount = 1};
    int64_t bytes, size = 0;
    for (const char *card = cards; card < cards + n * RX_CARD; card += RX_CARD)
        if (is_key(card, "BITPIX  "))
            l.bitpix = number(card);
        else if (is_key(card, "NAXIS   "))
            l.naxis = number(card);
        else if (is_key(card, "PCOUNT  "))
            l.pcount = number(card);
        else if (is_key(card, "GCOUNT  "))
            l.gcount = number(card);
        else if (is_key(card, "GROUPS  "))
            l.is_grouped = memchr(card + 10, 'T', 20) != NULL;
        else if (is_key(card, "NAXIS"))
            take_axis(&l, card);
    if (l.naxis == 0)
        return 0;
    if (l.bitpix == 8 || l.bitpix == 16 || l.bitpix == 32 || l.bitpix == 64 || l.bitpix == -32 ||
        l.bitpix == -64)
        size = labs((long)l.bitpix) / 8;
    const int64_t product = l.is_empty && !l.is_grouped ? 0 : l.product;
    if (size == 0 || product < 0 || l.pcount < 0 || l.gcount < 0 ||
        __builtin_add_overflow(product, l.pcount, &bytes) ||
        __builtin_mul_overflow(bytes, l.gcount, &bytes) || __builtin_mul_overflow(bytes, size, &bytes) ||
        bytes > INT64_MAX - RX_FITS_BLOCK)
        return -1;
    return (bytes + RX_FITS_BLOCK - 1) / RX_FITS_BLOCK * RX_FITS_BLOCK;
}

/* Of the data behind a header. */
static int64_t bytes_behind(const rx_fits_header *header)
{
    return rx_fits_data_bytes(header->cards.data, header->cards.length / RX_CARD);
}

/* Where blocks are read: a descriptor, or a file that cfitsio has open. */
typedef struct source {
    int plain;
    fitsfile *open;
    bool unreadable; /* not the end of the file: the disk */
} source;

static bool read_block(source *s, LONGLONG place, char *block)
{
    int failed = 0;
    if (s->open == NULL) {
        const ssize_t n = rx_input_read(s->plain, block, RX_FITS_BLOCK, place);
        s->unreadable = n < 0 && errno != EINVAL && errno != EOVERFLOW; /* no file has such a place */
        return n == RX_FITS_BLOCK;
    }
    ffmbyt(s->open, place, REPORT_EOF, &failed);
    ffgbyt(s->open, RX_FITS_BLOCK, block, &failed);
    s->unreadable = rx_fits_is_unreadable(failed);
    return failed == 0;
}

/* Reads the header at *place, as cfitsio may see it, and moves that behind it. *whole: it is one, with END before
 * the end of the file. Only memory fails. */
static rx_status read_header(source *s, LONGLONG *place, rx_fits_header *dst, bool *whole, rx_error *err)
{
    char block[RX_FITS_BLOCK];
    dst->cards.length = 0;
    dst->fault[0] = '\0';
    dst->is_rebuilt = *whole = false;
    for (int b = 0; !*whole; b++, *place += RX_FITS_BLOCK) {
        if (!read_block(s, *place, block) ||
            (b == 0 && strncmp(block, "SIMPLE  ", 8) != 0 && strncmp(block, "XTENSION", 8) != 0))
            break;
        if (b == MAX_BLOCKS) {
            snprintf(dst->fault, sizeof dst->fault,
                     "its header has no END within %d blocks; the file is damaged", MAX_BLOCKS);
            return RX_OK;
        }
        for (int i = 0; i < RX_FITS_BLOCK && !*whole; i += RX_CARD) {
            *whole = rx_fits_is_end(block + i);
            if (*whole)
                dst->is_rebuilt = strncmp(block + i, END, RX_CARD) != 0;
            else
                rx_text_add_bytes(&dst->cards, block + i, RX_CARD);
        }
    }
    if (dst->cards.failed)
        return rx_error_memory(err, dst->cards.length);
    return dst->cards.length > 0 ? rx_fits_header_rebuild(dst, err) : RX_OK;
}

bool rx_fits_is_unreadable(int failed)
{
    return failed == READ_ERROR || failed == SEEK_ERROR;
}

static rx_status refuse(const source *s, rx_fits_header *header, const char *path, int hdu, rx_error *err)
{
    if (s->unreadable)
        return rx_error_at(err, RX_INPUT, path, hdu, 0, "its header cannot be read from the disk");
    rx_text_tame(header->fault); /* it may quote a damaged card */
    return header->fault[0] == '\0' ? RX_OK : rx_error_at(err, RX_INPUT, path, hdu, 0, "%s", header->fault);
}

/* The header at that place of a file in memory becomes what cfitsio may see. */
static rx_status write_header(int file, LONGLONG place, rx_fits_header *header, bool whole, const char *path,
                              rx_error *err)
{
    if (whole)
        rx_text_add_bytes(&header->cards, END, RX_CARD);
    if (header->cards.failed)
        return rx_error_memory(err, header->cards.length);
    if (pwrite(file, header->cards.data, header->cards.length, (off_t)place) != (ssize_t)header->cards.length)
        return rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be held in memory: %s", strerror(errno));
    return RX_OK;
}

rx_status rx_fits_walk(int file, bool mend, const char *path, bool *odd, rx_error *err)
{
    source s = {.plain = file};
    rx_fits_header header = {0};
    rx_status status = RX_OK;
    LONGLONG place = 0;
    bool whole = true;
    *odd = false;
    for (int hdu = 0; whole; hdu++) {
        const LONGLONG begin = place;
        RX_TRY_EXIT(read_header(&s, &place, &header, &whole, err));
        RX_TRY_EXIT(refuse(&s, &header, path, hdu, err));
        *odd |= header.is_rebuilt;
        if (header.is_rebuilt && mend)
            RX_TRY_EXIT(write_header(file, begin, &header, whole, path, err));
        const int64_t bytes = bytes_behind(&header);
        if (bytes < 0 || __builtin_add_overflow(place, bytes, &place))
            break;
    }
exit:
    rx_text_free(&header.cards);
    return status;
}

int64_t rx_fits_walk_selected(int file, int64_t size, int64_t *place)
{
    source s = {.plain = file};
    rx_fits_header header = {0};
    int64_t enough = 0;
    for (LONGLONG at = *place; at <= INT64_MAX - RX_FITS_BLOCK;) {
        bool whole = false;
        if (at + RX_FITS_BLOCK > size) {
            enough = at + RX_FITS_BLOCK;
            break;
        }
        if (read_header(&s, &at, &header, &whole, NULL) != RX_OK)
            break;
        if (!whole && at + RX_FITS_BLOCK > size) {
            enough = at + RX_FITS_BLOCK;
            break;
        }
        const int64_t bytes = bytes_behind(&header);
        if (!whole || header.fault[0] != '\0' || bytes < 0 || __builtin_add_overflow(at, bytes, &at))
            break;
        *place = at;
    }
    rx_text_free(&header.cards);
    return enough;
}

rx_status rx_fits_walk_open(fitsfile *file, const char *path, int *failed, rx_error *err)
{
    source s = {.open = file};
    rx_fits_header header = {0};
    rx_status status = RX_OK;
    int ignored = 0, end = 0;
    bool whole = true;
    *failed = 0;
    for (int hdu = 1; whole && !end; hdu++) {
        LONGLONG place = file->Fptr->headstart[hdu]; /* known as soon as cfitsio has read the HDU before */
        if (place <= file->Fptr->headstart[hdu - 1])
            RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, hdu - 1, 0,
                                    "ends before it begins, by its size; the header is damaged"));
        RX_TRY_EXIT(read_header(&s, &place, &header, &whole, err));
        RX_TRY_EXIT(refuse(&s, &header, path, hdu, err));
        if (header.is_rebuilt)
            RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, hdu, 0,
                                    "its header is not as the standard has it; unpack the file"));
        fits_movabs_hdu(file, hdu + 1, NULL, &end);
    }
    *failed = rx_fits_is_unreadable(end) ? end : 0;
exit:
    if (*failed == 0)
        fits_clear_errmsg();
    fits_movabs_hdu(file, 1, NULL, &ignored);
    rx_text_free(&header.cards);
    return status;
}
