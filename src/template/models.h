/* What a point and what one of Sersic's profiles say of each source, whatever its template is: the columns _PSF, SPREAD_MODEL and
 * SPHEROID_. Both are fitted, convolved with the tile's PSF at the place, to what the templates of all other sources leave of the
 * untouched pixels, d, with the weights w that the fluxes were fitted with.
 *
 * Point: F P, flux and position free; a source whose template is a point has the flux of the joint fit. At that position, sums over all
 * pixels that are seen and G the PSF P convolved with a round exponential whose scale is FWHM / 16 (Desai et al. 2012, ApJ 757, 83; Bouy et
 * al. 2013, A&A 554, A101), the FWHM being twice the half-light radius of P, as PSFEx has it,
 *
 *   SPREAD_MODEL = b / a - sum G P / sum P P,   a = sum P d,   b = sum G d
 *   error^2      = f^2 sum (G / a - b P / a^2)^2 / w,   f: rx_noise_factor() of the root of what is summed up
 *
 * Sersic: flux, position, ln radius, g1, g2 (spergel.h) and ln n at the most probable values, all flat but for ln n (models.c), by the
 * inverse of the normal matrix; errors of ratio and angle are those of g along and across itself. Error of one that has ended at a limit:
 * NAN. Fluxes: as in the joint fit errors grow by the neighbours', the background's and the PSF's. */
#ifndef RX_TEMPLATE_MODELS_H
#define RX_TEMPLATE_MODELS_H

#include "base/error.h"
#include "template/fit_source.h"
#include "template/joint.h"

typedef struct rx_models_view {
    rx_fit_image *image;
    rx_template_otf *const *otfs; /* [image->nthreads] */
    int n;
    const rx_fit_source *sources;   /* [n] */
    const rx_joint_member *members; /* [n] */
} rx_models_view;

/* point and, when asked for, sersic of list [n], which has all the rest. Errors: RX_SYSTEM. */
rx_status rx_models_fit(const rx_models_view *view, int sersic, rx_tphot_source *list, rx_error *err);

#endif
