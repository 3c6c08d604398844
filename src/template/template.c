/* Template photometry: guess -> fit together -> refine one by one -> fit together -> what the residual shows.
 */
#include "template/template.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "template/blends.h"
#include "template/crowd.h"
#include "template/evidence.h"
#include "template/fit_image.h"
#include "template/fit_sources.h"
#include "template/joint.h"
#include "template/models.h"
#include "template/patch.h"
#include "template/prior.h"
#include "template/refine.h"
#include "template/residual_sky.h"
#include "template/template_chi2.h"
#include "template/template_otf.h"
#include "template/tphot.h"
#include "template/two.h"
#include "template/unseen.h"
#include "template/windows.h"

static const double SMALL = 1e-4; /* pixels: no source moves for less */
static const double MOST = 2.0,
                    MOST_NOISE = 10.0; /* times light and noise of its pixels: no source is brighter */
static const double RUNAWAY =
    1e3;                  /* times the brightest light that is seen no star is, not even a saturated one */
enum { SHIFTS = 2 };      /* joint moves of the positions in groups after each fit */
enum { CROWD_CELL = 64 }; /* pixels: cells of sky and noise in a crowd */
/* FWHM: so far at least the neighbours of what comes and goes in a crowd are fitted again; passes before what has gone may not
 * come again; everything is fitted again every so many passes, for what is fitted does reach farther. */
static const double STIRRED = 4.0;
enum { TRIED = 4, WHOLE = 4 };

typedef struct work {
    const rx_tphot_params *par;
    int substructure; /* of the restored pixels is asked for, and they are not the very ones that are fitted:
                         their noise would be taken for structure and fitted away */
    const rx_tphot_input *input;
    int nthreads;
    int frozen; /* all positions and shapes are given, and stay */
    rx_fit_image image;
    rx_template_otf **otfs; /* [nthreads] */
    int n;
    rx_fit_source *sources;   /* [n] */
    rx_joint_member *members; /* [n] of the last fit */
    double *backgrounds;      /* [n] by group */
    rx_blends blends;
    int errors;               /* of fluxes are asked for in this fit */
    double *covariances;      /* of the last fit, [members][members] group after group; NULL: not asked for */
    size_t *place;            /* [groups] where a group begins there */
    rx_tile_prior tile_prior; /* among clear sources */
    double sky;               /* taken off the level so far, mean */
    double point_power;       /* sum P^2 of the PSF */
    rx_structure structure;   /* of the sky, as points see it; empty: not known yet */
    rx_crowding crowd;        /* known after the first fit */
    int passes, nadded;       /* so far */
    double (*dropped)[2];     /* [ndropped] where what was added did not hold */
    int ndropped;
} work;

static rx_status open_work(work *w, rx_error *err)
{
    w->n = w->input->sources->n;
    w->sources = RX_NEW(rx_fit_source, w->n);
    w->otfs = RX_NEW(rx_template_otf *, w->nthreads);
    if (w->sources == NULL || w->otfs == NULL)
        return rx_error_memory(err, (size_t)w->n * sizeof(rx_fit_source));
    rx_status status = RX_OK;
    rx_fit_image_open(w->input, w->par->shown, w->nthreads, &w->image);
    /* no noise: it counts as much against that of sums of pixels as it would where pixels are independent */
    w->image.psf_error = w->par->psf_error / rx_noise_factor_wide(w->input->image.correlation);
    for (int i = 0; i < w->nthreads && status == RX_OK; i++)
        status = rx_template_otf_new(w->input->image.psf, w->input->restored->psf, &w->otfs[i], err);
    rx_fit_sources_start(w->par, w->input, w->sources);
    w->frozen = w->input->shapes != NULL;
    for (int i = 0; i < w->n; i++)
        w->frozen &= !w->sources[i].movable;
    return status;
}

static void close_work(work *w)
{
    for (int i = 0; i < w->n && w->sources != NULL; i++)
        free(w->sources[i].footprint.values);
    for (int i = 0; i < w->nthreads && w->otfs != NULL; i++)
        rx_template_otf_free(w->otfs[i]);
    free(w->sources);
    free(w->otfs);
    free(w->members);
    free(w->backgrounds);
    free(w->covariances);
    free(w->place);
    free(w->dropped);
    rx_blends_clear(&w->blends);
    rx_crowding_clear(&w->crowd);
    rx_structure_clear(&w->structure);
    rx_fit_image_clear(&w->image);
}

/* The model is that of the sources as they are now. */
static rx_status draw(work *w, rx_error *err)
{
    rx_layer *layers = RX_NEW(rx_layer, w->n);
    if (layers == NULL)
        return rx_error_memory(err, (size_t)w->n * sizeof *layers);
    for (int i = 0; i < w->n; i++)
        layers[i] = (rx_layer){w->sources[i].footprint, w->sources[i].flux};
    rx_fit_image_set(&w->image, layers, w->n);
    return RX_OK;
}

static rx_refine_params refine_params(const work *w, int frozen, int substructure)
{
    return (rx_refine_params){.extended = w->par->extended,
                              .substructure = substructure,
                              .tile_prior = &w->tile_prior,
                              .frozen = frozen};
}

