/* What is stated of a tile's PSF: by a list of stars, a file beside the image, its header, keywords. */
#include "stage/psf_hints.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/names.h"
#include "catalog/assoc.h"
#include "catalog/catalog.h"
#include "io/fits_read.h"
#include "io/wcs.h"
#include "psf/psf_files.h"

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
    const bool sky = rx_catalog_find_positions(list->table, true, &column[0], &column[1]);
    par.world = sky && image->wcs != NULL;
    if (!par.world && !rx_catalog_find_positions(list->table, false, &column[0], &column[1]))
        RX_TRY_EXIT(sky ? rx_error_at(err, RX_INPUT, image->name, image->hdu, 0,
                                      "has no celestial coordinates, and PSF_STARS_NAME '%s' holds no "
                                      "pixels; give columns X_IMAGE and Y_IMAGE",
                                      file)
                        : rx_error_at(err, RX_INPUT, file, -1, 0,
                                      "holds no positions of stars; give columns X_IMAGE and Y_IMAGE "
                                      "(pixels), or ALPHA_J2000 and DELTA_J2000 (or RA and DEC; degrees)"));
    for (int i = list->columns - 1; i >= 0; i--) { /* the first element of a vector */
        par.x = list->of[i] == column[0] ? i + 1 : par.x;
        par.y = list->of[i] == column[1] ? i + 1 : par.y;
    }
    RX_TRY_EXIT(rx_assoc_match(&par, list, image->wcs, log, sources, err));
    for (int i = 0; i < sources->n; i++)
        matched += sources->list[i].number_assoc > 0;
    rx_log_info(log, "%s[%d]: PSF_STARS_NAME %s: %d of %d sources are among its %ld stars", image->name,
                image->hdu, file, matched, sources->n, list->table->nrows);
exit:
    rx_assoc_free(list);
    return status;
}

/* A FWHM that is stated, in pixels, and where: by PSF_FWHM, the tile's header, or a SEEING_FWHM that was given; key NULL:
 * nowhere. Surveys write arcsec or pixels under the same name: a card whose comment does not say which is not taken. */
typedef struct stated_width {
    double fwhm;
    const char *key, *where;
} stated_width;

