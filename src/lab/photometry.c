/* The campaign PHOTOMETRY: stars of one magnitude per set on tiles of a field, through the stage once per restorer. The paper's
 * last figure.
 *
 * SIMULATED: the sky of the SIM. keywords, another one on each tile; the restorers are given its true PSF, unless
 * STAGE.PSF_TYPE is set: then the stage finds it as on any tile. A field for each of the conditions of SEEING, PSF_ERROR,
 * SKY_ERROR and NOISE_ERROR. INJECTED: stars added to a real tile with the tile's own PSF (of the STAGE. keywords, measured on
 * the untouched tile by default), which the restorers are given too, and with the photon noise of its gain. Its noise is the
 * same on every tile, and what is found on it before the injection, by any restorer, is known and neither right nor false: of
 * that, no one can distinguish faint sources from peaks of the noise. So every tile comes with a blank one, a realisation of
 * the tile's own noise without any source, whose detections are all false.
 *
 * Stars are listed, known objects at least as bright their rivals, and all known ones have a reach (sources.h). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/names.h"
#include "check/blankcheck.h"
#include "check/quality.h"
#include "check/replica.h"
#include "lab/sources.h"
#include "pipeline/pipeline.h"
#include "simulate/inject.h"

/* Test stars are so many FWHM apart, and so many from the border. */
static const double APART = 6.0, INSIDE = 4.0;
/* A detection belongs to a known galaxy within so many half-light radii. */
static const double GALAXY_REACH = 2.0;
static const double MPIXEL = 1024.0 * 1024.0; /* STARS_PER_TILE */

/* What random numbers are for. */
enum { DRAW_SKY = 1, DRAW_STARS, DRAW_NOISE, DRAW_BLANK };

/* --- open --- */

/* Every restorer with each of FLUXES. */
static rx_status add_runs(rx_lab *lab, rx_error *err)
{
    const rx_words *words = &lab->config->restore_type, *fluxes = &lab->config->fluxes;
    for (int i = 0; i < words->n * fluxes->n; i++) {
        const char *word = words->v[i / fluxes->n];
        rx_lab_run run = {.templates = strcmp(fluxes->v[i % fluxes->n], "TEMPLATE") == 0};
        snprintf(run.name, sizeof run.name, "%s%s", word, run.templates ? " TEMPLATE" : "");
        lab->options->pipeline.templates.wanted |= run.templates;
        RX_TRY(rx_lab_add_run(lab, word, run, err));
    }
    return RX_OK;
}

/* The first image of TILE_NAME, with its PSF whether a restorer needs it or not. */
static rx_status read_sky(rx_lab *lab, rx_log *log, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    const rx_reals *const errors[] = {&config->psf_error, &config->sky_error, &config->noise_error};
    int simulated = config->seeing.n > 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < errors[i]->n; k++)
            simulated |= errors[i]->v[k] != 0.0;
    if (simulated)
        return rx_error_set(err, RX_USAGE,
                            "SEEING, PSF_ERROR, SKY_ERROR and NOISE_ERROR are of simulated fields; leave "
                            "them out, or INJECTED");
    rx_lab_sky *dst;
    uint8_t *mask = NULL;
    RX_TRY(rx_lab_sky_read(lab, log, &dst, err));
    RX_TRY(rx_optics_psf(dst->psf, &dst->optics, err));
    const rx_tile *tile = dst->field->tile;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    RX_TRY(RX_MAKE(dst->allowed, n, err));
    RX_TRY(RX_MAKE(mask, n, err));
    for (size_t i = 0; i < n; i++)
        mask[i] = tile->mask[i] & RX_HIDE_PLAIN;
    const rx_status status = rx_inject_allowed(tile->width, tile->height, NULL, mask, 0, dst->allowed, err);
    free(mask);
    return status;
}

