/* The images of a file. */
#include "io/tile_list.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "base/text.h"
#include "io/cards.h"
#include "io/tile.h"

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

/* --- which HDUs --- */

/* How to name the first plane of a cube. */
static rx_status is_cube(const char *path, int hdu, const rx_fits_shape *shape, rx_error *err)
{
    rx_text lengths = {0}, places = {0};
    for (int i = 0; i < shape->naxis; i++) {
        rx_text_printf(&lengths, "%s%lld", i > 0 ? " x " : "", shape->axes[i]);
        if (i >= 2)
            rx_text_add(&places, ",1");
    }
    const rx_status status =
        lengths.failed || places.failed
            ? rx_error_memory(err, 0)
            : rx_error_at(err, RX_INPUT, path, hdu, 0,
                          "holds an image of %d axes (%s), a 2-D one was expected; name one plane of it, the "
                          "first by '%s[%d][*,*%s]'",
                          shape->naxis, lengths.data, path, hdu, places.data);
    rx_text_free(&lengths);
    rx_text_free(&places);
    return status;
}

rx_status rx_image_check(const char *path, int hdu, const rx_fits_shape *shape,
                         const rx_fits_section *section, rx_error *err)
{
    if (!shape->is_image)
        return rx_error_at(err, RX_INPUT, path, hdu, 0, "holds a table, a 2-D image was expected");
    if (shape->naxis == 0)
        return rx_error_at(err, RX_INPUT, path, hdu, 0,
                           "holds no pixels (NAXIS = 0); name an image extension");
    if (!rx_fits_is_plane(shape, section))
        return shape->naxis > 2 && shape->naxis <= RX_FITS_AXES
                   ? is_cube(path, hdu, shape, err)
                   : rx_error_at(err, RX_INPUT, path, hdu, 0,
                                 "holds an image of %d ax%s, a 2-D one was expected", shape->naxis,
                                 shape->naxis == 1 ? "is" : "es");
    for (int i = 2; i < RX_FITS_AXES; i++) {
        const LONGLONG length = i < shape->naxis ? shape->axes[i] : 1;
        if (section->plane[i - 2] > length)
            return rx_error_at(err, RX_INPUT, path, hdu, 0,
                               "has no plane %ld on axis %d; give one from 1 to %lld", section->plane[i - 2],
                               i + 1, length);
    }
    if (shape->axes[0] < 1 || shape->axes[1] < 1)
        return rx_error_at(err, RX_INPUT, path, hdu, 0,
                           "the image has %lld x %lld pixels, there is nothing in it", shape->axes[0],
                           shape->axes[1]);
    if (shape->axes[0] > INT_MAX / 4 || shape->axes[1] > INT_MAX / 4)
        return rx_error_at(err, RX_INPUT, path, hdu, 0,
                           "the header says %lld x %lld pixels, which no tile has", shape->axes[0],
                           shape->axes[1]);
    return RX_OK;
}

/* All usable HDUs; those that are not are logged, the reason of the first, or of the first cube, is kept for the case
 * of none. */
static rx_status list_all(rx_fits_source *source, const rx_fits_name *name, rx_log *log, int count,
                          rx_image_list *dst, rx_error *err)
{
    const char *path = name->path;
    bool cubes = false;
    rx_error reason = rx_error_part(err), first = reason;
    dst->n = 0;
    for (int hdu = 0; hdu < count; hdu++) {
        rx_fits_shape shape;
        RX_TRY(rx_fits_goto(source, hdu, err)); /* it was reached before: the disk fails */
        const bool failed = rx_fits_shape_of(source, &shape, &reason) != RX_OK;
        const rx_status status =
            failed ? RX_INPUT : rx_image_check(path, hdu, &shape, &name->section, &reason);
        if (status == RX_OK) {
            dst->list[dst->n++].hdu = hdu;
            continue;
        }
        int silent = !failed && shape.is_image && shape.naxis == 0; /* an empty primary HDU */
        const bool cube = !failed && shape.is_image && shape.naxis > 2;
        if (!silent && (first.status == RX_OK || (cube && !cubes)))
            first = reason;
        cubes |= cube;
        if (!silent && !failed && shape.is_image && shape.naxis != 1)
            rx_log_warning(log, "%s[%d]: skipped: %s", path, hdu, reason.text);
        else if (!silent)
            rx_log_detail(log, "%s[%d]: skipped: %s", path, hdu, reason.text);
    }
    if (dst->n > 0)
        return RX_OK;
    if (first.status != RX_OK && (count <= 2 || cubes)) {
        rx_error_take(err, &first);
        return first.status;
    }
    return rx_error_at(err, RX_INPUT, path, -1, 0, "holds no 2-D image in its %d HDUs", count);
}

/* The file is left at that HDU. */
static rx_status read_name(rx_fits_source *source, rx_image_hdu *dst, rx_error *err)
{
    char *cards = NULL;
    size_t n = 0;
    double version;
    RX_TRY(rx_fits_goto(source, dst->hdu, err));
    RX_TRY(rx_fits_read_cards(source, &cards, &n, err));
    rx_cards_text(cards, (long)n, "EXTNAME", dst->name, sizeof dst->name);
    if (rx_cards_number(cards, (long)n, "EXTVER", &version) && version >= 1 && version <= INT_MAX)
        dst->version = (int)version;
    free(cards);
    if (strcmp(dst->name, "COMPRESSED_IMAGE") == 0)
        dst->name[0] = '\0';
    return RX_OK;
}

/* The one that is selected. */
static rx_status list_one(rx_fits_source *source, const rx_fits_name *name, rx_image_list *dst, rx_error *err)
{
    rx_fits_shape shape;
    dst->n = 1;
    RX_TRY(rx_fits_goto_name(source, name, err));
    dst->list->hdu = source->hdu;
    RX_TRY(rx_fits_shape_of(source, &shape, err));
    return rx_image_check(name->path, source->hdu, &shape, &name->section, err);
}

