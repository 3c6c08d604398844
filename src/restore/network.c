/* A trained network on a tile, block by block. */
#include "restore/network.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "data/gaps.h"
#include "data/map.h"
#include "nn/direct.h"
#include "num/convolve.h"
#include "restore/blur.h"
#include "restore/network_forward.h"
#include "restore/network_optics.h"
#include "restore/network_sky.h"
#include "restore/noise_map.h"
#include "restore/prepared.h"
#include "restore/stamp.h"

/* Of the FFTs, output pixels: not NET_BLOCK, so that this changes no bit. Large domains have little halo;
 * those of small tiles are half as wide: threads can share them, and caches hold them. */
enum { DOMAIN_SIDE = 1024, LARGE_TILE = 2048 };
/* of a pixel's value: 250,000 electrons, about what a pixel of a detector holds at most */
static const double FULL_WELL_NOISE = 1.0 / 500;
/* sigmas, with a PSF; what FFTs round may tip over the rounding of a bfloat16 in an INFORMED model, which is
 * 50,000 times coarser */
static const double SEAM_LIMIT = 1e-3, SEAM_LIMIT_BF16 = 0.5;
/* of the noise map: a faint source that the network believes in has pixels this much fainter than one of the
 * same significance has among the noise (measured: network.h) */
static const float DETECTABLE = 0.6f;

/* Wall time of the parts of a restoration, seconds. */
typedef struct times {
    double network, tikhonov, steps, rest;
} times;