static rx_refine_view refine_view(const work *w)
{
    return (rx_refine_view){.image = &w->image,
                            .restored = w->input->restored,
                            .shape_mask = w->input->shape_mask,
                            .shape_bits = w->input->shape_bits,
                            .segments = w->input->sources->segments,
                            .crowd = &w->crowd,
                            .structure = w->structure.variance.nx > 0 ? &w->structure.variance : NULL,
                            .fwhm = fmax(w->input->image.psf->fwhm, 1.0)};
}

/* What all refinements of one round share. */
typedef struct refinement {
    work *w;
    rx_refine_params par;
    rx_refine_view view;
    int first, moved_only;
    rx_fit_source *after; /* [n] */
} refinement;

static int takes_part(const refinement *r, int i)
{
    const rx_fit_source *s = &r->w->sources[i];
    return i >= r->first && !s->still && (!r->moved_only || s->moved) && (r->par.frozen || s->movable);
}

static rx_status refine_one(void *user, int i, int thread, rx_error *err)
{
    const refinement *r = user;
    if (!takes_part(r, i))
        return RX_OK;
    return rx_refine(&r->par, &r->view, r->w->otfs[thread], &r->w->sources[i], &r->after[i], err);
}

static rx_status learn_prior(work *w, rx_error *err)
{
    const int n = w->input->sources->n;
    rx_prior_sample *cases = RX_NEW(rx_prior_sample, n);
    if (cases == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *cases);
    for (int i = 0; i < n; i++) {
        const rx_fit_source *s = &w->sources[i];
        cases[i] = (rx_prior_sample){.flux = s->as_point,
                                     .snr = s->as_point / s->point_error,
                                     .evidence = s->evidence,
                                     .agreement = s->agreement,
                                     .radius = s->size,
                                     .nu = s->slope};
    }
    const rx_status status =
        rx_tile_prior_fit(cases, n, fmax(w->input->image.psf->fwhm, 1.0), &w->tile_prior, err);
    free(cases);
    return status;
}

/* Sources from `first` on, each against the others as the model has them now; then all take their new shape
 * at once, so that no order matters. moved_only: those that shift() has moved. */
static rx_status refine(work *w, int first, int frozen, int moved_only, int substructure, rx_error *err)
{
    refinement r = {w,
                    refine_params(w, frozen, substructure),
                    refine_view(w),
                    first,
                    moved_only,
                    RX_NEW(rx_fit_source, w->n)};
    rx_window *windows = RX_NEW(rx_window, w->n);
    rx_status status = RX_OK;
    if (r.after == NULL || windows == NULL) {
        status = rx_error_memory(err, (size_t)w->n * sizeof *r.after);
        goto exit;
    }
    for (int i = 0; i < w->n; i++)
        if (takes_part(&r, i))
            windows[i] = rx_refine_window(&r.par, &r.view, w->otfs[0], &w->sources[i]);
    status = rx_windows_run(&w->image, windows, w->n, 0, refine_one, &r, err);
    for (int i = 0; i < w->n; i++) {
        if (!takes_part(&r, i))
            continue;
        free(status == RX_OK ? w->sources[i].footprint.values : r.after[i].footprint.values);
        if (status == RX_OK)
            w->sources[i] = r.after[i];
    }
exit:
    free(r.after);
    free(windows);
    if (status == RX_OK && w->par->extended && !frozen)
        status = learn_prior(w, err);
    return status == RX_OK ? draw(w, err) : status;
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
        footprints[i] = &w->sources[i].footprint;
    rx_blends_clear(&w->blends);
    rx_status status =
        rx_blends_find(w->par, footprints, w->n, w->image.width, w->image.height, &w->blends, err);
    free(footprints);
    return status == RX_OK && w->par->covariance ? place_covariances(w, err) : status;
}

/* Where the noise is next to nothing the faintest wings tie all groups together, and fits of all of them against the same model run
 * away. There no flux is above the light of the pixels that the template is on, and no point's peak above the light around it;
 * RX_TPHOT_SINGULAR where it would have been. */
static double within_light(const work *w, const rx_fit_source *s, double flux, int *flags)
{
    const rx_fit_image *c = &w->image;
    const rx_footprint *f = &s->footprint;
    double light = 0, share = 0, most = HUGE_VAL;
    if (!((double)c->floor > w->input->image.global_noise) || !isfinite(flux))
        return flux;
    for (int v = 0; v < f->height; v++)
        for (int u = 0; u < f->width; u++) {
            const size_t k = rx_fit_image_row(c, f->y0 + v) + (size_t)(f->x0 + u);
            const double t = f->values[(size_t)v * (size_t)f->width + (size_t)u],
                         own = fabs((double)c->data[k]) + MOST_NOISE * (double)c->sigma[k];
            if (!(c->weight[k] > 0))
                continue;
            light += own;
            share += t;
            if (s->kind == RX_TPHOT_POINT && hypot(f->x0 + u - s->x, f->y0 + v - s->y) < 1 && t > 0)
                most = fmin(most, MOST * own / t);
        }
    most = fmin(most, MOST * light / fmax(share, 0.01));
    if (fabs(flux) > most)
        *flags |= RX_TPHOT_SINGULAR;
    return fmin(fmax(flux, -most), most);
}

