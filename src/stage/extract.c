/* One restorer through one tile. */
#include "stage/extract.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/names.h"
#include "catalog/assoc.h"
#include "io/fits_write.h"
#include "io/tile.h"
#include "stage/coordinates.h"
#include "stage/probe.h"
#include "stage/template_table.h"

/* One extension while it is extracted. */
typedef struct work {
    const rx_options *options;
    const rx_field *detect, *measure; /* measure: of the fluxes, the same as detect without dual-image mode */
    int headers;                      /* some output has a header that facts go into */
    rx_probe probe;
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
    if (status == RX_OK && options->templates.covariances[0] != '\0') {
        run->covariance_name = rx_name_with_tag(options->templates.covariances, tag);
        status = run->covariance_name == NULL
                     ? rx_error_memory(err, 0)
                     : rx_outputs_file(outputs, run->covariance_name, &run->covariance_temporary, err);
    }
    if (status != RX_OK)
        return status;
    return rx_checkimages_open(options->nchecks, options->check_types, options->check_names, tag, outputs,
                               &run->images, err);
}

/* What was found of the fluxes, for log and report. */
static void account(rx_run *run, const work *w, rx_log *log)
{
    const rx_tile *tile = w->detect->tile;
    const rx_fluxcheck *check = &run->flux;
    const char *settings = w->probe.restored->settings;
    snprintf(run->account, sizeof run->account, "%s", settings);
    if (check->n == 0)
        return;
    char text[256];
    snprintf(text, sizeof text,
             "fluxes against untouched pixels, %d isolated sources: %.4f +- %.4f in apertures of %.1f "
             "pixels, FLUX_AUTO %.3f +- %.3f of these",
             check->n, check->wide, check->wide_error, check->diameter, check->automatic,
             check->automatic_error);
    rx_log_detail(log, "%s[%d]: %s: %s", tile->name, tile->hdu, run->label, text);
    if (rx_fluxcheck_is_off(check))
        rx_log_warning(
            log, "%s[%d]: %s: the flux scale is off: restored/untouched %.4f +- %.4f, FLUX_AUTO %.3f +- %.3f",
            tile->name, tile->hdu, run->label, check->wide, check->wide_error, check->automatic,
            check->automatic_error);
    snprintf(run->account, sizeof run->account, "%s; %s", settings, text);
}

/* One more sentence in the account. */
static void add_account(rx_run *run, const char *text)
{
    size_t used = strlen(run->account);
    snprintf(run->account + used, sizeof run->account - used, "; %s", text);
}

/* What the template fit found. */
static void account_templates(rx_run *run, const work *w, rx_log *log)
{
    const rx_tile *tile = w->detect->tile;
    const rx_template_fit *fit = &w->probe.templates;
    char text[256];
    run->tested = fit->tphot != NULL;
    run->invented_per_mpixel = fit->per_mpixel;
    if (!run->tested)
        return;
    snprintf(
        text, sizeof text,
        "templates: %d sources in %d groups (largest %d), %d of them added from the residual; %d (%.3g per "
        "Mpixel) not wanted by the untouched pixels%s; residual chi2 %.3f",
        fit->tphot->n, fit->tphot->ngroups, fit->tphot->largest, fit->added, fit->invented, fit->per_mpixel,
        fit->dropped > 0 ? ", dropped" : "", fit->chi2);
    rx_log_detail(log, "%s[%d]: %s: %s", tile->name, tile->hdu, run->label, text);
    add_account(run, text);
}

static void describe_templates(const rx_template_fit *fit, rx_record *facts)
{
    if (fit->tphot == NULL)
        return;
    rx_record_add(facts, "RXTPFWHM", "templates: FWHM of the PSF, pixels", "%.4f", fit->fwhm);
    rx_record_add(facts, "RXTPGRP", "groups of sources fitted together", "%d", fit->tphot->ngroups);
    rx_record_add(facts, "RXTPMAX", "members of the largest", "%d", fit->tphot->largest);
    rx_record_add(facts, "RXTPADD", "sources added from the residual", "%d", fit->added);
    rx_record_add(facts, "RXTPSKY", "mean sky taken off between them, ADU", "%.6g", fit->tphot->sky);
    rx_record_add(facts, "RXTPODDS", "odds of points among clear sources", "%.4g", fit->tphot->star_odds);
    rx_record_add(facts, "RXTPCHI2", "reduced chi2 of the residual", "%.5f", fit->chi2);
    rx_record_add(facts, "RXINV", "sources that untouched pixels do not want", "%d", fit->invented);
    rx_record_add(facts, "RXINVMP", "the same per Mpixel", "%.5g", fit->per_mpixel);
    rx_record_add(facts, "RXINVDR", "of these dropped", "%d", fit->dropped);
}