rx_status rx_images_of(const rx_fits_name *name, rx_log *log, rx_image_list *dst, rx_error *err)
{
    rx_fits_source source = {0};
    int count = 1, broken = 0;
    rx_status status;
    *dst = (rx_image_list){0};
    RX_TRY_EXIT(rx_fits_open(name->path, &source, err));
    if (!rx_fits_name_selects(name))
        RX_TRY_EXIT(rx_fits_count(&source, &count, &broken, err));
    RX_TRY_EXIT(RX_MAKE(dst->list, (size_t)count, err));
    status = rx_fits_name_selects(name) ? list_one(&source, name, dst, err)
                                        : list_all(&source, name, log, count, dst, err);
    if (status == RX_INPUT && broken)
        status = rx_error_at(err, RX_INPUT, name->path, count, 0,
                             "this HDU cannot be read, and none before it holds a 2-D image; the file is "
                             "damaged, fetch it again");
    if (status == RX_OK && broken)
        rx_log_warning(log, "%s: what follows HDU %d cannot be read and is skipped; the file is damaged",
                       name->path, count - 1);
    for (int i = 0; i < dst->n && status == RX_OK; i++)
        status = read_name(&source, &dst->list[i], err);
exit:
    rx_fits_done(&source);
    if (status != RX_OK) {
        free(dst->list);
        *dst = (rx_image_list){0};
    }
    return status;
}

rx_status rx_images_of_file(const rx_fits_name *name, rx_log *log, rx_image_list *dst, rx_error *err)
{
    rx_fits_name all = *name;
    all.hdu = -1;
    all.extname[0] = '\0';
    return rx_images_of(&all, log, dst, err);
}

bool rx_images_same(const rx_image_hdu *a, const rx_image_hdu *b)
{
    return a->name[0] != '\0' && strcasecmp(a->name, b->name) == 0 &&
           (a->version == b->version || a->version == 0 || b->version == 0);
}

void rx_images_own_maps(const rx_image_list *all, int hdu, int *mask, int *variance)
{
    int found[2] = {-1, -1}, i = 0;
    *mask = *variance = -1;
    while (i < all->n && all->list[i].hdu != hdu)
        i++;
    if (i == all->n || strcasecmp(all->list[i].name, IMAGE) != 0)
        return;
    for (i++; i < all->n && strcasecmp(all->list[i].name, IMAGE) != 0; i++)
        if (strcasecmp(all->list[i].name, "MASK") == 0)
            found[0] = all->list[i].hdu;
        else if (strcasecmp(all->list[i].name, "VARIANCE") == 0)
            found[1] = all->list[i].hdu;
    if (found[0] >= 0 && found[1] >= 0) {
        *mask = found[0];
        *variance = found[1];
    }
}

void rx_images_drop_maps(rx_image_list *images)
{
    int kept = 0;
    for (int i = 0; i < images->n; i++)
        if (map_of(images->list[i].name) < 0)
            images->list[kept++] = images->list[i];
    images->n = kept > 0 ? kept : images->n;
}

/* The log names the maps that are left out, each kind once, and the keywords that read one that is not taken by default. */
static rx_status log_maps(const char *path, rx_log *log, const rx_image_list *all, int first_image,
                          rx_error *err)
{
    rx_text maps = {0};
    int taken = -1, mask, variance;
    bool plain = true; /* names of maps alone, which one WEIGHT_IMAGE can give */
    rx_images_own_maps(all, first_image, &mask, &variance);
    for (int i = 0; i < NMAPS; i++)
        for (int k = 0, there = 0; k < all->n; k++) {
            if (map_of(all->list[k].name) != i)
                continue;
            plain = plain && strchr(all->list[k].name, '.') == NULL;
            if (there++ > 0)
                continue;
            rx_text_printf(&maps, "%s%s", maps.length > 0 ? ", " : "", MAPS[i].name);
            if (taken < 0 && MAPS[i].type != NULL)
                taken = i;
        }
    const rx_status status = maps.failed ? rx_error_memory(err, 0) : RX_OK;
    if (status == RX_OK && plain && taken >= 0 && mask < 0)
        rx_log_hint(log, "%s: %s: maps, not measured; WEIGHT_TYPE %s with WEIGHT_IMAGE '%s[%s]' reads one",
                    path, maps.data, MAPS[taken].type, path, MAPS[taken].name);
    else if (status == RX_OK)
        rx_log_hint(log, "%s: %s: maps, not measured", path, maps.data);
    rx_text_free(&maps);
    return status;
}

rx_status rx_tile_list(const char *name, rx_log *log, int **hdus, int *n, rx_error *err)
{
    rx_fits_name parsed;
    rx_image_list all = {0}, images = {0};
    rx_status status;
    *n = 0;
    *hdus = NULL;
    RX_TRY(rx_fits_name_parse(name, &parsed, err));
    RX_TRY_EXIT(rx_images_of(&parsed, log, &all, err));
    RX_TRY_EXIT(RX_MAKE(images.list, (size_t)all.n, err));
    memcpy(images.list, all.list, (size_t)all.n * sizeof *all.list);
    images.n = all.n;
    rx_images_drop_maps(&images);
    if (images.n < all.n)
        RX_TRY_EXIT(log_maps(parsed.path, log, &all, images.list->hdu, err));
    RX_TRY_EXIT(RX_MAKE(*hdus, (size_t)images.n, err));
    for (int i = 0; i < images.n; i++)
        (*hdus)[i] = images.list[i].hdu;
    *n = images.n;
exit:
    free(all.list);
    free(images.list);
    return status;
}