static rx_status open_runs(rx_lab *lab, rx_log *log, rx_error *err)
{
    const double *range = lab->config->magnitudes.v; /* from, to, step */
    lab->ntiles = rx_lab_size(lab, &lab->config->tiles);
    if (lab->nprecisions == 0) {
        lab->nprecisions = 2;
        lab->precision[0] = 0.95;
        lab->precision[1] = 0.99;
    }
    RX_TRY(add_runs(lab, err));
    for (int i = 0; i <= (int)floor((range[1] - range[0]) / range[2] + 1e-6); i++) {
        rx_lab_scene scene = {.id = RX_SCENE_MAGNITUDE, .number = i, .mag = range[0] + i * range[2]};
        snprintf(scene.name, sizeof scene.name, "%g", scene.mag);
        RX_TRY(rx_lab_add_scene(lab, scene, err));
    }
    const int find = rx_settings_was_set(&lab->config->settings, "STAGE.PSF_TYPE") != RX_FROM_DEFAULT;
    for (int i = 0; i < lab->config->fields.n; i++) /* each word comes once */
        RX_TRY(strcmp(lab->config->fields.v[i], "INJECTED") == 0
                   ? read_sky(lab, log, err)
                   : rx_lab_skies_simulate(lab, find, log, err));
    return RX_OK;
}

/* --- tiles --- */

/* Test stars: nothing else, apart from each other, anywhere allowed. */
static rx_status make_stars(const rx_lab *lab, const rx_lab_sky *sky, double mag, double zeropoint,
                            uint64_t number, rx_scene **dst, rx_error *err)
{
    const double area = (double)sky->width * (double)sky->height;
    const double least = fmin(sky->width, sky->height);
    const rx_scene_params par = {
        .width = sky->width,
        .height = sky->height,
        .zeropoint = zeropoint,
        .pixel_scale = 1.0,
        .galaxy_scale = 1.0,
        .stars = {.count = fmax(floor(lab->config->stars_per_tile * area / MPIXEL + 0.5), 1),
                  .mag_low = mag,
                  .mag_high = mag},
        .margin = -fmin(INSIDE * sky->fwhm, least / 4),
        .least_distance = APART * sky->fwhm,
        .allowed = sky->allowed,
        .seed = rx_lab_seed(lab, DRAW_STARS),
        .stream = number};
    return rx_scene_make(&par, NULL, dst, err);
}

/* The stars, listed, then what else is known: `others` of a simulated sky, or what was found on a real tile. */
static rx_status know_objects(const rx_lab *lab, const rx_lab_sky *sky, const rx_scene *stars,
                              const rx_scene *others, rx_lab_tile *dst, rx_error *err)
{
    const long nothers = others != NULL ? others->n : sky->known.n;
    double radius = 0;
    dst->objects = (rx_lab_objects){
        .n = stars->n + nothers, .width = sky->width, .height = sky->height, .covered = sky->covered};
    RX_TRY(RX_MAKE(dst->objects.list, (size_t)dst->objects.n, err));
    rx_lab_object *object = dst->objects.list;
    for (long i = 0; i < stars->n; i++)
        *object++ = (rx_lab_object){.x = stars->objects[i].x,
                                    .y = stars->objects[i].y,
                                    .flux = stars->objects[i].flux,
                                    .role = RX_LISTED};
    if (others != NULL)
        RX_TRY(rx_sources_radius(lab, sky, dst->field->tile, &radius, err));
    for (long i = 0; i < nothers; i++, object++) {
        const rx_object *o = others != NULL ? &others->objects[i] : NULL;
        *object = o == NULL
                      ? sky->known.list[i]
                      : (rx_lab_object){.x = o->x,
                                        .y = o->y,
                                        .flux = o->flux,
                                        .reach = rx_lab_beyond(sky, o->x, o->y) +
                                                 fmax(fmax(radius, sky->fwhm), GALAXY_REACH * o->radius)};
        object->role = stars->n > 0 && object->flux < stars->objects[0].flux ? RX_OTHER : RX_RIVAL;
    }
    return RX_OK;
}

/* A simulated tile: everything on it through the optics, then sky and noise. */
static rx_status simulated_tile(const rx_lab *lab, const rx_lab_sky *sky, const rx_scene *stars,
                                uint64_t number, rx_tile **tile, rx_scene **others, rx_error *err)
{
    rx_scene_params par = sky->simulation->scene;
    rx_scene *all = NULL;
    par.seed = rx_lab_seed(lab, DRAW_SKY);
    par.stream = number;
    RX_TRY(rx_scene_make(&par, sky->simulation->templates, others, err));
    RX_TRY(rx_scene_new(sky->width, sky->height, (*others)->n + stars->n, &all, err));
    memcpy(all->objects, (*others)->objects, (size_t)(*others)->n * sizeof *all->objects);
    memcpy(all->objects + (*others)->n, stars->objects, (size_t)stars->n * sizeof *all->objects);
    all->templates = (*others)->templates;
    return rx_lab_expose(sky, rx_lab_seed(lab, DRAW_NOISE), number, all, tile, err);
}

