/* Opening a tile: read, background, PSF. */
#include "pipeline/field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/names.h"
#include "base/text.h"
#include "catalog/assoc.h"
#include "catalog/catalog.h"
#include "data/gaps.h"
#include "data/map.h"
#include "data/unit.h"
#include "detect/correlation.h"
#include "detect/filter.h"
#include "detect/hollow.h"
#include "detect/no_data.h"
#include "detect/photons.h"
#include "detect/saturation.h"
#include "io/fits_read.h"
#include "io/tile.h"
#include "io/wcs.h"
#include "pipeline/crowd_psf.h"
#include "pipeline/field_noise.h"
#include "psf/psf_files.h"

/* Share of the pixels at SATUR_LEVEL or above. */
static double saturated_share(const rx_image *image)
{
    const size_t width = (size_t)image->width;
    size_t all = 0;
    for (int y = 0; image->mask != NULL && y < image->height; y++) {
        const uint8_t *mask = image->mask + (size_t)y * width;
        unsigned in_row = 0;
#pragma omp simd reduction(+ : in_row)
        for (size_t x = 0; x < width; x++)
            in_row += (mask[x] & RX_MASK_SATURATED) != 0;
        all += in_row;
    }
    return (double)all / ((double)width * (double)image->height);
}

static rx_status measure_background(const rx_pipeline_params *params, int role, const rx_image *input,
                                    int hide, rx_background **dst, rx_error *err)
{
    rx_image image = *input;
    image.hide = hide;
    return rx_error_where(err, rx_background_measure(&params->background[role], &image, dst, err),
                          input->name, input->hdu, 0);
}

rx_image rx_field_observed(const rx_field *field)
{
    rx_image image = rx_image_on_sky(&field->image, field->plain);
    image.psf = field->psf;
    return image;
}

rx_image rx_field_restorable(const rx_field *field)
{
    rx_image image = rx_image_on_sky(&field->image, field->restored);
    image.hide = RX_HIDE_RESTORED;
    image.psf = field->psf;
    return image;
}

rx_image rx_field_effective(const rx_field *field)
{
    rx_image image = rx_field_restorable(field);
    if (field->effective.maker.make != NULL) /* a factor that is 1 in single precision takes no room */
        image.noise = rx_map_made(&field->effective.maker, image.width);
    image.global_noise *= field->noise_factor;
    return image;
}

/* What is known of the noise beside its width. */
static rx_status measure_noise(const rx_pipeline_params *params, rx_field *field, rx_error *err)
{
    const rx_correlation_params *par = &params->noise;
    const rx_image image = rx_field_restorable(field);
    if (par->origin == RX_NOISE_GIVEN && par->kernel != NULL)
        field->noise = rx_noise_of_kernel(par->kernel, par->kernel_width, par->kernel_height);
    else if (par->origin == RX_NOISE_MEASURED)
        RX_TRY(rx_correlation_measure(&image, NULL, params->nthreads, &field->noise, err));
    else
        field->noise = rx_noise_white(RX_NOISE_WHITE);
    return RX_OK;
}

/* The PSF in the middle of the tile, to be freed; NULL without memory. */
static float *middle_stamp(const rx_field *field, const rx_psf *psf)
{
    float *stamp = RX_NEW(float, (size_t)psf->size *(size_t)psf->size);
    if (stamp != NULL)
        rx_psf_at(psf, 0.5 * (field->image.width - 1), 0.5 * (field->image.height - 1), stamp);
    return stamp;
}

/* The variance of the sky's photons over what was measured of all noise; 0: not known. */
static double photon_share(const rx_field *field, const rx_noise_correlation *noise)
{
    const double variance = pow(field->plain->global_sigma * noise->scale, 2.0);
    return field->image.gain > 0.0 && field->plain->global_level > 0.0 && variance > 0.0
               ? field->plain->global_level / field->image.gain / variance
               : 0.0;
}

rx_status rx_field_noise_measure(const rx_field *field, const unsigned char *used, int nthreads,
                                 rx_noise_correlation *dst, rx_error *err)
{
    const rx_psf *psf = field->psf;
    const rx_image image = used != NULL ? rx_field_observed(field) : rx_field_restorable(field);
    RX_TRY(rx_correlation_measure(&image, used, nthreads, dst, err));
    if (psf == NULL || !dst->correlated)
        return RX_OK;
    float *stamp = middle_stamp(field, psf);
    if (stamp == NULL)
        return rx_error_memory(err, 0);
    rx_noise_without_light(dst, stamp, psf->size, psf->size, photon_share(field, dst));
    free(stamp);
    return RX_OK;
}

static const double LEAST_FACTOR = 0.7;

/* A crowd's PSF is measured again until fluxes change by less, relative. */
static const double PSF_STAYS = 0.005;
enum { PSF_ROUNDS = 3 };
/* Of what taking off the seen neighbours changed, the error for the unseen ones: a choice. */
static const double PSF_UNSEEN = 0.5;

/* Of the matched filter, or of wide sums where no PSF serves; `of_light`, or NULL, says what light looks like there. What sharpening
 * leaves, or a correlation that was measured wrongly, is not believed. */
