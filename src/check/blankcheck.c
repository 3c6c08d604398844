/* False detections on noise alone. */
#include "check/blankcheck.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "fit/preal.h"
#include "io/tile.h"
#include "pipeline/domain.h"
#include "pipeline/field_noise.h"
#include "quality/statistics.h"
#include "simulate/inject.h"
#include "simulate/sky_noise.h"

enum {
    GLANCE_SIDE = 512, /* pixels of a window, */
    QUICK_SIDE = 1024, /* and of the next one where there was something to see */
    LOOKS = 16,        /* realisations of a tile that is smaller: a Mpixel, for one of 256 x 256 */
    SEVERAL = 3        /* false detections: a peak or two of a small window say little */
};

static const double RAISED_STEP = 1.05, RAISED_MOST = 10.0;
static const uint64_t NOISE =
    UINT64_C(0x424c4b0000000000); /* stream of random numbers, one per realisation */

rx_status rx_blankcheck_noise(const rx_field *field, const int32_t *segments, int nthreads,
                              rx_noise_correlation *dst, rx_error *err)
{
    const rx_tile *tile = field->tile;
    size_t n = (size_t)tile->width * (size_t)tile->height;
    const double fwhm = field->psf != NULL ? field->psf->fwhm : 4.0;
    const double distances[] = {2.0 * fwhm, fwhm, 0.0};
    rx_status status = RX_OK;
    unsigned char *used;
    RX_TRY(RX_MAKE(used, n, err));
    *dst = rx_noise_white(RX_NOISE_UNKNOWN);
    for (size_t k = 0; k < sizeof distances / sizeof *distances && dst->origin == RX_NOISE_UNKNOWN; k++) {
        RX_TRY_EXIT(
            rx_inject_allowed(tile->width, tile->height, segments, tile->mask, distances[k], used, err));
        RX_TRY_EXIT(rx_field_noise_measure(field, used, nthreads, dst, err));
    }
    if (dst->origin == RX_NOISE_UNKNOWN)
        status = rx_error_set(err, RX_INPUT, "there is too little sky without sources to measure its noise");
exit:
    free(used);
    return status;
}

rx_status rx_blankcheck_field(const rx_pipeline_params *params, const rx_blank_input *in,
                              const rx_replica_part *part, rx_random_stream from, rx_field **dst,
                              rx_error *err)
{
    const rx_field *field = in->field;
    const rx_map noise_map = rx_background_noise(field->plain);
    rx_tile *copy = NULL;
    rx_psf *psf = NULL;
    double model_noise = field->model_noise;
    if (!(model_noise > 0.0))
        RX_TRY(rx_domain_noise(field, params->nthreads, &model_noise, err));
    RX_TRY(rx_replica_new(field->tile, part, &copy, err));
    rx_status status = RX_OK;
    const int width = copy->width, height = copy->height;
    const size_t n = (size_t)width * (size_t)height, wide = (size_t)field->tile->width,
                 corner = part != NULL ? (size_t)part->y * wide + (size_t)part->x : 0;
    const float *light = in->light;
    const double gain = field->image.gain;
    float *sigma = RX_NEW(float, n);
    if (field->psf != NULL)
        psf = rx_replica_psf(field->psf, part);
    if (sigma == NULL || (psf == NULL) != (field->psf == NULL))
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof *sigma));
#pragma omp parallel for schedule(static) num_threads(params->nthreads > 0 ? params->nthreads : 1)
    for (int y = 0; y < height; y++) {
        float *row = sigma + (size_t)y * (size_t)width;
        const float *from =
            rx_map_row(&noise_map, y + (part != NULL ? part->y : 0), part != NULL ? part->x : 0, width, row);
        if (from != row)
            memcpy(row, from, (size_t)width * sizeof *row);
        for (int x = 0; x < width && light != NULL && gain > 0.0; x++)
            row[x] = (float)sqrt((double)row[x] * row[x] +
                                 fmax(light[corner + (size_t)y * wide + (size_t)x], 0.0) / gain);
    }
    const rx_map map = rx_map_plane(sigma, width);
    RX_TRY_EXIT(rx_sky_noise_draw(in->noise, &map, height, from, params->nthreads, copy->pixels, err));
    /* a map of the sky follows large sources: on it, their light would be found again */
#pragma omp parallel for schedule(static) num_threads(params->nthreads > 0 ? params->nthreads : 1)
    for (size_t i = 0; i < n; i++)
        copy->pixels[i] +=
            (float)field->plain->global_level +
            (light != NULL ? light[corner + i / (size_t)width * wide + i % (size_t)width] : 0.0f);
    copy->gain = 0.0; /* its noise is normal, that of few photons is not */
    rx_replica_settle(copy);
    rx_tile *tile = copy;
    copy = NULL;
    RX_TRY_EXIT(rx_field_prepare(params, RX_FIELD_DETECTED, tile, psf, NULL, dst, err));
    (*dst)->unrestorable = field->unrestorable;
    (*dst)->model_noise = model_noise; /* restored as the tile itself is */
    (*dst)->model_factor = field->model_factor > 0.0 ? field->model_factor : field->noise_factor;
