/* Mask- and edge-aware Richardson-Lucy. */
#include "restore/richardson_lucy.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "data/gaps.h"
#include "num/convolve.h"
#include "restore/stamp.h"

/* In units of the pedestal, the sky being 1. */
static const float MODEL_FLOOR = 0.05f;  /* a model below it (negative PSF wings) is no divisor */
static const float OBJECT_FLOOR = 1e-4f; /* f stays positive, or it could not come back */
static const float NORM_FLOOR = 1e-3f;   /* K^T W below it: nothing is known there */
/* A single pixel that held all flux of a star of the tile's peak is (peak of d) / (peak of the PSF); a
 * star with a masked core may be brighter. */
static const double BOUND = 1e4;
static const float KEPT = 0.1f; /* of a pixel that is carried on, at least */

/* How many rows of blocks of the sky are updated at a time, and how many rows of the model that takes: what
 * they see of it, and up to a block more. Threads share the blocks of a few rows out well enough. */
static void plan_strips(const rx_blur *blur, int whole, rx_rl *rl)
{
    enum { BLOCKS_OF_A_THREAD = 4 };
    const int wanted = BLOCKS_OF_A_THREAD * blur->nwork, across = blur->sky_x.n;
    rl->strip = whole ? blur->sky_y.n : rx_min_int((wanted + across - 1) / across, blur->sky_y.n);
    const size_t rows =
        (size_t)rl->strip * (size_t)blur->sky_y.step + 2 * (size_t)blur->margin + (size_t)blur->tile_y.step;
    rl->kept = whole || rows > (size_t)blur->height ? blur->height : (int)rows;
}

rx_status rx_rl_new(const rx_restore_params *par, const rx_prepared *prepared, const rx_blur *blur, int whole,
                    rx_rl **dst, rx_error *err)
{
    *dst = NULL;
    rx_rl *rl;
    RX_TRY(RX_MAKE(rl, 1, err));
    rl->prepared = prepared;
    rl->blur = blur;
    rl->bound = (float)fmin(BOUND * fmax(prepared->peak, 1), 1e12);
    plan_strips(blur, whole, rl);
    rl->object = rx_blur_sky(blur);
    rl->norm = rx_blur_sky(blur);
    rl->model = RX_NEW(float, (size_t)prepared->width *(size_t)rl->kept);
    rl->rows = RX_NEW(double, (size_t)prepared->height);
    rl->before = par->rl_accelerate ? rx_blur_sky(blur) : NULL;
    if (rl->object == NULL || rl->model == NULL || rl->norm == NULL || rl->rows == NULL ||
        (par->rl_accelerate && rl->before == NULL)) {
        rx_rl_free(rl);
        return rx_error_memory(err,
                               (3 + (size_t)par->rl_accelerate) * rx_blur_sky_size(blur) * sizeof(float));
    }
    rx_rl_reset(rl);
    rx_rl_normalise(rl);
    *dst = rl;
    return RX_OK;
}

void rx_rl_free(rx_rl *rl)
{
    if (rl == NULL)
        return;
    free(rl->object);
    free(rl->model);
    free(rl->norm);
    free(rl->rows);
    free(rl->before);
    free(rl);
}

void rx_rl_reset(rx_rl *rl)
{
    const size_t n = rx_blur_sky_size(rl->blur);
#pragma omp parallel for simd schedule(static) num_threads(rl->prepared->nthreads)
    for (size_t k = 0; k < n; k++)
        rl->object[k] = 1;
    rl->made = rl->updates = 0;
}

static void read_weight(void *user, int y, int x, int n, float *line)
{
    const float *weight = rx_prepared_weight(((const rx_rl *)user)->prepared, y, x, n, line);
    if (weight != line)
        memcpy(line, weight, (size_t)n * sizeof *line);
}

static size_t sky_at(const rx_blur *blur, int y, int x)
{
    return rx_blur_row(blur, y) - (size_t)blur->margin + (size_t)(x + blur->margin);
}

