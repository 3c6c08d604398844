/* One restorer through one tile. */
#include "stage/extract.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/names.h"
#include "catalog/assoc.h"
#include "check/restored_noise.h"
#include "data/facts.h"
#include "io/fits_write.h"
#include "io/tile.h"
#include "pipeline/pipeline.h"
#include "stage/coordinates.h"
#include "stage/domain_facts.h"
#include "stage/positions.h"
#include "stage/template_table.h"

/* One extension while it is extracted. */
typedef struct work {
    const rx_options *options;
    const rx_field *detect, *measure; /* measure: of the fluxes, the same as detect without dual-image mode */
    const rx_restorer *kind;          /* the run's, or what AUTO took */
    rx_pipeline_params params;        /* the options', DETECT_THRESH as the guard left it */
    rx_result result;
    rx_positions positions; /* of POSITIONS_NAME, on this image */
} work;

/* A table beside the catalogue has its format, where that makes sense. */
static rx_catalog_type side_type(rx_catalog_type type)
{
    if (type == RX_CATALOG_NONE || type == RX_CATALOG_ASCII_SKYCAT || type == RX_CATALOG_DS9)
        return RX_CATALOG_ASCII_HEAD;
    return type == RX_CATALOG_FITS_LDAC ? RX_CATALOG_FITS_1_0 : type;
}

rx_status rx_run_open(rx_run *run, const rx_options *options, const rx_restorer *kind, int tagged,
                      rx_outputs *outputs, rx_error *err)
{
    const char *tag = tagged ? kind->name : NULL;
    const bool to_file =
        options->catalog_type != RX_CATALOG_NONE && strcmp(options->catalog_name, "STDOUT") != 0;
    run->kind = kind;
    for (int k = 0; k < RX_RUN_FILES; k++) {
        rx_table_file *file = &run->file[k];
        const char *name = k == RX_RUN_CATALOG          ? options->catalog_name
                           : k == RX_RUN_COVARIANCES    ? options->covariance_name
                           : options->positions != NULL ? run->file[RX_RUN_CATALOG].name
                                                        : "";
        if (name[0] == '\0')
            continue;
        file->type = k == RX_RUN_CATALOG ? options->catalog_type : side_type(options->catalog_type);
        file->name = rx_name_with_tag(name, k == RX_RUN_POSITIONS ? RX_FORCED_TAG : tag);
        if (file->name == NULL)
            return rx_error_memory(err, 0);
        if (k != RX_RUN_CATALOG || to_file)
            RX_TRY(rx_outputs_file(outputs, file->name, &file->temporary, err));
    }
    return rx_checkimages_open(options->nchecks, options->check_types, options->check_names, tag, outputs,
                               &run->images, err);
}

/* One more sentence in the account. */
static void add_account(rx_run *run, const char *text)
{
    size_t used = strlen(run->account);
    snprintf(run->account + used, sizeof run->account - used, "; %s", text);
}

/* The same, and in the full log. */
static void log_account(rx_run *run, const rx_tile *tile, const char *text, rx_log *log)
{
    rx_log_detail(log, "%s[%d]: %s: %s", tile->name, tile->hdu, run->label, text);
    add_account(run, text);
}

/* What was found of the fluxes, for log and report. */
static void account(rx_run *run, const work *w, rx_log *log)
{
    const rx_fluxcheck *check = &run->flux;
    snprintf(run->account, sizeof run->account, "%s", w->result.restored->settings);
    if (check->n == 0)
        return;
    char text[256];
    snprintf(text, sizeof text,
             "fluxes against untouched pixels, %d isolated sources: %.4f +- %.4f in apertures of %.1f "
             "pixels, FLUX_AUTO %.3f +- %.3f of these",
             check->n, check->wide, check->wide_error, check->diameter, check->automatic,
             check->automatic_error);
    log_account(run, w->detect->tile, text, log);
}

