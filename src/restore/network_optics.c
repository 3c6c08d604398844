/* The PSF around the network, by FFT on blocks. */
#include "restore/network_optics.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/rl_step.h"
#include "num/convolve.h"
#include "restore/network_otf.h"
#include "restore/network_rows.h"

static const float SUPPORT_FLOOR = 1e-5f; /* rounding of the transforms */

struct rx_network_optics_work {
    rx_fft *fft;
    int x0, y0;            /* where its domain begins, tile pixels */
    float *a, *b;          /* real planes */
    float *c, *d;          /* likewise, for a PSF that varies */
    float *half;           /* complex plane */
    float *sum, *spectrum; /* likewise, for a PSF that varies */
};

static void work_free(rx_network_optics_work *work)
{
    free(work->a);
    free(work->b);
    free(work->c);
    free(work->d);
    free(work->half);
    free(work->sum);
    free(work->spectrum);
    rx_fft_free(work->fft);
}

static rx_status work_new(int width, int height, int varies, rx_network_optics_work *dst, rx_error *err)
{
    rx_status status = rx_fft_new(width, height, 1, &dst->fft, err);
    if (status != RX_OK)
        return status;
    dst->a = rx_fft_real(dst->fft);
    dst->b = rx_fft_real(dst->fft);
    dst->half = rx_fft_complex(dst->fft);
    int made = dst->a != NULL && dst->b != NULL && dst->half != NULL;
    if (varies) {
        dst->c = rx_fft_real(dst->fft);
        dst->d = rx_fft_real(dst->fft);
        dst->sum = rx_fft_complex(dst->fft);
        dst->spectrum = rx_fft_complex(dst->fft);
        made &= dst->c != NULL && dst->d != NULL && dst->sum != NULL && dst->spectrum != NULL;
    }
    return made ? RX_OK : rx_error_memory(err, 7 * (size_t)width * (size_t)height * sizeof(float));
}

void rx_network_optics_free(rx_network_optics *optics)
{
    if (optics == NULL)
        return;
    for (int i = 0; i < optics->nthreads && optics->work != NULL; i++)
        work_free(&optics->work[i]);
    rx_otf_free(&optics->relative);
    free(optics->work);
    free(optics->tikhonov);
    free(optics->filters);
    free(optics->fwhm);
    free(optics);
}

/* What a thread failed with; all of them can only lack memory. */
static void take_error(rx_status why, const rx_error *error, rx_status *status, rx_error *err)
{
#pragma omp critical(rx_network_optics_failure)
    {
        *status = why;
        rx_error_take(err, error);
    }
}

/* Of the threads those that have work do it, rx_blocks.team says why. */
static int team_of(const rx_network_optics *optics)
{
    const int team = optics->blocks->team;
    return optics->nthreads > 1 && team > optics->nthreads ? team : optics->nthreads;
}

/* Threads' planes on a domain that holds a block and the halo that the widest of the tasks needs. */
static rx_status make_work(rx_network_optics *optics, int step_radius, int psf_radius, rx_error *err)
{
    const rx_blocks *blocks = optics->blocks;
    rx_status status = RX_OK;
    optics->halo = 2 * step_radius > psf_radius ? 2 * step_radius : psf_radius;
    if (optics->filters != NULL && optics->halo < RX_TIKHONOV_REACH)
        optics->halo = RX_TIKHONOV_REACH;
    const int w = rx_fft_good_size(blocks->width + 2 * optics->halo),
              h = rx_fft_good_size(blocks->height + 2 * optics->halo);
    optics->work = RX_NEW(rx_network_optics_work, (size_t)optics->nthreads);
    if (optics->work == NULL)
        return rx_error_memory(err, 0);
#pragma omp parallel for schedule(static, 1) num_threads(team_of(optics))
    for (int i = 0; i < optics->nthreads; i++) {
        rx_error why = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
        const rx_status made = work_new(w, h, rx_otf_varies(optics->psf), &optics->work[i], &why);
        if (made != RX_OK)
            take_error(made, &why, &status, err);
    }
    return status;
}

