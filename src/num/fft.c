/* Real 2-D FFT from one-dimensional FFTW plans, the same bytes for any number of threads. */
#include "num/fft.h"

#include <fftw3.h>
#include <limits.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/simd.h"

/* Columns transformed together, and rows turned into pieces of columns together: eight complex numbers are
 * one cache line. */
enum { GROUP = 8, REAL_ALIGN = 16 };

struct rx_fft {
    int width, height, nthreads;
    int stride_real;
    int stride_complex;     /* complex numbers between two columns of a complex plane */
    int groups;             /* of columns, the last one filled up */
    int stride_scratch;     /* complex numbers between two rows of scratch */
    fftwf_complex *scratch; /* [nthreads][GROUP][stride_scratch] spectra of rows, then one row of pixels */
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
    const int w = fft->width, h = fft->height, s = fft->stride_complex;
    float *real = RX_NEW(float, fft->stride_real);
    fftwf_complex *half = RX_NEW(fftwf_complex, fft->stride_scratch);
    fftwf_complex *g = RX_NEW(fftwf_complex, (size_t)GROUP * (size_t)s);
    if (real != NULL && half != NULL && g != NULL) {
/* FFTW's planner is not thread-safe, and tiles of a campaign run side by side. */
#pragma omp critical(rx_fft_planner)
        {
            fft->row_forward = fftwf_plan_dft_r2c_1d(w, real, half, FFTW_ESTIMATE);
            fft->row_inverse = fftwf_plan_dft_c2r_1d(w, half, real, FFTW_ESTIMATE | FFTW_DESTROY_INPUT);
            fft->group_forward =
                fftwf_plan_many_dft(1, &h, GROUP, g, NULL, 1, s, g, NULL, 1, s, FFTW_FORWARD, FFTW_ESTIMATE);
            fft->group_inverse =
                fftwf_plan_many_dft(1, &h, GROUP, g, NULL, 1, s, g, NULL, 1, s, FFTW_BACKWARD, FFTW_ESTIMATE);
        }
    }
    free(real);
    free(half);
    free(g);
    return fft->row_forward != NULL && fft->row_inverse != NULL && fft->group_forward != NULL &&
           fft->group_inverse != NULL;
}

/* Of one thread, complex numbers: a row of pixels takes half as many. */
static size_t scratch_size(const rx_fft *fft)
{
    return (size_t)(GROUP + 1) * (size_t)fft->stride_scratch;
}

rx_status rx_fft_new(int width, int height, int nthreads, rx_fft **dst, rx_error *err)
{
    *dst = NULL;
    if (width < 1 || height < 1 || width > INT_MAX / 4 || height > INT_MAX / 4)
        return rx_error_set(err, RX_INPUT,
                            "an image of %d x %d pixels cannot be Fourier transformed; "
                            "give a smaller one",
                            width, height);
    rx_fft *fft;
    RX_TRY(RX_MAKE(fft, 1, err));
    fft->width = width;
    fft->height = height;
    fft->nthreads = nthreads < 1 ? 1 : nthreads;
    fft->stride_real = round_up(width, REAL_ALIGN);
    fft->groups = (width / 2 + GROUP) / GROUP;
    /* one more cache line than needed, against strides of a power of two */
    fft->stride_complex = round_up(height, GROUP) + GROUP;
    fft->stride_scratch = fft->groups * GROUP + GROUP;
    size_t scratch = (size_t)fft->nthreads * scratch_size(fft);
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
    return RX_NEW(float, rx_fft_complex_size(fft));
}

