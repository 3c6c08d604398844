/* Template photometry: guess -> fit together -> refine one by one -> fit together -> what the residual shows.
 */
#include "template/template.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "template/blends.h"
#include "template/canvas.h"
#include "template/evidence.h"
#include "template/joint.h"
#include "template/lens.h"
#include "template/refine.h"
#include "template/subjects.h"
#include "template/undersky.h"
#include "template/usual.h"

static const double SMALL = 1e-4; /* pixels: nobody moves for less */
enum { SHIFTS = 2 };              /* joint moves of the positions in groups after each fit */

typedef struct work {
    const rx_tphot_params *par;
    int substructure; /* of the restored pixels is asked for, and they are not the very ones that are fitted:
                         their noise would be taken for structure and fitted away */
    const rx_tphot_input *input;
    int nthreads;
    rx_canvas canvas;
    rx_lens *lenses; /* [nthreads] */
    int n;
    rx_subject *subjects;     /* [n] */
    rx_joint_member *members; /* [n] of the last fit */
    double *backgrounds;      /* [n] by group */
    rx_blends blends;
    double *covariances; /* of the last fit, [members][members] group after group; NULL: not asked for */
    size_t *place;       /* [groups] where a group begins there */
    rx_usual usual;      /* among clear sources */
    double sky;          /* taken off the level so far, mean */
} work;

rx_tphot_params rx_tphot_defaults(void)
{
    return (rx_tphot_params){.link = 0.01,
                             .group_limit = 40,
                             .background_sigma = 0.02,
                             .sky_cell = 128,
                             .psf_error = 0.01,
                             .non_negative = 0,
                             .rounds = 2,
                             .extended = 1,
                             .substructure = 1,
                             .star_penalty = 0,
                             .learn_odds = 1,
                             .nthreads = 1};
}

static rx_status check_input(const rx_tphot_input *input, rx_error *err)
{
    const rx_restored *restored = input->restored;
    const rx_sources *sources = input->sources;
    if (restored->width != input->width || restored->height != input->height ||
        sources->width != input->width || sources->height != input->height || sources->segments == NULL)
        return rx_error_set(err, RX_INPUT,
                            "the fitted image has %d x %d pixels and the restored one %d x %d; "
                            "templates need the same grid",
                            input->width, input->height, restored->width, restored->height);
    if (input->psf == NULL)
        return rx_error_set(err, RX_INPUT, "templates need the PSF of the image; give PSF_TYPE");
    if (input->shapes != NULL && input->shapes->nlisted != sources->n)
        return rx_error_set(err, RX_INPUT, "shapes of %d sources were given for a list of %d",
                            input->shapes->nlisted, sources->n);
    const rx_psf *psfs[2] = {input->psf, restored->psf};
    for (int i = 0; i < 2; i++)
        for (size_t k = 0;
             psfs[i] != NULL && k < (size_t)psfs[i]->nbasis * (size_t)psfs[i]->size * (size_t)psfs[i]->size;
             k++)
            if (!isfinite(psfs[i]->basis[k]))
                return rx_error_set(err, RX_INPUT,
                                    "the PSF has a pixel that is not a number; give another one");
    return RX_OK;
}

static rx_status open_work(work *w, rx_error *err)
{
    w->n = w->input->sources->n;
    w->subjects = RX_NEW(rx_subject, w->n);
    w->lenses = RX_NEW(rx_lens, w->nthreads);
    if (w->subjects == NULL || w->lenses == NULL)
        return rx_error_memory(err, (size_t)w->n * sizeof(rx_subject));
    rx_status status = rx_canvas_fill(w->input, w->nthreads, &w->canvas, err);
    w->canvas.psf_error = w->par->psf_error;
    for (int i = 0; i < w->nthreads && status == RX_OK; i++)
        status = rx_lens_open(w->input->psf, w->input->restored->psf, &w->lenses[i], err);
    rx_subjects_start(w->par, w->input, w->subjects);
    return status;
}

