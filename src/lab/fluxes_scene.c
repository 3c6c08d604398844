/* Tiles of the campaign of fluxes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "check/replica.h"
#include "io/tile.h"
#include "lab/fluxes.h"
#include "pipeline/domain.h"
#include "pipeline/pipeline.h"
#include "simulate/render.h"
#include "stage/open.h"

/* Least distances and margins inside, in FWHM. */
static const double PAIRS_APART = 8.0, PAIRS_PIXELS = 32.0, STARS_APART = 20.0, SHREDS_APART = 20.0,
                    INSIDE = 6.0;
static const double COMPANION_MAG = 2.0; /* fainter at most */
static const double SHREDS_LARGER = 2.0;
/* Company: see fluxes.h. */
static const double ALONE = 3.0, FAINT = 0.01, WINGS = 2.0, BLEND = 1.5, BLEND_MAG = 2.0;

/* What random numbers are for: their streams never meet. */
enum { DRAW_SCENE = 1, DRAW_NOISE = 2, DRAW_PAIRS = 3, DRAW_MEMBERS = 4 };

static uint64_t seed_for(const rx_fluxes_state *state, uint64_t purpose)
{
    uint32_t words[4];
    rx_random_block((uint64_t)state->config->seed, 0x666c757865, purpose, words);
    return (uint64_t)words[0] << 32 | words[1];
}

const rx_detection_sky *rx_fluxes_sky(const rx_fluxes_state *state, int condition, rx_fluxes_scene scene)
{
    return scene == RX_FLUXES_INJECTED ? &state->ground.sky : &state->sky[condition];
}

/* --- the real tile --- */

static rx_status open_field(rx_fluxes_state *state, rx_log *log, rx_error *err)
{
    const rx_campaign_config *config = state->config;
    int *hdus = NULL, n = 0;
    rx_status status = rx_tile_list(config->tile_name, log, &hdus, &n, err);
    if (status == RX_OK)
        status = rx_field_open(state->options, RX_FIELD_PSF, &(rx_image_place){config->tile_name, hdus[0], 1},
                               log, &state->ground.field, err);
    free(hdus);
    if (status != RX_OK)
        return status;
    rx_tile *tile = state->ground.field->tile;
    if (state->ground.field->psf == NULL)
        return rx_error_at(
            err, RX_INPUT, tile->name, tile->hdu, 0,
            "has too few stars for a PSF of its own; give STAGE.PSF_TYPE and what belongs to it");
    if (tile->zeropoint == 0) /* the stage's default states nothing */
        tile->zeropoint = config->sim->mag_zeropoint;
    return RX_OK;
}

rx_status rx_fluxes_ground_open(rx_fluxes_state *state, rx_log *log, rx_error *err)
{
    rx_simulate_config *own = NULL;
    rx_detection_sky *sky = &state->ground.sky;
    rx_status status = open_field(state, log, err);
    if (status != RX_OK)
        return status;
    const rx_field *field = state->ground.field;
    status = rx_simulate_config_copy(state->config->sim, &own, err);
    if (status == RX_OK)
        status = rx_settings_set(&own->settings, "PSF_TYPE", "AUTO", log, err);
    if (status == RX_OK)
        status = rx_simulation_for_tile(own, state->options, field, log, &sky->simulation, err);
    if (status == RX_OK)
        status = rx_detection_area(field->psf, field->tile->width, field->tile->height, &sky->area, err);
    rx_simulate_config_free(own);
    if (status != RX_OK)
        return status;
    sky->simulation->nthreads = 1;
    sky->simulation->scene.seed = seed_for(state, DRAW_SCENE);
    sky->simulation->noise.seed = seed_for(state, DRAW_NOISE);
    sky->fwhm = field->psf->fwhm;
    sky->sigma = field->plain->global_sigma;
    sky->told = rx_psf_copy(field->psf);
    return sky->told != NULL ? RX_OK : rx_error_memory(err, 0);
}

rx_status rx_fluxes_ground_search(rx_fluxes_state *state, rx_log *log, rx_error *err)
{
    rx_status status = rx_domain_noise(state->ground.field, &state->ground.model_noise, err);
    for (int r = 0; r < state->nruns && status == RX_OK; r++) {
        rx_options options = rx_fluxes_options(state, &state->ground.sky, state->run[r]);
        rx_result result;
        options.pipeline.nthreads = options.pipeline.restore.nthreads = options.pipeline.measure.nthreads =
            options.pipeline.templates.par.nthreads = state->nthreads;
        status =
            rx_field_extract(&options.pipeline, state->run[r], state->ground.field, NULL, log, &result, err);
        if (status != RX_OK)
            break;
        rx_sources_free(state->ground.before[r]);
        state->ground.before[r] = result.sources;
        result.sources = NULL;
        rx_result_free(&result);
    }
    return status;
}

