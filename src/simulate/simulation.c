/* Simulated fields: what the keywords say of them, and what is drawn. */
#include "simulate/simulation.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/text.h"
#include "base/threads.h"
#include "io/fits_write.h"
#include "io/tile.h"
#include "io/wcs.h"
#include "psf/psf.h"
#include "simulate/inject.h"
#include "simulate/render.h"

/* --- keywords to plain values --- */

static const double MPIXEL = 1e6;
/* FWHM beyond the border in which objects still lie, for their wings reach the tile. */
static const double BORDER = 4.0;

static int is(const char *word, const char *other)
{
    return strcmp(word, other) == 0;
}

/* --- coadds --- */

static rx_coadd_params coadd_params(const rx_simulate_config *config)
{
    const rx_coadd_type type = is(config->coadd_type, "DRIZZLE")   ? RX_COADD_DRIZZLE
                               : is(config->coadd_type, "LANCZOS") ? RX_COADD_LANCZOS
                                                                   : RX_COADD_NONE;
    return (rx_coadd_params){.type = type,
                             .frames = config->coadd_frames,
                             .pixfrac = config->coadd_pixfrac,
                             .scale = config->coadd_scale > 0.0  ? config->coadd_scale
                                      : type == RX_COADD_DRIZZLE ? 0.6
                                                                 : 1.0,
                             .uneven = config->coadd_uneven};
}

/* --- PSF --- */

static rx_status make_optics(const rx_simulate_config *config, const rx_simulation_ground *ground,
                             rx_log *log, rx_optics **dst, rx_error *err)
{
    const rx_psf_params par = {.file = config->psf_name, .extension = ground->extension};
    const int given = is(config->psf_type, "AUTO");
    rx_psf *psf = NULL;
    if (is(config->psf_type, "MOFFAT")) { /* stated in pixels of the image, made for those that see the sky */
        const rx_coadd_params coadd = coadd_params(config);
        const double scale = coadd.type != RX_COADD_NONE ? coadd.scale : 1.0;
        return rx_optics_moffat(
            &(rx_moffat_profile){config->psf_fwhm * scale, config->psf_beta, config->psf_ratio,
                                 config->psf_angle * M_PI / 180.0, config->psf_variation},
            (int)lround(ground->width * scale), (int)lround(ground->height * scale), dst, err);
    }
    if (given && ground->psf == NULL)
        return rx_error_set(err, RX_USAGE, "PSF_TYPE AUTO is measured on a real tile; give INJECT_IMAGE");
    if (!given)
        RX_TRY((is(config->psf_type, "PSFEX") ? rx_psf_psfex : rx_psf_file)(&par, ground->width,
                                                                            ground->height, log, &psf, err));
    const rx_status status = rx_optics_psf(given ? ground->psf : psf, dst, err);
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
        /* pixels are floats, so this level must be one: the file says the same number */
        .saturation = config->satur_level > 0.0 ? (double)(float)config->satur_level : HUGE_VAL,
        .bad_columns = config->bad_columns,
        .cosmic_rays = config->cosmic_rays,
        .seed = (uint64_t)(config->noise_seed < 0 ? config->seed : config->noise_seed),
    };
}

/* --- all of it --- */

rx_status rx_simulation_build(const rx_simulate_config *config, const rx_simulation_ground *ground,
                              rx_log *log, rx_simulation **dst, rx_error *err)
{
    double fwhm = config->psf_fwhm;
    rx_status status;
    rx_simulation *made;
    RX_TRY(RX_MAKE(made, 1, err));
    made->sharp_fwhm = config->sharp_fwhm;
    made->alpha = config->sky_center.v[0];
    made->delta = config->sky_center.v[1];
    made->nthreads = rx_threads_count(config->nthreads);
    made->noise = noise_params(config);
    made->coadd = coadd_params(config);
    if (ground->with_optics) {
        RX_TRY_EXIT(make_optics(config, ground, log, &made->optics, err));
        if (made->coadd.type == RX_COADD_NONE)
            fwhm = made->optics->fwhm;
    }
    RX_TRY_EXIT(rx_optics_gauss(config->sharp_fwhm, &made->target, err));
    if (config->template_count > 0.0)
        RX_TRY_EXIT(rx_templates_read(config->template_name, config->template_scale, config->template_snr,
                                      log, &made->templates, err));
    made->scene = scene_params(config, ground, fwhm);
    *dst = made;
    made = NULL;
exit:
    rx_simulation_free(made);
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
    free(simulation->listed);
    free(simulation);
}

/* --- one simulated field in memory, and as a tile --- */