static void close_work(work *w)
{
    for (int i = 0; i < w->n && w->subjects != NULL; i++)
        free(w->subjects[i].footprint.values);
    for (int i = 0; i < w->nthreads && w->lenses != NULL; i++)
        rx_lens_clear(&w->lenses[i]);
    free(w->subjects);
    free(w->lenses);
    free(w->members);
    free(w->backgrounds);
    free(w->covariances);
    free(w->place);
    rx_blends_clear(&w->blends);
    rx_canvas_clear(&w->canvas);
}

static rx_status draw(work *w, rx_error *err)
{
    rx_layer *layers = RX_NEW(rx_layer, w->n);
    if (layers == NULL)
        return rx_error_memory(err, (size_t)w->n * sizeof *layers);
    for (int i = 0; i < w->n; i++)
        layers[i] = (rx_layer){&w->subjects[i].footprint, w->subjects[i].flux};
    rx_status status = rx_canvas_draw(&w->canvas, layers, w->n, w->nthreads, err);
    free(layers);
    return status;
}

static rx_refine_params refine_params(const work *w, int frozen, int substructure)
{
    return (rx_refine_params){.extended = w->par->extended,
                              .substructure = substructure,
                              .star_penalty = w->par->star_penalty,
                              .usual = &w->usual,
                              .frozen = frozen};
}

static rx_refine_view refine_view(const work *w)
{
    return (rx_refine_view){.canvas = &w->canvas,
                            .restored = w->input->restored,
                            .segments = w->input->sources->segments,
                            .fwhm = fmax(w->input->psf->fwhm, 1.0)};
}

/* Subjects from `first` on, each against the others as the model has them now; then all take their new shape
 * at once, so that no order matters. moved_only: those that shift() has moved. */
static rx_status refine(work *w, int first, int frozen, int moved_only, int substructure, rx_error *err)
{
    const rx_refine_params par = refine_params(w, frozen, substructure);
    const rx_refine_view view = refine_view(w);
    rx_subject *after = RX_NEW(rx_subject, w->n);
    rx_status failed = RX_OK;
    if (after == NULL)
        return rx_error_memory(err, (size_t)w->n * sizeof *after);
#pragma omp parallel for schedule(dynamic, 8) num_threads(w->nthreads)
    for (int i = first; i < w->n; i++) {
        rx_error own = RX_ERROR_NONE;
        if (moved_only && !w->subjects[i].moved)
            continue;
        rx_status status = rx_interrupt_pending() ? rx_interrupt_check(&own) : RX_OK;
        if (status == RX_OK)
            status =
                rx_refine(&par, &view, &w->lenses[omp_get_thread_num()], &w->subjects[i], &after[i], &own);
        if (status != RX_OK) {
#pragma omp critical(rx_tphot_failure)
            {
                failed = status;
                if (err != NULL)
                    *err = own;
            }
        }
    }
    for (int i = first; i < w->n; i++) {
        if (moved_only && !w->subjects[i].moved)
            continue;
        free(failed == RX_OK ? w->subjects[i].footprint.values : after[i].footprint.values);
        if (failed == RX_OK)
            w->subjects[i] = after[i];
    }
    free(after);
    return failed == RX_OK ? draw(w, err) : failed;
}

/* Room for the covariances of the present groups. */
static rx_status place_covariances(work *w, rx_error *err)
{
    size_t room = 0;
    free(w->covariances);
    free(w->place);
    w->covariances = NULL;
    w->place = RX_NEW(size_t, w->blends.ngroups);
    for (int g = 0; g < w->blends.ngroups && w->place != NULL; g++) {
        const size_t m = (size_t)(w->blends.start[g + 1] - w->blends.start[g]);
        w->place[g] = room;
        room += m * m;
    }
    w->covariances = w->place != NULL ? rx_alloc(room, sizeof(double)) : NULL;
    return w->covariances != NULL ? RX_OK : rx_error_memory(err, room * sizeof(double));
}

