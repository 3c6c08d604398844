/* The maps that go with a tile: weights and flags. */
#include "io/tile_weight.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/unit.h"
#include "io/planes.h"

/* SExtractor's BIG: a variance of that much means no data, unless it is within MOST_VARIANCE of that of the tile's pixels, in
 * whatever unit these are. */
static const float NO_DATA = 1e30f;
static const double MOST_VARIANCE = 1e6; /* a pixel of more has no weight in any sum */

/* Names of the images of a file; *dst [*n] to be freed. */
static rx_status image_names(const char *path, const int *hdus, int n, rx_plane_name **dst, rx_error *err)
{
    rx_fits_source source = {0};
    rx_status status = rx_fits_open(path, &source, err);
    if (status == RX_OK)
        status = RX_MAKE(*dst, (size_t)n, err);
    for (int i = 0; i < n && status == RX_OK; i++)
        status = rx_planes_name(source.file, path, hdus[i], &(*dst)[i], err);
    rx_fits_done(&source);
    return status;
}

static int count_name(const rx_plane_name *names, int n, const rx_plane_name *name, int *last)
{
    int found = 0;
    for (int i = 0; i < n; i++)
        if (rx_planes_same(&names[i], name)) {
            found++;
            *last = i;
        }
    return found;
}

static int count_version(const rx_plane_name *names, int n, int version, int *last)
{
    int found = 0;
    for (int i = 0; i < n && version > 0; i++)
        if (names[i].version == version) {
            found++;
            *last = i;
        }
    return found;
}

/* Of the HDUs with the name that is given the one of the tile's version, *hdu; -1: there are none or several. */
static rx_status choose_version(const rx_fits_name *parsed, int version, int *hdu, rx_error *err)
{
    rx_fits_name all = *parsed;
    rx_plane_name *names = NULL, name = {.version = version};
    int *hdus = NULL, n = 0, last;
    rx_status status;
    snprintf(name.name, sizeof name.name, "%s", parsed->extname);
    all.extname[0] = '\0';
    *hdu = -1;
    RX_TRY_EXIT(rx_tile_list_named(&all, true, NULL, &hdus, &n, err));
    RX_TRY_EXIT(image_names(parsed->path, hdus, n, &names, err));
    if (count_name(names, n, &name, &last) == 1)
        *hdu = hdus[last];
exit:
    free(hdus);
    free(names);
    return status;
}

/* Which HDU of a companion file belongs to the tile: the one that is named, by a name alone the one of the tile's EXTVER; else
 * the image of the tile's EXTNAME and EXTVER, or the only one of its EXTVER; else the only image for the only tile; else the
 * image of the tile's number when the tile was named by HDU, or of its place among those processed. Without being named none
 * is taken that has the name or the version of another image of the tile's file. */