/* One group: members gathered, fitted, put back; nthreads work on it. */
static rx_status fit_group(work *w, int group, int nthreads, rx_error *err)
{
    const double fwhm = fmax(w->input->image.psf->fwhm, 1.0);
    const rx_joint_params par = {w->par->background_sigma, w->errors, nthreads};
    const int first = w->blends.start[group], m = w->blends.start[group + 1] - first;
    const int movable = m > 1 && w->par->rounds > 0;
    double *covariance = w->errors && w->covariances != NULL ? w->covariances + w->place[group] : NULL;
    rx_joint_member *members = RX_NEW(rx_joint_member, m);
    if (members == NULL)
        return rx_error_memory(err, (size_t)m * sizeof *members);
    for (int i = 0; i < m; i++) {
        const rx_fit_source *s = &w->sources[w->blends.member[first + i]];
        members[i] = (rx_joint_member){.footprint = &s->footprint,
                                       .before = s->flux,
                                       .grain = s->grain,
                                       .positive = s->positive,
                                       .shift_width = movable && s->movable ? rx_refine_reach(fwhm) : 0,
                                       .shift_centre = {s->x0 - s->x, s->y0 - s->y}};
    }
    rx_status status = rx_joint_fit(&par, &w->image, m, members, &w->backgrounds[group], covariance, err);
    for (int i = 0; i < m && status == RX_OK; i++) {
        const int k = w->blends.member[first + i];
        /* so far below 0 it would only take back what others have too much */
        w->sources[k].positive |= movable && w->sources[k].movable && w->errors &&
                                  members[i].flux < -w->par->least * sqrt(members[i].variance);
        members[i].flux = within_light(w, &w->sources[k], members[i].flux, &members[i].flags);
        w->members[k] = members[i];
    }
    free(members);
    return status;
}

/* Has nothing changed around any of its members? */
static int still(const work *w, int g)
{
    int still = 1;
    for (int k = w->blends.start[g]; k < w->blends.start[g + 1]; k++)
        still = still && w->sources[w->blends.member[k]].still;
    return still;
}

static double found_flux(const rx_joint_member *member)
{
    return isfinite(member->flux) ? member->flux : 0;
}

static rx_status fit_whole_group(void *user, int g, int thread, rx_error *err)
{
    work *w = user;
    (void)thread;
    return w->blends.divided[g] || still(w, g) ? RX_OK : fit_group(w, g, 1, err);
}

/* By all threads; what it finds is there for the next. */
static rx_status fit_divided_group(void *user, int g, int thread, rx_error *err)
{
    work *w = user;
    (void)thread;
    if (!w->blends.divided[g] || still(w, g))
        return RX_OK;
    rx_status status = fit_group(w, g, w->nthreads, err);
    for (int k = w->blends.start[g]; k < w->blends.start[g + 1] && status == RX_OK; k++) {
        rx_fit_source *s = &w->sources[w->blends.member[k]];
        const double flux = found_flux(&w->members[w->blends.member[k]]);
        status = rx_fit_image_add(&w->image, &s->footprint, flux - s->flux, err);
        s->flux = flux;
    }
    return status;
}

/* The footprints of the groups with cut links (divided = 1) or without. */
static void group_windows(const work *w, int divided, rx_window *windows)
{
    for (int g = 0; g < w->blends.ngroups; g++) {
        rx_window *all = &windows[g];
        *all = (rx_window){w->image.width, w->image.height, 0, 0};
        for (int k = w->blends.start[g]; k < w->blends.start[g + 1] && w->blends.divided[g] == divided; k++) {
            const rx_window one = rx_footprint_window(&w->sources[w->blends.member[k]].footprint);
            if (one.x1 <= one.x0)
                continue;
            *all = (rx_window){one.x0 < all->x0 ? one.x0 : all->x0, one.y0 < all->y0 ? one.y0 : all->y0,
                               one.x1 > all->x1 ? one.x1 : all->x1, one.y1 > all->y1 ? one.y1 : all->y1};
        }
    }
}

/* Groups that links were cut from, one after the other, each against what the ones before have found (block
 * Gauss-Seidel). All at once against the model of before, as the others are fitted, would run away where
 * neighbours across many cuts take the same light. */
static rx_status fit_divided_groups(work *w, rx_window *windows, rx_error *err)
{
    rx_status status = draw(w, err);
    group_windows(w, 1, windows);
    if (status == RX_OK)
        status = rx_windows_run(&w->image, windows, w->blends.ngroups, 1, fit_divided_group, w, err);
    return status;
}

/* Whole groups against the model of all others, then those with cut links, then the model anew. */
static rx_status fit_groups(work *w, int errors, rx_error *err)
{
    w->errors = errors;
    rx_window *windows = RX_NEW(rx_window, w->blends.ngroups);
    if (windows == NULL)
        return rx_error_memory(err, (size_t)w->blends.ngroups * sizeof *windows);
    group_windows(w, 0, windows);
    rx_status status = rx_windows_run(&w->image, windows, w->blends.ngroups, 0, fit_whole_group, w, err);
    for (int i = 0; i < w->n && status == RX_OK; i++)
        if (!w->blends.divided[w->blends.group[i]])
            w->sources[i].flux = found_flux(&w->members[i]);
    if (status == RX_OK && w->blends.ndivided > 0)
        status = fit_divided_groups(w, windows, err);
    free(windows);
    return status == RX_OK ? draw(w, err) : status;
}

