/* One restorer through one tile. */
#include "stage/extract.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/names.h"
#include "catalog/assoc.h"
#include "detect/filter.h"
#include "stage/coordinates.h"
#include "stage/photometry.h"

/* Planes and numbers that live while one extension is extracted. */
typedef struct work {
    const rx_options *options;
    const rx_field *detect, *measure; /* measure: of the fluxes, the same as detect without dual-image mode */
    int plain;                        /* nothing was restored: SExtractor's own way */
    int hide;                         /* mask bits that hide a pixel of the detection image */
    rx_filter filter;                 /* the detection filter */
    float *filtered;                  /* detection image after the filter */
    float *noise;                     /* noise that thresholds refer to; NULL: the background's sigma */
    const float *detect_sigma;
    double detect_global;
    rx_restored *second; /* restored measurement image (dual-image mode) */
    rx_photometry photometry;
} work;

rx_status rx_run_open(rx_run *run, const rx_options *options, const rx_restorer *kind, int tagged,
                      rx_outputs *outputs, rx_error *err)
{
    const char *tag = tagged ? kind->name : NULL;
    int to_file = options->catalog_type != RX_CATALOG_NONE && strcmp(options->catalog_name, "STDOUT") != 0;
    run->kind = kind;
    run->catalog_name = rx_name_with_tag(options->catalog_name, tag);
    if (run->catalog_name == NULL)
        return rx_error_memory(err, 0);
    rx_status status = RX_OK;
    if (to_file)
        status = rx_outputs_file(outputs, run->catalog_name, &run->catalog_temporary, err);
    if (status != RX_OK)
        return status;
    return rx_checkimages_open(options->nchecks, options->check_types, options->check_names, tag, outputs,
                               &run->images, err);
}

static rx_status restore(const rx_run *run, const rx_options *options, const rx_field *field, int *plain,
                         rx_log *log, rx_restored **dst, rx_error *err)
{
    const rx_restorer *kind = run->kind;
    if (kind->needs_psf && field->unrestorable)
        kind = rx_restorer_find("NONE");
    *plain = !kind->needs_psf && strcmp(kind->name, "NONE") == 0;
    rx_restore_params par = options->restore;
    if (*plain)
        par.mask_saturated = options->saturated_in_none;
    return kind->run(&par, field->tile, *plain ? field->plain : field->restored, field->psf, log, dst, err);
}

/* What the filter leaves of the noise of independent pixels; 1 without a filter. */
static double filter_norm(const rx_filter *filter)
{
    double power = 0.0;
    for (int i = 0; i < filter->width * filter->height; i++)
        power += (double)filter->values[i] * (double)filter->values[i];
    return power > 0.0 ? sqrt(power) : 1.0;
}

/* A threshold of k sigmas should mean the same on restored pixels as on raw ones, although their noise is
 * correlated and the filter averages less of it away. So the noise is measured after the filter and divided
 * by the factor that the filter would have had on independent pixels. */
static rx_status equivalent_noise(const rx_run *run, work *w, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    rx_background *measured = NULL;
    size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_background_params par = w->options->background[0];
    par.manual = 0;
    rx_status status =
        rx_background_measure(&par, tile->width, tile->height, w->filtered, run->restored->mask, w->hide,
                              NULL, RX_WEIGHT_NONE, &measured, err);
    if (status != RX_OK)
        return status;
    float factor = (float)(1.0 / filter_norm(&w->filter));
    for (size_t i = 0; i < n; i++)
        measured->sigma[i] *= factor;
    w->noise = measured->sigma;
    measured->sigma = NULL;
    w->detect_sigma = w->noise;
    w->detect_global = measured->global_sigma * factor;
    rx_background_free(measured);
    return RX_OK;
}

