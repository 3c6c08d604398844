/* Scenes of the restoration campaign.
 *
 * The population is that of the SIM. keywords. The brightest galaxy (or template) takes the place of the
 * galaxy images of the paper: it is moved to the middle and drawn so large that it fills the scene, at its
 * own surface brightness; all others stay as they are, small and fainter than the main one. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "lab/restoration.h"
#include "nn/noise_level.h"
#include "num/convolve.h"
#include "psf/psf.h"
#include "simulate/noise.h"
#include "simulate/optics.h"
#include "simulate/render.h"
#include "simulate/scene.h"

/* Half-light radius of the main galaxy, in sides of the scene; its place, sides from the middle. */
static const double FILL_LOW = 0.07, FILL_HIGH = 0.15, PLACE = 0.08;
/* Mean surface brightness of any other object, at most so many of the main galaxy's. */
static const double OTHERS = 0.5;

/* What random numbers are for. */
enum { DRAW_SCENE = 1, DRAW_QUANTITIES = 2, DRAW_NOISE = 3 };

/* Number of a scene: the same whatever the number of scenes per bin. */
static uint64_t stream_of(const rx_lab *lab, const rx_lab_unit *unit)
{
    const rx_lab_bin *bin = &lab->bin[unit->condition];
    const uint64_t which = (uint64_t)lround(8.0 * bin->low) << 1 | (uint64_t)bin->by_sigma;
    return which << 40 | (uint64_t)(lab->scene[unit->scene].id == RX_SCENE_TUNING) << 36 |
           (uint64_t)unit->number;
}

static double brightness(const rx_object *object, double least_radius)
{
    const double radius = fmax(object->radius, least_radius);
    return object->flux / (radius * radius);
}

/* See the head of this file. */
static void compose(const rx_lab *lab, uint64_t seed, uint64_t stream, rx_scene *scene)
{
    const double side = lab->config->scene_side;
    rx_object *main = NULL;
    for (long i = 0; i < scene->n; i++)
        if (scene->objects[i].type != RX_OBJECT_STAR && (main == NULL || scene->objects[i].flux > main->flux))
            main = &scene->objects[i];
    if (main == NULL || !(main->radius > 0))
        return;
    const double radius =
        side * (FILL_LOW + (FILL_HIGH - FILL_LOW) * rx_random_uniform(seed, stream, UINT64_C(1) << 62));
    const double factor = radius / main->radius;
    main->radius *= factor;
    main->bulge_radius *= factor;
    main->disk_radius *= factor;
    main->bar_radius *= factor;
    main->stretch *= factor;
    main->flux *= factor * factor;
    main->x =
        0.5 * (side - 1) + PLACE * side * (2 * rx_random_uniform(seed, stream, (UINT64_C(1) << 62) + 1) - 1);
    main->y =
        0.5 * (side - 1) + PLACE * side * (2 * rx_random_uniform(seed, stream, (UINT64_C(1) << 62) + 2) - 1);
    const double limit = OTHERS * brightness(main, 0);
    for (long i = 0; i < scene->n; i++) {
        rx_object *other = &scene->objects[i];
        const double bright = brightness(other, lab->sky[0].simulation->sharp_fwhm);
        if (other != main && bright > limit)
            other->flux *= limit / bright;
    }
}

/* The PSF as a restorer is given it; one that is larger than the scene is cut to it. */
static rx_status known_psf(const rx_lab *lab, const rx_optics *optics, rx_psf **dst, rx_error *err)
{
    rx_status status = rx_optics_on_pixels(optics, dst, err);
    if (status != RX_OK || (*dst)->size <= lab->config->scene_side)
        return status;
    const rx_simulate_config *sim = lab->config->sim;
    rx_psf_free(*dst);
    *dst = NULL;
    return rx_psf_moffat(optics->fwhm, sim->psf_beta, sim->psf_ratio, sim->psf_angle * M_PI / 180.0,
                         lab->config->scene_side - 1 + lab->config->scene_side % 2, dst, err);
}