/* The spectrum of the only filter of a PSF that does not vary. */
static rx_status make_tikhonov(rx_network_optics *optics, const rx_fft *fft, rx_error *err)
{
    if (optics->filters == NULL || optics->nx > 1 || optics->ny > 1)
        return RX_OK;
    optics->tikhonov = rx_fft_complex(fft);
    if (optics->tikhonov == NULL)
        return rx_error_memory(err, 0);
    rx_otf_spectrum(fft, optics->filters, 2 * RX_TIKHONOV_REACH + 1, optics->tikhonov);
    return RX_OK;
}

/* The filter of the copy and the relative PSF, each by a thread where there are two. */
static rx_status make_spectra(rx_network_optics *optics, const float *relative, int size, rx_error *err)
{
    const int other = optics->nthreads > 1; /* an rx_fft is used by one thread at a time */
    rx_status status = RX_OK;
#pragma omp parallel for schedule(static, 1) num_threads(team_of(optics))
    for (int task = 0; task < 2; task++) {
        rx_error why = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
        const rx_status made =
            task == 0 ? make_tikhonov(optics, optics->work[0].fft, &why)
                      : rx_otf_new(optics->work[other].fft, optics, relative, size, &optics->relative, &why);
        if (made != RX_OK)
            take_error(made, &why, &status, err);
    }
    return status;
}

rx_status rx_network_optics_new(const rx_image *image, double target_fwhm, double epsilon,
                                const rx_blocks *blocks, int nthreads, rx_network_optics **dst, rx_error *err)
{
    const rx_psf *psf = image->psf;
    float *relative = NULL;
    int size = 0;
    *dst = NULL;
    rx_network_optics *optics = RX_NEW(rx_network_optics, 1);
    if (optics == NULL)
        return rx_error_memory(err, sizeof *optics);
    optics->width = image->width;
    optics->height = image->height;
    optics->nthreads = rx_blocks_threads(blocks, nthreads);
    optics->blocks = blocks;
    optics->psf = psf;
    optics->target_fwhm = target_fwhm;
    rx_status status = rx_network_optics_nodes(optics, epsilon, err);
    if (status == RX_OK)
        status = rx_otf_relative(psf, target_fwhm, image->width, image->height, &relative, &size, err);
    if (status == RX_OK)
        status = make_work(optics, size / 2, psf->size / 2, err);
    if (status == RX_OK)
        status = make_spectra(optics, relative, size, err);
    free(relative);
    if (status != RX_OK) {
        rx_network_optics_free(optics);
        return status;
    }
    *dst = optics;
    return RX_OK;
}

/* dst (+)= c_i src, planes of the domain. */
static void weigh(const rx_network_optics *optics, const rx_otf *otf, int i,
                  const rx_network_optics_work *work, const float *src, int add, float *dst)
{
    const rx_fft *fft = work->fft;
    const size_t stride = (size_t)rx_fft_stride_real(fft);
    const int w = rx_fft_width(fft);
    for (int v = 0; v < rx_fft_height(fft); v++) {
        const float cy = otf->cy[i][rx_otf_clamp(work->y0 + v, optics->height)];
        const float *s = src + (size_t)v * stride;
        float *d = dst + (size_t)v * stride;
        for (int u = 0; u < w; u++) {
            const float value = cy * otf->cx[i][rx_otf_clamp(work->x0 + u, optics->width)] * s[u];
            d[u] = add ? d[u] + value : value;
        }
    }
}

/* dst = K src; `scratch` is a real plane, src stays. */
static void apply(const rx_network_optics *optics, const rx_otf *otf, rx_network_optics_work *work,
                  const float *src, float *scratch, float *dst)
{
    if (!otf->varies) {
        rx_convolve(work->fft, otf->spectrum[0], src, work->half, dst);
        return;
    }
    for (int i = 0; i < otf->n; i++) {
        weigh(optics, otf, i, work, src, 0, scratch);
        rx_fft_forward(work->fft, scratch, work->half);
        rx_convolve_multiply(work->fft, otf->spectrum[i], work->half, false, i > 0, work->sum);
    }
    rx_fft_inverse(work->fft, work->sum, dst);
}

