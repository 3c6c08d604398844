/* Real 2-D FFT from one-dimensional FFTW plans, the same bytes for any number of threads. */
#include "num/fft.h"

#include <fftw3.h>
#include <limits.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

/* Columns transformed together: eight complex numbers are one cache line. */
enum { GROUP = 8, REAL_ALIGN = 16 };

struct rx_fft {
    int width, height, nthreads;
    int stride_real, stride_complex;
    int stride_column;      /* complex numbers between two columns of a group in scratch */
    fftwf_complex *scratch; /* [nthreads][GROUP][stride_column] */
    fftwf_plan row_forward, row_inverse;
    fftwf_plan group_forward, group_inverse;
};

static int round_up(int n, int unit)
{
    return (n + unit - 1) / unit * unit;
}

int rx_fft_good_size(int n)
{
    static const int factors[] = {2, 3, 5, 7};
    if (n > INT_MAX - 4)
        return 0;
    for (int size = n <= 2 ? 2 : n + n % 2; size < INT_MAX - 2; size += 2) {
        int rest = size;
        for (int i = 0; i < 4; i++)
            while (rest % factors[i] == 0)
                rest /= factors[i];
        if (rest == 1)
            return size;
    }
    return 0;
}

/* Plans are made on planes that are thrown away: executed later on others of the same
 * alignment (64 bytes), which is what FFTW's new-array calls ask for. */
static int make_plans(rx_fft *fft)
{
    const int w = fft->width, h = fft->height, s = fft->stride_column;
    float *real = RX_NEW(float, fft->stride_real);
    fftwf_complex *half = RX_NEW(fftwf_complex, fft->stride_complex);
    if (real != NULL && half != NULL) {
/* FFTW's planner is not thread-safe, and tiles of a campaign run side by side. */
#pragma omp critical(rx_fft_planner)
        {
            fft->row_forward = fftwf_plan_dft_r2c_1d(w, real, half, FFTW_ESTIMATE);
            fft->row_inverse = fftwf_plan_dft_c2r_1d(w, half, real, FFTW_ESTIMATE | FFTW_DESTROY_INPUT);
            fftwf_complex *g = fft->scratch;
            fft->group_forward =
                fftwf_plan_many_dft(1, &h, GROUP, g, NULL, 1, s, g, NULL, 1, s, FFTW_FORWARD, FFTW_ESTIMATE);
            fft->group_inverse =
                fftwf_plan_many_dft(1, &h, GROUP, g, NULL, 1, s, g, NULL, 1, s, FFTW_BACKWARD, FFTW_ESTIMATE);
        }
    }
    free(real);
    free(half);
    return fft->row_forward != NULL && fft->row_inverse != NULL && fft->group_forward != NULL &&
           fft->group_inverse != NULL;
}

rx_status rx_fft_new(int width, int height, int nthreads, rx_fft **dst, rx_error *err)
{
    *dst = NULL;
    if (width < 1 || height < 1 || width > INT_MAX / 4 || height > INT_MAX / 4)
        return rx_error_set(err, RX_INPUT,
                            "an image of %d x %d pixels cannot be Fourier transformed; "
                            "give a smaller one",
                            width, height);
    rx_fft *fft = RX_NEW(rx_fft, 1);
    if (fft == NULL)
        return rx_error_memory(err, sizeof *fft);
    fft->width = width;
    fft->height = height;
    fft->nthreads = nthreads < 1 ? 1 : nthreads;
    fft->stride_real = round_up(width, REAL_ALIGN);
    fft->stride_complex = round_up(width / 2 + 1, GROUP);
    /* one more cache line than needed, against strides of a power of two */
    fft->stride_column = round_up(height, GROUP) + GROUP;
    size_t scratch = (size_t)fft->nthreads * GROUP * (size_t)fft->stride_column;
    fft->scratch = RX_NEW(fftwf_complex, scratch);
    if (fft->scratch == NULL || !make_plans(fft)) {
        rx_fft_free(fft);
        return rx_error_memory(err, scratch * sizeof(fftwf_complex));
    }
    *dst = fft;
    return RX_OK;
}

void rx_fft_free(rx_fft *fft)
{
    if (fft == NULL)
        return;
#pragma omp critical(rx_fft_planner)
    {
        fftwf_destroy_plan(fft->row_forward);
        fftwf_destroy_plan(fft->row_inverse);
        fftwf_destroy_plan(fft->group_forward);
        fftwf_destroy_plan(fft->group_inverse);
    }
    free(fft->scratch);
    free(fft);
}

float *rx_fft_real(const rx_fft *fft)
{
    return RX_NEW(float, (size_t)fft->height *(size_t)fft->stride_real);
}

float *rx_fft_complex(const rx_fft *fft)
{
    return RX_NEW(float, 2 * (size_t)fft->height * (size_t)fft->stride_complex);
}

int rx_fft_width(const rx_fft *fft)
{
    return fft->width;
}

int rx_fft_height(const rx_fft *fft)
{
    return fft->height;
}

int rx_fft_threads(const rx_fft *fft)
{
    return fft->nthreads;
}

int rx_fft_stride_real(const rx_fft *fft)
{
    return fft->stride_real;
}

int rx_fft_stride_complex(const rx_fft *fft)
{
    return fft->stride_complex;
}

