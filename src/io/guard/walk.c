/* From header to header through a FITS file. */
#include "io/guard/guard.h"

#include <errno.h>
#include <fitsio2.h> /* ffgbyt() */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "io/cards.h"
#include "io/fits_file.h"

enum {
    CARD = 80,
    BLOCK = 2880,
    MAX_BLOCKS = 4096,
    TABLE_CARDS = 8,
    MOST_FIELDS = 999,
    LONGEST = 24,
    LONGEST_TEXT = 68,
    MOST_DIGITS = 18
};

static bool is_key(const char *card, const char *key)
{
    return strncmp(card, key, strlen(key)) == 0 && strncmp(card + 8, "= ", 2) == 0;
}

static int64_t number(const char *card)
{
    char text[CARD - 9];
    memcpy(text, card + 10, CARD - 10);
    text[CARD - 10] = '\0';
    return strtoll(text, NULL, 10);
}

/* A number of 64 bits that is not negative, and nothing but a comment behind it. */
static bool is_count(const char *card)
{
    const char *c = card + 10, *end = card + CARD;
    while (c < end && *c == ' ')
        c++;
    const char *digits = c;
    while (c < end && *c >= '0' && *c <= '9')
        c++;
    return c > digits && c - digits <= MOST_DIGITS && (c == end || *c == ' ' || *c == '/');
}

/* Has a keyword that stands for a whole number more than LONGEST characters for a value, or another one of a
 * table more than a text can have? */
static bool is_too_long(const char *card, bool is_table)
{
    static const char *const keys[] = {"BITPIX",   "NAXIS",   "PCOUNT", "GCOUNT",  "TFIELDS",
                                       "THEAP",    "TNULL",   "TBCOL",  "BLANK",   "EXTVER",
                                       "EXTLEVEL", "ZBITPIX", "ZNAXIS", "ZTILE",   "ZVAL",
                                       "ZPCOUNT",  "ZGCOUNT", "ZBLANK", "ZDITHER0"};
    const char *c = card + 10, *end = card + CARD;
    bool found = false;
    for (size_t i = 0; i < sizeof keys / sizeof *keys && !found; i++)
        found = strncmp(card, keys[i], strlen(keys[i])) == 0;
    while (c < end && *c == ' ')
        c++;
    /* a text ends at its quote, a complex number at its parenthesis, whatever stands before it */
    const char close = c < end && *c == '(' ? ')' : '/';
    const char *stop = c < end && *c == '\'' ? rx_card_text_end(c, end) : memchr(c, close, (size_t)(end - c));
    if (stop != NULL)
        end = stop + (close == ')');
    while (end > c && end[-1] == ' ')
        end--;
    return card[8] == '=' &&
           ((found && end - c > LONGEST) || (is_table && end - c > LONGEST_TEXT && *c != '\''));
}

/* What cfitsio takes for a table, which it is less strict about than the standard. */
static bool says_table(const char *card)
{
    static const char *const types[] = {"BINTABLE", "TABLE", "A3DTABLE", "3DTABLE"};
    const char *c = card + 10, *end = card + CARD - 8;
    while (c < end && *c == ' ')
        c++;
    c += *c == '\'';
    while (c < end && *c == ' ')
        c++;
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (strncmp(c, types[i], strlen(types[i])) == 0)
            return true;
    return false;
}

/* How a table begins. */
static void take_table_card(rx_fits_layout *dst, const char *card)
{
    static const char *const order[] = {"XTENSION", "BITPIX  ", "NAXIS   ", "NAXIS1  ",
                                        "NAXIS2  ", "PCOUNT  ", "GCOUNT  ", "TFIELDS "};
    if (dst->cards == 0 && strncmp(card, "XTENSION", 8) == 0) {
        dst->is_table = is_key(card, "XTENSION") && says_table(card);
        dst->no_table = !is_key(card, "XTENSION");
    } else if (dst->is_table && dst->cards < TABLE_CARDS &&
               (!is_key(card, order[dst->cards]) || !is_count(card) ||
                (dst->cards == TABLE_CARDS - 1 && number(card) > MOST_FIELDS))) {
        dst->no_table = true;
    }
    dst->cards++;
}

