/* The images of a file, which of them are maps of others, and the maps that go with a tile: weights and flags. */
#include "io/tile_maps.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "base/text.h"
#include "data/unit.h"
#include "io/cards.h"

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
    const rx_status status = lengths.failed || places.failed
                                 ? rx_error_memory(err, 0)
                                 : rx_error_at(err, RX_INPUT, path, hdu, 0,
                                               "holds an image of %d axes (%s), a 2-D one was expected; name "
                                               "one plane of it, the first by '%s[%d][*,*%s]'",
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

/* The 2-D images that a name selects, or planes of cubes by its section, maps as well; dst->list to be freed. No such image:
 * RX_INPUT; HDUs that are skipped are named in the log. */
static rx_status images_of(const rx_fits_name *name, rx_log *log, rx_image_list *dst, rx_error *err)
{
    const bool selected = rx_fits_name_selects(name);
    rx_fits_source source = {0};
    rx_fits_shape shape;
    int count = 1, broken = 0;
    rx_status status;
    *dst = (rx_image_list){0};
    RX_TRY_EXIT(rx_fits_open(name->path, &source, err));
    if (!selected)
        RX_TRY_EXIT(rx_fits_count(&source, &count, &broken, err));
    RX_TRY_EXIT(RX_MAKE(dst->list, (size_t)count, err));
    if (selected) {
        dst->n = 1;
        RX_TRY_EXIT(rx_fits_goto_name(&source, name, err));
        dst->list->hdu = source.hdu;
        RX_TRY_EXIT(rx_fits_shape_of(&source, &shape, err));
        RX_TRY_EXIT(rx_image_check(name->path, source.hdu, &shape, &name->section, err));
    } else
        status = list_all(&source, name, log, count, dst, err);
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
    return images_of(&all, log, dst, err);
}

/* Have both a name, the same, and the same version unless one states none? */
static bool is_same(const rx_image_hdu *a, const rx_image_hdu *b)
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

/* Those stay that are no maps of another one, unless all are maps. */
static void drop_maps(rx_image_list *images)
{
    int kept = 0;
    for (int i = 0; i < images->n; i++)
        if (map_of(images->list[i].name) < 0)
            images->list[kept++] = images->list[i];
    images->n = kept > 0 ? kept : images->n;
}

/* The log names the maps that are left out, each kind once, and the keywords that read one that is not taken by default. */
static rx_status log_maps(const char *path, rx_log *log, const rx_image_list *all, rx_error *err)
{
    rx_text maps = {0};
    int taken = -1, mask, variance, first = 0;
    bool plain = true; /* names of maps alone, which one WEIGHT_IMAGE can give */
    while (first < all->n && map_of(all->list[first].name) >= 0)
        first++;
    if (first == all->n)
        return RX_OK; /* where all are maps none is left out */
    rx_images_own_maps(all, all->list[first].hdu, &mask, &variance);
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
    else if (status == RX_OK && maps.length > 0)
        rx_log_hint(log, "%s: %s: maps, not measured", path, maps.data);
    rx_text_free(&maps);
    return status;
}

rx_status rx_tile_list(const char *name, rx_log *log, int **hdus, int *n, rx_error *err)
{
    rx_fits_name parsed;
    rx_image_list all = {0};
    rx_status status;
    *n = 0;
    *hdus = NULL;
    RX_TRY(rx_fits_name_parse(name, &parsed, err));
    RX_TRY_EXIT(images_of(&parsed, log, &all, err));
    RX_TRY_EXIT(log_maps(parsed.path, log, &all, err));
    drop_maps(&all);
    RX_TRY_EXIT(RX_MAKE(*hdus, (size_t)all.n, err));
    for (int i = 0; i < all.n; i++)
        (*hdus)[i] = all.list[i].hdu;
    *n = all.n;
exit:
    free(all.list);
    return status;
}

/* --- companions --- */

/* SExtractor's BIG: a variance of that much means no data, unless it is within MOST_VARIANCE of that of the tile's pixels, in
 * whatever unit these are. */
static const float NO_DATA = 1e30f;
static const double MOST_VARIANCE = 1e6; /* a pixel of more has no weight in any sum */

/* How many have the name and version of `wanted`, or the version alone; *last of them. */
static int count(const rx_image_list *of, const rx_image_hdu *wanted, bool by_name, int *last)
{
    int found = 0;
    for (int i = 0; i < of->n; i++) {
        const rx_image_hdu *one = &of->list[i];
        if (by_name ? !is_same(one, wanted) : wanted->version <= 0 || one->version != wanted->version)
            continue;
        found++;
        *last = i;
    }
    return found;
}

/* Of the HDUs with the name that is given the one of the tile's version, *hdu; -1: there are none or several. */
static rx_status choose_version(const rx_fits_name *parsed, int version, int *hdu, rx_error *err)
{
    rx_image_list all;
    rx_image_hdu wanted = {.version = version};
    int last;
    snprintf(wanted.name, sizeof wanted.name, "%s", parsed->extname);
    RX_TRY(rx_images_of_file(parsed, NULL, &all, err));
    *hdu = count(&all, &wanted, true, &last) == 1 ? all.list[last].hdu : -1;
    free(all.list);
    return RX_OK;
}

/* Is it, by its name or its version, that of another image than `own` of the tile's file? */
static bool is_of_another(const rx_image_hdu *map, const rx_image_list *tiles, const rx_image_hdu *own)
{
    int last;
    return tiles->n > 1 && !is_same(map, own) &&
           (count(tiles, map, true, &last) > 0 ||
            (own->version > 0 && map->version != own->version && count(tiles, map, false, &last) > 0));
}

/* Which HDU of a companion file belongs to the tile: the one that is named, by a name alone the one of the tile's EXTVER; else
 * the image of the tile's EXTNAME and EXTVER, or the only one of its EXTVER; else the only image for the only tile; else the
 * image of the tile's number when the tile was named by HDU, or of its place among those processed. Without being named none
 * is taken that has the name or the version of another image of the tile's file. */
static rx_status choose_hdu(const char *what, const char *name, const rx_fits_name *parsed,
                            const rx_tile_place *place, int *hdu, rx_error *err)
{
    const bool selected = rx_fits_name_selects(place->name), named = rx_fits_name_selects(parsed);
    rx_image_list maps = {0}, tiles = {0};
    rx_image_hdu own = {0};
    int chosen = -1, found;
    rx_status status;
    RX_TRY_EXIT(images_of(parsed, NULL, &maps, err));
    RX_TRY_EXIT(rx_images_of_file(place->name, NULL, &tiles, err));
    for (int i = 0; i < tiles.n; i++)
        if (tiles.list[i].hdu == place->hdu)
            own = tiles.list[i];
    drop_maps(&tiles);
    if (named || (maps.n == 1 && tiles.n == 1))
        chosen = 0;
    else if (count(&maps, &own, true, &found) == 1 ||
             (count(&tiles, &own, false, &found) == 1 && count(&maps, &own, false, &found) == 1))
        chosen = found;
    else if (selected && maps.n == 1)
        chosen = 0;
    else if (selected) {
        for (int i = 0; i < maps.n; i++)
            chosen = maps.list[i].hdu == place->hdu ? i : chosen;
    } else if (place->extension >= 1 && place->extension <= maps.n && (maps.n > 1 || tiles.n == 1))
        chosen = place->extension - 1;
    *hdu = chosen < 0 || (!named && is_of_another(&maps.list[chosen], &tiles, &own)) ? -1
                                                                                     : maps.list[chosen].hdu;
    if (parsed->extname[0] != '\0' && parsed->extver == 0 && tiles.n > 1)
        RX_TRY_EXIT(choose_version(parsed, own.version, hdu, err));
    if (*hdu < 0)
        status = rx_error_at(err, RX_INPUT, name, -1, 0,
                             "none of its %d images belongs to HDU %d%s%s of the tile (number %d of those "
                             "processed); name the %s with its HDU: '%s[n]'",
                             maps.n, place->hdu, own.name[0] != '\0' ? ", " : "", own.name, place->extension,
                             what, parsed->path);
exit:
    free(maps.list);
    free(tiles.list);
    return status;
}

/* A companion of the tile, open at its HDU, and the rectangle that covers the tile's pixels. */
typedef struct companion {
    rx_fits_name name;
    rx_fits_source source; /* rx_fits_done() in any case */
    int hdu;
    rx_fits_shape shape;
    rx_fits_section part;
} companion;

static rx_status open_companion(const char *what, const char *text, const rx_tile_place *place,
                                companion *dst, rx_error *err)
{
    rx_fits_section *part = &dst->part;
    *dst = (companion){0};
    RX_TRY(rx_fits_name_parse(text, &dst->name, err));
    const char *path = dst->name.path;
    RX_TRY(choose_hdu(what, text, &dst->name, place, &dst->hdu, err));
    RX_TRY(rx_fits_open(path, &dst->source, err));
    RX_TRY(rx_fits_goto(&dst->source, dst->hdu, err));
    RX_TRY(rx_fits_shape_of(&dst->source, &dst->shape, err));
    RX_TRY(rx_fits_check_size(&dst->source, &dst->shape, err));
    const long axes[2] = {(long)dst->shape.axes[0], (long)dst->shape.axes[1]};
    int same = 1, whole = 1;
    *part = rx_fits_part(&dst->name, &dst->shape);
    if (strcmp(path, place->name->path) == 0 && dst->hdu == place->hdu &&
        memcmp(part->plane, place->part.plane, sizeof part->plane) == 0)
        return rx_error_at(err, RX_INPUT, path, dst->hdu, 0,
                           "is the image itself; name the HDU of the %s: '%s[n]'", what, path);
    for (int i = 0; i < 2; i++) {
        if (part->last[i] > axes[i])
            return rx_error_at(err, RX_INPUT, path, dst->hdu, 0,
                               "the section leaves the %s of %ld x %ld pixels", what, axes[0], axes[1]);
        same = same && part->last[i] - part->first[i] == place->part.last[i] - place->part.first[i];
        whole = whole && part->first[i] == 1 && part->last[i] == axes[i] && axes[i] == place->shape.axes[i];
    }
    for (int i = 0; whole && i < 2; i++) { /* the whole map of a tile of which a section is read */
        part->first[i] = place->part.first[i];
        part->last[i] = place->part.last[i];
    }
    if (!whole && !same)
        return rx_error_at(err, RX_INPUT, path, dst->hdu, 0,
                           "the %s has %ld x %ld pixels, the tile %ld x %ld; give a map of the tile's shape",
                           what, part->last[0] - part->first[0] + 1, part->last[1] - part->first[1] + 1,
                           place->part.last[0] - place->part.first[0] + 1,
                           place->part.last[1] - place->part.first[1] + 1);
    return RX_OK;
}

/* Its pixels as floats; *map, closed, is where they come from. */
static rx_status read_companion(const char *what, const char *name, const rx_tile_place *place,
                                companion *map, float **dst, rx_error *err)
{
    const rx_fits_section *part = &place->part;
    rx_status status = open_companion(what, name, place, map, err);
    if (status == RX_OK)
        status = RX_MAKE(
            *dst, (size_t)(part->last[0] - part->first[0] + 1) * (size_t)(part->last[1] - part->first[1] + 1),
            err);
    if (status == RX_OK)
        status = rx_fits_read_pixels(&map->source, &map->part, *dst, err);
    rx_fits_done(&map->source);
    return status;
}

/* As SExtractor: a weight <= WEIGHT_THRESH (default 0), or an rms or a variance >= it (default 1e30), means no
 * data; so does what is no noise at all: not a finite number, rms or variance <= 0. An inverse variance is in units
 * of the image, so that the noise that it states needs no scale; what is not above the least one has none. */
static void mask_by_weight(const rx_tile_params *par, rx_tile *tile)
{
    size_t n = (size_t)tile->width * (size_t)tile->height;
    int given = isfinite(par->weight_threshold);
    const float least = given && par->weight_threshold > 0 ? (float)par->weight_threshold : 0.f;
    if (tile->weight_type == RX_WEIGHT_MAP_WEIGHT) {
        for (size_t i = 0; i < n; i++) {
            if (!isfinite(tile->weight[i]))
                tile->weight[i] = 0.f;
            if (tile->weight[i] <= least)
                tile->mask[i] |= RX_MASK_WEIGHT;
        }
        return;
    }
    if (tile->weight_type == RX_WEIGHT_MAP_IVAR) {
        for (size_t i = 0; i < n; i++)
            tile->weight[i] = tile->weight[i] > least ? 1.0f / sqrtf(tile->weight[i]) : NAN;
        tile->weight_type = RX_WEIGHT_MAP_RMS;
        given = 0;
    }
    const double noise_of_pixels = rx_unit_of_pixels(tile->pixels, tile->width, tile->height),
                 beyond = tile->weight_type == RX_WEIGHT_MAP_VAR
                              ? MOST_VARIANCE * noise_of_pixels * noise_of_pixels
                              : sqrt(MOST_VARIANCE) * noise_of_pixels;
    const float most = (float)fmin(fmax((double)NO_DATA, beyond), (double)FLT_MAX);
    const float limit = given && par->weight_threshold > 0 ? fminf((float)par->weight_threshold, most) : most;
    for (size_t i = 0; i < n; i++) {
        const float noise = tile->weight[i];
        if (!isfinite(noise))
            tile->weight[i] = NO_DATA;
        if (!isfinite(noise) || noise >= limit || noise <= 0.f)
            tile->mask[i] |= RX_MASK_WEIGHT;
    }
}

static rx_status add_weight(const rx_tile_params *par, const rx_tile_place *place, rx_tile *tile,
                            rx_error *err)
{
    companion map;
    tile->weight_type = par->weight_type;
    if (par->weight_type == RX_WEIGHT_NONE || par->weight_type == RX_WEIGHT_BACKGROUND)
        return RX_OK;
    if (par->weight_name == NULL || par->weight_name[0] == '\0')
        return rx_error_set(err, RX_USAGE, "WEIGHT_TYPE asks for a map; give WEIGHT_IMAGE");
    RX_TRY(read_companion("weight map", par->weight_name, place, &map, &tile->weight, err));
    mask_by_weight(par, tile);
    return RX_OK;
}

rx_status rx_tile_take_weight(const rx_tile_params *par, const float *weight, rx_tile *tile, rx_error *err)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    const bool asked = par->weight_type > RX_WEIGHT_BACKGROUND;
    tile->weight_type = par->weight_type;
    if (asked != (weight != NULL))
        return rx_error_at(err, RX_USAGE, tile->name, -1, 0,
                           asked ? "WEIGHT_TYPE asks for a map; give its array"
                                 : "has a weight map; say by WEIGHT_TYPE what it holds (MAP_WEIGHT, MAP_RMS, "
                                   "MAP_VAR or MAP_IVAR)");
    if (!asked)
        return RX_OK;
    RX_TRY(RX_MAKE(tile->weight, n, err));
    memcpy(tile->weight, weight, n * sizeof *tile->weight);
    mask_by_weight(par, tile);
    return RX_OK;
}