/* Positions in groups move to where the last joint fit wants them, at most half a PSF's width at once, and
 * templates follow. */
static rx_status shift(work *w, rx_error *err)
{
    const double most = 0.25 * fmax(w->input->image.psf->fwhm, 1.0);
    int moved = 0;
    for (int i = 0; i < w->n; i++) {
        const double *by = w->members[i].shift, length = hypot(by[0], by[1]);
        w->sources[i].moved = !w->sources[i].still && length > SMALL && isfinite(length);
        if (!w->sources[i].moved)
            continue;
        const double scale = length > most ? most / length : 1;
        w->sources[i].x += scale * by[0];
        w->sources[i].y += scale * by[1];
        moved = 1;
    }
    return moved ? refine(w, 0, 1, 1, w->substructure, err) : RX_OK;
}

/* Fluxes and positions in turn, then the sky between the models, in a crowd that of all pixels and its noise, and all fluxes on it. */
static rx_status fit_on_sky(work *w, rx_error *err)
{
    const rx_residual_sky between = {.segments = w->input->sources->segments, .cell = w->par->sky_cell};
    const rx_residual_sky crowd = {.crowd = &w->crowd, .cell = CROWD_CELL};
    double mean = 0;
    RX_TRY(regroup(w, err));
    RX_TRY(fit_groups(w, 0, err));
    for (int i = 0; i < SHIFTS && w->blends.largest > 1; i++) {
        RX_TRY(shift(w, err));
        RX_TRY(fit_groups(w, 0, err));
    }
    if (w->blends.ndivided > 0) /* across cut links groups take turns: once more with what is known now */
        RX_TRY(fit_groups(w, 0, err));
    if (w->par->sky_cell > 0) {
        RX_TRY(rx_residual_sky_subtract(&w->image, &between, &mean, err));
        w->sky += mean;
        if (w->crowd.n > 0) {
            RX_TRY(rx_residual_sky_subtract(&w->image, &crowd, &mean, err));
            RX_TRY(rx_residual_sky_rescale(&w->image, &crowd, err));
            w->sky += mean;
        }
    }
    return fit_groups(w, 1, err);
}

static rx_status add_points(work *w, const double (*at)[2], int count, rx_error *err)
{
    if (count <= 0)
        return RX_OK;
    rx_fit_source *more = rx_regrow(w->sources, (size_t)w->n + (size_t)count, sizeof *more);
    if (more == NULL)
        return rx_error_memory(err, ((size_t)w->n + (size_t)count) * sizeof *more);
    const int first = w->n;
    w->sources = more;
    for (int i = 0; i < count; i++) {
        w->sources[w->n] = rx_fit_source_added(at[i][0], at[i][1], w->nadded++);
        w->sources[w->n++].movable = !w->frozen;
    }
    return refine(w, first, 1, 0, 0, err);
}

static int in_crowd(const work *w, const rx_fit_source *s)
{
    return rx_crowding_at(&w->crowd, (int)floor(s->x + 0.5), (int)floor(s->y + 0.5));
}

/* What was added in a crowd and does not hold goes again, and is not looked for there any more: *dropped of them. */
static rx_status drop_weak(work *w, int *dropped, rx_error *err)
{
    int n = 0;
    double(*list)[2] = rx_regrow(w->dropped, (size_t)w->ndropped + (size_t)w->n, sizeof *list);
    if (list == NULL)
        return rx_error_memory(err, (size_t)w->n * sizeof *list);
    w->dropped = list;
    for (int i = 0; i < w->n; i++) {
        const rx_fit_source *s = &w->sources[i];
        const rx_joint_member *m = &w->members[i];
        const int weak = s->added >= 0 && in_crowd(w, s) && !(m->flux > w->par->least * sqrt(m->variance));
        if (weak) {
            list[w->ndropped][0] = s->x;
            list[w->ndropped++][1] = s->y;
            free(s->footprint.values);
            continue;
        }
        w->members[n] = *m;
        w->sources[n++] = *s;
    }
    *dropped = w->n - n;
    w->n = n;
    return *dropped > 0 ? draw(w, err) : RX_OK;
}

/* [n + ndropped][2] where the sources are and what is gone was; NULL without memory. */
static double (*positions(const work *w))[2]
{
    double(*at)[2] = rx_alloc((size_t)w->n + (size_t)w->ndropped, sizeof *at);
    for (int i = 0; i < w->n && at != NULL; i++) {
        at[i][0] = w->sources[i].x;
        at[i][1] = w->sources[i].y;
    }
    if (at != NULL && w->ndropped > 0)
        memcpy(at + w->n, w->dropped, (size_t)w->ndropped * sizeof *at);
    return at;
}

