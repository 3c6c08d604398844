/* Sky level and noise of a tile on a grid of meshes.
 *
 * The estimator of SExtractor (Bertin & Arnouts 1996, A&AS 117, 393, section 4.1; constants as in its public
 * source) with sep's numbers but for the rounding of sums over a mesh, which are in another order. Mean and
 * rms clipped once at 2 sigma set the range of a histogram; its median and rms are clipped at 3 sigma until
 * they stay; the level is 2.5 median - 1.5 mean, or the median where the two are 0.3 sigma apart. A running
 * median smooths the grid; bicubic splines, which sep evaluates, join it. */
#ifndef RX_DETECT_MESH_H
#define RX_DETECT_MESH_H

#include "base/error.h"
#include "data/image.h"
#include "detect/libsep.h"
#include "detect/params.h"

/* Whether the level is that one, or the clipped mean: of pixels without sources, where it is twice as sure, and
 * as right where pixels come in steps of a detector's counts, of which a median is one or the next. */
typedef enum rx_mesh_level { RX_MESH_MODE, RX_MESH_MEAN } rx_mesh_level;

/* The grid for the image's pixels; of the image these, its size, mask and `hide` are looked at. Pixels that are
 * hidden or not finite are ignored. A mesh of which more than half is hidden takes the mean of the nearest that
 * are not. *good: pixels that are not hidden; *meshes: that have a value of their own. The same for any par->nthreads. Free with rx_mesh_free(). Errors:
 * RX_SYSTEM without memory. */
rx_status rx_mesh_measure(const rx_background_params *par, const rx_image *image, rx_mesh_level level,
                          sep_bkg **dst, size_t *good, int *meshes, rx_error *err);
void rx_mesh_free(sep_bkg *mesh);

#endif