exit:
    rx_tile_free(copy);
    rx_psf_free(psf);
    free(sigma);
    return status;
}

/* Mpixel of a restored image that are not hidden and, where `sky`, of no source. */
static double searched(const rx_pipeline_params *params, const rx_result *result, int sky)
{
    const int hide = result->plain && !params->saturated_in_none ? RX_HIDE_PLAIN : RX_HIDE_RESTORED;
    const size_t n = (size_t)result->restored->width * (size_t)result->restored->height;
    size_t good = 0;
#pragma omp parallel for schedule(static) reduction(+ : good)                                                \
    num_threads(params->nthreads > 0 ? params->nthreads : 1)
    for (size_t i = 0; i < n; i++)
        good += (result->restored->mask[i] & hide) == 0 && (!sky || result->sources->segments[i] == 0);
    return (double)good / 1e6;
}

int rx_blankcheck_is_crowd(const rx_result *tile)
{
    return tile->templates.tphot != NULL && tile->templates.tphot->crowded > 0.5;
}

static rx_status run_one(const rx_pipeline_params *params, const rx_blank_input *in, int number, int drop,
                         rx_blankcheck *dst, rx_error *err)
{
    rx_field *blank = NULL;
    rx_result result = {0};
    RX_TRY(rx_blankcheck_field(params, in, NULL, (rx_random_stream){params->seed, NOISE + (uint64_t)number},
                               &blank, err));
    rx_status status;
    RX_TRY_EXIT(rx_field_extract(params, in->kind, blank, NULL, NULL, &result, err));
    const rx_tphot *tphot = result.templates.tphot;
    dst->mpixels += searched(params, &result, 0);
    dst->false_detections += tphot == NULL ? result.sources->n : drop ? 0 : tphot->nlisted;
    dst->realisations++;
    if (tphot != NULL)
        RX_TRY_EXIT(RX_GROW(dst->fitted, (size_t)dst->nfitted + (size_t)tphot->n, err));
    for (int i = 0; tphot != NULL && i < tphot->n; i++, dst->nfitted++) {
        dst->fitted[dst->nfitted] = tphot->list[i].evidence;
    }
exit:
    rx_result_free(&result);
    rx_field_free(blank);
    return status;
}

static void set_rate(rx_blankcheck *dst)
{
    dst->rate = rx_poisson_rate(dst->false_detections, dst->mpixels, RX_LEVEL);
    dst->upper = rx_poisson_upper(dst->false_detections, dst->mpixels, RX_LEVEL);
}

rx_status rx_blankcheck_run(const rx_pipeline_params *params, const rx_blank_input *in, rx_log *log,
                            rx_blankcheck *dst, rx_error *err)
{
    rx_status status = RX_OK;
    rx_pipeline_params own = rx_replica_params(params);
    own.templates.wanted = in->tile != NULL && in->tile->templates.tphot != NULL;
    if (own.templates.wanted)
        own.templates.par.crowding = rx_blankcheck_is_crowd(in->tile) ? RX_CROWDING_YES : RX_CROWDING_NO;
    *dst = (rx_blankcheck){.raised = 1.0, .correlated = in->noise->correlated};
    rx_log_progress_begin(log);
    for (int i = 0; i < in->realisations; i++) {
        RX_TRY_EXIT(rx_interrupt_check(err));
        RX_TRY_EXIT(run_one(&own, in, i, params->templates.precision > 0.0, dst, err));
        rx_log_progress(log, "blank check", (double)(i + 1) / in->realisations);
    }
    set_rate(dst);
exit:
    rx_log_progress_end(log);
    return status;
}

typedef struct look {
    rx_field *blank;
    rx_result result;
} look;

/* One more realisation of a window of that side; *mpixels: 0 where the restorer did not do it. */
static rx_status take_look(const rx_pipeline_params *params, const rx_blank_input *in, int side, int number,
                           look *dst, double *mpixels, rx_error *err)
{
    const rx_tile *tile = in->field->tile;
    const rx_replica_part window =
        rx_replica_window(tile, &(rx_replica_part){.width = tile->width, .height = tile->height}, side);
    const uint64_t stream = NOISE + (uint64_t)side + ((uint64_t)number << 16);
    *mpixels = 0.0;
    RX_TRY(
        rx_blankcheck_field(params, in, &window, (rx_random_stream){params->seed, stream}, &dst->blank, err));
    RX_TRY(rx_field_extract(params, in->kind, dst->blank, NULL, NULL, &dst->result, err));
    if (dst->result.by == NULL)
        *mpixels = searched(params, &dst->result, 0);
    return RX_OK;
}

/* False detections of all looks at a threshold raised so. */
static rx_status count_raised(const rx_pipeline_params *params, const look *looks, rx_blankcheck *dst,
                              rx_error *err)
{
    dst->false_detections = 0;
    for (int i = 0; i < dst->realisations; i++) {
        long n;
        RX_TRY(rx_interrupt_check(err));
        RX_TRY(rx_result_count(params, &looks[i].result, dst->raised, &n, err));
        dst->false_detections += n;
    }
    return RX_OK;
}