/* What two points describe becomes the brighter one; the others, seconds[*count][2], are to be added. */
static void split(work *w, double (*seconds)[2], int *count)
{
    for (int i = 0; i < w->n; i++) {
        rx_fit_source *s = &w->sources[i];
        s->moved = s->paired && !in_crowd(w, s);
        s->paired = 0;
        if (!s->moved)
            continue;
        s->kind = RX_TPHOT_POINT;
        s->point = s->star = s->lift = 1;
        s->profile = (rx_spergel){.nu = s->profile.nu};
        s->flux = s->pair[0][0];
        s->x = s->x0 = s->pair[0][1];
        s->y = s->y0 = s->pair[0][2];
        seconds[*count][0] = s->pair[1][1];
        seconds[(*count)++][1] = s->pair[1][2];
    }
}

/* Adds what shows in the residual, and the second points of pairs: *count points, *seen of them in the residual. */
static rx_status look(work *w, int *count, int *seen, rx_error *err)
{
    double(*found)[2] = NULL, (*at)[2] = positions(w),
    (*seconds)[2] = rx_alloc((size_t)w->n, sizeof *seconds);
    int nseconds = 0;
    rx_status status = RX_OK;
    if (at == NULL || seconds == NULL) {
        status = rx_error_memory(err, 2 * (size_t)w->n * sizeof *at);
        goto exit;
    }
    if (w->par->crowding != RX_CROWDING_NO)
        split(w, seconds, &nseconds);
    /* what did not hold in the first passes may once its surroundings are right */
    const int n = w->passes <= TRIED ? w->n : w->n + w->ndropped;
    const rx_tphot_search view = {
        &w->image, &w->crowd, w->passes - 1, (const double(*)[2])at, n, (const double(*)[2])seconds,
        nseconds};
    RX_TRY_EXIT(w->input->more(w->input->user, &view, &found, count, err));
    *seen = *count - nseconds;
    if (nseconds > 0)
        RX_TRY_EXIT(refine(w, 0, 1, 1, 0, err));
    RX_TRY_EXIT(add_points(w, (const double(*)[2])found, *count, err));
exit:
    free(found);
    free(at);
    free(seconds);
    return status;
}

/* Cells of the image by whether something has come or gone in them or beside them. */
typedef struct stirred {
    double cell; /* pixels */
    int nx, ny;
    uint8_t *near;
} stirred;

static int along(double position, const stirred *of, int n)
{
    return rx_min_int(rx_max_int((int)(position / of->cell), 0), n - 1);
}

static void mark(const stirred *of, double x, double y)
{
    const int cx = along(x, of, of->nx), cy = along(y, of, of->ny);
    for (int v = rx_max_int(cy - 1, 0); v <= rx_min_int(cy + 1, of->ny - 1); v++)
        for (int u = rx_max_int(cx - 1, 0); u <= rx_min_int(cx + 1, of->nx - 1); u++)
            of->near[v * of->nx + u] = 1;
}

/* Only what is near the last `added` sources and the last `dropped` that are gone is fitted from now on. */
static rx_status settle(work *w, int added, int dropped, rx_error *err)
{
    stirred of = {.cell = STIRRED * fmax(w->input->image.psf->fwhm, 1.0)};
    of.nx = (int)(w->image.width / of.cell) + 1;
    of.ny = (int)(w->image.height / of.cell) + 1;
    of.near = RX_NEW(uint8_t, (size_t)of.nx * (size_t)of.ny);
    if (of.near == NULL)
        return rx_error_memory(err, (size_t)of.nx * (size_t)of.ny);
    for (int i = w->n - added; i < w->n; i++)
        mark(&of, w->sources[i].x, w->sources[i].y);
    for (int i = w->ndropped - dropped; i < w->ndropped; i++)
        mark(&of, w->dropped[i][0], w->dropped[i][1]);
    for (int i = 0; i < w->n; i++)
        w->sources[i].still =
            !of.near[along(w->sources[i].y, &of, of.ny) * of.nx + along(w->sources[i].x, &of, of.nx)];
    free(of.near);
    return RX_OK;
}

/* Everything is fitted from now on. */
static void unsettle(work *w)
{
    for (int i = 0; i < w->n; i++)
        w->sources[i].still = 0;
}

static int movable(const work *w)
{
    return !w->frozen && w->par->rounds > 0;
}

/* Where it is not crowded one look at the residual and a fit of everything with what it shows; else until nothing is found, most
 * times of what is near that. */
static rx_status look_again(work *w, rx_error *err)
{
    int count = 0, seen = 0, dropped = 0;
    do {
        RX_TRY(rx_interrupt_check(err));
        RX_TRY(look(w, &count, &seen, err));
        if (count == 0)
            break;
        unsettle(w);
        if (seen == 0 || (w->passes > 1 && w->passes % WHOLE != 0))
            RX_TRY(settle(w, count, dropped, err));
        w->passes++;
        for (int i = 0; i < w->n; i++)
            if (in_crowd(w, &w->sources[i])) { /* what was two sources is elsewhere now */
                w->sources[i].x0 = w->sources[i].x;
                w->sources[i].y0 = w->sources[i].y;
            }
        if (w->crowd.n == 0) {
            RX_TRY(fit_on_sky(w, err));
        } else if (
            movable(w)) { /* in a crowd's passes fluxes that are roughly right do for positions and shapes */
            RX_TRY(regroup(w, err));
            RX_TRY(fit_groups(w, 0, err));
        }
        if (movable(w))
            RX_TRY(refine(w, 0, 0, 0, w->substructure, err));
        RX_TRY(fit_on_sky(w, err));
        RX_TRY(drop_weak(w, &dropped, err));
    } while (w->crowd.n > 0 && w->passes < w->par->passes && dropped < count);
    unsettle(w);
    return RX_OK;
}

