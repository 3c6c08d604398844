/* Tiles of the campaign DETECTION: what is on them (SCENES below), and their pixels. Populations are those of the SIM.
 * keywords; ..._SNR are drawn as those of a star of the flux, uniform in magnitude, so many FWHM apart:
 *
 *   PAIRS      8; the first member of PAIR_SNR, the other one at a separation uniform in SIM.PAIR_DISTANCE (FWHM), at most
 *              0.5 mag brighter or fainter
 *   RINGS      20, RING_SNR           OUTSKIRTS  12, S/N 5 to 80
 *   PLATEAU    a square of half the tile's side, 200 sigmas bright, its edges smoothed by a Gaussian of FWHM 8
 *              pixels more than the PSF; shifted by a pixel from tile to tile */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "lab/lab.h"
#include "num/convolve.h"
#include "pipeline/pipeline.h"
#include "simulate/render.h"

/* Least distances and margins inside, in FWHM. */
static const double PAIRS_APART = 8.0, APART = 20.0, OUTSKIRTS_APART = 12.0, INSIDE = 6.0;
static const double ALIKE_MAG = 0.5;                    /* of companions, at most */
static const double EDGE = 8.0, PLATEAU_SIGMAS = 200.0; /* pixels; of the sky, a pixel */
static const double OUTSKIRTS_SNR[2] = {5.0, 80.0};

/* What random numbers are for. */
enum { DRAW_SCENE = 1, DRAW_NOISE = 2, DRAW_PAIRS = 3 };

static const struct {
    const char *name, *about;
} SCENES[RX_SCENE_IDS] = {
    [RX_SCENE_STARS] =
        {"STARS", "Stars alone, all that the population puts on a tile, blends and all. A detection that is "
                  "no star of the least S/N, nor a fainter one, is false."},
    [RX_SCENE_GALAXIES] = {"GALAXIES",
                           "Galaxies alone. A galaxy in two pieces is one right and one false detection."},
    [RX_SCENE_PAIRS] =
        {"PAIRS", "Close pairs of stars: resolved when there are two detections, each nearer than half the "
                  "separation to its star, both above the threshold."},
    [RX_SCENE_BLANK] = {"BLANK", "Noise without any object: all that is found is invented."},
    [RX_SCENE_RINGS] = {"RINGS", "Bright stars and nothing else: what is found around them is invented."},
    [RX_SCENE_PLATEAU] =
        {"PLATEAU", "A bright, flat square without noise: what a restorer adds to it that repeats every "
                    "second or fourth pixel."},
    [RX_SCENE_OUTSKIRTS] =
        {"OUTSKIRTS", "Faint galaxies: flux in round apertures at their true place on the restored pixels, "
                      "over what the same scene without noise has there (restored images: at the "
                      "target PSF). Below 1 flux was lost."},
};

const char *rx_scene_name(rx_scene_id id)
{
    return SCENES[id].name;
}

const char *rx_scene_about(rx_scene_id id)
{
    return SCENES[id].about;
}

int rx_scene_is_list(rx_scene_id id)
{
    return id == RX_SCENE_STARS || id == RX_SCENE_GALAXIES || id == RX_SCENE_MAGNITUDE;
}

/* --- what is on a tile --- */

/* As many objects of that S/N (a star's; from, to) as find a place so far apart (FWHM). */
static rx_population sparse(const rx_lab_sky *sky, const double *snr, double apart)
{
    const double step = 1.3 * apart * sky->fwhm;
    return (rx_population){.count = fmax(floor((double)sky->width * sky->height / (step * step)), 1),
                           .mag_low = rx_lab_mag(sky, snr[1]),
                           .mag_high = rx_lab_mag(sky, snr[0])};
}

static rx_scene_params params_of(const rx_lab *lab, const rx_lab_sky *sky, rx_scene_id id, uint64_t stream)
{
    static const rx_population none = {0};
    const rx_campaign_config *config = lab->config;
    rx_scene_params par = sky->simulation->scene;
    double apart = 0;
    par.seed = rx_lab_seed(lab, DRAW_SCENE);
    par.stream = stream;
    if (id != RX_SCENE_STARS)
        par.stars = none;
    if (id != RX_SCENE_GALAXIES)
        par.galaxies = par.templates = none;
    if (rx_scene_is_list(id))
        return par;
    par.pair_share = par.clustering = 0;
    par.margin = -fmin(INSIDE * sky->fwhm, fmin(par.width, par.height) / 4);
    if (id == RX_SCENE_PAIRS) {
        par.stars = sparse(sky, config->pair_snr.v, apart = PAIRS_APART);
    } else if (id == RX_SCENE_RINGS) {
        par.stars = sparse(sky, config->ring_snr.v, apart = APART);
    } else if (id == RX_SCENE_OUTSKIRTS) {
        par.galaxies = sparse(sky, OUTSKIRTS_SNR, apart = OUTSKIRTS_APART);
    }
    par.least_distance = apart * sky->fwhm;
    return par;
}

