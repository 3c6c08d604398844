/* What the targets share. */
#include "fuzz.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include <fitsio.h>

#include "io/fits_write.h"
#include "io/guard/guard.h"

enum { BLOCK = 2880, CARD = 80, FILES = 2 };

static const char MAGIC[] = "FITS\n", NEXT[] = "\nNEXT\n";

void fuzz_require(int holds, const char *what)
{
    if (holds)
        return;
    fprintf(stderr, "does not hold: %s\n", what);
    abort();
}

const char *fuzz_file(int which, const void *data, size_t size)
{
    static struct {
        int file;
        char name[64];
    } all[FILES];
    if (all[which].file == 0) {
        all[which].file = memfd_create("fuzz", 0);
        fuzz_require(all[which].file > 0, "a file in memory can be made");
        snprintf(all[which].name, sizeof all[which].name, "/proc/self/fd/%d", all[which].file);
    }
    fuzz_require(ftruncate(all[which].file, 0) == 0, "a file in memory can be emptied");
    fuzz_require(pwrite(all[which].file, data, size, 0) == (ssize_t)size, "a file in memory can be written");
    return all[which].name;
}

static void pad(rx_text *dst, char with)
{
    while (dst->length % BLOCK != 0)
        rx_text_add_bytes(dst, &with, 1);
}

void fuzz_expand(const uint8_t *data, size_t size, rx_text *dst)
{
    const char *at = (const char *)data, *end = at + size;
    if (size < sizeof MAGIC - 1 || memcmp(data, MAGIC, sizeof MAGIC - 1) != 0) {
        rx_text_add_bytes(dst, at, size);
        return;
    }
    for (at += sizeof MAGIC - 1; at < end;) {
        for (int last = 0; at < end && !last;) {
            char card[CARD];
            const char *stop = memchr(at, '\n', (size_t)(end - at));
            const size_t n = (size_t)((stop != NULL ? stop : end) - at);
            memset(card, ' ', CARD);
            memcpy(card, at, n < CARD ? n : CARD);
            rx_text_add_bytes(dst, card, CARD);
            last = n == 3 && memcmp(at, "END", 3) == 0;
            at += n + (stop != NULL);
        }
        pad(dst, ' ');
        const char *next = at < end ? memmem(at, (size_t)(end - at), NEXT, sizeof NEXT - 1) : NULL;
        rx_text_add_bytes(dst, at, (size_t)((next != NULL ? next : end) - at));
        pad(dst, '\0');
        at = next != NULL ? next + sizeof NEXT - 1 : end;
    }
}

/* Where the data of the header at data[at] begin, 0 when there is no END; *bytes of them. */
static size_t end_of_header(const uint8_t *data, size_t size, size_t at, int64_t *bytes)
{
    for (size_t end = at; end + CARD <= size; end += CARD)
        if (memcmp(data + end, "END     ", 8) == 0) {
            *bytes = rx_fits_data_bytes((const char *)data + at, (end - at) / CARD);
            return (end / BLOCK + 1) * BLOCK;
        }
    return 0;
}

int fuzz_condense(const uint8_t *data, size_t size, rx_text *dst)
{
    rx_text_add(dst, MAGIC);
    for (size_t at = 0; at < size;) {
        int64_t bytes = 0;
        const size_t body = end_of_header(data, size, at, &bytes);
        if (body == 0 || bytes < 0 || body + (size_t)bytes > size)
            return 0;
        rx_text_add(dst, at > 0 ? NEXT : "");
        for (int last = 0; !last; at += CARD) {
            size_t n = CARD;
            while (n > 0 && data[at + n - 1] == ' ')
                n--;
            last = memcmp(data + at, "END     ", 8) == 0;
            rx_text_add_bytes(dst, (const char *)data + at, n);
            rx_text_add(dst, "\n");
        }
        size_t used = (size_t)bytes;
        while (used > 0 && data[body + used - 1] == 0)
            used--;
        rx_text_add_bytes(dst, (const char *)data + body, used);
        at = body + (size_t)bytes;
    }
    return 1;
}

void fuzz_checksums(char *data, size_t size)
{
    for (size_t at = 0; at < size;) {
        int64_t bytes = 0;
        char *checksum = NULL, *datasum = NULL, text[32];
        const size_t body = end_of_header((uint8_t *)data, size, at, &bytes);
        if (body == 0 || body > size || bytes < 0 || (uint64_t)bytes > size - body)
            return;
        for (char *card = data + at; card < data + body; card += CARD) {
            checksum = memcmp(card, "CHECKSUM= '", 11) == 0 ? card : checksum;
            datasum = memcmp(card, "DATASUM = '", 11) == 0 ? card : datasum;
        }
        const uint32_t sum = rx_fits_sum_bytes(0, data + body, (size_t)bytes);
        if (datasum != NULL) {
            snprintf(text, sizeof text, "%" PRIu32 "'", sum);
            memset(datasum + 11, ' ', CARD - 11);
            memcpy(datasum + 11, text, strlen(text));
        }
        if (checksum != NULL) {
            memset(checksum + 11, '0', 16);
            fits_encode_chksum(rx_fits_sum_bytes(sum, data + at, body - at), 1, text);
            memcpy(checksum + 11, text, 16);
        }
        at = body + (size_t)bytes;
    }
}

void fuzz_look(rx_table *table)
{
    volatile double sum = 0;
    for (int c = 0; c < table->ncolumns; c++) {
        const rx_column *column = &table->columns[c];
        const long n = rx_column_elements(column);
        fuzz_require(memchr(column->name, '\0', sizeof column->name) != NULL, "names of columns end");
        fuzz_require(n >= 0, "a column has elements");
        for (long row = 0; row < table->nrows; row++)
            for (long i = 0; i < n; i++)
                sum = sum + rx_column_value(column, row, i);
        if (column->type == RX_CELL_TEXT)
            for (long i = 0; i < table->nrows * n; i++)
                fuzz_require(memchr((char *)column->data + i * column->text_width, '\0',
                                    (size_t)column->text_width) != NULL,
                             "texts of a table end");
    }
    if (table->cards != NULL && table->ncards > 0)
        sum = sum + table->cards[table->ncards * CARD - 1];
    rx_table_free(table);
}
