/* Tiles of the detection campaign. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "io/tile.h"
#include "lab/detection.h"
#include "num/convolve.h"
#include "simulate/render.h"

/* Least distances and margins inside, in FWHM. */
static const double PAIRS_APART = 8.0, STARS_APART = 20.0, GALAXIES_APART = 12.0, INSIDE = 6.0;
static const double COMPANION_MAG = 0.5;
static const double EXTENDED = 9.06; /* 4 pi / (2 ln 2): r_e^2 of a Gaussian to 1 / sum of its squares */
static const double EDGE = 8.0;      /* pixels, of the plateau */

/* What random numbers are for: their streams never meet. */
enum { DRAW_SCENE = 1, DRAW_NOISE = 2, DRAW_PAIRS = 3 };

static uint64_t seed_for(const rx_detection_state *state, uint64_t purpose)
{
    uint32_t words[4];
    rx_random_block((uint64_t)state->config->seed, 0x6465746563, purpose, words);
    return (uint64_t)words[0] << 32 | words[1];
}

double rx_detection_mag(const rx_detection_sky *sky, double snr)
{
    return sky->simulation->scene.zeropoint - 2.5 * log10(snr * sky->sigma * sqrt(sky->area));
}

double rx_detection_snr(const rx_detection_sky *sky, const rx_object *object)
{
    const double area = sky->area + EXTENDED * object->radius * object->radius * object->ratio;
    return object->flux / (sky->sigma * sqrt(area));
}

rx_population rx_detection_sparse(const rx_detection_sky *sky, const rx_reals *snr, double apart)
{
    const rx_scene_params *scene = &sky->simulation->scene;
    const double step = 1.3 * apart * sky->fwhm;
    return (rx_population){.count = fmax(floor((double)scene->width * scene->height / (step * step)), 1),
                           .mag_low = rx_detection_mag(sky, snr->v[1]),
                           .mag_high = rx_detection_mag(sky, snr->v[0])};
}

static rx_scene_params params_of(const rx_detection_state *state, const rx_detection_sky *sky,
                                 rx_detection_scene scene, uint64_t stream)
{
    static const rx_population none = {0};
    const rx_campaign_config *config = state->config;
    rx_scene_params par = sky->simulation->scene;
    const double least = fmin(par.width, par.height);
    double apart = 0;
    par.seed = seed_for(state, DRAW_SCENE);
    par.stream = stream;
    if (scene != RX_SCENE_GALAXIES && scene != RX_SCENE_STARS) {
        par.pair_share = par.clustering = 0;
        par.margin = -fmin(INSIDE * sky->fwhm, least / 4);
    }
    if (scene != RX_SCENE_STARS)
        par.stars = none;
    if (scene != RX_SCENE_GALAXIES)
        par.galaxies = par.templates = none;
    if (scene == RX_SCENE_PAIRS)
        par.stars = rx_detection_sparse(sky, &config->pair_snr, apart = PAIRS_APART);
    else if (scene == RX_SCENE_RINGS)
        par.stars = rx_detection_sparse(sky, &config->ring_snr, apart = STARS_APART);
    else if (scene == RX_SCENE_OUTSKIRTS)
        par.galaxies = rx_detection_sparse(sky, &config->outskirt_snr, apart = GALAXIES_APART);
    if (apart > 0)
        par.least_distance = apart * sky->fwhm;
    return par;
}

/* Every star gets a companion, right after it in the list. */
static rx_status add_companions(const rx_detection_state *state, const rx_detection_sky *sky, uint64_t stream,
                                rx_scene **scene, rx_error *err)
{
    const uint64_t seed = seed_for(state, DRAW_PAIRS);
    const double *distance = state->config->sim->pair_distance.v;
    rx_scene *all = NULL;
    rx_status status = rx_scene_new((*scene)->width, (*scene)->height, 2 * (*scene)->n, &all, err);
    if (status != RX_OK)
        return status;
    for (long i = 0; i < (*scene)->n; i++) {
        const uint64_t k = 4 * (uint64_t)i;
        const double angle = 2 * M_PI * rx_random_uniform(seed, stream, k);
        const double apart =
            sky->fwhm * (distance[0] + (distance[1] - distance[0]) * rx_random_uniform(seed, stream, k + 1));
        rx_object other = (*scene)->objects[i];
        other.x += apart * cos(angle);
        other.y += apart * sin(angle);
        other.mag += COMPANION_MAG * (2 * rx_random_uniform(seed, stream, k + 2) - 1);
        other.flux = pow(10.0, -0.4 * (other.mag - sky->simulation->scene.zeropoint));
        all->objects[2 * i] = (*scene)->objects[i];
        all->objects[2 * i + 1] = other;
    }
    rx_scene_free(*scene);
    *scene = all;
    return RX_OK;
}

static rx_status take_objects(const rx_detection_sky *sky, const rx_scene *scene, rx_detection_tile *dst,
                              rx_error *err)
{
    const size_t n = (size_t)scene->n;
    dst->n = scene->n;
    dst->x = RX_NEW(double, n);
    dst->y = RX_NEW(double, n);
    dst->snr = RX_NEW(double, n);
    dst->flux = RX_NEW(double, n);
    dst->radius = RX_NEW(double, n);
    if (!dst->x || !dst->y || !dst->snr || !dst->flux || !dst->radius)
        return rx_error_memory(err, 5 * n * sizeof(double));
    for (long i = 0; i < scene->n; i++) {
        const rx_object *object = &scene->objects[i];
        dst->x[i] = object->x;
        dst->y[i] = object->y;
        dst->snr[i] = rx_detection_snr(sky, object);
        dst->flux[i] = object->flux;
        dst->radius[i] = object->radius * sqrt(object->ratio);
    }
    return RX_OK;
}