/* SATURATE of a detector that never saturates: beyond all pixels, and a number that every reader takes. */
static const double NEVER = 1e30;

/* Scenes are numbered from 0; what is drawn per pixel comes from streams that no scene has. */
static uint64_t rx_simulation_pixel_stream(uint64_t stream)
{
    return stream | UINT64_C(1) << 62;
}

static rx_scene_params rx_simulation_scene(const rx_simulation *simulation, uint64_t stream)
{
    rx_scene_params par = simulation->scene;
    par.stream = stream;
    par.allowed = simulation->allowed;
    return par;
}

static rx_status expose(const rx_simulation *simulation, uint64_t stream, rx_simulated *dst, rx_error *err)
{
    const size_t n = (size_t)dst->width * (size_t)dst->height;
    rx_noise_params noise = simulation->noise;
    noise.stream = rx_simulation_pixel_stream(stream);
    dst->noise = simulation->noise;
    dst->sigma = rx_noise_sigma(&noise);
    if (simulation->coadd.type == RX_COADD_NONE) {
        memcpy(dst->image, dst->clean, n * sizeof(float));
        rx_noise_expose(&noise, dst->width, dst->height, dst->image, dst->defects, simulation->nthreads);
        const float weight = dst->sigma > 0.0 ? (float)(1.0 / (dst->sigma * dst->sigma)) : 1.0f;
        for (size_t i = 0; i < n; i++) /* dead columns have none */
            dst->weight[i] = dst->defects[i] & RX_DEFECT_COLUMN ? 0.0f : weight;
        return RX_OK;
    }
    rx_coadd coadd = {.image = dst->image, .weight = dst->weight, .defects = dst->defects};
    rx_status status = rx_coadd_make(&simulation->coadd, dst->scene, simulation->optics, &noise,
                                     simulation->nthreads, &coadd, err);
    dst->noise = coadd.noise;
    dst->sigma = coadd.sigma;
    dst->wide = coadd.wide;
    return status;
}

rx_status rx_simulation_make(const rx_simulation *simulation, uint64_t stream, rx_simulated *dst,
                             rx_error *err)
{
    const int width = simulation->scene.width, height = simulation->scene.height;
    const int exposes_once = simulation->coadd.type == RX_COADD_NONE;
    const size_t n = (size_t)width * (size_t)height;
    *dst = (rx_simulated){.width = width, .height = height, .wide = 1.0};
    if (simulation->optics == NULL)
        return rx_error_set(err, RX_USAGE, "INJECT_IMAGE names a real tile; it is no simulated field");
    const rx_scene_params scene = rx_simulation_scene(simulation, stream);
    const rx_optics *optics[2];
    float *images[2];
    int nimages = 0;
    rx_status status;
    RX_TRY_EXIT(rx_scene_make(&scene, simulation->templates, &dst->scene, err));
    RX_TRY_EXIT(RX_MAKE(dst->image, n, err));
    RX_TRY_EXIT(RX_MAKE(dst->weight, n, err));
    RX_TRY_EXIT(RX_MAKE(dst->defects, n, err));
    if (exposes_once) {
        RX_TRY_EXIT(RX_MAKE(dst->clean, n, err));
        optics[nimages] = simulation->optics;
        images[nimages++] = dst->clean;
    }
    if (!simulation->without_sharp) {
        RX_TRY_EXIT(RX_MAKE(dst->sharp, n, err));
        optics[nimages] = simulation->target;
        images[nimages++] = dst->sharp;
    }
    RX_TRY_EXIT(rx_render(dst->scene, nimages, optics, images, simulation->nthreads, err));
    status = expose(simulation, stream, dst, err);
exit:
    if (status != RX_OK)
        rx_simulated_free(dst);
    return status;
}

void rx_simulated_free(rx_simulated *simulated)
{
    free(simulated->image);
    free(simulated->clean);
    free(simulated->weight);
    free(simulated->sharp);
    free(simulated->defects);
    rx_scene_free(simulated->scene);
    *simulated = (rx_simulated){0};
}

/* --- as a tile --- */

