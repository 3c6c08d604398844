/* A tile against the dictionary of the network's model. */
#include "pipeline/domain.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/map.h"

enum { FEW = 10 /* pixels of a cosmic ray; a star has more */, PIECE = 1024 /* pixels of a row at a time */ };

/* z of the good pixels of row y that are `least` and more into dst[width], *bright of them; how many are good. */
static size_t bright_row(const rx_image *image, const rx_map *sky, int y, float least, float *dst,
                         size_t *bright)
{
    size_t good = 0, n = 0;
    for (int x = 0; x < image->width; x += PIECE) {
        float sigma_room[PIECE], sky_room[PIECE];
        const int width = image->width - x < PIECE ? image->width - x : PIECE;
        const size_t k = (size_t)y * (size_t)image->width + (size_t)x;
        const float *sigma = rx_map_row(&image->noise, y, x, width, sigma_room),
                    *base = rx_map_row(sky, y, x, width, sky_room);
        for (int i = 0; i < width; i++) {
            const float z = (image->pixels[k + (size_t)i] - base[i]) / sigma[i];
            const int is_good = !rx_image_hides(image, k + (size_t)i) & (sigma[i] > 0.0f);
            dst[n] = z;
            n += (size_t)(is_good & (z >= least));
            good += (size_t)is_good;
        }
    }
    *bright = n;
    return good;
}

/* Those of every step-th row into dst; how many there are, and of how many. count: [height]. */
static size_t bright_pixels(const rx_image *image, int step, float least, int nthreads, size_t *count,
                            float *dst, size_t *good)
{
    const rx_map sky = rx_image_sky(image);
    const size_t width = (size_t)image->width;
    size_t bright = 0, all = 0;
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1) reduction(+ : all)
    for (int y = step / 2; y < image->height; y += step)
        all += bright_row(image, &sky, y, least, dst + (size_t)y * width, &count[y]);
    for (int y = step / 2; y < image->height; y += step) {
        memmove(dst + bright, dst + (size_t)y * width, count[y] * sizeof *dst);
        bright += count[y];
    }
    *good = all;
    return bright;
}

/* The level needs few of the brightest pixels alone: a sample of rows says from where on to keep them. */
rx_status rx_domain_noise(const rx_field *field, int nthreads, double *noise, rx_error *err)
{
    enum { SAMPLED = 64 }; /* rows */
    const rx_image image = rx_field_effective(field);
    const size_t n = (size_t)image.width * (size_t)image.height;
    size_t good = 0, bright = 0, *count = NULL;
    float *above = NULL, least = -INFINITY;
    rx_status status = RX_OK;
    RX_TRY_EXIT(RX_MAKE(above, n, err));
    RX_TRY_EXIT(RX_MAKE(count, (size_t)image.height, err));
    if (image.height >= 4 * SAMPLED) {
        bright = bright_pixels(&image, image.height / SAMPLED, least, nthreads, count, above, &good);
        least = bright > 0 ? rx_upper_value(above, bright, 4 * rx_brightness_needs(bright)) : least;
    }
    bright = bright_pixels(&image, 1, least, nthreads, count, above, &good);
    if (bright < rx_brightness_needs(good))
        bright = bright_pixels(&image, 1, -INFINITY, nthreads, count, above, &good);
    *noise = rx_noise_level(rx_brightness_of_top(above, bright, good, FEW));
exit:
    free(above);
    free(count);
    return status;
}

/* "the network was trained for FWHM 2 to 8 pixels, noise from 1 on and noise factors to 3", or that the model does not say. */
static void add_grid(const rx_model *model, rx_text *dst)
{
    if (model->bins == NULL) {
        rx_text_add(dst, "the model does not say what it was trained for");
        return;
    }
    const rx_model_bin *first = model->bins, *last = first + (long)model->nfwhm * model->nsigma - 1;
    rx_text_printf(
        dst, "the network works for FWHM %.4g to %.4g pixels, noise from %.4g on and noise factors to %.3g",
        first->fwhm[0], last->fwhm[1], first->sigma[0], rx_model_factor(model));
}

/* A PSF that is narrower than the network's own output by so much leaves nothing to restore: its
 * deconvolution would be a blur, which the network and its steps turn into noise (undersampled tiles of 0.6
 * to 1.5 pixels). */
static const double NARROW = 0.9;

static rx_status leave(const rx_restore_params *par, const rx_image *image, rx_log *log,
                       const rx_restorer **kind, rx_domain *dst, rx_error *err)
{
    rx_text grid = {0};
    rx_status status = RX_OK;
    add_grid(dst->model, &grid);
    if (grid.failed) {
        rx_text_free(&grid);
        return rx_error_memory(err, 0);
    }
    switch (par->out_of_domain) {
    case RX_DOMAIN_FAIL:
        status = rx_error_at(err, RX_NOT_RESTORED, image->name, image->hdu, 0,
                             "%s, %s; take RESTORE_TYPE RL, another NET_MODEL, or "
                             "OUT_OF_DOMAIN WARN or RL",
                             dst->why, grid.data);
        break;
    case RX_DOMAIN_RL:
        *kind = rx_restorer_find("RL");
        break;
    case RX_DOMAIN_WARN:
        if (dst->fwhm < NARROW * dst->model->front.target_fwhm) { /* not for what the grid lacks */
            snprintf(dst->why, sizeof dst->why,
                     "FWHM %.4g pixels is below %.4g, %.4g of the network's output", dst->fwhm,
                     NARROW * dst->model->front.target_fwhm, NARROW);
            *kind = rx_restorer_find("RL");
            break;
        }
        rx_log_warning(log, "%s[%d]: %s, %s; how well it does here is not known", image->name, image->hdu,
                       dst->why, grid.data);
        break;
    }
    rx_text_free(&grid);
    return status;
}

rx_status rx_domain_obey(const rx_restore_params *par, const rx_field *field, rx_log *log,
                         const rx_restorer **kind, rx_domain *dst, rx_error *err)
{
    *dst = (rx_domain){.fwhm = NAN, .noise = NAN};
    if (((*kind)->traits & RX_TRAIT_TRAINED) == 0 || par->model == NULL)
        return RX_OK;
    dst->model = par->model;
    dst->place = RX_DOMAIN_UNKNOWN;
    dst->noise = field->model_noise;
    dst->factor = field->model_factor > 0.0 ? field->model_factor : field->noise_factor;
    RX_TRY(dst->noise > 0.0 ? RX_OK : rx_domain_noise(field, par->nthreads, &dst->noise, err));
    if (field->psf == NULL) {
        snprintf(dst->why, sizeof dst->why, "the FWHM of the tile is not known");
        return RX_OK;
    }
    dst->fwhm = field->psf->fwhm;
    dst->bin = rx_model_find(par->model, dst->fwhm, dst->noise, dst->why, sizeof dst->why);
    if (dst->factor > rx_model_factor(par->model)) {
        const size_t used = strlen(dst->why);
        snprintf(dst->why + used, sizeof dst->why - used, "%snoise factor %.2f is above %.3g",
                 used > 0 ? ", " : "", dst->factor, rx_model_factor(par->model));
        dst->bin = NULL;
    }
    dst->place = dst->bin != NULL ? RX_DOMAIN_INSIDE : RX_DOMAIN_OUTSIDE;
    const rx_image image = rx_field_restorable(field);
    return dst->bin != NULL ? RX_OK : leave(par, &image, log, kind, dst, err);
}
