/* A trained network on a tile, block by block. */
#include "restore/network.h"

#include <float.h>
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/wide.h"
#include "data/map.h"
#include "nn/flat_sky.h"
#include "restore/blur.h"
#include "restore/network_forward.h"
#include "restore/network_optics.h"
#include "restore/network_report.h"
#include "restore/noise_map.h"
#include "restore/prepared.h"
#include "restore/stamp.h"

/* Of the FFTs, output pixels: not NET_BLOCK, so that this changes no bit. Large domains have little halo;
 * small tiles need two of them to be shared among threads. */
enum { DOMAIN_SIDE = 1024, LARGE_TILE = 2048 };
static const double UNKNOWN_FWHM = 5; /* pixels, of a PSF that nobody knows: middle of the usual seeing */
/* of a pixel's value: 250,000 electrons, about what a pixel of a detector holds at most */
static const double FULL_WELL_NOISE = 1.0 / 500;
/* sigmas, INFORMED; what FFTs round may tip over the rounding of a bfloat16, which is 50,000 times
 * coarser */
static const double SEAM_LIMIT = 1e-3, SEAM_LIMIT_BF16 = 0.5;
/* of the noise map: a faint source that the network believes in has pixels this much fainter than one of the
 * same significance has among the noise (measured: network.h) */
static const float DETECTABLE = 0.6f;

/* One restoration of a tile: on one grid of blocks. */
typedef struct network {
    const rx_restore_params *par;
    const rx_model *model;
    const rx_tile *tile;
    const rx_background *background;
    const rx_psf *psf; /* NULL: not known */
    rx_log *log;
    rx_restored *restored;
    rx_blocks blocks;  /* of the network */
    rx_blocks domains; /* of the FFTs */
    int nthreads;
    rx_coarse scale;
    rx_network_optics *optics;  /* NULL without a PSF */
    float *x;                   /* data: restored->support until that is made, or its own */
    float *v;                   /* what the network, later the step makes; it becomes restored->pixels */
    float *spare;               /* Tikhonov copy, then target of the step; the two change places */
    rx_network_forward forward; /* its planes are set when it runs */
    double clock;               /* seconds: when the last part of the work ended */
    rx_network_times times;
} network;

/* The time since the last call belongs to that part. */
static void lap(network *n, double *part)
{
    const double now = rx_seconds();
    *part += now - n->clock;
    n->clock = now;
}

static int unit_of(const rx_model *model)
{
    return 2 << rx_net_levels(model->restore);
}

static rx_status check_input(const rx_restore_params *par, const rx_psf *psf, rx_error *err)
{
    if (par->model == NULL)
        return rx_error_set(err, RX_USAGE, "no model is given for the restorer NET; name one by NET_MODEL");
    if (psf == NULL && par->model->front.mode == RX_MODE_BLIND)
        return RX_OK;
    /* unlike Richardson-Lucy the network takes tiles smaller than the PSF */
    return rx_blur_check(psf, psf != NULL ? psf->size : 0, psf != NULL ? psf->size : 0, err);
}

/* v = network(x, w) */
static rx_status run_network(network *n, double begin, double end, rx_error *err)
{
    rx_network_forward forward = n->forward;
    forward.optics = n->optics;
    forward.x = n->x;
    if (n->model->front.mode == RX_MODE_INFORMED)
        forward.base = forward.spent = n->spare;
    else
        forward.base = n->x;
    forward.v = n->v;
    return rx_network_forward_run(&forward, &n->blocks, n->log, begin, end, err);
}

static rx_status make_optics(network *n, rx_error *err)
{
    const rx_front *front = &n->model->front;
    if (n->psf == NULL)
        return RX_OK;
    return rx_network_optics_new(n->psf, front->target_fwhm,
                                 front->mode == RX_MODE_INFORMED ? front->tikhonov : 0, n->tile->width,
                                 n->tile->height, &n->domains, n->nthreads, &n->optics, err);
}

static rx_status run_steps(network *n, rx_error *err)
{
    const rx_front *front = &n->model->front;
    const int steps = front->mode == RX_MODE_INFORMED ? front->rl_steps : 0;
    rx_status status = RX_OK;
    for (int i = 0; i < steps && status == RX_OK; i++) {
        status = rx_network_optics_step(n->optics, n->v, n->x, n->restored->mask, front->pedestal, n->spare,
                                        n->log, 0.8 + 0.1 * i / steps, 0.8 + 0.1 * (i + 1) / steps, err);
        float *done = n->v;
        n->v = n->spare;
        n->spare = done;
    }
    return status;
}

