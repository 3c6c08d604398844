/* Injection into copies of the tile, and what the stage makes of it. */
#include "check/selfcheck.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "check/quality.h"
#include "check/replica.h"
#include "io/tile.h"
#include "measure/view.h"
#include "quality/evaluate.h"
#include "quality/match.h"
#include "quality/metrics.h"
#include "quality/statistics.h"
#include "simulate/inject.h"
#include "simulate/render.h"
#include "simulate/scene.h"

/* Streams of random numbers, one per round from here. */
static const uint64_t SCENES = UINT64_C(0x53434e0000000000), PHOTONS = UINT64_C(0x5350480000000000);

/* One round: a copy of the field with objects in it. */
typedef struct injection {
    rx_scene *scene;
    rx_field *field;
    float *light; /* pixels after - before */
    float *clean; /* the same without photon noise and saturation */
} injection;

/* n objects, or fewer where there is no room: whole numbers of both kinds, with the share asked for in the sum of all rounds. */
static rx_status make_scene(const rx_selfcheck_plan *plan, int round, long done, long n, rx_scene **dst,
                            rx_error *err)
{
    const rx_tile *tile = plan->field->tile;
    const double share = plan->galaxies;
    const double galaxies = floor(share * (double)(done + n) + 0.5) - floor(share * (double)done + 0.5);
    rx_population population = {.mag_low = plan->mag_low, .mag_high = plan->mag_high};
    rx_scene_params par = {.width = tile->width,
                           .height = tile->height,
                           .zeropoint = tile->zeropoint,
                           .pixel_scale = plan->pixel_scale,
                           .stars = population,
                           .galaxies = population,
                           .galaxy_kind = RX_GALAXY_MIXED,
                           .galaxy_scale = plan->galaxy_scale,
                           .least_distance = plan->distance,
                           .allowed = plan->allowed,
                           .seed = plan->params.seed,
                           .stream = SCENES + (uint64_t)round};
    par.stars.count = (double)n - galaxies;
    par.galaxies.count = galaxies;
    return rx_scene_make(&par, NULL, dst, err);
}

static rx_status inject(const rx_selfcheck_plan *plan, int round, long done, injection *dst, rx_error *err)
{
    const rx_tile *tile = plan->field->tile;
    const size_t npixels = (size_t)tile->width * (size_t)tile->height;
    const long left = plan->count - done;
    rx_tile *copy = NULL;
    rx_status status = RX_OK;
    RX_TRY(make_scene(plan, round, done, left < plan->per_round ? left : plan->per_round, &dst->scene, err));
    RX_TRY(RX_MAKE(dst->light, npixels, err));
    RX_TRY(RX_MAKE(dst->clean, npixels, err));
    RX_TRY(rx_replica_new(tile, NULL, &copy, err));
    RX_TRY_EXIT(rx_render(dst->scene, 1, &(const rx_optics *){plan->optics}, &(float *const){dst->clean},
                          plan->params.nthreads, err));
    RX_TRY_EXIT(rx_inject(dst->scene, plan->optics,
                          &(rx_inject_params){.gain = tile->gain,
                                              .saturation = tile->saturation,
                                              .noise = &plan->field->noise,
                                              .seed = plan->params.seed,
                                              .stream = PHOTONS + (uint64_t)round},
                          plan->params.nthreads, copy->pixels, err));
    rx_replica_settle(copy);
    for (size_t i = 0; i < npixels; i++)
        dst->light[i] = copy->pixels[i] - tile->pixels[i];
    RX_TRY(
        rx_field_prepare(&plan->params, RX_FIELD_DETECTED, copy, plan->field->psf, NULL, &dst->field, err));
    dst->field->model_noise = plan->model_noise;
    dst->field->model_factor = plan->field->noise_factor;
    return RX_OK;
exit:
    rx_tile_free(copy);
    return status;
}

/* What distinguishes new detections of a tile with injected objects from those that were there before. */
typedef struct sift {
    const rx_sources *before, *after;
    const rx_image *image; /* after the injection, with its sky */
    const float *injected; /* pixels after - before */
    double radius;         /* of a match, pixels */
} sift;

