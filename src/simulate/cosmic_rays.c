#include "simulate/cosmic_rays.h"

#include <math.h>
#include <stddef.h>

#include "base/random.h"

enum { DRAWS = 8 }; /* counters of one ray */

void rx_cosmic_ray_make(uint64_t seed, uint64_t stream, uint64_t number, int width, int height,
                        rx_cosmic_ray *dst)
{
    const uint64_t first = number * DRAWS;
    double cosine = pow(rx_random_uniform(seed, stream, first), 0.25); /* P(cos < c) = c^4 */
    double azimuth = 2.0 * M_PI * rx_random_uniform(seed, stream, first + 1);
    double tangent = sqrt(fmax(1.0 / (cosine * cosine) - 1.0, 0.0));
    double length = fmin(RX_COSMIC_DEPTH * tangent, RX_COSMIC_LONGEST);
    double path = hypot(length, RX_COSMIC_DEPTH), normal = rx_random_normal(seed, stream, first + 2);
    double moyal = -log(fmax(normal * normal, 1e-300));
    dst->x = width * rx_random_uniform(seed, stream, first + 3) - 0.5;
    dst->y = height * rx_random_uniform(seed, stream, first + 4) - 0.5;
    dst->dx = length * cos(azimuth);
    dst->dy = length * sin(azimuth);
    dst->charge = RX_COSMIC_CHARGE * path * fmax(1.0 + 0.15 * moyal, 0.3);
}

/* Where the track next leaves a pixel along one axis, as a share of its length; 2 = never. */
static double next_border(double start, double step, int pixel)
{
    if (step == 0.0)
        return 2.0;
    return (pixel + (step > 0.0 ? 0.5 : -0.5) - start) / step;
}

void rx_cosmic_ray_add(const rx_cosmic_ray *ray, double gain, int width, int height, float *pixels,
                       uint8_t *defects, uint8_t bit)
{
    int x = (int)floor(ray->x + 0.5), y = (int)floor(ray->y + 0.5);
    double at = 0.0;
    while (at < 1.0) {
        double across = next_border(ray->x, ray->dx, x), up = next_border(ray->y, ray->dy, y);
        double leave = fmin(fmin(across, up), 1.0);
        if (x >= 0 && y >= 0 && x < width && y < height) {
            size_t i = (size_t)y * (size_t)width + (size_t)x;
            pixels[i] += (float)(ray->charge * fmax(leave - at, 0.0) / gain);
            if (defects != NULL)
                defects[i] |= bit;
        }
        at = leave;
        if (across <= up)
            x += ray->dx > 0.0 ? 1 : -1;
        else
            y += ray->dy > 0.0 ? 1 : -1;
    }
}