static rx_status regroup(work *w, rx_error *err)
{
    const rx_footprint **footprints = RX_NEW(const rx_footprint *, w->n);
    rx_joint_member *members = rx_regrow(w->members, (size_t)w->n + 1, sizeof *members);
    if (members != NULL)
        w->members = members;
    double *backgrounds = rx_regrow(w->backgrounds, (size_t)w->n + 1, sizeof *backgrounds);
    if (backgrounds != NULL)
        w->backgrounds = backgrounds;
    if (footprints == NULL || members == NULL || backgrounds == NULL) {
        free(footprints);
        return rx_error_memory(err, (size_t)w->n * sizeof *members);
    }
    for (int i = 0; i < w->n; i++)
        footprints[i] = &w->subjects[i].footprint;
    rx_blends_clear(&w->blends);
    rx_status status = rx_blends_find(footprints, w->n, w->canvas.width, w->canvas.height, w->par->link,
                                      w->par->group_limit, w->nthreads, &w->blends, err);
    free(footprints);
    return status == RX_OK && w->par->covariance ? place_covariances(w, err) : status;
}

/* One group: members gathered, fitted, put back; nthreads work on it. */
static rx_status fit_group(work *w, int group, int nthreads, rx_error *err)
{
    const int movable = w->input->shapes == NULL && w->par->rounds > 0;
    const double fwhm = fmax(w->input->psf->fwhm, 1.0);
    const rx_joint_params par = {w->par->background_sigma, w->par->non_negative};
    const int first = w->blends.start[group], m = w->blends.start[group + 1] - first;
    double *covariance = w->covariances != NULL ? w->covariances + w->place[group] : NULL;
    rx_joint_member *members = RX_NEW(rx_joint_member, m);
    if (members == NULL)
        return rx_error_memory(err, (size_t)m * sizeof *members);
    for (int i = 0; i < m; i++) {
        const rx_subject *s = &w->subjects[w->blends.member[first + i]];
        members[i] = (rx_joint_member){.footprint = &s->footprint,
                                       .before = s->flux,
                                       .shift_width = m > 1 && movable ? rx_refine_reach(fwhm) : 0,
                                       .shift_centre = {s->x0 - s->x, s->y0 - s->y}};
    }
    rx_status status =
        rx_joint_fit(&par, &w->canvas, m, members, nthreads, &w->backgrounds[group], covariance, err);
    for (int i = 0; i < m && status == RX_OK; i++)
        w->members[w->blends.member[first + i]] = members[i];
    free(members);
    return status;
}

static double found_flux(const rx_joint_member *member)
{
    return isfinite(member->flux) ? member->flux : 0;
}

/* Groups that links were cut from, one after the other, each against what the ones before have found (block
 * Gauss-Seidel). All at once against the model of before, as the others are fitted, would run away where
 * neighbours across many cuts take the same light. */
static rx_status fit_torn_groups(work *w, rx_error *err)
{
    rx_status status = RX_OK;
    for (int g = 0; g < w->blends.ngroups && status == RX_OK; g++) {
        if (!w->blends.torn[g])
            continue;
        status = rx_interrupt_pending() ? rx_interrupt_check(err) : fit_group(w, g, w->nthreads, err);
        for (int k = w->blends.start[g]; k < w->blends.start[g + 1] && status == RX_OK; k++) {
            rx_subject *s = &w->subjects[w->blends.member[k]];
            const double flux = found_flux(&w->members[w->blends.member[k]]);
            rx_canvas_add(&w->canvas, &s->footprint, flux - s->flux);
            s->flux = flux;
        }
    }
    return status;
}

/* Whole groups against the model of all others, then those with cut links, then the model anew. */
static rx_status fit_groups(work *w, rx_error *err)
{
    rx_status failed = RX_OK;
#pragma omp parallel for schedule(dynamic, 8) num_threads(w->nthreads)
    for (int g = 0; g < w->blends.ngroups; g++) {
        rx_error own = RX_ERROR_NONE;
        if (w->blends.torn[g])
            continue;
        rx_status status = rx_interrupt_pending() ? rx_interrupt_check(&own) : fit_group(w, g, 1, &own);
        if (status != RX_OK) {
#pragma omp critical(rx_tphot_failure)
            {
                failed = status;
                if (err != NULL)
                    *err = own;
            }
        }
    }
    for (int i = 0; i < w->n && failed == RX_OK; i++)
        if (!w->blends.torn[w->blends.group[i]])
            w->subjects[i].flux = found_flux(&w->members[i]);
    if (failed == RX_OK && w->blends.ntorn > 0) {
        failed = draw(w, err);
        if (failed == RX_OK)
            failed = fit_torn_groups(w, err);
    }
    return failed == RX_OK ? draw(w, err) : failed;
}

