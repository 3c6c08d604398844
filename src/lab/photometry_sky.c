/* Skies and tiles of the photometry campaign. */
#include "lab/photometry_sky.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "check/blankcheck.h"
#include "check/quality.h"
#include "check/replica.h"
#include "data/psf.h"
#include "io/tile.h"
#include "simulate/inject.h"
#include "simulate/noise.h"
#include "simulate/render.h"
#include "stage/open.h"

/* Test stars are so many FWHM apart, and so many from the border. */
static const double APART = 6.0, INSIDE = 4.0;
/* A detection belongs to a known galaxy within so many half-light radii. */
static const double GALAXY_REACH = 2.0;
static const double MPIXEL = 1024.0 * 1024.0; /* STARS_PER_TILE */

/* What random numbers are for: their streams never meet. */
enum { DRAW_SKY = 1, DRAW_STARS = 2, DRAW_NOISE = 3, DRAW_BLANK = 4 };

static uint64_t seed_for(const rx_photometry_state *state, uint64_t purpose)
{
    uint32_t words[4];
    rx_random_block((uint64_t)state->config->seed, 0x70686f746f, purpose, words);
    return (uint64_t)words[0] << 32 | words[1];
}

long rx_photometry_units(const rx_photometry_state *state)
{
    return state->nskies * state->nmags * state->ntiles;
}

/* --- skies --- */

static rx_status measure_power(rx_photometry_sky *sky, rx_error *err)
{
    const size_t n = (size_t)sky->psf->size * (size_t)sky->psf->size;
    float *stamp = RX_NEW(float, n);
    if (stamp == NULL)
        return rx_error_memory(err, n * sizeof *stamp);
    rx_psf_at(sky->psf, 0.5 * (sky->width - 1), 0.5 * (sky->height - 1), stamp);
    sky->power = 0;
    for (size_t i = 0; i < n; i++)
        sky->power += (double)stamp[i] * (double)stamp[i];
    free(stamp);
    return RX_OK;
}

static rx_status open_simulated(rx_photometry_state *state, rx_log *log, rx_photometry_sky *dst,
                                rx_error *err)
{
    const rx_campaign_config *config = state->config;
    const int find = rx_settings_was_set(&config->settings, "STAGE.PSF_TYPE") != RX_FROM_DEFAULT;
    if (find && dst->condition.psf_error != 0.0)
        return rx_error_set(
            err, RX_USAGE,
            "PSF_ERROR says what PSF restorers are given, STAGE.PSF_TYPE that they find it; leave "
            "out one of them");
    rx_status status = rx_condition_simulation(&dst->condition, config->sim, log, &dst->simulation, err);
    if (status != RX_OK)
        return status;
    dst->width = dst->simulation->scene.width;
    dst->height = dst->simulation->scene.height;
    dst->fwhm = dst->simulation->optics->fwhm;
    if (!find)
        status = rx_condition_psf(&dst->condition, config->sim, dst->simulation, &dst->told, err);
    return status == RX_OK ? rx_optics_on_pixels(dst->simulation->optics, &dst->psf, err) : status;
}

static rx_status allow(rx_photometry_sky *sky, rx_error *err)
{
    const rx_tile *tile = sky->field->tile;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    uint8_t *mask = RX_NEW(uint8_t, n);
    sky->allowed = RX_NEW(unsigned char, n);
    rx_status status = RX_OK;
    if (mask == NULL || sky->allowed == NULL) {
        status = rx_error_memory(err, 2 * n);
    } else {
        for (size_t i = 0; i < n; i++)
            mask[i] = tile->mask[i] & RX_HIDE_PLAIN;
        status =
            rx_inject_allowed(RX_INJECT_AMONG, tile->width, tile->height, NULL, mask, 0, sky->allowed, err);
    }
    free(mask);
    return status;
}

/* The first image of TILE_NAME, with its PSF whether a restorer needs it or not. */
static rx_status open_injected(rx_photometry_state *state, rx_log *log, rx_photometry_sky *dst, rx_error *err)
{
    const rx_campaign_config *config = state->config;
    if (config->tile_name[0] == '\0')
        return rx_error_set(err, RX_USAGE,
                            "FIELDS INJECTED needs TILE_NAME, the tile that stars are added to");
    int *hdus = NULL, n = 0;
    rx_status status = rx_tile_list(config->tile_name, log, &hdus, &n, err);
    if (status == RX_OK)
        status = rx_field_open(state->options, RX_FIELD_PSF, &(rx_image_place){config->tile_name, hdus[0], 1},
                               log, &dst->field, err);
    free(hdus);
    if (status != RX_OK)
        return status;
    rx_tile *tile = dst->field->tile;
    if (dst->field->psf == NULL)
        return rx_error_at(
            err, RX_INPUT, tile->name, tile->hdu, 0,
            "has too few stars for a PSF of its own; give STAGE.PSF_TYPE and what belongs to it");
    if (tile->zeropoint == 0) /* the stage's default states nothing */
        tile->zeropoint = config->sim->mag_zeropoint;
    dst->injected = 1;
    dst->width = tile->width;
    dst->height = tile->height;
    dst->fwhm = dst->field->psf->fwhm;
    dst->psf = rx_psf_copy(dst->field->psf);
    dst->told = rx_psf_copy(dst->field->psf);
    if (dst->psf == NULL || dst->told == NULL)
        return rx_error_memory(err, 0);
    status = rx_optics_psf(dst->psf, &dst->optics, err);
    return status == RX_OK ? allow(dst, err) : status;
}