/* One restoration of a tile: on one grid of blocks. */
typedef struct network {
    const rx_restore_params *par;
    const rx_model *model;
    const rx_image *image;
    rx_log *log;
    rx_restored *restored;
    rx_blocks first, second; /* of the networks */
    rx_blocks domains;       /* of the FFTs */
    int nthreads;
    rx_network_input input;     /* x: restored->support until that is made, or its own */
    rx_network_optics *optics;  /* NULL without a PSF */
    float *v;                   /* what the network, later the step makes; it becomes restored->pixels */
    float *spare;               /* Tikhonov copy, then target of the step; the two change places */
    rx_network_forward forward; /* its planes are set when it runs */
    double clock;               /* seconds: when the last part of the work ended */
    times times;
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
    const int first = rx_net_levels(model->restore);
    return 2 << (model->second != NULL ? rx_max_int(first, rx_net_levels(model->second)) : first);
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

static void change_places(network *n)
{
    float *done = n->spare;
    n->spare = n->v;
    n->v = done;
}

/* v = network(x, w) */
static rx_status run_first(network *n, double begin, double end, rx_error *err)
{
    rx_network_forward forward = n->forward;
    const int informed = n->model->front.mode == RX_MODE_INFORMED;
    forward.nplanes = rx_front_channels(n->model->front.mode);
    forward.planes[0] = forward.base = n->input.x;
    if (informed)
        forward.planes[1] = forward.base = forward.spent = n->spare;
    forward.optics = n->optics;
    forward.v = n->v;
    return rx_network_forward_run(&forward, &n->first, &(rx_blocks_progress){n->log, begin, end}, err);
}

/* v = network(x, w, v, what v leaves of x); w comes anew, its memory was spent. */
static rx_status run_second(network *n, double begin, double end, rx_error *err)
{
    const size_t area = (size_t)n->image->width * (size_t)n->image->height;
    const double middle = begin + 0.2 * (end - begin);
    const rx_blocks_progress before = {n->log, begin, middle}, after = {n->log, middle, end};
    rx_network_forward forward = n->forward;
    float *w = RX_NEW(float, area), *left = RX_NEW(float, area);
    rx_status status = w != NULL && left != NULL ? RX_OK : rx_error_memory(err, 2 * area * sizeof(float));
    if (status == RX_OK)
        status = rx_network_optics_tikhonov(n->optics, n->input.x, w, NULL, err);
    if (status == RX_OK)
        status = rx_network_optics_left(n->optics, n->input.x, n->v, left, &before, err);
    lap(n, &n->times.tikhonov);
    forward.net = n->model->second;
    forward.nplanes = RX_SECOND_CHANNELS;
    forward.planes[0] = n->input.x;
    forward.planes[1] = w;
    forward.planes[3] = forward.base = n->v;
    forward.planes[4] = forward.spent = left;
    forward.optics = n->optics;
    forward.v = n->spare;
    forward.cost = n->forward.cost != NULL ? n->forward.cost + n->forward.net->nnodes : NULL;
    if (status == RX_OK)
        status = rx_network_forward_run(&forward, &n->second, &after, err);
    free(w);
    free(left);
    change_places(n);
    lap(n, &n->times.network);
    return status;
}

static rx_status make_optics(network *n, rx_error *err)
{
    const rx_front *front = &n->model->front;
    if (n->image->psf == NULL)
        return RX_OK;
    return rx_network_optics_new(n->image, front->target_fwhm,
                                 front->mode == RX_MODE_INFORMED ? front->tikhonov : 0, &n->domains,
                                 n->nthreads, &n->optics, err);
}

static rx_status run_steps(network *n, double begin, double end, rx_error *err)
{
    const rx_front *front = &n->model->front;
    const int steps = front->mode == RX_MODE_INFORMED ? front->rl_steps : 0;
    rx_status status = RX_OK;
    for (int i = 0; i < steps && status == RX_OK; i++) {
        const double each = (end - begin) / steps;
        const rx_blocks_progress progress = {n->log, begin + each * i, begin + each * (i + 1)};
        status =
            rx_network_optics_step(n->optics, &n->input, front->pedestal, n->v, n->spare, &progress, err);
        change_places(n);
    }
    lap(n, &n->times.steps);
    return status;
}

/* What the PSF makes of v takes the place of the data; where the PSF is not known, a Gaussian of the usual
 * seeing stands in. */
static rx_status reblur(network *n, rx_error *err)
{
    const rx_image *image = n->image;
    const size_t area = (size_t)image->width * (size_t)image->height;
    const double target = n->model->front.target_fwhm;
    if (n->optics != NULL)
        return rx_network_optics_reblur(n->optics, n->v, n->input.x, &(rx_blocks_progress){n->log, 0.9, 0.95},
                                        err);
    memcpy(n->input.x, n->v, area * sizeof *n->v);
    return rx_gauss_masked(image->width, image->height,
                           sqrt(RX_UNKNOWN_FWHM * RX_UNKNOWN_FWHM - target * target), NULL, n->nthreads,
                           n->input.x, err);
}

/* v becomes the restored tile, what the data have at low frequency and v has not is added. Where the data were is the
 * reblurred image if that is wanted. */
static rx_status finish(network *n, double fwhm, int reblurred, rx_error *err)
{
    rx_restored *restored = n->restored;
    const size_t area = (size_t)n->image->width * (size_t)n->image->height;
    rx_network_adu adu = {n->v, reblurred ? n->input.x : NULL, NAN};
    rx_coarse sky = {0};
    free(n->spare);
    n->spare = NULL;
#pragma omp parallel for simd schedule(static) num_threads(n->nthreads)
    for (size_t k = 0; k < area; k++)
        n->v[k] = rx_front_shown(n->v[k]);
    rx_status status = reblur(n, err);
    if (status == RX_OK)
        status = rx_network_sky(&n->input, n->input.x, fwhm, n->nthreads, &sky, err);
    if (status == RX_OK)
        status = rx_network_sky_add(&n->input, n->input.x, &sky, n->nthreads, &adu, err);
    rx_coarse_free(&sky);
    if (reblurred) {
        restored->reblurred = n->input.x;
        restored->support = n->input.x = NULL;
    }
    restored->pixels = n->v;
    restored->chi2 = n->optics != NULL ? adu.chi2 : NAN;
    return status;
}

static rx_status set_noise(const network *n, rx_error *err)
{
    rx_restored *restored = n->restored;
    rx_status status =
        rx_noise_map(n->image, restored->mask, DETECTABLE, n->nthreads, &restored->noise_maker, err);
    if (status == RX_OK)
        restored->noise = rx_map_made(restored->noise_maker, n->image->width);
    return status;
}

/* A Gaussian of common seeing says what the mask has taken where the PSF is not known. The data go. */
static rx_status make_support(network *n, int wanted, rx_error *err)
{
    const rx_blocks_progress progress = {n->log, 0.95, 1};
    rx_restored *restored = n->restored;
    if (!wanted) {
        free(restored->support);
        restored->support = n->input.x = NULL;
        return RX_OK;
    }
    if (restored->support == NULL)
        restored->support = RX_NEW(float, (size_t)n->image->width *(size_t)n->image->height);
    if (restored->support == NULL)
        return rx_error_memory(err, (size_t)n->image->width * (size_t)n->image->height * sizeof(float));
    if (n->optics != NULL)
        return rx_network_optics_support(n->optics, restored->mask, restored->support, &progress, err);
    rx_psf *psf = rx_stamp_gauss(RX_UNKNOWN_FWHM);
    rx_network_optics *optics = NULL;
    if (psf == NULL)
        return rx_error_memory(err, 0);
    rx_image image = *n->image;
    image.psf = psf;
    rx_status status =
        rx_network_optics_new(&image, n->model->front.target_fwhm, 0, &n->domains, n->nthreads, &optics, err);
    if (status == RX_OK)
        status = rx_network_optics_support(optics, restored->mask, restored->support, &progress, err);
    rx_network_optics_free(optics);
    rx_psf_free(psf);
    return status;
}

static rx_status restore_planes(network *n, int extras, rx_error *err)
{
    const double fwhm =
        n->image->psf != NULL && n->image->psf->fwhm > 0 ? n->image->psf->fwhm : RX_UNKNOWN_FWHM;
    rx_restored *restored = n->restored;
    rx_status status = rx_network_scale(n->image, restored->mask, n->nthreads, &n->input.scale, err);
    if (status == RX_OK)
        status = rx_network_data(&n->input, fwhm, &n->domains, n->nthreads, err);
    if (status == RX_OK)
        status = make_optics(n, err);
    lap(n, &n->times.rest);
    if (status == RX_OK && n->model->front.mode == RX_MODE_INFORMED)
        status = rx_network_optics_tikhonov(n->optics, n->input.x, n->spare,
                                            &(rx_blocks_progress){n->log, 0, 0.1}, err);
    lap(n, &n->times.tikhonov);
    const double middle = n->model->second != NULL ? 0.45 : 0.9;
    if (status == RX_OK)
        status = run_first(n, 0.1, 0.85 * middle, err);
    lap(n, &n->times.network);
    if (status == RX_OK)
        status = run_steps(n, 0.85 * middle, middle, err);
    if (status == RX_OK && n->model->second != NULL)
        status = run_second(n, middle, 0.85, err);
    if (status == RX_OK && n->model->second != NULL)
        status = run_steps(n, 0.85, 0.9, err);
    if (status == RX_OK)
        status = finish(n, fwhm, extras && n->par->keep_reblurred && n->image->psf != NULL, err);
    if (status == RX_OK)
        status = make_support(n, extras && n->par->keep_support, err);
    rx_network_optics_free(n->optics);
    n->optics = NULL;
    if (status == RX_OK)
        status = set_noise(n, err);
    lap(n, &n->times.rest);
    rx_coarse_free(&n->input.scale);
    return status;
}

/* The planes; support serves as scratch first. */
static rx_status new_restored(const network *n, rx_restored **dst, rx_error *err)
{
    const size_t area = (size_t)n->image->width * (size_t)n->image->height;
    rx_restored *restored = *dst = rx_restored_bare("NET", n->image->width, n->image->height);
    if (restored == NULL)
        return rx_error_memory(err, area * sizeof(float));
    restored->pixels = RX_NEW(float, area); /* taken from the system as the network writes them */
    restored->support = RX_NEW(float, area);
    restored->psf = rx_stamp_gauss(n->model->front.target_fwhm);
    restored->blur = n->image->psf != NULL ? rx_psf_copy(n->image->psf) : NULL;
    if (restored->pixels == NULL || restored->support == NULL || restored->psf == NULL ||
        (n->image->psf != NULL && restored->blur == NULL))
        return rx_error_memory(err, 2 * area * sizeof(float));
    return RX_OK;
}

static void describe(const network *n, rx_restored *dst)
{
    const rx_front *front = &n->model->front;
    const char *stages = n->model->second != NULL ? ", two stages" : "";
    char step[64] = "";
    if (front->mode == RX_MODE_INFORMED && front->rl_steps > 0)
        snprintf(step, sizeof step, ", %s%d RL step%s, pedestal %g", *stages != '\0' ? "each " : "",
                 front->rl_steps, front->rl_steps == 1 ? "" : "s", front->pedestal);
    snprintf(dst->settings, sizeof dst->settings, "model %.60s (%.16s), %s, target FWHM %g pixels%s%s, %s",
             n->model->name, n->model->digest, front->mode == RX_MODE_INFORMED ? "INFORMED" : "BLIND",
             front->target_fwhm, stages, step, n->par->precision == RX_BF16 ? "BF16" : "F32");
}

static double per(double amount, double seconds)
{
    return seconds > 0 ? amount / seconds : 0;
}

static void report_node(const rx_net *net, int i, int stage, const rx_stream_cost *cost, double peak,
                        rx_log *log)
{
    const rx_node *n = &net->node[i];
    const double speed = per(cost->flops, cost->seconds);
    rx_log_detail(log, "NET: %slayer %d %s %dx%d %d->%d: %.4f s, %.1f GFLOP/s, %.1f %% of peak",
                  stage == 2 ? "second stage, " : "", i, rx_op_name(n->op), n->kernel, n->kernel,
                  net->node[n->src].channels, n->channels, cost->seconds, 1e-9 * speed,
                  100 * per(speed, peak));
}

/* How fast the network was, against what the machine convolves at most. Lines for VERBOSE_TYPE FULL, one per
 * node of the network and one for all. Seconds of a node are summed over threads, its share is that of one
 * thread's peak; the network's work is what its output pixels need, halo not counted, and its share that of
 * the peak of all threads. Convolutions by Winograd's algorithm count as direct ones, and may exceed the
 * peak. */
static void report(const rx_network_forward *f, const rx_model *model, const times *spent, rx_log *log)
{
    const rx_net *first = model->restore, *second = model->second;
    double peak = 0, macs = rx_net_macs(first);
    if (rx_direct_peak(f->precision == RX_BF16 ? RX_REAL_BF16 : RX_REAL_F32, &peak, NULL) != RX_OK)
        return;
    for (int i = 1; i < first->nnodes; i++)
        report_node(first, i, 1, &f->cost[i], peak, log);
    for (int i = 1; second != NULL && i < second->nnodes; i++)
        report_node(second, i, 2, &f->cost[first->nnodes + i], peak, log);
    macs += second != NULL ? rx_net_macs(second) : 0;
    const double speed = per(2 * macs * f->width * (double)f->height, spent->network);
    rx_log_detail(log,
                  "NET: network %.4f s, %.1f GFLOP/s, %.1f %% of peak; Tikhonov %.4f s, steps %.4f s, rest "
                  "%.4f s",
                  spent->network, 1e-9 * speed, 100 * per(speed, peak * f->nthreads), spent->tikhonov,
                  spent->steps, spent->rest);
}

/* One restoration in blocks of at most `side` and FFTs of at most `domain` pixels, the grids shifted by
 * `shift`; extras: with the planes that are to be kept besides the image. */
static rx_status restore(const network *plan, int side, int domain, int shift, int extras, rx_restored **dst,
                         rx_error *err)
{
    const int unit = unit_of(plan->model), width = plan->image->width, height = plan->image->height;
    const int measured = plan->log != NULL && plan->log->level >= RX_FULL;
    rx_stream_cost cost[2 * RX_NET_NODES] = {{0, 0}};
    network n = *plan;
    n.forward = (rx_network_forward){.model = n.model->name,
                                     .net = n.model->restore,
                                     .precision = n.par->precision,
                                     .width = width,
                                     .height = height,
                                     .nthreads = n.nthreads,
                                     .cost = measured ? cost : NULL};
    const int large = width > LARGE_TILE || height > LARGE_TILE, across = large ? domain : domain / 2;
    const int shift_y = shift > 0 ? shift + unit : 0;
    n.first = rx_network_forward_blocks(&n.forward, side, shift, shift_y);
    if (n.model->second != NULL) {
        rx_network_forward second = n.forward;
        second.net = n.model->second;
        n.second = rx_network_forward_blocks(&second, side, shift, shift_y);
    }
    n.domains = rx_blocks_make(width, height, across, across, unit, shift, shift_y);
    n.first.team = n.second.team = n.domains.team = n.nthreads;
    const double begun = n.clock = rx_seconds();
    *dst = NULL;
    rx_status status = new_restored(&n, &n.restored, err);
    if (status == RX_OK) {
        n.input = (rx_network_input){.image = n.image, .mask = n.restored->mask, .x = n.restored->support};
        n.v = n.restored->pixels;
        n.spare = RX_NEW(float, (size_t)width *(size_t)height);
        if (n.spare == NULL)
            status = rx_error_memory(err, (size_t)width * (size_t)height * sizeof *n.spare);
    }
    if (status == RX_OK) {
        uint8_t *mask = n.restored->mask;
        if (rx_prepared_mask(n.image, n.nthreads, mask) == 0)
            rx_log_warning(n.log, "%s[%d]: NET: every pixel is masked, nothing to restore", n.image->name,
                           n.image->hdu);
        status = rx_gaps_find(mask, width, height, n.image->psf != NULL ? n.image->psf->fwhm : 0, 0,
                              &n.restored->gaps, err);
        n.input.gaps = n.restored->gaps;
        rx_gaps_mark(n.input.gaps, RX_MASK_GAP, mask);
        if (status == RX_OK)
            status = restore_planes(&n, extras, err);
        rx_gaps_mark(n.input.gaps, 0, mask);
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
        report(&n.forward, n.model, &n.times, n.log);
    *dst = n.restored;
    return RX_OK;
}

/* Largest difference between two restorations, in sigmas of the pixels (network.h). */
static double largest_difference(const rx_map *noise, const rx_restored *a, const rx_restored *b)
{
    float room[RX_MAP_PIECE];
    double most = 0;
    for (int y = 0; y < a->height; y++)
        for (int x = 0; x < a->width; x += RX_MAP_PIECE) {
            const int n = rx_map_piece(x, a->width);
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
    const int fft = plan->image->psf != NULL, informed = plan->model->front.mode == RX_MODE_INFORMED;
    const double rounding = informed && plan->par->precision == RX_BF16 ? SEAM_LIMIT_BF16 : SEAM_LIMIT;
    const double limit = fft ? rounding : 0;
    const rx_map *noise = &plan->image->noise;
    rx_restored *second = NULL;
    RX_TRY(restore(plan, other, DOMAIN_SIDE * 5 / 8, shift, 0, &second, err));
    restored->seam = largest_difference(noise, restored, second);
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

rx_status rx_network_run(const rx_restore_params *par, const rx_image *image, rx_log *log, rx_restored **dst,
                         rx_error *err)
{
    rx_restored *restored = NULL;
    *dst = NULL;
    RX_TRY(check_input(par, image->psf, err));
    const network plan = {.par = par,
                          .model = par->model,
                          .image = image,
                          .log = log,
                          .nthreads = par->nthreads < 1 ? 1 : par->nthreads};
    rx_log_progress_begin(log);
    rx_status status = restore(&plan, par->net_block, DOMAIN_SIDE, 0, 1, &restored, err);
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
