/* The blur of a tile and its adjoint by FFT, block by block, exact for a polynomial PSF. */
#include "restore/blur.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "num/convolve.h"

static const double NEGLIGIBLE = 1e-6;

/* Sides of blocks' domains and what a pixel of a filter costs on them (measured, ns; ratios matter). Smaller
 * ones stay in the cache, larger ones lose less to the margins. */
static const struct {
    int side;
    double cost;
} domains[] = {{96, 6.8},   {128, 3.6},  {192, 3.4},  {256, 4.0},  {320, 4.5},  {384, 3.7},
               {512, 3.6},  {576, 4.6},  {640, 3.8},  {800, 4.4},  {1024, 4.7}, {1280, 6.3},
               {1600, 6.5}, {2048, 7.3}, {3200, 7.5}, {4096, 7.8}, {6400, 8.5}, {8192, 9.0}};
static const double COST_OF_OTHERS = 9;

/* ---- terms and planes of a domain ---- */

int rx_psf_varies(const rx_psf *psf)
{
    return psf->nbasis > 1 || psf->px[0] != 0 || psf->py[0] != 0;
}

/* ((pixel - zero) / scale)^power at domain pixel i, held at its value on the tile's edge. */
static double polynomial(int i, int margin, int n, double zero, double scale, int power)
{
    double t = (fmin(fmax(i - margin, 0), n - 1) - zero) / scale, v = 1;
    for (int p = 0; p < power; p++)
        v *= t;
    return v;
}

static double largest(const float *values, size_t n)
{
    double max = 0;
    for (size_t i = 0; i < n; i++)
        max = fmax(max, fabs(values[i]));
    return max;
}

/* The coefficients of one basis image into cx, cy[n]; *most: the largest product. */
static rx_status set_coefficients(rx_blur_kernel *k, const rx_psf *psf, int basis, double *most,
                                  rx_error *err)
{
    const int w = k->width + 2 * k->margin, h = k->height + 2 * k->margin, i = k->n;
    if (k->cx[i] == NULL)
        k->cx[i] = RX_NEW(float, (size_t)w);
    if (k->cy[i] == NULL)
        k->cy[i] = RX_NEW(float, (size_t)h);
    if (k->cx[i] == NULL || k->cy[i] == NULL)
        return rx_error_memory(err, (size_t)(w + h) * sizeof(float));
    for (int x = 0; x < w; x++)
        k->cx[i][x] = (float)polynomial(x, k->margin, k->width, psf->x0, psf->xs, psf->px[basis]);
    for (int y = 0; y < h; y++)
        k->cy[i][y] = (float)polynomial(y, k->margin, k->height, psf->y0, psf->ys, psf->py[basis]);
    *most = largest(k->cx[i], (size_t)w) * largest(k->cy[i], (size_t)h);
    return RX_OK;
}

rx_status rx_blur_kernel_make(const rx_fft *fft, const rx_psf *psf, int width, int height,
                              rx_blur_kernel *dst, rx_error *err)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    const double peak = largest(psf->basis, n);
    *dst = (rx_blur_kernel){.width = width, .height = height, .margin = psf->size / 2};
    for (int i = 0; i < psf->nbasis; i++) {
        const float *stamp = psf->basis + n * (size_t)i;
        double most = 0;
        rx_status status = set_coefficients(dst, psf, i, &most, err);
        if (status != RX_OK)
            return status;
        if (!(most * largest(stamp, n) > NEGLIGIBLE * peak))
            continue;
        if (psf->px[i] != 0 || psf->py[i] != 0 || dst->n > 0)
            dst->varies = 1;
        float *spectrum = dst->spectrum[dst->n++] = rx_fft_complex(fft);
        if (spectrum == NULL)
            return rx_error_memory(err, rx_fft_complex_size(fft) * sizeof *spectrum);
        rx_convolve_spectrum(fft, stamp, psf->size, spectrum);
    }
    if (dst->n == 0)
        return rx_error_set(err, RX_INPUT, "the PSF vanishes on the tile; give another one");
    return RX_OK;
}

void rx_blur_kernel_clear(rx_blur_kernel *kernel)
{
    for (int i = 0; i < RX_PSF_MAX_BASIS; i++) {
        free(kernel->spectrum[i]);
        free(kernel->cx[i]);
        free(kernel->cy[i]);
    }
}

rx_status rx_blur_domain_make(int width, int height, int nthreads, int varies, rx_blur_domain *dst,
                              rx_error *err)
{
    RX_TRY(rx_fft_new(width, height, nthreads, &dst->fft, err));
    dst->half = rx_fft_complex(dst->fft);
    dst->sum = varies ? rx_fft_complex(dst->fft) : NULL;
    dst->back = varies ? rx_fft_real(dst->fft) : NULL;
    if (dst->half == NULL || (varies && (dst->sum == NULL || dst->back == NULL)))
        return rx_error_memory(err, rx_fft_complex_size(dst->fft) * sizeof(float));
    return RX_OK;
}