/* A plane of what was restored elsewhere. Where the tile has data it has to have some, too, and a noise above 0. */
static rx_status add_restored(const char *what, const char *name, const rx_tile_place *place, bool noise,
                              const rx_tile *tile, float **dst, rx_error *err)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    companion map;
    if (name == NULL || name[0] == '\0')
        return RX_OK;
    RX_TRY(read_companion(what, name, place, &map, dst, err));
    for (size_t i = 0; i < n; i++) {
        const float value = (*dst)[i];
        if ((tile->mask[i] & (RX_MASK_BAD | RX_MASK_WEIGHT)) != 0)
            (*dst)[i] = isfinite(value) ? value : 0.0f;
        else if (!isfinite(value) || (noise && !(value > 0.0f)))
            return rx_error_at(err, RX_INPUT, map.name.path, map.hdu, 0,
                               "the %s is %g in pixel (%ld,%ld), where the tile has data; give %s", what,
                               (double)value, map.part.first[0] + (long)(i % (size_t)tile->width),
                               map.part.first[1] + (long)(i / (size_t)tile->width),
                               noise ? "a number above 0 there" : "a number there");
    }
    return RX_OK;
}

/* Flags are integers of up to 32 bits, as IMAFLAGS_ISO is, which a double holds; compressed images cannot be
 * read as LONGLONG. Negative ones keep their bit pattern, where the map has no more bits than that. Floats will do that are
 * integers, as a mask is that went through arithmetic. */
