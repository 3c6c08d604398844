/* Opening a tile: read, background, PSF. */
#include "stage/field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/map.h"
#include "detect/filter.h"
#include "io/fits_read.h"
#include "io/tile.h"
#include "io/wcs.h"

static int any_saturated(const rx_tile *tile)
{
    const size_t width = (size_t)tile->width;
    for (int y = 0; y < tile->height; y++) { /* whole rows: no branch in a loop over all pixels */
        const uint8_t *mask = tile->mask + (size_t)y * width;
        uint8_t bits = 0;
#pragma omp simd reduction(| : bits)
        for (size_t x = 0; x < width; x++)
            bits |= mask[x];
        if (bits & RX_MASK_SATURATED)
            return 1;
    }
    return 0;
}

static rx_status measure_background(const rx_options *options, int role, const rx_tile *tile, int hide,
                                    rx_background **dst, rx_error *err)
{
    rx_status status =
        rx_background_measure(&options->background[role], tile->width, tile->height, tile->pixels, tile->mask,
                              hide, tile->weight, tile->weight_type, dst, err);
    if (status != RX_OK && err != NULL && err->where[0] == '\0')
        snprintf(err->where, sizeof err->where, "%s", tile->name), err->hdu = tile->hdu;
    return status;
}

void rx_field_above_sky(const rx_tile *tile, const rx_background *sky, int hide, int nthreads, float *dst)
{
    const rx_map levels = rx_background_level(sky);
    const int width = tile->width;
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1)
    for (int y = 0; y < tile->height; y++)
        for (int x = 0; x < width; x += RX_MAP_PIECE) {
            const size_t at = (size_t)y * (size_t)width + (size_t)x;
            const int n = rx_map_piece(x, width);
            float room[RX_MAP_PIECE];
            const float *level = rx_map_row(&levels, y, x, n, room);
            for (int i = 0; i < n; i++)
                dst[at + (size_t)i] =
                    (tile->mask[at + (size_t)i] & hide) != 0 ? 0.0f : tile->pixels[at + (size_t)i] - level[i];
        }
}

/* The detection image after the filter; NULL without one. */
static rx_status filter_pixels(const rx_options *options, const rx_tile *tile, const float *pixels,
                               float **filtered, rx_error *err)
{
    const rx_detect_params *par = &options->detect;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_filter filter;
    rx_status status = rx_filter_new(par->filter, par->filter_width, par->filter_height, &filter, err);
    if (status != RX_OK || filter.values == NULL)
        return status;
    *filtered = rx_alloc_filled(n, sizeof **filtered, options->nthreads);
    if (*filtered == NULL)
        status = rx_error_memory(err, n * sizeof **filtered);
    else
        rx_filter_plane(&filter, pixels, tile->width, tile->height, options->nthreads, *filtered);
    rx_filter_free(&filter);
    return status;
}

/* Candidate stars for PSF_TYPE AUTO: a plain extraction that never looks at saturated values. */
static rx_status find_stars(const rx_options *options, const rx_field *field, rx_log *log, rx_sources **dst,
                            rx_error *err)
{
    const rx_tile *tile = field->tile;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    const rx_map noise = rx_background_noise(field->restored);
    rx_sources *sources = NULL;
    rx_status status = RX_OK;
    float *pixels = RX_NEW(float, n), *sigma = RX_NEW(float, n), *filtered = NULL;
    if (pixels == NULL || sigma == NULL) {
        status = rx_error_memory(err, 2 * n * sizeof(float));
        goto exit;
    }
    rx_field_above_sky(tile, field->restored, RX_HIDE_RESTORED, options->nthreads, pixels);
    rx_map_fill(&noise, tile->height, options->nthreads, sigma);
    rx_detect_image detect = {.width = tile->width,
                              .height = tile->height,
                              .pixels = pixels,
                              .noise = rx_map_plane(sigma, tile->width),
                              .mask = tile->mask,
                              .mask_bits = RX_HIDE_RESTORED,
                              .variable_noise = 1,
                              .global_sigma = field->restored->global_sigma};
    rx_measure_image measure = {.width = tile->width,
                                .height = tile->height,
                                .pixels = pixels,
                                .sigma = sigma,
                                .level = rx_background_level(field->restored),
                                .mask = tile->mask,
                                .mask_bits = RX_HIDE_RESTORED,
                                .saturated_mask = tile->mask,
                                .gain = tile->gain,
                                .global_sigma = field->restored->global_sigma,
                                .variable_noise = 1,
                                .law_scale = 1.0,
                                .law_power = 0.5};
    rx_detect_params detect_params = options->detect;
    detect_params.absolute = 0;
    detect_params.threshold = detect_params.analysis_threshold = 3.0;
    rx_measure_params measure_params = options->measure;
    measure_params.nnw_file = NULL;
    measure_params.skip = RX_SKIP_PETRO | RX_SKIP_APER | RX_SKIP_WIN;
    measure_params.vignet_width = measure_params.vignet_height = 0;
    measure_params.nradii = 1;
    measure_params.flux_fraction[0] = 0.5;
    /* hidden pixels are 0 already: detection needs no copy of them, and no filtered ones after it */
    status = filter_pixels(options, tile, pixels, &filtered, err);
    detect.filtered = filtered != NULL ? filtered : pixels;
    detect.done_with = filtered != NULL ? &filtered : NULL;
    if (status == RX_OK)
        status = rx_detect_run(&detect_params, &detect, log, &sources, err);
    if (status == RX_OK)
        status = rx_measure_run(&measure_params, &measure, log, sources, err);
    if (status == RX_OK) {
        *dst = sources;
        sources = NULL;
    }
exit:
    rx_sources_free(sources);
    free(pixels);
    free(sigma);
    free(filtered);
    return status;
}