/* Positions in groups move to where the last joint fit wants them, at most half a PSF's width at once, and
 * templates follow. */
static rx_status shift(work *w, rx_error *err)
{
    const double most = 0.25 * fmax(w->input->psf->fwhm, 1.0);
    int moved = 0;
    for (int i = 0; i < w->n; i++) {
        const double *by = w->members[i].shift, length = hypot(by[0], by[1]);
        w->subjects[i].moved = length > SMALL && isfinite(length);
        if (!w->subjects[i].moved)
            continue;
        const double scale = length > most ? most / length : 1;
        w->subjects[i].x += scale * by[0];
        w->subjects[i].y += scale * by[1];
        moved = 1;
    }
    return moved ? refine(w, 0, 1, 1, w->substructure, err) : RX_OK;
}

static rx_status fit_all(work *w, rx_error *err)
{
    rx_status status = regroup(w, err);
    if (status == RX_OK)
        status = fit_groups(w, err);
    int cut = 0;
    for (int i = 0; i < w->n && status == RX_OK; i++)
        cut |= w->blends.cut[i];
    for (int i = 0; i < SHIFTS && status == RX_OK && w->blends.largest > 1; i++) {
        status = shift(w, err);
        if (status == RX_OK)
            status = fit_groups(w, err);
    }
    /* across cut links groups take turns: once more with what is known now */
    if (status == RX_OK && cut)
        status = fit_groups(w, err);
    return status;
}

/* The sky between the models, and all fluxes on it. */
static rx_status fit_on_sky(work *w, rx_error *err)
{
    double mean = 0;
    rx_status status = fit_all(w, err);
    if (status != RX_OK || w->par->sky_cell <= 0)
        return status;
    status = rx_undersky_subtract(&w->canvas, w->input->sources->segments, w->par->sky_cell, w->nthreads,
                                  &mean, err);
    w->sky += mean;
    return status == RX_OK ? fit_groups(w, err) : status;
}

static rx_status add_points(work *w, const double (*at)[2], int count, rx_error *err)
{
    if (count <= 0)
        return RX_OK;
    rx_subject *more = rx_regrow(w->subjects, (size_t)w->n + (size_t)count, sizeof *more);
    if (more == NULL)
        return rx_error_memory(err, ((size_t)w->n + (size_t)count) * sizeof *more);
    const int first = w->n;
    w->subjects = more;
    for (int i = 0; i < count; i++)
        w->subjects[w->n++] = rx_subject_extra(at[i][0], at[i][1]);
    return refine(w, first, 1, 0, 0, err);
}

/* Asks for what shows in the residual, and fits everything again with it. */
static rx_status second_pass(work *w, rx_error *err)
{
    const rx_canvas *c = &w->canvas;
    const rx_tphot_state state = {c->width, c->height, c->data, c->model, c->weight};
    double(*found)[2] = NULL;
    int count = 0;
    rx_status status = w->input->more(w->input->user, &state, &found, &count, err);
    if (status == RX_OK && count > 0) {
        status = add_points(w, (const double(*)[2])found, count, err);
        if (status == RX_OK)
            status = fit_on_sky(w, err);
        if (status == RX_OK && w->input->shapes == NULL && w->par->rounds > 0)
            status = refine(w, 0, 0, 0, w->substructure, err);
        if (status == RX_OK)
            status = fit_on_sky(w, err);
    }
    free(found);
    return status;
}

static rx_status learn_usual(work *w, rx_error *err)
{
    const int n = w->input->sources->n;
    rx_usual_case *cases = RX_NEW(rx_usual_case, n);
    if (cases == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *cases);
    for (int i = 0; i < n; i++) {
        const rx_subject *s = &w->subjects[i];
        cases[i] = (rx_usual_case){.flux = s->flux,
                                   .snr = s->flux / sqrt(w->members[i].variance),
                                   .evidence = s->evidence,
                                   .radius = s->size,
                                   .nu = s->slope};
    }
    rx_usual_learn(cases, n, w->par->star_penalty, fmax(w->input->psf->fwhm, 1.0), &w->usual);
    free(cases);
    return RX_OK;
}