void rx_fluxes_ground_close(rx_fluxes_ground *ground)
{
    for (int r = 0; r < RX_FLUXES_RUNS; r++)
        rx_sources_free(ground->before[r]);
    rx_detection_sky_close(&ground->sky);
    rx_field_free(ground->field);
    *ground = (rx_fluxes_ground){0};
}

/* --- what is on a tile --- */

static double star_share(const rx_scene_params *par)
{
    const double all = par->stars.count + par->galaxies.count;
    return all > 0 ? par->stars.count / all : 1;
}

static rx_scene_params params_of(const rx_fluxes_state *state, const rx_detection_sky *sky,
                                 rx_fluxes_scene scene, uint64_t stream)
{
    static const rx_population none = {0};
    const rx_campaign_config *config = state->config;
    rx_scene_params par = sky->simulation->scene;
    double apart = 0;
    const double stars = star_share(&par);
    par.seed = seed_for(state, DRAW_SCENE);
    par.stream = stream;
    if (scene == RX_FLUXES_FIELD)
        return par;
    par.pair_share = par.clustering = 0;
    par.margin = -fmin(INSIDE * sky->fwhm, fmin(par.width, par.height) / 4);
    par.stars = par.galaxies = par.templates = none;
    if (scene == RX_FLUXES_PAIRS) {
        apart = fmax(PAIRS_APART, PAIRS_PIXELS / sky->fwhm);
        par.stars = par.galaxies = rx_detection_sparse(sky, &config->pair_snr, apart);
        par.stars.count *= stars;
        par.galaxies.count *= 1 - stars;
    } else if (scene == RX_FLUXES_RINGS) {
        par.stars = rx_detection_sparse(sky, &config->ring_snr, apart = STARS_APART);
    } else if (scene == RX_FLUXES_SHREDS) {
        par.galaxies = rx_detection_sparse(sky, &config->shred_snr, apart = SHREDS_APART);
        par.galaxy_scale *= SHREDS_LARGER;
        par.galaxy_kind = RX_GALAXY_MIXED;
    }
    par.least_distance = apart * sky->fwhm;
    return par;
}

/* A companion of the population's kinds, of the magnitude range of the first members. */
static rx_status draw_members(const rx_fluxes_state *state, const rx_detection_sky *sky, uint64_t stream,
                              rx_scene **dst, rx_error *err)
{
    rx_scene_params par = params_of(state, sky, RX_FLUXES_PAIRS, stream);
    par.seed = seed_for(state, DRAW_MEMBERS);
    par.least_distance = 0;
    return rx_scene_make(&par, sky->simulation->templates, dst, err);
}

/* Every object gets a companion, right after it in the list. */
static rx_status add_companions(const rx_fluxes_state *state, const rx_detection_sky *sky, uint64_t stream,
                                rx_scene **scene, rx_error *err)
{
    const uint64_t seed = seed_for(state, DRAW_PAIRS);
    const double *distance = state->config->sim->pair_distance.v;
    rx_scene *all = NULL, *members = NULL;
    rx_status status = rx_scene_new((*scene)->width, (*scene)->height, 2 * (*scene)->n, &all, err);
    if (status == RX_OK)
        status = draw_members(state, sky, stream, &members, err);
    for (long i = 0; status == RX_OK && i < (*scene)->n; i++) {
        const uint64_t k = 4 * (uint64_t)i;
        const rx_object *first = &(*scene)->objects[i];
        const double angle = 2 * M_PI * rx_random_uniform(seed, stream, k);
        const double apart =
            sky->fwhm * (distance[0] + (distance[1] - distance[0]) * rx_random_uniform(seed, stream, k + 1));
        const long which = (long)(rx_random_uniform(seed, stream, k + 3) * (double)members->n);
        rx_object other = members->n > 0 ? members->objects[which] : *first;
        other.x = first->x + apart * cos(angle);
        other.y = first->y + apart * sin(angle);
        other.mag = first->mag + COMPANION_MAG * rx_random_uniform(seed, stream, k + 2);
        other.flux = pow(10.0, -0.4 * (other.mag - sky->simulation->scene.zeropoint));
        all->objects[2 * i] = *first;
        all->objects[2 * i + 1] = other;
    }
    rx_scene_free(members);
    if (status != RX_OK) {
        rx_scene_free(all);
        return status;
    }
    all->templates = (*scene)->templates;
    rx_scene_free(*scene);
    *scene = all;
    return RX_OK;
}