/* What the template fit found. */
static void account_templates(rx_run *run, const work *w, rx_log *log)
{
    const rx_tile *tile = w->detect->tile;
    const rx_template_fit *fit = &w->result.templates;
    char text[320];
    run->tested = fit->tphot != NULL;
    run->invented_per_mpixel = fit->per_mpixel;
    const double precision = w->options->pipeline.templates.precision;
    if (precision > 0.0 && (!run->tested || fit->unknown_noise))
        rx_log_warning(log,
                       "%s[%d]: %s: no source can be tested, so that PRECISION_TARGET leaves the list as it "
                       "was detected",
                       tile->name, tile->hdu, run->label);
    if (!run->tested)
        return;
    char dropped[60] = "";
    if (fit->dropped > 0)
        snprintf(dropped, sizeof dropped, ", %d dropped (P_REAL below %.3f)", fit->dropped,
                 fmin(fit->least, 1));
    snprintf(text, sizeof text,
             "templates: %d sources in %d groups (largest %d), %d of them added from the residual; %d (%.3g "
             "per Mpixel) not significant in the untouched pixels%s; residual chi2 %.3f",
             fit->tphot->n, fit->tphot->ngroups, fit->tphot->largest, fit->added, fit->invented,
             fit->per_mpixel, dropped, fit->chi2);
    log_account(run, tile, text, log);
    if (!(precision > 0.0) && rx_spurious_are_many(fit->invented, w->result.sources->n))
        rx_log_warning(log,
                       "%s[%d]: %s: %d of %d sources are marked as spurious (P_REAL below 0.5): are noise, "
                       "PSF and GAIN those of these pixels? If so, raise DETECT_THRESH",
                       tile->name, tile->hdu, run->label, fit->invented, w->result.sources->n);
}

/* For the record of a survey: what the log has warned of. */
static void describe_outside(const rx_result *result, rx_run *run)
{
    const rx_noise_correlation *noise = &result->detect->noise;
    const bool trained = run->by != NULL || run->domain.place != RX_DOMAIN_OUTSIDE;
    char structure[80] = "", dark[80] = "";
    if (rx_noise_is_structure(noise))
        snprintf(structure, sizeof structure, "noise %.1f times as wide as that of independent pixels, ",
                 rx_noise_factor_wide(noise));
    if (run->is_dark)
        snprintf(dark, sizeof dark, "%.0f %% of it below the sky, ", 100.0 * result->residual.dark);
    const int length = snprintf(run->outside, sizeof run->outside, "%s%s%s%s", trained ? "" : run->domain.why,
                                trained ? "" : ", ", structure, dark);
    if (length >= 2 && length < (int)sizeof run->outside)
        run->outside[length - 2] = '\0'; /* the last comma */
}

/* The line of a restorer at NORMAL; the rest is in the full log. */
static void log_sources(const rx_run *run, const work *w, rx_log *log)
{
    const rx_tile *tile = w->detect->tile;
    const rx_fluxcheck *check = &w->result.photometry.check;
    char fluxes[64] = "", marked[64] = "";
    if (check->n > 0 && !rx_fluxcheck_is_off(check)) /* else rx_runs_warn() says so */
        snprintf(fluxes, sizeof fluxes, ", flux restored/untouched %.4f +- %.4f", check->wide,
                 check->wide_error);
    if (run->tested && w->result.templates.invented > 0 && w->result.templates.dropped == 0)
        snprintf(marked, sizeof marked, ", %d marked in FLAGS_RESTORE", w->result.templates.invented);
    rx_log_info(log, "%s[%d]: %s: %d sources%s%s", tile->name, tile->hdu, run->label, w->result.sources->n,
                marked, fluxes);
}

/* The cards, which are freed where they failed, become those of the table's facts. */
static rx_status take_facts(rx_table *table, rx_text *cards, rx_error *err)
{
    if (cards->failed) {
        rx_text_free(cards);
        return rx_error_memory(err, 0);
    }
    free(table->facts);
    table->facts = cards->data;
    table->nfacts = (long)(cards->length / RX_CARD);
    return RX_OK;
}

