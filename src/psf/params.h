/* The parameters of the PSF. */
#ifndef RX_PSF_PARAMS_H
#define RX_PSF_PARAMS_H

#include "base/extern.h"
#include "data/psf.h"

RX_BEGIN_DECLS

/* Is the light of an oversampled image still to be collected by the tile's pixels? AUTO: unless its header says that it
 * is an effective PSF. */
typedef enum rx_psf_integration {
    RX_PSF_INTEGRATE_AUTO,
    RX_PSF_INTEGRATE,
    RX_PSF_INTERPOLATE
} rx_psf_integration;

typedef struct rx_psf_params {
    rx_psf_type type; /* MOFFAT, FILE, PSFEX, AUTO */
    double fwhm;      /* pixels, MOFFAT */
    double beta;      /* MOFFAT exponent [4.765] */
    const char *file; /* PSF_NAME, FILE and PSFEX */
    double sampling;  /* FILE: samples of an image per pixel of the tile; 0: what its header says, else 1 */
    rx_psf_integration integrate; /* FILE, sampling above 1 */
    int extension; /* PSFEX: of a file with several models that of this image HDU, from 1; 0: the first */
    int size; /* odd stamp size in pixels, 0 = from the fwhm, or the file's; FILE and PSFEX are cut to it */
    int min_stars;  /* AUTO: fewer usable stars is an error; below 5 a simpler profile is fitted. [1] */
    double min_snr; /* AUTO [20] */
    const char *stars_file; /* PSF_STARS_NAME: only sources with number_assoc may be stars; NULL, "": all */
    double
        flattened; /* AUTO: stars that reach this (ADU) are no stars; 0: their peaks and sizes decide; HUGE_VAL: all are */
    int max_degree; /* AUTO: of the polynomial over the tile [6] */
    double unit;    /* ADU, of the pixels that stars are measured on (data/unit.h); rx_psf_make() sets it */
    int nthreads;   /* AUTO; the result does not depend on it */
} rx_psf_params;

/* FWHM, pixels: below it pixels do not sample a PSF well enough to be shifted by parts of a pixel (Lanczos and Fourier
 * leave 0.02 mag of scatter at 1.5, 0.001 at 2.5), and the PSF has samples between them; as many a pixel. */
#define RX_PSF_NARROW 2.6
static inline int rx_psf_narrow_samples(double fwhm)
{
    return !(fwhm < RX_PSF_NARROW) ? 1 : fwhm > 1.2 ? 2 : 4;
}

/* Side of a PSF at most, pixels: stamps are counted by int, and no PSF needs more. */
enum { RX_PSF_LARGEST = 4095 };

RX_END_DECLS

#endif