/* What is found in so many realisations at most of a window of that side; with the threshold raised where it is too much. Looks
 * end with a Mpixel, or where their number says that no more than `most` are there, or that more are. */
static rx_status run_window(const rx_pipeline_params *params, const rx_blank_input *in, int side, double most,
                            rx_blankcheck *dst, rx_error *err)
{
    look *looks;
    rx_status status = RX_OK;
    bool decided = false;
    rx_blankcheck check = {.raised = 1.0, .quick = 1, .correlated = in->noise->correlated};
    RX_TRY(RX_MAKE(looks, (size_t)in->realisations, err));
    for (int i = 0; i < in->realisations && !decided; i++) {
        double mpixels;
        RX_TRY_EXIT(rx_interrupt_check(err));
        RX_TRY_EXIT(take_look(params, in, side, i, &looks[i], &mpixels, err));
        if (!(mpixels > 0.0))
            break;
        check.realisations++;
        check.mpixels += mpixels;
        check.false_detections += looks[i].result.sources->n;
        set_rate(&check);
        decided = !(most > 0.0) || check.mpixels >= 1.0 || check.rate.high < most ||
                  (check.rate.low > most && check.false_detections >= SEVERAL);
    }
    if (check.realisations == 0)
        goto exit;
    check.asked = check.rate.value;
    if (most > 0.0 && check.false_detections >= SEVERAL)
        while ((double)check.false_detections > most * check.mpixels && check.raised < RAISED_MOST) {
            check.raised *= RAISED_STEP;
            RX_TRY_EXIT(count_raised(params, looks, &check, err));
        }
    set_rate(&check);
    *dst = check;
exit:
    for (int i = 0; i < in->realisations; i++) {
        rx_result_free(&looks[i].result);
        rx_field_free(looks[i].blank);
    }
    free(looks);
    return status;
}

rx_status rx_blankcheck_guard(rx_pipeline_params *params, const rx_restorer *kind, const rx_field *field,
                              double most, rx_blankcheck *dst, rx_error *err)
{
    const rx_tile *tile = field->tile;
    rx_pipeline_params own = rx_replica_params(params);
    rx_noise_correlation noise = field->noise;
    own.keep_filtered = 1;
    *dst = (rx_blankcheck){.raised = 1.0};
    if (field->psf == NULL ||
        params->detect.filter_auto) /* AUTO: what is made of noise is not significant in the pixels */
        return RX_OK;
    if (noise.origin != RX_NOISE_MEASURED) /* what was stated may be wrong */
        RX_TRY(rx_field_noise_measure(field, NULL, params->nthreads, &noise, err));
    if (noise.origin == RX_NOISE_UNKNOWN)
        return RX_OK;
    const bool wide = (double)tile->width * (double)tile->height > (double)GLANCE_SIDE * GLANCE_SIDE;
    rx_blank_input in = {.kind = kind, .field = field, .noise = &noise, .realisations = wide ? 1 : LOOKS};
    RX_TRY(run_window(&own, &in, GLANCE_SIDE, wide ? 0.0 : most, dst, err));
    in.realisations = LOOKS;
    if (wide && dst->false_detections >= SEVERAL)
        RX_TRY(run_window(&own, &in, QUICK_SIDE, most, dst, err));
    params->detect.threshold *= dst->raised;
    return RX_OK;
}

/* Of what was fitted to noise PRECISION_TARGET would have kept some. */
static void count_kept(const rx_pipeline_params *params, const rx_result *tile, rx_blankcheck *check)
{
    if (tile->templates.tphot == NULL || check->realisations == 0 || check->quick ||
        !(params->templates.precision > 0.0))
        return;
    const rx_preal *preal = &tile->templates.preal[rx_blankcheck_is_crowd(tile)];
    for (int i = 0; i < check->nfitted; i++)
        check->false_detections += rx_preal_of(preal, check->fitted[i]) >= tile->templates.least;
    set_rate(check);
}

/* 1 - false / n within 0..1. */
static double share(double rate, double sky, long n)
{
    return fmin(fmax(1.0 - rate * sky / (double)n, 0.0), 1.0);
}

void rx_blankcheck_finish(const rx_pipeline_params *params, const rx_result *tile, rx_blankcheck *check)
{
    const long n = tile->sources->n;
    count_kept(params, tile, check);
    check->sky = searched(params, tile, 1);
    check->real = (rx_estimate){.value = NAN, .low = NAN, .high = NAN};
    if (n > 0 && check->realisations > 0)
        check->real = (rx_estimate){.value = share(check->rate.value, check->sky, n),
                                    .low = share(check->rate.high, check->sky, n),
                                    .high = share(check->rate.low, check->sky, n),
                                    .n = n};
}

void rx_blankcheck_free(rx_blankcheck *check)
{
    free(check->fitted);
    *check = (rx_blankcheck){0};
}