/* Error of a matched filter's flux over the flux: 1 / sum P^2 / (sigma^2 + F P / gain), squared. */
static double bound_of(const float *stamp, size_t n, double flux, double sigma, double gain)
{
    double weight = 0;
    for (size_t i = 0; i < n; i++) {
        const double p = (double)stamp[i];
        weight += p * p / (sigma * sigma + (gain > 0 ? fmax(flux * p, 0) / gain : 0));
    }
    return 1 / (sqrt(weight) * flux);
}

static rx_status take_objects(const rx_detection_sky *sky, const rx_psf *psf, double gain,
                              const rx_scene *scene, rx_fluxes_tile *dst, rx_error *err)
{
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    float *stamp = RX_NEW(float, n);
    dst->n = scene->n;
    dst->object = RX_NEW(rx_fluxes_object, (size_t)scene->n);
    if (stamp == NULL || dst->object == NULL) {
        free(stamp);
        return rx_error_memory(err, n * sizeof *stamp + (size_t)scene->n * sizeof *dst->object);
    }
    for (long i = 0; i < scene->n; i++) {
        const rx_object *o = &scene->objects[i];
        rx_psf_at(psf, o->x, o->y, stamp);
        dst->object[i] = (rx_fluxes_object){.x = o->x,
                                            .y = o->y,
                                            .flux = o->flux,
                                            .radius = o->radius * sqrt(o->ratio),
                                            .snr = rx_detection_snr(sky, o),
                                            .bound = bound_of(stamp, n, o->flux, sky->sigma, gain),
                                            .galaxy = o->type != RX_OBJECT_STAR,
                                            .partner = -1};
    }
    free(stamp);
    return RX_OK;
}

static int keeps_company(const rx_fluxes_object *a, double x, double y, double flux, double radius,
                         double fwhm)
{
    const double more = fmax(log10(flux / a->flux), 0);
    return flux > FAINT * a->flux &&
           hypot(x - a->x, y - a->y) < (ALONE + more) * fwhm + WINGS * (a->radius + radius);
}

void rx_fluxes_company(long n, rx_fluxes_object *object, long nothers, const double (*others)[3], double fwhm)
{
    const double most = pow(10, 0.4 * BLEND_MAG);
    for (long i = 0; i < n; i++) {
        rx_fluxes_object *a = &object[i];
        double nearest = BLEND * fwhm;
        int alone = 1;
        a->partner = -1;
        for (long k = 0; k < n; k++) {
            const rx_fluxes_object *b = &object[k];
            const double d = hypot(a->x - b->x, a->y - b->y), f = b->flux / a->flux;
            if (k == i)
                continue;
            alone = alone && !keeps_company(a, b->x, b->y, b->flux, b->radius, fwhm);
            if (d < nearest && f <= most && f >= 1 / most) {
                nearest = d;
                a->partner = k;
            }
        }
        for (long k = 0; k < nothers; k++)
            alone = alone && !keeps_company(a, others[k][0], others[k][1], others[k][2], 0, fwhm);
        a->company = a->partner >= 0 ? RX_BLENDED : alone ? RX_ISOLATED : RX_NEITHER;
    }
}

/* Sources of the untouched tile, of the first restorer. */
static rx_status find_company(const rx_fluxes_state *state, const rx_detection_sky *sky, int injected,
                              rx_fluxes_tile *tile, rx_error *err)
{
    const rx_sources *before = injected ? state->ground.before[0] : NULL;
    const long n = before != NULL ? before->n : 0;
    double(*others)[3] = rx_alloc((size_t)n, sizeof *others);
    if (others == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *others);
    for (long i = 0; i < n; i++) {
        others[i][0] = before->list[i].x;
        others[i][1] = before->list[i].y;
        others[i][2] = fmax(before->list[i].flux_auto, 0);
    }
    rx_fluxes_company(tile->n, tile->object, n, (const double(*)[3])others, sky->fwhm);
    free(others);
    return RX_OK;
}

/* --- pixels --- */