/* Is most of the light in the footprint of `s` injected? */
static int mostly_injected(const sift *in, const rx_source *s)
{
    const rx_image *image = in->image;
    double all = 0.0, gained = 0.0;
    for (int y = s->ymin; y <= s->ymax; y++) {
        for (int x = s->xmin; x <= s->xmax; x++) {
            size_t p = (size_t)y * (size_t)image->width + (size_t)x;
            if (in->after->segments[p] != s->segment || (image->mask[p] & RX_MASK_BAD))
                continue;
            all += (double)image->pixels[p] - (double)rx_map_at(&image->level, x, y);
            gained += (double)in->injected[p];
        }
    }
    return gained > 0.0 && 2.0 * gained >= all;
}

static void positions(const rx_sources *sources, double *x, double *y)
{
    for (int i = 0; i < sources->n; i++) {
        x[i] = sources->list[i].x;
        y[i] = sources->list[i].y;
    }
}

/* new_one[after->n]: 1 for the detections of `after` that count as new (selfcheck.h), 2 for those that have a counterpart
 * all the same. */
static rx_status find_new(const sift *in, unsigned char *new_one, rx_error *err)
{
    const rx_sources *before = in->before, *after = in->after;
    const size_t nb = (size_t)before->n, na = (size_t)after->n;
    rx_status status = RX_OK;
    double *xy = RX_NEW(double, 2 * (nb + na));
    long *partners = RX_NEW(long, nb + na);
    if (xy == NULL || partners == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 2 * (nb + na) * sizeof(double)));
    double *xb = xy, *yb = xy + nb, *xa = xy + 2 * nb, *ya = xa + na;
    positions(before, xb, yb);
    positions(after, xa, ya);
    RX_TRY_EXIT(rx_match(&(rx_match_list){before->n, xb, yb, NULL}, &(rx_match_list){after->n, xa, ya, NULL},
                         in->radius, partners, partners + nb, err));
    for (size_t i = 0; i < na; i++)
        new_one[i] = partners[nb + i] < 0 ? 1 : mostly_injected(in, &after->list[i]) ? 2 : 0;
exit:
    free(xy);
    free(partners);
    return status;
}

/* Make room for n rows: positions, magnitudes and fluxes, and, when `measured` is not NULL, score, flags and *measured,
 * too. New rows are not set; alpha and delta stay NULL. */
static rx_status grow(rx_qa_list *list, rx_selfcheck_found **measured, long n, rx_error *err)
{
    double **columns[] = {&list->x,    &list->y,          &list->mag,  &list->mag_error,
                          &list->flux, &list->flux_error, &list->score};
    for (size_t i = 0; i < (measured != NULL ? 7 : 6); i++)
        RX_TRY(RX_GROW(*columns[i], (size_t)n, err));
    if (measured != NULL) {
        RX_TRY(RX_GROW(list->flags, (size_t)n, err));
        RX_TRY(RX_GROW(*measured, (size_t)n, err));
    }
    list->n = n;
    return RX_OK;
}

/* Injected objects of a round behind those of the rounds before. */
static rx_status keep_truth(const rx_scene *scene, double shift, rx_selfcheck *dst, rx_error *err)
{
    long first = dst->truth.n;
    RX_TRY(grow(&dst->truth, NULL, first + scene->n, err));
    RX_TRY(RX_GROW(dst->is_galaxy, (size_t)(first + scene->n), err));
    for (long i = 0; i < scene->n; i++) {
        const rx_object *object = &scene->objects[i];
        dst->is_galaxy[first + i] = object->type == RX_OBJECT_GALAXY;
        dst->truth.x[first + i] = object->x + shift;
        dst->truth.y[first + i] = object->y;
        dst->truth.mag[first + i] = object->mag;
        dst->truth.flux[first + i] = object->flux;
        dst->truth.mag_error[first + i] = 0.0;
        dst->truth.flux_error[first + i] = 0.0;
    }
    return RX_OK;
}

