/* What rx_network_optics is made of: spectra and coefficients of a PSF, Tikhonov filters at nodes. */
#ifndef RX_RESTORE_NETWORK_OTF_H
#define RX_RESTORE_NETWORK_OTF_H

#include "restore/network_optics.h"

static inline int rx_otf_clamp(int i, int n)
{
    return i < 0 ? 0 : i < n ? i : n - 1;
}

/* spectrum as rx_convolve_spectrum() makes it, to the bit, without a plane. */
void rx_otf_spectrum(const rx_fft *fft, const float *stamp, int size, float *spectrum);

/* 1: the PSF is not the same everywhere. */
int rx_otf_varies(const rx_psf *psf);

/* stamps [nbasis][size][size] with the polynomials of optics->psf on its tile. Terms that nowhere reach 1e-6 of the first
 * stamp's peak are left out. Errors: RX_SYSTEM. */
rx_status rx_otf_new(const rx_fft *fft, const rx_network_optics *optics, const float *stamps, int size,
                     rx_otf *dst, rx_error *err);
void rx_otf_free(rx_otf *otf);

/* *stamps [psf->nbasis][*size][*size], the caller's to free: the relative PSF of nn/deblur.h, basis image by
 * basis image, scaled so that the first sums to 1 and the others to 0. */
rx_status rx_otf_relative(const rx_psf *psf, double target_fwhm, int width, int height, float **stamps,
                          int *size, rx_error *err);

/* nx .. fwhm of optics, whose psf, width, height, target and nthreads are set; what it made so far belongs to
 * optics even after an error. */
rx_status rx_network_optics_nodes(rx_network_optics *optics, double epsilon, rx_error *err);

#endif