/* Every object gets a companion, right after it in the list. */
static rx_status add_companions(const rx_lab *lab, const rx_lab_sky *sky, uint64_t stream, rx_scene **scene,
                                rx_error *err)
{
    const uint64_t seed = rx_lab_seed(lab, DRAW_PAIRS);
    const double *distance = lab->config->sim->pair_distance.v;
    rx_scene *all = NULL;
    RX_TRY(rx_scene_new((*scene)->width, (*scene)->height, 2 * (*scene)->n, &all, err));
    for (long i = 0; i < (*scene)->n; i++) {
        const uint64_t k = 4 * (uint64_t)i;
        const rx_object *first = &(*scene)->objects[i];
        const double angle = 2 * M_PI * rx_random_uniform(seed, stream, k);
        const double apart =
            sky->fwhm * (distance[0] + (distance[1] - distance[0]) * rx_random_uniform(seed, stream, k + 1));
        rx_object other = *first;
        other.x = first->x + apart * cos(angle);
        other.y = first->y + apart * sin(angle);
        other.mag = first->mag + ALIKE_MAG * (2 * rx_random_uniform(seed, stream, k + 2) - 1);
        other.flux = pow(10.0, -0.4 * (other.mag - sky->simulation->scene.zeropoint));
        all->objects[2 * i] = *first;
        all->objects[2 * i + 1] = other;
    }
    all->templates = (*scene)->templates;
    rx_scene_free(*scene);
    *scene = all;
    return RX_OK;
}

/* Objects of TRUTH_SNR and more that lie inside are to be found; bright stars always are. Of an object beyond the border
 * the light that comes in, most of it where the border is nearest, is no false source. */
static rx_status take_objects(const rx_lab *lab, const rx_lab_sky *sky, rx_scene_id id, const rx_scene *scene,
                              rx_lab_objects *dst, rx_error *err)
{
    *dst = (rx_lab_objects){.n = scene->n};
    RX_TRY(RX_MAKE(dst->list, (size_t)scene->n, err));
    for (long i = 0; i < scene->n; i++) {
        const rx_object *o = &scene->objects[i];
        const double beyond = rx_lab_beyond(sky, o->x, o->y), snr = rx_lab_snr(sky, o),
                     radius = o->radius * sqrt(o->ratio);
        const int listed =
            id == RX_SCENE_RINGS || (rx_scene_is_list(id) && snr >= lab->truth_snr && !(beyond > 0));
        dst->list[i] = (rx_lab_object){.x = o->x,
                                       .y = o->y,
                                       .flux = o->flux,
                                       .radius = radius,
                                       .snr = snr,
                                       .reach = beyond > 0 ? beyond + sky->fwhm + radius : 0,
                                       .role = listed ? RX_LISTED : RX_OTHER};
    }
    return RX_OK;
}

/* --- pixels --- */

rx_status rx_lab_expose(const rx_lab_sky *sky, uint64_t seed, uint64_t stream, rx_scene *scene,
                        float *const truth[2], rx_tile **tile, rx_error *err)
{
    const rx_optics *const optics[] = {sky->simulation->optics, sky->simulation->target};
    const size_t n = (size_t)scene->width * (size_t)scene->height;
    rx_simulated simulated = {.width = scene->width, .height = scene->height, .scene = scene};
    rx_noise_params noise = sky->simulation->noise;
    simulated.noise = noise;
    simulated.image = RX_NEW(float, n);
    simulated.defects = RX_NEW(uint8_t, n);
    noise.seed = seed;
    noise.stream = stream;
    rx_status status = simulated.image == NULL || simulated.defects == NULL
                           ? rx_error_memory(err, n * sizeof(float))
                           : rx_render(scene, truth != NULL ? 2 : 1, optics,
                                       truth != NULL ? truth : &simulated.image, 1, err);
    if (status == RX_OK && truth != NULL)
        memcpy(simulated.image, truth[0], n * sizeof(float));
    if (status == RX_OK)
        status = rx_noise_expose(&noise, simulated.width, simulated.height, simulated.image,
                                 simulated.defects, 1, err);
    if (status == RX_OK) {
        /* world coordinates: not every version of wcslib reads headers in several threads */
#pragma omp critical(rx_campaign_tile)
        status = rx_simulation_tile(sky->simulation, &simulated, "simulated", tile, err);
    }
    rx_simulated_free(&simulated);
    return status;
}