RX_WIDE static void row_to_adu(int n, const float *restrict unit, const uint8_t *restrict mask,
                               float *restrict v)
{
#pragma omp simd
    for (int x = 0; x < n; x++) {
        const double value = (double)rx_front_shown(v[x]) * (double)unit[x];
        v[x] = (float)value;
    }
    /* one choice in a loop, or it does not become vectors; v >= -1/2 before it was scaled */
#pragma omp simd
    for (int x = 0; x < n; x++)
        v[x] = v[x] > FLT_MAX ? FLT_MAX : v[x];
#pragma omp simd
    for (int x = 0; x < n; x++)
        v[x] = v[x] < -FLT_MAX ? -FLT_MAX : v[x];
    for (int x = 0; x < n; x++)
        if (mask[x] != 0)
            v[x] = 0;
}

/* Noise units become ADU, 0 under the mask. units[nthreads][width]: scratch. */
static void to_adu(const network *n, float *units)
{
    const size_t width = (size_t)n->tile->width;
#pragma omp parallel for schedule(static) num_threads(n->nthreads)
    for (int y = 0; y < n->tile->height; y++) {
        float *unit = units + (size_t)omp_get_thread_num() * width;
        rx_coarse_row(&n->scale, y, 0, n->tile->width, unit);
        row_to_adu(n->tile->width, unit, n->restored->mask + (size_t)y * width, n->v + (size_t)y * width);
    }
}

/* The planes of the restored tile take their places; what is left of the scratch goes. */
static rx_status finish(network *n, double fwhm, rx_error *err)
{
    rx_restored *restored = n->restored;
    float *units = RX_NEW(float, (size_t)n->tile->width *(size_t)n->nthreads);
    if (units == NULL)
        return rx_error_memory(err, (size_t)n->tile->width * (size_t)n->nthreads * sizeof *units);
    rx_flat_sky(n->tile->width, n->tile->height, fwhm, n->nthreads, n->v, n->spare);
    to_adu(n, units);
    free(units);
    restored->pixels = n->v;
    free(n->spare);
    n->spare = NULL;
    return rx_noise_map(n->tile, n->background, restored->mask, DETECTABLE, n->nthreads, &restored->noise,
                        err);
}

/* A Gaussian of the usual seeing tells what the mask has taken where the PSF is not known. The data go. */
static rx_status make_support(network *n, int wanted, rx_error *err)
{
    rx_restored *restored = n->restored;
    if (!wanted) {
        free(restored->support);
        restored->support = n->x = NULL;
        return RX_OK;
    }
    if (n->optics != NULL)
        return rx_network_optics_support(n->optics, restored->mask, restored->support, n->log, 0.95, 1, err);
    rx_psf *psf = rx_stamp_gauss(UNKNOWN_FWHM);
    rx_network_optics *optics = NULL;
    if (psf == NULL)
        return rx_error_memory(err, 0);
    rx_status status = rx_network_optics_new(psf, n->model->front.target_fwhm, 0, n->tile->width,
                                             n->tile->height, &n->domains, n->nthreads, &optics, err);
    if (status == RX_OK)
        status = rx_network_optics_support(optics, restored->mask, restored->support, n->log, 0.95, 1, err);
    rx_network_optics_free(optics);
    rx_psf_free(psf);
    return status;
}