static void describe_crowd(const work *w, rx_crowd_source *sources)
{
    const rx_sources *listed = w->input->sources;
    for (int i = 0; i < w->n; i++) {
        const rx_fit_source *s = &w->sources[i];
        const int clear = rx_prior_is_clear(s->flux / sqrt(w->members[i].variance));
        sources[i] = (rx_crowd_source){
            s->x, s->y, clear ? s->star : -1, {s->point * s->flux, (1 - s->point) * s->flux}, 0};
        if (i < listed->n && (listed->list[i].fit.restore & RX_RESTORE_SHARP) != 0)
            sources[i] = (rx_crowd_source){s->x, s->y, -1, {0}, 1};
    }
}

/* spare: what has been found is none where it shows extended sources. */
static rx_status find_crowd(work *w, int spare, rx_error *err)
{
    rx_crowd_source *sources = RX_NEW(rx_crowd_source, w->n);
    rx_status status = RX_OK;
    if (sources == NULL)
        return rx_error_memory(err, (size_t)w->n * sizeof *sources);
    describe_crowd(w, sources);
    if (spare) {
        status = rx_crowding_spare(sources, w->n, &w->crowd, err);
    } else {
        rx_crowding_clear(&w->crowd);
        status = rx_crowding_find(&w->image, sources, w->n, fmax(w->input->image.psf->fwhm, 1.0),
                                  w->par->crowding, &w->crowd, err);
    }
    free(sources);
    return status;
}

/* What structure the sky has now is followed as far as it can be. Not in crowds: there it is stars that no model has yet. */
static rx_status follow_structure(work *w, rx_error *err)
{
    const int everywhere = w->crowd.n == w->crowd.nx * w->crowd.ny;
    if (w->par->sky_cell <= 0 || (everywhere && w->structure.level.nx == 0))
        return RX_OK;
    RX_TRY(rx_residual_sky_structure(&w->image, w->input->image.psf, &w->crowd, &w->structure,
                                     &w->point_power, err));
    return fit_groups(w, 1, err);
}

/* In a crowd shapes of before are of no use: pairs are no profiles there, and neighbours are to come. */
static rx_status fit_everything(work *w, rx_error *err)
{
    const int frozen = w->frozen;
    /* frozen shapes still take up their restored pixels, once the fluxes are known */
    const int rounds = frozen ? w->substructure != 0 : w->par->rounds;
    RX_TRY(refine(w, 0, 1, 0, 0, err));
    RX_TRY(add_points(w, w->input->extra, w->input->nextra, err));
    RX_TRY(fit_on_sky(w, err));
    for (int i = 0; i < rounds && w->crowd.n == 0; i++) {
        RX_TRY(refine(w, 0, frozen, 0, w->substructure, err));
        RX_TRY(fit_on_sky(w, err));
        RX_TRY(find_crowd(w, 0, err));
    }
    if (rounds == 0)
        RX_TRY(find_crowd(w, 0, err));
    else
        RX_TRY(follow_structure(w, err));
    w->passes = 1;
    if (movable(w))
        RX_TRY(refine(w, 0, 0, 0, w->substructure, err));
    if (w->crowd.n > 0 && w->par->crowding == RX_CROWDING_AUTO)
        RX_TRY(find_crowd(w, 1, err));
    if (w->crowd.n > 0 || movable(w))
        RX_TRY(fit_on_sky(w, err));
    if (w->input->more != NULL && w->par->passes > 1)
        RX_TRY(look_again(w, err));
    /* weights follow the photons of the model that has just been found, and in a crowd some have gone */
    if (w->image.gain > 0 || w->image.psf_error > 0 || w->crowd.n > 0)
        RX_TRY(fit_on_sky(w, err));
    return follow_structure(w, err);
}

/* What all sources are weighed with. */
typedef struct weighing {
    work *w;
    rx_refine_params par;
    rx_refine_view view;
    rx_fit_neighbour *rivals; /* [n] */
    rx_two_counts counts;
} weighing;

/* Variance that the structure of the sky adds to its flux. What it does to a level counts by the width of a template, squared,
 * which is 1 / sum T^2. */
static double structure_of(const work *w, const rx_fit_source *s)
{
    const double power = rx_footprint_product(&s->footprint, &s->footprint, NULL);
    const int x = rx_min_int(rx_max_int((int)lround(s->x), 0), w->image.width - 1),
              y = rx_min_int(rx_max_int((int)lround(s->y), 0), w->image.height - 1);
    if (!(power > 0) || w->structure.variance.nx == 0)
        return 0;
    const double noise = (double)rx_fit_image_variance(&w->image, x, y) * s->grain * s->grain / power;
    return rx_sky_mesh_at(&w->structure.variance, x, y) * noise * fmax(w->point_power / power, 1);
}