/* The line of a restorer at NORMAL; the rest is in the full log. */
static void tell_sources(const rx_run *run, const work *w, rx_log *log)
{
    const rx_tile *tile = w->detect->tile;
    const rx_fluxcheck *check = &w->probe.photometry.check;
    char fluxes[64] = "", marked[64] = "";
    if (check->n > 0 && !rx_fluxcheck_is_off(check)) /* else the warning says so */
        snprintf(fluxes, sizeof fluxes, ", flux restored/untouched %.4f +- %.4f", check->wide,
                 check->wide_error);
    if (run->tested && w->probe.templates.invented > 0)
        snprintf(marked, sizeof marked, ", %d marked in FLAGS_RESTORE", w->probe.templates.invented);
    rx_log_info(log, "%s[%d]: %s: %d sources%s%s", tile->name, tile->hdu, run->label, w->probe.sources->n,
                marked, fluxes);
}

/* The facts of this extension, for the headers of its table and images. */
static void describe(const rx_run *run, const work *w, rx_record *facts)
{
    const rx_probe *probe = &w->probe;
    const rx_restored *restored = probe->restored;
    const rx_field *field = w->detect;
    const rx_background *background = probe->plain ? field->plain : field->restored;
    rx_record_add(facts, "RXREST", "restorer that made this", "%s", restored->name);
    rx_record_add(facts, "RXASKED", "restorer that was asked for", "%s", run->kind->name);
    if (run->by != NULL)
        rx_record_add(facts, "RXWHY", "why another one did it", "%s", run->why);
    rx_record_add(facts, "RXSETT", "its settings", "%s", restored->settings);
    if (restored->iterations > 0)
        rx_record_add(facts, "RXITER", "iterations done", "%d", restored->iterations);
    if (isfinite(restored->chi2))
        rx_record_add(facts, "RXCHI2", "reduced chi2 of restored * PSF - input", "%.6g", restored->chi2);
    if (isfinite(restored->seam))
        rx_record_add(facts, "RXSEAM", "largest change in other blocks, sigmas", "%.3g", restored->seam);
    if (restored->blur != NULL) {
        rx_record_add(facts, "RXPSF", "PSF of the input", "%s", restored->blur->description);
        rx_record_add(facts, "RXFWHM", "its FWHM, pixels", "%.4f", restored->blur->fwhm);
    }
    rx_record_add(facts, "RXMEAS", "image that fluxes are measured on", "%s",
                  probe->original ? "ORIGINAL" : "RESTORED");
    rx_record_add(facts, "RXBACK", "mean sky level, ADU", "%.8g", background->global_level);
    rx_record_add(facts, "RXSIGMA", "noise of an input pixel, ADU", "%.8g", background->global_sigma);
    rx_record_add(facts, "RXDSIG", "noise that thresholds refer to, ADU", "%.8g", probe->global_noise);
    rx_record_add(facts, "RXLAWS", "noise law: sigma(A) = RXLAWS * sigma * A^RXLAWP", "%.6g",
                  probe->photometry.law.scale);
    rx_record_add(facts, "RXLAWP", "0.5 = independent pixels", "%.6g", probe->photometry.law.power);
    rx_record_add(facts, "RXLAWN", "empty apertures behind the law, 0 = none", "%d",
                  probe->photometry.law.apertures);
    if (probe->photometry.law.apertures > 0)
        rx_record_add(facts, "RXLAWE", "scatter of the fit, dex", "%.4f", probe->photometry.law.scatter);
    const rx_fluxcheck *check = &probe->photometry.check;
    if (check->n > 0) {
        rx_record_add(facts, "RXFLXN", "isolated sources compared with untouched pixels", "%d", check->n);
        rx_record_add(facts, "RXFLXD", "aperture of the comparison, pixels", "%.2f", check->diameter);
        rx_record_add(facts, "RXFLXW", "its flux, restored / untouched", "%.5f", check->wide);
        rx_record_add(facts, "RXFLXWE", "1 sigma of RXFLXW", "%.5f", check->wide_error);
        rx_record_add(facts, "RXFLXA", "FLUX_AUTO restored / that flux untouched", "%.5f", check->automatic);
        rx_record_add(facts, "RXFLXAE", "1 sigma of RXFLXA", "%.5f", check->automatic_error);
        rx_record_add(facts, "RXFLXOK", "flux scale right, to 1 % or 5 sigma", "%s",
                      rx_fluxcheck_is_off(check) ? "F" : "T");
    }
    describe_templates(&probe->templates, facts);
    rx_record_add(facts, "RXZP", "magnitude of 1 ADU", "%.6g", w->measure->tile->zeropoint);
    rx_record_add(facts, "RXGAIN", "gain, e-/ADU, 0 = infinite", "%.6g", w->measure->tile->gain);
    rx_record_add(facts, "RXSATUR", "saturation level, ADU", "%.6g", w->detect->tile->saturation);
    if (w->headers)
        rx_record_add(facts, "RXINSUM", "digest of the input pixels", "%s", rx_tile_checksum(field->tile));
}