/* Arcsec a pixel; 0: not known. */
static double pixel_scale(const rx_options *options, const rx_tile *tile)
{
    return tile->wcs != NULL
               ? rx_wcs_pixel_scale(tile->wcs, 0.5 * (tile->width - 1), 0.5 * (tile->height - 1))
               : options->stated_scale;
}

/* FWHM in pixels that the tile's header states, *key says where; 0: nowhere. Surveys write arcsec or pixels
 * under the same name: a card whose comment does not say which is not taken. */
static double header_fwhm(const rx_tile *tile, double scale, const char **key)
{
    static const char *const keys[] = {"PSF_FWHM", "SEEING", "FWHM", "MEDFWHM", "IQFINAL"};
    const long n = tile->cards != NULL ? (long)tile->ncards : 0;
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        char comment[80];
        double value;
        if (!rx_cards_number(tile->cards, n, keys[i], &value) ||
            !rx_cards_comment(tile->cards, n, keys[i], comment, sizeof comment))
            continue;
        const bool arcsec = strstr(comment, "arcsec") != NULL, pixels = strstr(comment, "pix") != NULL;
        const double fwhm = arcsec == pixels ? 0.0 : pixels ? value : scale > 0.0 ? value / scale : 0.0;
        *key = keys[i];
        if (fwhm >= 0.5 && fwhm <= 50.0)
            return fwhm;
    }
    return 0.0;
}

static const double LEAST_FWHM = 0.1; /* of a Moffat, pixels: psf/psf.c */

/* Where no stars say it, what was stated of the PSF serves (PSF_FWHM, the header, a SEEING_FWHM that was given),
 * loudly where stars were asked; where nothing was, the tile stays as it is. */
static rx_status stated_psf(const rx_options *options, const rx_error *why, rx_field *field, rx_log *log,
                            rx_error *err)
{
    const rx_tile *tile = field->tile;
    rx_psf_params par = options->psf;
    const char *key = par.fwhm > 0.0 ? "PSF_FWHM" : NULL, *where = "";
    const double scale = pixel_scale(options, tile);
    par.type = RX_PSF_MOFFAT;
    if (key == NULL) {
        par.fwhm = header_fwhm(tile, scale, &key);
        where = " of the header";
    }
    if (!(par.fwhm > 0.0) && options->seeing_stated && scale > 0.0) {
        par.fwhm = options->seeing_arcsec / scale;
        key = "SEEING_FWHM";
        where = "";
    }
    if (!(par.fwhm >= LEAST_FWHM)) { /* a pixel scale of degrees, or none */
        rx_log_warning(log, "%s[%d]: %s", tile->name, tile->hdu, why->text);
        field->unrestorable = 1;
        return RX_OK;
    }
    if (options->psf.type == RX_PSF_AUTO)
        rx_log_warning(log, "%s[%d]: %.*s; %s%s is taken: Moffat of FWHM %.2f pixels", tile->name, tile->hdu,
                       (int)strcspn(why->text, ";"), why->text, key, where, par.fwhm);
    rx_status status = rx_psf_make(&par, tile, field->restored, NULL, log, &field->psf, err);
    if (status == RX_OK) {
        char *said = field->psf->description;
        const size_t used = strlen(said);
        snprintf(said + used, sizeof field->psf->description - used, ", from %s%s", key, where);
    }
    return status;
}