/* dst = K^T src; scratch not dst. */
static void adjoint(const rx_network_optics *optics, const rx_otf *otf, rx_network_optics_work *work,
                    const float *src, float *scratch, float *dst)
{
    if (!otf->varies) {
        rx_correlate(work->fft, otf->spectrum[0], src, work->half, dst);
        return;
    }
    rx_fft_forward(work->fft, src, work->sum);
    for (int i = 0; i < otf->n; i++) {
        rx_convolve_multiply(work->fft, otf->spectrum[i], work->sum, true, false, work->half);
        rx_fft_inverse(work->fft, work->half, scratch);
        weigh(optics, otf, i, work, scratch, i > 0, dst);
    }
}

/* What a task on blocks is given. */
typedef struct job {
    const rx_network_optics *optics;
    const float *f, *x;
    const uint8_t *mask;
    float *dst;
    double pedestal;
    const rx_otf *plain; /* the tile's PSF */
} job;

/* The part of the block at (x, y) that lies on the tile. */
typedef struct part {
    int x0, y0, x1, y1;
} part;

static part part_of(const rx_network_optics *optics, int x, int y)
{
    const rx_blocks *blocks = optics->blocks;
    return (part){x > 0 ? x : 0, y > 0 ? y : 0,
                  x + blocks->width < optics->width ? x + blocks->width : optics->width,
                  y + blocks->height < optics->height ? y + blocks->height : optics->height};
}

/* The planes of a thread for the block at (x, y). */
static rx_network_optics_work *work_at(const rx_network_optics *optics, int thread, int x, int y)
{
    rx_network_optics_work *work = &optics->work[thread];
    work->x0 = x - optics->halo;
    work->y0 = y - optics->halo;
    return work;
}

static rx_blocks_window domain_of(const rx_network_optics_work *work)
{
    return (rx_blocks_window){work->x0, work->y0, rx_fft_width(work->fft), rx_fft_height(work->fft),
                              rx_fft_stride_real(work->fft)};
}

static void read_domain(const job *j, const rx_network_optics_work *work, const float *plane, float *dst)
{
    const rx_blocks_window window = domain_of(work);
    rx_blocks_read(plane, j->optics->width, j->optics->height, &window, dst);
}

static long read_good(const job *j, const rx_network_optics_work *work, float *dst)
{
    const rx_blocks_window window = domain_of(work);
    return rx_blocks_good(j->mask, j->optics->width, j->optics->height, &window, dst);
}

static rx_rows rows_of(const rx_network_optics *optics, const rx_network_optics_work *work, const part *p)
{
    return (rx_rows){.fft = work->fft,
                     .width = optics->width,
                     .height = optics->height,
                     .x0 = work->x0,
                     .y0 = work->y0,
                     .left = p->x0,
                     .right = p->x1,
                     .top = p->y0,
                     .bottom = p->y1,
                     .half = work->half,
                     .a = work->a,
                     .b = work->b};
}

/* w += hat_node (T_node * x); x is given as its transform in work->sum. */
static void add_node(const job *j, rx_network_optics_work *work, int node, const part *p)
{
    const rx_network_optics *optics = j->optics;
    const int side = 2 * RX_TIKHONOV_REACH + 1, nx = node % optics->nx, ny = node / optics->nx;
    const size_t stride = (size_t)rx_fft_stride_real(work->fft);
    rx_otf_spectrum(work->fft, optics->filters + (size_t)node * side * side, side, work->spectrum);
    rx_convolve_multiply(work->fft, work->spectrum, work->sum, false, false, work->half);
    rx_fft_inverse(work->fft, work->half, work->b);
    for (int y = p->y0; y < p->y1; y++) {
        const double hat_y = optics->ny == 1 ? 1 : 1 - fabs(y / optics->step_y - ny);
        const float *src = work->b + (size_t)(y - work->y0) * stride;
        float *dst = j->dst + (size_t)y * optics->width;
        for (int x = p->x0; x < p->x1 && hat_y > 0; x++) {
            const double hat_x = optics->nx == 1 ? 1 : 1 - fabs(x / optics->step_x - nx);
            if (hat_x > 0)
                dst[x] += (float)(hat_x * hat_y) * src[x - work->x0];
        }
    }
}