static rx_status make_effective_noise(rx_field *field, const rx_psf *of_light, rx_log *log, rx_error *err)
{
    const rx_psf *psf = field->psf != NULL ? field->psf : of_light;
    const rx_image *image = &field->image;
    if (psf != NULL && field->noise.correlated) {
        float *stamp = middle_stamp(field, psf);
        if (stamp == NULL)
            return rx_error_memory(err, 0);
        rx_noise_without_light(&field->noise, stamp, psf->size, psf->size,
                               photon_share(field, &field->noise));
        field->noise_factor = rx_noise_factor(&field->noise, stamp, psf->size, psf->size);
        free(stamp);
    }
    if (field->psf == NULL || !field->noise.correlated)
        field->noise_factor = rx_noise_factor_wide(&field->noise);
    if (field->noise.origin == RX_NOISE_MEASURED && field->noise_factor < LEAST_FACTOR) {
        rx_log_warning(
            log,
            "%s[%d]: its noise is finer than any resampling leaves it (a matched filter has %.2f times that "
            "of independent pixels); it is taken as independent, errors and thresholds may be too large",
            image->name, image->hdu, field->noise_factor);
        field->noise = rx_noise_white(RX_NOISE_UNKNOWN);
        field->noise_factor = 1.0;
    }
    rx_map_scaled(&field->effective, rx_background_noise(field->restored), (float)field->noise_factor);
    field->image.correlation = &field->noise;
    return RX_OK;
}

static const char *const origins[] = {[RX_NOISE_UNKNOWN] = "UNKNOWN",
                                      [RX_NOISE_WHITE] = "WHITE",
                                      [RX_NOISE_MEASURED] = "MEASURED",
                                      [RX_NOISE_GIVEN] = "FILE"};

const char *rx_field_noise_origin(const rx_field *field)
{
    return origins[field->noise.origin];
}

static void say_noise(const rx_field *field, rx_log *log)
{
    const rx_noise_correlation *noise = &field->noise;
    const rx_image *image = &field->image;
    const int mid = RX_NOISE_REACH;
    double q[RX_NOISE_QUADRANTS];
    for (int i = 0; i < RX_NOISE_QUADRANTS; i++)
        q[i] = rx_noise_quadrant_factor(noise, i);
    const rx_noise_law law = rx_noise_law_of(noise);
    double sums[4], power[2][5];
    static const double radii[] = {1.5, 3.0, 5.0, 10.0};
    for (int i = 0; i < 4; i++)
        sums[i] = rx_noise_law_factor(&law, M_PI * radii[i] * radii[i]);
    for (int i = 0; i < 5; i++) {
        power[0][i] = rx_noise_power(noise, i / 8.0, 0.0);
        power[1][i] = rx_noise_power(noise, 0.0, i / 8.0);
    }
    if (rx_noise_is_structure(noise))
        rx_log_warning(
            log,
            "%s[%d]: its noise is correlated more than any resampling leaves it: wide sums of pixels have "
            "%.1f times that of independent ones (RXNWIDE; limit %g): fringes, light that fills the tile, or "
            "smoothing; thresholds and errors rise with it, every source has FLAGS_RESTORE 128",
            image->name, image->hdu, rx_noise_factor_wide(noise), RX_NOISE_RESAMPLED);
    if (field->noise_factor > 1.1)
        rx_log_info(log,
                    "%s[%d]: noise is correlated: a matched filter has %.2f times that of independent pixels",
                    image->name, image->hdu, field->noise_factor);
    if (rx_noise_uneven(noise))
        rx_log_warning(
            log,
            "%s[%d]: its noise is not correlated alike everywhere: wide sums have %.2f, %.2f, %.2f and %.2f "
            "times that of independent pixels in its quadrants (low left, low right, high left, high "
            "right); errors and thresholds are those of the whole tile",
            image->name, image->hdu, q[0], q[1], q[2], q[3]);
    rx_log_detail(
        log,
        "%s[%d]: noise %s: correlation at lag 1 %.3f in x, %.3f in y, +-%.4f (%ld pixels); noise of the "
        "matched filter %.3f, of circles of radius 1.5, 3, 5 and 10 pixels %.3f %.3f %.3f %.3f, of wide sums "
        "%.3f (quadrants %.2f %.2f %.2f %.2f) times that of independent pixels; power at 0, 1/8, 1/4, 3/8 "
        "and "
        "1/2 cycles per pixel %.3f %.3f %.3f %.3f %.3f in x, %.3f %.3f %.3f %.3f %.3f in y",
        image->name, image->hdu, origins[noise->origin], noise->at[mid][mid + 1], noise->at[mid + 1][mid],
        noise->error, noise->pixels, field->noise_factor, sums[0], sums[1], sums[2], sums[3],
        rx_noise_factor_wide(noise), q[0], q[1], q[2], q[3], power[0][0], power[0][1], power[0][2],
        power[0][3], power[0][4], power[1][0], power[1][1], power[1][2], power[1][3], power[1][4]);
}

static int hides_noise(const rx_field *field)
{
    return field->plain->constant || rx_anomalies_is_cut(&field->anomalies) ||
           rx_anomalies_is_coarse(&field->anomalies, field->plain->global_sigma);
}

int rx_fields_noise_hidden(rx_fields fields)
{
    return hides_noise(fields.detect) || hides_noise(fields.measure);
}

/* What may be hidden of its pixels, the caller's or its own. */
static uint8_t *own_mask(const rx_field *field)
{
    return field->mask != NULL ? field->mask : field->tile != NULL ? field->tile->mask : NULL;
}

static bool has_pixels(const rx_field *field)
{
    const uint8_t *mask = own_mask(field);
    const size_t n = (size_t)field->image.width * (size_t)field->image.height;
    for (size_t i = 0; i < n; i++)
        if (mask == NULL || (mask[i] & RX_HIDE_PLAIN) == 0)
            return true;
    return false;
}

