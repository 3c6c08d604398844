/* Images and their maps in one file. */
#include "io/planes.h"

#include <limits.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "base/text.h"
#include "io/fits_read.h"

static const char IMAGE[] = "IMAGE";

/* EXTNAMEs of maps in the files of Rubin and HSC (MASK, VARIANCE), HST and JWST (ERR, DQ, VAR_*, WHT, CON, CTX, AREA,
 * SAMP, TIME, and the distortion of WCSDVARR and D2IMARR), Euclid (RMS, FLG, CHI2), DES and the Legacy Surveys (MSK,
 * WGT, IVAR, MASKBITS), of astropy (UNCERT) and others; type: of WEIGHT_TYPE that reads it, NULL: none does. */
static const struct {
    const char *name, *type;
} MAPS[] = {{"MASK", NULL},
            {"MSK", NULL},
            {"DQ", NULL},
            {"FLAGS", NULL},
            {"FLG", NULL},
            {"MASKBITS", NULL},
            {"BPM", NULL},
            {"VARIANCE", "MAP_VAR"},
            {"VAR", "MAP_VAR"},
            {"ERR", "MAP_RMS"},
            {"ERROR", "MAP_RMS"},
            {"RMS", "MAP_RMS"},
            {"SIGMA", "MAP_RMS"},
            {"UNCERT", "MAP_RMS"},
            {"WHT", "MAP_WEIGHT"},
            {"WGT", "MAP_WEIGHT"},
            {"WEIGHT", "MAP_WEIGHT"},
            {"IVAR", "MAP_IVAR"},
            {"INVVAR", "MAP_IVAR"},
            {"CHI2", NULL},
            {"CON", NULL},
            {"CTX", NULL},
            {"AREA", NULL},
            {"SAMP", NULL},
            {"TIME", NULL},
            {"VAR_POISSON", NULL},
            {"VAR_RNOISE", NULL},
            {"VAR_FLAT", NULL},
            {"D2IMARR", NULL},
            {"WCSDVARR", NULL}};
enum { NMAPS = sizeof MAPS / sizeof *MAPS };

/* Several detectors in a file, as Euclid's, have the plane behind a point: DET11.SCI, DET11.RMS. */
static int map_of(const char *extname)
{
    const char *point = strrchr(extname, '.'), *plane = point != NULL ? point + 1 : extname;
    for (int i = 0; i < NMAPS; i++)
        if (strcasecmp(plane, MAPS[i].name) == 0)
            return i;
    return -1;
}

rx_status rx_planes_name(fitsfile *file, const char *path, int hdu, rx_plane_name *dst, rx_error *err)
{
    char *cards = NULL;
    size_t n = 0;
    double version;
    *dst = (rx_plane_name){.version = 0};
    RX_TRY(rx_fits_goto(file, path, hdu, err));
    RX_TRY(rx_fits_read_cards(file, path, hdu, &cards, &n, err));
    rx_cards_text(cards, (long)n, "EXTNAME", dst->name, sizeof dst->name);
    if (rx_cards_number(cards, (long)n, "EXTVER", &version) && version >= 1 && version <= INT_MAX)
        dst->version = (int)version;
    free(cards);
    if (strcmp(dst->name, "COMPRESSED_IMAGE") == 0)
        dst->name[0] = '\0';
    return RX_OK;
}

bool rx_planes_same(const rx_plane_name *a, const rx_plane_name *b)
{
    return a->name[0] != '\0' && strcasecmp(a->name, b->name) == 0 &&
           (a->version == b->version || a->version == 0 || b->version == 0);
}

/* The log names the maps that are left out, each kind once, and the keywords that read one that is not taken by default. */
static rx_status log_maps(fitsfile *file, const char *path, rx_log *log, int first_image,
                          const bool *is_there, bool plain, rx_error *err)
{
    rx_text maps = {0};
    int taken = -1, mask, variance;
    RX_TRY(rx_planes_find(file, path, first_image, &mask, &variance, err));
    for (int i = 0; i < NMAPS; i++)
        if (is_there[i]) {
            rx_text_printf(&maps, "%s%s", maps.length > 0 ? ", " : "", MAPS[i].name);
            if (taken < 0 && MAPS[i].type != NULL)
                taken = i;
        }
    if (maps.failed) {
        rx_text_free(&maps);
        return rx_error_memory(err, 0);
    }
    if (plain && taken >= 0 && mask < 0)
        rx_log_hint(log, "%s: %s: maps, not measured; WEIGHT_TYPE %s with WEIGHT_IMAGE '%s[%s]' reads one",
                    path, maps.data, MAPS[taken].type, path, MAPS[taken].name);
    else
        rx_log_hint(log, "%s: %s: maps, not measured", path, maps.data);
    rx_text_free(&maps);
    return RX_OK;
}

