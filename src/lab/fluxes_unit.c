/* One tile of the campaign of fluxes through every restorer. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "check/quality.h"
#include "check/selfcheck.h"
#include "lab/fluxes.h"
#include "lab/unit_row.h"
#include "pipeline/pipeline.h"
#include "quality/match.h"

static const double STRONG = 7.0, WEAK = 5.0;
/* A detection is a piece of the nearest galaxy within so many half-light radii and FWHM. */
static const double PIECE_RADII = 3.0, PIECE_FWHM = 2.0;
static const double WIDE = 4.0; /* diameter of the second aperture, FWHM */

/* What one unit works on. */
typedef struct work {
    const rx_fluxes_state *state;
    const rx_detection_sky *sky;
    rx_fluxes_scene scene;
    const rx_fluxes_tile *tile;
    double radius;         /* of matching, pixels */
    unsigned char *wanted; /* [n] objects that are listed */
    rx_unit_row *r;
} work;

/* What one restorer has found. */
typedef struct finding {
    const rx_sources *sources;
    double *x, *y;            /* [sources->n] */
    unsigned char *use;       /* [sources->n] 1: it counts */
    long *found, *taken;      /* [objects], [sources]: the partner, -1 none */
    long *ignored, *excluded; /* [objects], [sources]: the same of fainter objects */
} finding;

rx_options rx_fluxes_options(const rx_fluxes_state *state, const rx_detection_sky *sky,
                             const rx_restorer *restorer)
{
    rx_options options = *state->options;
    options.pipeline.measure.naper = 2; /* the first is that of the keywords */
    options.pipeline.measure.aperture_diameter[1] = WIDE * sky->fwhm;
    if (strcmp(restorer->name, "NET") == 0) {
        options.pipeline.detect.threshold *= state->config->net_depth;
        options.pipeline.detect.analysis_threshold *= state->config->net_depth;
    }
    return options;
}

static int is_wanted(const work *w, const rx_fluxes_object *o)
{
    const rx_tile *tile = w->tile->field->tile;
    return o->snr >= w->state->config->truth_snr && o->x >= 0 && o->y >= 0 && o->x <= tile->width - 1 &&
           o->y <= tile->height - 1;
}

/* --- matching --- */

static void finding_free(finding *f)
{
    free(f->x);
    free(f->y);
    free(f->use);
    free(f->found);
    free(f->taken);
    free(f->ignored);
    free(f->excluded);
}

static rx_status finding_new(const work *w, int run, const rx_sources *sources, finding *f, rx_error *err)
{
    const size_t n = (size_t)w->tile->n, m = (size_t)sources->n;
    *f = (finding){.sources = sources};
    f->x = RX_NEW(double, m);
    f->y = RX_NEW(double, m);
    f->use = RX_NEW(unsigned char, m);
    f->found = RX_NEW(long, n);
    f->taken = RX_NEW(long, m);
    f->ignored = RX_NEW(long, n);
    f->excluded = RX_NEW(long, m);
    if (!f->x || !f->y || !f->use || !f->found || !f->taken || !f->ignored || !f->excluded)
        return rx_error_memory(err, (2 * n + 4 * m) * sizeof(long));
    for (size_t i = 0; i < m; i++) {
        f->x[i] = sources->list[i].x;
        f->y[i] = sources->list[i].y;
        f->use[i] = 1;
    }
    if (w->scene != RX_FLUXES_INJECTED)
        return RX_OK;
    const rx_field *field = w->tile->field;
    const rx_image image = rx_field_observed(field);
    const rx_sift sift = {.before = w->state->ground.before[run],
                          .after = sources,
                          .image = &image,
                          .injected = w->tile->light,
                          .radius = w->radius};
    return rx_selfcheck_sift(&sift, f->use, err);
}

/* Objects that are listed take detections first; what is left may belong to others. */
static rx_status match(const work *w, finding *f, rx_error *err)
{
    const size_t n = (size_t)w->tile->n, m = (size_t)f->sources->n;
    double *xy = RX_NEW(double, 2 * n);
    unsigned char *other = RX_NEW(unsigned char, n), *left = RX_NEW(unsigned char, m);
    rx_status status = RX_OK;
    if (xy == NULL || other == NULL || left == NULL) {
        status = rx_error_memory(err, 2 * n * sizeof *xy);
        goto exit;
    }
    for (size_t i = 0; i < n; i++) {
        xy[i] = w->tile->object[i].x;
        xy[n + i] = w->tile->object[i].y;
        other[i] = !w->wanted[i];
    }
    status = rx_match(&(rx_match_list){(long)n, xy, xy + n, w->wanted},
                      &(rx_match_list){(long)m, f->x, f->y, f->use}, w->radius, f->found, f->taken, err);
    for (size_t k = 0; k < m && status == RX_OK; k++)
        left[k] = f->use[k] != 0 && f->taken[k] < 0;
    if (status == RX_OK)
        status =
            rx_match(&(rx_match_list){(long)n, xy, xy + n, other},
                     &(rx_match_list){(long)m, f->x, f->y, left}, w->radius, f->ignored, f->excluded, err);
exit:
    free(xy);
    free(other);
    free(left);
    return status;
}