void rx_blur_domain_clear(rx_blur_domain *domain)
{
    rx_fft_free(domain->fft);
    free(domain->half);
    free(domain->sum);
    free(domain->back);
}

/* ---- on a domain ---- */

/* One term of a varying PSF on its way. */
typedef struct weighted {
    const rx_blur_kernel *kernel;
    const rx_blur_domain *domain;
    const rx_blur_rows *rows;
    int term;
} weighted;

static int read_weighted(void *user, int j, float *line)
{
    const weighted *w = user;
    const rx_blur_kernel *kernel = w->kernel;
    if (!w->rows->read(w->rows->user, j, line))
        return 0;
    const int margin = kernel->margin, x = w->domain->x, first = rx_max_int(x, -margin),
              last = rx_min_int(x + rx_fft_width(w->domain->fft), kernel->width + margin);
    const float c = kernel->cy[w->term][w->domain->y + j + margin],
                *cx = kernel->cx[w->term] + (first + margin);
    float *sky = line + (first - x);
#pragma omp simd
    for (int i = 0; i < last - first; i++)
        sky[i] *= c * cx[i];
    return 1;
}

/* Adds the weighted term to the sum, which is given away with the last one. */
static void write_weighted(void *user, int j, float *line)
{
    const weighted *w = user;
    const rx_blur_kernel *kernel = w->kernel;
    const int left = w->rows->left, n = w->rows->right - left, margin = kernel->margin;
    const float c = kernel->cy[w->term][w->domain->y + j + margin],
                *cx = kernel->cx[w->term] + (w->domain->x + left + margin), *part = line + left;
    float *row = w->domain->back + (size_t)j * (size_t)rx_fft_stride_real(w->domain->fft), *sum = row + left;
    if (w->term == 0)
        memset(sum, 0, (size_t)n * sizeof *sum);
#pragma omp simd
    for (int i = 0; i < n; i++)
        sum[i] += c * cx[i] * part[i];
    if (w->term == kernel->n - 1)
        w->rows->write(w->rows->user, j, row);
}

void rx_blur_domain_apply(const rx_blur_kernel *kernel, const rx_blur_domain *domain,
                          const rx_blur_rows *rows)
{
    weighted w = {kernel, domain, rows, 0};
    const rx_fft_rows plain = {rows->read, rows->write, rows->user, rows->top, rows->bottom};
    if (!kernel->varies) {
        rx_fft_filter_rows(domain->fft, &plain, kernel->spectrum[0], false, domain->half);
        return;
    }
    for (w.term = 0; w.term < kernel->n; w.term++) {
        rx_fft_forward_rows(domain->fft, read_weighted, &w, domain->half);
        rx_convolve_multiply(domain->fft, kernel->spectrum[w.term], domain->half, false, w.term > 0,
                             domain->sum);
    }
    rx_fft_inverse_rows(domain->fft, domain->sum, rows->top, rows->bottom, rows->write, rows->user);
}

void rx_blur_domain_adjoint(const rx_blur_kernel *kernel, const rx_blur_domain *domain,
                            const rx_blur_rows *rows)
{
    weighted w = {kernel, domain, rows, 0};
    const rx_fft_rows plain = {rows->read, rows->write, rows->user, rows->top, rows->bottom};
    if (!kernel->varies) {
        rx_fft_filter_rows(domain->fft, &plain, kernel->spectrum[0], true, domain->half);
        return;
    }
    rx_fft_forward_rows(domain->fft, rows->read, rows->user, domain->sum);
    for (w.term = 0; w.term < kernel->n; w.term++) {
        rx_convolve_multiply(domain->fft, kernel->spectrum[w.term], domain->sum, true, false, domain->half);
        rx_fft_inverse_rows(domain->fft, domain->half, rows->top, rows->bottom, write_weighted, &w);
    }
}

/* ---- the blocks of a tile ---- */

rx_status rx_blur_check(const rx_psf *psf, int width, int height, rx_error *err)
{
    if (psf == NULL)
        return rx_error_set(err, RX_INPUT, "no PSF is known for the restoration; give one by PSF_TYPE");
    if (psf->size < 1 || psf->size % 2 == 0 || psf->nbasis < 1 || psf->nbasis > RX_PSF_MAX_BASIS)
        return rx_error_set(err, RX_INPUT,
                            "a PSF of %d images of %d pixels cannot be used; give odd images, at most %d",
                            psf->nbasis, psf->size, RX_PSF_MAX_BASIS);
    if (psf->size > width || psf->size > height)
        return rx_error_set(
            err, RX_INPUT,
            "the PSF image of %d x %d pixels is larger than the tile of %d x %d; give a smaller PSF or "
            "a larger tile",
            psf->size, psf->size, width, height);
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    for (size_t i = 0; i < n * (size_t)psf->nbasis; i++)
        if (!isfinite(psf->basis[i]))
            return rx_error_set(err, RX_INPUT, "the PSF holds values that are not finite; give another one");
    double sum = 0;
    for (size_t i = 0; i < n; i++)
        sum += psf->basis[i];
    if (!(sum > 0))
        return rx_error_set(err, RX_INPUT, "the PSF has no flux; give one with a positive sum");
    return RX_OK;
}