static void write_norm(void *user, int y, int x, int n, const float *line)
{
    const rx_rl *rl = user;
    memcpy(rl->norm + sky_at(rl->blur, y, x), line, (size_t)n * sizeof *line);
}

void rx_rl_normalise(rx_rl *rl)
{
    rx_blur_adjoint(rl->blur, &(rx_blur_lines){read_weight, write_norm, rl});
}

/* Where pixel (x, y) of the model is. */
static float *model_at(const rx_rl *rl, int y, int x)
{
    return rl->model + (size_t)(y % rl->kept) * (size_t)rl->prepared->width + (size_t)x;
}

static void read_object(void *user, int y, int x, int n, float *line)
{
    const rx_rl *rl = user;
    memcpy(line, rl->object + sky_at(rl->blur, y, x), (size_t)n * sizeof *line);
}

static void write_model(void *user, int y, int x, int n, const float *line)
{
    memcpy(model_at(user, y, x), line, (size_t)n * sizeof *line);
}

/* The model's rows up to `end`, in whole rows of blocks. */
static void make_model(rx_rl *rl, int end)
{
    const int step = rl->blur->tile_y.step, first = (rl->made + step - 1) / step,
              last = (end + step - 1) / step;
    if (end <= rl->made)
        return;
    rx_blur_apply_rows(rl->blur, &(rx_blur_lines){read_object, write_model, rl}, first, last);
    rl->made = rx_min_int(last * step, rl->prepared->height);
}

void rx_rl_model(rx_rl *rl)
{
    rl->made = 0;
    make_model(rl, rl->prepared->height);
}

/* Sum over good pixels of n from (x, y) on, added to `sum` in their order. */
static double add_chi2(const rx_rl *rl, int y, int x, int n, double sum)
{
    const rx_prepared *prepared = rl->prepared;
    float room[RX_MAP_PIECE], variance[RX_MAP_PIECE];
    const size_t k = (size_t)y * (size_t)prepared->width + (size_t)x;
    const float *data = rx_prepared_data(prepared, y, x, n, room), *model = model_at(rl, y, x);
    const float photon = (float)prepared->photon;
    rx_prepared_variance(prepared, y, x, n, variance);
    for (int i = 0; i < n; i++) {
        const float residual = data[i] - model[i];
        const float whole = variance[i] + photon * fmaxf(model[i] - 1, 0);
        if (prepared->mask[k + (size_t)i] == 0)
            sum += (double)residual * residual / whole;
    }
    return sum;
}

double rx_rl_chi2(rx_rl *rl)
{
    const rx_prepared *prepared = rl->prepared;
    const int width = prepared->width, height = prepared->height, whole = rl->kept == height;
    if (!whole)
        rl->made = 0;
    for (int from = 0, to; from < height; from = to) {
        make_model(rl, whole ? height : from + 1);
        to = rl->made;
#pragma omp parallel for schedule(static) num_threads(prepared->nthreads)
        for (int y = from; y < to; y++) {
            double sum = 0;
            for (int x = 0; x < width; x += RX_MAP_PIECE)
                sum = add_chi2(rl, y, x, rx_map_piece(x, width), sum);
            rl->rows[y] = sum;
        }
    }
    if (!whole)
        rl->made = 0;
    double sum = 0;
    for (int y = 0; y < height; y++)
        sum += rl->rows[y];
    return sum / (double)prepared->good;
}

/* dst = W (d - m) / m */
RX_SIMD static void plain_residual(const float *restrict data, const float *restrict weight,
                                   const float *restrict model, int n, float *restrict dst)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float m = model[i] > MODEL_FLOOR ? model[i] : MODEL_FLOOR;
        dst[i] = weight[i] * ((data[i] - m) / m);
    }
}