rx_fits_layout rx_fits_layout_begin(void)
{
    return (rx_fits_layout){.product = 1, .gcount = 1};
}

/* cfitsio finds keywords of small letters, too. */
void rx_fits_layout_card(rx_fits_layout *dst, const char *as_it_is)
{
    char card[CARD];
    memcpy(card, as_it_is, CARD);
    for (int i = 0; i < 8; i++)
        card[i] = card[i] >= 'a' && card[i] <= 'z' ? (char)(card[i] - 'a' + 'A') : card[i];
    take_table_card(dst, card);
    dst->too_long |= is_too_long(card, dst->is_table);
    if (is_key(card, "BITPIX  "))
        dst->bitpix = number(card);
    else if (is_key(card, "NAXIS   "))
        dst->naxis = number(card);
    else if (is_key(card, "PCOUNT  "))
        dst->pcount = number(card);
    else if (is_key(card, "GCOUNT  "))
        dst->gcount = number(card);
    else if (strncmp(card, "ZTILE", 5) == 0 && card[5] >= '1' && card[5] <= '9' && card[8] == '=' &&
             (card[9] != ' ' || !is_count(card) || number(card) < 1))
        dst->no_tile = true;
    else if (is_key(card, "ZCMPTYPE"))
        dst->rice = strncmp(card + 11, "RICE", 4) == 0;
    else if (is_key(card, "ZVAL1   "))
        dst->no_block = number(card) < 1;
    else if (is_key(card, "NAXIS") && __builtin_mul_overflow(dst->product, number(card), &dst->product))
        dst->product = -1;
}

/* Where blocks are read: a descriptor, or a file that cfitsio has open. */
typedef struct source {
    int plain;
    fitsfile *open;
    bool unreadable; /* not the end of the file: the disk */
} source;

/* EINVAL: no file has such a place. */
static bool read_plain(source *s, LONGLONG place, char *block)
{
    size_t have = 0;
    while (have < BLOCK) {
        const ssize_t n = pread(s->plain, block + have, BLOCK - have, (off_t)(place + (LONGLONG)have));
        if (n > 0)
            have += (size_t)n;
        else if (n == 0 || errno != EINTR) {
            s->unreadable = n < 0 && errno != EINVAL && errno != EOVERFLOW;
            return false;
        }
    }
    return true;
}

static bool read_block(source *s, LONGLONG place, char *block)
{
    int failed = 0;
    if (s->open == NULL)
        return read_plain(s, place, block);
    ffmbyt(s->open, place, REPORT_EOF, &failed);
    ffgbyt(s->open, BLOCK, block, &failed);
    s->unreadable = rx_fits_is_unreadable(failed);
    return failed == 0;
}

/* Reads the header at *place and moves that behind it. false: no END, or the end of the file. */
static bool read_header(source *s, LONGLONG *place, rx_fits_layout *dst)
{
    char block[BLOCK];
    *dst = rx_fits_layout_begin();
    for (int b = 0; b < MAX_BLOCKS; b++, *place += BLOCK) {
        if (!read_block(s, *place, block) ||
            (b == 0 && strncmp(block, "SIMPLE  ", 8) != 0 && strncmp(block, "XTENSION", 8) != 0))
            return false;
        for (int i = 0; i < BLOCK; i += CARD) {
            if (strncmp(block + i, "END     ", 8) == 0) {
                *place += BLOCK;
                return true;
            }
            rx_fits_layout_card(dst, block + i);
        }
    }
    return false;
}

int64_t rx_fits_layout_bytes(const rx_fits_layout *l)
{
    int64_t bytes, bits = l->bitpix < 0 ? -l->bitpix : l->bitpix;
    if (l->naxis == 0)
        return 0;
    if (l->product < 0 || l->pcount < 0 || l->gcount < 0 || bits > 64 ||
        __builtin_add_overflow(l->product, l->pcount, &bytes) ||
        __builtin_mul_overflow(bytes, l->gcount, &bytes) || __builtin_mul_overflow(bytes, bits / 8, &bytes) ||
        bytes > INT64_MAX - BLOCK)
        return -1;
    return (bytes + BLOCK - 1) / BLOCK * BLOCK;
}