rx_status rx_planes_keep_images(fitsfile *file, const char *path, rx_log *log, int *hdus, int *n,
                                rx_error *err)
{
    const int all = *n;
    bool is_there[NMAPS] = {false},
         plain = true; /* plain: names of maps alone, which one WEIGHT_IMAGE can give */
    int kept = 0, *map;
    rx_status status = RX_OK;
    if (all < 2)
        return RX_OK;
    RX_TRY(RX_MAKE(map, (size_t)all, err));
    for (int i = 0; i < all && status == RX_OK; i++) {
        rx_plane_name name;
        status = rx_planes_name(file, path, hdus[i], &name, err);
        map[i] = map_of(name.name);
        kept += map[i] < 0;
        plain = plain && (map[i] < 0 || strchr(name.name, '.') == NULL);
    }
    if (status == RX_OK && kept > 0 && kept < all) {
        *n = 0;
        for (int i = 0; i < all; i++)
            if (map[i] < 0)
                hdus[(*n)++] = hdus[i];
            else
                is_there[map[i]] = true;
        status = log_maps(file, path, log, hdus[0], is_there, plain, err);
    }
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

rx_status rx_planes_find(fitsfile *file, const char *path, int hdu, int *mask, int *variance, rx_error *err)
{
    rx_plane_name name;
    int n = 0, found[2] = {-1, -1};
    *mask = *variance = -1;
    RX_TRY(rx_planes_name(file, path, hdu, &name, err));
    if (strcasecmp(name.name, IMAGE) != 0)
        return RX_OK;
    RX_TRY(rx_fits_count(file, path, &n, NULL, err));
    for (int i = hdu + 1; i < n; i++) {
        RX_TRY(rx_planes_name(file, path, i, &name, err));
        if (strcasecmp(name.name, IMAGE) == 0)
            break;
        if (strcasecmp(name.name, "MASK") == 0)
            found[0] = i;
        else if (strcasecmp(name.name, "VARIANCE") == 0)
            found[1] = i;
    }
    if (found[0] >= 0 && found[1] >= 0) {
        *mask = found[0];
        *variance = found[1];
    }
    return RX_OK;
}

/* A mask whose header names no bits marks by 1 what is bad where it holds 0 and 1 alone; else its bits may say anything. */
static bool is_yes_or_no(const uint32_t *flags, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (flags[i] > 1)
            return false;
    return true;
}

static rx_status add_maps(const rx_tile_params *par, fitsfile *file, const rx_tile_place *place,
                          const int hdus[2], rx_log *log, rx_tile *tile, rx_error *err)
{
    static const char *const no_data[] = {"MP_BAD", "MP_CR", "MP_NO_DATA"}, *const saturated[] = {"MP_SAT"};
    const char *path = place->name->path;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    size_t ncards = 0;
    char *cards = NULL;
    uint32_t *flags = NULL;
    rx_text map = {0}, weight = {0};
    rx_status status;
    rx_text_printf(&map, "%s[%d]", path, hdus[0]);
    rx_text_printf(&weight, "%s[%d]", path, hdus[1]);
    if (map.failed || weight.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    rx_tile_params own = *par;
    own.weight_type = RX_WEIGHT_MAP_VAR;
    own.weight_name = weight.data;
    RX_TRY_EXIT(rx_tile_add_weight(&own, place, tile, err));
    RX_TRY_EXIT(RX_MAKE(flags, n, err));
    RX_TRY_EXIT(rx_tile_read_flags(map.data, place, flags, err));
    RX_TRY_EXIT(rx_fits_goto(file, path, hdus[0], err));
    RX_TRY_EXIT(rx_fits_read_cards(file, path, hdus[0], &cards, &ncards, err));
    uint32_t bad = bits_of(cards, ncards, no_data, sizeof no_data / sizeof *no_data);
    const uint32_t full = bits_of(cards, ncards, saturated, 1);
    const bool named = (bad | full) != 0, simple = !named && is_yes_or_no(flags, n);
    bad |= simple ? 1 : 0;
    for (size_t i = 0; i < n; i++)
        tile->mask[i] |=
            (uint8_t)((flags[i] & bad ? RX_MASK_WEIGHT : 0) | (flags[i] & full ? RX_MASK_SATURATED : 0));
    if (!named && !simple)
        rx_log_warning(
            log,
            "%s[%d]: is a MASK of several bits and names none of them (MP_BAD, MP_SAT): it is left "
            "out; FLAG_IMAGE '%s' puts its bits into IMAFLAGS_ISO",
            path, hdus[0], map.data);
    rx_log_info(log, "%s[%d]: measured with the VARIANCE%s of its file; WEIGHT_TYPE NONE leaves %s out", path,
                place->hdu,
                named    ? " and the MASK (BAD, CR, NO_DATA, SAT)"
                : simple ? " and the MASK (1 is bad)"
                         : "",
                named || simple ? "them" : "it");
exit:
    free(cards);
    free(flags);
    rx_text_free(&map);
    rx_text_free(&weight);
    return status;
}

rx_status rx_planes_add(const rx_tile_params *par, fitsfile *file, const rx_tile_place *place, rx_log *log,
                        rx_tile *tile, rx_error *err)
{
    int hdus[2];
    rx_error reason = rx_error_part(err);
    RX_TRY(rx_planes_find(file, place->name->path, place->hdu, &hdus[0], &hdus[1], err));
    if (hdus[0] < 0)
        return RX_OK;
    const rx_status status = add_maps(par, file, place, hdus, log, tile, &reason);
    if (status == RX_INPUT) /* of a map that was not asked for */
        return rx_error_at(err, status, reason.where, reason.hdu, reason.line,
                           "%s; WEIGHT_TYPE NONE leaves it out", reason.text);
    return status == RX_OK ? RX_OK : rx_error_take(err, &reason);
}