/* What fails is freed with the run. */
static rx_status add_table(rx_run *run, const work *w, const rx_record *facts, rx_error *err)
{
    rx_text cards = {0};
    const rx_template_fit *templates = &w->result.templates;
    const rx_image *image = &w->measure->image;
    const rx_tile *tile = w->measure->tile;
    const int n = run->ntables;
    rx_table **table[RX_RUN_FILES];
    for (int k = RX_RUN_FILES - 1; k >= 0; k--)
        RX_TRY(RX_GROW(run->file[k].tables, (size_t)n + 1, err));
    for (int k = 0; k < RX_RUN_FILES; k++) {
        table[k] = &run->file[k].tables[n];
        *table[k] = NULL;
    }
    run->ntables++;
    if (run->file[RX_RUN_COVARIANCES].name != NULL)
        RX_TRY(rx_template_table(templates->tphot, w->result.sources, w->detect->tile->extension,
                                 table[RX_RUN_COVARIANCES], err));
    if (run->file[RX_RUN_POSITIONS].name != NULL)
        RX_TRY(rx_position_list_table(w->options->positions, image, templates->forced,
                                      table[RX_RUN_POSITIONS], err));
    RX_TRY(rx_catalog_table(w->options->columns, image, w->result.sources, table[RX_RUN_CATALOG], err));
    if (tile->cards != NULL)
        RX_TRY(rx_table_copy_cards(*table[RX_RUN_CATALOG], tile->cards, tile->ncards, err));
    rx_record_cards(facts, &cards);
    return take_facts(*table[RX_RUN_CATALOG], &cards, err);
}

/* What the network's model says of this tile. */
static rx_status log_domain(rx_run *run, const work *w, rx_log *log, rx_error *err)
{
    rx_text text = {0};
    rx_domain_text(&run->domain, &text);
    if (!text.failed && text.length > 0)
        log_account(run, w->detect->tile, text.data, log);
    rx_status status = text.failed ? rx_error_memory(err, 0) : RX_OK;
    rx_text_free(&text);
    return status;
}

static rx_status run_checks(rx_run *run, const rx_checks *checks, work *w, rx_log *log, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    rx_text text = {0};
    rx_status status = RX_OK;
    RX_TRY(rx_checks_run(checks, &w->params, w->kind, &w->result, log, &run->checks, err));
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
    const rx_blankcheck *blank = &run->checks.blank;
    if (status == RX_OK && blank->realisations > 0)
        rx_log_info(log,
                    "%s[%d]: %s: blank check: %.3g false detections per Mpixel (%.3g to %.3g at 95 %%, from "
                    "%ld in %.2g Mpixel of noise)",
                    tile->name, tile->hdu, run->label, blank->rate.value, blank->rate.low, blank->rate.high,
                    blank->false_detections, blank->mpixels);
    if (status == RX_OK && text.length > 0)
        log_account(run, tile, text.data, log);
    rx_text_free(&text);
    return status;
}

/* Has some output a header that facts go into? Plain ASCII catalogues hold none. */
static int has_headers(const rx_options *options, const rx_run *run)
{
    const rx_catalog_type type = options->catalog_type;
    const int ascii = type == RX_CATALOG_NONE || type == RX_CATALOG_ASCII || type == RX_CATALOG_ASCII_HEAD ||
                      type == RX_CATALOG_ASCII_SKYCAT || type == RX_CATALOG_DS9;
    return !ascii || options->nchecks > 0 || run->file[RX_RUN_COVARIANCES].name != NULL;
}