/* What is wrong with a header so that cfitsio must not see it, after its last card; NULL: nothing. */
static const char *layout_fault(const rx_fits_layout *l)
{
    if (l->no_tile)
        return "ZTILEn of the compressed image is no size of a tile; the header is damaged";
    if (l->rice && l->no_block)
        return "ZVAL1 of the compressed image is no size of a block; the header is damaged";
    if (l->too_long)
        return "a value is longer than any of its kind; the header is damaged";
    if (l->no_table || (l->is_table && l->cards < TABLE_CARDS))
        return "the table does not begin with XTENSION, BITPIX, NAXIS, NAXIS1, NAXIS2, PCOUNT, GCOUNT, "
               "TFIELDS; "
               "the header is damaged";
    return NULL;
}

bool rx_fits_is_unreadable(int failed)
{
    return failed == READ_ERROR || failed == SEEK_ERROR;
}

static rx_status judge(const source *s, const rx_fits_layout *header, const char *path, int hdu,
                       rx_error *err)
{
    if (s->unreadable)
        return rx_error_at(err, RX_INPUT, path, hdu, 0, "its header cannot be read from the disk");
    const char *fault = layout_fault(header);
    return fault == NULL ? RX_OK : rx_error_at(err, RX_INPUT, path, hdu, 0, "%s", fault);
}

rx_status rx_fits_walk(int file, const char *path, rx_error *err)
{
    source s = {.plain = file};
    rx_fits_layout header;
    rx_status status = RX_OK;
    LONGLONG place = 0;
    for (int hdu = 0; status == RX_OK; hdu++) {
        const bool whole = read_header(&s, &place, &header);
        const int64_t bytes = rx_fits_layout_bytes(&header);
        status = judge(&s, &header, path, hdu, err);
        if (!whole || bytes < 0 || __builtin_add_overflow(place, bytes, &place))
            break;
    }
    return status;
}

int64_t rx_fits_walk_selected(int file, int64_t size, int64_t *place)
{
    source s = {.plain = file};
    rx_fits_layout header;
    for (LONGLONG at = *place; at <= INT64_MAX - BLOCK;) {
        if (at + BLOCK > size)
            return at + BLOCK;
        const bool whole = read_header(&s, &at, &header);
        if (!whole && at + BLOCK > size)
            return at + BLOCK;
        const int64_t bytes = rx_fits_layout_bytes(&header);
        if (!whole || bytes < 0 || __builtin_add_overflow(at, bytes, &at))
            break;
        *place = at;
    }
    return 0;
}

rx_status rx_fits_walk_open(fitsfile *file, const char *path, rx_error *err)
{
    source s = {.open = file};
    rx_fits_layout header;
    rx_status status = RX_OK;
    int failed = 0;
    for (int hdu = 1; status == RX_OK; hdu++) {
        LONGLONG place = file->Fptr->headstart[hdu]; /* known as soon as cfitsio has read the HDU before */
        if (place <= file->Fptr->headstart[hdu - 1]) {
            status = rx_error_at(err, RX_INPUT, path, hdu - 1, 0,
                                 "ends before it begins, by its size; the header is damaged");
            break; /* cfitsio would go round for ever */
        }
        const bool whole = read_header(&s, &place, &header);
        status = judge(&s, &header, path, hdu, err);
        if (!whole || status != RX_OK || fits_movabs_hdu(file, hdu + 1, NULL, &failed))
            break;
    }
    if (status == RX_OK && rx_fits_is_unreadable(failed))
        status = rx_fits_failed(err, RX_INPUT, path, -1, failed, "cannot be read");
    failed = 0;
    fits_movabs_hdu(file, 1, NULL, &failed);
    fits_clear_errmsg();
    return status;
}
