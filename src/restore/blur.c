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

struct rx_blur_work {
    rx_fft *fft;
    float *half;       /* complex */
    float *sum, *back; /* complex and real, of a varying PSF */
};

static double clamp(double v, double low, double high)
{
    return v < low ? low : v > high ? high : v;
}

/* ((pixel - zero) / scale)^power at domain pixel i, held at its value on the tile's edge. */
static double polynomial(int i, int margin, int n, double zero, double scale, int power)
{
    double t = (clamp(i - margin, 0, n - 1) - zero) / scale, v = 1;
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

/* The coefficients of one basis image into blur->cx, cy[nterms]; *peak is the largest product. */
static rx_status set_coefficients(rx_blur *blur, const rx_psf *psf, int basis, double *peak, rx_error *err)
{
    const int w = blur->width + 2 * blur->margin, h = blur->height + 2 * blur->margin, i = blur->nterms;
    if (blur->cx[i] == NULL)
        blur->cx[i] = RX_NEW(float, (size_t)w);
    if (blur->cy[i] == NULL)
        blur->cy[i] = RX_NEW(float, (size_t)h);
    if (blur->cx[i] == NULL || blur->cy[i] == NULL)
        return rx_error_memory(err, (size_t)(w + h) * sizeof(float));
    for (int x = 0; x < w; x++)
        blur->cx[i][x] = (float)polynomial(x, blur->margin, blur->width, psf->x0, psf->xs, psf->px[basis]);
    for (int y = 0; y < h; y++)
        blur->cy[i][y] = (float)polynomial(y, blur->margin, blur->height, psf->y0, psf->ys, psf->py[basis]);
    *peak = largest(blur->cx[i], (size_t)w) * largest(blur->cy[i], (size_t)h);
    return RX_OK;
}

static rx_status add_terms(rx_blur *blur, const rx_psf *psf, rx_error *err)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    const double peak = largest(psf->basis, n);
    const rx_fft *fft = blur->work[0].fft;
    for (int i = 0; i < psf->nbasis; i++) {
        const float *stamp = psf->basis + n * (size_t)i;
        double most = 0;
        rx_status status = set_coefficients(blur, psf, i, &most, err);
        if (status != RX_OK)
            return status;
        if (!(most * largest(stamp, n) > NEGLIGIBLE * peak))
            continue;
        if (psf->px[i] != 0 || psf->py[i] != 0 || blur->nterms > 0)
            blur->varies = 1;
        float *kernel = blur->kernel[blur->nterms++] = rx_fft_complex(fft);
        if (kernel == NULL)
            return rx_error_memory(err, rx_fft_complex_size(fft) * sizeof *kernel);
        rx_convolve_spectrum(fft, stamp, psf->size, blur->plane, kernel);
    }
    if (blur->nterms == 0)
        return rx_error_set(err, RX_INPUT, "the PSF vanishes on the tile; give another one");
    return RX_OK;
}

static rx_blur_axis cut(int begin, int end, int most)
{
    const int n = (end - begin + most - 1) / most;
    return (rx_blur_axis){begin, end, (end - begin + n - 1) / n, n};
}

/* The cheapest domain for blocks of `length` pixels with so many around; 0: none is large enough. */
static int choose_domain(int length, int margin)
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

/* Blocks, and the threads' planes; where there are fewer blocks than threads, these share each transform. */
static rx_status make_blocks(rx_blur *blur, int nthreads, rx_error *err)
{
    const int margin = blur->margin, threads = nthreads < 1 ? 1 : nthreads;
    const int side_x = choose_domain(blur->width + 2 * margin, margin),
              side_y = choose_domain(blur->height + 2 * margin, margin);
    blur->tile_x = cut(0, blur->width, side_x - 2 * margin);
    blur->tile_y = cut(0, blur->height, side_y - 2 * margin);
    blur->sky_x = cut(-margin, blur->width + margin, side_x - 2 * margin);
    blur->sky_y = cut(-margin, blur->height + margin, side_y - 2 * margin);
    blur->nwork = blur->tile_x.n * blur->tile_y.n >= threads ? threads : 1;
    blur->work = RX_NEW(rx_blur_work, (size_t)blur->nwork);
    if (blur->work == NULL)
        return rx_error_memory(err, 0);
    for (int i = 0; i < blur->nwork; i++) {
        rx_blur_work *work = &blur->work[i];
        rx_status status = rx_fft_new(side_x, side_y, blur->nwork > 1 ? 1 : threads, &work->fft, err);
        if (status != RX_OK)
            return status;
        if ((work->half = rx_fft_complex(work->fft)) == NULL)
            return rx_error_memory(err, rx_fft_complex_size(work->fft) * sizeof(float));
    }
    blur->plane = rx_fft_real(blur->work[0].fft);
    return blur->plane != NULL ? RX_OK : rx_error_memory(err, 0);
}