rx_status rx_photometry_sky_open(rx_photometry_state *state, int injected, const rx_condition *condition,
                                 rx_log *log, rx_photometry_sky *dst, rx_error *err)
{
    dst->condition = *condition;
    rx_status status = injected ? open_injected(state, log, dst, err) : open_simulated(state, log, dst, err);
    return status == RX_OK ? measure_power(dst, err) : status;
}

void rx_photometry_sky_close(rx_photometry_sky *sky)
{
    rx_psf_free(sky->psf);
    rx_psf_free(sky->told);
    rx_simulation_free(sky->simulation);
    rx_field_free(sky->field);
    rx_optics_free(sky->optics);
    free(sky->allowed);
    rx_known_free(&sky->before);
    *sky = (rx_photometry_sky){0};
}

/* --- tiles --- */

/* Test stars: nothing else, apart from each other, anywhere allowed. */
static rx_status make_stars(const rx_photometry_state *state, const rx_photometry_sky *sky, double mag,
                            double zeropoint, uint64_t number, rx_scene **dst, rx_error *err)
{
    const double area = (double)sky->width * (double)sky->height;
    const double least = fmin(sky->width, sky->height);
    const rx_scene_params par = {
        .width = sky->width,
        .height = sky->height,
        .zeropoint = zeropoint,
        .pixel_scale = 1.0,
        .galaxy_scale = 1.0,
        .stars = {.count = fmax(floor(state->config->stars_per_tile * area / MPIXEL + 0.5), 1),
                  .mag_low = mag,
                  .mag_high = mag},
        .margin = -fmin(INSIDE * sky->fwhm, least / 4),
        .least_distance = APART * sky->fwhm,
        .allowed = sky->allowed,
        .seed = seed_for(state, DRAW_STARS),
        .stream = number};
    return rx_scene_make(&par, NULL, dst, err);
}

static rx_status take_stars(const rx_scene *stars, double mag, double zeropoint, rx_photometry_tile *dst,
                            rx_error *err)
{
    dst->n = stars->n;
    dst->flux = pow(10.0, -0.4 * (mag - zeropoint));
    dst->x = RX_NEW(double, (size_t)stars->n);
    dst->y = RX_NEW(double, (size_t)stars->n);
    if (dst->x == NULL || dst->y == NULL)
        return rx_error_memory(err, 2 * (size_t)stars->n * sizeof(double));
    for (long i = 0; i < stars->n; i++) {
        dst->x[i] = stars->objects[i].x;
        dst->y[i] = stars->objects[i].y;
        stars->objects[i].mag = mag;
        stars->objects[i].flux = dst->flux;
    }
    return RX_OK;
}

static rx_status know_scene(const rx_photometry_sky *sky, const rx_scene *scene, double radius, rx_known *dst,
                            rx_error *err)
{
    rx_status status = rx_known_new(scene->n, dst, err);
    for (long i = 0; status == RX_OK && i < scene->n; i++) {
        const rx_object *object = &scene->objects[i];
        dst->x[i] = object->x;
        dst->y[i] = object->y;
        dst->flux[i] = object->flux;
        dst->radius[i] = fmax(fmax(radius, sky->fwhm), GALAXY_REACH * object->radius);
    }
    return status;
}

static rx_status join(const rx_scene *a, const rx_scene *b, rx_scene **dst, rx_error *err)
{
    rx_status status = rx_scene_new(a->width, a->height, a->n + b->n, dst, err);
    if (status != RX_OK)
        return status;
    memcpy((*dst)->objects, a->objects, (size_t)a->n * sizeof *a->objects);
    memcpy((*dst)->objects + a->n, b->objects, (size_t)b->n * sizeof *b->objects);
    (*dst)->templates = a->templates;
    return RX_OK;
}

/* Pixels of a simulated tile: everything on it through the optics, then sky and noise. */
static rx_status expose(const rx_photometry_state *state, const rx_photometry_sky *sky, uint64_t number,
                        rx_simulated *simulated, rx_error *err)
{
    const rx_simulation *simulation = sky->simulation;
    const size_t n = (size_t)sky->width * (size_t)sky->height;
    const rx_optics *optics = simulation->optics;
    simulated->width = sky->width;
    simulated->height = sky->height;
    simulated->image = RX_NEW(float, n);
    simulated->defects = RX_NEW(uint8_t, n);
    if (simulated->image == NULL || simulated->defects == NULL)
        return rx_error_memory(err, n * sizeof(float));
    rx_noise_params noise = simulation->noise;
    noise.seed = seed_for(state, DRAW_NOISE);
    noise.stream = number;
    rx_status status = rx_render(simulated->scene, 1, &optics, &simulated->image, 1, err);
    if (status == RX_OK)
        status =
            rx_noise_expose(&noise, sky->width, sky->height, simulated->image, simulated->defects, 1, err);
    return status;
}