/* Gnomonic projection, north up and east to the left. */
static void write_cards(const rx_simulation *simulation, const rx_noise_params *noise, rx_text *cards)
{
    const double step = simulation->scene.pixel_scale / 3600.0;
    rx_card_text(cards, "CTYPE1", "RA---TAN", "");
    rx_card_text(cards, "CTYPE2", "DEC--TAN", "");
    rx_card_text(cards, "CUNIT1", "deg", "");
    rx_card_text(cards, "CUNIT2", "deg", "");
    rx_card_number(cards, "CRVAL1", simulation->alpha, "");
    rx_card_number(cards, "CRVAL2", simulation->delta, "");
    rx_card_number(cards, "CRPIX1", 0.5 * (simulation->scene.width + 1), "");
    rx_card_number(cards, "CRPIX2", 0.5 * (simulation->scene.height + 1), "");
    rx_card_number(cards, "CD1_1", -step, "");
    rx_card_number(cards, "CD1_2", 0.0, "");
    rx_card_number(cards, "CD2_1", 0.0, "");
    rx_card_number(cards, "CD2_2", step, "");
    rx_card_text(cards, "RADESYS", "ICRS", "");
    rx_card_number(cards, "EQUINOX", 2000.0, "");
    rx_card_text(cards, "BUNIT", "adu", "");
    rx_card_number(cards, "GAIN", noise->gain, "e-/ADU, 0 = infinite");
    rx_card_number(cards, "SATURATE", fmin(noise->saturation, NEVER), "ADU; 1e30 = never");
    rx_card_number(cards, "EXPTIME", 1.0, "s");
    rx_card_number(cards, "MAGZERO", simulation->scene.zeropoint, "magnitude of 1 ADU");
}

static void take_pixels(const rx_simulated *simulated, rx_tile *tile)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    for (size_t i = 0; i < n; i++) {
        if (simulated->defects[i] & RX_DEFECT_COLUMN || !isfinite(simulated->image[i])) {
            tile->mask[i] = RX_MASK_BAD;
            continue;
        }
        tile->pixels[i] = simulated->image[i];
        if ((double)tile->pixels[i] >= tile->saturation)
            tile->mask[i] = RX_MASK_SATURATED;
    }
}

rx_status rx_simulation_tile(const rx_simulation *simulation, const rx_simulated *simulated, const char *name,
                             rx_tile **dst, rx_error *err)
{
    const size_t n = (size_t)simulated->width * (size_t)simulated->height;
    const rx_noise_params *noise = &simulated->noise;
    rx_text cards = {0};
    rx_status status = RX_OK;
    rx_tile *tile;
    RX_TRY(RX_MAKE(tile, 1, err));
    *tile = (rx_tile){.extension = 1,
                      .width = simulated->width,
                      .height = simulated->height,
                      .gain = noise->gain,
                      .saturation = fmin(noise->saturation, NEVER),
                      .zeropoint = simulation->scene.zeropoint,
                      .exptime = 1.0};
    tile->name = rx_strdup(name);
    tile->extname = rx_strdup("");
    tile->pixels = RX_NEW(float, n);
    tile->mask = RX_NEW(uint8_t, n);
    write_cards(simulation, noise, &cards);
    if (tile->name == NULL || tile->extname == NULL || tile->pixels == NULL || tile->mask == NULL ||
        cards.failed)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof(float)));
    take_pixels(simulated, tile);
    tile->ncards = cards.length / 80;
    tile->cards = cards.data;
    cards = (rx_text){0};
    tile->wcs_free = rx_wcs_free;
    status = rx_wcs_from_cards(tile->cards, tile->ncards, tile->width, tile->height, &tile->wcs, NULL, err);
    if (status == RX_OK && tile->wcs != NULL)
        tile->pixel_scale = rx_wcs_pixel_scale(tile->wcs, 0.5 * (tile->width - 1), 0.5 * (tile->height - 1));
exit:
    rx_text_free(&cards);
    if (status == RX_OK)
        *dst = tile;
    else
        rx_tile_free(tile);
    return status;
}

/* --- on a real tile --- */

rx_status rx_simulation_inject(const rx_simulation *simulation, uint64_t stream, float *pixels, float *sharp,
                               rx_scene **dst, rx_error *err)
{
    const rx_noise_params *noise = &simulation->noise;
    const rx_scene_params par = rx_simulation_scene(simulation, stream);
    const rx_inject_params light = {.gain = noise->gain,
                                    .saturation = noise->saturation,
                                    .seed = noise->seed,
                                    .stream = rx_simulation_pixel_stream(stream)};
    rx_scene *scene = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_scene_make(&par, simulation->templates, &scene, err));
    RX_TRY_EXIT(rx_inject(scene, simulation->optics, &light, simulation->nthreads, pixels, err));
    if (sharp != NULL) {
        memset(sharp, 0, (size_t)par.width * (size_t)par.height * sizeof(float));
        RX_TRY_EXIT(
            rx_render(scene, 1, &(const rx_optics *){simulation->target}, &sharp, simulation->nthreads, err));
    }
    *dst = scene;
    scene = NULL;
exit:
    rx_scene_free(scene);
    return status;
}