static rx_status write_images(const rx_run *run, const work *w, const rx_record *record,
                              const rx_record *facts, rx_record *products, rx_error *err)
{
    if (run->images == NULL)
        return RX_OK;
    rx_checkimage_data data = {.tile = w->detect->tile,
                               .background = w->probe.plain ? w->detect->plain : w->detect->restored,
                               .restored = w->probe.restored,
                               .sources = w->probe.sources,
                               .tphot = w->probe.templates.tphot,
                               .fitted = w->measure->tile,
                               .fitted_sky = w->measure->restored,
                               .filtered = w->probe.filtered,
                               .mesh_width = w->options->background[0].mesh_width,
                               .mesh_height = w->options->background[0].mesh_height,
                               .facts = facts,
                               .record = record,
                               .products = products};
    return rx_checkimages_write(run->images, &data, err);
}

/* Room for one more table of each kind. */
static rx_status grow_tables(rx_run *run, rx_error *err)
{
    rx_table **tables = rx_regrow(run->tables, (size_t)run->ntables + 1, sizeof *tables);
    if (tables == NULL)
        return rx_error_memory(err, 0);
    run->tables = tables;
    if (run->covariance_name == NULL)
        return RX_OK;
    tables = rx_regrow(run->covariances, (size_t)run->ntables + 1, sizeof *tables);
    if (tables == NULL)
        return rx_error_memory(err, 0);
    run->covariances = tables;
    return RX_OK;
}