static rx_status injected_tile(const rx_lab *lab, const rx_lab_sky *sky, const rx_scene *stars,
                               uint64_t number, rx_tile **tile, rx_error *err)
{
    const rx_tile *src = sky->field->tile;
    const double gain = src->gain > 0 ? src->gain : lab->config->sim->gain;
    RX_TRY(rx_replica_new(src, NULL, tile, err));
    RX_TRY(rx_inject(stars, sky->optics,
                     &(rx_inject_params){.gain = gain,
                                         .saturation = src->saturation,
                                         .noise = &sky->noise,
                                         .seed = rx_lab_seed(lab, DRAW_NOISE),
                                         .stream = number},
                     1, (*tile)->pixels, err));
    rx_replica_settle(*tile);
    return RX_OK;
}

static rx_status make_tile(const rx_lab *lab, const rx_lab_unit *unit, rx_lab_tile *dst, rx_error *err)
{
    const rx_lab_sky *sky = &lab->sky[unit->condition];
    const double mag = lab->scene[unit->scene].mag;
    const double zeropoint =
        sky->field != NULL ? sky->field->tile->zeropoint : sky->simulation->scene.zeropoint;
    /* those of one magnitude and tile are drawn alike in every field */
    const uint64_t number = (uint64_t)lab->scene[unit->scene].number << 32 | (uint64_t)unit->number;
    const rx_pipeline_params *par = &lab->options->pipeline;
    rx_scene *stars = NULL, *others = NULL;
    rx_tile *tile = NULL;
    rx_status status;
    int needs_psf = 0;
    for (int r = 0; r < lab->nruns; r++)
        needs_psf |= (lab->run[r].restorer->traits & RX_TRAIT_PSF) != 0;
    *dst = (rx_lab_tile){0};
    RX_TRY_EXIT(make_stars(lab, sky, mag, zeropoint, number, &stars, err));
    for (long i = 0; i < stars->n; i++) {
        stars->objects[i].mag = mag;
        stars->objects[i].flux = pow(10.0, -0.4 * (mag - zeropoint));
    }
    RX_TRY_EXIT(sky->field != NULL ? injected_tile(lab, sky, stars, number, &tile, err)
                                   : simulated_tile(lab, sky, stars, number, &tile, &others, err));
    status = rx_field_prepare(par, needs_psf ? RX_FIELD_PSF : 0, tile, sky->given, NULL, &dst->field, err);
    tile = NULL; /* the field's */
    RX_TRY_EXIT(status);
    RX_TRY_EXIT(know_objects(lab, sky, stars, others, dst, err));
    rx_condition_apply(&sky->condition, dst->field);
    if (sky->field != NULL)
        status =
            rx_blankcheck_field(par, &(rx_blank_input){.field = sky->field, .noise = &sky->noise}, NULL,
                                (rx_random_stream){rx_lab_seed(lab, DRAW_BLANK), number}, &dst->blank, err);
    if (status == RX_OK && dst->field->unrestorable && needs_psf)
        status = rx_error_set(err, RX_INPUT,
                              "a simulated tile has too few stars for the PSF that STAGE.PSF_TYPE asks for; "
                              "leave it out, and restorers are given the true one");
exit:
    rx_tile_free(tile);
    rx_scene_free(stars);
    rx_scene_free(others);
    if (status != RX_OK)
        rx_lab_tile_free(dst);
    return status;
}

/* --- before the units: an untouched tile --- */

/* Detections that no earlier restorer had become known, and the footprints of all; and the noise without them. */
static rx_status keep_known(const rx_lab *lab, rx_lab_sky *sky, const rx_sources *sources, rx_error *err)
{
    const size_t n = (size_t)sky->width * (size_t)sky->height;
    const long before = sky->known.n;
    rx_qa_list list = {0};
    double radius = 0;
    RX_TRY(rx_sources_radius(lab, sky, sky->field->tile, &radius, err));
    if (sky->covered == NULL) { /* the first restorer */
        RX_TRY(RX_MAKE(sky->covered, n, err));
        RX_TRY(rx_blankcheck_noise(sky->field, sources->segments, lab->nthreads, &sky->noise, err));
    }
    RX_TRY(RX_GROW(sky->known.list, (size_t)(before + sources->n), err));
    RX_TRY(rx_quality_list(&lab->options->check.quality, sky->field->tile, sources, &list, err));
    for (long i = 0; i < list.n; i++) {
        int is_known = 0;
        for (long k = 0; k < before; k++)
            is_known |= hypot(list.x[i] - sky->known.list[k].x, list.y[i] - sky->known.list[k].y) <= radius;
        if (!is_known)
            sky->known.list[sky->known.n++] = (rx_lab_object){
                .x = list.x[i], .y = list.y[i], .flux = list.flux[i], .reach = fmax(radius, sky->fwhm)};
    }
    rx_qa_list_free(&list);
    for (size_t i = 0; i < n; i++)
        sky->covered[i] |= sources->segments[i] != 0;
    return RX_OK;
}