static rx_status choose_hdu(const char *what, const char *name, const rx_fits_name *parsed,
                            const rx_tile_place *place, int *hdu, rx_error *err)
{
    const bool selected = rx_fits_name_selects(place->name), named = rx_fits_name_selects(parsed);
    rx_fits_name all = *place->name; /* the file's images, of which the tile is one */
    int *hdus = NULL, *tiles = NULL, n = 0, ntiles = 0, chosen = -1, found;
    rx_plane_name *names = NULL, *others = NULL, *own = NULL;
    rx_status status;
    all.hdu = -1;
    all.extname[0] = '\0';
    RX_TRY_EXIT(rx_tile_list_named(parsed, true, NULL, &hdus, &n, err));
    RX_TRY_EXIT(rx_tile_list_named(&all, false, NULL, &tiles, &ntiles, err));
    RX_TRY_EXIT(image_names(place->name->path, &place->hdu, 1, &own, err));
    RX_TRY_EXIT(image_names(parsed->path, hdus, n, &names, err));
    RX_TRY_EXIT(image_names(place->name->path, tiles, ntiles, &others, err));
    if (named || (n == 1 && ntiles == 1))
        chosen = 0;
    else if (count_name(names, n, own, &found) == 1 ||
             (count_version(others, ntiles, own->version, &found) == 1 &&
              count_version(names, n, own->version, &found) == 1))
        chosen = found;
    else if (selected && n == 1)
        chosen = 0;
    else if (selected) {
        for (int i = 0; i < n; i++)
            chosen = hdus[i] == place->hdu ? i : chosen;
    } else if (place->extension >= 1 && place->extension <= n && (n > 1 || ntiles == 1))
        chosen = place->extension - 1;
    *hdu = chosen < 0 ? -1 : hdus[chosen];
    if (parsed->extname[0] != '\0' && parsed->extver == 0 && ntiles > 1)
        RX_TRY_EXIT(choose_version(parsed, own->version, hdu, err));
    else if (chosen >= 0 && !named && ntiles > 1 && !rx_planes_same(&names[chosen], own) &&
             (count_name(others, ntiles, &names[chosen], &found) > 0 ||
              (own->version > 0 && names[chosen].version != own->version &&
               count_version(others, ntiles, names[chosen].version, &found) > 0)))
        *hdu = -1; /* that of another image */
    if (*hdu < 0)
        status = rx_error_at(
            err, RX_INPUT, name, -1, 0,
            "none of its %d images belongs to HDU %d%s%s of the tile (number %d of those processed); name "
            "the %s with its HDU: '%s[n]'",
            n, place->hdu, own->name[0] != '\0' ? ", " : "", own->name, place->extension, what, parsed->path);
exit:
    free(hdus);
    free(tiles);
    free(names);
    free(others);
    free(own);
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
    RX_TRY(rx_fits_goto(dst->source.file, path, dst->hdu, err));
    int failed = rx_fits_shape_of(dst->source.file, &dst->shape);
    if (failed)
        return rx_fits_failed(err, RX_INPUT, path, dst->hdu, failed, "this HDU cannot be read");
    RX_TRY(rx_fits_check_size(&dst->source, path, dst->hdu, &dst->shape, err));
    const long axes[2] = {(long)dst->shape.axes[0], (long)dst->shape.axes[1]};
    int same = 1, whole = 1;
    *part = rx_fits_part(&dst->name, axes);
    if (strcmp(path, place->name->path) == 0 && dst->hdu == place->hdu &&
        memcmp(part->plane, place->part.plane, sizeof part->plane) == 0)
        return rx_error_at(err, RX_INPUT, path, dst->hdu, 0,
                           "is the image itself; name the HDU of the %s: '%s[n]'", what, path);
    for (int i = 0; i < 2; i++) {
        if (part->last[i] > axes[i])
            return rx_error_at(err, RX_INPUT, path, dst->hdu, 0,
                               "the section leaves the %s of %ld x %ld pixels", what, axes[0], axes[1]);
        same = same && part->last[i] - part->first[i] == place->part.last[i] - place->part.first[i];
        whole = whole && part->first[i] == 1 && part->last[i] == axes[i] && axes[i] == place->full[i];
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

/* An inverse variance is in units of the image, so that the noise that it states needs no scale; what is not above the
 * least one has none. */
static void rms_of_ivar(double threshold, rx_tile *tile)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    const float limit = threshold > 0.0 ? (float)threshold : 0.0f; /* 0 where it is not given, too */
    for (size_t i = 0; i < n; i++)
        tile->weight[i] = tile->weight[i] > limit ? 1.0f / sqrtf(tile->weight[i]) : NAN;
    tile->weight_type = RX_WEIGHT_MAP_RMS;
}

static float no_data_from(const rx_tile *tile)
{
    const double noise = rx_unit_of_pixels(tile->pixels, tile->width, tile->height),
                 most = tile->weight_type == RX_WEIGHT_MAP_VAR ? MOST_VARIANCE * noise * noise
                                                               : sqrt(MOST_VARIANCE) * noise;
    return (float)fmin(fmax((double)NO_DATA, most), (double)FLT_MAX);
}

/* As SExtractor: a weight <= WEIGHT_THRESH (default 0), or an rms or a variance >= it (default
 * 1e30), means no data; so does what is no noise at all: not a finite number, rms or variance <= 0. */
static void mask_by_weight(const rx_tile_params *par, rx_tile *tile)
{
    size_t n = (size_t)tile->width * (size_t)tile->height;
    int given = isfinite(par->weight_threshold);
    if (tile->weight_type == RX_WEIGHT_MAP_WEIGHT) {
        float limit = given && par->weight_threshold > 0 ? (float)par->weight_threshold : 0.f;
        for (size_t i = 0; i < n; i++) {
            if (!isfinite(tile->weight[i]))
                tile->weight[i] = 0.f;
            if (tile->weight[i] <= limit)
                tile->mask[i] |= RX_MASK_WEIGHT;
        }
        return;
    }
    if (tile->weight_type == RX_WEIGHT_MAP_IVAR) {
        rms_of_ivar(par->weight_threshold, tile);
        given = 0;
    }
    const float most = no_data_from(tile);
    const float limit = given && par->weight_threshold > 0 ? fminf((float)par->weight_threshold, most) : most;
    for (size_t i = 0; i < n; i++) {
        const float noise = tile->weight[i];
        if (!isfinite(noise))
            tile->weight[i] = NO_DATA;
        if (!isfinite(noise) || noise >= limit || noise <= 0.f)
            tile->mask[i] |= RX_MASK_WEIGHT;
    }
}

rx_status rx_tile_add_weight(const rx_tile_params *par, const rx_tile_place *place, rx_tile *tile,
                             rx_error *err)
{
    companion map;
    tile->weight_type = par->weight_type;
    if (par->weight_type == RX_WEIGHT_NONE || par->weight_type == RX_WEIGHT_BACKGROUND)
        return RX_OK;
    if (par->weight_name == NULL || par->weight_name[0] == '\0')
        return rx_error_set(err, RX_USAGE, "WEIGHT_TYPE asks for a map; give WEIGHT_IMAGE");
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_status status = open_companion("weight map", par->weight_name, place, &map, err);
    if (status == RX_OK && (tile->weight = RX_NEW(float, n)) == NULL)
        status = rx_error_memory(err, n * sizeof(float));
    if (status == RX_OK)
        status = rx_fits_read_pixels(map.source.file, map.name.path, map.hdu, &map.part, tile->weight, err);
    if (status == RX_OK)
        mask_by_weight(par, tile);
    rx_fits_done(&map.source);
    return status;
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
    tile->weight = RX_NEW(float, n);
    if (tile->weight == NULL)
        return rx_error_memory(err, n * sizeof *tile->weight);
    memcpy(tile->weight, weight, n * sizeof *tile->weight);
    mask_by_weight(par, tile);
    return RX_OK;
}

/* Flags are integers of up to 32 bits, as IMAFLAGS_ISO is, which a double holds; compressed images cannot be
 * read as LONGLONG. Negative ones keep their bit pattern, where the map has no more bits than that. Floats will do that are
 * integers, as a mask is that went through arithmetic. */
static rx_status read_flags(const companion *map, uint32_t *dst, rx_error *err)
{
    const double least = map->shape.bitpix > 32 ? 0 : INT32_MIN;
    const long *first = map->part.first, *last = map->part.last;
    rx_fits_corner low, high, step = {1, 1, 1, 1, 1, 1, 1, 1, 1};
    size_t width = (size_t)(last[0] - first[0] + 1), height = (size_t)(last[1] - first[1] + 1);
    int failed = 0, anynul = 0;
    double null = 0, *row = RX_NEW(double, width);
    if (row == NULL)
        return rx_error_memory(err, width * sizeof *row);
    for (size_t y = 0; y < height && !failed; y++) {
        rx_fits_rows(&map->part, y, 1, low, high);
        fits_read_subset(map->source.file, TDOUBLE, low, high, step, &null, row, &anynul, &failed);
        for (size_t x = 0; x < width && !failed; x++) {
            const double flags = row[x];
            const bool whole = flags == floor(flags);
            if (!whole || flags < least || flags > UINT32_MAX) {
                free(row);
                return rx_error_at(
                    err, RX_INPUT, map->name.path, map->hdu, 0,
                    whole ? "the flags %.0f of pixel (%ld,%ld) have bits beyond the 32 that "
                            "IMAFLAGS_ISO holds; give a map of 32 bits"
                          : "the flags %g of pixel (%ld,%ld) are no integer; give a map of integers",
                    flags, first[0] + (long)x, first[1] + (long)y);
            }
            dst[y * width + x] = (uint32_t)(int64_t)flags;
        }
    }
    free(row);
    return failed
               ? rx_fits_failed(err, RX_INPUT, map->name.path, map->hdu, failed, "the pixels cannot be read")
               : RX_OK;
}

rx_status rx_tile_read_flags(const char *name, const rx_tile_place *place, uint32_t *dst, rx_error *err)
{
    companion map;
    rx_status status = open_companion("flag map", name, place, &map, err);
    if (status == RX_OK)
        status = read_flags(&map, dst, err);
    rx_fits_done(&map.source);
    return status;
}

rx_status rx_tile_add_flags(const rx_tile_params *par, const rx_tile_place *place, rx_tile *tile,
                            rx_error *err)
{
    rx_status status = RX_OK;
    size_t n = (size_t)tile->width * (size_t)tile->height;
    if (par->nflags <= 0)
        return RX_OK;
    RX_TRY(RX_MAKE(tile->flagmaps, (size_t)par->nflags, err));
    for (int i = 0; status == RX_OK && i < par->nflags; i++) {
        status = RX_MAKE(tile->flagmaps[i], n, err);
        if (status == RX_OK) {
            tile->nflagmaps = i + 1;
            status = rx_tile_read_flags(par->flag_names[i], place, tile->flagmaps[i], err);
        }
    }
    return status;
}