/* What a PSF that varies needs besides. */
static rx_status make_sums(rx_blur *blur, rx_error *err)
{
    for (int i = 0; i < blur->nwork && blur->varies; i++) {
        rx_blur_work *work = &blur->work[i];
        work->sum = rx_fft_complex(work->fft);
        work->back = rx_fft_real(work->fft);
        if (work->sum == NULL || work->back == NULL)
            return rx_error_memory(err, rx_fft_complex_size(work->fft) * sizeof(float));
    }
    return RX_OK;
}

rx_status rx_blur_new(const rx_psf *psf, int width, int height, int nthreads, rx_blur **dst, rx_error *err)
{
    *dst = NULL;
    rx_status status = rx_blur_check(psf, width, height, err);
    if (status != RX_OK)
        return status;
    rx_blur *blur = RX_NEW(rx_blur, 1);
    if (blur == NULL)
        return rx_error_memory(err, sizeof *blur);
    blur->width = width;
    blur->height = height;
    blur->size = psf->size;
    blur->margin = psf->size / 2;
    status = make_blocks(blur, nthreads, err);
    if (status == RX_OK)
        status = add_terms(blur, psf, err);
    if (status == RX_OK)
        status = make_sums(blur, err);
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
    for (int i = 0; i < RX_PSF_MAX_BASIS; i++) {
        free(blur->kernel[i]);
        free(blur->cx[i]);
        free(blur->cy[i]);
    }
    for (int i = 0; i < blur->nwork && blur->work != NULL; i++) {
        rx_fft_free(blur->work[i].fft);
        free(blur->work[i].half);
        free(blur->work[i].sum);
        free(blur->work[i].back);
    }
    free(blur->work);
    free(blur->plane);
    free(blur);
}

void rx_blur_replace(rx_blur *blur, const float *stamp)
{
    rx_convolve_spectrum(blur->work[0].fft, stamp, blur->size, blur->plane, blur->kernel[0]);
}

/* ---- one block ---- */

typedef struct block {
    const rx_blur *blur;
    const rx_blur_work *work;
    const rx_blur_lines *lines;
    int x, y, width, height; /* of what is made */
    const rx_blur_axis *from_x, *from_y;
    int term; /* of a varying PSF */
    int last; /* term: the sum is complete */
} block;

