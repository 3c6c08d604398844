/* One tile of the detection campaign through every method. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "check/quality.h"
#include "lab/detection.h"
#include "lab/unit_row.h"
#include "pipeline/pipeline.h"
#include "quality/match.h"

/* What one unit works on. */
typedef struct work {
    const rx_detection_state *state;
    const rx_detection_sky *sky;
    rx_detection_scene scene;
    const rx_detection_tile *tile;
    rx_unit_row *r;
} work;

int rx_detection_columns(rx_detection_scene scene)
{
    return scene == RX_SCENE_PLATEAU ? 3 : scene == RX_SCENE_OUTSKIRTS ? 2 * RX_OUTSKIRT_RADII : 1;
}

/* What a filter leaves of the noise of independent pixels. */
static double norm(const float *filter, int n)
{
    double sum = 0, power = 0;
    for (int i = 0; i < n; i++) {
        sum += fabs((double)filter[i]);
        power += (double)filter[i] * (double)filter[i];
    }
    return n > 0 ? sqrt(power) / sum : 1;
}

static rx_options options_of(const work *w, const rx_detection_method *method)
{
    rx_options options = *w->state->options;
    if (method->matched) { /* a threshold of k sigmas means k sigmas of the unfiltered noise: the same S/N
                              here */
        const double now = norm(options.pipeline.detect.filter,
                                options.pipeline.detect.filter_width * options.pipeline.detect.filter_height);
        options.pipeline.detect.threshold *= norm(w->sky->kernel, w->sky->side * w->sky->side) / now;
        options.pipeline.detect.filter = w->sky->kernel;
        options.pipeline.detect.filter_width = options.pipeline.detect.filter_height = w->sky->side;
        options.pipeline.detect.filter_normalise = 1;
        options.pipeline.detect.matched = 0;
    }
    if (strcmp(method->restorer->name, "NET") == 0) {
        options.pipeline.detect.threshold *= w->state->config->net_depth;
        options.pipeline.detect.analysis_threshold *= w->state->config->net_depth;
    }
    if (method->tuned) {
        options.pipeline.restore.rl_niter = method->niter;
        options.pipeline.restore.rl_stop_discrepancy = 0;
        options.pipeline.restore.rl_denoise = method->filter;
        options.pipeline.restore.rl_denoise_by_psf = 1;
    }
    return options;
}

/* --- lists --- */

static int wanted(const work *w, long i)
{
    const rx_tile *tile = w->tile->field->tile;
    const double x = w->tile->x[i], y = w->tile->y[i];
    if (w->scene == RX_SCENE_RINGS)
        return 1;
    return rx_detection_scene_is_list(w->scene) && w->tile->snr[i] >= w->state->config->truth_snr && x >= 0 &&
           y >= 0 && x <= tile->width - 1 && y <= tile->height - 1;
}

static double nearest_object(const work *w, double x, double y)
{
    double least = HUGE_VAL;
    for (long i = 0; i < w->tile->n; i++)
        least = fmin(least, hypot(x - w->tile->x[i], y - w->tile->y[i]));
    return w->scene == RX_SCENE_RINGS && w->tile->n > 0 ? least / w->sky->fwhm : 0;
}

static void add_list(const work *w, const rx_qa_list *list, const unsigned char *use, const long *found,
                     const long *taken, const long *faint)
{
    long nfalse = 0;
    for (long i = 0; i < w->tile->n; i++)
        if (use[i])
            rx_unit_row_add(w->r, found[i] >= 0 ? list->score[found[i]] : NAN);
    for (long k = 0; k < list->n; k++)
        nfalse += taken[k] < 0 && faint[k] < 0;
    rx_unit_row_add(w->r, (double)nfalse);
    for (long k = 0; k < list->n; k++)
        if (taken[k] < 0 && faint[k] < 0) {
            rx_unit_row_add(w->r, list->score[k]);
            rx_unit_row_add(w->r, nearest_object(w, list->x[k], list->y[k]));
        }
}

