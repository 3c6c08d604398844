/* One tile of the photometry campaign through every restorer. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "check/blankcheck.h"
#include "check/quality.h"
#include "lab/photometry_sky.h"
#include "lab/unit_row.h"
#include "pipeline/pipeline.h"

/* --- before the units: an untouched tile --- */

static int near_known(const rx_known *known, double x, double y, double radius)
{
    for (long i = 0; i < known->n; i++)
        if (hypot(x - known->x[i], y - known->y[i]) <= radius)
            return 1;
    return 0;
}

/* Detections that no earlier restorer had, and the footprints of all. */
static rx_status join_known(const rx_photometry_sky *sky, const rx_result *result, const rx_qa_list *list,
                            double radius, rx_known *dst, rx_error *err)
{
    const size_t n = (size_t)sky->width * (size_t)sky->height;
    rx_known all;
    rx_status status = rx_known_new(dst->n + list->n, &all, err);
    if (status != RX_OK)
        return status;
    all.n = dst->n;
    for (long i = 0; i < dst->n; i++) {
        all.x[i] = dst->x[i];
        all.y[i] = dst->y[i];
        all.flux[i] = dst->flux[i];
        all.radius[i] = dst->radius[i];
    }
    for (long i = 0; i < list->n; i++) {
        if (near_known(dst, list->x[i], list->y[i], radius))
            continue;
        all.x[all.n] = list->x[i];
        all.y[all.n] = list->y[i];
        all.flux[all.n] = list->flux[i];
        all.radius[all.n++] = fmax(radius, sky->fwhm);
    }
    all.width = sky->width;
    all.height = sky->height;
    all.covered = dst->covered != NULL ? dst->covered : RX_NEW(unsigned char, n);
    dst->covered = NULL;
    rx_known_free(dst);
    *dst = all;
    if (dst->covered == NULL)
        return rx_error_memory(err, n);
    for (size_t i = 0; i < n; i++)
        dst->covered[i] |= result->sources->segments[i] != 0;
    return RX_OK;
}

static rx_status prepare_sky(const rx_photometry_state *state, rx_photometry_sky *sky, rx_log *log,
                             rx_error *err)
{
    rx_options options = *state->options;
    double radius = 0;
    options.pipeline.nthreads = options.pipeline.restore.nthreads = options.pipeline.measure.nthreads =
        state->nthreads;
    rx_known_free(&sky->before);
    rx_status status = rx_quality_radius(&options.check.quality, sky->field->tile, &radius, err);
    for (int r = 0; status == RX_OK && r < state->nruns; r++) {
        rx_result result;
        rx_qa_list list = {0};
        if (r > 0 && state->run[r] == state->run[r - 1])
            continue;
        status = rx_field_extract(&options.pipeline, state->run[r], sky->field, NULL, log, &result, err);
        if (status != RX_OK)
            return status;
        status = rx_quality_list(&options.check.quality, sky->field->tile, result.sources, &list, err);
        if (status == RX_OK && r == 0)
            status =
                rx_blankcheck_noise(sky->field, result.sources->segments, state->nthreads, &sky->noise, err);
        if (status == RX_OK)
            status = join_known(sky, &result, &list, radius, &sky->before, err);
        rx_qa_list_free(&list);
        rx_result_free(&result);
    }
    return status;
}

rx_status rx_photometry_prepare(rx_photometry_state *state, rx_log *log, rx_error *err)
{
    rx_status status = RX_OK;
    for (int s = 0; status == RX_OK && s < state->nskies; s++)
        if (state->sky[s].injected)
            status = prepare_sky(state, &state->sky[s], log, err);
    return status;
}

/* --- units --- */

static double searched(const rx_tile *tile)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    size_t good = 0;
    for (size_t i = 0; i < n; i++)
        good += (tile->mask[i] & RX_HIDE_PLAIN) == 0;
    return 1e-6 * (double)good;
}

static void add_star(rx_unit_row *r, const rx_qa_list *list, long found, double flux)
{
    if (found < 0) {
        rx_unit_row_add(r, NAN);
        rx_unit_row_add(r, NAN);
        rx_unit_row_add(r, NAN);
        rx_unit_row_add(r, 0);
        return;
    }
    const double error = list->flux_error[found];
    rx_unit_row_add(r, list->score[found]);
    rx_unit_row_add(r, list->flux[found] / flux);
    rx_unit_row_add(r, error > 0 ? (list->flux[found] - flux) / error : NAN);
    rx_unit_row_add(r, (list->flags[found] & (RX_FLAG_CROWDED | RX_FLAG_MERGED)) != 0);
}