static void say_anomalies(const rx_field *field, rx_log *log)
{
    const rx_anomalies *a = &field->anomalies;
    const rx_image *image = &field->image;
    if (field->plain->constant && !has_pixels(field))
        rx_log_warning(log,
                       "%s[%d]: all of its pixels are masked or hold no data, so that no source is found",
                       image->name, image->hdu);
    else if (field->plain->constant)
        rx_log_warning(log,
                       "%s[%d]: it has no noise that could be measured (a map, rounded numbers?): sigma is "
                       "taken for 1, thresholds and errors mean nothing, every source has "
                       "FLAGS_RESTORE 1024; give the noise (WEIGHT_TYPE MAP_RMS)",
                       image->name, image->hdu);
    else if (rx_anomalies_is_coarse(a, field->plain->global_sigma))
        rx_log_warning(log,
                       "%s[%d]: its pixel values have steps of %.3g ADU, what is taken for its noise is %.3g "
                       "(RXSTEP, RXSIGMA): rounded numbers, or no image of a sky (a map of noise, of "
                       "segments?); thresholds and errors are wrong, every source has FLAGS_RESTORE 1024; "
                       "give the tile as it was before it was rounded",
                       image->name, image->hdu, a->step, field->plain->global_sigma);
    if (rx_anomalies_is_cut(a))
        rx_log_warning(log,
                       "%s[%d]: %.0f %% of its pixels have its lowest value (RXCUT): what was below it is "
                       "cut off, or photons are few, so that sky, noise, thresholds and errors are wrong; "
                       "every source has FLAGS_RESTORE 1024; give the tile with values below its sky",
                       image->name, image->hdu, 100.0 * a->cut);
    if (rx_anomalies_is_striped(a))
        rx_log_warning(log,
                       "%s[%d]: its rows are offset by %.2g sigma of a pixel, its columns by %.2g (RXROWS, "
                       "RXCOLS): faint sources may be false; subtract each one's overscan or median",
                       image->name, image->hdu, a->rows, a->columns);
    if (rx_anomalies_is_lit(a))
        rx_log_warning(
            log,
            "%s[%d]: %.0f %% of it holds light that is no source's and that the sky's mesh does not "
            "follow (RXLIGHT): filaments, a ghost; faint sources there have FLAGS_RESTORE 512; a "
            "smaller BACK_SIZE may follow it",
            image->name, image->hdu, 100.0 * a->light);
}

/* The detection image after the filter; NULL without one. */
static rx_status filter_pixels(const rx_detect_params *par, int nthreads, const rx_image *image,
                               const float *pixels, float **filtered, rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    rx_filter filter;
    rx_status status = rx_filter_new(par->filter, par->filter_width, par->filter_height, &filter, err);
    if (status != RX_OK || filter.values == NULL)
        return status;
    *filtered = rx_alloc_filled(n, sizeof **filtered, nthreads);
    if (*filtered == NULL)
        status = rx_error_memory(err, n * sizeof **filtered);
    else
        rx_filter_plane(&filter, pixels, image->width, image->height, nthreads, *filtered);
    rx_filter_free(&filter);
    return status;
}

enum { WIDE = 17 };                  /* pixels, of a filter */
static const double WIDE_FWHM = 8.0; /* pixels */

/* Candidate stars for a PSF that is measured: a plain extraction that never looks at saturated values. */
static rx_status find_stars(const rx_pipeline_params *params, const rx_field *field, rx_log *log,
                            rx_sources **dst, rx_error *err)
{
    const size_t n = (size_t)field->image.width * (size_t)field->image.height;
    const rx_map noise = rx_background_noise(field->restored);
    rx_sources *sources = NULL;
    rx_status status = RX_OK;
    float *pixels = RX_NEW(float, n), *sigma = RX_NEW(float, n), *filtered = NULL;
    if (pixels == NULL || sigma == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 2 * n * sizeof(float)));
    rx_image image = rx_field_restorable(field);
    rx_image_above_sky(&image, params->nthreads, pixels);
    rx_map_fill(&noise, image.height, params->nthreads, sigma);
    image.pixels = pixels;
    image.with_sky = 0;
    image.noise = rx_map_plane(sigma, image.width);
    image.variable_noise = 1;
    image.nflagmaps = 0;
    rx_image detection = image;
    detection.gain = 0.0;
    rx_detect_params detect_params = params->detect;
    detect_params.absolute = 0;
    detect_params.threshold = detect_params.analysis_threshold = 3.0;
    rx_measure_params measure_params = params->measure;
    measure_params.star_net = NULL;
    measure_params.weight_gain = 0;
    measure_params.skip = RX_SKIP_PETRO | RX_SKIP_APER | RX_SKIP_WIN;
    measure_params.vignet_width = measure_params.vignet_height = 0;
    measure_params.nradii = 1;
    measure_params.flux_fraction[0] = 0.5;
    /* where the filter finds nothing, stars may be wide and faint */
    for (int wide = 0; wide < 2 && status == RX_OK && (sources == NULL || sources->n == 0); wide++) {
        float kernel[WIDE * WIDE];
        if (wide) {
            for (int i = 0; i < WIDE * WIDE; i++)
                kernel[i] = (float)exp2(-(pow(i % WIDE - WIDE / 2, 2) + pow(i / WIDE - WIDE / 2, 2)) * 4.0 /
                                        (WIDE_FWHM * WIDE_FWHM));
            detect_params.filter = kernel;
            detect_params.filter_width = detect_params.filter_height = WIDE;
            /* thresholds are sigmas of a pixel, as SExtractor's; here 5 of the filtered noise */
            detect_params.threshold = detect_params.analysis_threshold =
                5.0 * rx_filter_norm(kernel, WIDE * WIDE);
        }
        rx_sources_free(sources);
        sources = NULL;
        /* hidden pixels are 0 already: detection needs no copy of them, and no filtered ones after it */
        status = filter_pixels(&detect_params, params->nthreads, &image, pixels, &filtered, err);
        const rx_filtered after = {.pixels = filtered != NULL ? filtered : pixels,
                                   .spare = filtered != NULL ? &filtered : NULL};
        if (status == RX_OK)
            status = rx_detect_run(&detect_params, &detection, &after, log, &sources, err);
        if (status == RX_OK)
            status = rx_measure_run(&measure_params, &image, NULL, log, sources, err);
    }
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

