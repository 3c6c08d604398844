/* Cosmic rays: charge along short straight tracks.
 *
 * Muons at sea level: zenith angles ~ cos^2, through a level surface hence ~ cos^3 sin. A track crosses a
 * sensitive layer RX_COSMIC_DEPTH pixels deep (thinned CCDs: 15 to 40 um of silicon, pixels of 10 to 20 um)
 * with any azimuth: RX_COSMIC_DEPTH tan(zenith) pixels long on the image, at most RX_COSMIC_LONGEST. A
 * minimum ionising particle frees about 80 electrons per um of silicon (Particle Data Group), 1200 per pixel
 * of 15 um; the sum along the track fluctuates by 1 + 0.15 l, not below 0.3, with l of Moyal's distribution
 * (1955, Phil. Mag. 46, 263), which is -ln z^2 of a normal z. No charge diffuses: what a pixel gets is its
 * share of the track's length. */
#ifndef RX_SIMULATE_COSMIC_RAYS_H
#define RX_SIMULATE_COSMIC_RAYS_H

#include <stdint.h>

#define RX_COSMIC_DEPTH 2.0
#define RX_COSMIC_LONGEST 100.0
#define RX_COSMIC_CHARGE 1200.0 /* electrons per pixel of path */

typedef struct rx_cosmic_ray {
    double x, y, dx, dy; /* from (x, y), pixels, to (x + dx, y + dy) */
    double charge;       /* electrons in all */
} rx_cosmic_ray;

/* Number `number` of (seed, stream); begins anywhere on width x height pixels. */
void rx_cosmic_ray_make(uint64_t seed, uint64_t stream, uint64_t number, int width, int height,
                        rx_cosmic_ray *dst);

/* pixels [height][width] += charge / gain along the track as far as it is inside; defects (may be NULL) get
 * `bit` there. */
void rx_cosmic_ray_add(const rx_cosmic_ray *ray, double gain, int width, int height, float *pixels,
                       uint8_t *defects, uint8_t bit);

#endif