static rx_status read_flags(const companion *map, uint32_t *dst, rx_error *err)
{
    const double least = map->shape.bitpix > 32 ? 0 : INT32_MIN;
    const long *first = map->part.first, *last = map->part.last;
    const double null = 0;
    size_t width = (size_t)(last[0] - first[0] + 1), height = (size_t)(last[1] - first[1] + 1);
    rx_status status = RX_OK;
    double *row;
    RX_TRY(RX_MAKE(row, width, err));
    for (size_t y = 0; y < height; y++) {
        RX_TRY_EXIT(rx_fits_read_rows(&map->source, &map->part, y, 1, &null, row, err));
        for (size_t x = 0; x < width; x++) {
            const double flags = row[x];
            const bool whole = flags == floor(flags);
            if (!whole || flags < least || flags > UINT32_MAX)
                RX_TRY_EXIT(rx_error_at(
                    err, RX_INPUT, map->name.path, map->hdu, 0,
                    whole ? "the flags %.0f of pixel (%ld,%ld) have bits beyond the 32 that IMAFLAGS_ISO "
                            "holds; give a map of 32 bits"
                          : "the flags %g of pixel (%ld,%ld) are no integer; give a map of integers",
                    flags, first[0] + (long)x, first[1] + (long)y));
            dst[y * width + x] = (uint32_t)(int64_t)flags;
        }
    }
exit:
    free(row);
    return status;
}