static rx_status expose(const rx_lab *lab, uint64_t stream, const rx_scene *scene, rx_trial *dst,
                        rx_error *err)
{
    const rx_simulate_config *sim = lab->config->sim;
    const size_t n = (size_t)lab->config->scene_side * (size_t)lab->config->scene_side;
    rx_optics *optics = NULL;
    float *noise = RX_NEW(float, n);
    rx_status status = noise == NULL
                           ? rx_error_memory(err, n * sizeof *noise)
                           : rx_optics_moffat(&(rx_moffat_profile){.fwhm = dst->fwhm,
                                                                   .beta = sim->psf_beta,
                                                                   .ratio = sim->psf_ratio,
                                                                   .angle = sim->psf_angle * M_PI / 180.0},
                                              lab->config->scene_side, lab->config->scene_side, &optics, err);
    if (status == RX_OK)
        status = rx_render(scene, 2, (const rx_optics *const[]){optics, lab->sky[0].simulation->target},
                           (float *const[]){dst->image, dst->sharp}, 1, err);
    if (status == RX_OK)
        status = known_psf(lab, optics, &dst->psf, err);
    if (status != RX_OK)
        goto exit;
    double peak = 0;
    for (size_t i = 0; i < n; i++)
        peak = fmax(peak, dst->sharp[i]);
    const double factor = peak > 0 ? lab->config->scene_peak / peak : 0;
    for (size_t i = 0; i < n; i++) {
        dst->sharp[i] = (float)(dst->sharp[i] * factor);
        dst->image[i] = (float)(dst->image[i] * factor);
    }
    memcpy(noise, dst->image, n * sizeof *noise);
    dst->level = rx_noise_level(rx_brightness(noise, n, 0) / dst->sigma);
    rx_noise_normals(rx_lab_seed(lab, DRAW_NOISE), stream, 0, (long)n, noise);
    for (size_t i = 0; i < n; i++)
        dst->image[i] += (float)(dst->sigma * noise[i]);
exit:
    rx_optics_free(optics);
    free(noise);
    return status;
}

rx_status rx_trial_make(const rx_lab *lab, const rx_lab_unit *unit, rx_trial *dst, rx_error *err)
{
    const int side = lab->config->scene_side;
    const size_t n = (size_t)side * (size_t)side;
    const rx_lab_bin *bin = &lab->bin[unit->condition];
    const uint64_t stream = stream_of(lab, unit), seed = rx_lab_seed(lab, DRAW_QUANTITIES);
    const double u = rx_random_uniform(seed, stream, 0), v = rx_random_uniform(seed, stream, 1);
    const double binned = bin->low + (bin->high - bin->low) * u,
                 other = bin->other_low + (bin->other_high - bin->other_low) * v;
    rx_scene_params par = lab->sky[0].simulation->scene;
    rx_scene *scene = NULL;
    par.seed = rx_lab_seed(lab, DRAW_SCENE);
    par.stream = stream;
    *dst = (rx_trial){.fwhm = bin->by_sigma ? other : binned,
                      .sigma = bin->by_sigma ? binned : other,
                      .image = RX_NEW(float, n),
                      .sharp = RX_NEW(float, n)};
    rx_status status = dst->image == NULL || dst->sharp == NULL
                           ? rx_error_memory(err, 2 * n * sizeof(float))
                           : rx_scene_make(&par, lab->sky[0].simulation->templates, &scene, err);
    if (status == RX_OK) {
        compose(lab, par.seed, stream, scene);
        status = expose(lab, stream, scene, dst, err);
    }
    if (status == RX_OK)
        status = rx_image_reference_new(side, side, dst->sharp, &dst->reference, err);
    rx_scene_free(scene);
    if (status != RX_OK)
        rx_trial_free(dst);
    return status;
}

void rx_trial_free(rx_trial *trial)
{
    free(trial->image);
    free(trial->sharp);
    rx_image_reference_free(trial->reference);
    rx_psf_free(trial->psf);
    *trial = (rx_trial){0};
}

rx_status rx_trial_restore(const rx_lab *lab, const rx_trial *trial, const rx_restorer *restorer, int niter,
                           float *dst, rx_error *err)
{
    rx_restored *restored = NULL;
    rx_restore_params par = lab->options->pipeline.restore;
    if (niter > 0) {
        par.rl_niter = niter;
        par.rl_stop_discrepancy = 0;
        par.rl_denoise = 0;
        par.rl_denoise_by_psf = 0;
    }
    rx_background sky = {.width = lab->config->scene_side, .height = lab->config->scene_side};
    rx_background_flatten(&sky, 0, trial->sigma);
    const rx_image image = {.name = "scene",
                            .width = lab->config->scene_side,
                            .height = lab->config->scene_side,
                            .pixels = trial->image,
                            .noise = rx_background_noise(&sky),
                            .saturation = HUGE_VAL,
                            .psf = trial->psf};
    rx_status status = restorer->run(&par, &image, NULL, &restored, err);
    if (status == RX_OK)
        memcpy(dst, restored->pixels,
               (size_t)lab->config->scene_side * (size_t)lab->config->scene_side * sizeof *dst);
    rx_restored_free(restored);
    return status;
}
