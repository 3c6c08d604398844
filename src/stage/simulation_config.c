/* From the keywords of rextract-simulate to plain values. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/threads.h"
#include "psf/psf.h"
#include "stage/simulation_parts.h"

static const double MPIXEL = 1e6;
/* FWHM beyond the border in which objects still lie, for their wings reach the tile. */
static const double BORDER = 4.0;

static int is(const char *word, const char *other)
{
    return strcmp(word, other) == 0;
}

/* --- PSF --- */

static rx_status moffat(const rx_simulate_config *config, const rx_simulation_ground *ground, rx_optics **dst,
                        rx_error *err)
{
    return rx_optics_moffat(config->psf_fwhm, config->psf_beta, config->psf_ratio,
                            config->psf_angle * M_PI / 180.0, config->psf_variation, ground->width,
                            ground->height, dst, err);
}

static rx_status make_optics(const rx_simulate_config *config, const rx_simulation_ground *ground,
                             rx_log *log, rx_optics **dst, rx_error *err)
{
    rx_psf *psf = NULL;
    rx_status status;
    if (is(config->psf_type, "MOFFAT"))
        return moffat(config, ground, dst, err);
    if (is(config->psf_type, "AUTO"))
        return ground->psf != NULL
                   ? rx_optics_psf(ground->psf, dst, err)
                   : rx_error_set(err, RX_USAGE,
                                  "PSF_TYPE AUTO is measured on a real tile; give INJECT_IMAGE");
    if (is(config->psf_type, "PSFEX"))
        status = rx_psf_psfex(config->psf_name, ground->extension, 0, ground->width, ground->height, log,
                              &psf, err);
    else
        status = rx_psf_image(config->psf_name, 0, ground->width, ground->height, log, &psf, err);
    if (status == RX_OK)
        status = rx_optics_psf(psf, dst, err);
    rx_psf_free(psf);
    return status;
}

/* --- scene and noise --- */

static rx_population population(double per_mpixel, const rx_reals *magnitudes, double slope, double pixels)
{
    return (rx_population){.count = per_mpixel * pixels / MPIXEL,
                           .mag_low = magnitudes->v[0],
                           .mag_high = magnitudes->v[1],
                           .slope = slope};
}

static rx_scene_params scene_params(const rx_simulate_config *config, const rx_simulation_ground *ground,
                                    double fwhm)
{
    /* counts are per area, and objects also lie beyond the border */
    const double margin = ceil(ground->margin * fwhm);
    const double pixels = (ground->width + 2.0 * margin) * (ground->height + 2.0 * margin);
    const char *kind = config->galaxy_type;
    return (rx_scene_params){
        .width = ground->width,
        .height = ground->height,
        .zeropoint = ground->zeropoint,
        .pixel_scale = ground->pixel_scale,
        .stars = population(config->star_count, &config->star_mag, config->star_slope, pixels),
        .galaxies = population(config->galaxy_count, &config->galaxy_mag, config->galaxy_slope, pixels),
        .templates =
            population(config->template_count, &config->template_mag, config->template_slope, pixels),
        .galaxy_kind = is(kind, "SMOOTH")   ? RX_GALAXY_SMOOTH
                       : is(kind, "SPIRAL") ? RX_GALAXY_SPIRAL
                                            : RX_GALAXY_MIXED,
        .galaxy_scale = config->galaxy_scale,
        .template_blur = config->sharp_fwhm, /* the sharp reference would be no reference */
        .pair_share = config->pair_share,
        .pair_low = config->pair_distance.v[0] * fwhm,
        .pair_high = config->pair_distance.v[1] * fwhm,
        .clustering = config->clustering,
        .margin = margin,
        .least_distance = config->least_distance * fwhm,
        .seed = (uint64_t)config->seed,
        .stream = (uint64_t)config->scene_number,
    };
}

/* Pixels are floats, so the level at which they stop must be one: the file says the same number. */
static double saturation_level(double level)
{
    return level > 0.0 ? (double)(float)level : HUGE_VAL;
}

static rx_noise_params noise_params(const rx_simulate_config *config)
{
    const char *type = config->noise_type;
    return (rx_noise_params){
        .type = is(type, "CCD")     ? RX_NOISE_CCD
                : is(type, "GAUSS") ? RX_NOISE_GAUSS
                                    : RX_NOISE_NONE,
        .sky = config->sky_level,
        .sigma = config->noise_sigma,
        .gain = config->gain,
        .read_noise = config->read_noise,
        .saturation = saturation_level(config->satur_level),
        .bad_columns = config->bad_columns,
        .cosmic_rays = config->cosmic_rays,
        .seed = (uint64_t)config->seed,
    };
}

/* --- all of it --- */

rx_status rx_simulation_build(const rx_simulate_config *config, const rx_simulation_ground *ground,
                              rx_log *log, rx_simulation **dst, rx_error *err)
{
    double fwhm = config->psf_fwhm;
    rx_status status = RX_OK;
    rx_simulation *simulation = RX_NEW(rx_simulation, 1);
    if (simulation == NULL)
        return rx_error_memory(err, sizeof *simulation);
    simulation->sharp_fwhm = config->sharp_fwhm;
    simulation->alpha = config->sky_center.v[0];
    simulation->delta = config->sky_center.v[1];
    simulation->nthreads = rx_threads_wanted(config->nthreads);
    simulation->noise = noise_params(config);
    if (ground->with_optics) {
        status = make_optics(config, ground, log, &simulation->optics, err);
        if (status == RX_OK)
            fwhm = simulation->optics->fwhm;
    }
    if (status == RX_OK)
        status = rx_optics_gauss(config->sharp_fwhm, &simulation->target, err);
    if (status == RX_OK && config->template_count > 0.0)
        status = rx_templates_read(config->template_name, config->template_scale, config->template_snr, log,
                                   &simulation->templates, err);
    simulation->scene = scene_params(config, ground, fwhm);
    if (status == RX_OK)
        *dst = simulation;
    else
        rx_simulation_free(simulation);
    return status;
}

rx_status rx_simulation_from_config(const rx_simulate_config *config, rx_log *log, rx_simulation **dst,
                                    rx_error *err)
{
    const rx_ints *size = &config->image_size;
    const rx_simulation_ground ground = {.width = size->v[0],
                                         .height = size->v[size->n > 1 ? 1 : 0],
                                         .extension = 1,
                                         .zeropoint = config->mag_zeropoint,
                                         .pixel_scale = config->pixel_scale,
                                         .margin = BORDER,
                                         .with_optics = config->inject_image[0] == '\0'};
    return rx_simulation_build(config, &ground, log, dst, err);
}

void rx_simulation_free(rx_simulation *simulation)
{
    if (simulation == NULL)
        return;
    rx_templates_free(simulation->templates);
    rx_optics_free(simulation->optics);
    rx_optics_free(simulation->target);
    free(simulation->allowed);
    free(simulation);
}
