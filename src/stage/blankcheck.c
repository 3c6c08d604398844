/* False detections on noise alone. */
#include "stage/blankcheck.h"

#include <math.h>
#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "io/tile.h"
#include "simulate/inject.h"
#include "stage/domain.h"
#include "stage/replica.h"
#include "validate/hypothesis.h"

static const double LEVEL = 0.95;
static const uint64_t NOISE =
    UINT64_C(0x424c4b0000000000); /* stream of random numbers, one per realisation */

rx_status rx_blankcheck_noise(const rx_field *field, const int32_t *segments, rx_sky_noise *dst,
                              rx_error *err)
{
    const rx_tile *tile = field->tile;
    size_t n = (size_t)tile->width * (size_t)tile->height;
    const double fwhm = field->psf != NULL ? field->psf->fwhm : 4.0;
    const double distances[] = {2.0 * fwhm, fwhm, 0.0};
    const rx_map sigma = rx_background_noise(field->plain);
    rx_status status = RX_INPUT;
    unsigned char *used = RX_NEW(unsigned char, n);
    float *pixels = RX_NEW(float, n);
    if (used == NULL || pixels == NULL) {
        status = rx_error_memory(err, n * sizeof(float));
        goto exit;
    }
    rx_field_above_sky(tile, field->plain, 0, 1, pixels);
    for (size_t k = 0; k < sizeof distances / sizeof *distances && status == RX_INPUT; k++) {
        status = rx_inject_allowed(RX_INJECT_AWAY, tile->width, tile->height, segments, tile->mask,
                                   distances[k], used, err);
        if (status == RX_OK)
            status = rx_sky_noise_measure(tile->width, tile->height, pixels, &sigma, used, dst, err);
    }
exit:
    free(used);
    free(pixels);
    return status;
}

rx_status rx_blankcheck_field(const rx_options *options, const rx_field *field, const rx_sky_noise *noise,
                              uint64_t seed, uint64_t stream, rx_field **dst, rx_error *err)
{
    const rx_tile *tile = field->tile;
    size_t n = (size_t)tile->width * (size_t)tile->height;
    const rx_map sigma = rx_background_noise(field->plain);
    rx_tile *copy = NULL;
    double model_noise = 0.0;
    rx_status status = rx_domain_noise(field, &model_noise, err);
    if (status == RX_OK)
        status = rx_replica_new(tile, &copy, err);
    if (status != RX_OK)
        return status;
    status = rx_sky_noise_draw(noise, tile->width, tile->height, &sigma, seed, stream, options->nthreads,
                               copy->pixels, err);
    if (status != RX_OK) {
        rx_tile_free(copy);
        return status;
    }
    /* a map of the sky follows large sources: on it, their light would be found again */
    for (size_t i = 0; i < n; i++)
        copy->pixels[i] += (float)field->plain->global_level;
    rx_replica_settle(copy);
    status = rx_field_prepare(options, 0, copy, field->psf, 0, NULL, dst, err);
    if (status == RX_OK) {
        (*dst)->unrestorable = field->unrestorable;
        (*dst)->model_noise = model_noise; /* restored as the tile itself is */
    }
    return status;
}

/* Mpixel of a probed image that are not hidden and, where `sky`, of no source. */
static double searched(const rx_options *options, const rx_probe *probe, int sky)
{
    const int hide = probe->plain && !options->saturated_in_none ? RX_HIDE_PLAIN : RX_HIDE_RESTORED;
    const size_t n = (size_t)probe->restored->width * (size_t)probe->restored->height;
    size_t good = 0;
    for (size_t i = 0; i < n; i++)
        good += (probe->restored->mask[i] & hide) == 0 && (!sky || probe->sources->segments[i] == 0);
    return (double)good / 1e6;
}

static rx_status run_one(const rx_options *options, const rx_restorer *kind, const rx_field *field,
                         const rx_sky_noise *noise, int number, rx_blankcheck *dst, rx_error *err)
{
    rx_field *blank = NULL;
    rx_probe probe = {0};
    rx_status status =
        rx_blankcheck_field(options, field, noise, options->seed, NOISE + (uint64_t)number, &blank, err);
    if (status != RX_OK)
        return status;
    status = rx_probe_run(options, kind, blank, NULL, NULL, &probe, err);
    if (status == RX_OK) {
        dst->mpixels += searched(options, &probe, 0);
        dst->false_detections += probe.sources->n;
        dst->realisations++;
    }
    rx_probe_free(&probe);
    rx_field_free(blank);
    return status;
}

rx_status rx_blankcheck_run(const rx_options *options, const rx_restorer *kind, const rx_field *field,
                            const rx_sky_noise *noise, rx_log *log, rx_blankcheck *dst, rx_error *err)
{
    rx_status status = RX_OK;
    rx_options own = *options; /* detections are counted, not measured */
    own.measure.skip = RX_SKIP_APER | RX_SKIP_AUTO | RX_SKIP_PETRO | RX_SKIP_RADIUS | RX_SKIP_WIN;
    own.measure.nnw_file = NULL;
    own.measure.vignet_width = own.measure.vignet_height = 0;
    own.calibrate_none = own.calibrate_restored = 0;
    own.restore.keep_reblurred = 0;
    own.restore.keep_support = 0;
    own.templates.wanted = own.templates.drop;
    *dst = (rx_blankcheck){0};
    rx_log_progress_begin(log);
    for (int i = 0; i < options->blank_check && status == RX_OK; i++) {
        status = rx_interrupt_check(err);
        if (status == RX_OK)
            status = run_one(&own, kind, field, noise, i, dst, err);
        rx_log_progress(log, "blank check", (double)(i + 1) / options->blank_check);
    }
    rx_log_progress_end(log);
    if (status != RX_OK)
        return status;
    rx_estimate count = rx_poisson_interval(dst->false_detections, LEVEL);
    double area = dst->mpixels;
    dst->rate = (rx_estimate){.value = (double)dst->false_detections / area,
                              .low = count.low / area,
                              .high = count.high / area,
                              .n = dst->false_detections};
    dst->upper = rx_poisson_upper(dst->false_detections, LEVEL) / area;
    return RX_OK;
}

/* 1 - false / n within 0..1. */
static double share(double rate, double sky, long n)
{
    return fmin(fmax(1.0 - rate * sky / (double)n, 0.0), 1.0);
}

void rx_blankcheck_judge(const rx_options *options, const rx_probe *tile, rx_blankcheck *check)
{
    const long n = tile->sources->n;
    check->sky = searched(options, tile, 1);
    check->real = (rx_estimate){.value = NAN, .low = NAN, .high = NAN};
    if (n > 0 && check->realisations > 0)
        check->real = (rx_estimate){.value = share(check->rate.value, check->sky, n),
                                    .low = share(check->rate.high, check->sky, n),
                                    .high = share(check->rate.low, check->sky, n),
                                    .n = n};
}