static int node_below(double v, double step, int n)
{
    const int i = (int)floor(v / step);
    return i < n - 1 ? i : n - 1;
}

static rx_status tikhonov_block(void *user, int thread, int bx, int by, rx_error *err)
{
    const job *j = user;
    const rx_network_optics *optics = j->optics;
    rx_network_optics_work *work = work_at(optics, thread, bx, by);
    const part p = part_of(optics, bx, by);
    (void)err;
    if (optics->tikhonov != NULL) {
        const rx_rows rows = rows_of(optics, work, &p);
        rx_rows_filter(&rows, optics->tikhonov, j->x, j->dst);
        return RX_OK;
    }
    read_domain(j, work, j->x, work->a);
    rx_fft_forward(work->fft, work->a, work->sum);
    for (int y = p.y0; y < p.y1; y++)
        memset(j->dst + (size_t)y * optics->width + p.x0, 0, (size_t)(p.x1 - p.x0) * sizeof(float));
    const int last_x = node_below(p.x1 - 1, optics->step_x, optics->nx) + 1,
              last_y = node_below(p.y1 - 1, optics->step_y, optics->ny) + 1;
    for (int ny = node_below(p.y0, optics->step_y, optics->ny); ny <= last_y && ny < optics->ny; ny++)
        for (int nx = node_below(p.x0, optics->step_x, optics->nx); nx <= last_x && nx < optics->nx; nx++)
            add_node(j, work, ny * optics->nx + nx, &p);
    return RX_OK;
}

rx_status rx_network_optics_tikhonov(const rx_network_optics *optics, const float *x, float *w,
                                     const rx_blocks_progress *progress, rx_error *err)
{
    job j = {.optics = optics, .x = x, .dst = w};
    return rx_blocks_run(optics->blocks, optics->nthreads, tikhonov_block, &j, progress, err);
}

static void light(int n, float *f)
{
#pragma omp simd
    for (int i = 0; i < n; i++)
        f[i] = rx_rl_light(f[i]);
}

/* m becomes r; weight NULL: 1. */
static void ratios(int n, const float *restrict x, const float *restrict weight, float pedestal,
                   float *restrict m)
{
    if (weight == NULL) {
#pragma omp simd
        for (int i = 0; i < n; i++)
            m[i] = rx_rl_ratio(x[i], m[i], 1, pedestal);
        return;
    }
#pragma omp simd
    for (int i = 0; i < n; i++)
        m[i] = rx_rl_ratio(x[i], m[i], weight[i], pedestal);
}

/* q NULL: 1. */
static void update(int n, const float *restrict f, const float *restrict c, const float *restrict q,
                   float *restrict next)
{
    if (q == NULL) {
#pragma omp simd
        for (int i = 0; i < n; i++)
            next[i] = rx_rl_update(f[i], c[i], 1);
        return;
    }
#pragma omp simd
    for (int i = 0; i < n; i++)
        next[i] = rx_rl_update(f[i], c[i], q[i]);
}

static rx_status step_block(void *user, int thread, int bx, int by, rx_error *err)
{
    const job *j = user;
    const rx_network_optics *optics = j->optics;
    const rx_otf *otf = &optics->relative;
    rx_network_optics_work *work = work_at(optics, thread, bx, by);
    const int w = rx_fft_width(work->fft), h = rx_fft_height(work->fft);
    const size_t stride = (size_t)rx_fft_stride_real(work->fft);
    const part p = part_of(optics, bx, by);
    (void)err;
    if (!otf->varies) {
        const rx_rows rows = rows_of(optics, work, &p);
        const rx_rows_kernel kernel = {otf->spectrum[0], otf->inside, otf->radius};
        rx_rows_step(&rows, &kernel, j->f, j->x, j->mask, (float)j->pedestal, j->dst);
        return RX_OK;
    }
    read_domain(j, work, j->f, work->a);
    for (int v = 0; v < h; v++)
        light(w, work->a + (size_t)v * stride);
    apply(optics, otf, work, work->a, work->c, work->b);
    read_domain(j, work, j->x, work->c);
    const long bad = read_good(j, work, work->d);
    for (int v = 0; v < h; v++) {
        const size_t row = (size_t)v * stride;
        ratios(w, work->c + row, bad > 0 ? work->d + row : NULL, (float)j->pedestal, work->b + row);
    }
    adjoint(optics, otf, work, work->b, work->a, work->c);
    /* the stamps sum to 1 everywhere: without masks so does K'^T W */
    if (bad > 0)
        adjoint(optics, otf, work, work->d, work->a, work->b);
    for (int y = p.y0; y < p.y1; y++) {
        const size_t row = (size_t)(y - work->y0) * stride + (size_t)(p.x0 - work->x0);
        const size_t k = (size_t)y * optics->width + (size_t)p.x0;
        update(p.x1 - p.x0, j->f + k, work->c + row, bad > 0 ? work->b + row : NULL, j->dst + k);
    }
    return RX_OK;
}