static rx_status prepare(rx_lab *lab, rx_log *log, rx_error *err)
{
    rx_status status = RX_OK;
    for (int i = 0; i < lab->nskies * lab->nruns && status == RX_OK; i++) {
        const int r = i % lab->nruns;
        rx_lab_sky *sky = &lab->sky[i / lab->nruns];
        const rx_lab_run *run = &lab->run[r];
        rx_options options = rx_lab_options(lab, sky, run);
        rx_pipeline_params *par = &options.pipeline;
        rx_result result = {0};
        if (sky->field == NULL ||
            (r > 0 && run[-1].restorer == run->restorer && run[-1].templates != run->templates))
            continue; /* other fluxes of the same sources */
        par->nthreads = par->restore.nthreads = par->measure.nthreads = par->templates.par.nthreads =
            lab->nthreads;
        status = rx_field_extract(par, run->restorer, sky->field, NULL, log, &result, err);
        if (status == RX_OK)
            status = keep_known(lab, sky, result.sources, err);
        rx_result_free(&result);
    }
    return status;
}

/* --- words --- */

static rx_status describe_sky(const rx_lab *lab, rx_lab_sky *sky, rx_error *err)
{
    const rx_campaign_config *config = lab->config;
    if (sky->field != NULL) {
        const rx_tile *tile = sky->field->tile;
        char *name = rx_name_stem(config->tile_name);
        if (name == NULL)
            return rx_error_memory(err, 0);
        snprintf(sky->name, sizeof sky->name, "%s", name);
        free(name);
        snprintf(sky->about, sizeof sky->about,
                 "%d stars added to %d x %d real pixels, among the tile's own sources, again and again; PSF "
                 "%s; noise %.4g, gain %g; what was found before the injection counts neither as right nor "
                 "as false; false detections are those that the injection brings, and all on as many blank "
                 "tiles: realisations of the tile's own noise without sources",
                 (int)fmax(
                     floor(config->stars_per_tile * (double)tile->width * tile->height / 1048576.0 + 0.5), 1),
                 tile->width, tile->height, sky->psf->description, sky->field->plain->global_sigma,
                 tile->gain);
        return RX_OK;
    }
    const rx_simulate_config *sim = config->sim;
    snprintf(sky->about, sizeof sky->about,
             "%d x %d pixels, PSF %s, %s%s; noise %s (sky %g ADU, sigma %g), per Mpixel %g stars of %g to %g "
             "mag and %g galaxies of %g to %g mag besides the test stars, another sky on each tile",
             sky->width, sky->height, sky->simulation->optics->description,
             sky->given != NULL ? "known to the restorers" : "found by the stage",
             sky->condition.error != 0.0 ? " (or what is given of PSF, sky and noise, with the error named)"
                                         : "",
             sim->noise_type, sim->sky_level, sim->noise_sigma, sim->star_count, sim->star_mag.v[0],
             sim->star_mag.v[1], sim->galaxy_count, sim->galaxy_mag.v[0], sim->galaxy_mag.v[1]);
    return RX_OK;
}

static rx_status describe(rx_lab *lab, rx_error *err)
{
    for (int s = 0; s < lab->nskies; s++)
        RX_TRY(describe_sky(lab, &lab->sky[s], err));
    return RX_OK;
}

RX_LAB_KIND(rx_kind_photometry, .name = "PHOTOMETRY", .title = "Photometry campaign", .tag = 0x70686f746f,
            .most = RX_METHODS_MAX, .ntables = RX_SOURCES_TABLES, .tables = rx_sources_tables,
            .open = open_runs, .prepare = prepare, .tile = make_tile, .unit = rx_sources_unit,
            .describe = describe, .name_set = rx_sources_name_set, .report = rx_sources_report,
            .reading = rx_sources_reading);