static rx_status extract(rx_run *run, work *w, rx_log *log, rx_error *err)
{
    w->params = w->options->pipeline;
    RX_TRY(rx_checks_guard(&w->options->check, w->kind, w->detect, &w->params, log, &run->checks.blank, err));
    w->params.templates.positions = w->options->positions != NULL ? &w->positions : NULL;
    const rx_status status =
        rx_field_extract(&w->params, w->kind, w->detect, w->measure, log, &w->result, err);
    w->params.templates.positions = NULL;
    return status;
}

/* The first candidate that nothing speaks against, before or after; `why` is what spoke against those before it. */
static rx_status extract_by_choice(rx_run *run, work *w, rx_log *log, rx_error *err)
{
    const rx_tile *tile = w->detect->tile;
    char out[200], all[sizeof run->why] = "the model of the tile explains it";
    size_t used = 0;
    for (int i = 0; i < RX_CHOICE_CANDIDATES; i++) {
        RX_TRY(rx_choice_before(&w->options->pipeline, w->detect, i, &w->kind, out, err));
        if (out[0] == '\0') {
            RX_TRY(extract(run, w, log, err));
            rx_choice_after(&w->result, out);
            if (out[0] == '\0')
                break;
            rx_result_free(&w->result);
            rx_blankcheck_free(&run->checks.blank);
        }
        if (used < sizeof all)
            used += (size_t)snprintf(all + used, sizeof all - used, "%s%s: %s", used > 0 ? "; " : "",
                                     w->kind->name, out);
    }
    run->taken = w->kind;
    w->result.kind = run->kind;
    snprintf(w->result.why, sizeof w->result.why, "%s", all);
    rx_log_info(log, "%s[%d]: %s: %s: %s", tile->name, tile->hdu, run->kind->name, w->kind->name, all);
    return RX_OK;
}

rx_status rx_run_extract(rx_run *run, const rx_extraction_input *in, rx_log *log, rx_error *err)
{
    const rx_options *options = in->options;
    const rx_field *detect = in->detect, *measure = in->measure;
    work w = {.options = options, .detect = detect, .measure = measure != NULL ? measure : detect};
    rx_record facts = {0}, shown = {0};
    float *rms = NULL;
    const double begun = rx_seconds();
    run->checks = (rx_check_results){0};
    rx_status status = RX_OK;
    w.kind = run->kind;
    run->taken = NULL;
    if (options->positions != NULL)
        status = rx_position_list_pixels(options->positions, options->positions_name, w.measure->tile, log,
                                         &w.positions, err);
    if (status == RX_OK)
        status = rx_restorer_is_auto(run->kind) ? extract_by_choice(run, &w, log, err)
                                                : extract(run, &w, log, err);
    free(w.positions.at);
    if (status != RX_OK)
        return status;
    rx_sources *sources = w.result.sources;
    run->domain = w.result.domain;
    run->by = w.result.by;
    memcpy(run->why, w.result.why, sizeof run->why);
    run->flux = w.result.photometry.check;
    run->is_dark = rx_result_is_dark(&w.result);
    run->sharp = rx_result_sharp(&w.result);
    describe_outside(&w.result, run);
    const char *did = run->by != NULL ? run->by : run->taken != NULL ? run->taken->name : NULL;
    snprintf(run->label, sizeof run->label, did != NULL ? "%s (done by %s)" : "%s", run->kind->name, did);
    account(run, &w, log);
    if (run->taken != NULL)
        add_account(run, run->why);
    RX_TRY_EXIT(log_domain(run, &w, log, err));
    RX_TRY_EXIT(rx_coordinates_fill(&w.measure->image, sources, err));
    if (options->assoc_list != NULL)
        RX_TRY_EXIT(
            rx_assoc_match(&options->assoc, options->assoc_list, w.measure->tile->wcs, log, sources, err));
    RX_TRY_EXIT(run_checks(run, in->checks, &w, log, err));
    rx_checks_apply(&run->checks, &w.result);
    account_templates(run, &w, log);
    log_sources(run, &w, log);
    rx_result_facts(&w.result, &facts);
    run->misfit = w.result.residual;
    w.result.residual = (rx_residual){0};
    if (has_headers(options, run))
        rx_fact_text(&facts, RX_FACT_INSUM, rx_tile_checksum(detect->tile));
    rx_domain_facts(&w.result.domain, &facts);
    rx_checks_facts(in->checks, &w.params, &run->checks, &facts);
    rx_facts_of_header(&facts, options->all_facts, &shown);
    RX_TRY_EXIT(shown.failed ? rx_error_memory(err, 0) : add_table(run, &w, &shown, err));
    const rx_background_params *background = &options->pipeline.background[0];
    if (run->images != NULL && options->restored_rms) {
        RX_TRY_EXIT(RX_MAKE(rms, (size_t)detect->tile->width * (size_t)detect->tile->height, err));
        RX_TRY_EXIT(rx_restored_noise(&w.params, &w.result, rms, err));
    }
    const rx_checkimage_data images = {.result = &w.result,
                                       .rms = rms,
                                       .mesh_width = background->mesh_width,
                                       .mesh_height = background->mesh_height,
                                       .facts = &shown,
                                       .record = in->record,
                                       .products = in->products,
                                       .log = log};
    if (run->images != NULL)
        RX_TRY_EXIT(rx_checkimages_write(run->images, &images, err));
    if (in->kept != NULL) {
        *in->kept = w.result;
        *in->facts = facts;
        w.result = (rx_result){0};
        facts = (rx_record){0};
    } else {
        run->restored = w.result.restored; /* the report wants them */
        run->sources = sources;
        run->facts = facts;
        facts = (rx_record){0};
        w.result.restored = NULL;
        w.result.sources = NULL;
    }
exit:
    run->seconds = rx_seconds() - begun;
    free(rms);
    rx_record_free(&facts);
    rx_record_free(&shown);
    rx_result_free(&w.result);
    return status;
}

