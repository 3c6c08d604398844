/* The QA report of one extension. */
#include "stage/report.h"

#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/names.h"
#include "check/quality.h"
#include "pipeline/residual.h"
#include "report/qa_page.h"
#include "report/tile_page.h"
#include "stage/domain_facts.h"
#include "stage/reference.h"

/* All of a run but its sources. */
static rx_qa_run about_run(const rx_run *run, rx_qa_promise *promise)
{
    const rx_fluxcheck *flux = &run->flux;
    return (rx_qa_run){.name = run->kind->name,
                       .settings = run->account,
                       .by = run->by,
                       .why = run->why,
                       .taken = run->taken != NULL ? run->taken->name : NULL,
                       .flux = {.n = flux->n,
                                .diameter = flux->diameter,
                                .wide = flux->wide,
                                .wide_error = flux->wide_error,
                                .automatic = flux->automatic,
                                .automatic_error = flux->automatic_error,
                                .off = rx_fluxcheck_is_off(flux)},
                       .blank = {.n = run->checks.blank.realisations,
                                 .mpixels = run->checks.blank.mpixels,
                                 .rate = run->checks.blank.rate,
                                 .raised = run->checks.blank.raised,
                                 .asked = run->checks.blank.asked},
                       .real = run->checks.blank.real,
                       .promise = rx_domain_promise(&run->domain, promise)};
}

static rx_status collect_runs(const rx_report_input *in, rx_qa_promise *promises, rx_qa_run *dst,
                              rx_error *err)
{
    for (int i = 0; i < in->options->nrestorers; i++) {
        const rx_restored *restored = in->runs[i].restored;
        dst[i] = about_run(&in->runs[i], &promises[i]);
        dst[i].seconds = in->runs[i].seconds;
        dst[i].psf = restored->blur != NULL ? restored->blur->description : "";
        dst[i].tally = in->runs[i].tally;
        dst[i].tested = in->runs[i].tested;
        dst[i].made_up_per_mpixel = in->runs[i].invented_per_mpixel;
        dst[i].law_scale = in->runs[i].sources->law_scale;
        dst[i].law_power = in->runs[i].sources->law_power;
        RX_TRY(rx_quality_list(&in->options->check.quality, in->fields.measure->tile, in->runs[i].sources,
                               &dst[i].list, err));
    }
    return RX_OK;
}

static char *folder_name(const char *wanted, int extension)
{
    char tag[16] = "";
    if (extension > 0)
        snprintf(tag, sizeof tag, "%d", extension);
    return rx_name_with_tag(wanted, tag);
}

static rx_status open_folder(const char *wanted, int extension, rx_outputs *outputs, const char **folder,
                             rx_error *err)
{
    char *name = folder_name(wanted, extension);
    if (name == NULL)
        return rx_error_memory(err, 0);
    rx_status status = rx_outputs_folder(outputs, name, folder, err);
    free(name);
    return status;
}

rx_status rx_report_try(const rx_config *config, const rx_options *options, const char *image, int extension,
                        rx_error *err)
{
    const char *const names[][2] = {
        {"QA_NAME", options->reference.name != NULL || options->tile_page ? options->qa_name : ""},
        {"SELF_CHECK_NAME", options->check.self_check ? options->self_check_name : ""}};
    const char *folder = NULL;
    rx_outputs *outputs = NULL;
    rx_status status = rx_outputs_new(&outputs, err);
    for (int i = 0; i < 2 && status == RX_OK; i++) {
        if (names[i][1][0] == '\0')
            continue;
        char *name = folder_name(names[i][1], extension);
        status = name == NULL ? rx_error_memory(err, 0) : RX_OK;
        if (status == RX_OK && extension > 0) /* the name of an extension's folder is known only now */
            status = rx_settings_check_folder((const rx_settings *)config, image, names[i][0], name, err);
        if (status == RX_OK)
            status = rx_outputs_folder(outputs, name, &folder, err);
        free(name);
    }
    rx_outputs_free(outputs);
    return status;
}