static stated_width find_width(const rx_pipeline_params *params, const rx_field *field)
{
    static const char *const keys[] = {"PSF_FWHM", "SEEING", "FWHM", "MEDFWHM", "IQFINAL"};
    const rx_image *image = &field->image;
    const double scale = image->wcs != NULL ? rx_wcs_pixel_scale(image->wcs, 0.5 * (image->width - 1),
                                                                 0.5 * (image->height - 1))
                                            : params->stated_scale; /* arcsec; 0: not known */
    const rx_tile *tile = field->tile;
    const long n = tile != NULL && tile->cards != NULL ? (long)tile->ncards : 0;
    if (params->psf.fwhm > 0.0)
        return (stated_width){params->psf.fwhm, "PSF_FWHM", ""};
    for (size_t i = 0; n > 0 && i < sizeof keys / sizeof *keys; i++) {
        char comment[80];
        double value;
        if (!rx_cards_number(tile->cards, n, keys[i], &value) ||
            !rx_cards_comment(tile->cards, n, keys[i], comment, sizeof comment))
            continue;
        const bool arcsec = strstr(comment, "arcsec") != NULL, pixels = strstr(comment, "pix") != NULL;
        const double fwhm = arcsec == pixels ? 0.0 : pixels ? value : scale > 0.0 ? value / scale : 0.0;
        if (fwhm >= 0.5 && fwhm <= 50.0)
            return (stated_width){fwhm, keys[i], " of the header"};
    }
    if (params->seeing_stated && scale > 0.0)
        return (stated_width){params->seeing_arcsec / scale, "SEEING_FWHM", ""};
    return (stated_width){0};
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

/* field->psf of that file, as PSFEx leaves it beside the image; NULL where it is of no use. */
static rx_status take_beside(const rx_pipeline_params *params, const char *path, const rx_error *why,
                             rx_field *field, rx_log *log, rx_error *err)
{
    const rx_image *image = &field->image;
    const char *name = rx_psf_base_name(path);
    rx_psf_params par = params->psf;
    rx_error local = rx_error_part(err);
    rx_record_add(&field->inputs, "PSF_NAME", "", "%s", path);
    par.type = RX_PSF_FILE;
    par.file = path;
    par.extension = image->extension;
    par.sampling = 0.0;
    par.integrate = RX_PSF_INTEGRATE_AUTO;
    const rx_status status = rx_psf_file(&par, image->width, image->height, log, &field->psf, &local);
    if (status != RX_OK && status != RX_INPUT)
        return rx_error_take(err, &local);
    if (status == RX_INPUT) {
        rx_log_warning(log, "%s[%d]: %s beside it is no PSF of it: %s", image->name, image->hdu, name,
                       local.text);
        return RX_OK;
    }
    rx_psf *psf = field->psf;
    const size_t used = strlen(psf->description);
    psf->quality.how = RX_PSF_BY_BESIDE;
    snprintf(psf->description + used, sizeof psf->description - used, ", %s beside the image", name);
    rx_log_warning(log, "%s[%d]: %.*s; the PSF is that of %s beside the image", image->name, image->hdu,
                   (int)strcspn(why->text, ";"), why->text, name);
    return RX_OK;
}

/* A Moffat of that width, loudly where stars were asked; without one the tile stays as it is. The narrowest sources are a
 * bound only. */
static rx_status take_width(const rx_pipeline_params *params, const rx_error *why, const stated_width *width,
                            rx_field *field, rx_log *log, rx_error *err)
{
    const rx_image *image = &field->image;
    rx_psf_params par = params->psf;
    par.type = RX_PSF_MOFFAT;
    par.fwhm = width->fwhm;
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
            image->name, image->hdu, par.fwhm, width->key, field->psf_bound);
    if (params->psf.type == RX_PSF_AUTO)
        rx_log_warning(log, "%s[%d]: %.*s; %s%s is taken: Moffat of FWHM %.2f pixels", image->name,
                       image->hdu, (int)strcspn(why->text, ";"), why->text, width->key, width->where,
                       par.fwhm);
    const rx_image restorable = rx_field_restorable(field);
    RX_TRY(rx_psf_make(&par, &restorable, NULL, log, &field->psf, err));
    char *said = field->psf->description;
    field->psf->quality.how = RX_PSF_BY_STATED;
    field->psf->quality.flux_error = STATED_ERROR;
    const size_t used = strlen(said);
    snprintf(said + used, sizeof field->psf->description - used, ", from %s%s", width->key, width->where);
    return RX_OK;
}

/* Where no stars say it, what was stated of the PSF serves: PSF_FWHM, a file beside the image, another width. What few
 * stars gave stays where nothing is stated, or what is cannot be read. */
static rx_status stated(const rx_pipeline_params *params, const rx_error *why, rx_field *field, rx_log *log,
                        rx_error *err)
{
    const stated_width width = find_width(params, field);
    rx_psf *own = field->psf;
    bool failed = false;
    char *file = params->psf.type == RX_PSF_AUTO && !(params->psf.fwhm > 0.0)
                     ? beside(field, own == NULL || width.key != NULL ? log : NULL, &failed)
                     : NULL;
    rx_status status = failed ? rx_error_memory(err, 0) : RX_OK;
    if (failed || (own != NULL && file == NULL && width.key == NULL))
        return status;
    field->psf = NULL;
    if (file != NULL)
        status = take_beside(params, file, why, field, log, err);
    if (status == RX_OK && field->psf == NULL)
        status = take_width(params, why, &width, field, log, err);
    free(file);
    if (own == NULL || status != RX_OK || field->psf != NULL) {
        rx_psf_free(own);
        return status;
    }
    field->psf = own;
    field->unrestorable = 0;
    rx_log_warning(log, "%s[%d]: the PSF stays that of its few stars", field->image.name, field->image.hdu);
    return RX_OK;
}

const rx_psf_hints rx_stage_psf_hints = {.mark_stars = mark_stars, .stated = stated};