static rx_status add_flags(const rx_tile_params *par, const rx_tile_place *place, rx_tile *tile,
                           rx_error *err)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_status status = RX_OK;
    if (par->nflags > 0)
        status = RX_MAKE(tile->flagmaps, (size_t)par->nflags, err);
    for (int i = 0; status == RX_OK && i < par->nflags; i++) {
        companion map;
        RX_TRY(RX_MAKE(tile->flagmaps[i], n, err));
        tile->nflagmaps = i + 1;
        status = open_companion("flag map", par->flag_names[i], place, &map, err);
        if (status == RX_OK)
            status = read_flags(&map, tile->flagmaps[i], err);
        rx_fits_done(&map.source);
    }
    return status;
}

/* --- maps beside the image --- */

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

/* What the mask says joins tile->mask; *said: of which bits, "" where it is left out. */
static rx_status add_mask(const char *name, const rx_tile_place *place, rx_log *log, rx_tile *tile,
                          const char **said, rx_error *err)
{
    static const char *const no_data[] = {"MP_BAD", "MP_CR", "MP_NO_DATA"}, *const saturated[] = {"MP_SAT"};
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    size_t ncards = 0;
    char *cards = NULL;
    uint32_t *flags = NULL;
    companion map;
    rx_status status;
    RX_TRY_EXIT(open_companion("flag map", name, place, &map, err));
    RX_TRY_EXIT(RX_MAKE(flags, n, err));
    RX_TRY_EXIT(read_flags(&map, flags, err));
    RX_TRY_EXIT(rx_fits_read_cards(&map.source, &cards, &ncards, err));
    uint32_t bad = bits_of(cards, ncards, no_data, sizeof no_data / sizeof *no_data);
    const uint32_t full = bits_of(cards, ncards, saturated, 1);
    const bool named = (bad | full) != 0;
    bool simple = !named; /* 0 and 1 alone: 1 is bad; else bits without names may say anything */
    for (size_t i = 0; simple && i < n; i++)
        simple = flags[i] <= 1;
    bad |= simple ? 1 : 0;
    for (size_t i = 0; i < n; i++)
        tile->mask[i] |=
            (uint8_t)((flags[i] & bad ? RX_MASK_WEIGHT : 0) | (flags[i] & full ? RX_MASK_SATURATED : 0));
    if (!named && !simple)
        rx_log_warning(log,
                       "%s[%d]: is a MASK of several bits and names none of them (MP_BAD, MP_SAT): it is "
                       "left out; FLAG_IMAGE '%s' puts its bits into IMAFLAGS_ISO",
                       map.name.path, map.hdu, name);
    *said = named ? " and the MASK (BAD, CR, NO_DATA, SAT)" : simple ? " and the MASK (1 is bad)" : "";
exit:
    rx_fits_done(&map.source);
    free(cards);
    free(flags);
    return status;
}