void rx_rl_residual(const rx_rl *rl, int y, int x, int n, float *dst)
{
    const rx_prepared *prepared = rl->prepared;
    for (int end = x + n; x < end; x += RX_MAP_PIECE, dst += RX_MAP_PIECE) {
        float data_room[RX_MAP_PIECE], weight_room[RX_MAP_PIECE];
        const int count = rx_map_piece(x, end);
        const float *data = rx_prepared_data(prepared, y, x, count, data_room),
                    *weight = rx_prepared_weight(prepared, y, x, count, weight_room),
                    *model = model_at(rl, y, x);
        plain_residual(data, weight, model, count, dst);
    }
}

static void read_residual(void *user, int y, int x, int n, float *line)
{
    rx_rl_residual(user, y, x, n, line);
}

/* f moves by its change, where that is known. */
RX_SIMD static void move(const float *restrict change, const float *restrict norm, float bound, int n,
                         float *restrict f)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float known = norm[i] > NORM_FLOOR ? 1 : 0;
        const float safe = norm[i] > NORM_FLOOR ? norm[i] : 1;
        const float next = f[i] * (1 + known * (change[i] / safe));
        f[i] = next > OBJECT_FLOOR ? (next < bound ? next : bound) : OBJECT_FLOOR;
    }
}

/* f on along its last step. */
RX_SIMD static void carry(float a, float bound, int n, float *restrict f, float *restrict before)
{
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float now = f[i], on = now + a * (now - before[i]);
        const float least = KEPT * now > OBJECT_FLOOR ? KEPT * now : OBJECT_FLOOR;
        f[i] = on > least ? (on < bound ? on : bound) : least;
        before[i] = now;
    }
}

static void move_object(void *user, int y, int x, int n, const float *change)
{
    const rx_rl *rl = user;
    const size_t k = sky_at(rl->blur, y, x);
    move(change, rl->norm + k, rl->bound, n, rl->object + k);
    if (rl->before != NULL)
        carry(rl->carried, rl->bound, n, rl->object + k, rl->before + k);
}

void rx_rl_update(rx_rl *rl, int last)
{
    const rx_blur_axis *sky = &rl->blur->sky_y;
    rl->carried = last ? 0 : (float)rl->updates / (float)(rl->updates + 9);
    rl->updates++;
    /* What is not made of the model yet reads only rows of the object that have not moved. */
    for (int first = 0; first < sky->n; first += rl->strip) {
        const int end = rx_min_int(first + rl->strip, sky->n);
        make_model(rl, rx_min_int(rx_min_int(sky->begin + end * sky->step, sky->end) + rl->blur->margin,
                                  rl->prepared->height));
        rx_blur_adjoint_rows(rl->blur, &(rx_blur_lines){read_residual, move_object, rl}, first, end);
    }
    rl->made = 0;
}

/* Good pixels in, what is left of the sky's light on them out. */
typedef struct share {
    const rx_prepared *prepared;
    float *support;
} share;

static void read_good(void *user, int y, int x, int n, float *line)
{
    const rx_prepared *prepared = ((const share *)user)->prepared;
    const uint8_t *mask = prepared->mask + (size_t)y * (size_t)prepared->width + (size_t)x;
    for (int i = 0; i < n; i++)
        line[i] = mask[i] == 0 ? 1 : 0;
}

static void write_support(void *user, int y, int x, int n, const float *line)
{
    const share *s = user;
    const int width = s->prepared->width, height = s->prepared->height;
    for (int i = 0; i < n && y >= 0 && y < height; i++) {
        const float lost = 1 - line[i];
        if (x + i >= 0 && x + i < width)
            s->support[(size_t)y * (size_t)width + (size_t)(x + i)] = lost < RX_SUPPORT_FLOOR ? 0
                                                                      : lost > 1              ? 1
                                                                                              : lost;
    }
}

/* A plane of the tile's pixels, rows `stride` apart, back in ADU above the sky. */
static void take(const rx_rl *rl, const float *plane, size_t stride, const uint8_t *mask, float *dst)
{
    const rx_prepared *prepared = rl->prepared;
#pragma omp parallel for schedule(static) num_threads(prepared->nthreads)
    for (int y = 0; y < prepared->height; y++) {
        const float *line = plane + (size_t)y * stride;
        for (int x = 0; x < prepared->width; x++) {
            const size_t k = (size_t)y * prepared->width + x;
            const double value = (line[x] - 1.0) * prepared->pedestal;
            dst[k] = mask != NULL && mask[k] != 0 ? 0 : (float)fmax(-FLT_MAX, fmin(FLT_MAX, value));
        }
    }
}

