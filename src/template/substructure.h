/* What the restored pixels of a source have beyond its profile. */
#ifndef RX_TEMPLATE_SUBSTRUCTURE_H
#define RX_TEMPLATE_SUBSTRUCTURE_H

#include "template/fit_source.h"
#include "template/patch.h"

/* source holds a fitted profile and its flux, plane 0 of the domain its template T, chi2 that of F T alone
 * on the patch (without priors). With
 *
 *   D = share v^2 / (v^2 + s^2) v,   v = restored - F P / share
 *   P      the profile behind the restored PSF
 *   s      the restored pixel's noise, at least that of the restored sky around
 *   share  of the model of all, what is the source's: F P / share is that model; 1 on the own segment
 *
 * on the segment and, where it is clear, |v| > 3 s, in its nearest free surroundings, the data decide on F'
 * and A, 0 <= A <= 1, of F' T + A K*D. Where that gains more than two for each pixel that D makes free use of
 * (Akaike 1974), plane 0 becomes the template of both, sum 1, *flux its flux, and 1 is returned; else 0, with
 * plane 0 and *flux as they were. Other planes are lost. (cx, cy): the pixel in the middle of the domain. */
int rx_substructure_add(const rx_refine_view *view, const rx_fit_source *source, int cx, int cy,
                        rx_template_domain *size, const rx_patch *patch, double *flux);

#endif
