/* Images and their maps in one file. */
#include "io/planes.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "base/text.h"
#include "io/fits_read.h"

static const char VARIANCE[] = "VARIANCE";

/* EXTNAMEs of maps in the files of Rubin and HSC (MASK, VARIANCE), HST and JWST (ERR, DQ, VAR_*, WHT, CON, CTX, AREA,
 * SAMP, TIME), DES and the Legacy Surveys (MSK, WGT, IVAR), of astropy (UNCERT) and others; type: of WEIGHT_TYPE that
 * reads it, NULL: none does. */
static const struct {
    const char *name, *type;
} MAPS[] = {{"MASK", NULL},
            {"MSK", NULL},
            {"DQ", NULL},
            {"FLAGS", NULL},
            {"BPM", NULL},
            {VARIANCE, "MAP_VAR"},
            {"VAR", "MAP_VAR"},
            {"ERR", "MAP_RMS"},
            {"ERROR", "MAP_RMS"},
            {"RMS", "MAP_RMS"},
            {"SIGMA", "MAP_RMS"},
            {"UNCERT", "MAP_RMS"},
            {"WHT", "MAP_WEIGHT"},
            {"WGT", "MAP_WEIGHT"},
            {"WEIGHT", "MAP_WEIGHT"},
            {"IVAR", "MAP_WEIGHT"},
            {"INVVAR", "MAP_WEIGHT"},
            {"CON", NULL},
            {"CTX", NULL},
            {"AREA", NULL},
            {"SAMP", NULL},
            {"TIME", NULL},
            {"VAR_POISSON", NULL},
            {"VAR_RNOISE", NULL},
            {"VAR_FLAT", NULL}};
enum { NMAPS = sizeof MAPS / sizeof *MAPS };

static int map_of(const char *extname)
{
    for (int i = 0; i < NMAPS; i++)
        if (strcasecmp(extname, MAPS[i].name) == 0)
            return i;
    return -1;
}

rx_status rx_planes_name(fitsfile *file, const char *path, int hdu, char dst[RX_EXTNAME], rx_error *err)
{
    char *cards = NULL;
    size_t n = 0;
    dst[0] = '\0';
    RX_TRY(rx_fits_goto(file, path, hdu, err));
    RX_TRY(rx_fits_read_cards(file, path, hdu, &cards, &n, err));
    rx_cards_text(cards, (long)n, "EXTNAME", dst, RX_EXTNAME);
    free(cards);
    if (strcmp(dst, "COMPRESSED_IMAGE") == 0)
        dst[0] = '\0';
    return RX_OK;
}

rx_status rx_planes_keep_images(fitsfile *file, const char *path, rx_log *log, int *hdus, int *n,
                                rx_error *err)
{
    char name[RX_EXTNAME];
    rx_text maps = {0};
    const char *type = NULL;
    int kept = 0, taken = -1, *map;
    rx_status status = RX_OK;
    if (*n < 2)
        return RX_OK;
    RX_TRY(RX_MAKE(map, (size_t)*n, err));
    for (int i = 0; i < *n && status == RX_OK; i++) {
        status = rx_planes_name(file, path, hdus[i], name, err);
        map[i] = map_of(name);
        kept += map[i] < 0;
    }
    if (status == RX_OK && kept > 0 && kept < *n) {
        const int all = *n;
        *n = 0;
        for (int i = 0; i < all; i++) {
            if (map[i] < 0) {
                hdus[(*n)++] = hdus[i];
                continue;
            }
            rx_text_printf(&maps, "%s%s", maps.length > 0 ? ", " : "", MAPS[map[i]].name);
            if (type == NULL && (type = MAPS[map[i]].type) != NULL)
                taken = map[i];
        }
        if (maps.failed)
            status = rx_error_memory(err, 0);
        else if (type != NULL && strcmp(MAPS[taken].name, VARIANCE) != 0) /* which rx_planes_add() takes */
            rx_log_hint(log,
                        "%s: %s: maps, not measured; WEIGHT_TYPE %s with WEIGHT_IMAGE '%s[%s]' reads one",
                        path, maps.data, type, path, MAPS[taken].name);
        else
            rx_log_hint(log, "%s: %s: maps, not measured", path, maps.data);
    }
    rx_text_free(&maps);
    free(map);
    return status;
}