static rx_status add_own_maps(const rx_tile_params *par, const rx_tile_place *place, rx_log *log,
                              rx_tile *tile, rx_error *err)
{
    const char *path = place->name->path, *said = "";
    char name[sizeof place->name->path + 16];
    int mask, variance;
    rx_image_list all;
    rx_tile_params own = *par;
    rx_error reason = rx_error_part(err);
    RX_TRY(rx_images_of_file(place->name, NULL, &all, err));
    rx_images_own_maps(&all, place->hdu, &mask, &variance);
    free(all.list);
    if (mask < 0)
        return RX_OK;
    own.weight_type = RX_WEIGHT_MAP_VAR;
    own.weight_name = name;
    snprintf(name, sizeof name, "%s[%d]", path, variance);
    rx_status status = add_weight(&own, place, tile, &reason);
    snprintf(name, sizeof name, "%s[%d]", path, mask);
    if (status == RX_OK)
        status = add_mask(name, place, log, tile, &said, &reason);
    if (status == RX_INPUT) /* of a map that was not asked for */
        return rx_error_at(err, status, reason.where, reason.hdu, reason.line,
                           "%s; WEIGHT_TYPE NONE leaves it out", reason.text);
    if (status != RX_OK)
        return rx_error_take(err, &reason);
    rx_log_info(log, "%s[%d]: measured with the VARIANCE%s of its file; WEIGHT_TYPE NONE leaves %s out", path,
                place->hdu, said, said[0] != '\0' ? "them" : "it");
    return RX_OK;
}

rx_status rx_tile_add_maps(const rx_tile_params *par, const rx_tile_place *place, rx_log *log, rx_tile *tile,
                           rx_error *err)
{
    RX_TRY(add_weight(par, place, tile, err));
    if (par->own_maps)
        RX_TRY(add_own_maps(par, place, log, tile, err));
    RX_TRY(add_restored("restored image", par->restored_name, place, false, tile, &tile->restored, err));
    RX_TRY(add_restored("noise of the restored image", par->restored_noise_name, place, true, tile,
                        &tile->restored_noise, err));
    return add_flags(par, place, tile, err);
}
