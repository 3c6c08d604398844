/* What the tests of io/ share: a scratch folder, header cards, and FITS files made byte by byte. */
#ifndef RX_TESTS_IO_TEST_H
#define RX_TESTS_IO_TEST_H

#include "../scratch.h"
#include "base/error.h"
#include "base/text.h"

/* Folder of the real data, NULL (and a line) where it is absent. */
static inline const char *real_data(void)
{
    const char *folder = getenv("RX_SHARED_DATA");
    if (folder == NULL || access(folder, R_OK) != 0) {
        print_message("real data absent (RX_SHARED_DATA): skipped\n");
        return NULL;
    }
    return folder;
}

/* --- cards --- */

/* Cards from lines separated by newlines. */
static inline void cards_from(const char *lines, rx_text *cards)
{
    while (*lines != '\0') {
        size_t n = strcspn(lines, "\n");
        char card[81];
        snprintf(card, sizeof card, "%-80.*s", (int)n, lines);
        rx_text_add_bytes(cards, card, 80);
        lines += n + (lines[n] == '\n');
    }
}

/* Append one HDU: its cards, END, padding, data, padding. */
static inline void add_hdu(rx_text *file, const char *lines, const void *data, size_t bytes)
{
    cards_from(lines, file);
    cards_from("END", file);
    while (file->length % 2880 != 0)
        rx_text_add_bytes(file, " ", 1);
    rx_text_add_bytes(file, data, bytes);
    while (file->length % 2880 != 0)
        rx_text_add_bytes(file, "\0", 1);
}

/* Big-endian bytes of n values of size bytes each, in place. */
static inline void swap(void *data, size_t n, size_t size)
{
    unsigned char *bytes = data;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < size / 2; j++) {
            unsigned char keep = bytes[i * size + j];
            bytes[i * size + j] = bytes[i * size + size - 1 - j];
            bytes[i * size + size - 1 - j] = keep;
        }
}

#endif