/* Are fluxes those of untouched pixels? */
static int untouched(const rx_selfcheck_plan *plan, const rx_result *result)
{
    return result->plain || plan->params.measure_original;
}

/* Sky level of a field as that restorer subtracts it. */
static rx_map sky_level(const rx_field *field, const rx_restored *on)
{
    return rx_background_level(on == NULL ? field->plain : field->restored);
}

/* flux[i]: what the wide aperture of source i would hold without injection, that is on the untouched tile,
 * less the sky that the injection made the background take away in excess. */
static rx_status empty_apertures(const rx_selfcheck_plan *plan, const rx_result *before, injection *in,
                                 const rx_sources *after, double *flux, rx_error *err)
{
    rx_sources same = *after; /* its own list, the map is lent */
    rx_photometry unused;
    const rx_restored *on = untouched(plan, before) ? NULL : before->restored;
    const rx_map old = sky_level(plan->field, on), new = sky_level(in->field, on);
    const double area =
        plan->params.measure.local_background ? 0.0 : acos(-1.0) * 0.25 * plan->diameter * plan->diameter;
    const size_t n = (size_t)after->n;
    same.vignets = NULL;
    RX_TRY(RX_MAKE(same.list, n, err));
    memcpy(same.list, after->list, n * sizeof(rx_source));
    const rx_photometry_input input = {.detect = plan->field, .field = plan->field, .restored = on};
    const rx_status status = rx_photometry_run(&plan->apertures, &input, &same, NULL, &unused, err);
    for (size_t i = 0; i < n && status == RX_OK; i++) {
        const rx_source *s = &same.list[i];
        const float gained = rx_map_at(&new, s->xpeak, s->ypeak),
                    before_it = rx_map_at(&old, s->xpeak, s->ypeak);
        flux[i] = s->flux_aper[0] - area * ((double)gained - (double)before_it);
    }
    free(same.list);
    return status;
}

/* Sum of a plane in the wide aperture at (x, y), as MAG_APER sums it. */
static double in_aperture(const rx_tile *tile, const float *plane, double x, double y, double radius)
{
    double sum = 0.0;
    int x0 = (int)floor(x - radius), x1 = (int)ceil(x + radius);
    int y0 = (int)floor(y - radius), y1 = (int)ceil(y + radius);
    for (int j = y0 < 0 ? 0 : y0; j <= y1 && j < tile->height; j++)
        for (int i = x0 < 0 ? 0 : x0; i <= x1 && i < tile->width; i++)
            sum += rx_pixel_in_circle((float)(i - x), (float)(j - y), radius, 5) *
                   (double)plane[(size_t)j * (size_t)tile->width + (size_t)i];
    return sum;
}

/* What a round found, sifted and kept. */
static rx_status keep_round(const rx_selfcheck_plan *plan, const rx_result *before, injection *in,
                            const rx_result *result, double shift, rx_selfcheck *dst, rx_error *err)
{
    const rx_sources *sources = result->sources;
    const rx_image image = rx_field_observed(in->field);
    const sift how = {.before = before->sources,
                      .after = sources,
                      .image = &image,
                      .injected = in->light,
                      .radius = plan->match_radius};
    const int wide = plan->params.measure.naper - 1;
    rx_qa_list all = {0}, *to = &dst->found_list;
    long n = to->n, added = 0;
    unsigned char *new_one = RX_NEW(unsigned char, (size_t)sources->n);
    double *empty = RX_NEW(double, (size_t)sources->n), *light = RX_NEW(double, (size_t)sources->n);
    rx_status status = RX_OK;
    if (new_one == NULL || empty == NULL || light == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (size_t)sources->n * sizeof(double)));
    RX_TRY_EXIT(find_new(&how, new_one, err));
    RX_TRY_EXIT(empty_apertures(plan, before, in, sources, empty, err));
    for (int i = 0; i < sources->n; i++)
        light[i] = untouched(plan, result) ? in_aperture(plan->field->tile, in->clean, sources->list[i].x,
                                                         sources->list[i].y, 0.5 * plan->diameter)
                                           : NAN;
    RX_TRY_EXIT(rx_quality_list(&plan->par->quality, in->field->tile, sources, &all, err));
    RX_TRY_EXIT(keep_truth(in->scene, shift, dst, err));
    /* new detections, behind those of the rounds before */
    for (int i = 0; i < sources->n; i++)
        added += new_one[i] != 0;
    RX_TRY_EXIT(grow(to, &dst->measured, n + added, err));
    for (int i = 0; i < sources->n; i++) {
        if (new_one[i] == 0)
            continue;
        to->x[n] = all.x[i] + shift;
        to->y[n] = all.y[i];
        to->mag[n] = all.mag[i];
        to->mag_error[n] = all.mag_error[i];
        to->flux[n] = all.flux[i];
        to->flux_error[n] = all.flux_error[i];
        to->score[n] = all.score[i];
        to->flags[n] = all.flags[i] | (new_one[i] == 2 ? RX_FLAG_CROWDED : 0);
        const rx_source *source = &sources->list[i];
        dst->measured[n] = (rx_selfcheck_found){.wide = source->flux_aper[wide],
                                                .empty = empty[i],
                                                .light = light[i],
                                                .flux = source->fit.flux,
                                                .fluxerr = source->fit.fluxerr,
                                                .blend = source->fit.blend};
        n++;
    }