static rx_status restore_planes(network *n, int extras, rx_error *err)
{
    const double fwhm = n->psf != NULL && n->psf->fwhm > 0 ? n->psf->fwhm : UNKNOWN_FWHM;
    rx_restored *restored = n->restored;
    rx_status status = rx_network_scale(n->tile, n->background, restored->mask, n->nthreads, &n->scale, err);
    if (status == RX_OK)
        status = rx_network_data(n->tile, n->background, restored->mask, &n->scale, fwhm, &n->domains,
                                 n->nthreads, n->x, err);
    if (status == RX_OK)
        status = make_optics(n, err);
    lap(n, &n->times.rest);
    if (status == RX_OK && n->model->front.mode == RX_MODE_INFORMED)
        status = rx_network_optics_tikhonov(n->optics, n->x, n->spare, n->log, 0, 0.1, err);
    lap(n, &n->times.tikhonov);
    if (status == RX_OK)
        status = run_network(n, 0.1, 0.8, err);
    lap(n, &n->times.network);
    if (status == RX_OK)
        status = run_steps(n, err);
    lap(n, &n->times.steps);
    if (status == RX_OK && n->optics != NULL)
        status =
            rx_network_optics_reblur(n->optics, n->v, n->x, restored->mask, &n->scale, n->tile, n->background,
                                     restored->reblurred, &restored->chi2, n->log, 0.9, 0.95, err);
    if (status == RX_OK)
        status = make_support(n, extras && n->par->keep_support, err);
    rx_network_optics_free(n->optics);
    n->optics = NULL;
    if (status == RX_OK)
        status = finish(n, fwhm, err);
    lap(n, &n->times.rest);
    rx_coarse_free(&n->scale);
    return status;
}

/* The planes; support serves as scratch first. */
static rx_status new_restored(const network *n, int extras, rx_restored **dst, rx_error *err)
{
    const int reblurred = extras && n->par->keep_reblurred && n->psf != NULL;
    const size_t area = (size_t)n->tile->width * (size_t)n->tile->height;
    rx_restored *restored = *dst = rx_restored_bare("NET", n->tile->width, n->tile->height);
    if (restored == NULL)
        return rx_error_memory(err, area * sizeof(float));
    restored->pixels = RX_NEW(float, area); /* taken from the system as the network writes them */
    restored->support = RX_NEW(float, area);
    restored->reblurred = reblurred ? RX_NEW(float, area) : NULL;
    restored->psf = rx_stamp_gauss(n->model->front.target_fwhm);
    restored->blur = n->psf != NULL ? rx_psf_copy(n->psf) : NULL;
    if (restored->pixels == NULL || restored->support == NULL || restored->psf == NULL ||
        (reblurred && restored->reblurred == NULL) || (n->psf != NULL && restored->blur == NULL))
        return rx_error_memory(err, 3 * area * sizeof(float));
    return RX_OK;
}

static void describe(const network *n, rx_restored *dst)
{
    const rx_front *front = &n->model->front;
    char step[64] = "";
    if (front->mode == RX_MODE_INFORMED && front->rl_steps > 0)
        snprintf(step, sizeof step, ", %d RL step, pedestal %g", front->rl_steps, front->pedestal);
    snprintf(dst->settings, sizeof dst->settings, "model %.60s (%.16s), %s, target FWHM %g pixels%s, %s",
             n->model->name, n->model->digest, front->mode == RX_MODE_INFORMED ? "INFORMED" : "BLIND",
             front->target_fwhm, step, n->par->precision == RX_BF16 ? "BF16" : "F32");
}

/* One restoration in blocks of at most `side` and FFTs of at most `domain` pixels, the grids shifted by
 * `shift`; extras: with the planes that are to be kept besides the image. */
static rx_status restore(const network *plan, int side, int domain, int shift, int extras, rx_restored **dst,
                         rx_error *err)
{
    const int unit = unit_of(plan->model), width = plan->tile->width, height = plan->tile->height;
    const int measured = plan->log != NULL && plan->log->level >= RX_FULL;
    rx_stream_cost cost[RX_NET_NODES] = {{0, 0}};
    network n = *plan;
    n.forward = (rx_network_forward){.model = n.model,
                                     .precision = n.par->precision,
                                     .width = width,
                                     .height = height,
                                     .nthreads = n.nthreads,
                                     .cost = measured ? cost : NULL};
    const int high = height > LARGE_TILE ? domain : domain / 2, shift_y = shift > 0 ? shift + unit : 0;
    n.blocks = rx_network_forward_blocks(&n.forward, side, shift, shift_y);
    n.domains = rx_blocks_make(width, height, domain, high, unit, shift, shift_y);
    n.blocks.team = n.domains.team = n.nthreads;
    const double begun = n.clock = rx_seconds();
    *dst = NULL;
    rx_status status = new_restored(&n, extras, &n.restored, err);
    if (status == RX_OK) {
        n.x = n.restored->support;
        n.v = n.restored->pixels;
        n.spare = RX_NEW(float, (size_t)width *(size_t)height);
        if (n.spare == NULL)
            status = rx_error_memory(err, (size_t)width * (size_t)height * sizeof *n.spare);
    }
    if (status == RX_OK) {
        if (rx_prepared_mask(n.par, n.tile, n.background, n.restored->mask) == 0)
            rx_log_warning(n.log, "NET: every pixel is masked, nothing to restore");
        status = restore_planes(&n, extras, err);
    }
    if (status != RX_OK) {
        if (n.v != NULL) /* the planes may have changed places */
            n.restored->pixels = n.v;
        free(n.spare);
        rx_restored_free(n.restored);
        return status;
    }
    n.restored->seconds = rx_seconds() - begun;
    if (measured)
        rx_network_report(&n.forward, &n.times, n.log);
    *dst = n.restored;
    return RX_OK;
}