/* It was done by a restorer that has a run of its own, whose line says the same. */
static bool is_repeated(const rx_run *runs, int n, int i)
{
    bool repeated = false;
    for (int j = 0; j < n && runs[i].by != NULL; j++)
        repeated |= strcmp(runs[j].kind->name, runs[i].by) == 0;
    return repeated;
}

/* One line of the runs that a model fails for the same reason, with the number of the first. */
static void warn_of_misfit(const rx_run *runs, int n, rx_misfit cause, const rx_tile *tile, rx_log *log)
{
    char names[RX_MAX_RUNS * 16] = "";
    double by = 0;
    size_t used = 0;
    for (int i = 0; i < n; i++)
        if (runs[i].misfit.cause == cause && !is_repeated(runs, n, i) && used < sizeof names) {
            by = used == 0 ? runs[i].misfit.by : by;
            used += (size_t)snprintf(names + used, sizeof names - used, "%s%s", used > 0 ? ", " : "",
                                     runs[i].kind->name);
        }
    if (used > 0)
        rx_log_warning(log, "%s[%d]: %s %.2g (%s; RXMISFIT %s): %s", tile->name, tile->hdu,
                       rx_misfit_text(cause), by, names, rx_misfit_name(cause), rx_misfit_remedy(cause));
}

