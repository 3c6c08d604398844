/* Injection: the simulator on a real tile. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "restore/restore.h"
#include "simulate/inject.h"
#include "simulate/render.h"
#include "stage/probe.h"
#include "stage/simulation_parts.h"

/* MAG_ZEROPOINT where it was set by hand, else what the tile states (0, the stage's default, states nothing).
 */
static double zeropoint_of(const rx_simulate_config *config, const rx_tile *tile, rx_log *log)
{
    if (rx_settings_was_set(&config->settings, "MAG_ZEROPOINT") != RX_FROM_DEFAULT)
        return config->mag_zeropoint;
    if (tile->zeropoint != 0.0)
        return tile->zeropoint;
    rx_log_warning(log, "%s[%d]: no zero point is known; magnitudes are those of MAG_ZEROPOINT %g",
                   tile->name, tile->hdu, config->mag_zeropoint);
    return config->mag_zeropoint;
}

static double gain_of(const rx_simulate_config *config, const rx_tile *tile, rx_log *log)
{
    double gain = tile->gain > 0.0 ? tile->gain : config->gain;
    if (!(gain > 0.0))
        rx_log_warning(log, "%s[%d]: no gain is known; the added light brings no photon noise (give GAIN)",
                       tile->name, tile->hdu);
    return gain;
}

/* Masks of AWAY are all bits; a source AMONG others can also lie on saturated pixels. */
static rx_status allow(const rx_simulate_config *config, const rx_options *options, const rx_field *field,
                       double fwhm, rx_log *log, unsigned char **dst, rx_error *err)
{
    const rx_tile *tile = field->tile;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    const int away = strcmp(config->inject_place, "AWAY") == 0;
    rx_probe probe = {0};
    rx_status status = RX_OK;
    uint8_t *mask = RX_NEW(uint8_t, n);
    *dst = RX_NEW(unsigned char, n);
    if (mask == NULL || *dst == NULL) {
        status = rx_error_memory(err, n);
        goto exit;
    }
    for (size_t i = 0; i < n; i++)
        mask[i] = tile->mask[i] & (away ? RX_HIDE_RESTORED : RX_HIDE_PLAIN);
    if (away) {
        status = rx_probe_run(options, rx_restorer_find("NONE"), field, NULL, log, &probe, err);
        if (status != RX_OK)
            goto exit;
    }
    status = rx_inject_allowed(away ? RX_INJECT_AWAY : RX_INJECT_AMONG, tile->width, tile->height,
                               away ? probe.sources->segments : NULL, mask, config->inject_distance * fwhm,
                               *dst, err);
    if (away)
        rx_probe_free(&probe);
exit:
    free(mask);
    return status;
}

/* A PSF that was only stated would pass for the tile's own. */
static rx_status check_measured(const rx_field *field, rx_error *err)
{
    if (field->psf != NULL && field->psf->type == RX_PSF_AUTO)
        return RX_OK;
    return rx_error_at(
        err, RX_INPUT, field->tile->name, field->tile->hdu, 0,
        "too few stars to measure the PSF; give -PSF_TYPE MOFFAT -PSF_FWHM <pixels>, or a PSF file");
}

rx_status rx_simulation_for_tile(const rx_simulate_config *config, const rx_options *options,
                                 const rx_field *field, rx_log *log, rx_simulation **dst, rx_error *err)
{
    const rx_tile *tile = field->tile;
    const int automatic = strcmp(config->psf_type, "AUTO") == 0;
    rx_simulation *simulation = NULL;
    rx_status status = automatic ? check_measured(field, err) : RX_OK;
    if (status != RX_OK)
        return status;
    const rx_simulation_ground ground = {.width = tile->width,
                                         .height = tile->height,
                                         .extension = tile->extension,
                                         .zeropoint = zeropoint_of(config, tile, log),
                                         .pixel_scale = tile->pixel_scale > 0.0 ? tile->pixel_scale
                                                                                : config->pixel_scale,
                                         .psf = automatic ? field->psf : NULL,
                                         .with_optics = 1};
    status = rx_simulation_build(config, &ground, log, &simulation, err);
    if (status != RX_OK)
        return status;
    simulation->nthreads = options->nthreads;
    simulation->noise.type = RX_NOISE_NONE;
    simulation->noise.sky = simulation->noise.sigma = 0.0;
    simulation->noise.gain = gain_of(config, tile, log);
    simulation->noise.saturation = tile->saturation;
    status = allow(config, options, field, simulation->optics->fwhm, log, &simulation->allowed, err);
    if (status == RX_OK)
        *dst = simulation;
    else
        rx_simulation_free(simulation);
    return status;
}

rx_status rx_simulation_inject(const rx_simulation *simulation, uint64_t stream, float *pixels, float *sharp,
                               rx_scene **dst, rx_error *err)
{
    const rx_noise_params *noise = &simulation->noise;
    const rx_scene_params par = rx_simulation_scene(simulation, stream);
    const rx_optics *target = simulation->target;
    rx_scene *scene = NULL;
    rx_status status = rx_scene_make(&par, simulation->templates, &scene, err);
    if (status == RX_OK)
        status = rx_inject(scene, simulation->optics, noise->gain, noise->saturation, noise->seed,
                           rx_simulation_pixel_stream(stream), simulation->nthreads, pixels, err);
    if (status == RX_OK && sharp != NULL) {
        memset(sharp, 0, (size_t)par.width * (size_t)par.height * sizeof(float));
        status = rx_render(scene, 1, &target, &sharp, simulation->nthreads, err);
    }
    if (status == RX_OK)
        *dst = scene;
    else
        rx_scene_free(scene);
    return status;
}