/* The scene as pixels with sky and noise. */
static rx_status simulate(const rx_lab *lab, const rx_lab_sky *sky, rx_scene_id id, uint64_t stream,
                          rx_tile **tile, rx_lab_tile *dst, rx_error *err)
{
    const rx_scene_params par = params_of(lab, sky, id, stream);
    const int outskirts = id == RX_SCENE_OUTSKIRTS;
    rx_scene *scene = NULL;
    RX_TRY(rx_scene_make(&par, sky->simulation->templates, &scene, err));
    rx_status status = id == RX_SCENE_PAIRS ? add_companions(lab, sky, stream, &scene, err) : RX_OK;
    if (status == RX_OK)
        status = take_objects(lab, sky, id, scene, &dst->objects, err);
    for (int i = 0; i < 2 && status == RX_OK && outskirts; i++)
        if ((dst->truth[i] = RX_NEW(float, (size_t)par.width *(size_t)par.height)) == NULL)
            status = rx_error_memory(err, (size_t)par.width * (size_t)par.height * sizeof(float));
    if (status == RX_OK)
        return rx_lab_expose(sky, rx_lab_seed(lab, DRAW_NOISE), stream, scene, outskirts ? dst->truth : NULL,
                             tile, err);
    rx_scene_free(scene);
    return status;
}

/* The noise goes, the plateau comes; sky and noise are given as they were. */
static rx_status put_plateau(const rx_lab_sky *sky, long number, rx_field *field, rx_error *err)
{
    rx_tile *tile = field->tile;
    const int w = tile->width, h = tile->height, shift = (int)(number % 4);
    const size_t n = (size_t)w * (size_t)h;
    const double level = sky->simulation->noise.sky;
    float *plane = NULL;
    RX_TRY(RX_MAKE(plane, n, err));
    for (int y = h / 4 + shift; y < h - h / 4 + shift; y++)
        for (int x = w / 4 + shift; x < w - w / 4 + shift; x++)
            plane[(size_t)y * (size_t)w + (size_t)x] = (float)(PLATEAU_SIGMAS * sky->sigma);
    rx_status status = rx_gauss_masked(w, h, sky->fwhm + EDGE, NULL, 1, plane, err);
    for (size_t i = 0; i < n && status == RX_OK; i++)
        tile->pixels[i] = (float)(level + (double)plane[i]);
    rx_background_flatten(field->plain, level, sky->sigma);
    rx_background_flatten(field->restored, level, sky->sigma);
    free(plane);
    return status;
}

rx_status rx_lab_tile_make(const rx_lab *lab, const rx_lab_unit *unit, rx_lab_tile *dst, rx_error *err)
{
    const rx_lab_sky *sky = &lab->sky[unit->condition];
    const rx_scene_id id = lab->scene[unit->scene].id;
    const uint64_t stream = (uint64_t)lab->scene[unit->scene].number << 40 | (uint64_t)unit->number;
    rx_tile *tile = NULL;
    rx_status status;
    *dst = (rx_lab_tile){0};
    RX_TRY_EXIT(simulate(lab, sky, id, stream, &tile, dst, err));
    status =
        rx_field_prepare(&lab->options->pipeline, RX_FIELD_PSF, tile, sky->given, NULL, &dst->field, err);
    tile = NULL; /* the field's */
    RX_TRY_EXIT(status);
    if (id == RX_SCENE_PLATEAU)
        RX_TRY_EXIT(put_plateau(sky, unit->number, dst->field, err));
    rx_condition_apply(&sky->condition, dst->field);
exit:
    rx_tile_free(tile);
    if (status != RX_OK)
        rx_lab_tile_free(dst);
    return status;
}

void rx_lab_tile_free(rx_lab_tile *tile)
{
    rx_field_free(tile->field);
    rx_field_free(tile->blank);
    free(tile->objects.list);
    free(tile->truth[0]);
    free(tile->truth[1]);
    *tile = (rx_lab_tile){0};
}