static rx_status weigh_one(void *user, int i, int thread, rx_error *err)
{
    const weighing *g = user;
    work *w = g->w;
    rx_fit_source *s = &w->sources[i];
    s->structure = structure_of(w, s);
    RX_TRY(rx_evidence_of(&g->par, &g->view, w->otfs[thread], w->sources, &g->rivals[i], &s->presence, err));
    return w->input->shapes != NULL ? RX_OK
                                    : rx_two_odds(&g->par, &g->view, w->otfs[thread], &g->counts, s, err);
}

static rx_status count_sources(weighing *g, rx_error *err)
{
    const work *w = g->w;
    double *flux, *error;
    RX_TRY(RX_MAKE(flux, 2 * (size_t)w->n, err));
    error = flux + w->n;
    for (int i = 0; i < w->n; i++) {
        flux[i] = w->members[i].flux;
        error[i] = sqrt(w->members[i].variance);
    }
    const rx_status status = rx_two_counts_make(
        flux, error, w->n, (double)w->image.width * (double)w->image.height, &g->counts, err);
    free(flux);
    return status;
}

static rx_window around(rx_window a, rx_window b)
{
    if (a.x1 <= a.x0 || a.y1 <= a.y0 || b.x1 <= b.x0 || b.y1 <= b.y0)
        return a.x1 <= a.x0 || a.y1 <= a.y0 ? b : a;
    return (rx_window){rx_min_int(a.x0, b.x0), rx_min_int(a.y0, b.y0), rx_max_int(a.x1, b.x1),
                       rx_max_int(a.y1, b.y1)};
}

/* Evidence of every source; long groups are no one thread's. */
static rx_status weigh_evidence(work *w, rx_error *err)
{
    weighing g = {.w = w,
                  .par = refine_params(w, 0, 0),
                  .view = refine_view(w),
                  .rivals = RX_NEW(rx_fit_neighbour, w->n)};
    rx_window *windows = RX_NEW(rx_window, w->n);
    rx_status status = RX_OK;
    if (g.rivals == NULL || windows == NULL) {
        status = rx_error_memory(err, (size_t)w->n * (sizeof *g.rivals + sizeof *windows));
        goto exit;
    }
    RX_TRY_EXIT(count_sources(&g, err));
#pragma omp parallel for schedule(dynamic, 8) num_threads(w->nthreads)
    for (int k = 0; k < w->n; k++) {
        const int group = w->blends.group[w->blends.member[k]], i = w->blends.member[k];
        const int first = w->blends.start[group], m = w->blends.start[group + 1] - first;
        g.rivals[i] = rx_evidence_neighbour(w->sources, w->members, w->blends.member + first, m, k - first);
        windows[i] =
            around(rx_footprint_window(&w->sources[i].footprint), rx_two_window(&g.view, &w->sources[i]));
        if (g.rivals[i].other >= 0)
            windows[i] = around(
                windows[i], rx_refine_alone_window(&g.view, &w->sources[g.rivals[i].other], &w->sources[i]));
    }
    status = rx_windows_run(&w->image, windows, w->n, 0, weigh_one, &g, err);
exit:
    rx_two_counts_clear(&g.counts);
    free(g.rivals);
    free(windows);
    return status;
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
                                    covariance[i * m + j] * w->sources[member[i]].shape_error *
                                        w->sources[member[j]].shape_error};
    }
    return RX_OK;
}

static const double ISOLATED_SNR = 20.0;

typedef struct bright {
    double x, y, flux;
    int i;
} bright;

static int by_flux(const void *one, const void *other)
{
    const bright *a = one, *b = other;
    return a->flux != b->flux ? (a->flux < b->flux) - (a->flux > b->flux) : (a->i > b->i) - (a->i < b->i);
}

/* The model without points that have no brighter one within par->isolate: these stand on their own in pixels - model. *modelled: how
 * many remain in it. */
static rx_status isolate(work *w, int *modelled, rx_error *err)
{
    const double cell = w->par->isolate;
    const int nx = (int)(w->image.width / cell) + 1, ny = (int)(w->image.height / cell) + 1;
    bright *list = RX_NEW(bright, w->n);
    int *last = RX_NEW(int, (size_t)nx *(size_t)ny), *next = RX_NEW(int, w->n), n = 0;
    rx_layer *layers = RX_NEW(rx_layer, w->n);
    if (list == NULL || last == NULL || next == NULL || layers == NULL) {
        free(list);
        free(last);
        free(next);
        free(layers);
        return rx_error_memory(err, (size_t)w->n * sizeof *list);
    }
    for (int i = 0; i < w->n; i++) {
        const rx_fit_source *s = &w->sources[i];
        layers[i] = (rx_layer){s->footprint, s->flux};
        if (s->flux > ISOLATED_SNR * sqrt(w->members[i].variance))
            list[n++] = (bright){s->x, s->y, s->flux, i};
    }
    qsort(list, (size_t)n, sizeof *list, by_flux);
    for (int k = 0; k < n; k++) { /* the brightest first, each against those before it; lists end with 0 */
        const int cx = rx_min_int(rx_max_int((int)(list[k].x / cell), 0), nx - 1),
                  cy = rx_min_int(rx_max_int((int)(list[k].y / cell), 0), ny - 1);
        int alone = w->sources[list[k].i].kind == RX_TPHOT_POINT;
        for (int v = rx_max_int(cy - 1, 0); v <= rx_min_int(cy + 1, ny - 1); v++)
            for (int u = rx_max_int(cx - 1, 0); u <= rx_min_int(cx + 1, nx - 1); u++)
                for (int j = last[v * nx + u]; j > 0 && alone; j = next[j - 1])
                    alone = hypot(list[j - 1].x - list[k].x, list[j - 1].y - list[k].y) > cell;
        next[k] = last[cy * nx + cx];
        last[cy * nx + cx] = k + 1;
        if (alone)
            layers[list[k].i].flux = 0;
        *modelled -= alone;
    }
    rx_fit_image_set(&w->image, layers, w->n);
    free(list);
    free(last);
    free(next);
    return RX_OK;
}