exit:
    rx_qa_list_free(&all);
    free(new_one);
    free(empty);
    free(light);
    return status;
}

static rx_status run_round(const rx_selfcheck_plan *plan, const rx_restorer *kind, const rx_result *before,
                           int round, rx_selfcheck *dst, long *injected, rx_error *err)
{
    injection in = {0};
    rx_result result = {0};
    const double shift = (double)round * dst->pitch;
    const rx_tile *tile = plan->field->tile;
    rx_status status;
    RX_TRY_EXIT(inject(plan, round, dst->truth.n, &in, err));
    RX_TRY_EXIT(rx_field_extract(&plan->params, kind, in.field, NULL, NULL, &result, err));
    *injected = in.scene->n;
    RX_TRY_EXIT(keep_round(plan, before, &in, &result, shift, dst, err));
    if (round > 0)
        goto exit;
    RX_TRY_EXIT(rx_quality_picture(kind->name, tile->width, tile->height, result.restored->pixels,
                                   plan->field->plain->global_sigma, &dst->picture, err));
    if (!untouched(plan, &result) && (dst->psf = rx_psf_copy(result.restored->psf)) == NULL)
        status = rx_error_memory(err, 0);
exit:
    rx_result_free(&result);
    rx_scene_free(in.scene);
    rx_field_free(in.field);
    free(in.light);
    free(in.clean);
    return status;
}

/* --- completeness and bias --- */

static const double CLEAR = 1.5; /* S/N 20 is so many magnitudes brighter than the limit at S/N 5 */

void rx_selfcheck_input(const rx_selfcheck_plan *plan, const rx_selfcheck *check, const char *name,
                        rx_qa_input *input, rx_qa_run *run)
{
    *run = (rx_qa_run){.name = name, .list = check->found_list, .law_scale = 1.0, .law_power = 0.5};
    *input = (rx_qa_input){.tile = plan->field->tile->name,
                           .reference = "objects injected into the tile itself",
                           .width = check->width,
                           .height = check->height,
                           .pixel_scale = plan->pixel_scale,
                           .score_name = "peak S/N of the filtered detection image",
                           .truth = check->truth,
                           .nruns = 1,
                           .runs = run};
}

rx_qa_params rx_selfcheck_qa(const rx_selfcheck_plan *plan)
{
    return (rx_qa_params){.match_radius = plan->match_radius,
                          .mag_low = plan->mag_low,
                          .mag_high = plan->mag_high,
                          .mag_step = plan->mag_step,
                          .figures = plan->par->figures,
                          .by = {plan->params.seed, plan->params.nthreads}};
}