/* Iterate to the end asked for; leaves K f in rl->model, where that is kept. */
static rx_status iterate(const rx_restore_params *par, rx_rl *rl, const char *name, rx_log *log,
                         rx_restored *restored, rx_error *err)
{
    rx_status status = RX_OK;
    rx_log_progress_begin(log);
    for (int i = 0;; i++) {
        if ((status = rx_interrupt_check(err)) != RX_OK)
            break;
        const int last = i >= par->rl_niter;
        if (last || (par->rl_stop_discrepancy && i > 0))
            restored->chi2 = rx_rl_chi2(rl);
        restored->iterations = i;
        if (last || (par->rl_stop_discrepancy && i > 0 && restored->chi2 <= 1))
            break;
        rx_rl_update(rl, i + 1 >= par->rl_niter);
        rx_log_progress(log, name, (i + 1.0) / par->rl_niter);
    }
    rx_log_progress_end(log);
    return status;
}

static void describe(const rx_restore_params *par, const rx_prepared *prepared, const char *settings,
                     rx_restored *dst)
{
    snprintf(dst->settings, sizeof dst->settings,
             "RL_NITER %d%s, RL_STOP %s, RL_DENOISE %.4g pixels, RL_PEDESTAL %g (used: %.4g "
             "ADU)%s%s",
             par->rl_niter, par->rl_accelerate ? ", RL_ACCELERATE Y" : "",
             par->rl_stop_discrepancy ? "DISCREPANCY" : "NITER", par->rl_denoise, par->rl_pedestal,
             prepared->pedestal, settings[0] != '\0' ? ", " : "", settings);
}

static rx_status new_restored(const rx_restore_params *par, const rx_prepared *prepared, const char *name,
                              rx_restored **dst, rx_error *err)
{
    const size_t n = (size_t)prepared->width * (size_t)prepared->height;
    rx_restored *restored = *dst = rx_restored_bare(name, prepared->width, prepared->height);
    if (restored == NULL)
        return rx_error_memory(err, n * sizeof(float));
    restored->support = par->keep_support ? RX_NEW(float, n) : NULL;
    restored->reblurred = par->keep_reblurred ? RX_NEW(float, n) : NULL;
    restored->psf = rx_stamp_gauss(par->rl_denoise);
    restored->blur = rx_psf_copy(prepared->image.psf);
    if (restored->psf == NULL || restored->blur == NULL || (par->keep_support && restored->support == NULL) ||
        (par->keep_reblurred && restored->reblurred == NULL))
        return rx_error_memory(err, 3 * n * sizeof(float));
    return RX_OK;
}

/* The restored planes from a tile with good pixels; rl and blur are gone before the denoising. */
static rx_status restore_planes(const rx_restore_params *par, const rx_prepared *prepared, rx_log *log,
                                rx_restored *restored, rx_error *err)
{
    const size_t n = (size_t)prepared->width * (size_t)prepared->height;
    rx_blur *blur = NULL;
    rx_rl *rl = NULL;
    share support = {prepared, restored->support};
    rx_status status;
    RX_TRY_EXIT(
        rx_blur_new(prepared->image.psf, prepared->width, prepared->height, prepared->nthreads, &blur, err));
    RX_TRY_EXIT(rx_rl_new(par, prepared, blur,
                          n <= RX_RL_WHOLE || restored->reblurred != NULL || par->rl_stop_discrepancy, &rl,
                          err));
    RX_TRY_EXIT(iterate(par, rl, restored->name, log, restored, err));
    if (restored->reblurred != NULL)
        take(rl, rl->model, (size_t)prepared->width, NULL, restored->reblurred);
    /* before the restored planes are touched for the first time */
    free(rl->model);
    free(rl->norm);
    free(rl->before);
    rl->model = rl->norm = rl->before = NULL;
    if (restored->support != NULL)
        rx_blur_adjoint(blur, &(rx_blur_lines){read_good, write_support, &support});
    restored->pixels = rx_alloc_filled(n, sizeof *restored->pixels, prepared->nthreads);
    if (restored->pixels == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof *restored->pixels));
    take(rl, rl->object + rx_blur_row(blur, 0), (size_t)(prepared->width + 2 * blur->margin), restored->mask,
         restored->pixels);