/* A group of columns to scratch, column by column, where each transform runs through neighbouring memory. */
static void gather(const rx_fft *fft, fftwf_complex *corner, fftwf_complex *scratch)
{
    const size_t stride = (size_t)fft->stride_complex, column = (size_t)fft->stride_column;
    for (size_t y = 0; y < (size_t)fft->height; y++)
        for (size_t i = 0; i < GROUP; i++)
            memcpy(scratch[i * column + y], corner[y * stride + i], sizeof(fftwf_complex));
}

static void scatter(const rx_fft *fft, fftwf_complex *scratch, fftwf_complex *corner)
{
    const size_t stride = (size_t)fft->stride_complex, column = (size_t)fft->stride_column;
    for (size_t y = 0; y < (size_t)fft->height; y++)
        for (size_t i = 0; i < GROUP; i++)
            memcpy(corner[y * stride + i], scratch[i * column + y], sizeof(fftwf_complex));
}

/* scratch *= kernel, or its complex conjugate for sign = -1. */
static void multiply(const rx_fft *fft, const fftwf_complex *kernel, float sign, fftwf_complex *scratch)
{
    const size_t stride = (size_t)fft->stride_complex, column = (size_t)fft->stride_column;
    for (size_t y = 0; y < (size_t)fft->height; y++)
        for (size_t i = 0; i < GROUP; i++) {
            const float kr = kernel[y * stride + i][0], ki = sign * kernel[y * stride + i][1];
            float *s = scratch[i * column + y];
            const float sr = s[0], si = s[1];
            s[0] = kr * sr - ki * si;
            s[1] = kr * si + ki * sr;
        }
}

/* The first groups of columns of plane [height][stride_complex] in place: transformed by `first`, multiplied
 * by the kernel, transformed by `second`; kernel and second are NULL where only one transform is wanted. */
static void pass_columns(const rx_fft *fft, int groups, fftwf_plan first, const fftwf_complex *kernel,
                         float sign, fftwf_plan second, fftwf_complex *plane)
{
#pragma omp parallel for schedule(static) num_threads(fft->nthreads)
    for (int g = 0; g < groups; g++) {
        fftwf_complex *scratch =
            fft->scratch + (size_t)omp_get_thread_num() * GROUP * (size_t)fft->stride_column;
        gather(fft, plane + (size_t)g * GROUP, scratch);
        fftwf_execute_dft(first, scratch, scratch);
        if (kernel != NULL) {
            multiply(fft, kernel + (size_t)g * GROUP, sign, scratch);
            fftwf_execute_dft(second, scratch, scratch);
        }
        scatter(fft, scratch, plane + (size_t)g * GROUP);
    }
}

static int all_groups(const rx_fft *fft)
{
    return fft->stride_complex / GROUP;
}

static void rows_forward(const rx_fft *fft, const float *real, fftwf_complex *plane)
{
    /* FFTW's type is not const; an out-of-place r2c plan in one dimension preserves its input */
    float *rows = (float *)(size_t)real;
#pragma omp parallel for schedule(static) num_threads(fft->nthreads)
    for (int y = 0; y < fft->height; y++)
        fftwf_execute_dft_r2c(fft->row_forward, rows + (size_t)y * fft->stride_real,
                              plane + (size_t)y * fft->stride_complex);
}

static void rows_inverse(const rx_fft *fft, fftwf_complex *plane, float *real)
{
#pragma omp parallel for schedule(static) num_threads(fft->nthreads)
    for (int y = 0; y < fft->height; y++)
        fftwf_execute_dft_c2r(fft->row_inverse, plane + (size_t)y * fft->stride_complex,
                              real + (size_t)y * fft->stride_real);
}

void rx_fft_forward(const rx_fft *fft, const float *real, float *complex_out)
{
    fftwf_complex *plane = (fftwf_complex *)complex_out;
    rows_forward(fft, real, plane);
    pass_columns(fft, all_groups(fft), fft->group_forward, NULL, 1, NULL, plane);
}

void rx_fft_forward_low(const rx_fft *fft, const float *real, int columns, float *complex_out)
{
    const int groups = (columns + GROUP - 1) / GROUP;
    fftwf_complex *plane = (fftwf_complex *)complex_out;
    rows_forward(fft, real, plane);
    pass_columns(fft, groups < all_groups(fft) ? groups : all_groups(fft), fft->group_forward, NULL, 1, NULL,
                 plane);
}

void rx_fft_inverse(const rx_fft *fft, float *complex_in, float *real)
{
    fftwf_complex *plane = (fftwf_complex *)complex_in;
    pass_columns(fft, all_groups(fft), fft->group_inverse, NULL, 1, NULL, plane);
    rows_inverse(fft, plane, real);
}

void rx_fft_filter(const rx_fft *fft, const float *src, const float *kernel, bool conjugate, float *half,
                   float *dst)
{
    fftwf_complex *plane = (fftwf_complex *)half;
    rows_forward(fft, src, plane);
    pass_columns(fft, all_groups(fft), fft->group_forward, (const fftwf_complex *)kernel,
                 conjugate ? -1.0f : 1.0f, fft->group_inverse, plane);
    rows_inverse(fft, plane, dst);
}