/* --- values --- */

/* flux and error of a source, one after the other. */
static void fluxes_of(const rx_source *s, double flux[RX_FLUX_KINDS], double error[RX_FLUX_KINDS])
{
    flux[RX_FLUX_AUTO] = s->flux_auto;
    flux[RX_FLUX_APER] = s->flux_aper[0];
    flux[RX_FLUX_WIDE] = s->flux_aper[1];
    flux[RX_FLUX_TEMPLATE] = s->fit.flux;
    error[RX_FLUX_AUTO] = s->fluxerr_auto;
    error[RX_FLUX_APER] = s->fluxerr_aper[0];
    error[RX_FLUX_WIDE] = s->fluxerr_aper[1];
    error[RX_FLUX_TEMPLATE] = s->fit.fluxerr;
}

/* Is object i found, within that distance. */
static int near_enough(const work *w, const finding *f, long i, double distance)
{
    const rx_fluxes_object *o = &w->tile->object[i];
    const long k = f->found[i];
    return k >= 0 && hypot(f->x[k] - o->x, f->y[k] - o->y) <= distance;
}

/* An object and the one that it is blended with, both found, each nearer than half their separation. */
static int told_apart(const work *w, const finding *f, long i)
{
    const rx_fluxes_object *o = &w->tile->object[i];
    if (o->partner < 0)
        return 0;
    const rx_fluxes_object *other = &w->tile->object[o->partner];
    const double half = 0.5 * hypot(o->x - other->x, o->y - other->y);
    return near_enough(w, f, i, half) && near_enough(w, f, o->partner, half);
}

/* Detections on a galaxy, all (0) or those without the mark (1): those that it is the nearest object of. */
static void count_pieces(const work *w, const finding *f, long i, double pieces[2])
{
    pieces[0] = pieces[1] = 0;
    for (int k = 0; k < f->sources->n; k++) {
        long nearest = -1;
        double least = HUGE_VAL;
        for (long o = 0; o < w->tile->n; o++) {
            const double d = hypot(f->x[k] - w->tile->object[o].x, f->y[k] - w->tile->object[o].y);
            if (d < least) {
                least = d;
                nearest = o;
            }
        }
        if (nearest == i && least <= PIECE_RADII * w->tile->object[i].radius + PIECE_FWHM * w->sky->fwhm) {
            pieces[0]++;
            pieces[1] += !rx_source_is_spurious(&f->sources->list[k]);
        }
    }
}

static double state_of(const rx_source *s)
{
    return (s->fit.restore & RX_RESTORE_ADDED ? 2 : 0) + (rx_source_is_spurious(s) ? 1 : 0);
}

static void add_object(const work *w, const finding *f, long i)
{
    double flux[RX_FLUX_KINDS], error[RX_FLUX_KINDS], pieces[2] = {0, 0};
    const long found = f->found[i];
    const double truth = w->tile->object[i].flux;
    for (int k = 0; k < RX_FLUX_KINDS; k++)
        flux[k] = error[k] = NAN;
    if (found >= 0)
        fluxes_of(&f->sources->list[found], flux, error);
    rx_unit_row_add(w->r, found >= 0 ? state_of(&f->sources->list[found]) : NAN);
    for (int k = 0; k < RX_FLUX_KINDS; k++)
        rx_unit_row_add(w->r, flux[k] / truth);
    for (int k = 0; k < RX_FLUX_KINDS; k++)
        rx_unit_row_add(w->r, error[k] / truth);
    rx_unit_row_add(w->r, told_apart(w, f, i));
    if (w->scene == RX_FLUXES_SHREDS)
        count_pieces(w, f, i, pieces);
    rx_unit_row_add(w->r, pieces[0]);
    rx_unit_row_add(w->r, pieces[1]);
}