/* Row j of the domain, that is row y - margin + j. */
static int read_line(void *user, int j, float *line)
{
    const block *b = user;
    const int margin = b->blur->margin, side = rx_fft_width(b->work->fft), left = b->x - margin;
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

/* The same of the term's weighted sky. */
static int read_weighted(void *user, int j, float *line)
{
    const block *b = user;
    const rx_blur *blur = b->blur;
    if (!read_line(user, j, line))
        return 0;
    const int left = b->x - blur->margin, first = rx_max_int(left, b->from_x->begin),
              last = rx_min_int(b->x + b->width + blur->margin, b->from_x->end);
    const float c = blur->cy[b->term][b->y + j], *cx = blur->cx[b->term] + (first + blur->margin);
    float *sky = line + (first - left);
#pragma omp simd
    for (int x = 0; x < last - first; x++)
        sky[x] *= c * cx[x];
    return 1;
}

/* Adds the weighted term to the sum, which is given away with the last one. */
static void write_weighted(void *user, int j, float *line)
{
    const block *b = user;
    const rx_blur *blur = b->blur;
    const int y = b->y - blur->margin + j;
    const float c = blur->cy[b->term][y + blur->margin], *cx = blur->cx[b->term] + (b->x + blur->margin);
    float *sum = b->work->back + (size_t)j * (size_t)rx_fft_stride_real(b->work->fft) + blur->margin;
    const float *part = line + blur->margin;
    if (b->term == 0)
        memset(sum, 0, (size_t)b->width * sizeof *sum);
#pragma omp simd
    for (int x = 0; x < b->width; x++)
        sum[x] += c * cx[x] * part[x];
    if (b->last)
        b->lines->write(b->lines->user, y, b->x, b->width, sum);
}

static void apply_block(block *b)
{
    const rx_blur *blur = b->blur;
    const rx_blur_work *work = b->work;
    const int first = blur->margin, last = first + b->height;
    if (!blur->varies) {
        rx_fft_filter_rows(work->fft, read_line, blur->kernel[0], false, work->half, first, last, write_line,
                           b);
        return;
    }
    for (b->term = 0; b->term < blur->nterms; b->term++) {
        rx_fft_forward_rows(work->fft, read_weighted, b, work->half);
        rx_convolve_multiply(work->fft, blur->kernel[b->term], work->half, false, b->term > 0, work->sum);
    }
    rx_fft_inverse_rows(work->fft, work->sum, first, last, write_line, b);
}

static void adjoin_block(block *b)
{
    const rx_blur *blur = b->blur;
    const rx_blur_work *work = b->work;
    const int first = blur->margin, last = first + b->height;
    if (!blur->varies) {
        rx_fft_filter_rows(work->fft, read_line, blur->kernel[0], true, work->half, first, last, write_line,
                           b);
        return;
    }
    rx_fft_forward_rows(work->fft, read_line, b, work->sum);
    for (b->term = 0; b->term < blur->nterms; b->term++) {
        b->last = b->term == blur->nterms - 1;
        rx_convolve_multiply(work->fft, blur->kernel[b->term], work->sum, true, false, work->half);
        rx_fft_inverse_rows(work->fft, work->half, first, last, write_weighted, b);
    }
}

static void run_one(block b, rx_blur_work *work, const rx_blur_axis *to_x, const rx_blur_axis *to_y, int k,
                    void (*run)(block *))
{
    b.work = work;
    b.x = to_x->begin + k % to_x->n * to_x->step;
    b.y = to_y->begin + k / to_x->n * to_y->step;
    b.width = rx_min_int(to_x->step, to_x->end - b.x);
    b.height = rx_min_int(to_y->step, to_y->end - b.y);
    run(&b);
}

static void run_blocks(block b, const rx_blur_axis *to_x, const rx_blur_axis *to_y, int first, int last,
                       void (*run)(block *))
{
    const rx_blur *blur = b.blur;
    const int begin = first * to_x->n, end = last * to_x->n;
    if (blur->nwork == 1) { /* within a region, even of one, each transform would be given new threads */
        for (int k = begin; k < end; k++)
            run_one(b, blur->work, to_x, to_y, k, run);
        return;
    }
#pragma omp parallel for schedule(dynamic, 1) num_threads(blur->nwork)
    for (int k = begin; k < end; k++)
        run_one(b, &blur->work[omp_get_thread_num()], to_x, to_y, k, run);
}

void rx_blur_apply_rows(const rx_blur *blur, const rx_blur_lines *lines, int first, int last)
{
    const block b = {.blur = blur, .lines = lines, .from_x = &blur->sky_x, .from_y = &blur->sky_y};
    run_blocks(b, &blur->tile_x, &blur->tile_y, first, last, apply_block);
}

void rx_blur_adjoint_rows(const rx_blur *blur, const rx_blur_lines *lines, int first, int last)
{
    const block b = {.blur = blur, .lines = lines, .from_x = &blur->tile_x, .from_y = &blur->tile_y};
    run_blocks(b, &blur->sky_x, &blur->sky_y, first, last, adjoin_block);
}

void rx_blur_apply(const rx_blur *blur, const rx_blur_lines *lines)
{
    rx_blur_apply_rows(blur, lines, 0, blur->tile_y.n);
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
    rx_blur_apply(blur, &(rx_blur_lines){read_sky, write_tile, &p});
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