static rx_status prepare_detection(const rx_run *run, work *w, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    const rx_detect_params *par = &w->options->detect;
    size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_status status = rx_filter_new(par->filter, par->filter_width, par->filter_height, &w->filter, err);
    if (status != RX_OK)
        return status;
    w->filtered = RX_NEW(float, n);
    if (w->filtered == NULL)
        return rx_error_memory(err, n * sizeof(float));
    rx_filter_plane(&w->filter, run->restored->pixels, tile->width, tile->height, w->filtered);
    const rx_background *background = w->plain ? w->detect->plain : w->detect->restored;
    w->detect_sigma = run->restored->sigma != NULL ? run->restored->sigma : background->sigma;
    w->detect_global = background->global_sigma;
    if (!w->plain && run->restored->sigma == NULL)
        return equivalent_noise(run, w, err);
    return RX_OK;
}

/* Peak of the filtered image in units of its own noise: the order of certainty for P-R curves. */
static void rank_detections(const work *w, rx_sources *sources)
{
    const double norm = filter_norm(&w->filter);
    for (int i = 0; i < sources->n; i++) {
        rx_source *s = &sources->list[i];
        s->detection_snr = 0.0;
        for (int y = s->ymin; y <= s->ymax; y++) {
            for (int x = s->xmin; x <= s->xmax; x++) {
                size_t p = (size_t)y * (size_t)sources->width + (size_t)x;
                double snr = (double)w->filtered[p] / (norm * (double)w->detect_sigma[p]);
                if (sources->segments[p] == s->segment && snr > s->detection_snr)
                    s->detection_snr = snr;
            }
        }
    }
}

static rx_status detect_sources(rx_run *run, work *w, rx_log *log, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    rx_detect_image image = {.width = tile->width,
                             .height = tile->height,
                             .pixels = run->restored->pixels,
                             .sigma = w->detect_sigma,
                             .mask = run->restored->mask,
                             .mask_bits = w->hide,
                             .variable_noise = !w->plain || tile->weight_type != RX_WEIGHT_NONE,
                             .global_sigma = w->detect_global,
                             .gain = tile->gain};
    rx_status status = rx_detect_run(&w->options->detect, &image, log, &run->sources, err);
    if (status == RX_OK)
        rank_detections(w, run->sources);
    return status;
}

/* Fluxes come from the restored image (of the measurement tile in dual-image mode) or from untouched pixels.
 */
static rx_status measure_sources(rx_run *run, work *w, rx_log *log, rx_error *err)
{
    const rx_restored *restored = run->restored;
    int plain = w->plain;
    if (w->options->measure_original || plain) {
        restored = NULL;
    } else if (w->measure != w->detect) {
        rx_status status = restore(run, w->options, w->measure, &plain, log, &w->second, err);
        if (status != RX_OK)
            return status;
        restored = plain ? NULL : w->second;
    }
    rx_status status = rx_photometry_run(w->options, w->detect, restored != NULL ? run->restored : NULL,
                                         w->measure, restored, run->sources, log, &w->photometry, err);
    const rx_fluxcheck *check = &w->photometry.check;
    snprintf(run->account, sizeof run->account, "%s", run->restored->settings);
    if (status != RX_OK || check->n == 0)
        return status;
    char text[256];
    snprintf(text, sizeof text,
             "fluxes against untouched pixels, %d isolated sources: %.4f +- %.4f in apertures of %.1f "
             "pixels, FLUX_AUTO "
             "%.3f +- %.3f of these",
             check->n, check->wide, check->wide_error, check->diameter, check->automatic,
             check->automatic_error);
    rx_log_info(log, "%s[%d]: %s: %s", w->detect->tile->name, w->detect->tile->hdu, run->kind->name, text);
    snprintf(run->account, sizeof run->account, "%s; %s", run->restored->settings, text);
    return RX_OK;
}