/* What a run's restorer has detected, with the run's flux. Free with rx_qa_list_free(). */
static rx_status detections(const rx_photometry_state *state, int run, const rx_field *field,
                            const rx_result *result, rx_qa_list *dst, rx_error *err)
{
    rx_options options = *state->options;
    if (state->templates[run])
        options.check.quality.flux = RX_QUALITY_TEMPLATE;
    return rx_quality_list(&options.check.quality, field->tile, result->sources, dst, err);
}

/* blank: what was detected on the blank tile; n 0 where there is none. */
static rx_status judge(const rx_photometry_state *state, const rx_photometry_sky *sky,
                       const rx_photometry_tile *tile, const rx_qa_list *list, const rx_qa_list *blank,
                       rx_unit_row *r, rx_error *err)
{
    const rx_photometry_stars stars = {tile->n, tile->x, tile->y, tile->flux};
    const rx_known *known = sky->injected ? &sky->before : &tile->known;
    double radius = 0, nfalse = (double)blank->n;
    long *found = RX_NEW(long, (size_t)tile->n);
    unsigned char *is_false = RX_NEW(unsigned char, (size_t)list->n);
    rx_status status = rx_quality_radius(&state->options->check.quality, tile->field->tile, &radius, err);
    if (found == NULL || is_false == NULL)
        status = rx_error_memory(err, (size_t)tile->n * sizeof *found);
    if (status == RX_OK)
        status = rx_photometry_match(&stars, known, list->n, list->x, list->y, radius, found, is_false, err);
    if (status != RX_OK)
        goto exit;
    for (long i = 0; i < tile->n; i++)
        add_star(r, list, found[i], tile->flux);
    for (long i = 0; i < list->n; i++)
        nfalse += is_false[i];
    rx_unit_row_add(r, nfalse);
    for (long i = 0; i < list->n; i++) {
        if (is_false[i]) {
            rx_unit_row_add(r, list->score[i]);
            rx_unit_row_add(r, list->mag[i]);
        }
    }
    for (long i = 0; i < blank->n; i++) {
        rx_unit_row_add(r, blank->score[i]);
        rx_unit_row_add(r, blank->mag[i]);
    }
exit:
    free(found);
    free(is_false);
    return status;
}

/* One restorer, runs `first` and the ones after it that share it. blank NULL: there is none. */
static rx_status measure(const rx_photometry_state *state, const rx_photometry_sky *sky, int first,
                         const rx_photometry_tile *tile, const rx_field *blank, rx_unit_row *r, rx_error *err)
{
    const rx_restorer *kind = state->run[first];
    rx_result result = {0}, empty = {0};
    rx_status status =
        rx_field_extract(&state->options->pipeline, kind, tile->field, NULL, NULL, &result, err);
    if (status == RX_OK && blank != NULL)
        status = rx_field_extract(&state->options->pipeline, kind, blank, NULL, NULL, &empty, err);
    for (int k = first; status == RX_OK && k < state->nruns && state->run[k] == kind; k++) {
        rx_qa_list list = {0}, noise = {0};
        status = detections(state, k, tile->field, &result, &list, err);
        if (status == RX_OK && blank != NULL)
            status = detections(state, k, blank, &empty, &noise, err);
        if (status == RX_OK)
            status = judge(state, sky, tile, &list, &noise, r, err);
        rx_qa_list_free(&noise);
        rx_qa_list_free(&list);
    }
    rx_result_free(&empty);
    rx_result_free(&result);
    return status;
}

rx_status rx_photometry_unit(const rx_photometry_state *state, long unit, rx_unit_values *dst, rx_error *err)
{
    const long set = unit / state->ntiles;
    const rx_photometry_sky *sky = &state->sky[set / state->nmags];
    const uint64_t number = (uint64_t)(set % state->nmags) << 32 | (uint64_t)(unit % state->ntiles);
    rx_unit_row r = {.values = dst};
    rx_photometry_tile tile;
    rx_field *blank = NULL;
    rx_status status =
        rx_photometry_tile_make(state, sky, state->mags[set % state->nmags], number, &tile, err);
    if (status == RX_OK && sky->injected)
        status = rx_photometry_blank_make(state, sky, number, &blank, err);
    if (status != RX_OK) {
        rx_photometry_tile_free(&tile);
        return status;
    }
    rx_unit_row_add(&r, (double)tile.n);
    rx_unit_row_add(&r, searched(tile.field->tile));
    rx_unit_row_add(&r, tile.flux * sqrt(sky->power) / tile.field->plain->global_sigma);
    for (int k = 0; status == RX_OK && k < state->nruns; k++)
        if (k == 0 || state->run[k] != state->run[k - 1])
            status = measure(state, sky, k, &tile, blank, &r, err);
    rx_field_free(blank);
    rx_photometry_tile_free(&tile);
    return status == RX_OK ? rx_unit_row_status(&r, err) : status;
}
