/* Real 2-D FFT (FFTW, single precision) whose result does not depend on the number of
 * threads: fixed one-dimensional FFTW_ESTIMATE plans over rows and over groups of eight
 * columns, OpenMP over these, every transform on memory of one alignment. Spectra are kept column by column:
 * eight rows at a time go from pixels to pieces of all columns, so that each plane is read and written once.
 *
 * Forward:  Z[v][u] = sum_y sum_x a[y][x] exp(-2 pi i (u x / width + v y / height))
 * for u = 0 .. width/2, v = 0 .. height-1; the inverse has the sign + and no factor.
 * Relative rms error about 1e-7 sqrt(log2(width height)). */
#ifndef RX_NUM_FFT_H
#define RX_NUM_FFT_H

#include <stdbool.h>
#include <stddef.h>

#include "base/error.h"

/* Plans and scratch for one size. Making and freeing one is not thread-safe (FFTW's
 * planner); different objects can be used at the same time, one object by one caller. */
typedef struct rx_fft rx_fft;

/* Smallest even size >= n whose prime factors are 2, 3, 5, 7; 0 when that overflows. */
int rx_fft_good_size(int n);

/* Any width, height >= 1. nthreads < 1 counts as 1. Errors: RX_SYSTEM without memory. */
rx_status rx_fft_new(int width, int height, int nthreads, rx_fft **dst, rx_error *err);
void rx_fft_free(rx_fft *fft);

/* Planes are made by rx_fft_real() / rx_fft_complex(): zeroed, padded for alignment. Real: [height]
 * [stride_real] floats. Complex half spectrum: [u][v], column u at u * stride_complex complex numbers (re,
 * im), width/2+1 columns of height used, the padding must stay finite. Free with free(); NULL without memory.
 */
float *rx_fft_real(const rx_fft *fft);
float *rx_fft_complex(const rx_fft *fft);
int rx_fft_width(const rx_fft *fft);
int rx_fft_height(const rx_fft *fft);
int rx_fft_threads(const rx_fft *fft);
int rx_fft_stride_real(const rx_fft *fft);     /* floats */
int rx_fft_stride_complex(const rx_fft *fft);  /* complex numbers, from column to column */
size_t rx_fft_complex_size(const rx_fft *fft); /* floats of a complex plane, padding included */

/* The padding of the rows of `real` is neither read nor written. */
void rx_fft_forward(const rx_fft *fft, const float *real, float *complex_out);
/* The same, of the first `columns` only (u < columns); the others hold nothing of use afterwards. */
void rx_fft_forward_low(const rx_fft *fft, const float *real, int columns, float *complex_out);
/* Unnormalised inverse (width*height times too large); complex_in is destroyed. */
void rx_fft_inverse(const rx_fft *fft, float *complex_in, float *real);
/* The same, of the rows first <= y < last only; the others stay as they are. */
void rx_fft_inverse_part(const rx_fft *fft, float *complex_in, int first, int last, float *real);

/* dst = inverse(kernel forward(src)), conj(kernel) when `conjugate`: the three steps in one, each
 * column group staying in the cache. `kernel` is a complex plane; `half` another, overwritten;
 * dst may be src. Unnormalised. */
void rx_fft_filter(const rx_fft *fft, const float *src, const float *kernel, bool conjugate, float *half,
                   float *dst);

/* The same without real planes, rows made and used where they are needed, by any of the fft's threads and in
 * any order: `read` fills line [width] with row y and returns 1, or returns 0 for a row of zeros; `write`
 * takes row y, which it may change, first <= y < last only. */
typedef int (*rx_fft_read)(void *user, int y, float *line);
typedef void (*rx_fft_write)(void *user, int y, float *line);
void rx_fft_forward_rows(const rx_fft *fft, rx_fft_read read, void *user, float *complex_out);
void rx_fft_inverse_rows(const rx_fft *fft, float *complex_in, int first, int last, rx_fft_write write,
                         void *user);
typedef struct rx_fft_rows {
    rx_fft_read read;
    rx_fft_write write;
    void *user;
    int first, last;
} rx_fft_rows;
void rx_fft_filter_rows(const rx_fft *fft, const rx_fft_rows *rows, const float *kernel, bool conjugate,
                        float *half);

/* Name, version and instruction sets of the library. */
const char *rx_fft_library(void);

#endif