void rx_runs_warn(const rx_run *runs, int n, const rx_tile *tile, rx_log *log)
{
    char text[RX_MAX_RUNS * 128] = "";
    size_t used = 0;
    for (int i = 0; i < n; i++) {
        const rx_fluxcheck *check = &runs[i].flux;
        if (!rx_fluxcheck_is_off(check) || is_repeated(runs, n, i) || used >= sizeof text)
            continue;
        used += (size_t)snprintf(text + used, sizeof text - used,
                                 "%s%s: restored/untouched %.4f +- %.4f, FLUX_AUTO %.3f +- %.3f",
                                 used > 0 ? "; " : "", runs[i].label, check->wide, check->wide_error,
                                 check->automatic, check->automatic_error);
    }
    if (used > 0)
        rx_log_warning(log, "%s[%d]: the flux scale is off: %s", tile->name, tile->hdu, text);
    for (int cause = RX_MISFIT_NONE + 1; cause < RX_MISFITS; cause++)
        warn_of_misfit(runs, n, (rx_misfit)cause, tile, log);
    for (int i = 0; i < n; i++)
        if (runs[i].is_dark)
            rx_log_warning(log,
                           "%s[%d]: %s: %.0f %% of the tile's boxes of 32 pixels lie below the sky, which "
                           "the network was not trained for (RXDARK; sources there have FLAGS_RESTORE 64): "
                           "is its sky right, are there dark clouds?",
                           tile->name, tile->hdu, runs[i].label, 100.0 * runs[i].misfit.dark);
    for (int i = 0; i < n; i++)
        if (runs[i].by != NULL)
            rx_log_warning(log, "%s[%d]: %s: done by %s, %s", tile->name, tile->hdu, runs[i].kind->name,
                           runs[i].by, runs[i].why);
}

void rx_run_forget(rx_run *run)
{
    rx_restored_free(run->restored);
    rx_sources_free(run->sources);
    rx_check_results_free(&run->checks);
    rx_record_free(&run->facts);
    rx_residual_free(&run->misfit);
    run->restored = NULL;
    run->sources = NULL;
    run->tally = NULL;
}

/* One more card in the header of each table. */
static rx_status digest_tables(const rx_table_file *file, int n, rx_record *products, rx_error *err)
{
    for (int part = 0; part < rx_catalog_parts(file->type, n) && n > 0; part++) {
        char digest[RX_HASH_TEXT];
        rx_table *table = file->tables[part];
        rx_text cards = {0};
        RX_TRY(rx_catalog_digest(file->type, file->tables, n, part, digest, err));
        rx_record_product(products, digest, part + 1, file->name);
        if (table->facts != NULL)
            rx_text_add_bytes(&cards, table->facts, (size_t)table->nfacts * RX_CARD);
        rx_card_text(&cards, "RXDIGEST", digest, "");
        RX_TRY(take_facts(table, &cards, err));
    }
    return products->failed ? rx_error_memory(err, 0) : RX_OK;
}

rx_status rx_run_digest(rx_run *run, rx_record *products, rx_error *err)
{
    for (const rx_table_file *file = run->file; file < run->file + RX_RUN_FILES; file++)
        if (file->name != NULL && file->type != RX_CATALOG_NONE)
            RX_TRY(digest_tables(file, run->ntables, products, err));
    return RX_OK;
}

rx_status rx_run_close(rx_run *run, const rx_record *record, const rx_record *products, FILE *standard_out,
                       rx_error *err)
{
    rx_status status = RX_OK;
    rx_checkimages *images = run->images;
    run->images = NULL;
    RX_TRY(rx_checkimages_close(images, err));
    for (const rx_table_file *file = run->file; file < run->file + RX_RUN_FILES && status == RX_OK; file++) {
        rx_record whole = {0}; /* of what made the file */
        const rx_catalog catalog = {file->type, run->ntables, file->tables, &whole};
        if (file->name == NULL)
            continue;
        status = rx_record_of(record, products, file->name, &whole, err);
        if (status == RX_OK)
            status = rx_catalog_write(&catalog, file->name, file->temporary, standard_out, err);
        rx_record_free(&whole);
    }
    return status;
}

void rx_run_free(rx_run *run)
{
    rx_run_forget(run);
    for (rx_table_file *file = run->file; file < run->file + RX_RUN_FILES; file++) {
        for (int i = 0; i < run->ntables; i++)
            rx_table_free(file->tables[i]);
        free(file->tables);
        free(file->name);
    }
    rx_checkimages_free(run->images);
    *run = (rx_run){0};
}