/* Does a source of the untouched tile, a masked pixel or the border reach into the wide aperture? */
static int crowded(const rx_selfcheck_plan *plan, double x, double y)
{
    const rx_tile *tile = plan->field->tile;
    const double radius = 0.5 * plan->diameter + 0.5;
    int x0 = (int)floor(x - radius), x1 = (int)ceil(x + radius);
    int y0 = (int)floor(y - radius), y1 = (int)ceil(y + radius);
    if (x0 < 0 || y0 < 0 || x1 >= tile->width || y1 >= tile->height)
        return 1;
    for (int j = y0; j <= y1; j++) {
        for (int i = x0; i <= x1; i++) {
            size_t p = (size_t)j * (size_t)tile->width + (size_t)i;
            if ((plan->segments[p] != 0 || tile->mask[p] != 0) && hypot(i - x, j - y) <= radius)
                return 1;
        }
    }
    return 0;
}

typedef struct deviations {
    long ntotal, nwide;
    double *total; /* QA_MAG of all unflagged ones, mag */
    /* bright isolated ones: wide aperture as measured and less what it would hold without them, mag; that,
     * ADU per pixel */
    double *wide, *gained, *sky;
} deviations;

static rx_status find_deviations(const rx_selfcheck_plan *plan, const rx_selfcheck *check,
                                 const rx_evaluation *e, deviations *dst, rx_error *err)
{
    const double area = acos(-1.0) * 0.25 * plan->diameter * plan->diameter;
    const rx_qa_list *list = &check->found_list, *truth = &check->truth;
    const size_t side = check->psf != NULL ? (size_t)check->psf->size : 0;
    float *stamp;
    RX_TRY(RX_MAKE(stamp, side * side, err));
    for (long j = 0; j < list->n; j++) {
        long i = e->origin[j];
        if (i < 0 || list->flags[j] != 0)
            continue;
        if (isfinite(e->dmag[j]))
            dst->total[dst->ntotal++] = e->dmag[j];
        double x = fmod(truth->x[i] + 1.0, check->pitch) - 1.0, y = truth->y[i];
        const double wide = check->measured[j].wide, empty = check->measured[j].empty;
        double light = check->measured[j].light;
        if (truth->mag[i] > plan->limit - CLEAR || !(wide > 0.0) || !(wide > empty) || crowded(plan, x, y))
            continue;
        if (check->psf != NULL && check->is_galaxy[i])
            continue; /* how much of it the aperture holds is not known */
        if (check->psf != NULL)
            light = truth->flux[i] * rx_selfcheck_enclosed(check->psf, x, y, plan->diameter, stamp);
        if (!(light > 0.0))
            continue;
        dst->wide[dst->nwide] = -2.5 * log10(wide / light);
        dst->gained[dst->nwide] = -2.5 * log10((wide - empty) / light);
        dst->sky[dst->nwide++] = empty / area;
    }
    free(stamp);
    return RX_OK;
}

static rx_status biases(const rx_selfcheck_plan *plan, const rx_evaluation *e, rx_selfcheck *check,
                        rx_error *err)
{
    size_t n = (size_t)check->found_list.n;
    rx_estimate unused;
    double *values;
    RX_TRY(RX_MAKE(values, 4 * n, err));
    deviations found = {.total = values, .wide = values + n, .gained = values + 2 * n, .sky = values + 3 * n};
    rx_status status = find_deviations(plan, check, e, &found, err);
    rx_robust_estimates(found.total, found.ntotal, RX_LEVEL, &check->bias, &check->scatter);
    rx_robust_estimates(found.wide, found.nwide, RX_LEVEL, &check->wide_bias, &unused);
    rx_robust_estimates(found.gained, found.nwide, RX_LEVEL, &check->aperture_bias, &unused);
    rx_robust_estimates(found.sky, found.nwide, RX_LEVEL, &check->sky, &unused);
    free(values);
    return status;
}