static rx_status make_psf(const rx_options *options, int role, rx_field *field, rx_log *log, rx_error *err)
{
    rx_psf_params par = options->psf;
    par.file = options->psf_files[role];
    rx_sources *stars = NULL;
    rx_error why = RX_ERROR_NONE;
    if (par.type == RX_PSF_MOFFAT && !(par.fwhm > 0.0)) {
        rx_error_set(&why, RX_INPUT,
                     "PSF_TYPE MOFFAT needs the FWHM of stars; give PSF_FWHM in pixels, or "
                     "SEEING_FWHM in arcsec, with PIXEL_SCALE where there is no WCS");
        return stated_psf(options, &why, field, log, err);
    }
    if (par.type != RX_PSF_AUTO)
        return rx_psf_make(&par, field->tile, field->restored, NULL, log, &field->psf, err);
    rx_status status = find_stars(options, field, log, &stars, err);
    if (status != RX_OK)
        return status;
    status = rx_psf_make(&par, field->tile, field->restored, stars, log, &field->psf, &why);
    rx_sources_free(stars);
    if (status == RX_INPUT)
        return stated_psf(options, &why, field, log, err);
    if (status != RX_OK && err != NULL)
        *err = why;
    return status;
}

/* Both backgrounds of field->tile. */
static rx_status measure_backgrounds(const rx_options *options, int role, rx_field *field, rx_error *err)
{
    int hide_plain = options->saturated_in_none ? RX_HIDE_RESTORED : RX_HIDE_PLAIN;
    rx_status status = measure_background(options, role, field->tile, hide_plain, &field->plain, err);
    field->restored = field->plain;
    if (status != RX_OK || hide_plain == RX_HIDE_RESTORED || !any_saturated(field->tile))
        return status;
    field->restored = NULL;
    return measure_background(options, role, field->tile, RX_HIDE_RESTORED, &field->restored, err);
}

rx_status rx_field_prepare(const rx_options *options, int role, rx_tile *tile, const rx_psf *known,
                           int need_psf, rx_log *log, rx_field **dst, rx_error *err)
{
    rx_field *field = RX_NEW(rx_field, 1);
    if (field == NULL) {
        rx_tile_free(tile);
        return rx_error_memory(err, sizeof *field);
    }
    field->tile = tile;
    double begun = rx_seconds();
    rx_status status = measure_backgrounds(options, role, field, err);
    if (status != RX_OK)
        goto exit;
    field->background_seconds = rx_seconds() - begun;
    begun = rx_seconds();
    rx_log_detail(log, "%s[%d]: %d x %d pixels, background %g, noise %g, gain %g, pixel scale %g arcsec",
                  tile->name, tile->hdu, tile->width, tile->height, field->plain->global_level,
                  field->plain->global_sigma, tile->gain, tile->pixel_scale);
    if (known != NULL) {
        field->psf = rx_psf_copy(known);
        if (field->psf == NULL)
            status = rx_error_memory(err, 0);
    } else if (need_psf) {
        status = make_psf(options, role, field, log, err);
    }
    field->psf_seconds = rx_seconds() - begun;
    if (status == RX_OK && known == NULL && field->psf != NULL)
        rx_log_info(log, "%s[%d]: PSF %s", tile->name, tile->hdu, field->psf->description);
exit:
    if (status == RX_OK)
        *dst = field;
    else
        rx_field_free(field);
    return status;
}

rx_status rx_field_open(const rx_options *options, int role, const char *name, int hdu, int extension,
                        int need_psf, rx_log *log, rx_field **dst, rx_error *err)
{
    rx_tile *tile = NULL;
    const double begun = rx_seconds();
    rx_status status = rx_tile_read(&options->tile[role], name, hdu, extension, log, &tile, err);
    const double read_seconds = rx_seconds() - begun;
    if (status == RX_OK)
        status = rx_field_prepare(options, role, tile, NULL, need_psf, log, dst, err);
    if (status == RX_OK)
        rx_log_detail(log, "%s[%d]: seconds: read %.4f, background %.4f, PSF %.4f", (*dst)->tile->name,
                      (*dst)->tile->hdu, read_seconds, (*dst)->background_seconds, (*dst)->psf_seconds);
    return status;
}

void rx_field_free(rx_field *field)
{
    if (field == NULL)
        return;
    if (field->restored != field->plain)
        rx_background_free(field->restored);
    rx_background_free(field->plain);
    rx_psf_free(field->psf);
    rx_tile_free(field->tile);
    free(field);
}
