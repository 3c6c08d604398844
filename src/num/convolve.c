/* Cyclic convolution by spectra, and normalised Gaussian smoothing. */
#include "num/convolve.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "base/simd.h"

/* A stamp around the origin of a cyclic plane. */
typedef struct stamp_rows {
    const float *stamp;
    int size, width, height;
} stamp_rows;

static int read_stamp(void *user, int y, float *line)
{
    const stamp_rows *s = user;
    const int centre = s->size / 2, j = (y + centre) % s->height;
    const double scale = 1.0 / ((double)s->width * s->height);
    if (j >= s->size)
        return 0;
    memset(line, 0, (size_t)s->width * sizeof *line);
    for (int i = 0; i < s->size; i++)
        line[(i - centre + s->width) % s->width] =
            (float)(s->stamp[(size_t)j * (size_t)s->size + (size_t)i] * scale);
    return 1;
}

void rx_convolve_spectrum(const rx_fft *fft, const float *stamp, int size, float *spectrum)
{
    stamp_rows rows = {stamp, size, rx_fft_width(fft), rx_fft_height(fft)};
    rx_fft_forward_rows(fft, read_stamp, &rows, spectrum);
}

/* n complex numbers: d (+)= k s with the sign of Im k given. */
static void multiply_column(int n, const float *k, const float *s, float sign, bool add, float *d)
{
    for (int i = 0; i < n; i++) {
        float kr = k[2 * i], ki = sign * k[2 * i + 1], sr = s[2 * i], si = s[2 * i + 1];
        float re = kr * sr - ki * si, im = kr * si + ki * sr;
        d[2 * i] = add ? d[2 * i] + re : re;
        d[2 * i + 1] = add ? d[2 * i + 1] + im : im;
    }
}

void rx_convolve_multiply(const rx_fft *fft, const float *kernel, const float *src, bool conjugate, bool add,
                          float *dst)
{
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(fft);
#pragma omp parallel for schedule(static) num_threads(rx_fft_threads(fft))
    for (int u = 0; u <= rx_fft_width(fft) / 2; u++)
        multiply_column(rx_fft_height(fft), kernel + u * stride, src + u * stride, conjugate ? -1.0f : 1.0f,
                        add, dst + u * stride);
}

void rx_convolve_divide(const rx_fft *fft, const float *numerator, const float *denominator, double delta,
                        float *dst)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft);
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(fft);
    const double pixels = (double)w * h;
    for (int u = 0; u <= w / 2; u++)
        for (int v = 0; v < h; v++) {
            const size_t k = (size_t)u * stride + 2 * (size_t)v;
            const double re = denominator[k] * pixels, im = denominator[k + 1] * pixels;
            const double nr = numerator[k], ni = numerator[k + 1];
            const double gain = (1 + delta) / (re * re + im * im + delta);
            dst[k] = (float)(gain * (nr * re + ni * im));
            dst[k + 1] = (float)(gain * (ni * re - nr * im));
        }
}

void rx_convolve(const rx_fft *fft, const float *kernel, const float *src, float *half, float *dst)
{
    rx_fft_filter(fft, src, kernel, false, half, dst);
}

void rx_correlate(const rx_fft *fft, const float *kernel, const float *src, float *half, float *dst)
{
    rx_fft_filter(fft, src, kernel, true, half, dst);
}

/* FWHM = 2 sqrt(2 ln 2) sigma */
static double gauss_sigma(double fwhm)
{
    return fwhm / RX_FWHM_SIGMA;
}

int rx_gauss_radius(double fwhm)
{
    return (int)ceil(4.5 * gauss_sigma(fwhm) + 0.5);
}

void rx_gauss_weights(double fwhm, int radius, float *weights)
{
    const double unit = 1 / (gauss_sigma(fwhm) * sqrt(2.0));
    double sum = erf((radius + 0.5) * unit);
    for (int i = -radius; i <= radius; i++)
        weights[i + radius] = (float)((erf((i + 0.5) * unit) - erf((i - 0.5) * unit)) / (2 * sum));
}

