/* From shapes to templates: what one thread needs to put a point, a profile or pixels behind the tile's PSF
 * at a place, in Fourier space on small square domains. Plans and spectra are kept for each size; where a PSF
 * varies, its spectrum is made anew at each place.
 *
 * A rendered plane has the place (x, y) of the source at pixel (n/2 + x - cx, n/2 + y - cy), (cx, cy) the
 * whole pixel nearest to it; the sum is 1, and light beyond the domain comes back on the other side. Shifts
 * are exact where the PSF is known between the pixels, and else as far as these sample it. */
#ifndef RX_TEMPLATE_TEMPLATE_OTF_H
#define RX_TEMPLATE_TEMPLATE_OTF_H

#include "base/error.h"
#include "data/psf.h"
#include "num/fft.h"
#include "template/spergel.h"

typedef struct rx_template_otf rx_template_otf;

/* A domain with the spectrum of the tile's PSF at a place; only rx_template_otf_at() hands one out. */
typedef struct rx_template_domain {
    int n;
    rx_fft *fft;
    float *optics;
    int first,
        last; /* rows that are rendered, first <= row < last, of points these columns; the caller's choice */
    float *half[5], *plane[5]; /* work */
    double *phase;             /* [m n + 1][2], m: samples a pixel */
    float *column;             /* [7 + 2 m][n] */
} rx_template_domain;

/* The PSF-matching kernel, which takes the restored image's PSF to the tile's, and the restored PSF itself,
 * both at the place of a domain; only rx_template_domain_matching() hands one out. */
typedef struct rx_matching rx_matching;

/* tile, image: PSF of the fitted and of the restored image, which must outlive the otf; image NULL: the same
 * as the tile's. Free with rx_template_otf_free(). Errors: RX_SYSTEM. */
rx_status rx_template_otf_new(const rx_psf *tile, const rx_psf *image, rx_template_otf **dst, rx_error *err);
void rx_template_otf_free(rx_template_otf *otf); /* NULL is fine */

/* Side of the domain for light that reaches `reach` pixels from the source before it is blurred. level: of the PSF only the part
 * around its middle that is above it is needed, and what fits into the domain is taken, not normalised anew; 0: all of it. half: only
 * so many pixels to all sides of the middle have to be right; 0: all that has light. */
int rx_template_otf_side(const rx_template_otf *otf, double reach, double level, int half);

/* The domain of side n (from rx_template_otf_side()) with the PSF at tile position (x, y); valid until
 * the next call; all rows will be rendered. Errors: RX_SYSTEM. */
rx_status rx_template_otf_at(rx_template_otf *otf, int n, double x, double y, rx_template_domain **dst,
                             rx_error *err);

/* The kernel there, valid as long as the domain is. Planes other than 0 are lost. */
const rx_matching *rx_template_domain_matching(rx_template_domain *size);

/* Planes 0 .. count - 1 of the domain (count 1 or 5) = the profile (NULL: a point) (dx, dy) off the middle,
 * and its derivatives by ln radius, g1, g2, ln(1 + nu), through the tile's PSF (restored NULL) or the
 * restored image's. */
void rx_template_domain_render(rx_template_domain *size, const rx_spergel *profile, double dx, double dy,
                               const rx_matching *restored, int count);

/* Plane 0 (real, [n][n] in rows of rx_fft_stride_real()) blurred by the kernel. */
void rx_template_domain_blur(rx_template_domain *size, const rx_matching *matching);

#endif