static void add_tallies(const work *w, const finding *f)
{
    double tally[RX_FLUXES_TALLIES] = {0};
    for (int k = 0; k < f->sources->n; k++) {
        const rx_source *s = &f->sources->list[k];
        const int kept = !rx_source_is_spurious(s);
        if (!f->use[k] || f->excluded[k] >= 0)
            continue;
        if (f->taken[k] < 0) {
            tally[RX_TALLY_FALSE]++;
            tally[RX_TALLY_FALSE_KEPT] += kept;
            continue;
        }
        const double snr = w->tile->object[f->taken[k]].snr;
        tally[RX_TALLY_RIGHT]++;
        tally[RX_TALLY_RIGHT_KEPT] += kept;
        tally[RX_TALLY_ADDED] += (s->fit.restore & RX_RESTORE_ADDED) != 0;
        if (snr >= STRONG) {
            tally[RX_TALLY_STRONG]++;
            tally[RX_TALLY_STRONG_KEPT] += kept;
        } else if (snr >= WEAK) {
            tally[RX_TALLY_WEAK]++;
            tally[RX_TALLY_WEAK_KEPT] += kept;
        }
    }
    for (int t = 0; t < RX_FLUXES_TALLIES; t++)
        rx_unit_row_add(w->r, tally[t]);
}

static void add_props(const work *w)
{
    const rx_fluxes_tile *tile = w->tile;
    long *number = RX_NEW(long, (size_t)tile->n), n = 0;
    if (number == NULL) {
        w->r->failed = 1;
        return;
    }
    for (long i = 0; i < tile->n; i++)
        number[i] = w->wanted[i] ? n++ : -1;
    rx_unit_row_add(w->r, (double)n);
    rx_unit_row_add(w->r, 1e-6 * (double)tile->field->tile->width * (double)tile->field->tile->height);
    for (long i = 0; i < tile->n; i++) {
        const rx_fluxes_object *o = &tile->object[i],
                               *other = o->partner >= 0 ? &tile->object[o->partner] : o;
        if (!w->wanted[i])
            continue;
        const double prop[RX_FLUXES_PROPS] = {
            [RX_PROP_SNR] = o->snr,
            [RX_PROP_GALAXY] = o->galaxy,
            [RX_PROP_BLEND_STATE] = o->company,
            [RX_PROP_BOUND] = o->bound,
            [RX_PROP_PARTNER] = o->partner >= 0 ? (double)number[o->partner] : -1,
            [RX_PROP_APART] = hypot(o->x - other->x, o->y - other->y) / w->sky->fwhm,
            [RX_PROP_MAGS] = 2.5 * log10(other->flux / o->flux)};
        for (int p = 0; p < RX_FLUXES_PROPS; p++)
            rx_unit_row_add(w->r, prop[p]);
    }
    free(number);
}

/* --- units --- */

static rx_status measure(const work *w, int run, rx_error *err)
{
    const rx_options options = rx_fluxes_options(w->state, w->sky, w->state->run[run]);
    rx_result result;
    finding f;
    rx_status status =
        rx_field_extract(&options.pipeline, w->state->run[run], w->tile->field, NULL, NULL, &result, err);
    if (status != RX_OK)
        return status;
    status = finding_new(w, run, result.sources, &f, err);
    if (status == RX_OK)
        status = match(w, &f, err);
    for (long i = 0; status == RX_OK && i < w->tile->n; i++)
        if (w->wanted[i])
            add_object(w, &f, i);
    if (status == RX_OK)
        add_tallies(w, &f);
    finding_free(&f);
    rx_result_free(&result);
    return status;
}

rx_status rx_fluxes_unit(const rx_fluxes_state *state, long unit, rx_unit_values *dst, rx_error *err)
{
    const long set = unit / state->ntiles;
    const int condition = (int)(set / state->nscenes);
    const rx_fluxes_scene scene = state->scene[set % state->nscenes];
    rx_unit_row r = {.values = dst};
    rx_fluxes_tile tile;
    work w = {.state = state, .sky = rx_fluxes_sky(state, condition, scene), .scene = scene, .tile = &tile};
    w.r = &r;
    rx_status status = rx_fluxes_tile_make(state, condition, scene, unit % state->ntiles, &tile, err);
    if (status != RX_OK)
        return status;
    w.wanted = RX_NEW(unsigned char, (size_t)tile.n);
    status = w.wanted != NULL
                 ? rx_quality_radius(&state->options->check.quality, tile.field->tile, &w.radius, err)
                 : rx_error_memory(err, (size_t)tile.n);
    if (scene == RX_FLUXES_SHREDS) /* the middle of a large galaxy is a wide place */
        w.radius = fmax(w.radius, w.sky->fwhm);
    for (long i = 0; status == RX_OK && i < tile.n; i++)
        w.wanted[i] = is_wanted(&w, &tile.object[i]) != 0;
    if (status == RX_OK)
        add_props(&w);
    for (int k = 0; k < state->nruns && status == RX_OK; k++)
        status = measure(&w, k, err);
    free(w.wanted);
    rx_fluxes_tile_free(&tile);
    return status == RX_OK ? rx_unit_row_status(&r, err) : status;
}