/* The facts of this extension, for the headers of its table and images. */
static void describe(const rx_run *run, const work *w, rx_record *facts)
{
    const rx_restored *restored = run->restored;
    const rx_field *field = w->detect;
    const rx_background *background = w->plain ? field->plain : field->restored;
    rx_record_add(facts, "RXREST", "restorer", "%s", restored->name);
    rx_record_add(facts, "RXSETT", "its settings", "%s", restored->settings);
    if (restored->iterations > 0)
        rx_record_add(facts, "RXITER", "iterations done", "%d", restored->iterations);
    if (isfinite(restored->chi2))
        rx_record_add(facts, "RXCHI2", "reduced chi2 of restored * PSF - input", "%.6g", restored->chi2);
    if (restored->blur != NULL) {
        rx_record_add(facts, "RXPSF", "PSF of the input", "%s", restored->blur->description);
        rx_record_add(facts, "RXFWHM", "its FWHM, pixels", "%.4f", restored->blur->fwhm);
    }
    rx_record_add(facts, "RXMEAS", "image that fluxes are measured on", "%s",
                  w->options->measure_original || w->plain ? "ORIGINAL" : "RESTORED");
    rx_record_add(facts, "RXBACK", "mean sky level, ADU", "%.8g", background->global_level);
    rx_record_add(facts, "RXSIGMA", "noise of an input pixel, ADU", "%.8g", background->global_sigma);
    rx_record_add(facts, "RXDSIG", "noise that thresholds refer to, ADU", "%.8g", w->detect_global);
    rx_record_add(facts, "RXLAWS", "noise law: sigma(A) = RXLAWS * sigma * A^RXLAWP", "%.6g",
                  w->photometry.law.scale);
    rx_record_add(facts, "RXLAWP", "0.5 = independent pixels", "%.6g", w->photometry.law.power);
    rx_record_add(facts, "RXLAWN", "empty apertures behind the law, 0 = none", "%d",
                  w->photometry.law.apertures);
    if (w->photometry.law.apertures > 0)
        rx_record_add(facts, "RXLAWE", "scatter of the fit, dex", "%.4f", w->photometry.law.scatter);
    const rx_fluxcheck *check = &w->photometry.check;
    if (check->n > 0) {
        rx_record_add(facts, "RXFLXN", "isolated sources compared with untouched pixels", "%d", check->n);
        rx_record_add(facts, "RXFLXD", "aperture of the comparison, pixels", "%.2f", check->diameter);
        rx_record_add(facts, "RXFLXW", "its flux, restored / untouched", "%.5f", check->wide);
        rx_record_add(facts, "RXFLXWE", "1 sigma of RXFLXW", "%.5f", check->wide_error);
        rx_record_add(facts, "RXFLXA", "FLUX_AUTO restored / that flux untouched", "%.5f", check->automatic);
        rx_record_add(facts, "RXFLXAE", "1 sigma of RXFLXA", "%.5f", check->automatic_error);
    }
    rx_record_add(facts, "RXZP", "magnitude of 1 ADU", "%.6g", w->measure->tile->zeropoint);
    rx_record_add(facts, "RXGAIN", "gain, e-/ADU, 0 = infinite", "%.6g", w->measure->tile->gain);
    rx_record_add(facts, "RXSATUR", "saturation level, ADU", "%.6g", w->detect->tile->saturation);
    rx_record_add(facts, "RXINSUM", "digest of the input pixels", "%s", field->tile->checksum);
}

static rx_status write_images(const rx_run *run, const work *w, const rx_record *record,
                              const rx_record *facts, rx_error *err)
{
    if (run->images == NULL)
        return RX_OK;
    rx_status status = RX_OK;
    rx_text cards = {0};
    rx_record_cards(facts, &cards);
    rx_record_cards(record, &cards);
    if (cards.failed) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    rx_checkimage_data data = {.tile = w->detect->tile,
                               .background = w->plain ? w->detect->plain : w->detect->restored,
                               .restored = run->restored,
                               .sources = run->sources,
                               .filtered = w->filtered,
                               .mesh_width = w->options->background[0].mesh_width,
                               .mesh_height = w->options->background[0].mesh_height,
                               .cards = &cards};
    status = rx_checkimages_write(run->images, &data, err);
exit:
    rx_text_free(&cards);
    return status;
}