/* MAGERR_INJECTED: of those that were found, whatever their FLAGS. */
static rx_status find_errors(const rx_evaluation *e, rx_selfcheck *check, rx_error *err)
{
    const rx_qa_list *list = &check->found_list, *truth = &check->truth;
    long n = 0;
    rx_conformal_case *cases;
    RX_TRY(RX_MAKE(cases, (size_t)list->n, err));
    for (long j = 0; j < list->n; j++) {
        const rx_selfcheck_found *m = &check->measured[j];
        const long i = e->origin[j];
        if (i >= 0)
            cases[n++] = (rx_conformal_case){.snr = m->flux / m->fluxerr,
                                             .blend = m->blend,
                                             .score = fabs(m->flux - truth->flux[i]) / m->fluxerr,
                                             .weight = 1.0 / truth->flux[i]};
    }
    rx_conformal_fit(cases, n, &check->errors);
    free(cases);
    return RX_OK;
}

static rx_status measure_one(const rx_evaluation *e, rx_metric metric, rx_resampling by, rx_estimate *dst,
                             rx_error *err)
{
    rx_estimate all[RX_METRIC_COUNT];
    RX_TRY(rx_metrics_measure(e, (rx_mag_range){.whole = 1}, RX_LEVEL, by, metric, all, err));
    *dst = all[metric];
    return RX_OK;
}

/* The numbers of `check` from its lists. */
static rx_status measure(const rx_selfcheck_plan *plan, rx_selfcheck *check, rx_error *err)
{
    rx_qa_input input;
    rx_qa_run run;
    rx_bins bins;
    rx_evaluation e = {0};
    rx_qa_params par = rx_selfcheck_qa(plan);
    rx_selfcheck_input(plan, check, "self check", &input, &run);
    rx_status status = RX_OK;
    RX_TRY(rx_evaluate_bins(&par, &input, &bins, err));
    RX_TRY(rx_evaluate(&par, &input, 0, &bins, RX_LEVEL, &e, err));
    check->injected = e.references;
    check->found = e.matched;
    RX_TRY_EXIT(measure_one(&e, RX_METRIC_MAG50, par.by, &check->mag50, err));
    RX_TRY_EXIT(measure_one(&e, RX_METRIC_MAG90, par.by, &check->mag90, err));
    RX_TRY_EXIT(measure_one(&e, RX_METRIC_PRECISION, par.by, &check->injected_share, err));
    RX_TRY_EXIT(biases(plan, &e, check, err));
    if (plan->params.templates.wanted)
        RX_TRY_EXIT(find_errors(&e, check, err));
    check->partner = e.partner;
    e.partner = NULL;
exit:
    rx_evaluation_free(&e);
    return status;
}

rx_status rx_selfcheck_run(const rx_selfcheck_plan *plan, const rx_restorer *kind, const rx_result *before,
                           rx_log *log, rx_selfcheck *dst, rx_error *err)
{
    const rx_tile *tile = plan->field->tile;
    rx_status status = RX_OK;
    *dst = (rx_selfcheck){.galaxies = plan->galaxies, .height = tile->height};
    dst->pitch = tile->width + 2 * (int)ceil(plan->match_radius) + 2; /* no pair across rounds */
    rx_log_progress_begin(log);
    while (status == RX_OK && dst->truth.n < plan->count && dst->rounds < INT_MAX / dst->pitch - 1) {
        long injected = 0;
        status = rx_interrupt_check(err);
        if (status == RX_OK)
            status = run_round(plan, kind, before, dst->rounds, dst, &injected, err);
        if (status == RX_OK && injected == 0)
            break;
        dst->rounds++;
        rx_log_progress(log, "self check", (double)dst->truth.n / (double)plan->count);
    }
    rx_log_progress_end(log);
    dst->width = dst->rounds * dst->pitch;
    if (status == RX_OK && dst->truth.n == 0)
        status = rx_error_at(err, RX_INPUT, tile->name, tile->hdu, 0,
                             "self check: no place was found for an object; leave out SELF_CHECK");
    if (status == RX_OK)
        status = measure(plan, dst, err);
    return status;
}

void rx_selfcheck_free(rx_selfcheck *check)
{
    rx_qa_list_free(&check->truth);
    rx_qa_list_free(&check->found_list);
    free(check->measured);
    free(check->is_galaxy);
    free(check->partner);
    rx_psf_free(check->psf);
    free((void *)check->picture.pixels);
    *check = (rx_selfcheck){0};
}
