/* Tiles of the campaigns DETECTION and FLUXES: what is on them (SCENES below), and their pixels. Populations are those of
 * the SIM. keywords; ..._SNR are drawn as those of a star of the flux, uniform in magnitude, so many FWHM apart:
 *
 *   PAIRS      8; the first member of PAIR_SNR, the other one at a separation uniform in SIM.PAIR_DISTANCE (FWHM).
 *              DETECTION: stars, the other one at most 0.5 mag brighter or fainter. FLUXES: 0 to 2 mag fainter, the pairs
 *              also 32 pixels apart; members are stars in the proportion of SIM.STAR_COUNT to SIM.GALAXY_COUNT, galaxies
 *              have the shapes and sizes of the population
 *   RINGS      20, RING_SNR           OUTSKIRTS  12, S/N 5 to 80
 *   SHREDS     20, SHRED_SNR, twice as large as the population's, 60 % of them with disks with arms and a third of these
 *              with bars
 *   PLATEAU    a square of half the tile's side, 200 sigmas bright, its edges smoothed by a Gaussian of FWHM 8
 *              pixels more than the PSF; shifted by a pixel from tile to tile
 *   INJECTED   on TILE_NAME, with its PSF (STAGE. keywords) and the photon noise of its gain; what was there by the rule of
 *              check/selfcheck.h is neither right nor wrong */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "check/replica.h"
#include "lab/lab.h"
#include "num/convolve.h"
#include "pipeline/pipeline.h"
#include "simulate/render.h"

/* Least distances and margins inside, in FWHM, and of mixed pairs in pixels. */
static const double PAIRS_APART = 8.0, PAIRS_PIXELS = 32.0, APART = 20.0, OUTSKIRTS_APART = 12.0,
                    INSIDE = 6.0;
static const double ALIKE_MAG = 0.5, FAINTER_MAG = 2.0; /* of companions, at most */
static const double SHREDS_LARGER = 2.0;
static const double EDGE = 8.0, PLATEAU_SIGMAS = 200.0; /* pixels; of the sky, a pixel */
static const double OUTSKIRTS_SNR[2] = {5.0, 80.0};
/* Company: see fluxes.h. */
static const double ALONE = 3.0, FAINT = 0.01, WINGS = 2.0, BLEND = 1.5, BLEND_MAG = 2.0;

/* What random numbers are for. */
enum { DRAW_SCENE = 1, DRAW_NOISE = 2, DRAW_PAIRS = 3, DRAW_MEMBERS = 4 };

static const struct {
    const char *name, *about;
} SCENES[RX_SCENE_IDS] = {
    [RX_SCENE_STARS] =
        {"STARS", "Stars alone, all that the population puts on a tile, blends and all. A detection that is "
                  "no star of the least S/N, nor a fainter one, is false."},
    [RX_SCENE_GALAXIES] = {"GALAXIES",
                           "Galaxies alone. A galaxy in two pieces is one right and one false detection."},
    [RX_SCENE_FIELD] = {"FIELD", "Stars and galaxies, all that the population puts on a tile."},
    [RX_SCENE_PAIRS] =
        {"PAIRS", "Close pairs of stars: resolved when there are two detections, each nearer than half the "
                  "separation to its star, both above the threshold."},
    [RX_SCENE_MIXED_PAIRS] = {"PAIRS",
                              "Pairs of stars or galaxies, up to 2 mag different, far from other pairs."},
    [RX_SCENE_BLANK] = {"BLANK", "Noise without any object: all that is found is invented."},
    [RX_SCENE_RINGS] = {"RINGS", "Bright stars and nothing else: what is found around them is invented."},
    [RX_SCENE_PLATEAU] =
        {"PLATEAU", "A bright, flat square without noise: what a restorer adds to it that repeats every "
                    "second or fourth pixel."},
    [RX_SCENE_OUTSKIRTS] =
        {"OUTSKIRTS", "Faint galaxies: flux in round apertures at their true place on the restored pixels, "
                      "over what the same scene without noise has there (restored images: at the "
                      "target PSF). Below 1 flux was lost."},
    [RX_SCENE_SHREDS] =
        {"SHREDS", "Bright, large galaxies and nothing else: the detection nearest to the middle is the "
                   "galaxy, all other pieces are invented."},
    [RX_SCENE_INJECTED] =
        {"INJECTED", "Stars and galaxies added to a real tile. What is on it already is neither right nor "
                     "wrong; its unresolved and undetected objects are part of the errors."},
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
    const double all = par.stars.count + par.galaxies.count, stars = all > 0 ? par.stars.count / all : 1;
    double apart = 0;
    par.seed = rx_lab_seed(lab, DRAW_SCENE);
    par.stream = stream;
    if (id == RX_SCENE_FIELD)
        return par;
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
    } else if (id == RX_SCENE_MIXED_PAIRS) {
        apart = fmax(PAIRS_APART, PAIRS_PIXELS / sky->fwhm);
        par.stars = par.galaxies = sparse(sky, config->pair_snr.v, apart);
        par.stars.count *= stars;
        par.galaxies.count *= 1 - stars;
    } else if (id == RX_SCENE_RINGS) {
        par.stars = sparse(sky, config->ring_snr.v, apart = APART);
    } else if (id == RX_SCENE_OUTSKIRTS) {
        par.galaxies = sparse(sky, OUTSKIRTS_SNR, apart = OUTSKIRTS_APART);
    } else if (id == RX_SCENE_SHREDS) {
        par.galaxies = sparse(sky, config->shred_snr.v, apart = APART);
        par.galaxy_scale *= SHREDS_LARGER;
        par.galaxy_kind = RX_GALAXY_MIXED;
    }
    par.least_distance = apart * sky->fwhm;
    return par;
}

