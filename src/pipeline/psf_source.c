/* Where the PSF of a tile comes from: stars, or what is stated. */
#include "pipeline/psf_source.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/names.h"
#include "catalog/assoc.h"
#include "catalog/catalog.h"
#include "detect/filter.h"
#include "io/fits_read.h"
#include "io/wcs.h"
#include "psf/psf_files.h"

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
                    image->hdu, file, matched, sources->n, list->table->nrows);
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
        psf->quality.how = RX_PSF_BY_BESIDE;
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
        field->psf->quality.how = RX_PSF_BY_STATED;
        field->psf->quality.flux_error = STATED_ERROR;
        const size_t used = strlen(said);
        snprintf(said + used, sizeof field->psf->description - used, ", from %s%s", key, where);
    }
    return status;
}

rx_status rx_field_psf(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
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
    const int one = status == RX_OK && field->psf->quality.how == RX_PSF_BY_WIDTH;
    if (one || (status == RX_OK && par.fwhm > 0.0 && field->psf->quality.how == RX_PSF_BY_MOFFAT_BETA)) {
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
rx_status rx_field_psf_of_light(const rx_pipeline_params *params, int role, const rx_field *field,
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