static rx_status expose(const rx_fluxes_state *state, const rx_detection_sky *sky, rx_fluxes_scene scene,
                        uint64_t stream, rx_tile **tile, rx_fluxes_tile *dst, rx_error *err)
{
    const rx_scene_params par = params_of(state, sky, scene, stream);
    const rx_optics *optics = sky->simulation->optics;
    const rx_noise_params *noise = &sky->simulation->noise;
    const double gain = noise->type == RX_NOISE_CCD ? noise->gain : 0; /* GAUSS has no photon noise */
    const size_t n = (size_t)par.width * (size_t)par.height;
    rx_simulated simulated = {.width = par.width, .height = par.height, .noise = sky->simulation->noise};
    rx_psf *psf = NULL;
    simulated.image = RX_NEW(float, n);
    simulated.defects = RX_NEW(uint8_t, n);
    rx_status status = simulated.image == NULL || simulated.defects == NULL
                           ? rx_error_memory(err, n * sizeof(float))
                           : rx_scene_make(&par, sky->simulation->templates, &simulated.scene, err);
    if (status == RX_OK && scene == RX_FLUXES_PAIRS)
        status = add_companions(state, sky, stream, &simulated.scene, err);
    if (status == RX_OK)
        status = rx_optics_on_pixels(optics, &psf, err);
    if (status == RX_OK)
        status = take_objects(sky, psf, gain, simulated.scene, dst, err);
    if (status == RX_OK)
        status = rx_render(simulated.scene, 1, &optics, &simulated.image, 1, err);
    if (status == RX_OK)
        status = rx_detection_expose(sky, seed_for(state, DRAW_NOISE), stream, &simulated, tile, err);
    rx_psf_free(psf);
    rx_simulated_free(&simulated);
    return status;
}

static rx_status inject(const rx_fluxes_state *state, uint64_t stream, rx_tile **tile, rx_fluxes_tile *dst,
                        rx_error *err)
{
    const rx_detection_sky *sky = &state->ground.sky;
    const rx_tile *src = state->ground.field->tile;
    const size_t n = (size_t)src->width * (size_t)src->height;
    rx_scene *scene = NULL;
    rx_status status = rx_replica_new(src, NULL, tile, err);
    if (status == RX_OK)
        status = rx_simulation_inject(sky->simulation, stream, (*tile)->pixels, NULL, &scene, err);
    if (status == RX_OK)
        status = take_objects(sky, sky->told, sky->simulation->noise.gain, scene, dst, err);
    rx_scene_free(scene);
    if (status != RX_OK)
        return status;
    rx_replica_settle(*tile);
    dst->light = RX_NEW(float, n);
    if (dst->light == NULL)
        return rx_error_memory(err, n * sizeof(float));
    for (size_t i = 0; i < n; i++)
        dst->light[i] = (*tile)->pixels[i] - src->pixels[i];
    return RX_OK;
}

rx_status rx_fluxes_tile_make(const rx_fluxes_state *state, int condition, rx_fluxes_scene scene, long number,
                              rx_fluxes_tile *dst, rx_error *err)
{
    const rx_detection_sky *sky = rx_fluxes_sky(state, condition, scene);
    const uint64_t stream = (uint64_t)scene << 40 | (uint64_t)number;
    const int injected = scene == RX_FLUXES_INJECTED;
    rx_tile *tile = NULL;
    *dst = (rx_fluxes_tile){0};
    rx_status status = injected ? inject(state, stream, &tile, dst, err)
                                : expose(state, sky, scene, stream, &tile, dst, err);
    if (status == RX_OK) {
        status = rx_field_prepare(&state->options->pipeline, RX_FIELD_PSF, tile, sky->told, NULL, &dst->field,
                                  err);
        tile = NULL; /* the field's */
    }
    if (status == RX_OK && injected) {
        dst->field->model_noise = state->ground.model_noise;
        dst->field->model_factor = state->ground.field->noise_factor;
    }
    if (status == RX_OK)
        status = find_company(state, sky, injected, dst, err);
    for (long i = 0; status == RX_OK && scene == RX_FLUXES_PAIRS && i < dst->n; i++)
        dst->object[i].partner = i ^ 1;
    if (status == RX_OK && !injected)
        rx_condition_apply(&state->condition[condition], dst->field);
    rx_tile_free(tile);
    if (status != RX_OK)
        rx_fluxes_tile_free(dst);
    return status;
}

void rx_fluxes_tile_free(rx_fluxes_tile *tile)
{
    rx_field_free(tile->field);
    free(tile->light);
    free(tile->object);
    *tile = (rx_fluxes_tile){0};
}
