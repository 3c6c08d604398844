/* Sources against the true ones: one tile through every run. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "check/quality.h"
#include "lab/lists.h"
#include "pipeline/pipeline.h"

static const double HALF = 0.5; /* of the FWHM: noise moves faint sources so far, and blends of two */

rx_status rx_lab_radius(const rx_lab *lab, const rx_lab_sky *sky, const rx_tile *tile, double *pixels,
                        rx_error *err)
{
    RX_TRY(rx_quality_radius(&lab->options->check.quality, tile, pixels, err));
    *pixels = fmax(*pixels, HALF * sky->fwhm);
    return RX_OK;
}

/* False detections of the run at work: those of a list with that outcome, NULL: all of it. */
static rx_status add_wrong(const rx_lab_search *s, const rx_qa_list *list, const unsigned char *outcome,
                           rx_error *err)
{
    const rx_lab_objects *o = &s->tile.objects;
    for (long k = 0; k < list->n; k++) {
        double *row, least = o->n > 0 ? HUGE_VAL : 0;
        if (outcome != NULL && outcome[k] != RX_IS_FALSE)
            continue;
        RX_TRY(rx_lab_rows_add(&s->table[s->lab->kind->wrong], 1, &row, err));
        for (long i = 0; s->scene == RX_SCENE_RINGS && i < o->n; i++)
            least = fmin(least, hypot(list->x[k] - o->list[i].x, list->y[k] - o->list[i].y));
        row[RX_WRONG_RUN] = s->run;
        row[RX_WRONG_SCORE] = list->score[k];
        row[RX_WRONG_WIDTH] = s->scene == RX_SCENE_MAGNITUDE ? list->mag[k]
                              : s->scene == RX_SCENE_RINGS   ? least / s->sky->fwhm
                                                             : 0;
    }
    return RX_OK;
}

/* One run whose sources are there; blank: what was found on the blank tile. */
static rx_status judge(rx_lab_search *s, const rx_options *options, const rx_sources *blank, rx_error *err)
{
    const rx_quality_params *par = &options->check.quality;
    rx_qa_list noise = {0};
    rx_status status = rx_quality_list(par, s->tile.field->tile, s->sources, &s->list, err);
    if (status == RX_OK)
        status = rx_lab_match(&s->tile.objects, &(rx_match_list){s->list.n, s->list.x, s->list.y, NULL},
                              s->radius, &s->matches, err);
    if (status == RX_OK) {
        s->lab->kind->found(s);
        if (s->scene != RX_SCENE_PAIRS)
            status = add_wrong(s, &s->list, s->matches.outcome, err);
    }
    if (status == RX_OK && blank != NULL)
        status = rx_quality_list(par, s->tile.blank->tile, blank, &noise, err);
    if (status == RX_OK && blank != NULL)
        status = add_wrong(s, &noise, NULL, err);
    rx_matches_free(&s->matches);
    rx_qa_list_free(&noise);
    rx_qa_list_free(&s->list);
    return status;
}

rx_status rx_lab_search_unit(const rx_lab *lab, const rx_lab_unit *unit, const rx_unit_values *done,
                             rx_lab_table *dst, rx_error *err)
{
    (void)done;
    rx_lab_search s = {
        .lab = lab, .sky = &lab->sky[unit->condition], .scene = lab->scene[unit->scene].id, .table = dst};
    RX_TRY(lab->kind->tile(lab, unit, &s.tile, err));
    rx_status status = rx_lab_radius(lab, s.sky, s.tile.field->tile, &s.radius, err);
    if (status == RX_OK)
        status = lab->kind->rows(&s, err);
    for (int first = 0; first < lab->nruns && status == RX_OK; first = s.run) {
        const rx_lab_run *run = &lab->run[first];
        const rx_options options = rx_lab_options(lab, s.sky, run);
        rx_result result = {0}, empty = {0};
        status = rx_field_extract(&options.pipeline, run->restorer, s.tile.field, NULL, NULL, &result, err);
        if (status == RX_OK && s.tile.blank != NULL)
            status =
                rx_field_extract(&options.pipeline, run->restorer, s.tile.blank, NULL, NULL, &empty, err);
        s.sources = result.sources;
        /* other fluxes of the same sources follow as runs of their own */
        for (s.run = first; status == RX_OK && s.run < lab->nruns; s.run++) {
            const rx_lab_run *next = &lab->run[s.run];
            const rx_options own = rx_lab_options(lab, s.sky, next);
            if (s.run > first && (next->restorer != run->restorer || next->matched || next->tuned))
                break;
            status = judge(&s, &own, empty.sources, err);
        }
        rx_result_free(&empty);
        rx_result_free(&result);
    }
    rx_lab_tile_free(&s.tile);
    return status;
}

rx_status rx_lab_prepare(rx_lab *lab, rx_log *log, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < lab->nskies * lab->nruns && status == RX_OK; i++) {
        const int r = i % lab->nruns;
        rx_lab_sky *sky = &lab->sky[i / lab->nruns];
        const rx_lab_run *run = &lab->run[r];
        rx_options options = rx_lab_options(lab, sky, run);
        rx_pipeline_params *par = &options.pipeline;
        rx_result result = {0};
        if (sky->field == NULL ||
            (r > 0 && run[-1].restorer == run->restorer && run[-1].templates != run->templates))
            continue; /* other fluxes of the same sources */
        par->nthreads = par->restore.nthreads = par->measure.nthreads = par->templates.par.nthreads =
            lab->nthreads;
        status = rx_field_extract(par, run->restorer, sky->field, NULL, log, &result, err);
        if (status == RX_OK)
            status = lab->kind->untouched(lab, sky, r, &result, err);
        rx_result_free(&result);
    }
    return status;
}
