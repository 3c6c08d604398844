/* The planes that sep gets when the noise varies, and its catalogue brought back to the tile.
 *
 * sep 1.2.1 reads the threshold of a group, from which it deblends, at the pixel where its scan completes the
 * group: a neighbour below the threshold, with whatever noise that one has, 1e30 where it is hidden, 0 beyond
 * the right and the upper border. With 0 or 1e30 nothing is deblended. So sep gets planes one pixel wider and
 * higher, in which the noise of all neighbours of a group says the group's lowest threshold, as SExtractor
 * takes it, or as much more as keeps the neighbour itself below the threshold. */
#ifndef RX_DETECT_NOISE_PLANES_H
#define RX_DETECT_NOISE_PLANES_H

#include "base/error.h"
#include "detect/filter.h"
#include "detect/groups.h"
#include "detect/libsep.h"

typedef struct rx_noise_planes {
    int width, height; /* those of the tile + 1 */
    float *pixels, *noise;
} rx_noise_planes;

/* pixels (hidden ones 0) and sigma (hidden ones 1e30): [height][width]; threshold in sigmas.
 * Free with rx_noise_planes_free(), also after an error. */
rx_status rx_noise_planes_make(const float *pixels, const float *sigma, int width, int height,
                               const rx_filter *kernel, double threshold, const rx_groups *groups,
                               rx_noise_planes *dst, rx_error *err);
void rx_noise_planes_free(rx_noise_planes *planes);

/* Pixel indices of sep's catalogue back to the tile's, thresholds to the lowest of each source's own pixels,
 * and the flag of what touches the right or upper border. */
void rx_noise_planes_restore(const rx_noise_planes *planes, const float *sigma, double threshold,
                             sep_catalog *cat);

#endif