/* Objects that are to be found take detections first; what is left may belong to others. */
static rx_status judge_list(const work *w, const rx_qa_list *list, double radius, rx_error *err)
{
    const size_t n = (size_t)w->tile->n, m = (size_t)list->n;
    rx_status status = RX_OK;
    unsigned char *use = RX_NEW(unsigned char, n), *other = RX_NEW(unsigned char, n),
                  *left = RX_NEW(unsigned char, m);
    long *found = RX_NEW(long, n), *taken = RX_NEW(long, m), *none = RX_NEW(long, n),
         *faint = RX_NEW(long, m);
    if (!use || !other || !left || !found || !taken || !none || !faint) {
        status = rx_error_memory(err, (2 * n + 2 * m) * sizeof(long));
        goto exit;
    }
    for (size_t i = 0; i < n; i++)
        other[i] = !(use[i] = wanted(w, (long)i) != 0);
    const double *x = w->tile->x, *y = w->tile->y;
    status = rx_match(&(rx_match_list){w->tile->n, x, y, use},
                      &(rx_match_list){list->n, list->x, list->y, NULL}, radius, found, taken, err);
    for (size_t k = 0; k < m && status == RX_OK; k++)
        left[k] = taken[k] < 0;
    if (status == RX_OK)
        status = rx_match(&(rx_match_list){w->tile->n, x, y, other},
                          &(rx_match_list){list->n, list->x, list->y, left}, radius, none, faint, err);
    if (status == RX_OK)
        add_list(w, list, use, found, taken, faint);
exit:
    free(use);
    free(other);
    free(left);
    free(found);
    free(taken);
    free(none);
    free(faint);
    return status;
}

/* The detection nearest to an object, within the radius, or -1. */
static long nearest_detection(const rx_qa_list *list, double x, double y, double radius)
{
    long best = -1;
    for (long k = 0; k < list->n; k++) {
        const double d = hypot(list->x[k] - x, list->y[k] - y);
        if (d <= radius) {
            best = k;
            radius = d;
        }
    }
    return best;
}

static double separation(const rx_detection_tile *tile, long pair)
{
    return hypot(tile->x[2 * pair] - tile->x[2 * pair + 1], tile->y[2 * pair] - tile->y[2 * pair + 1]);
}

static void judge_pairs(const work *w, const rx_qa_list *list, double radius)
{
    for (long p = 0; p < w->tile->n / 2; p++) {
        const double reach = fmin(radius, 0.5 * separation(w->tile, p));
        const long a = nearest_detection(list, w->tile->x[2 * p], w->tile->y[2 * p], reach);
        const long b = nearest_detection(list, w->tile->x[2 * p + 1], w->tile->y[2 * p + 1], reach);
        rx_unit_row_add(w->r, a >= 0 && b >= 0 && a != b ? fmin(list->score[a], list->score[b]) : NAN);
    }
    rx_unit_row_add(w->r, 0);
}

static rx_status detect(const work *w, const rx_detection_method *method, rx_error *err)
{
    const rx_options options = options_of(w, method);
    rx_result result;
    rx_qa_list list = {0};
    double radius = 0;
    rx_status status =
        rx_field_extract(&options.pipeline, method->restorer, w->tile->field, NULL, NULL, &result, err);
    if (status != RX_OK)
        return status;
    status = rx_quality_list(&options.check.quality, w->tile->field->tile, result.sources, &list, err);
    if (status == RX_OK)
        status = rx_quality_radius(&options.check.quality, w->tile->field->tile, &radius, err);
    if (status == RX_OK && w->scene == RX_SCENE_PAIRS)
        judge_pairs(w, &list, radius);
    else if (status == RX_OK)
        status = judge_list(w, &list, radius, err);
    rx_qa_list_free(&list);
    rx_result_free(&result);
    return status;
}

/* --- pixels --- */

/* rms of the means of side x side phases about their mean, and their range. */
static void phases(const float *pixels, int width, int x0, int y0, int box, int side, double *rms,
                   double *range)
{
    double sum[16] = {0}, mean = 0, low = HUGE_VAL, high = -HUGE_VAL;
    const int n = side * side;
    for (int y = 0; y < box; y++)
        for (int x = 0; x < box; x++)
            sum[y % side * side + x % side] +=
                (double)pixels[(size_t)(y0 + y) * (size_t)width + (size_t)(x0 + x)];
    for (int i = 0; i < n; i++) {
        sum[i] /= (double)box * box / n;
        mean += sum[i] / n;
        low = fmin(low, sum[i]);
        high = fmax(high, sum[i]);
    }
    *rms = 0;
    for (int i = 0; i < n; i++)
        *rms += (sum[i] - mean) * (sum[i] - mean) / n;
    *rms = sqrt(*rms);
    *range = high - low;
}

static void measure_plateau(const work *w, const float *pixels)
{
    const rx_tile *tile = w->tile->field->tile;
    const int least = tile->width < tile->height ? tile->width : tile->height, box = least / 16 * 4;
    double rms2, rms4, range;
    phases(pixels, tile->width, (tile->width - box) / 2, (tile->height - box) / 2, box, 2, &rms2, &range);
    phases(pixels, tile->width, (tile->width - box) / 2, (tile->height - box) / 2, box, 4, &rms4, &range);
    rx_unit_row_add(w->r, rms2 / w->sky->sigma);
    rx_unit_row_add(w->r, rms4 / w->sky->sigma);
    rx_unit_row_add(w->r, range / w->sky->sigma);
    rx_unit_row_add(w->r, 0);
}