/* Those of PSF_STARS_NAME are marked by number_assoc. Pixels of a list are those of the tile, degrees are of its sky,
 * which is believed more. */
static rx_status mark_stars(const rx_pipeline_params *params, const rx_image *image, rx_log *log,
                            rx_sources *sources, rx_error *err)
{
    const char *file = params->psf.stars_file;
    static const double RADIUS = 2.0; /* pixels, of a match */
    rx_assoc_params par = {.radius = RADIUS, .type = RX_ASSOC_NEAREST, .select = RX_ASSOC_ALL};
    rx_assoc *list = NULL;
    int column[2], matched = 0;
    RX_TRY(rx_assoc_read(file, &list, err));
    rx_status status = RX_OK;
    par.world = image->wcs != NULL && rx_catalog_find_positions(list->table, true, &column[0], &column[1]);
    if (!par.world && !rx_catalog_find_positions(list->table, false, &column[0], &column[1]))
        status =
            image->wcs == NULL && rx_catalog_find_positions(list->table, true, &column[0], &column[1])
                ? rx_error_at(err, RX_INPUT, image->name, image->hdu, 0,
                              "has no celestial coordinates, and PSF_STARS_NAME '%s' holds no pixels; "
                              "give columns X_IMAGE and Y_IMAGE",
                              file)
                : rx_error_at(err, RX_INPUT, file, -1, 0,
                              "holds no positions of stars; give columns X_IMAGE and Y_IMAGE (pixels), or "
                              "ALPHA_J2000 and DELTA_J2000 (or RA and DEC; degrees)");
    for (int i = list->columns - 1; i >= 0 && status == RX_OK; i--) { /* the first element of a vector */
        par.x = list->of[i] == column[0] ? i + 1 : par.x;
        par.y = list->of[i] == column[1] ? i + 1 : par.y;
    }
    if (status == RX_OK)
        status = rx_assoc_match(&par, list, image->wcs, log, sources, err);
    for (int i = 0; i < sources->n && status == RX_OK; i++)
        matched += sources->list[i].number_assoc > 0;
    if (status == RX_OK)
        rx_log_info(log, "%s[%d]: PSF_STARS_NAME %s: %d of %d sources are among its %ld stars", image->name,
                    image->hdu, file, matched, sources->n, list->rows);
    rx_assoc_free(list);
    return status;
}

/* Arcsec a pixel; 0: not known. */
static double pixel_scale(const rx_pipeline_params *params, const rx_image *image)
{
    return image->wcs != NULL
               ? rx_wcs_pixel_scale(image->wcs, 0.5 * (image->width - 1), 0.5 * (image->height - 1))
               : params->stated_scale;
}

/* FWHM in pixels that the tile's header states, *key says where; 0: nowhere. Surveys write arcsec or pixels
 * under the same name: a card whose comment does not say which is not taken. */