/* The bits of a mask plane by the names that its header gives: MP_SAT = 1 is the second. */
static uint32_t bits_of(const char *cards, size_t n, const char *const *names, size_t nnames)
{
    uint32_t bits = 0;
    for (size_t i = 0; i < nnames; i++) {
        double bit;
        if (rx_cards_number(cards, (long)n, names[i], &bit) && bit >= 0 && bit < 32)
            bits |= (uint32_t)1 << (int)bit;
    }
    return bits;
}

rx_status rx_planes_find(fitsfile *file, const char *path, const char *extname, int *mask, int *variance,
                         rx_error *err)
{
    int n = 0, last[2] = {-1, -1};
    *mask = *variance = -1;
    if (strcmp(extname, "IMAGE") != 0)
        return RX_OK;
    rx_status status = rx_fits_count(file, path, &n, NULL, err);
    for (int hdu = 0; hdu < n && status == RX_OK; hdu++) {
        char name[RX_EXTNAME];
        status = rx_planes_name(file, path, hdu, name, err);
        if (strcmp(name, "MASK") == 0)
            last[0] = hdu;
        else if (strcmp(name, VARIANCE) == 0)
            last[1] = hdu;
    }
    if (last[0] >= 0 && last[1] >= 0) {
        *mask = last[0];
        *variance = last[1];
    }
    return status;
}

rx_status rx_planes_add(const rx_tile_params *par, fitsfile *file, const rx_tile_place *place, rx_log *log,
                        rx_tile *tile, rx_error *err)
{
    static const char *const no_data[] = {"MP_BAD", "MP_CR", "MP_NO_DATA"}, *const saturated[] = {"MP_SAT"};
    const char *path = place->name->path;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    int mask, variance;
    size_t ncards = 0;
    char *cards = NULL;
    uint32_t *flags = NULL;
    rx_text map = {0}, weight = {0};
    rx_status status = rx_planes_find(file, path, tile->extname, &mask, &variance, err);
    if (status != RX_OK || mask < 0)
        return status;
    rx_text_printf(&weight, "%s[%d]", path, variance);
    rx_text_printf(&map, "%s[%d]", path, mask);
    if (map.failed || weight.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    rx_tile_params own = *par;
    own.weight_type = RX_WEIGHT_MAP_VAR;
    own.weight_name = weight.data;
    RX_TRY_EXIT(rx_tile_add_weight(&own, place, tile, err));
    RX_TRY_EXIT(RX_MAKE(flags, n, err));
    RX_TRY_EXIT(rx_tile_read_flags(map.data, place, flags, err));
    RX_TRY_EXIT(rx_fits_goto(file, path, mask, err));
    RX_TRY_EXIT(rx_fits_read_cards(file, path, mask, &cards, &ncards, err));
    const uint32_t bad = bits_of(cards, ncards, no_data, sizeof no_data / sizeof *no_data);
    const uint32_t full = bits_of(cards, ncards, saturated, 1);
    for (size_t i = 0; i < n; i++)
        tile->mask[i] |=
            (uint8_t)((flags[i] & bad ? RX_MASK_WEIGHT : 0) | (flags[i] & full ? RX_MASK_SATURATED : 0));
    rx_log_info(log,
                "%s[%d]: measured with the VARIANCE and the MASK (BAD, CR, NO_DATA, SAT) of its file; "
                "WEIGHT_TYPE NONE leaves them out",
                path, place->hdu);
exit:
    free(cards);
    free(flags);
    rx_text_free(&map);
    rx_text_free(&weight);
    return status;
}