static rx_status fit_everything(work *w, rx_error *err)
{
    rx_status status = refine(w, 0, 1, 0, 0, err);
    if (status == RX_OK)
        status = add_points(w, w->input->extra, w->input->nextra, err);
    if (status == RX_OK)
        status = fit_on_sky(w, err);
    const int frozen = w->input->shapes != NULL;
    /* frozen shapes still take up their restored pixels, once the fluxes are known */
    const int rounds = frozen ? w->substructure != 0 : w->par->rounds;
    for (int i = 0; i < rounds && status == RX_OK; i++) {
        status = refine(w, 0, frozen, 0, w->substructure, err);
        if (status == RX_OK)
            status = fit_on_sky(w, err);
        if (status == RX_OK && w->par->learn_odds && w->par->extended && !frozen)
            status = learn_usual(w, err);
    }
    if (status == RX_OK && w->input->more != NULL)
        status = second_pass(w, err);
    /* weights follow the photons of the model that has just been found */
    if (status == RX_OK && (w->canvas.gain > 0 || w->canvas.psf_error > 0))
        status = fit_on_sky(w, err);
    return status;
}

/* Evidence of every source; long groups are no one thread's. */
static rx_status weigh_evidence(work *w, rx_error *err)
{
    const rx_refine_params par = refine_params(w, 0, 0);
    const rx_refine_view view = refine_view(w);
    rx_status failed = RX_OK;
#pragma omp parallel for schedule(dynamic, 8) num_threads(w->nthreads)
    for (int k = 0; k < w->n; k++) {
        const int group = w->blends.group[w->blends.member[k]];
        const int first = w->blends.start[group], m = w->blends.start[group + 1] - first;
        const int *member = w->blends.member + first;
        rx_error own = RX_ERROR_NONE;
        rx_status status = rx_interrupt_pending() ? rx_interrupt_check(&own) : RX_OK;
        if (status == RX_OK)
            status = rx_evidence_of(&par, &view, &w->lenses[omp_get_thread_num()], w->subjects, w->members,
                                    member, m, k - first, &w->subjects[member[k - first]].presence, &own);
        if (status != RX_OK) {
#pragma omp critical(rx_tphot_failure)
            {
                failed = status;
                if (err != NULL)
                    *err = own;
            }
        }
    }
    return failed;
}

static rx_status store_pairs(const work *w, rx_tphot *dst, rx_error *err)
{
    size_t room = 0;
    for (int g = 0; g < w->blends.ngroups; g++) {
        const size_t m = (size_t)(w->blends.start[g + 1] - w->blends.start[g]);
        room += m * (m - 1) / 2;
    }
    dst->pairs = RX_NEW(rx_tphot_pair, room);
    if (dst->pairs == NULL)
        return rx_error_memory(err, room * sizeof *dst->pairs);
    for (int g = 0; g < w->blends.ngroups; g++) {
        const int *member = w->blends.member + w->blends.start[g];
        const double *covariance = w->covariances + w->place[g];
        const size_t m = (size_t)(w->blends.start[g + 1] - w->blends.start[g]);
        for (size_t i = 0; i < m; i++)
            for (size_t j = i + 1; j < m; j++)
                dst->pairs[dst->npairs++] =
                    (rx_tphot_pair){member[i], member[j],
                                    covariance[i * m + j] * w->subjects[member[i]].shape_error *
                                        w->subjects[member[j]].shape_error};
    }
    return RX_OK;
}