/* Largest difference between two restorations, in sigmas of the pixels (network.h). */
static double largest_difference(const rx_map *noise, const rx_restored *a, const rx_restored *b)
{
    enum { PIECE = 1024 }; /* pixels of a row at a time */
    float room[PIECE];
    double most = 0;
    for (int y = 0; y < a->height; y++)
        for (int x = 0; x < a->width; x += PIECE) {
            const int n = a->width - x < PIECE ? a->width - x : PIECE;
            const float *sigma = rx_map_row(noise, y, x, n, room);
            const size_t k = (size_t)y * (size_t)a->width + (size_t)x;
            const float *p = a->pixels + k, *q = b->pixels + k;
            for (int i = 0; i < n; i++) {
                const double difference = fabs((double)p[i] - q[i]);
                const double unit = (sigma[i] > 0 ? sigma[i] : 0) + FULL_WELL_NOISE * fabs((double)p[i]);
                if (difference > 0)
                    most = fmax(most, difference / unit);
            }
        }
    return most;
}

static rx_status verify_seams(const network *plan, rx_restored *restored, rx_error *err)
{
    const int unit = unit_of(plan->model), side = plan->par->net_block;
    const int other = (side * 5 / 8 + unit) / unit * unit, shift = (side / 3 + unit) / unit * unit;
    const double rounding = plan->par->precision == RX_BF16 ? SEAM_LIMIT_BF16 : SEAM_LIMIT;
    const double limit = plan->model->front.mode == RX_MODE_INFORMED ? rounding : 0;
    const rx_map noise = rx_background_noise(plan->background);
    rx_restored *second = NULL;
    rx_status status = restore(plan, other, DOMAIN_SIDE * 5 / 8, shift, 0, &second, err);
    if (status != RX_OK)
        return status;
    restored->seam = largest_difference(&noise, restored, second);
    rx_restored_free(second);
    rx_log_info(plan->log, "NET: in blocks of %d pixels at most, shifted by %d,%d: largest change %.3g sigma",
                other, shift, shift + unit, restored->seam);
    if (restored->seam > limit)
        return rx_error_set(
            err, RX_SYSTEM,
            "the restored image depends on its blocks by %.3g sigma, more than %g; give %sVERIFY_SEAMS N "
            "if that is good enough",
            restored->seam, limit, plan->par->precision == RX_BF16 ? "NET_PRECISION F32, or " : "");
    return RX_OK;
}

rx_status rx_network_run(const rx_restore_params *par, const rx_tile *tile, const rx_background *background,
                         const rx_psf *psf, rx_log *log, rx_restored **dst, rx_error *err)
{
    rx_restored *restored = NULL;
    *dst = NULL;
    rx_status status = check_input(par, psf, err);
    if (status != RX_OK)
        return status;
    const network plan = {.par = par,
                          .model = par->model,
                          .tile = tile,
                          .background = background,
                          .psf = psf,
                          .log = log,
                          .nthreads = par->nthreads < 1 ? 1 : par->nthreads};
    rx_log_progress_begin(log);
    status = restore(&plan, par->net_block, DOMAIN_SIDE, 0, 1, &restored, err);
    if (status == RX_OK && par->verify_seams) {
        const double begun = rx_seconds();
        status = verify_seams(&plan, restored, err);
        restored->seconds += rx_seconds() - begun;
    }
    rx_log_progress_end(log);
    if (status != RX_OK) {
        rx_restored_free(restored);
        return status;
    }
    describe(&plan, restored);
    rx_log_detail(log, "NET: %s, reduced chi2 %.3f, %.3f s", restored->settings, restored->chi2,
                  restored->seconds);
    *dst = restored;
    return RX_OK;
}