typedef struct storing {
    work *w;
    rx_tphot *dst;
} storing;

static rx_status store_one(void *user, int i, int thread, rx_error *err)
{
    const storing *t = user;
    const work *w = t->w;
    rx_tphot_source *s = &t->dst->list[i];
    (void)thread;
    (void)err;
    rx_source_without_fits(&s->point_fit, &s->sersic_fit);
    s->group = w->blends.group[i];
    s->added = w->sources[i].added;
    s->crowded = in_crowd(w, &w->sources[i]);
    s->blend = w->members[i].blend;
    s->flags = w->members[i].flags | (w->blends.cut[i] ? RX_TPHOT_GROUP_CUT : 0);
    rx_fit_source_result(&w->image, w->input->sources->segments, &w->sources[i], &w->members[i],
                         w->backgrounds[s->group], s);
    /* light that the PSF has in the wrong place weighs more where less of the light is seen; where the core is hidden
     * (saturated stars) the flux is extrapolated from wings, and as wrong as these fit badly */
    const double seen = fmax(s->inside - s->masked, 1e-3);
    const rx_psf *psf = w->input->image.psf;
    s->fluxerr = hypot(s->fluxerr, rx_psf_flux_error(psf, w->sources[i].x, w->sources[i].y) * s->flux / seen);
    if ((s->flags & RX_TPHOT_MASKED) != 0)
        s->fluxerr *= sqrt(fmax(s->chi2, 1.0));
    if (rx_footprint_peak(&w->sources[i].footprint) * fabs(s->flux) > RUNAWAY * (double)w->image.brightest)
        s->flags |= RX_TPHOT_SINGULAR;
    if ((s->flags & RX_TPHOT_NO_DATA) != 0)
        s->flux = s->fluxerr = s->snr = NAN;
    return RX_OK;
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
    dst->width = w->image.width;
    dst->height = w->image.height;
    dst->sky = w->sky;
    dst->crowded = (double)w->crowd.n / rx_max_int(w->crowd.seen, 1);
    dst->galaxies = rx_crowding_galaxies(&w->crowd);
    dst->passes = w->passes;
    dst->modelled = w->n;
    dst->least = (double)w->image.floor;
    dst->star_odds = exp(w->tile_prior.odds[0]);
    rx_window *windows = RX_NEW(rx_window, w->n);
    if (windows == NULL)
        return rx_error_memory(err, (size_t)w->n * sizeof *windows);
    for (int i = 0; i < w->n; i++)
        windows[i] = rx_footprint_window(&w->sources[i].footprint);
    rx_status status = rx_windows_run(&w->image, windows, w->n, 0, store_one, &(storing){w, dst}, err);
    free(windows);
    if (status == RX_OK)
        status = rx_unseen_allow(&w->crowd, fmax(w->input->image.psf->fwhm, 1.0), dst->list, dst->n,
                                 &dst->unseen, err);
    if (status == RX_OK && w->par->point_fits)
        status = rx_models_fit(&(rx_models_view){&w->image, w->otfs, w->n, w->sources, w->members},
                               w->par->sersic_fits, dst->list, err);
    if (status == RX_OK && w->par->covariance)
        status = store_pairs(w, dst, err);
    if (status == RX_OK && w->par->isolate > 0)
        status = isolate(w, &dst->modelled, err);
    return status == RX_OK ? rx_template_chi2(&w->image, w->par->keep_model, dst, err) : status;
}

rx_status rx_tphot_run(const rx_tphot_params *par, const rx_tphot_input *input, rx_tphot **dst, rx_error *err)
{
    work w = {.par = par,
              .substructure = par->substructure && (input->restored->blur != NULL || input->shapes != NULL),
              .input = input,
              .nthreads = par->nthreads < 1 ? 1 : par->nthreads};
    *dst = NULL;
    rx_status status = rx_tphot_check(input, err);
    if (status != RX_OK)
        return status;
    rx_tphot *tphot = RX_NEW(rx_tphot, 1);
    if (tphot == NULL)
        return rx_error_memory(err, sizeof *tphot);
    w.tile_prior = rx_tile_prior_start(fmax(input->image.psf->fwhm, 1.0));
    status = open_work(&w, err);
    if (status == RX_OK)
        status = fit_everything(&w, err);
    if (status == RX_OK && (input->shapes == NULL || w.frozen) && !(par->isolate > 0))
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