static rx_blur_axis cut(int begin, int end, int most)
{
    const int n = (end - begin + most - 1) / most;
    return (rx_blur_axis){begin, end, (end - begin + n - 1) / n, n};
}

int rx_blur_side(int length, int margin)
{
    int best = rx_fft_good_size(length + 2 * margin);
    double least = COST_OF_OTHERS * best;
    for (size_t i = 0; i < sizeof domains / sizeof *domains; i++) {
        const int side = domains[i].side, most = side - 2 * margin;
        if (most < 1)
            continue;
        const double cost = ((length + most - 1) / most) * (double)side * domains[i].cost;
        if (cost < least) {
            least = cost;
            best = side;
        }
    }
    return best;
}

rx_status rx_blur_new(const rx_psf *psf, int width, int height, int nthreads, rx_blur **dst, rx_error *err)
{
    *dst = NULL;
    rx_status status = RX_OK;
    RX_TRY(rx_blur_check(psf, width, height, err));
    rx_blur *blur;
    RX_TRY(RX_MAKE(blur, 1, err));
    const int margin = psf->size / 2, threads = nthreads < 1 ? 1 : nthreads;
    const int side_x = rx_blur_side(width + 2 * margin, margin),
              side_y = rx_blur_side(height + 2 * margin, margin);
    blur->width = width;
    blur->height = height;
    blur->margin = margin;
    blur->tile_x = cut(0, width, side_x - 2 * margin);
    blur->tile_y = cut(0, height, side_y - 2 * margin);
    blur->sky_x = cut(-margin, width + margin, side_x - 2 * margin);
    blur->sky_y = cut(-margin, height + margin, side_y - 2 * margin);
    /* where there are fewer blocks than threads, these share each transform */
    blur->nwork = blur->tile_x.n * blur->tile_y.n >= threads ? threads : 1;
    blur->work = RX_NEW(rx_blur_domain, (size_t)blur->nwork);
    if (blur->work == NULL)
        status = rx_error_memory(err, 0);
    for (int i = 0; i < blur->nwork && status == RX_OK; i++)
        status = rx_blur_domain_make(side_x, side_y, blur->nwork > 1 ? 1 : threads, rx_psf_varies(psf),
                                     &blur->work[i], err);
    if (status == RX_OK)
        status = rx_blur_kernel_make(blur->work[0].fft, psf, width, height, &blur->kernel, err);
    if (status != RX_OK) {
        rx_blur_free(blur);
        return status;
    }
    *dst = blur;
    return RX_OK;
}

void rx_blur_free(rx_blur *blur)
{
    if (blur == NULL)
        return;
    rx_blur_kernel_clear(&blur->kernel);
    for (int i = 0; i < blur->nwork && blur->work != NULL; i++)
        rx_blur_domain_clear(&blur->work[i]);
    free(blur->work);
    free(blur);
}

void rx_blur_replace(rx_blur *blur, const float *stamp)
{
    rx_convolve_spectrum(blur->work[0].fft, stamp, 2 * blur->margin + 1, blur->kernel.spectrum[0]);
}

/* Blocks of what is made, from pieces of rows of the other. */
typedef struct block {
    const rx_blur *blur;
    const rx_blur_lines *lines;
    const rx_blur_axis *from_x, *from_y, *to_x, *to_y;
    int adjoint;
    int x, y, width, height; /* of what is made */
} block;

/* Row j of the domain, that is row y - margin + j. */
static int read_line(void *user, int j, float *line)
{
    const block *b = user;
    const int margin = b->blur->margin, side = rx_fft_width(b->blur->work[0].fft), left = b->x - margin;
    const int y = b->y - margin + j, first = rx_max_int(left, b->from_x->begin),
              last = rx_min_int(b->x + b->width + margin, b->from_x->end);
    if (j >= b->height + 2 * margin || y < b->from_y->begin || y >= b->from_y->end)
        return 0;
    memset(line, 0, (size_t)(first - left) * sizeof *line);
    b->lines->read(b->lines->user, y, first, last - first, line + (first - left));
    memset(line + (last - left), 0, (size_t)(side - (last - left)) * sizeof *line);
    return 1;
}

static void write_line(void *user, int j, float *line)
{
    const block *b = user;
    const int margin = b->blur->margin;
    b->lines->write(b->lines->user, b->y - margin + j, b->x, b->width, line + margin);
}