/* The pixels against all models; rows are added up in their order. */
static rx_status judge_tile(const work *w, rx_tphot *dst, rx_error *err)
{
    const rx_canvas *c = &w->canvas;
    double(*rows)[2] = rx_alloc((size_t)c->height, sizeof *rows);
    if (rows == NULL)
        return rx_error_memory(err, (size_t)c->height * sizeof *rows);
#pragma omp parallel for schedule(static) num_threads(w->nthreads)
    for (int y = 0; y < c->height; y++)
        for (size_t k = (size_t)y * (size_t)c->width; k < ((size_t)y + 1) * (size_t)c->width; k++) {
            if (!(c->weight[k] > 0))
                continue;
            const double sigma = (double)c->sigma[k], r = c->data[k] - c->model[k];
            const double photons = c->gain > 0.0 && c->model[k] > 0 ? (double)c->model[k] / c->gain : 0.0;
            rows[y][0] += r * r / (sigma * sigma + photons);
            rows[y][1]++;
        }
    for (int y = 0; y < c->height; y++) {
        dst->chi2 += rows[y][0];
        dst->visible += rows[y][1];
    }
    free(rows);
    return RX_OK;
}

/* Data become the residual in their place. */
static void keep_model(work *w, rx_tphot *dst)
{
    const size_t pixels = (size_t)w->canvas.width * (size_t)w->canvas.height;
#pragma omp parallel for schedule(static) num_threads(w->nthreads)
    for (size_t k = 0; k < pixels; k++)
        w->canvas.data[k] = w->canvas.weight[k] > 0 ? w->canvas.data[k] - w->canvas.model[k] : 0;
    dst->residual = w->canvas.data;
    dst->model = w->canvas.model;
    w->canvas.data = w->canvas.model = NULL;
}

static rx_status store(work *w, rx_tphot *dst, rx_error *err)
{
    dst->list = RX_NEW(rx_tphot_source, w->n);
    if (dst->list == NULL)
        return rx_error_memory(err, (size_t)w->n * sizeof *dst->list);
    dst->n = w->n;
    dst->nlisted = w->input->sources->n;
    dst->ngroups = w->blends.ngroups;
    dst->largest = w->blends.largest;
    dst->width = w->canvas.width;
    dst->height = w->canvas.height;
    dst->sky = w->sky;
    dst->star_odds = w->usual.star_odds;
#pragma omp parallel for schedule(dynamic, 64) num_threads(w->nthreads)
    for (int i = 0; i < w->n; i++) {
        rx_tphot_source *s = &dst->list[i];
        s->group = w->blends.group[i];
        s->blend = w->members[i].blend;
        s->flags = w->members[i].flags | (w->blends.cut[i] ? RX_TPHOT_GROUP_CUT : 0);
        rx_subject_tell(&w->canvas, w->input->sources->segments, &w->subjects[i], &w->members[i],
                        w->backgrounds[s->group], s);
        if ((s->flags & RX_TPHOT_NO_DATA) != 0)
            s->flux = s->fluxerr = s->snr = NAN;
    }
    rx_status status = w->par->covariance ? store_pairs(w, dst, err) : RX_OK;
    if (status == RX_OK)
        status = judge_tile(w, dst, err);
    if (status == RX_OK && w->par->keep_model)
        keep_model(w, dst);
    return status;
}

rx_status rx_tphot_run(const rx_tphot_params *par, const rx_tphot_input *input, rx_tphot **dst, rx_error *err)
{
    work w = {.par = par,
              .substructure = par->substructure && (input->restored->blur != NULL || input->shapes != NULL),
              .input = input,
              .nthreads = par->nthreads < 1 ? 1 : par->nthreads};
    *dst = NULL;
    rx_status status = check_input(input, err);
    if (status != RX_OK)
        return status;
    rx_tphot *tphot = RX_NEW(rx_tphot, 1);
    if (tphot == NULL)
        return rx_error_memory(err, sizeof *tphot);
    w.usual = rx_usual_start(fmax(input->psf->fwhm, 1.0));
    status = open_work(&w, err);
    if (status == RX_OK)
        status = fit_everything(&w, err);
    if (status == RX_OK)
        status = weigh_evidence(&w, err);
    if (status == RX_OK)
        status = store(&w, tphot, err);
    close_work(&w);
    if (status != RX_OK) {
        rx_tphot_free(tphot);
        return status;
    }
    *dst = tphot;
    return RX_OK;
}

void rx_tphot_free(rx_tphot *tphot)
{
    if (tphot == NULL)
        return;
    free(tphot->list);
    free(tphot->pairs);
    free(tphot->model);
    free(tphot->residual);
    free(tphot);
}
