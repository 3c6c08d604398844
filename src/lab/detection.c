/* The campaign DETECTION: whole scenes through every restorer, and what its list of detections is worth. Runs: every restorer of
 * RESTORE_TYPE; beside NONE also MATCHED, the unrestored image with a Gaussian of the PSF's FWHM for a detection filter, at
 * the threshold of the same S/N as that of NONE; RL once for each number of TUNE_NITER and of TUNE_FILTER. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "lab/sources.h"
#include "pipeline/pipeline.h"

/* Pairs are so many FWHM apart, and so many from the border; of their companions. */
static const double PAIRS_APART = 8.0, INSIDE = 6.0, ALIKE_MAG = 0.5;

static const double EXTENDED = 9.06; /* 4 pi / (2 ln 2): r_e^2 of a Gaussian to 1 / sum of its squares */

/* What random numbers are for. */
enum { DRAW_SCENE = 1, DRAW_NOISE, DRAW_PAIRS };

static const rx_lab_scene SCENES[] = {
    {RX_SCENE_STARS, 0, 0, "STARS",
     "Stars alone, all that the population puts on a tile, blends and all. A detection that is no star of "
     "the "
     "least S/N, nor a fainter one, is false."},
    {RX_SCENE_GALAXIES, 1, 0, "GALAXIES",
     "Galaxies alone. A galaxy in two pieces is one right and one false detection."},
    {RX_SCENE_PAIRS, 2, 0, "PAIRS",
     "Close pairs of stars: resolved when there are two detections, each nearer than half the separation to "
     "its star, both above the threshold."}};
enum { NSCENES = sizeof SCENES / sizeof *SCENES };

/* RL with every number of iterations and every filter that is tried. */
static rx_status add_runs(rx_lab *lab, const char *word, rx_error *err)
{
    const rx_ints *niter = &lab->config->tune_niter;
    const rx_reals *filter = &lab->config->tune_filter;
    const int tuned = strcmp(word, "RL") == 0;
    if (!tuned)
        RX_TRY(rx_lab_add_run(lab, word, (rx_lab_run){0}, err));
    if (strcmp(word, "NONE") == 0)
        RX_TRY(rx_lab_add_run(lab, word, (rx_lab_run){.name = "MATCHED", .matched = 1}, err));
    for (int k = 0; tuned && k < niter->n * filter->n; k++) {
        rx_lab_run run = {.tuned = 1, .niter = niter->v[k / filter->n], .filter = filter->v[k % filter->n]};
        snprintf(run.name, sizeof run.name, "RL %d %g", run.niter, run.filter);
        RX_TRY(rx_lab_add_run(lab, word, run, err));
    }
    return RX_OK;
}

static rx_status open_runs(rx_lab *lab, rx_log *log, rx_error *err)
{
    const rx_words *scenes = &lab->config->scenes;
    for (int i = 0; i < lab->config->restore_type.n; i++)
        RX_TRY(add_runs(lab, lab->config->restore_type.v[i], err));
    for (int i = 0; i < scenes->n; i++)
        for (int k = 0; k < NSCENES; k++)
            if (strcmp(scenes->v[i], SCENES[k].name) == 0)
                RX_TRY(rx_lab_add_scene(lab, SCENES[k], err));
    RX_TRY(rx_lab_skies_simulate(lab, 0, log, err));
    return lab->sky[0].sigma > 0
               ? RX_OK
               : rx_error_set(err, RX_USAGE,
                              "SIM.NOISE_TYPE, SIM.NOISE_SIGMA: the sky of a DETECTION campaign needs noise");
}

/* --- tiles --- */

/* Of a star of that S/N in a matched filter on the bare sky, flux / (sigma sqrt(A)), A = 1 / sum PSF^2. */
static double mag_of(const rx_lab_sky *sky, double snr)
{
    return sky->simulation->scene.zeropoint - 2.5 * log10(snr * sky->sigma * sqrt(sky->area));
}

static rx_scene_params params_of(const rx_lab *lab, const rx_lab_sky *sky, rx_scene_id id, uint64_t stream)
{
    static const rx_population none = {0};
    const double *snr = lab->config->pair_snr.v, step = 1.3 * PAIRS_APART * sky->fwhm;
    rx_scene_params par = sky->simulation->scene;
    par.seed = rx_lab_seed(lab, DRAW_SCENE);
    par.stream = stream;
    if (id == RX_SCENE_GALAXIES)
        par.stars = none;
    else
        par.galaxies = par.templates = none;
    if (id != RX_SCENE_PAIRS)
        return par;
    /* the brighter ones: of PAIR_SNR, uniform in magnitude, as many as find a place so far apart */
    par.stars = (rx_population){.count = fmax(floor((double)sky->width * sky->height / (step * step)), 1),
                                .mag_low = mag_of(sky, snr[1]),
                                .mag_high = mag_of(sky, snr[0])};
    par.pair_share = par.clustering = 0;
    par.margin = -fmin(INSIDE * sky->fwhm, fmin(par.width, par.height) / 4);
    par.least_distance = PAIRS_APART * sky->fwhm;
    return par;
}