static double header_fwhm(const rx_tile *tile, double scale, const char **key)
{
    static const char *const keys[] = {"PSF_FWHM", "SEEING", "FWHM", "MEDFWHM", "IQFINAL"};
    if (tile == NULL || tile->cards == NULL)
        return 0.0;
    const long n = (long)tile->ncards;
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
/* Of fluxes, relative, with a FWHM that was stated: rms where it is 10 % off (1 sigma), as what is called FWHM, or was the
 * seeing, is, and the profile one of six kinds: validation/results/psf (few stars). */
static const double STATED_ERROR = 0.08;

/* Was that file made for want of a PSF that stars say? Then it has no standing of its own. */
static bool is_makeshift(const char *path, int extension, char how[80])
{
    static const char *const words[] = {"STATED", "WIDTH", "BESIDE", "LIBRARY", "UNKNOWN"};
    rx_table *table = NULL;
    bool found = false;
    if (!(extension > 1 && rx_fits_read_table(path, extension - 1, &table, NULL) == RX_OK) &&
        rx_fits_read_table(path, 0, &table, NULL) != RX_OK)
        return false;
    if (table->cards != NULL && rx_cards_text(table->cards, table->ncards, "RXPSFHOW", how, 80))
        for (size_t i = 0; i < sizeof words / sizeof *words; i++)
            found = found || strcmp(how, words[i]) == 0;
    rx_table_free(table);
    return found;
}

/* The PSF file beside the image, to be freed; NULL: there is none of use, or no memory (*failed). */
static char *beside(const rx_field *field, rx_log *log, bool *failed)
{
    char *path = field->tile != NULL && field->tile->name != NULL ? rx_name_psf(field->tile->name) : NULL;
    char how[80];
    *failed = path == NULL && field->tile != NULL && field->tile->name != NULL;
    if (path != NULL && access(path, R_OK) == 0) {
        if (!is_makeshift(path, field->image.extension, how))
            return path;
        rx_log_info(log,
                    "%s[%d]: %s beside it is passed over: Rextract made it where stars gave no PSF (RXPSFHOW "
                    "%s); give it as PSF_TYPE FILE to have it",
                    field->image.name, field->image.hdu, rx_psf_base_name(path), how);
    }
    free(path);
    return NULL;
}

/* The PSF file beside the image, as PSFEx leaves it there; where there is none, or none of use, field->psf stays NULL. */
static rx_status psf_beside(const rx_pipeline_params *params, const rx_error *why, rx_field *field,
                            rx_log *log, rx_error *err)
{
    const rx_image *image = &field->image;
    rx_psf_params par = params->psf;
    rx_error local = rx_error_part(err);
    bool failed = false;
    char *path = par.type == RX_PSF_AUTO ? beside(field, log, &failed) : NULL;
    if (path == NULL)
        return failed ? rx_error_memory(err, 0) : RX_OK;
    rx_record_add(&field->inputs, "PSF_NAME", "", "%s", path);
    par.type = RX_PSF_FILE;
    par.file = path;
    par.extension = image->extension;
    par.sampling = 0.0;
    par.integrate = RX_PSF_INTEGRATE_AUTO;
    const char *name = rx_psf_base_name(path);
    rx_status status = rx_psf_file(&par, image->width, image->height, log, &field->psf, &local);
    if (status == RX_INPUT) {
        rx_log_warning(log, "%s[%d]: %s beside it is no PSF of it: %s", image->name, image->hdu, name,
                       local.text);
        status = RX_OK;
    } else if (status != RX_OK) {
        rx_error_take(err, &local);
    } else {
        rx_psf *psf = field->psf;
        const size_t used = strlen(psf->description);
        snprintf(psf->quality.how, sizeof psf->quality.how, "BESIDE");
        snprintf(psf->description + used, sizeof psf->description - used, ", %s beside the image", name);
        rx_log_warning(log, "%s[%d]: %.*s; the PSF is that of %s beside the image", image->name, image->hdu,
                       (int)strcspn(why->text, ";"), why->text, name);
    }
    free(path);
    return status;
}

/* Is a PSF stated: by PSF_FWHM, a file beside the image, the header, or SEEING_FWHM? */
static int is_stated(const rx_pipeline_params *params, const rx_field *field)
{
    const char *key;
    const double scale = pixel_scale(params, &field->image);
    bool failed;
    char *file = beside(field, NULL, &failed);
    free(file);
    return file != NULL || params->psf.fwhm > 0.0 || header_fwhm(field->tile, scale, &key) > 0.0 ||
           (params->seeing_stated && scale > 0.0);
}

/* Where no stars say it, what was stated of the PSF serves (PSF_FWHM, a file beside the image, the header, a
 * SEEING_FWHM that was given), loudly where stars were asked; where nothing was, the tile stays as it is.
 * The narrowest sources are a bound only. */
static rx_status stated_psf(const rx_pipeline_params *params, const rx_error *why, rx_field *field,
                            rx_log *log, rx_error *err)
{
    const rx_image *image = &field->image;
    rx_psf_params par = params->psf;
    const char *key = par.fwhm > 0.0 ? "PSF_FWHM" : NULL, *where = "";
    const double scale = pixel_scale(params, image);
    par.type = RX_PSF_MOFFAT;
    if (key == NULL)
        RX_TRY(psf_beside(params, why, field, log, err));
    if (field->psf != NULL)
        return RX_OK;
    if (key == NULL) {
        par.fwhm = header_fwhm(field->tile, scale, &key);
        where = " of the header";
    }
    if (!(par.fwhm > 0.0) && params->seeing_stated && scale > 0.0) {
        par.fwhm = params->seeing_arcsec / scale;
        key = "SEEING_FWHM";
        where = "";
    }
    if (!(par.fwhm >= LEAST_FWHM)) { /* a pixel scale of degrees, or none */
        if (field->psf_bound > 0.0)
            rx_log_warning(
                log, "%s[%d]: %s; its narrowest sources say no more than that FWHM is below %.2g pixels",
                image->name, image->hdu, why->text, field->psf_bound);
        else
            rx_log_warning(log, "%s[%d]: %s", image->name, image->hdu, why->text);
        field->unrestorable = 1;
        return RX_OK;
    }
    if (field->psf_bound > 0.0 && par.fwhm > field->psf_bound)
        rx_log_warning(
            log, "%s[%d]: a FWHM of %.3g pixels is stated (%s), but sources are narrower: it is below %.2g",
            image->name, image->hdu, par.fwhm, key, field->psf_bound);
    if (params->psf.type == RX_PSF_AUTO)
        rx_log_warning(log, "%s[%d]: %.*s; %s%s is taken: Moffat of FWHM %.2f pixels", image->name,
                       image->hdu, (int)strcspn(why->text, ";"), why->text, key, where, par.fwhm);
    const rx_image restorable = rx_field_restorable(field);
    rx_status status = rx_psf_make(&par, &restorable, NULL, log, &field->psf, err);
    if (status == RX_OK) {
        char *said = field->psf->description;
        snprintf(field->psf->quality.how, sizeof field->psf->quality.how, "STATED");
        field->psf->quality.flux_error = STATED_ERROR;
        const size_t used = strlen(said);
        snprintf(said + used, sizeof field->psf->description - used, ", from %s%s", key, where);
    }
    return status;
}

static rx_status make_psf(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
                          rx_error *err)
{
    rx_psf_params par = params->psf;
    const rx_image image = rx_field_restorable(field);
    par.file = params->psf_files[role];
    par.extension = field->image.extension;
    const bool listed = par.stars_file != NULL && par.stars_file[0] != '\0';
    rx_sources *stars = NULL;
    rx_error why = rx_error_part(err);
    if (listed && par.type != RX_PSF_AUTO)
        rx_log_warning(log, "PSF_STARS_NAME is for PSF_TYPE AUTO, and is not used");
    if (par.type == RX_PSF_MOFFAT && !(par.fwhm > 0.0)) {
        rx_error_set(&why, RX_INPUT,
                     "PSF_TYPE MOFFAT needs the FWHM of stars; give PSF_FWHM in pixels, or "
                     "SEEING_FWHM in arcsec, with PIXEL_SCALE where there is no WCS");
        return stated_psf(params, &why, field, log, err);
    }
    if (par.type != RX_PSF_AUTO)
        return rx_psf_make(&par, &image, NULL, log, &field->psf, err);
    rx_status status = find_stars(params, field, log, &stars, err);
    if (status == RX_OK && listed)
        status = mark_stars(params, &field->image, log, stars, err);
    if (status != RX_OK) {
        rx_sources_free(stars);
        return status;
    }
    field->nstars = stars->n;
    status = rx_psf_make(&par, &image, stars, log, &field->psf, &why);
    if (status == RX_INPUT)
        field->psf_bound = rx_psf_bound(&par, &image, stars);
    rx_sources_free(stars);
    /* one source that may be a galaxy says less than whoever stated a width, few say less than PSF_FWHM */
    const int one = status == RX_OK && strcmp(field->psf->quality.how, "WIDTH") == 0;
    if (one || (status == RX_OK && par.fwhm > 0.0 && strcmp(field->psf->quality.how, "MOFFAT_BETA") == 0)) {
        status = rx_error_set(&why, RX_INPUT,
                              "PSF_TYPE AUTO found only %d star%s; what is stated is believed more",
                              field->psf->nstars, one ? "" : "s");
        if (!is_stated(params, field))
            return RX_OK;
        rx_psf *own = field->psf;
        field->psf = NULL;
        status = stated_psf(params, &why, field, log, err);
        if (status != RX_OK || field->psf != NULL) {
            rx_psf_free(own);
            return status;
        }
        field->psf = own; /* what was stated could not be read */
        field->unrestorable = 0;
        rx_log_warning(log, "%s[%d]: the PSF stays that of its few stars", image.name, image.hdu);
        return RX_OK;
    }
    if (status == RX_INPUT)
        return stated_psf(params, &why, field, log, err);
    if (status != RX_OK)
        rx_error_take(err, &why);
    return status;
}

/* The PSF of a tile that needs none, where noise seems to be correlated farther than resampling leaves it, as the light of faint
 * sources is; NULL where it is not, or is not known. */
static rx_status measure_light(const rx_pipeline_params *params, int role, const rx_field *field,
                               rx_psf **dst, rx_error *err)
{
    const rx_image image = rx_field_restorable(field);
    rx_psf_params par = params->psf;
    rx_sources *stars = NULL;
    rx_error why = rx_error_part(err);
    par.file = params->psf_files[role];
    par.extension = field->image.extension;
    if (field->noise.origin != RX_NOISE_MEASURED || !field->noise.correlated ||
        !rx_noise_reaches_far(&field->noise) || (par.type == RX_PSF_MOFFAT && !(par.fwhm > 0.0)))
        return RX_OK;
    if (par.type == RX_PSF_AUTO)
        RX_TRY(find_stars(params, field, NULL, &stars, err));
    const rx_status status = rx_psf_make(&par, &image, stars, NULL, dst, &why);
    rx_sources_free(stars);
    if (status != RX_OK && status != RX_INPUT)
        return rx_error_take(err, &why);
    return RX_OK;
}

/* Both backgrounds. */
static rx_status measure_backgrounds(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
                                     rx_error *err)
{
    static const double many = 0.1; /* of the pixels: no sky has so many bright stars */
    const double saturated = saturated_share(&field->image);
    if (saturated > many)
        rx_log_warning(
            log,
            "%s[%d]: %.0f %% of its pixels are at SATUR_LEVEL %g or above, so that their sources "
            "count as saturated (FLAGS 4): give SATUR_LEVEL in the unit of the pixels and, where the "
            "header has SATUR_KEY, a SATUR_KEY that it lacks",
            field->image.name, field->image.hdu, 100.0 * saturated, field->image.saturation);
    int hide_plain = params->saturated_in_none ? RX_HIDE_RESTORED : RX_HIDE_PLAIN;
    rx_status status = measure_background(params, role, &field->image, hide_plain, &field->plain, err);
    field->restored = field->plain;
    if (status != RX_OK || hide_plain == RX_HIDE_RESTORED || saturated == 0.0)
        return status;
    field->restored = NULL;
    return measure_background(params, role, &field->image, RX_HIDE_RESTORED, &field->restored, err);
}

/* With SExtractor's sky (BACK_PASSES 1) a constant at its level is sky, as there. */
static rx_status hide_no_data(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
                              rx_error *err)
{
    const rx_image *image = &field->image;
    uint8_t *mask = own_mask(field);
    if (mask == NULL)
        return RX_OK;
    RX_TRY(rx_no_data_hide(image, params->background[role].passes == 1, params->nthreads, mask,
                           &field->no_data, err));
    if (field->no_data > 0)
        rx_log_warning(log,
                       "%s[%d]: %.1f %% of its pixels, in runs of one value, hold no data (RXNODATA): they "
                       "are left out, as by a weight map",
                       image->name, image->hdu,
                       100.0 * (double)field->no_data / ((double)image->width * (double)image->height));
    return RX_OK;
}

/* Where no card and no keyword states a level, the pixels show from where on values are saturated. */
static rx_status find_saturation(rx_field *field, rx_log *log, rx_error *err)
{
    rx_image *image = &field->image;
    uint8_t *mask = own_mask(field);
    size_t n = 0;
    if (mask == NULL || isfinite(image->saturation))
        return RX_OK;
    RX_TRY(rx_saturation_find(image, mask, &image->saturation, err));
    if (!isfinite(image->saturation))
        return RX_OK;
    for (size_t k = 0; k < (size_t)image->width * (size_t)image->height; k++)
        if (mask[k] == 0 && (double)image->pixels[k] >= image->saturation) {
            mask[k] = RX_MASK_SATURATED;
            n++;
        }
    if (field->tile != NULL)
        field->tile->saturation = image->saturation;
    rx_log_warning(
        log,
        "%s[%d]: no SATUR_LEVEL is stated, and from %.6g ADU on (RXSATUR) its pixels pile up or its cores "
        "are "
        "hollow: %zu pixels are taken as saturated (FLAGS 4); give SATUR_LEVEL if another is right",
        image->name, image->hdu, image->saturation, n);
    return RX_OK;
}

/* Cores that were left at 0 or another low value are below any level. */
static rx_status hide_hollow(rx_field *field, rx_log *log, rx_error *err)
{
    const rx_image observed = rx_field_observed(field);
    uint8_t *mask = own_mask(field);
    size_t n = 0;
    if (mask == NULL)
        return RX_OK;
    RX_TRY(rx_hollow_hide(&observed, mask, &n, err));
    if (n > 0)
        rx_log_warning(
            log,
            "%s[%d]: %zu pixels, low ones with bright ones all around that fall outwards, are taken as "
            "saturated cores without a value (FLAGS 4), and left out",
            observed.name, observed.hdu, n);
    return RX_OK;
}

/* A gain in another unit than the pixels' claims photon noise that is not there, or none. */
static rx_status check_gain(rx_field *field, rx_log *log, rx_error *err)
{
    const rx_image image = rx_field_restorable(field);
    const char *card = field->tile != NULL ? field->tile->gain_card : "";
    char why[120];
    rx_photon_test test;
    RX_TRY(rx_photons_test(&image, field->plain->global_level, &field->noise, &test, err));
    if (test.impossible == 0)
        return RX_OK;
    if (test.impossible > 0)
        snprintf(why, sizeof why, "its sky has %.3g times the noise of its photons", sqrt(test.ratio));
    else
        snprintf(why, sizeof why, "%ld of %ld bright pixels scatter by less than half of their photon noise",
                 test.quiet, test.n);
    rx_log_warning(
        log,
        "%s[%d]: %s%s = %g e-/ADU cannot be the gain of its pixels: %s; errors are without the photons "
        "of sources (RXGAIN 0); give their GAIN%s",
        image.name, image.hdu, card[0] != '\0' ? "card " : "", card[0] != '\0' ? card : "GAIN", image.gain,
        why, card[0] != '\0' ? ", and a GAIN_KEY that the header lacks" : "");
    field->image.gain = 0.0;
    if (field->tile != NULL)
        field->tile->gain = 0.0;
    return RX_OK;
}

/* A pixel that lacks more light than 90,000 electrons are is dead: no dark cloud takes so much off a sky that is in the mesh. */
static void hide_deep(rx_field *field, rx_log *log)
{
    static const double deep = 300.0,
                        at_least = 30.0; /* sigmas of the pixel, and of the tile: few are looked at */
    const rx_image *image = &field->image;
    uint8_t *mask = own_mask(field);
    const rx_map level = rx_background_level(field->plain), noise = rx_background_noise(field->plain);
    const double limit = field->plain->global_level - at_least * field->plain->global_sigma;
    for (int y = 0; mask != NULL && y < image->height; y++)
        for (int x = 0; x < image->width; x++) {
            const size_t k = (size_t)y * (size_t)image->width + (size_t)x;
            if ((double)image->pixels[k] < limit && (mask[k] & RX_HIDE_RESTORED) == 0 &&
                image->pixels[k] < rx_map_at(&level, x, y) - (float)deep * rx_map_at(&noise, x, y)) {
                mask[k] |= RX_MASK_DEEP;
                field->deep++;
            }
        }
    if (field->deep > 0)
        rx_log_warning(
            log,
            "%s[%d]: %zu pixels are more than %g sigma below the sky, as no light or cloud makes them "
            "(RXDEEP): restorers leave them out; where they are dead, mark them in a weight or flag map",
            image->name, image->hdu, field->deep, deep);
}

/* Sky, noise and PSF of field->image. */
static rx_status measure_field(const rx_pipeline_params *params, int what, rx_field *field, rx_log *log,
                               rx_error *err)
{
    const rx_image *image = &field->image;
    const int role = (what & RX_FIELD_MEASURED) != 0;
    rx_lap last = rx_lap_now();
    rx_status status = RX_OK;
    RX_TRY(hide_no_data(params, role, field, log, err));
    RX_TRY(find_saturation(field, log, err));
    RX_TRY(measure_backgrounds(params, role, field, log, err));
    RX_TRY(hide_hollow(field, log, err));
    hide_deep(field, log);
    RX_TRY(measure_noise(params, field, err));
    RX_TRY(check_gain(field, log, err));
    rx_lap_add(&last, &field->background_lap);
    rx_log_detail(log, "%s[%d]: %d x %d pixels, background %g, noise %g, gain %g, pixel scale %g arcsec",
                  image->name, image->hdu, image->width, image->height, field->plain->global_level,
                  field->plain->global_sigma, image->gain, image->pixel_scale);
    if (image->psf != NULL) {
        field->psf = rx_psf_copy(image->psf);
        if (field->psf == NULL)
            status = rx_error_memory(err, 0);
    } else if ((what & RX_FIELD_PSF) != 0) {
        status = make_psf(params, role, field, log, err);
    }
    rx_lap_add(&last, &field->psf_lap);
    if (status == RX_OK && image->psf == NULL && field->psf != NULL)
        rx_log_info(log, "%s[%d]: PSF %s", image->name, image->hdu, field->psf->description);
    if (status == RX_OK && own_mask(field) != NULL) {
        const rx_image observed = rx_field_observed(field);
        field->cores =
            rx_gaps_mark_cores(&observed, field->psf != NULL ? field->psf->fwhm : 0.0, own_mask(field));
    }
    const rx_noise_correlation noise = field->noise;
    field->image.psf = field->psf;
    rx_psf *of_light = NULL;
    if (status == RX_OK && field->psf == NULL && (what & RX_FIELD_PSF) == 0)
        status = measure_light(params, role, field, &of_light, err);
    if (status == RX_OK)
        status = make_effective_noise(field, of_light, log, err);
    rx_psf_free(of_light);
    if (status == RX_OK && image->psf != NULL && params->psf.type == RX_PSF_AUTO && field->nstars > 0) {
        rx_lap_add(&last, &field->background_lap);
        double by = HUGE_VAL, all = 0;
        for (int round = 0; round < PSF_ROUNDS && fabs(by) > PSF_STAYS && status == RX_OK; round++) {
            rx_psf *psf = NULL;
            status = rx_psf_between(params, what & RX_FIELD_MEASURED, field, log, &psf, &by, err);
            if (psf == NULL)
                break;
            if (by < -PSF_STAYS) {
                /* With less light around its stars a PSF gets no wider: its wings follow noise. */
                field->psf->quality.flux_error = hypot(field->psf->quality.flux_error, by);
                rx_psf_free(psf);
                break;
            }
            all += by;
            psf->quality.flux_error = hypot(psf->quality.flux_error, PSF_UNSEEN * all);
            rx_psf_free(field->psf);
            field->image.psf = field->psf = psf;
            field->noise = noise;
            if (status == RX_OK)
                status = make_effective_noise(field, NULL, log, err);
        }
        rx_lap_add(&last, &field->psf_lap);
    }
    if (status == RX_OK) {
        const rx_image restorable = rx_field_restorable(field);
        say_noise(field, log);
        status = rx_anomalies_measure(&restorable, rx_noise_factor_wide(&field->noise), params->nthreads,
                                      &field->anomalies, err);
    }
    rx_lap_add(&last, &field->background_lap);
    if (status == RX_OK)
        say_anomalies(field, log);
    return status;
}

rx_status rx_field_prepare(const rx_pipeline_params *params, int what, rx_tile *tile, const rx_psf *known,
                           rx_log *log, rx_field **dst, rx_error *err)
{
    *dst = NULL;
    rx_field *field = RX_NEW(rx_field, 1);
    if (field == NULL) {
        rx_tile_free(tile);
        return rx_error_memory(err, sizeof *field);
    }
    field->tile = tile;
    field->image = rx_tile_image(tile);
    field->image.psf = known;
    rx_status status = measure_field(params, what, field, log, err);
    if (status == RX_OK)
        *dst = field;
    else
        rx_field_free(field);
    return status;
}

/* The caller's mask, and what the values themselves say: not a number, at saturation, a weight of no data. */
static void make_mask(const rx_image *image, uint8_t *dst)
{
    const float limit = rx_pixel_limit(image->pixels, image->width, image->height);
    const size_t n = (size_t)image->width * (size_t)image->height;
    const int weighted = image->weight_type == RX_WEIGHT_MAP_WEIGHT && image->weight != NULL;
    for (size_t i = 0; i < n; i++) {
        const float value = image->pixels[i];
        int bits = rx_image_hides(image, i) ? RX_MASK_BAD : 0;
        if (!rx_pixel_usable(value, limit))
            bits |= RX_MASK_BAD;
        else if (image->saturation > 0.0 && (double)value >= image->saturation)
            bits |= RX_MASK_SATURATED;
        if (weighted && !(image->weight[i] > 0.0f))
            bits |= RX_MASK_WEIGHT;
        dst[i] = (uint8_t)bits;
    }
}

rx_status rx_field_new(const rx_pipeline_params *params, int what, const rx_image *image, rx_log *log,
                       rx_field **dst, rx_error *err)
{
    const size_t n = (size_t)image->width * (size_t)image->height;
    *dst = NULL;
    if (image->width < 1 || image->height < 1 || image->pixels == NULL)
        return rx_error_set(err, RX_USAGE, "an image of %d x %d pixels; give width, height and pixels",
                            image->width, image->height);
    rx_field *field = RX_NEW(rx_field, 1);
    if (field != NULL)
        field->mask = RX_NEW(uint8_t, n);
    if (field == NULL || field->mask == NULL) {
        rx_field_free(field);
        return rx_error_memory(err, n);
    }
    make_mask(image, field->mask);
    field->image = *image;
    field->image.mask = field->image.saturated = field->mask;
    field->image.hide = 0;
    field->image.with_sky = 1;
    if (image->name == NULL)
        field->image.name = "image";
    if (!(image->saturation > 0.0))
        field->image.saturation = HUGE_VAL;
    rx_status status = measure_field(params, what, field, log, err);
    if (status == RX_OK)
        *dst = field;
    else
        rx_field_free(field);
    return status;
}

void rx_field_free(rx_field *field)
{
    if (field == NULL)
        return;
    if (field->restored != field->plain)
        rx_background_free(field->restored);
    rx_background_free(field->plain);
    rx_anomalies_free(&field->anomalies);
    rx_psf_free(field->psf);
    rx_tile_free(field->tile);
    rx_record_free(&field->inputs);
    free(field->mask);
    free(field);
}
