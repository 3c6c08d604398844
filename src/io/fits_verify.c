/* Is a FITS file as it was written? Its bytes, one's complement sums (FITS 4.0, appendix J). */
#include "io/fits_verify.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "io/fits_read.h"
#include "io/fits_sum.h"
#include "io/guard/guard.h"

enum { CARD = 80, BLOCK = 2880 };

typedef struct verifier {
    const char *path;
    FILE *file;
    int hdu;
    unsigned char block[BLOCK];
} verifier;

/* *n: 0 at the end of the file, else a whole block. */
static rx_status next_block(verifier *v, size_t *n, rx_error *err)
{
    *n = fread(v->block, 1, BLOCK, v->file);
    if (ferror(v->file))
        return rx_error_at(err, RX_INPUT, v->path, v->hdu, 0, "cannot be read: %s", strerror(errno));
    if (*n != 0 && *n != BLOCK)
        return rx_error_at(err, RX_INPUT, v->path, v->hdu, 0,
                           "is cut off: its size is no multiple of %d bytes; fetch it again", BLOCK);
    return RX_OK;
}

static rx_status damaged(const verifier *v, const char *what, rx_error *err)
{
    return rx_error_at(err, RX_INPUT, v->path, v->hdu, 0,
                       "%s: the file is damaged or was edited; fetch or make it again", what);
}

/* What a header says of itself. */
typedef struct header {
    rx_fits_layout layout;
    int has_checksum, has_datasum;
    char datasum[24];
    uint32_t sum;
} header;

/* Cards of the block into dst; 1 when END was among them. */
static int take_block(const unsigned char *block, header *dst)
{
    for (int i = 0; i < BLOCK; i += CARD) {
        const char *card = (const char *)block + i;
        if (memcmp(card, "END     ", 8) == 0)
            return 1;
        rx_fits_layout_card(&dst->layout, card);
        if (memcmp(card, "CHECKSUM", 8) == 0)
            dst->has_checksum = 1;
        else if (memcmp(card, "DATASUM ", 8) == 0)
            dst->has_datasum = rx_cards_text(card, 1, "DATASUM", dst->datasum, sizeof dst->datasum);
    }
    return 0;
}

/* The file stands behind the header afterwards; *more 0: there was no further HDU. */
static rx_status read_header(verifier *v, header *dst, int *more, rx_error *err)
{
    size_t n = 0;
    *dst = (header){.layout = rx_fits_layout_begin()};
    rx_status status = next_block(v, &n, err);
    *more = status == RX_OK && n > 0;
    if (!*more)
        return status;
    if (memcmp(v->block, v->hdu == 0 ? "SIMPLE  = " : "XTENSION= ", 10) != 0)
        return damaged(v,
                       v->hdu == 0 ? "is not plain FITS (unpack it if it is compressed)"
                                   : "no HDU begins where this one should",
                       err);
    for (;;) {
        dst->sum = rx_fits_sum_bytes(dst->sum, v->block, BLOCK);
        if (take_block(v->block, dst))
            return RX_OK;
        status = next_block(v, &n, err);
        if (status == RX_OK && n == 0)
            status = damaged(v, "the header has no END", err);
        if (status != RX_OK)
            return status;
    }
}

static rx_status verify_hdu(verifier *v, int *more, rx_error *err)
{
    header head;
    uint32_t data = 0;
    rx_status status = read_header(v, &head, more, err);
    if (status != RX_OK || !*more)
        return status;
    int64_t bytes = rx_fits_layout_bytes(&head.layout);
    if (bytes < 0)
        return damaged(v, "the size of its data makes no sense", err);
    uint32_t sum = head.sum;
    for (; bytes > 0; bytes -= BLOCK) {
        size_t n = 0;
        status = next_block(v, &n, err);
        if (status == RX_OK && n == 0)
            status = rx_error_at(err, RX_INPUT, v->path, v->hdu, 0,
                                 "is cut off: %" PRId64 " bytes are missing; fetch it again", bytes);
        if (status != RX_OK)
            return status;
        data = rx_fits_sum_bytes(data, v->block, BLOCK);
        sum = rx_fits_sum_bytes(sum, v->block, BLOCK);
    }
    if (!head.has_checksum || !head.has_datasum)
        return rx_error_at(
            err, RX_INPUT, v->path, v->hdu, 0,
            "has no %s, so that it cannot be checked whether it is whole; fetch or make it again",
            head.has_checksum ? "DATASUM" : "CHECKSUM");
    char *end;
    if (strtoull(head.datasum, &end, 10) != data || *end != '\0')
        return damaged(v, "DATASUM does not fit the data", err);
    return sum == UINT32_MAX ? RX_OK : damaged(v, "CHECKSUM does not fit the HDU", err);
}

rx_status rx_fits_verify(const char *path, int nhdus, rx_error *err)
{
    rx_status status = RX_OK;
    verifier v = {.path = path, .file = fopen(path, "rb")};
    if (v.file == NULL)
        return rx_error_file(err, path, "cannot be opened");
    for (int more = 1; more && status == RX_OK; v.hdu += more && status == RX_OK)
        status = verify_hdu(&v, &more, err);
    fclose(v.file);
    if (status == RX_OK && nhdus > 0 && v.hdu != nhdus)
        status = rx_error_at(err, RX_INPUT, path, -1, 0,
                             "has %d HDUs, %d were written: the file is cut off or was edited; fetch or make "
                             "it again",
                             v.hdu, nhdus);
    if (status == RX_OK && v.hdu == 0)
        status = rx_error_at(err, RX_INPUT, path, -1, 0, "is an empty file; fetch it again");
    return status;
}