static rx_status render(const rx_detection_sky *sky, rx_detection_scene scene, rx_simulated *simulated,
                        rx_detection_tile *dst, rx_error *err)
{
    const rx_simulation *simulation = sky->simulation;
    const size_t n = (size_t)simulated->width * (size_t)simulated->height;
    const rx_optics *const optics[] = {simulation->optics, simulation->target};
    simulated->image = RX_NEW(float, n);
    simulated->defects = RX_NEW(uint8_t, n);
    for (int i = 0; i < 2 && scene == RX_SCENE_OUTSKIRTS; i++)
        if ((dst->truth[i] = RX_NEW(float, n)) == NULL)
            return rx_error_memory(err, n * sizeof(float));
    if (simulated->image == NULL || simulated->defects == NULL)
        return rx_error_memory(err, n * sizeof(float));
    rx_status status = RX_OK;
    if (scene == RX_SCENE_OUTSKIRTS) {
        status = rx_render(simulated->scene, 2, optics, dst->truth, 1, err);
        memcpy(simulated->image, dst->truth[0], n * sizeof(float));
    } else {
        status = rx_render(simulated->scene, 1, optics, &simulated->image, 1, err);
    }
    return status;
}

rx_status rx_detection_expose(const rx_detection_sky *sky, uint64_t seed, uint64_t stream,
                              rx_simulated *simulated, rx_tile **tile, rx_error *err)
{
    rx_noise_params noise = sky->simulation->noise;
    noise.seed = seed;
    noise.stream = stream;
    rx_status status = rx_noise_expose(&noise, simulated->width, simulated->height, simulated->image,
                                       simulated->defects, 1, err);
    if (status == RX_OK) {
        /* world coordinates: not every version of wcslib reads headers in several threads */
#pragma omp critical(rx_campaign_tile)
        status = rx_simulation_tile(sky->simulation, simulated, "simulated", tile, err);
    }
    return status;
}

/* The scene as pixels with sky and noise. */
static rx_status expose(const rx_detection_state *state, const rx_detection_sky *sky,
                        rx_detection_scene scene, uint64_t stream, rx_tile **tile, rx_detection_tile *dst,
                        rx_error *err)
{
    const rx_scene_params par = params_of(state, sky, scene, stream);
    rx_simulated simulated = {.width = par.width, .height = par.height, .noise = sky->simulation->noise};
    rx_status status = rx_scene_make(&par, sky->simulation->templates, &simulated.scene, err);
    if (status == RX_OK && scene == RX_SCENE_PAIRS)
        status = add_companions(state, sky, stream, &simulated.scene, err);
    if (status == RX_OK)
        status = take_objects(sky, simulated.scene, dst, err);
    if (status == RX_OK)
        status = render(sky, scene, &simulated, dst, err);
    if (status == RX_OK)
        status = rx_detection_expose(sky, seed_for(state, DRAW_NOISE), stream, &simulated, tile, err);
    rx_simulated_free(&simulated);
    return status;
}

/* The noise goes, the plateau comes; sky and noise are given as they were. */
static rx_status put_plateau(const rx_detection_state *state, const rx_detection_sky *sky, long number,
                             rx_field *field, rx_error *err)
{
    rx_tile *tile = field->tile;
    const int w = tile->width, h = tile->height, shift = (int)(number % 4);
    const size_t n = (size_t)w * (size_t)h;
    const double level = sky->simulation->noise.sky;
    float *plane = RX_NEW(float, n);
    if (plane == NULL)
        return rx_error_memory(err, n * sizeof *plane);
    for (int y = h / 4 + shift; y < h - h / 4 + shift; y++)
        for (int x = w / 4 + shift; x < w - w / 4 + shift; x++)
            plane[(size_t)y * (size_t)w + (size_t)x] = (float)(state->config->plateau_snr * sky->sigma);
    rx_status status = rx_gauss_masked(w, h, sky->fwhm + EDGE, NULL, 1, plane, err);
    for (size_t i = 0; i < n && status == RX_OK; i++)
        tile->pixels[i] = (float)(level + (double)plane[i]);
    rx_background_flatten(field->plain, level, sky->sigma);
    rx_background_flatten(field->restored, level, sky->sigma);
    free(plane);
    return status;
}

rx_status rx_detection_tile_make(const rx_detection_state *state, int condition, rx_detection_scene scene,
                                 long number, rx_detection_tile *dst, rx_error *err)
{
    const rx_detection_sky *sky = &state->sky[condition];
    const uint64_t stream = (uint64_t)scene << 40 | (uint64_t)number;
    rx_tile *tile = NULL;
    *dst = (rx_detection_tile){0};
    rx_status status = expose(state, sky, scene, stream, &tile, dst, err);
    if (status == RX_OK) {
        status = rx_field_prepare(&state->options->pipeline, RX_FIELD_PSF, tile, sky->told, NULL, &dst->field,
                                  err);
        tile = NULL; /* the field's */
    }
    if (status == RX_OK && scene == RX_SCENE_PLATEAU)
        status = put_plateau(state, sky, number, dst->field, err);
    if (status == RX_OK)
        rx_condition_apply(&state->condition[condition], dst->field);
    rx_tile_free(tile);
    if (status != RX_OK)
        rx_detection_tile_free(dst);
    return status;
}

void rx_detection_tile_free(rx_detection_tile *tile)
{
    rx_field_free(tile->field);
    free(tile->x);
    free(tile->y);
    free(tile->snr);
    free(tile->flux);
    free(tile->radius);
    free(tile->truth[0]);
    free(tile->truth[1]);
    *tile = (rx_detection_tile){0};
}