static rx_status simulated_tile(const rx_photometry_state *state, const rx_photometry_sky *sky,
                                const rx_scene *stars, uint64_t number, rx_tile **tile, rx_known *known,
                                rx_error *err)
{
    rx_simulated simulated = {.noise = sky->simulation->noise};
    rx_scene *others = NULL;
    rx_scene_params par = sky->simulation->scene;
    par.seed = seed_for(state, DRAW_SKY);
    par.stream = number;
    rx_status status = rx_scene_make(&par, sky->simulation->templates, &others, err);
    if (status == RX_OK)
        status = join(others, stars, &simulated.scene, err);
    if (status == RX_OK)
        status = expose(state, sky, number, &simulated, err);
    if (status == RX_OK) {
        /* world coordinates: not every version of wcslib reads headers in several threads */
#pragma omp critical(rx_campaign_tile)
        status = rx_simulation_tile(sky->simulation, &simulated, "simulated", tile, err);
    }
    double radius = 0;
    if (status == RX_OK)
        status = rx_quality_radius(&state->options->check.quality, *tile, &radius, err);
    if (status == RX_OK)
        status = know_scene(sky, others, radius, known, err);
    rx_scene_free(others);
    rx_simulated_free(&simulated);
    return status;
}

static rx_status injected_tile(const rx_photometry_state *state, const rx_photometry_sky *sky,
                               const rx_scene *stars, uint64_t number, rx_tile **tile, rx_error *err)
{
    const rx_tile *src = sky->field->tile;
    const double gain = src->gain > 0 ? src->gain : state->config->sim->gain;
    rx_status status = rx_replica_new(src, NULL, tile, err);
    if (status == RX_OK)
        status = rx_inject(stars, sky->optics,
                           &(rx_inject_params){.gain = gain,
                                               .saturation = src->saturation,
                                               .noise = &sky->noise,
                                               .seed = seed_for(state, DRAW_NOISE),
                                               .stream = number},
                           1, (*tile)->pixels, err);
    if (status == RX_OK)
        rx_replica_settle(*tile);
    return status;
}

rx_status rx_photometry_blank_make(const rx_photometry_state *state, const rx_photometry_sky *sky,
                                   uint64_t number, rx_field **dst, rx_error *err)
{
    return rx_blankcheck_field(&state->options->pipeline, sky->field, &sky->noise, NULL,
                               seed_for(state, DRAW_BLANK), number, dst, err);
}

static int needs_psf(const rx_photometry_state *state)
{
    for (int r = 0; r < state->nruns; r++)
        if (state->run[r]->needs_psf)
            return 1;
    return 0;
}

rx_status rx_photometry_tile_make(const rx_photometry_state *state, const rx_photometry_sky *sky, double mag,
                                  uint64_t number, rx_photometry_tile *dst, rx_error *err)
{
    rx_scene *stars = NULL;
    rx_tile *tile = NULL;
    const double zeropoint = sky->injected ? sky->field->tile->zeropoint : sky->simulation->scene.zeropoint;
    *dst = (rx_photometry_tile){0};
    rx_status status = make_stars(state, sky, mag, zeropoint, number, &stars, err);
    if (status == RX_OK)
        status = take_stars(stars, mag, zeropoint, dst, err);
    if (status == RX_OK)
        status = sky->injected ? injected_tile(state, sky, stars, number, &tile, err)
                               : simulated_tile(state, sky, stars, number, &tile, &dst->known, err);
    if (status == RX_OK) {
        status = rx_field_prepare(&state->options->pipeline, (needs_psf(state) ? RX_FIELD_PSF : 0), tile,
                                  sky->told, NULL, &dst->field, err);
        tile = NULL; /* the field's */
    }
    if (status == RX_OK)
        rx_condition_apply(&sky->condition, dst->field);
    if (status == RX_OK && dst->field->unrestorable && needs_psf(state))
        status = rx_error_set(err, RX_INPUT,
                              "a simulated tile has too few stars for the PSF that STAGE.PSF_TYPE asks for; "
                              "leave it out, and restorers are given the true one");
    rx_tile_free(tile);
    rx_scene_free(stars);
    if (status != RX_OK)
        rx_photometry_tile_free(dst);
    return status;
}

void rx_photometry_tile_free(rx_photometry_tile *tile)
{
    rx_field_free(tile->field);
    rx_known_free(&tile->known);
    free(tile->x);
    free(tile->y);
    *tile = (rx_photometry_tile){0};
}