static void run_one(block b, const rx_blur_domain *work, int k)
{
    const int margin = b.blur->margin;
    b.x = b.to_x->begin + k % b.to_x->n * b.to_x->step;
    b.y = b.to_y->begin + k / b.to_x->n * b.to_y->step;
    b.width = rx_min_int(b.to_x->step, b.to_x->end - b.x);
    b.height = rx_min_int(b.to_y->step, b.to_y->end - b.y);
    rx_blur_domain domain = *work;
    domain.x = b.x - margin;
    domain.y = b.y - margin;
    const rx_blur_rows rows = {.read = read_line,
                               .write = write_line,
                               .user = &b,
                               .left = margin,
                               .right = margin + b.width,
                               .top = margin,
                               .bottom = margin + b.height};
    (b.adjoint ? rx_blur_domain_adjoint : rx_blur_domain_apply)(&b.blur->kernel, &domain, &rows);
}

static void run_blocks(block b, int first, int last)
{
    const rx_blur *blur = b.blur;
    const int begin = first * b.to_x->n, end = last * b.to_x->n;
    if (blur->nwork == 1) { /* within a region, even of one, each transform would be given new threads */
        for (int k = begin; k < end; k++)
            run_one(b, blur->work, k);
        return;
    }
#pragma omp parallel for schedule(dynamic, 1) num_threads(blur->nwork)
    for (int k = begin; k < end; k++)
        run_one(b, &blur->work[omp_get_thread_num()], k);
}

void rx_blur_apply_rows(const rx_blur *blur, const rx_blur_lines *lines, int first, int last)
{
    run_blocks((block){.blur = blur,
                       .lines = lines,
                       .from_x = &blur->sky_x,
                       .from_y = &blur->sky_y,
                       .to_x = &blur->tile_x,
                       .to_y = &blur->tile_y},
               first, last);
}

void rx_blur_adjoint_rows(const rx_blur *blur, const rx_blur_lines *lines, int first, int last)
{
    run_blocks((block){.blur = blur,
                       .lines = lines,
                       .from_x = &blur->tile_x,
                       .from_y = &blur->tile_y,
                       .to_x = &blur->sky_x,
                       .to_y = &blur->sky_y,
                       .adjoint = 1},
               first, last);
}

void rx_blur_adjoint(const rx_blur *blur, const rx_blur_lines *lines)
{
    rx_blur_adjoint_rows(blur, lines, 0, blur->sky_y.n);
}

/* ---- planes ---- */

typedef struct planes {
    const rx_blur *blur;
    const float *from;
    float *to;
} planes;

static size_t sky_at(const rx_blur *blur, int y, int x)
{
    return rx_blur_row(blur, y) - (size_t)blur->margin + (size_t)(x + blur->margin);
}

static size_t tile_at(const rx_blur *blur, int y, int x)
{
    return (size_t)y * (size_t)blur->width + (size_t)x;
}

static void read_sky(void *user, int y, int x, int n, float *line)
{
    const planes *p = user;
    memcpy(line, p->from + sky_at(p->blur, y, x), (size_t)n * sizeof *line);
}

static void write_sky(void *user, int y, int x, int n, const float *line)
{
    const planes *p = user;
    memcpy(p->to + sky_at(p->blur, y, x), line, (size_t)n * sizeof *line);
}

static void read_tile(void *user, int y, int x, int n, float *line)
{
    const planes *p = user;
    memcpy(line, p->from + tile_at(p->blur, y, x), (size_t)n * sizeof *line);
}

static void write_tile(void *user, int y, int x, int n, const float *line)
{
    const planes *p = user;
    memcpy(p->to + tile_at(p->blur, y, x), line, (size_t)n * sizeof *line);
}

void rx_blur_plane(const rx_blur *blur, const float *sky, float *tile)
{
    planes p = {blur, sky, tile};
    rx_blur_apply_rows(blur, &(rx_blur_lines){read_sky, write_tile, &p}, 0, blur->tile_y.n);
}

void rx_blur_adjoint_plane(const rx_blur *blur, const float *tile, float *sky)
{
    planes p = {blur, tile, sky};
    rx_blur_adjoint(blur, &(rx_blur_lines){read_tile, write_sky, &p});
}

float *rx_blur_sky(const rx_blur *blur)
{
    return RX_NEW(float, rx_blur_sky_size(blur));
}

size_t rx_blur_sky_size(const rx_blur *blur)
{
    return (size_t)(blur->width + 2 * blur->margin) * (size_t)(blur->height + 2 * blur->margin);
}

size_t rx_blur_row(const rx_blur *blur, int y)
{
    return (size_t)(y + blur->margin) * (size_t)(blur->width + 2 * blur->margin) + (size_t)blur->margin;
}