static rx_status add_table(rx_run *run, const work *w, const rx_record *facts, rx_error *err)
{
    rx_text cards = {0};
    rx_table **tables = rx_regrow(run->tables, (size_t)run->ntables + 1, sizeof *tables);
    if (tables == NULL)
        return rx_error_memory(err, 0);
    run->tables = tables;
    rx_status status =
        rx_catalog_table(w->options->columns, w->measure->tile, run->sources, &tables[run->ntables], err);
    if (status != RX_OK)
        return status;
    rx_table *table = tables[run->ntables++];
    rx_record_cards(facts, &cards);
    if (cards.failed) {
        rx_text_free(&cards);
        return rx_error_memory(err, 0);
    }
    table->facts = cards.data;
    table->nfacts = (long)(cards.length / 80);
    return RX_OK;
}

rx_status rx_run_extract(rx_run *run, const rx_options *options, const rx_field *detect,
                         const rx_field *measure, const rx_record *record, rx_log *log, rx_error *err)
{
    work w = {.options = options, .detect = detect, .measure = measure != NULL ? measure : detect};
    rx_record facts = {0};
    rx_status status = restore(run, options, detect, &w.plain, log, &run->restored, err);
    w.hide = w.plain && !options->saturated_in_none ? RX_HIDE_PLAIN : RX_HIDE_RESTORED;
    if (status == RX_OK)
        status = prepare_detection(run, &w, err);
    if (status == RX_OK)
        status = detect_sources(run, &w, log, err);
    if (status == RX_OK)
        status = measure_sources(run, &w, log, err);
    if (status == RX_OK)
        status = rx_coordinates_fill(w.measure->tile, run->sources, err);
    if (status == RX_OK && options->assoc_list != NULL)
        status = rx_assoc_match(&options->assoc, options->assoc_list, w.measure->tile->wcs, log, run->sources,
                                err);
    if (status != RX_OK)
        goto exit;
    describe(run, &w, &facts);
    status = facts.failed ? rx_error_memory(err, 0) : add_table(run, &w, &facts, err);
    if (status == RX_OK)
        status = write_images(run, &w, record, &facts, err);
    if (status == RX_OK)
        rx_log_info(log, "%s[%d]: %s: %d sources", detect->tile->name, detect->tile->hdu, run->kind->name,
                    run->sources->n);
exit:
    rx_record_free(&facts);
    rx_restored_free(w.second);
    rx_filter_free(&w.filter);
    free(w.filtered);
    free(w.noise);
    return status;
}

void rx_run_forget(rx_run *run)
{
    rx_restored_free(run->restored);
    rx_sources_free(run->sources);
    run->restored = NULL;
    run->sources = NULL;
}

rx_status rx_run_close(rx_run *run, const rx_options *options, const rx_record *record, FILE *standard_out,
                       rx_error *err)
{
    rx_checkimages *images = run->images;
    run->images = NULL;
    rx_status status = rx_checkimages_close(images, err);
    if (status != RX_OK)
        return status;
    rx_record_pair *pairs = RX_NEW(rx_record_pair, (size_t)record->n);
    if (pairs == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < record->n; i++)
        pairs[i] = (rx_record_pair){record->pairs[i][0], record->pairs[i][1], record->pairs[i][2]};
    status = rx_catalog_write(options->catalog_type, run->catalog_name, run->tables, run->ntables, pairs,
                              record->n, run->catalog_temporary, standard_out, err);
    free(pairs);
    return status;
}

void rx_run_free(rx_run *run)
{
    rx_run_forget(run);
    for (int i = 0; i < run->ntables; i++)
        rx_table_free(run->tables[i]);
    free(run->tables);
    rx_checkimages_free(run->images);
    free(run->catalog_name);
    *run = (rx_run){0};
}
