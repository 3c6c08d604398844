/* Real 2-D FFT (FFTW float) whose result does not depend on the number of threads: fixed
 * one-dimensional FFTW_ESTIMATE plans over rows and groups of columns, OpenMP over these. */
#ifndef RX_NUM_FFT_H
#define RX_NUM_FFT_H

#include <stddef.h>

#include "base/error.h"

typedef struct rx_fft rx_fft; /* plans for one size; making one is not thread-safe, using one is */

/* Smallest size >= n that FFTW likes (factors 2, 3, 5, 7; even). */
int rx_fft_good_size(int n);

rx_status rx_fft_new(int width, int height, int nthreads, rx_fft **dst, rx_error *err);
void rx_fft_free(rx_fft *fft);

/* Planes are made by rx_fft_real() / rx_fft_complex(): rows padded for alignment.
 * Real: [height][stride_real] floats. Complex half spectrum: [height][stride_complex]
 * complex numbers, width/2+1 used. Free with free(). */
float *rx_fft_real(const rx_fft *fft);
float *rx_fft_complex(const rx_fft *fft);
int rx_fft_stride_real(const rx_fft *fft);
int rx_fft_stride_complex(const rx_fft *fft);

void rx_fft_forward(const rx_fft *fft, const float *real, float *complex_out);
/* Unnormalised inverse (width*height times too large); complex_in is destroyed. */
void rx_fft_inverse(const rx_fft *fft, float *complex_in, float *real);

#endif