/* Sums of so many pixels of a row grow together, each in the order of the weights; rows of a band. */
enum { TOGETHER = 64, BAND = 256 };

typedef struct gauss {
    int width, height, radius, nthreads;
    const uint8_t *mask;
    float *weights;   /* [2 radius + 1] */
    float *num, *den; /* sums along x of some rows */
    float *good;      /* [nthreads][width] */
    float *open;      /* den of a row without masked pixels: [width] */
    uint8_t *masked;  /* rows that have some: [height] */
} gauss;

RX_SIMD static int any_set(const uint8_t *mask, int n)
{
    int any = 0;
#pragma omp simd reduction(| : any)
    for (int i = 0; i < n; i++)
        any |= mask[i];
    return any != 0;
}

/* Along x: dst = G src, for TOGETHER pixels from x0 on of one row. */
RX_SIMD static void smooth_row(const gauss *g, int x0, const float *src, float *restrict dst)
{
    const int width = g->width, x1 = x0 + TOGETHER < width ? x0 + TOGETHER : width;
    float n[TOGETHER] = {0};
    for (int i = -g->radius; i <= g->radius; i++) {
        const int first = x0 + i < 0 ? -i : x0, last = x1 + i > width ? width - i : x1;
        const float weight = g->weights[i + g->radius];
#pragma omp simd
        for (int x = first; x < last; x++)
            n[x - x0] += weight * src[x + i];
    }
    for (int x = x0; x < x1; x++)
        dst[x] = n[x - x0];
}

/* Rows y0 .. y1 - 1 of the image along x, into rows of num and den from `first` on: num = G f, den = G good; f and `good` are
 * 0 at masked pixels. */
static void smooth_rows(const gauss *g, int y0, int y1, int first, const float *image)
{
#pragma omp parallel for schedule(static) num_threads(g->nthreads)
    for (int y = y0; y < y1; y++) {
        const size_t row = (size_t)y * g->width, at = (size_t)(first + y - y0) * g->width;
        float *good = g->good + (size_t)omp_get_thread_num() * g->width;
        for (int x = 0; x < g->width; x += TOGETHER)
            smooth_row(g, x, image + row, g->num + at);
        memcpy(g->den + at, g->open, (size_t)g->width * sizeof *g->den);
        if (!g->masked[y])
            continue;
        for (int x = 0; x < g->width; x++)
            good[x] = g->mask[row + x] == 0 ? 1.0f : 0.0f;
        for (int x = 0; x < g->width; x += TOGETHER)
            smooth_row(g, x, good, g->den + at);
    }
}

/* Along y: dst = G src for `count` pixels of row y; src at the first of them. */
RX_SIMD static void smooth_column(const gauss *g, int y, int count, const float *src, float *restrict dst)
{
    const int first = y < g->radius ? -y : -g->radius;
    const int last = y + g->radius >= g->height ? g->height - 1 - y : g->radius;
    for (int i = first; i <= last; i++) {
        const float weight = g->weights[i + g->radius], *from = src + (ptrdiff_t)i * g->width;
#pragma omp simd
        for (int x = 0; x < count; x++)
            dst[x] += weight * from[x];
    }
}

/* Rows y0 .. y1 - 1 of the image, from num and den whose first row is row `top` of the image: along y, then the quotient, at
 * good pixels. */
