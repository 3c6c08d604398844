/* The QA report of one extension. */
#include "stage/report.h"

#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/names.h"
#include "stage/quality.h"
#include "stage/reference.h"

static rx_status match_options(const rx_options *options, const rx_tile *tile, rx_qa_params *dst,
                               rx_error *err)
{
    *dst = options->qa;
    dst->match_radius_arcsec = options->match_arcsec ? options->match_radius : 0.0;
    return rx_quality_radius(options, tile, &dst->match_radius, err);
}

/* All of a run but its sources. */
static rx_qa_run about(const rx_run *run, rx_qa_promise *promise)
{
    const rx_fluxcheck *flux = &run->flux;
    return (rx_qa_run){.name = run->kind->name,
                       .settings = run->account,
                       .by = run->by,
                       .why = run->why,
                       .flux = {.n = flux->n,
                                .diameter = flux->diameter,
                                .wide = flux->wide,
                                .wide_error = flux->wide_error,
                                .automatic = flux->automatic,
                                .automatic_error = flux->automatic_error,
                                .off = rx_fluxcheck_is_off(flux)},
                       .real = run->checks.blank.real,
                       .promise = rx_domain_promise(&run->domain, promise)};
}

static rx_status collect_runs(const rx_options *options, const rx_field *measure, const rx_run *runs,
                              rx_qa_promise *promises, rx_qa_run *dst, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < options->nrestorers && status == RX_OK; i++) {
        const rx_restored *restored = runs[i].restored;
        dst[i] = about(&runs[i], &promises[i]);
        dst[i].seconds = runs[i].seconds;
        dst[i].psf = restored->blur != NULL ? restored->blur->description : "";
        dst[i].tally = runs[i].tally;
        dst[i].tested = runs[i].tested;
        dst[i].made_up_per_mpixel = runs[i].invented_per_mpixel;
        dst[i].law_scale = runs[i].sources->law_scale;
        dst[i].law_power = runs[i].sources->law_power;
        status = rx_quality_list(options, measure->tile, runs[i].sources, &dst[i].list, err);
    }
    return status;
}

static rx_status collect_pictures(const rx_options *options, const rx_field *detect, const rx_run *runs,
                                  rx_qa_picture *dst, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < options->nrestorers && status == RX_OK; i++)
        status = rx_quality_picture(runs[i].kind->name, detect->tile->width, detect->tile->height,
                                    runs[i].restored->pixels, detect->plain->global_sigma, &dst[i], err);
    return status;
}

static rx_status open_folder(const char *wanted, int extension, rx_outputs *outputs, const char **folder,
                             rx_error *err)
{
    char tag[16] = "";
    if (extension > 0)
        snprintf(tag, sizeof tag, "%d", extension);
    char *name = rx_name_with_tag(wanted, tag);
    if (name == NULL)
        return rx_error_memory(err, 0);
    rx_status status = rx_outputs_folder(outputs, name, folder, err);
    free(name);
    return status;
}

rx_status rx_report_try(const rx_options *options, int extension, rx_error *err)
{
    const char *const names[] = {options->reference.name != NULL ? options->qa_name : "",
                                 options->self_check ? options->self_check_name : ""};
    const char *folder = NULL;
    rx_outputs *outputs = NULL;
    rx_status status = rx_outputs_new(&outputs, err);
    for (int i = 0; i < 2 && status == RX_OK; i++)
        if (names[i][0] != '\0')
            status = open_folder(names[i], extension, outputs, &folder, err);
    rx_outputs_free(outputs);
    return status;
}

rx_status rx_report_write(const rx_options *options, const rx_field *detect, const rx_field *measure,
                          const rx_table *reference, const rx_run *runs, int extension,
                          const rx_record *record, rx_outputs *outputs, rx_log *log, rx_verdict *verdict,
                          rx_text *brief, rx_error *err)
{
    const rx_tile *tile = measure->tile;
    rx_qa_run qa_runs[RX_MAX_RUNS] = {0};
    rx_qa_promise promises[RX_MAX_RUNS];
    rx_qa_picture pictures[RX_MAX_RUNS] = {0};
    rx_qa_params par;
    rx_verdict found = RX_VERDICT_NONE;
    const char *folder = NULL;
    const char *(*pairs)[2] = NULL;
    double scale = rx_quality_scale(tile);
    rx_qa_input input = {.tile = tile->name,
                         .reference = options->reference.name,
                         .width = tile->width,
                         .height = tile->height,
                         .mask = NULL,
                         .pixel_scale = scale,
                         .score_name = "peak S/N of the filtered detection image",
                         .nruns = options->nrestorers,
                         .runs = qa_runs,
                         .npictures = options->nrestorers,
                         .pictures = pictures};
    unsigned char *blind = NULL;
    size_t n = (size_t)tile->width * (size_t)tile->height;
    rx_status status = match_options(options, tile, &par, err);
    if (status == RX_OK)
        status = rx_reference_list(&options->reference, reference, tile, log, &input.truth, err);
    if (status == RX_OK && (blind = RX_NEW(unsigned char, n)) == NULL)
        status = rx_error_memory(err, n);
    for (size_t i = 0; i < n && blind != NULL; i++)
        blind[i] = (detect->tile->mask[i] & RX_HIDE_PLAIN) != 0;
    input.mask = blind;
    if (status == RX_OK)
        status = collect_runs(options, measure, runs, promises, qa_runs, err);
    if (status == RX_OK)
        status = collect_pictures(options, detect, runs, pictures, err);
    if (status == RX_OK)
        status = rx_record_list(record, &pairs, err);
    input.nrecord = record->n;
    input.record = (const char *const(*)[2])pairs;
    if (status == RX_OK)
        status = open_folder(options->qa_name, extension, outputs, &folder, err);
    if (status == RX_OK)
        status =
            rx_qa_report(&par, &input, folder, rx_outputs_shown(outputs, folder), log, &found, brief, err);
    *verdict = rx_verdict_worse(*verdict, found);
    rx_qa_list_free(&input.truth);
    for (int i = 0; i < options->nrestorers; i++) {
        rx_qa_list_free(&qa_runs[i].list);
        free((void *)pictures[i].pixels);
    }
    free(pairs);
    free(blind);
    return status;
}

rx_status rx_report_checks(const rx_options *options, const rx_checks *checks, const rx_run *runs,
                           int extension, const rx_record *record, rx_outputs *outputs, rx_log *log,
                           rx_error *err)
{
    const char *folder = NULL;
    const rx_check_results *results[RX_MAX_RUNS];
    rx_qa_promise promises[RX_MAX_RUNS];
    rx_qa_run qa_runs[RX_MAX_RUNS];
    if (options->self_check_name[0] == '\0' || !rx_checks_injected(checks))
        return RX_OK;
    for (int i = 0; i < options->nrestorers; i++) {
        qa_runs[i] = about(&runs[i], &promises[i]);
        results[i] = &runs[i].checks;
    }
    rx_status status = open_folder(options->self_check_name, extension, outputs, &folder, err);
    if (status == RX_OK)
        status = rx_checks_report(checks, options->nrestorers, qa_runs, results, record, folder,
                                  rx_outputs_shown(outputs, folder), log, err);
    return status;
}