/* Every object gets a companion, right after it in the list; of mixed pairs one of the population's kinds, drawn apart. */
static rx_status add_companions(const rx_lab *lab, const rx_lab_sky *sky, rx_scene_id id, uint64_t stream,
                                rx_scene **scene, rx_error *err)
{
    const int mixed = id == RX_SCENE_MIXED_PAIRS;
    const uint64_t seed = rx_lab_seed(lab, DRAW_PAIRS);
    const double *distance = lab->config->sim->pair_distance.v;
    rx_scene *all = NULL, *members = NULL;
    rx_status status = rx_scene_new((*scene)->width, (*scene)->height, 2 * (*scene)->n, &all, err);
    if (status == RX_OK && mixed) {
        rx_scene_params par = params_of(lab, sky, id, stream);
        par.seed = rx_lab_seed(lab, DRAW_MEMBERS);
        par.least_distance = 0;
        status = rx_scene_make(&par, sky->simulation->templates, &members, err);
    }
    for (long i = 0; status == RX_OK && i < (*scene)->n; i++) {
        const uint64_t k = 4 * (uint64_t)i;
        const rx_object *first = &(*scene)->objects[i];
        const double angle = 2 * M_PI * rx_random_uniform(seed, stream, k);
        const double apart =
            sky->fwhm * (distance[0] + (distance[1] - distance[0]) * rx_random_uniform(seed, stream, k + 1));
        const double u = rx_random_uniform(seed, stream, k + 2);
        rx_object other = *first;
        if (mixed && members->n > 0)
            other = members->objects[(long)(rx_random_uniform(seed, stream, k + 3) * (double)members->n)];
        other.x = first->x + apart * cos(angle);
        other.y = first->y + apart * sin(angle);
        other.mag = first->mag + (mixed ? FAINTER_MAG * u : ALIKE_MAG * (2 * u - 1));
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

/* Objects of TRUTH_SNR and more that lie inside are to be found; bright stars always are. */
static rx_truth_role role_of(const rx_lab *lab, const rx_lab_sky *sky, rx_scene_id id, const rx_lab_object *o)
{
    if (!lab->kind->fluxes && id == RX_SCENE_RINGS)
        return RX_LISTED;
    return (lab->kind->fluxes || rx_scene_is_list(id)) && o->snr >= lab->truth_snr &&
                   !(rx_lab_beyond(sky, o->x, o->y) > 0)
               ? RX_LISTED
               : RX_OTHER;
}

/* Of an object beyond the border the light that comes in, most of it where the border is nearest, is no invention. */
static double reach_of(const rx_lab_sky *sky, const rx_lab_object *o)
{
    const double beyond = rx_lab_beyond(sky, o->x, o->y);
    return beyond > 0 ? beyond + sky->fwhm + o->radius : 0;
}

static rx_status take_objects(const rx_lab *lab, const rx_lab_sky *sky, rx_scene_id id, double gain,
                              const rx_scene *scene, rx_lab_objects *dst, rx_error *err)
{
    const size_t n = (size_t)sky->psf->size * (size_t)sky->psf->size;
    float *stamp = RX_NEW(float, n);
    *dst = (rx_lab_objects){.n = scene->n, .list = RX_NEW(rx_lab_object, (size_t)scene->n)};
    rx_status status = stamp != NULL && dst->list != NULL
                           ? RX_OK
                           : rx_error_memory(err, n * sizeof *stamp + (size_t)scene->n * sizeof *dst->list);
    for (long i = 0; status == RX_OK && i < scene->n; i++) {
        const rx_object *o = &scene->objects[i];
        rx_lab_object *one = &dst->list[i];
        *one = (rx_lab_object){.x = o->x,
                               .y = o->y,
                               .flux = o->flux,
                               .radius = o->radius * sqrt(o->ratio),
                               .snr = rx_lab_snr(sky, o),
                               .galaxy = o->type != RX_OBJECT_STAR,
                               .partner = -1};
        one->role = role_of(lab, sky, id, one);
        one->reach = reach_of(sky, one);
        if (!lab->kind->fluxes)
            continue;
        rx_psf_at(sky->psf, o->x, o->y, stamp);
        one->bound = bound_of(stamp, n, o->flux, sky->sigma, gain);
    }
    free(stamp);
    return status;
}

/* --- company --- */

static int keeps_company(const rx_lab_object *a, double x, double y, double flux, double radius, double fwhm)
{
    const double more = fmax(log10(flux / a->flux), 0);
    return flux > FAINT * a->flux &&
           hypot(x - a->x, y - a->y) < (ALONE + more) * fwhm + WINGS * (a->radius + radius);
}

void rx_lab_company(rx_lab_objects *objects, long nothers, const double (*others)[3], double fwhm)
{
    const double most = pow(10, 0.4 * BLEND_MAG);
    for (long i = 0; i < objects->n; i++) {
        rx_lab_object *a = &objects->list[i];
        double nearest = BLEND * fwhm;
        int alone = 1;
        a->partner = -1;
        for (long k = 0; k < objects->n; k++) {
            const rx_lab_object *b = &objects->list[k];
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

/* Beside the objects the sources of the untouched tile, as the first restorer finds them. */
static rx_status find_company(const rx_lab_sky *sky, rx_lab_objects *objects, rx_error *err)
{
    const rx_sources *before = sky->before[0];
    const long n = before != NULL ? before->n : 0;
    double(*others)[3] = rx_alloc((size_t)n, sizeof *others);
    if (others == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *others);
    for (long i = 0; i < n; i++) {
        others[i][0] = before->list[i].x;
        others[i][1] = before->list[i].y;
        others[i][2] = fmax(before->list[i].flux_auto, 0);
    }
    rx_lab_company(objects, n, (const double(*)[3])others, sky->fwhm);
    free(others);
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
    const rx_noise_params *noise = &sky->simulation->noise;
    const int outskirts = id == RX_SCENE_OUTSKIRTS;
    rx_scene *scene = NULL;
    RX_TRY(rx_scene_make(&par, sky->simulation->templates, &scene, err));
    rx_status status = id == RX_SCENE_PAIRS || id == RX_SCENE_MIXED_PAIRS
                           ? add_companions(lab, sky, id, stream, &scene, err)
                           : RX_OK;
    if (status == RX_OK)
        status = take_objects(lab, sky, id, noise->type == RX_NOISE_CCD ? noise->gain : 0, scene,
                              &dst->objects, err);
    for (int i = 0; i < 2 && status == RX_OK && outskirts; i++)
        if ((dst->truth[i] = RX_NEW(float, (size_t)par.width *(size_t)par.height)) == NULL)
            status = rx_error_memory(err, (size_t)par.width * (size_t)par.height * sizeof(float));
    if (status == RX_OK)
        return rx_lab_expose(sky, rx_lab_seed(lab, DRAW_NOISE), stream, scene, outskirts ? dst->truth : NULL,
                             tile, err);
    rx_scene_free(scene);
    return status;
}

static rx_status inject(const rx_lab *lab, const rx_lab_sky *sky, uint64_t stream, rx_tile **tile,
                        rx_lab_tile *dst, rx_error *err)
{
    const rx_tile *src = sky->field->tile;
    const size_t n = (size_t)src->width * (size_t)src->height;
    rx_scene *scene = NULL;
    rx_status status = rx_replica_new(src, NULL, tile, err);
    if (status == RX_OK)
        status = rx_simulation_inject(sky->simulation, stream, (*tile)->pixels, NULL, &scene, err);
    if (status == RX_OK)
        status =
            take_objects(lab, sky, RX_SCENE_INJECTED, sky->simulation->noise.gain, scene, &dst->objects, err);
    rx_scene_free(scene);
    if (status != RX_OK)
        return status;
    rx_replica_settle(*tile);
    RX_TRY(RX_MAKE(dst->light, n, err));
    for (size_t i = 0; i < n; i++)
        dst->light[i] = (*tile)->pixels[i] - src->pixels[i];
    return RX_OK;
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
    const int injected = id == RX_SCENE_INJECTED;
    const int pairs = id == RX_SCENE_PAIRS || id == RX_SCENE_MIXED_PAIRS;
    rx_tile *tile = NULL;
    rx_status status;
    *dst = (rx_lab_tile){0};
    RX_TRY_EXIT(injected ? inject(lab, sky, stream, &tile, dst, err)
                         : simulate(lab, sky, id, stream, &tile, dst, err));
    status =
        rx_field_prepare(&lab->options->pipeline, RX_FIELD_PSF, tile, sky->given, NULL, &dst->field, err);
    tile = NULL; /* the field's */
    RX_TRY_EXIT(status);
    if (injected) {
        dst->field->model_noise = sky->model_noise;
        dst->field->model_factor = sky->field->noise_factor;
    }
    if (id == RX_SCENE_PLATEAU)
        RX_TRY_EXIT(put_plateau(sky, unit->number, dst->field, err));
    if (lab->kind->fluxes)
        RX_TRY_EXIT(find_company(sky, &dst->objects, err));
    for (long i = 0; pairs && i < dst->objects.n; i++)
        dst->objects.list[i].partner = i ^ 1;
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
    free(tile->light);
    free(tile->truth[0]);
    free(tile->truth[1]);
    *tile = (rx_lab_tile){0};
}