/* Every object gets a companion, right after it in the list, at most ALIKE_MAG brighter or fainter. */
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

/* S/N: A + 9.06 r_e^2 b/a, as if the profile was a Gaussian of its half-light radius. Objects of TRUTH_SNR and more that lie inside are to be found. Of an object beyond the border the light that comes in, most
 * of it where the border is nearest, is no false source. */
static rx_status take_objects(const rx_lab *lab, const rx_lab_sky *sky, rx_scene_id id, const rx_scene *scene,
                              rx_lab_objects *dst, rx_error *err)
{
    *dst = (rx_lab_objects){.n = scene->n};
    RX_TRY(RX_MAKE(dst->list, (size_t)scene->n, err));
    for (long i = 0; i < scene->n; i++) {
        const rx_object *o = &scene->objects[i];
        const double beyond = rx_lab_beyond(sky, o->x, o->y),
                     area = sky->area + EXTENDED * o->radius * o->radius * o->ratio,
                     snr = o->flux / (sky->sigma * sqrt(area));
        const int listed = id != RX_SCENE_PAIRS && snr >= lab->config->truth_snr && !(beyond > 0);
        dst->list[i] =
            (rx_lab_object){.x = o->x,
                            .y = o->y,
                            .flux = o->flux,
                            .snr = snr,
                            .reach = beyond > 0 ? beyond + sky->fwhm + o->radius * sqrt(o->ratio) : 0,
                            .role = listed ? RX_LISTED : RX_OTHER};
    }
    return RX_OK;
}

static rx_status make_tile(const rx_lab *lab, const rx_lab_unit *unit, rx_lab_tile *dst, rx_error *err)
{
    const rx_lab_sky *sky = &lab->sky[unit->condition];
    const rx_scene_id id = lab->scene[unit->scene].id;
    const uint64_t stream = (uint64_t)lab->scene[unit->scene].number << 40 | (uint64_t)unit->number;
    const rx_scene_params par = params_of(lab, sky, id, stream);
    rx_scene *scene = NULL;
    rx_tile *tile = NULL;
    rx_status status;
    *dst = (rx_lab_tile){0};
    RX_TRY_EXIT(rx_scene_make(&par, sky->simulation->templates, &scene, err));
    if (id == RX_SCENE_PAIRS)
        RX_TRY_EXIT(add_companions(lab, sky, stream, &scene, err));
    RX_TRY_EXIT(take_objects(lab, sky, id, scene, &dst->objects, err));
    status = rx_lab_expose(sky, rx_lab_seed(lab, DRAW_NOISE), stream, scene, &tile, err);
    scene = NULL;
    RX_TRY_EXIT(status);
    RX_TRY_EXIT(
        rx_field_prepare(&lab->options->pipeline, RX_FIELD_PSF, tile, sky->given, NULL, &dst->field, err));
    rx_condition_apply(&sky->condition, dst->field);
exit:
    rx_scene_free(scene);
    if (status != RX_OK)
        rx_lab_tile_free(dst);
    return status;
}

static rx_status describe(rx_lab *lab, rx_error *err)
{
    (void)err;
    const rx_simulate_config *sim = lab->config->sim;
    snprintf(
        lab->about, sizeof lab->about,
        "%d x %d pixels, %ld tiles per scene and condition; Moffat PSF of beta %g, noise %s (sky %g ADU, "
        "sigma %.4g); per Mpixel %g stars of %g to %g mag in STARS, %g galaxies of %g to %g mag in GALAXIES",
        lab->sky[0].width, lab->sky[0].height, lab->ntiles, sim->psf_beta, sim->noise_type, sim->sky_level,
        lab->sky[0].sigma, sim->star_count, sim->star_mag.v[0], sim->star_mag.v[1], sim->galaxy_count,
        sim->galaxy_mag.v[0], sim->galaxy_mag.v[1]);
    return RX_OK;
}

RX_LAB_KIND(rx_kind_detection, .name = "DETECTION", .title = "Detection campaign", .tag = 0x6465746563,
            .most = RX_LAB_RUNS, .ntables = RX_SOURCES_TABLES, .tables = rx_sources_tables, .by_width = 1,
            .open = open_runs, .tile = make_tile, .unit = rx_sources_unit, .describe = describe,
            .name_set = rx_sources_name_set, .report = rx_sources_report, .reading = rx_sources_reading);
