/* Views of what others own. */
#include "data/image.h"

#include <math.h>
#include <stdlib.h>

#include "base/simd.h"
#include "data/restored.h"
#include "data/unit.h"

rx_image rx_tile_image(const rx_tile *tile)
{
    return (rx_image){.name = tile->name,
                      .hdu = tile->hdu,
                      .extension = tile->extension,
                      .width = tile->width,
                      .height = tile->height,
                      .pixels = tile->pixels,
                      .mask = tile->mask,
                      .saturated = tile->mask,
                      .with_sky = 1,
                      .weight = tile->weight,
                      .weight_type = tile->weight_type,
                      .restored = tile->restored,
                      .restored_noise = tile->restored_noise,
                      .nflagmaps = tile->nflagmaps,
                      .flagmaps = tile->flagmaps,
                      .gain = tile->gain,
                      .saturation = tile->saturation,
                      .zeropoint = tile->zeropoint,
                      .pixel_scale = tile->pixel_scale,
                      .wcs = tile->wcs,
                      .linear = tile->linear_wcs ? tile->linear : NULL};
}

rx_image rx_image_on_sky(const rx_image *image, const rx_background *sky)
{
    rx_image dst = *image;
    dst.hide = sky->mask_bits;
    dst.level = rx_background_level(sky);
    dst.noise = rx_background_noise(sky);
    dst.global_noise = sky->global_sigma;
    dst.variable_noise = image->weight_type != RX_WEIGHT_NONE;
    return dst;
}

rx_image rx_restored_image(const rx_restored *restored, const rx_image *input)
{
    rx_image dst = *input;
    dst.pixels = restored->pixels;
    dst.mask = restored->mask;
    dst.with_sky = 0;
    dst.psf = restored->psf;
    return dst;
}

RX_SIMD void rx_image_sigmas(const rx_image *image, int x, int y, int n, float *restrict z)
{
    float level_room[RX_MAP_PIECE] = {0}, sigma_room[RX_MAP_PIECE];
    const rx_map sky = rx_image_sky(image);
    const size_t at = (size_t)y * (size_t)image->width + (size_t)x;
    const float *pixels = image->pixels + at, *sigma = rx_map_row(&image->noise, y, x, n, sigma_room);
    const float *level = rx_map_given(&sky) ? rx_map_row(&sky, y, x, n, level_room) : level_room;
    for (int i = 0; i < n; i++) {
        const float value = pixels[i] - level[i];
        z[i] = sigma[i] > 0.0f && isfinite(value) && !rx_image_hides(image, at + (size_t)i) ? value / sigma[i]
                                                                                            : NAN;
    }
}

void rx_image_above_sky(const rx_image *image, int nthreads, float *dst)
{
    const int width = image->width;
    const rx_map sky = rx_image_sky(image);
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1)
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < width; x += RX_MAP_PIECE) {
            const size_t at = (size_t)y * (size_t)width + (size_t)x;
            const int n = rx_map_piece(x, width);
            float room[RX_MAP_PIECE];
            const float *level = rx_map_row(&sky, y, x, n, room);
            for (int i = 0; i < n; i++)
                dst[at + (size_t)i] =
                    rx_image_hides(image, at + (size_t)i) ? 0.0f : image->pixels[at + (size_t)i] - level[i];
        }
}

int rx_image_in_unit(const rx_image *image, rx_image_scaled *dst)
{
    const double unit = rx_unit_of(image->global_noise);
    *dst = (rx_image_scaled){.image = *image, .unit = unit};
    if (unit == 1.0)
        return 1;
    dst->pixels = rx_unit_copy(image->pixels, (size_t)image->width * (size_t)image->height, unit);
    dst->image.pixels = dst->pixels;
    dst->image.level = rx_map_scaled(&dst->level, image->level, (float)(1.0 / unit));
    dst->image.noise = rx_map_scaled(&dst->noise, image->noise, (float)(1.0 / unit));
    dst->image.global_noise /= unit;
    dst->image.gain *= unit;
    dst->image.saturation /= unit;
    return dst->pixels != NULL;
}

void rx_image_scaled_clear(rx_image_scaled *scaled)
{
    free(scaled->pixels);
    *scaled = (rx_image_scaled){0};
}