static void smooth_columns(const gauss *g, int y0, int y1, int top, float *image)
{
#pragma omp parallel for schedule(static) num_threads(g->nthreads)
    for (int y = y0; y < y1; y++) {
        const int low = y > g->radius ? y - g->radius : 0,
                  high = y + g->radius < g->height ? y + g->radius + 1 : g->height,
                  open = !any_set(g->masked + low, high - low);
        float weight = 0;
        for (int i = low; i < high; i++)
            weight += g->weights[i - y + g->radius];
        for (int x = 0; x < g->width; x += TOGETHER) {
            const size_t at = (size_t)(y - top) * g->width + x, k = (size_t)y * g->width + x;
            const int count = x + TOGETHER < g->width ? TOGETHER : g->width - x;
            float n[TOGETHER] = {0}, d[TOGETHER] = {0};
            smooth_column(g, y, count, g->num + at, n);
            if (!open)
                smooth_column(g, y, count, g->den + at, d);
            /* a good pixel counts itself, hence a den above 0 there */
            for (int i = 0; i < count; i++)
                image[k + i] = g->masked[y] && g->mask[k + i] != 0
                                   ? 0.0f
                                   : n[i] / (open ? weight * g->open[x + i] : d[i]);
        }
    }
}

/* Band by band: what the next one needs of rows that this one overwrites is in num and den already. */
static void smooth_bands(const gauss *g, float *image)
{
    int done = 0; /* rows of the image that num and den have had */
    for (int y0 = 0; y0 < g->height; y0 += BAND) {
        const int y1 = y0 + BAND < g->height ? y0 + BAND : g->height;
        const int top = y0 > g->radius ? y0 - g->radius : 0;
        const int end = y1 + g->radius < g->height ? y1 + g->radius : g->height;
        const int before = y0 - BAND > g->radius ? y0 - BAND - g->radius : 0; /* the last band's top */
        if (y0 > 0) {
            const size_t from = (size_t)(top - before) * g->width, n = (size_t)(done - top) * g->width;
            memmove(g->num, g->num + from, n * sizeof *g->num);
            memmove(g->den, g->den + from, n * sizeof *g->den);
        }
        smooth_rows(g, done, end, done - top, image);
        done = end;
        smooth_columns(g, y0, y1, top, image);
    }
}

static void clear_masked(int width, int height, const uint8_t *mask, int nthreads, float *image)
{
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < height; y++)
        for (size_t k = (size_t)y * width; k < (size_t)(y + 1) * width; k++)
            if (mask[k] != 0)
                image[k] = 0;
}

rx_status rx_gauss_masked(int width, int height, double fwhm, const uint8_t *mask, int nthreads, float *image,
                          rx_error *err)
{
    gauss g = {.width = width, .height = height, .mask = mask, .nthreads = nthreads < 1 ? 1 : nthreads};
    rx_status status = RX_OK;
    if (mask != NULL)
        clear_masked(width, height, mask, g.nthreads, image);
    if (!(fwhm > 0))
        return RX_OK;
    g.radius = rx_gauss_radius(fwhm);
    const size_t rows = (size_t)BAND + 2 * (size_t)g.radius,
                 most = rows < (size_t)height ? rows : (size_t)height;
    RX_TRY_EXIT(RX_MAKE(g.weights, 2 * (size_t)g.radius + 1, err));
    RX_TRY_EXIT(RX_MAKE(g.num, most * (size_t)width, err));
    RX_TRY_EXIT(RX_MAKE(g.den, most * (size_t)width, err));
    RX_TRY_EXIT(RX_MAKE(g.good, (size_t)g.nthreads * (size_t)width, err));
    RX_TRY_EXIT(RX_MAKE(g.open, (size_t)width, err));
    RX_TRY_EXIT(RX_MAKE(g.masked, (size_t)height, err));
    rx_gauss_weights(fwhm, g.radius, g.weights);
    for (int x = 0; x < width; x++)
        g.good[x] = 1;
    for (int x = 0; x < width; x += TOGETHER)
        smooth_row(&g, x, g.good, g.open);
    for (int y = 0; mask != NULL && y < height; y++)
        g.masked[y] = (uint8_t)any_set(mask + (size_t)y * (size_t)width, width);
    smooth_bands(&g, image);
exit:
    free(g.weights);
    free(g.num);
    free(g.den);
    free(g.open);
    free(g.masked);
    free(g.good);
    return status;
}