/* All runs against the reference. */
static rx_status compare(const rx_report_input *in, const char *folder, rx_verdict *verdict, rx_text *brief,
                         rx_error *err)
{
    const rx_options *options = in->options;
    const rx_tile *tile = in->fields.measure->tile;
    rx_qa_run qa_runs[RX_MAX_RUNS] = {0};
    rx_qa_promise promises[RX_MAX_RUNS];
    rx_qa_picture pictures[RX_MAX_RUNS] = {0};
    const rx_quality_params *quality = &options->check.quality;
    rx_qa_params par = options->qa;
    rx_verdict found = RX_VERDICT_NONE;
    const char *(*pairs)[2] = NULL;
    double scale = rx_quality_scale(tile);
    rx_qa_input input = {.tile = tile->name,
                         .reference = options->reference.name,
                         .width = tile->width,
                         .height = tile->height,
                         .mask = NULL,
                         .pixel_scale = scale,
                         .psf = {in->fields.detect->psf, in->fields.detect->image.zeropoint},
                         .score_name = "peak S/N of the filtered detection image",
                         .nruns = options->nrestorers,
                         .runs = qa_runs,
                         .npictures = options->nrestorers,
                         .pictures = pictures};
    if (input.psf.psf != NULL && input.psf.psf->quality.how == RX_PSF_BY_NOTHING)
        input.psf.psf = NULL;
    unsigned char *blind = NULL;
    rx_reference_note note = {0};
    size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_status status;
    par.match_radius_arcsec = quality->match_arcsec ? quality->match_radius : 0.0;
    RX_TRY_EXIT(rx_quality_radius(quality, tile, &par.match_radius, err));
    RX_TRY_EXIT(
        rx_reference_list(&options->reference, in->reference, tile, in->log, &input.truth, &note, err));
    input.reference = note.shown.data;
    RX_TRY_EXIT(RX_MAKE(blind, n, err));
    for (size_t i = 0; i < n; i++)
        blind[i] = (in->fields.detect->tile->mask[i] & RX_HIDE_PLAIN) != 0;
    input.mask = blind;
    RX_TRY_EXIT(collect_runs(in, promises, qa_runs, err));
    for (int i = 0; i < options->nrestorers; i++)
        RX_TRY_EXIT(rx_quality_picture(in->runs[i].kind->name, in->fields.detect->tile->width,
                                       in->fields.detect->tile->height, in->runs[i].restored->pixels,
                                       in->fields.detect->plain->global_sigma, &pictures[i], err));
    RX_TRY_EXIT(rx_record_list(in->record, &pairs, err));
    input.nrecord = in->record->n;
    input.record = (const char *const(*)[2])pairs;
    par.log = in->log;
    status = rx_qa_report(&par, &input, folder, rx_outputs_shown(in->outputs, folder), &found, brief, err);
exit:
    *verdict = rx_verdict_worse(*verdict, found);
    rx_qa_list_free(&input.truth);
    for (int i = 0; i < options->nrestorers; i++) {
        rx_qa_list_free(&qa_runs[i].list);
        free((void *)pictures[i].pixels);
    }
    rx_text_free(&note.shown);
    free(pairs);
    free(blind);
    return status;
}

/* The page of the tile by itself. */
static rx_status describe(const rx_report_input *in, const char *folder, rx_extension_facts *facts,
                          rx_error *err)
{
    const rx_options *options = in->options;
    rx_tile_restored runs[RX_MAX_RUNS];
    rx_qa_run abouts[RX_MAX_RUNS];
    rx_qa_promise promises[RX_MAX_RUNS];
    const char *(*pairs)[2] = NULL;
    rx_tile_about about = {.name = in->fields.detect->tile->name,
                           .image = rx_field_observed(in->fields.detect),
                           .nruns = options->nrestorers,
                           .runs = runs,
                           .seed = options->pipeline.seed};
    about.image.zeropoint = in->fields.measure->image.zeropoint;
    for (int i = 0; i < options->nrestorers; i++) {
        const rx_run *run = &in->runs[i];
        abouts[i] = about_run(run, &promises[i]);
        runs[i] = (rx_tile_restored){
            .about = &abouts[i],
            .sources = run->sources,
            .restored = run->restored,
            .pull = {.nx = run->misfit.nx,
                     .ny = run->misfit.ny,
                     .side = (about.image.width + run->misfit.nx - 1) / run->misfit.nx,
                     .value = run->misfit.pull},
            .unexplained = run->misfit.share,
            .misfit = run->misfit.cause != RX_MISFIT_NONE ? rx_misfit_text(run->misfit.cause) : NULL,
            .by = run->misfit.by,
            .plain = run->restored->blur == NULL,
            .outside = run->outside};
    }
    RX_TRY(rx_record_list(in->record, &pairs, err));
    const rx_tile_page page = {&about, in->record->n, (const char *const(*)[2])pairs};
    const rx_report_files files = {.folder = folder,
                                   .shown = rx_outputs_shown(in->outputs, folder),
                                   .figures = options->qa.figures,
                                   .gnuplot = options->qa.gnuplot,
                                   .log = in->log};
    rx_tile_page_facts found = {0};
    const rx_status status = rx_tile_page_write(&page, &files, &found, err);
    if (status == RX_OK && facts != NULL) {
        facts->state.wrong = found.wrong;
        facts->state.look = found.look;
        snprintf(facts->page, sizeof facts->page, "%s/tile.html", files.shown);
    }
    free(pairs);
    return status;
}

rx_status rx_stage_report(const rx_report_input *in, rx_extension_facts *facts, rx_verdict *verdict,
                          rx_text *brief, rx_error *err)
{
    const char *folder = NULL;
    RX_TRY(open_folder(in->options->qa_name, in->extension, in->outputs, &folder, err));
    if (in->reference != NULL)
        RX_TRY(compare(in, folder, verdict, brief, err));
    return in->options->tile_page ? describe(in, folder, facts, err) : RX_OK;
}

rx_status rx_report_checks(const rx_report_input *in, const rx_checks *checks, rx_error *err)
{
    const rx_options *options = in->options;
    const char *folder = NULL;
    const rx_check_results *results[RX_MAX_RUNS];
    rx_qa_promise promises[RX_MAX_RUNS];
    rx_qa_run qa_runs[RX_MAX_RUNS];
    if (options->self_check_name[0] == '\0' || !rx_checks_injected(checks))
        return RX_OK;
    for (int i = 0; i < options->nrestorers; i++) {
        qa_runs[i] = about_run(&in->runs[i], &promises[i]);
        results[i] = &in->runs[i].checks;
    }
    RX_TRY(open_folder(options->self_check_name, in->extension, in->outputs, &folder, err));
    return rx_checks_report(checks,
                            &(rx_checks_page){.n = options->nrestorers,
                                              .about = qa_runs,
                                              .results = results,
                                              .record = in->record,
                                              .folder = folder,
                                              .shown = rx_outputs_shown(in->outputs, folder)},
                            in->log, err);
}