rx_status rx_network_optics_step(const rx_network_optics *optics, const rx_network_input *input,
                                 double pedestal, float *f, float *next, const rx_blocks_progress *progress,
                                 rx_error *err)
{
    job j = {.optics = optics, .f = f, .x = input->x, .mask = input->mask, .pedestal = pedestal, .dst = next};
    const rx_blocks_spent spent = {f, optics->width, optics->halo};
    return rx_blocks_run_spending(optics->blocks, optics->nthreads, step_block, &j, &spent, progress, err);
}

static rx_status reblur_block(void *user, int thread, int bx, int by, rx_error *err)
{
    const job *j = user;
    const rx_network_optics *optics = j->optics;
    rx_network_optics_work *work = work_at(optics, thread, bx, by);
    const part p = part_of(optics, bx, by);
    (void)err;
    if (!optics->relative.varies) {
        const rx_rows rows = rows_of(optics, work, &p);
        rx_rows_filter(&rows, optics->relative.spectrum[0], j->f, j->dst);
        return RX_OK;
    }
    read_domain(j, work, j->f, work->a);
    apply(optics, &optics->relative, work, work->a, work->c, work->b);
    for (int y = p.y0; y < p.y1; y++)
        memcpy(j->dst + (size_t)y * optics->width + p.x0,
               work->b + (size_t)(y - work->y0) * rx_fft_stride_real(work->fft) + (p.x0 - work->x0),
               (size_t)(p.x1 - p.x0) * sizeof(float));
    return RX_OK;
}

rx_status rx_network_optics_reblur(const rx_network_optics *optics, const float *f, float *dst,
                                   const rx_blocks_progress *progress, rx_error *err)
{
    job j = {.optics = optics, .f = f, .dst = dst};
    return rx_blocks_run(optics->blocks, optics->nthreads, reblur_block, &j, progress, err);
}

static rx_status support_block(void *user, int thread, int bx, int by, rx_error *err)
{
    const job *j = user;
    const rx_network_optics *optics = j->optics;
    rx_network_optics_work *work = work_at(optics, thread, bx, by);
    const part p = part_of(optics, bx, by);
    (void)err;
    const long bad = read_good(j, work, work->a);
    if (bad > 0)
        adjoint(optics, j->plain, work, work->a, work->c, work->b);
    for (int y = p.y0; y < p.y1; y++)
        for (int x = p.x0; x < p.x1; x++) {
            const float share =
                bad > 0 ? 1 - work->b[(size_t)(y - work->y0) * rx_fft_stride_real(work->fft) + (x - work->x0)]
                        : 0;
            j->dst[(size_t)y * optics->width + x] = share < SUPPORT_FLOOR ? 0 : share > 1 ? 1 : share;
        }
    return RX_OK;
}

rx_status rx_network_optics_support(const rx_network_optics *optics, const uint8_t *mask, float *support,
                                    const rx_blocks_progress *progress, rx_error *err)
{
    const rx_psf *psf = optics->psf;
    rx_otf plain = {0};
    job j = {.optics = optics, .mask = mask, .dst = support, .plain = &plain};
    rx_status status = rx_otf_new(optics->work->fft, optics, psf->basis, psf->size, &plain, err);
    if (status == RX_OK)
        status = rx_blocks_run(optics->blocks, optics->nthreads, support_block, &j, progress, err);
    rx_otf_free(&plain);
    return status;
}