size_t rx_fft_complex_size(const rx_fft *fft)
{
    return 2 * (size_t)GROUP * (size_t)fft->groups * (size_t)fft->stride_complex;
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

/* s *= kernel, or its complex conjugate for sign = -1; n complex numbers. */
RX_SIMD static void multiply(size_t n, const fftwf_complex *kernel, float sign, fftwf_complex *s)
{
    const float *restrict k = (const float *)kernel;
    float *restrict z = (float *)s;
#pragma omp simd
    for (size_t i = 0; i < n; i++) {
        const float kr = k[2 * i], ki = sign * k[2 * i + 1], sr = z[2 * i], si = z[2 * i + 1];
        z[2 * i] = kr * sr - ki * si;
        z[2 * i + 1] = kr * si + ki * sr;
    }
}

static void pass_group(size_t step, size_t at, fftwf_plan first, const fftwf_complex *kernel, float sign,
                       fftwf_plan second, fftwf_complex *plane)
{
    fftwf_execute_dft(first, plane + at, plane + at);
    if (kernel == NULL)
        return;
    multiply(step, kernel + at, sign, plane + at);
    fftwf_execute_dft(second, plane + at, plane + at);
}

/* The first groups of columns of a plane in place: transformed by `first`, multiplied by the kernel,
 * transformed by `second`; kernel and second are NULL where only one transform is wanted. */
static void pass_columns(const rx_fft *fft, int groups, fftwf_plan first, const fftwf_complex *kernel,
                         float sign, fftwf_plan second, fftwf_complex *plane)
{
    const size_t step = (size_t)GROUP * (size_t)fft->stride_complex;
    if (fft->nthreads == 1) { /* small planes, tens of thousands: opening a region takes its time */
        for (int g = 0; g < groups; g++)
            pass_group(step, (size_t)g * step, first, kernel, sign, second, plane);
        return;
    }
#pragma omp parallel for schedule(static) num_threads(fft->nthreads)
    for (int g = 0; g < groups; g++)
        pass_group(step, (size_t)g * step, first, kernel, sign, second, plane);
}

/* Where rows come from and go to: planes, or the caller's functions. */
typedef struct rows {
    const float *from;
    float *to;
    rx_fft_read read;
    rx_fft_write write;
    void *user;
} rows;

static fftwf_complex *thread_scratch(const rx_fft *fft)
{
    return fft->scratch + (fft->nthreads == 1 ? 0 : (size_t)omp_get_thread_num()) * scratch_size(fft);
}

/* Rows y .. y + n - 1 to pieces of the columns. */
static void put_rows(const rx_fft *fft, const rows *rows, int y, int n, int columns, fftwf_complex *plane)
{
    const size_t stride = (size_t)fft->stride_scratch, column = (size_t)fft->stride_complex;
    fftwf_complex *scratch = thread_scratch(fft);
    float *line = (float *)(scratch + GROUP * stride);
    int some = 0;
    for (int i = 0; i < n; i++) {
        if (rows->read != NULL && !rows->read(rows->user, y + i, line)) {
            memset(scratch + (size_t)i * stride, 0, stride * sizeof *scratch);
            continue;
        }
        /* FFTW's type is not const; an out-of-place r2c plan in one dimension preserves its input */
        float *row = rows->read != NULL
                         ? line
                         : (float *)(size_t)(rows->from + (size_t)(y + i) * (size_t)fft->stride_real);
        fftwf_execute_dft_r2c(fft->row_forward, row, scratch + (size_t)i * stride);
        some = 1;
    }
    for (size_t u = 0; u < (size_t)columns; u++) {
        fftwf_complex *piece = plane + u * column + y;
        if (!some)
            memset(piece, 0, (size_t)n * sizeof *piece);
        else
            for (int i = 0; i < n; i++)
                memcpy(piece[i], scratch[(size_t)i * stride + u], sizeof *piece);
    }
}

static void rows_forward(const rx_fft *fft, const rows *rows, int columns, fftwf_complex *plane)
{
    if (fft->nthreads == 1) {
        for (int y = 0; y < fft->height; y += GROUP)
            put_rows(fft, rows, y, y + GROUP < fft->height ? GROUP : fft->height - y, columns, plane);
        return;
    }
#pragma omp parallel for schedule(static) num_threads(fft->nthreads)
    for (int y = 0; y < fft->height; y += GROUP)
        put_rows(fft, rows, y, y + GROUP < fft->height ? GROUP : fft->height - y, columns, plane);
}

static void take_rows(const rx_fft *fft, const rows *rows, int y, int n, fftwf_complex *plane)
{
    const size_t stride = (size_t)fft->stride_scratch, column = (size_t)fft->stride_complex;
    fftwf_complex *scratch = thread_scratch(fft);
    float *line = (float *)(scratch + GROUP * stride);
    for (size_t u = 0; u < (size_t)fft->width / 2 + 1; u++) {
        fftwf_complex *piece = plane + u * column + y;
        for (int i = 0; i < n; i++)
            memcpy(scratch[(size_t)i * stride + u], piece[i], sizeof *piece);
    }
    for (int i = 0; i < n; i++) {
        float *row = rows->write != NULL ? line : rows->to + (size_t)(y + i) * (size_t)fft->stride_real;
        fftwf_execute_dft_c2r(fft->row_inverse, scratch + (size_t)i * stride, row);
        if (rows->write != NULL)
            rows->write(rows->user, y + i, row);
    }
}

static void rows_inverse(const rx_fft *fft, const rows *rows, int first, int last, fftwf_complex *plane)
{
    if (fft->nthreads == 1) {
        for (int y = first; y < last; y += GROUP)
            take_rows(fft, rows, y, y + GROUP < last ? GROUP : last - y, plane);
        return;
    }
#pragma omp parallel for schedule(static) num_threads(fft->nthreads)
    for (int y = first; y < last; y += GROUP)
        take_rows(fft, rows, y, y + GROUP < last ? GROUP : last - y, plane);
}

void rx_fft_forward(const rx_fft *fft, const float *real, float *complex_out)
{
    rx_fft_forward_low(fft, real, fft->width / 2 + 1, complex_out);
}

void rx_fft_forward_low(const rx_fft *fft, const float *real, int columns, float *complex_out)
{
    const int all = fft->width / 2 + 1, wanted = columns < all ? columns : all;
    fftwf_complex *plane = (fftwf_complex *)complex_out;
    rows_forward(fft, &(rows){.from = real}, wanted, plane);
    pass_columns(fft, (wanted + GROUP - 1) / GROUP, fft->group_forward, NULL, 1, NULL, plane);
}

void rx_fft_forward_rows(const rx_fft *fft, rx_fft_read read, void *user, float *complex_out)
{
    fftwf_complex *plane = (fftwf_complex *)complex_out;
    rows_forward(fft, &(rows){.read = read, .user = user}, fft->width / 2 + 1, plane);
    pass_columns(fft, fft->groups, fft->group_forward, NULL, 1, NULL, plane);
}

void rx_fft_inverse(const rx_fft *fft, float *complex_in, float *real)
{
    rx_fft_inverse_part(fft, complex_in, 0, fft->height, real);
}

void rx_fft_inverse_part(const rx_fft *fft, float *complex_in, int first, int last, float *real)
{
    fftwf_complex *plane = (fftwf_complex *)complex_in;
    pass_columns(fft, fft->groups, fft->group_inverse, NULL, 1, NULL, plane);
    rows_inverse(fft, &(rows){.to = real}, first, last, plane);
}

void rx_fft_inverse_rows(const rx_fft *fft, float *complex_in, int first, int last, rx_fft_write write,
                         void *user)
{
    fftwf_complex *plane = (fftwf_complex *)complex_in;
    pass_columns(fft, fft->groups, fft->group_inverse, NULL, 1, NULL, plane);
    rows_inverse(fft, &(rows){.write = write, .user = user}, first, last, plane);
}

static void filter(const rx_fft *fft, const rows *rows, const float *kernel, bool conjugate, float *half,
                   int first, int last)
{
    fftwf_complex *plane = (fftwf_complex *)half;
    rows_forward(fft, rows, fft->width / 2 + 1, plane);
    pass_columns(fft, fft->groups, fft->group_forward, (const fftwf_complex *)kernel,
                 conjugate ? -1.0f : 1.0f, fft->group_inverse, plane);
    rows_inverse(fft, rows, first, last, plane);
}

void rx_fft_filter(const rx_fft *fft, const float *src, const float *kernel, bool conjugate, float *half,
                   float *dst)
{
    filter(fft, &(rows){.from = src, .to = dst}, kernel, conjugate, half, 0, fft->height);
}

void rx_fft_filter_rows(const rx_fft *fft, const rx_fft_rows *of, const float *kernel, bool conjugate,
                        float *half)
{
    filter(fft, &(rows){.read = of->read, .write = of->write, .user = of->user}, kernel, conjugate, half,
           of->first, of->last);
}

const char *rx_fft_library(void)
{
    return fftwf_version;
}
