/* From header to header through a FITS file. */
#include "io/fits_walk.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { CARD = 80, BLOCK = 2880, MAX_BLOCKS = 4096 };

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

rx_fits_layout rx_fits_layout_begin(void)
{
    return (rx_fits_layout){.product = 1, .gcount = 1};
}

void rx_fits_layout_card(rx_fits_layout *dst, const char *card)
{
    if (is_key(card, "BITPIX  "))
        dst->bitpix = number(card);
    else if (is_key(card, "NAXIS   "))
        dst->naxis = number(card);
    else if (is_key(card, "PCOUNT  "))
        dst->pcount = number(card);
    else if (is_key(card, "GCOUNT  "))
        dst->gcount = number(card);
    else if (is_key(card, "ZTILE") && card[5] >= '1' && card[5] <= '9' && number(card) < 1)
        dst->no_tile = true;
    else if (is_key(card, "NAXIS") && __builtin_mul_overflow(dst->product, number(card), &dst->product))
        dst->product = -1;
}

/* Reads one header, the file then stands behind it. false: no END, or the end of the file. */
static bool read_header(FILE *file, rx_fits_layout *dst)
{
    char block[BLOCK];
    *dst = rx_fits_layout_begin();
    for (int b = 0; b < MAX_BLOCKS && fread(block, 1, BLOCK, file) == BLOCK; b++) {
        if (b == 0 && strncmp(block, "SIMPLE  ", 8) != 0 && strncmp(block, "XTENSION", 8) != 0)
            return false;
        for (int i = 0; i < BLOCK; i += CARD) {
            if (strncmp(block + i, "END     ", 8) == 0)
                return true;
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

rx_status rx_fits_walk(const char *path, rx_error *err)
{
    rx_fits_layout header;
    rx_status status = RX_OK;
    FILE *file = fopen(path, "rb");
    if (file == NULL)
        return RX_OK; /* cfitsio tells why */
    for (int hdu = 0; status == RX_OK && read_header(file, &header); hdu++) {
        int64_t bytes = rx_fits_layout_bytes(&header);
        if (header.no_tile)
            status =
                rx_error_at(err, RX_INPUT, path, hdu, 0,
                            "ZTILEn of the compressed image is no size of a tile; the header is damaged");
        else if (bytes < 0 || fseeko(file, bytes, SEEK_CUR) != 0)
            break;
    }
    fclose(file);
    return status;
}