/* Sum within a radius; pixels on the edge with the share of 5 x 5 points that are inside. */
static double aperture(const float *pixels, int width, int height, double x, double y, double radius)
{
    enum { FINE = 5 };
    double sum = 0;
    const int x0 = (int)fmax(floor(x - radius), 0), x1 = (int)fmin(ceil(x + radius), width - 1);
    const int y0 = (int)fmax(floor(y - radius), 0), y1 = (int)fmin(ceil(y + radius), height - 1);
    for (int v = y0; v <= y1; v++)
        for (int u = x0; u <= x1; u++) {
            int inside = 0;
            for (int k = 0; k < FINE * FINE; k++)
                inside += hypot(u - x + (k % FINE + 0.5) / FINE - 0.5,
                                v - y + (k / FINE + 0.5) / FINE - 0.5) <= radius;
            sum += (double)pixels[(size_t)v * (size_t)width + (size_t)u] * inside / (FINE * FINE);
        }
    return sum;
}

static void measure_outskirts(const work *w, const float *pixels, int restored)
{
    const rx_detection_tile *t = w->tile;
    const int width = t->field->tile->width, height = t->field->tile->height;
    for (long i = 0; i < t->n; i++) {
        const double r50 = hypot(t->radius[i], 0.5 * w->sky->fwhm);
        for (int which = 0; which < 2; which++)
            for (int k = 0; k < RX_OUTSKIRT_RADII; k++)
                rx_unit_row_add(w->r, aperture(which ? t->truth[restored] : pixels, width, height, t->x[i],
                                               t->y[i], r50 * (1 << k)) /
                                          t->flux[i]);
    }
    rx_unit_row_add(w->r, 0);
}

static rx_status measure(const work *w, const rx_detection_method *method, rx_error *err)
{
    const rx_options options = options_of(w, method);
    const rx_field *field = w->tile->field;
    const int plain = strcmp(method->restorer->name, "NONE") == 0;
    rx_restored *restored = NULL;
    rx_image image = plain ? rx_field_observed(field) : rx_field_restorable(field);
    image.hide = options.pipeline.restore.mask_saturated ? RX_HIDE_RESTORED : RX_HIDE_PLAIN;
    rx_status status = method->restorer->run(&options.pipeline.restore, &image, NULL, &restored, err);
    if (status != RX_OK)
        return status;
    if (w->scene == RX_SCENE_PLATEAU)
        measure_plateau(w, restored->pixels);
    else
        measure_outskirts(w, restored->pixels, !plain);
    rx_restored_free(restored);
    return RX_OK;
}

/* --- units --- */

static void add_objects(const work *w)
{
    const rx_detection_tile *tile = w->tile;
    const double mpixels = 1e-6 * (double)tile->field->tile->width * (double)tile->field->tile->height;
    long n = 0;
    if (w->scene == RX_SCENE_PLATEAU) {
        const double head[] = {1, mpixels, w->state->config->plateau_snr, 0};
        for (int i = 0; i < 4; i++)
            rx_unit_row_add(w->r, head[i]);
        return;
    }
    const int pairs = w->scene == RX_SCENE_PAIRS, all = w->scene == RX_SCENE_OUTSKIRTS;
    for (long i = 0; i < tile->n; i++)
        n += pairs ? i % 2 : all || wanted(w, i);
    rx_unit_row_add(w->r, (double)n);
    rx_unit_row_add(w->r, mpixels);
    for (long i = 0; i < tile->n; i++) {
        if (!(pairs ? i % 2 : all || wanted(w, i)))
            continue;
        rx_unit_row_add(w->r, pairs ? fmin(tile->snr[i], tile->snr[i - 1]) : tile->snr[i]);
        rx_unit_row_add(w->r, pairs ? separation(tile, i / 2) / w->sky->fwhm : 0);
    }
}

rx_status rx_detection_unit(const rx_detection_state *state, long unit, rx_unit_values *dst, rx_error *err)
{
    const long set = unit / state->ntiles;
    const int condition = (int)(set / state->nscenes);
    rx_unit_row r = {.values = dst};
    rx_detection_tile tile;
    const work w = {state, &state->sky[condition], state->scene[set % state->nscenes], &tile, &r};
    rx_status status = rx_detection_tile_make(state, condition, w.scene, unit % state->ntiles, &tile, err);
    if (status != RX_OK)
        return status;
    add_objects(&w);
    for (int m = 0; m < state->nmethods && status == RX_OK; m++) {
        const int pixels = w.scene == RX_SCENE_PLATEAU || w.scene == RX_SCENE_OUTSKIRTS;
        status = pixels ? measure(&w, &state->method[m], err) : detect(&w, &state->method[m], err);
    }
    rx_detection_tile_free(&tile);
    return status == RX_OK ? rx_unit_row_status(&r, err) : status;
}