exit:
    rx_rl_free(rl);
    rx_blur_free(blur);
    return status;
}

/* Into a mask of zeros: where nothing is masked it stays untouched and takes no memory. */
static void copy_mask(const uint8_t *src, size_t n, uint8_t *dst)
{
    static const uint8_t clear[RX_MAP_PIECE];
    for (size_t k = 0; k < n; k += RX_MAP_PIECE) {
        const size_t count = n - k < RX_MAP_PIECE ? n - k : RX_MAP_PIECE;
        if (memcmp(src + k, clear, count) != 0)
            memcpy(dst + k, src + k, count);
    }
}

rx_status rx_rl_restore(const rx_restore_params *wanted, const rx_prepared *prepared, const char *name,
                        const char *settings, rx_log *log, rx_restored **dst, rx_error *err)
{
    const rx_psf *psf = prepared->image.psf;
    const double begun = rx_seconds();
    const size_t n = (size_t)prepared->width * (size_t)prepared->height;
    rx_restored *restored = NULL;
    rx_restore_params used = *wanted;
    const rx_restore_params *par = &used;
    *dst = NULL;
    rx_status status = rx_blur_check(psf, prepared->width, prepared->height, err);
    if (status == RX_OK && wanted->rl_denoise_by_psf) {
        used.rl_denoise *= psf->fwhm;
        used.rl_denoise_by_psf = 0;
    }
    if (status == RX_OK)
        status = new_restored(par, prepared, name, &restored, err);
    if (status == RX_OK) /* under wide masks is no estimate of the light, in gaps there is */
        status = rx_gaps_find(prepared->mask, prepared->width, prepared->height, psf->fwhm, 0,
                              &restored->gaps, err);
    if (status != RX_OK)
        goto exit;
    copy_mask(prepared->mask, n, restored->mask);
    rx_gaps_mark(restored->gaps, 0, restored->mask);
    if (prepared->good == 0) {
        rx_log_warning(log, "%s: every pixel is masked, nothing to restore", name);
        for (size_t k = 0; restored->support != NULL && k < n; k++)
            restored->support[k] = 1;
        restored->pixels = RX_NEW(float, n);
        if (restored->pixels == NULL)
            status = rx_error_memory(err, n * sizeof *restored->pixels);
    } else if ((status = restore_planes(par, prepared, log, restored, err)) == RX_OK) {
        status = rx_gauss_masked(prepared->width, prepared->height, par->rl_denoise, restored->mask,
                                 prepared->nthreads, restored->pixels, err);
    }
    describe(par, prepared, settings, restored);
    restored->seconds = rx_seconds() - begun;
exit:
    if (status != RX_OK) {
        rx_restored_free(restored);
        return status;
    }
    rx_log_detail(log, "%s: %d iterations, reduced chi2 %.3f, %.3f s", name, restored->iterations,
                  restored->chi2, restored->seconds);
    *dst = restored;
    return RX_OK;
}

rx_status rx_rl_run(const rx_restore_params *par, const rx_image *image, rx_log *log, rx_restored **dst,
                    rx_error *err)
{
    rx_prepared *prepared = NULL;
    *dst = NULL;
    rx_status status = rx_prepared_new(par, image, &prepared, err);
    if (status == RX_OK)
        status = rx_rl_restore(par, prepared, "RL", "", log, dst, err);
    rx_prepared_free(prepared);
    return status;
}