static rx_status add_table(rx_run *run, const work *w, const rx_record *facts, rx_error *err)
{
    rx_text cards = {0};
    rx_table *covariances = NULL, **tables;
    rx_status status = grow_tables(run, err);
    if (status == RX_OK && run->covariance_name != NULL)
        status = rx_template_table(w->probe.templates.tphot, w->probe.sources, w->detect->tile->extension,
                                   &covariances, err);
    if (status != RX_OK)
        return status;
    tables = run->tables;
    status =
        rx_catalog_table(w->options->columns, w->measure->tile, w->probe.sources, &tables[run->ntables], err);
    if (status != RX_OK) {
        rx_table_free(covariances);
        return status;
    }
    if (covariances != NULL)
        run->covariances[run->ntables] = covariances;
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

/* What the network's model says of this tile. */
static rx_status tell_domain(rx_run *run, const work *w, rx_log *log, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    rx_text text = {0};
    rx_domain_text(&run->domain, &text);
    if (!text.failed && text.length > 0) {
        rx_log_detail(log, "%s[%d]: %s: %s", tile->name, tile->hdu, run->label, text.data);
        add_account(run, text.data);
    }
    rx_status status = text.failed ? rx_error_memory(err, 0) : RX_OK;
    rx_text_free(&text);
    return status;
}

static rx_status run_checks(rx_run *run, const rx_checks *checks, const work *w, rx_log *log, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    rx_text text = {0};
    rx_status status = rx_checks_run(checks, run->kind, &w->probe, log, &run->checks, err);
    if (status != RX_OK)
        return status;
    rx_checks_text(checks, &run->checks, &text);
    if (text.failed)
        status = rx_error_memory(err, 0);
    const rx_selfcheck *self = &run->checks.self;
    char depth[64] = "";
    if (isfinite(self->mag50.value) && isfinite(self->mag90.value))
        snprintf(depth, sizeof depth, ", 50 %% complete at %.2f, 90 %% at %.2f", self->mag50.value,
                 self->mag90.value);
    if (status == RX_OK && self->injected > 0)
        rx_log_info(log, "%s[%d]: %s: self check: %ld of %ld injected objects found%s", tile->name, tile->hdu,
                    run->label, self->found, self->injected, depth);
    if (status == RX_OK && run->checks.blank.realisations > 0)
        rx_log_info(log, "%s[%d]: %s: blank check: %.3g false detections per Mpixel", tile->name, tile->hdu,
                    run->label, run->checks.blank.rate.value);
    if (status == RX_OK && text.length > 0) {
        rx_log_detail(log, "%s[%d]: %s: %s", tile->name, tile->hdu, run->label, text.data);
        add_account(run, text.data);
    }
    rx_text_free(&text);
    return status;
}

/* Plain ASCII catalogues hold no facts. */
static int has_headers(const rx_options *options, const rx_run *run)
{
    const rx_catalog_type type = options->catalog_type;
    const int ascii = type == RX_CATALOG_NONE || type == RX_CATALOG_ASCII || type == RX_CATALOG_ASCII_HEAD ||
                      type == RX_CATALOG_ASCII_SKYCAT;
    return !ascii || options->nchecks > 0 || run->covariance_name != NULL;
}

rx_status rx_run_extract(rx_run *run, const rx_options *options, const rx_field *detect,
                         const rx_field *measure, const rx_checks *checks, const rx_record *record,
                         rx_record *products, rx_log *log, rx_error *err)
{
    work w = {.options = options,
              .detect = detect,
              .measure = measure != NULL ? measure : detect,
              .headers = has_headers(options, run)};
    rx_record facts = {0};
    const double begun = rx_seconds();
    rx_status status = rx_probe_run(options, run->kind, detect, measure, log, &w.probe, err);
    if (status != RX_OK)
        return status;
    rx_sources *sources = w.probe.sources;
    run->domain = w.probe.domain;
    run->by = w.probe.by;
    memcpy(run->why, w.probe.why, sizeof run->why);
    run->flux = w.probe.photometry.check;
    snprintf(run->label, sizeof run->label, run->by != NULL ? "%s (done by %s)" : "%s", run->kind->name,
             run->by);
    account(run, &w, log);
    account_templates(run, &w, log);
    status = tell_domain(run, &w, log, err);
    if (status == RX_OK)
        status = rx_coordinates_fill(w.measure->tile, sources, err);
    if (status == RX_OK && options->assoc_list != NULL)
        status =
            rx_assoc_match(&options->assoc, options->assoc_list, w.measure->tile->wcs, log, sources, err);
    if (status != RX_OK)
        goto exit;
    tell_sources(run, &w, log);
    status = run_checks(run, checks, &w, log, err);
    if (status != RX_OK)
        goto exit;
    describe(run, &w, &facts);
    rx_domain_facts(&w.probe.domain, &facts);
    rx_checks_facts(checks, &run->checks, &facts);
    status = facts.failed ? rx_error_memory(err, 0) : add_table(run, &w, &facts, err);
    if (status == RX_OK)
        status = write_images(run, &w, record, &facts, products, err);
    if (status != RX_OK)
        goto exit;
    run->restored = w.probe.restored; /* the report wants them */
    run->sources = sources;
    w.probe.restored = NULL;
    w.probe.sources = NULL;
exit:
    run->seconds = rx_seconds() - begun;
    rx_record_free(&facts);
    rx_probe_free(&w.probe);
    return status;
}

void rx_run_forget(rx_run *run)
{
    rx_restored_free(run->restored);
    rx_sources_free(run->sources);
    rx_check_results_free(&run->checks);
    run->restored = NULL;
    run->sources = NULL;
    run->tally = NULL;
}

/* The covariances' table has the format of the catalogue, where that makes sense. */
static rx_catalog_type covariance_type(rx_catalog_type type)
{
    if (type == RX_CATALOG_NONE || type == RX_CATALOG_ASCII_SKYCAT)
        return RX_CATALOG_ASCII_HEAD;
    return type == RX_CATALOG_FITS_LDAC ? RX_CATALOG_FITS_1_0 : type;
}

/* One more card in the header of the table. */
static rx_status add_digest_card(rx_table *table, const char *digest, rx_error *err)
{
    rx_text cards = {0};
    if (table->facts != NULL)
        rx_text_add_bytes(&cards, table->facts, (size_t)table->nfacts * 80);
    rx_card_text(&cards, "RXDIGEST", digest, "");
    if (cards.failed) {
        rx_text_free(&cards);
        return rx_error_memory(err, 0);
    }
    free(table->facts);
    table->facts = cards.data;
    table->nfacts = (long)(cards.length / 80);
    return RX_OK;
}

static rx_status digest_tables(rx_catalog_type type, rx_table **tables, int n, const char *name,
                               rx_record *products, rx_error *err)
{
    rx_status status = RX_OK;
    for (int part = 0; part < rx_catalog_parts(type, n) && n > 0 && status == RX_OK; part++) {
        char digest[RX_HASH_TEXT];
        status = rx_catalog_digest(type, tables, n, part, digest, err);
        if (status != RX_OK)
            return status;
        rx_record_product(products, digest, part + 1, name);
        status = add_digest_card(tables[part], digest, err);
    }
    return status == RX_OK && products->failed ? rx_error_memory(err, 0) : status;
}

rx_status rx_run_digest(rx_run *run, const rx_options *options, rx_record *products, rx_error *err)
{
    const rx_catalog_type type = options->catalog_type;
    rx_status status = RX_OK;
    if (type != RX_CATALOG_NONE)
        status = digest_tables(type, run->tables, run->ntables, run->catalog_name, products, err);
    if (status == RX_OK && run->covariance_name != NULL)
        status = digest_tables(covariance_type(type), run->covariances, run->ntables, run->covariance_name,
                               products, err);
    return status;
}

/* One file with the record of what made it. */
static rx_status write_tables(rx_catalog_type type, const char *name, rx_table **tables, int n,
                              const rx_record *record, const rx_record *products, const char *temporary,
                              FILE *standard_out, rx_error *err)
{
    rx_record whole = {0};
    rx_record_pair *pairs = NULL;
    rx_status status = rx_record_of(record, products, name, &whole, err);
    if (status != RX_OK)
        goto exit;
    pairs = RX_NEW(rx_record_pair, (size_t)whole.n);
    if (pairs == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    for (int i = 0; i < whole.n; i++)
        pairs[i] = (rx_record_pair){whole.pairs[i][0], whole.pairs[i][1], whole.pairs[i][2]};
    status = rx_catalog_write(type, name, tables, n, pairs, whole.n, temporary, standard_out, err);
exit:
    free(pairs);
    rx_record_free(&whole);
    return status;
}

rx_status rx_run_close(rx_run *run, const rx_options *options, const rx_record *record,
                       const rx_record *products, FILE *standard_out, rx_error *err)
{
    const rx_catalog_type type = options->catalog_type;
    rx_checkimages *images = run->images;
    run->images = NULL;
    rx_status status = rx_checkimages_close(images, err);
    if (status == RX_OK)
        status = write_tables(type, run->catalog_name, run->tables, run->ntables, record, products,
                              run->catalog_temporary, standard_out, err);
    if (status == RX_OK && run->covariance_name != NULL)
        status = write_tables(covariance_type(type), run->covariance_name, run->covariances, run->ntables,
                              record, products, run->covariance_temporary, NULL, err);
    return status;
}

void rx_run_free(rx_run *run)
{
    rx_run_forget(run);
    for (int i = 0; i < run->ntables; i++)
        rx_table_free(run->tables[i]);
    for (int i = 0; i < run->ntables && run->covariances != NULL; i++)
        rx_table_free(run->covariances[i]);
    free(run->tables);
    free(run->covariances);
    free(run->covariance_name);
    rx_checkimages_free(run->images);
    free(run->catalog_name);
    *run = (rx_run){0};
}
