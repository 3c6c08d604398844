/* Simulated fields: what the keywords say of them, what is drawn, and the job that writes them. */
#include "stage/simulation.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/text.h"
#include "base/threads.h"
#include "catalog/catalog.h"
#include "config/config_fields.h"
#include "data/psf.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "io/output.h"
#include "io/tile.h"
#include "io/wcs.h"
#include "pipeline/pipeline.h"
#include "psf/psf.h"
#include "restore/restore.h"
#include "simulate/inject.h"
#include "simulate/render.h"
#include "simulate/truth.h"
#include "stage/open.h"
#include "stage/provenance.h"

/* What a field's settings depend on besides the keywords. */
typedef struct rx_simulation_ground {
    int width, height;
    int extension; /* from 1: which model of a PSFEx file with several */
    double zeropoint, pixel_scale;
    double margin;     /* pixels by which objects may lie beyond the border, in FWHM */
    const rx_psf *psf; /* measured on the tile, for PSF_TYPE AUTO; else NULL */
    int with_optics;
} rx_simulation_ground;

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

/* Stated in pixels of the image, made for those that see the sky. */
static rx_status moffat(const rx_simulate_config *config, const rx_simulation_ground *ground, rx_optics **dst,
                        rx_error *err)
{
    const rx_coadd_params coadd = coadd_params(config);
    const double scale = coadd.type != RX_COADD_NONE ? coadd.scale : 1.0;
    return rx_optics_moffat(
        &(rx_moffat_profile){config->psf_fwhm * scale, config->psf_beta, config->psf_ratio,
                             config->psf_angle * M_PI / 180.0, config->psf_variation},
        (int)lround(ground->width * scale), (int)lround(ground->height * scale), dst, err);
}

static rx_status make_optics(const rx_simulate_config *config, const rx_simulation_ground *ground,
                             rx_log *log, rx_optics **dst, rx_error *err)
{
    const rx_psf_params par = {.file = config->psf_name, .extension = ground->extension};
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
        status = rx_psf_psfex(&par, ground->width, ground->height, log, &psf, err);
    else
        status = rx_psf_file(&par, ground->width, ground->height, log, &psf, err);
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

static rx_status rx_simulation_build(const rx_simulate_config *config, const rx_simulation_ground *ground,
                                     rx_log *log, rx_simulation **dst, rx_error *err)
{
    double fwhm = config->psf_fwhm;
    rx_status status = RX_OK;
    rx_simulation *simulation;
    RX_TRY(RX_MAKE(simulation, 1, err));
    simulation->sharp_fwhm = config->sharp_fwhm;
    simulation->alpha = config->sky_center.v[0];
    simulation->delta = config->sky_center.v[1];
    simulation->nthreads = rx_threads_count(config->nthreads);
    simulation->noise = noise_params(config);
    simulation->coadd = coadd_params(config);
    if (ground->with_optics) {
        status = make_optics(config, ground, log, &simulation->optics, err);
        if (status == RX_OK && simulation->coadd.type == RX_COADD_NONE)
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

/* images[i] += the scene through optics[i], but for those that are not wanted. */
static rx_status render(const rx_simulation *simulation, const rx_scene *scene, float *clean, float *sharp,
                        rx_error *err)
{
    const rx_optics *optics[2];
    float *images[2];
    int n = 0;
    if (clean != NULL) {
        optics[n] = simulation->optics;
        images[n++] = clean;
    }
    if (sharp != NULL) {
        optics[n] = simulation->target;
        images[n++] = sharp;
    }
    return rx_render(scene, n, optics, images, simulation->nthreads, err);
}

/* Dead columns have no weight. */
static void even_weight(const rx_simulated *simulated, size_t n)
{
    const double sigma = simulated->sigma;
    const float weight = sigma > 0.0 ? (float)(1.0 / (sigma * sigma)) : 1.0f;
    for (size_t i = 0; i < n; i++)
        simulated->weight[i] = simulated->defects[i] & RX_DEFECT_COLUMN ? 0.0f : weight;
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
        rx_status status = rx_noise_expose(&noise, dst->width, dst->height, dst->image, dst->defects,
                                           simulation->nthreads, err);
        if (status == RX_OK)
            even_weight(dst, n);
        return status;
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
    rx_status status;
    RX_TRY_EXIT(rx_scene_make(&scene, simulation->templates, &dst->scene, err));
    dst->image = RX_NEW(float, n);
    dst->weight = RX_NEW(float, n);
    dst->defects = RX_NEW(uint8_t, n);
    if (exposes_once)
        dst->clean = RX_NEW(float, n);
    if (!simulation->without_sharp)
        dst->sharp = RX_NEW(float, n);
    if (dst->image == NULL || dst->weight == NULL || dst->defects == NULL ||
        (dst->clean == NULL && exposes_once) || (dst->sharp == NULL && !simulation->without_sharp))
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof(float)));
    RX_TRY_EXIT(render(simulation, dst->scene, dst->clean, dst->sharp, err));
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

/* --- injection: the simulator on a real tile --- */

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
    rx_result result = {0};
    rx_status status = RX_OK;
    uint8_t *mask = RX_NEW(uint8_t, n);
    *dst = RX_NEW(unsigned char, n);
    if (mask == NULL || *dst == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n));
    for (size_t i = 0; i < n; i++)
        mask[i] = tile->mask[i] & (away ? RX_HIDE_RESTORED : RX_HIDE_PLAIN);
    if (away)
        RX_TRY_EXIT(
            rx_field_extract(&options->pipeline, rx_restorer_find("NONE"), field, NULL, log, &result, err));
    status = rx_inject_allowed(tile->width, tile->height, away ? result.sources->segments : NULL, mask,
                               away ? config->inject_distance * fwhm : 0.0, *dst, err);
    if (away)
        rx_result_free(&result);
exit:
    free(mask);
    return status;
}

/* A PSF that was only stated would pass for the tile's own. */
static rx_status check_measured(const rx_field *field, rx_error *err)
{
    if (field->psf != NULL && rx_psf_type_measured(field->psf->type))
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
    RX_TRY(automatic ? check_measured(field, err) : RX_OK);
    const rx_simulation_ground ground = {.width = tile->width,
                                         .height = tile->height,
                                         .extension = tile->extension,
                                         .zeropoint = zeropoint_of(config, tile, log),
                                         .pixel_scale = tile->pixel_scale > 0.0 ? tile->pixel_scale
                                                                                : config->pixel_scale,
                                         .psf = automatic ? field->psf : NULL,
                                         .with_optics = 1};
    RX_TRY(rx_simulation_build(config, &ground, log, &simulation, err));
    simulation->nthreads = options->pipeline.nthreads;
    simulation->noise.type = RX_NOISE_NONE;
    simulation->noise.sky = simulation->noise.sigma = 0.0;
    simulation->noise.gain = gain_of(config, tile, log);
    simulation->noise.saturation = tile->saturation;
    rx_status status =
        allow(config, options, field, simulation->optics->fwhm, log, &simulation->allowed, err);
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
        status = rx_inject(scene, simulation->optics,
                           &(rx_inject_params){.gain = noise->gain,
                                               .saturation = noise->saturation,
                                               .seed = noise->seed,
                                               .stream = rx_simulation_pixel_stream(stream)},
                           simulation->nthreads, pixels, err);
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

/* --- the job: fields, or every image of a tile with objects added, to files --- */

/* One image file among the outputs; writer NULL where it is not wanted. */
typedef struct image_file {
    const char *name;
    rx_fits_writer *writer;
} image_file;

typedef struct job {
    const rx_simulate_config *config;
    rx_log *log;
    rx_outputs *outputs;
    image_file image, sharp, flags, weight;
    const char *truth_temporary; /* NULL without truth catalogue */
    int ntables;
    rx_table **tables; /* truth, one of each image */
    rx_record record;  /* of the whole run */
} job;

/* What goes to the files for one image. */
typedef struct field_data {
    const rx_simulation *simulation;
    const rx_scene *scene;
    const rx_tile *tile; /* the pixels as they are written */
    const float *sharp;  /* NULL when not wanted */
    const float *weight; /* NULL for a real tile */
    const uint8_t *defects;
    const rx_text *facts; /* ready cards */
} field_data;

/* --- provenance --- */

static void add_keyword(void *user, const char *name, const char *value, const char *help)
{
    if (strcmp(name, "NTHREADS") != 0 && strcmp(name, "VERBOSE_TYPE") != 0)
        rx_record_add(user, name, help, "%s", value);
}

static rx_status record_run(job *job, rx_error *err)
{
    rx_record *record = &job->record;
    rx_record_add(record, "PROGRAM", "made by", "rextract-simulate");
    rx_record_add(record, "RXVERS", "version of rextract", "%s", RX_VERSION);
    if (!rx_settings_visit(&job->config->settings, add_keyword, record) || record->failed)
        return rx_error_memory(err, 0);
    return RX_OK;
}

static long count(const rx_scene *scene, rx_object_type type)
{
    long n = 0;
    for (long i = 0; i < scene->n; i++)
        n += scene->objects[i].type == type;
    return n;
}

/* field: the real tile, NULL for a simulated field, as below. */
static void describe_noise(const rx_simulated *simulated, const rx_field *field, rx_record *facts)
{
    static const char *const words[] = {
        [RX_NOISE_NONE] = "none", [RX_NOISE_GAUSS] = "Gaussian", [RX_NOISE_CCD] = "photons and read noise"};
    const rx_noise_params *noise = &simulated->noise;
    rx_record_add(facts, "RXNOISE", "noise", "%s",
                  field == NULL       ? words[noise->type]
                  : noise->gain > 0.0 ? "the tile's own, and photon noise of the added light"
                                      : "the tile's own; gain unknown, no photon noise of the added light");
    rx_record_add(facts, "RXBACK", "mean sky level, ADU", "%.8g",
                  field != NULL ? field->plain->global_level : noise->sky);
    rx_record_add(facts, "RXSIGMA", "noise of a sky pixel, ADU", "%.8g",
                  field != NULL ? field->plain->global_sigma : simulated->sigma);
    rx_record_add(facts, "RXGAIN", "gain, e-/ADU, 0 = infinite", "%.6g", noise->gain);
}

static void describe_psf(const rx_simulation *simulation, rx_record *facts)
{
    const rx_coadd_params *coadd = &simulation->coadd;
    const rx_optics *optics = simulation->optics;
    const int exposed_once = coadd->type == RX_COADD_NONE;
    const double fwhm = exposed_once ? optics->fwhm : optics->fwhm / coadd->scale;
    rx_record_add(facts, "RXPSF", exposed_once ? "PSF of the image" : "PSF of a frame, in its pixels", "%s",
                  optics->description);
    rx_record_add(facts, "RXFWHM", "its FWHM, pixels, before pixel integration", "%.6g", fwhm);
    rx_record_add(facts, "RXMISS", "share of its flux beyond the stamp, left out", "%.3g", optics->missing);
    rx_record_add(facts, "RXSHARP", "FWHM of the sharp reference, pixels", "%.6g", simulation->sharp_fwhm);
    if (!exposed_once)
        rx_record_add(facts, "RXCFWHM", "FWHM of a star on the image, pixels", "%.4f",
                      rx_coadd_fwhm(coadd, fwhm, optics->beta));
}

static void describe_coadd(const rx_simulation *simulation, const rx_simulated *simulated, rx_record *facts)
{
    const rx_coadd_params *coadd = &simulation->coadd;
    const int drizzles = coadd->type == RX_COADD_DRIZZLE;
    rx_record_add(facts, "RXCOADD", "how frames were combined", "%s", drizzles ? "DRIZZLE" : "LANCZOS");
    rx_record_add(facts, "RXCNUM", "frames", "%d", coadd->frames);
    rx_record_add(facts, "RXCSCAL", "image pixel / frame pixel", "%.6g", coadd->scale);
    if (drizzles)
        rx_record_add(facts, "RXCDROP", "pixfrac: side of the drop / frame pixel", "%.6g", coadd->pixfrac);
    rx_record_add(facts, "RXCUNEV", "how uneven the depth is, 0 to 1", "%.6g", coadd->uneven);
    rx_record_add(facts, "RXCWIDE", "noise of wide sums / of independent pixels", "%.5g", simulated->wide);
}

static void describe(const rx_simulation *simulation, const rx_simulated *simulated, const rx_field *field,
                     rx_record *facts)
{
    const rx_scene *scene = simulated->scene;
    describe_psf(simulation, facts);
    if (simulation->coadd.type != RX_COADD_NONE)
        describe_coadd(simulation, simulated, facts);
    describe_noise(simulated, field, facts);
    rx_record_add(facts, "RXZP", "magnitude of 1 ADU", "%.6g", simulation->scene.zeropoint);
    rx_record_add(facts, "RXSCALE", "pixel size that sizes refer to, arcsec", "%.6g",
                  simulation->scene.pixel_scale);
    rx_record_add(facts, "RXSEED", "seed", "%llu", (unsigned long long)simulation->scene.seed);
    rx_record_add(facts, "RXSCENE", "number of the scene", "%llu",
                  (unsigned long long)simulation->scene.stream);
    rx_record_add(facts, "RXNSTAR", "stars", "%ld", count(scene, RX_OBJECT_STAR));
    rx_record_add(facts, "RXNGAL", "galaxies", "%ld", count(scene, RX_OBJECT_GALAXY));
    rx_record_add(facts, "RXNTEMP", "template galaxies", "%ld", count(scene, RX_OBJECT_TEMPLATE));
    if (scene->shrunk > 0)
        rx_record_add(facts, "RXNSHRNK", "of them drawn smaller: no sharper template", "%ld", scene->shrunk);
    if (scene->left_out > 0)
        rx_record_add(facts, "RXNOUT", "objects left out: no place for them", "%ld", scene->left_out);
    if (field != NULL) {
        rx_record_add(facts, "RXINPUT", "tile that objects were added to", "%s", field->tile->name);
        rx_record_add(facts, "RXINSUM", "digest of its pixels", "%s", rx_tile_checksum(field->tile));
    }
}

static rx_status make_facts(const rx_simulation *simulation, const rx_simulated *simulated,
                            const rx_field *field, rx_text *cards, rx_error *err)
{
    rx_record facts = {0};
    describe(simulation, simulated, field, &facts);
    rx_status status = facts.failed ? rx_error_memory(err, 0) : RX_OK;
    if (status == RX_OK) {
        rx_record_cards(&facts, cards);
        status = cards->failed ? rx_error_memory(err, cards->length) : RX_OK;
    }
    rx_record_free(&facts);
    return status;
}

/* --- outputs --- */

static rx_status open_image(job *job, const char *name, image_file *file, rx_error *err)
{
    const char *temporary;
    if (name[0] == '\0')
        return RX_OK;
    file->name = name;
    rx_status status = rx_outputs_file(job->outputs, name, &temporary, err);
    return status == RX_OK ? rx_fits_create(temporary, name, &file->writer, err) : status;
}

static rx_status open_outputs(job *job, rx_error *err)
{
    const rx_simulate_config *config = job->config;
    RX_TRY(rx_outputs_new(&job->outputs, err));
    RX_TRY(open_image(job, config->image_name, &job->image, err));
    RX_TRY(open_image(job, config->sharp_name, &job->sharp, err));
    RX_TRY(open_image(job, config->flag_name, &job->flags, err));
    RX_TRY(open_image(job, config->weight_name, &job->weight, err));
    if (config->truth_name[0] != '\0')
        RX_TRY(rx_outputs_file(job->outputs, config->truth_name, &job->truth_temporary, err));
    return RX_OK;
}

static rx_status write_plane(const image_file *file, const float *pixels, const rx_tile *tile,
                             const rx_text *extra, rx_error *err)
{
    rx_fits_plane plane = rx_fits_plane_of(tile);
    plane.floats = pixels;
    return rx_fits_image(file->writer, &plane, extra, err);
}

/* Masked pixels of a file that were no numbers are none again. */
static rx_status write_image(const job *job, const field_data *data, const rx_text *extra, rx_error *err)
{
    const rx_tile *tile = data->tile;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    float *pixels;
    RX_TRY(RX_MAKE(pixels, n, err));
    for (size_t i = 0; i < n; i++)
        pixels[i] = tile->mask[i] & RX_MASK_BAD ? NAN : tile->pixels[i];
    rx_status status = write_plane(&job->image, pixels, tile, extra, err);
    free(pixels);
    return status;
}

static rx_status write_flags(const job *job, const field_data *data, const rx_text *extra, rx_error *err)
{
    const rx_tile *tile = data->tile;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    int32_t *flags;
    RX_TRY(RX_MAKE(flags, n, err));
    for (size_t i = 0; i < n; i++)
        flags[i] = data->defects[i];
    rx_fits_plane plane = rx_fits_plane_of(tile);
    plane.integers = flags;
    rx_status status = rx_fits_image(job->flags.writer, &plane, extra, err);
    free(flags);
    return status;
}

static rx_status add_truth(job *job, const field_data *data, rx_error *err)
{
    rx_table *table = NULL;
    RX_TRY(RX_GROW(job->tables, (size_t)job->ntables + 1, err));
    RX_TRY(rx_truth_table(data->scene, data->tile->wcs, 0, &table, err));
    job->tables[job->ntables++] = table;
    rx_text facts = {0}, cards = {0};
    rx_text_add_bytes(&facts, data->facts->data, data->facts->length);
    rx_text_add_bytes(&cards, data->tile->cards, data->tile->ncards * 80);
    table->facts = facts.data;
    table->nfacts = (long)(facts.length / 80);
    table->cards = cards.data;
    table->ncards = (long)(cards.length / 80);
    return facts.failed || cards.failed ? rx_error_memory(err, 0) : RX_OK;
}

static void tell(const job *job, const field_data *data)
{
    const rx_scene *scene = data->scene;
    rx_log_info(job->log, "%s: %d x %d pixels, %ld stars, %ld galaxies, %ld template galaxies; %s%s",
                job->image.name, data->tile->width, data->tile->height, count(scene, RX_OBJECT_STAR),
                count(scene, RX_OBJECT_GALAXY), count(scene, RX_OBJECT_TEMPLATE),
                data->simulation->optics->description,
                data->simulation->coadd.type != RX_COADD_NONE ? " (of the frames, in their pixels)" : "");
    if (scene->shrunk > 0)
        rx_log_info(job->log,
                    "%s: %ld template galaxies are smaller than their magnitude asks for, or their own PSF "
                    "would show",
                    job->image.name, scene->shrunk);
    if (scene->left_out > 0)
        rx_log_warning(job->log, "%s: %ld objects found no place and are left out", job->image.name,
                       scene->left_out);
}

static rx_status write_field(job *job, const field_data *data, rx_error *err)
{
    const rx_tile *tile = data->tile;
    rx_text extra = {0};
    rx_status status = RX_OK;
    rx_text_add_bytes(&extra, data->facts->data, data->facts->length);
    rx_record_cards(&job->record, &extra);
    if (extra.failed)
        RX_TRY_EXIT(rx_error_memory(err, extra.length));
    RX_TRY_EXIT(write_image(job, data, &extra, err));
    if (job->sharp.writer != NULL)
        RX_TRY_EXIT(write_plane(&job->sharp, data->sharp, tile, &extra, err));
    if (job->weight.writer != NULL)
        RX_TRY_EXIT(write_plane(&job->weight, data->weight, tile, &extra, err));
    if (job->flags.writer != NULL)
        RX_TRY_EXIT(write_flags(job, data, &extra, err));
    if (job->truth_temporary != NULL)
        RX_TRY_EXIT(add_truth(job, data, err));
    tell(job, data);
exit:
    rx_text_free(&extra);
    return status;
}

static rx_catalog_type truth_type(const char *word)
{
    return strcmp(word, "ASCII_HEAD") == 0      ? RX_CATALOG_ASCII_HEAD
           : strcmp(word, "ASCII_VOTABLE") == 0 ? RX_CATALOG_VOTABLE
           : strcmp(word, "FITS_LDAC") == 0     ? RX_CATALOG_FITS_LDAC
                                                : RX_CATALOG_FITS_1_0;
}

static rx_status write_truth(const job *job, rx_error *err)
{
    const rx_record *record = &job->record;
    if (job->truth_temporary == NULL)
        return RX_OK;
    rx_record_pair *pairs;
    RX_TRY(RX_MAKE(pairs, (size_t)record->n, err));
    for (int i = 0; i < record->n; i++)
        pairs[i] = (rx_record_pair){record->pairs[i][0], record->pairs[i][1], record->pairs[i][2]};
    const rx_catalog catalog = {.type = truth_type(job->config->truth_type),
                                .n = job->ntables,
                                .tables = job->tables,
                                .npairs = record->n,
                                .record = pairs};
    rx_status status = rx_catalog_write(&catalog, job->config->truth_name, job->truth_temporary, NULL, err);
    free(pairs);
    return status;
}

static rx_status close_image(image_file *file, rx_error *err)
{
    rx_fits_writer *writer = file->writer;
    file->writer = NULL;
    return writer != NULL ? rx_fits_close(writer, err) : RX_OK;
}

static rx_status finish(job *job, rx_error *err)
{
    RX_TRY(close_image(&job->image, err));
    RX_TRY(close_image(&job->sharp, err));
    RX_TRY(close_image(&job->flags, err));
    RX_TRY(close_image(&job->weight, err));
    RX_TRY(write_truth(job, err));
    RX_TRY(rx_interrupt_check(err));
    RX_TRY(rx_outputs_commit(job->outputs, err));
    rx_outputs_log(job->outputs, NULL, job->log);
    return RX_OK;
}

/* --- a simulated field --- */

static rx_status run_field(job *job, rx_error *err)
{
    rx_simulation *simulation = NULL;
    rx_simulated simulated = {0};
    rx_tile *tile = NULL;
    rx_text facts = {0};
    rx_status status;
    RX_TRY_EXIT(rx_simulation_from_config(job->config, job->log, &simulation, err));
    simulation->nthreads = rx_threads_had(job->config->nthreads, job->log);
    simulation->without_sharp = job->sharp.writer == NULL;
    RX_TRY_EXIT(rx_simulation_make(simulation, simulation->scene.stream, &simulated, err));
    RX_TRY_EXIT(rx_simulation_tile(simulation, &simulated, job->image.name, &tile, err));
    RX_TRY_EXIT(make_facts(simulation, &simulated, NULL, &facts, err));
    field_data data = {.simulation = simulation,
                       .scene = simulated.scene,
                       .tile = tile,
                       .sharp = simulated.sharp,
                       .weight = simulated.weight,
                       .defects = simulated.defects,
                       .facts = &facts};
    status = write_field(job, &data, err);
exit:
    rx_text_free(&facts);
    rx_tile_free(tile);
    rx_simulated_free(&simulated);
    rx_simulation_free(simulation);
    return status;
}

/* --- injection --- */

/* The tile's cards without what an earlier run of ours said of its own pixels. */
static void copy_cards(const rx_tile *tile, rx_text *cards)
{
    for (size_t i = 0; i < tile->ncards; i++) {
        const char *card = tile->cards + i * 80;
        if (strncmp(card, "RX", 2) != 0 && strncmp(card, "PROGRAM ", 8) != 0)
            rx_text_add_bytes(cards, card, 80);
    }
}

/* What the tile's reader took from elsewhere (primary header, configuration) goes with the pixels. */
static rx_status complete_cards(const rx_options *options, const rx_simulation *simulation, rx_tile *tile,
                                rx_error *err)
{
    const rx_tile_params *par = &options->tile[0];
    rx_text cards = {0};
    const long n = (long)tile->ncards;
    double value;
    copy_cards(tile, &cards);
    if (par->gain_key[0] != '\0' && !rx_cards_number(tile->cards, n, par->gain_key, &value))
        rx_card_number(&cards, par->gain_key, simulation->noise.gain, "e-/ADU, 0 = infinite");
    if (par->saturation_key[0] != '\0' && isfinite(tile->saturation) &&
        !rx_cards_number(tile->cards, n, par->saturation_key, &value))
        rx_card_number(&cards, par->saturation_key, tile->saturation, "ADU");
    if (cards.failed) {
        rx_text_free(&cards);
        return rx_error_memory(err, cards.length);
    }
    free(tile->cards);
    tile->cards = cards.data;
    tile->ncards = cards.length / 80;
    return RX_OK;
}

/* Pixels that the added light brought to the saturation level, as the flag map has them. */
static void mark_saturated(const rx_tile *tile, uint8_t *defects)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    for (size_t i = 0; i < n; i++)
        defects[i] = !(tile->mask[i] & RX_MASK_BAD) && (double)tile->pixels[i] >= tile->saturation
                         ? RX_DEFECT_SATURATED
                         : 0;
}

static rx_status inject_image(job *job, const rx_options *options, int hdu, int extension, rx_error *err)
{
    const rx_simulate_config *config = job->config;
    const int automatic = strcmp(config->psf_type, "AUTO") == 0;
    rx_field *field = NULL;
    rx_simulation *simulation = NULL;
    rx_scene *scene = NULL;
    rx_text facts = {0};
    float *sharp = NULL;
    uint8_t *defects = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_field_open(options, automatic ? RX_FIELD_PSF : 0,
                              &(rx_image_place){config->inject_image, hdu, extension}, job->log, &field,
                              err));
    RX_TRY_EXIT(rx_simulation_for_tile(config, options, field, job->log, &simulation, err));
    const size_t n = (size_t)field->tile->width * (size_t)field->tile->height;
    RX_TRY_EXIT(RX_MAKE(sharp, n, err));
    RX_TRY_EXIT(RX_MAKE(defects, n, err));
    /* images of one file are different skies */
    simulation->scene.stream += (uint64_t)(extension - 1) << 32;
    rx_tile_checksum(field->tile); /* is of the pixels as they are before the objects come */
    RX_TRY_EXIT(rx_simulation_inject(simulation, simulation->scene.stream, field->tile->pixels,
                                     job->sharp.writer != NULL ? sharp : NULL, &scene, err));
    RX_TRY_EXIT(make_facts(simulation, &(rx_simulated){.scene = scene, .noise = simulation->noise}, field,
                           &facts, err));
    RX_TRY_EXIT(complete_cards(options, simulation, field->tile, err));
    mark_saturated(field->tile, defects);
    field_data data = {.simulation = simulation,
                       .scene = scene,
                       .tile = field->tile,
                       .sharp = sharp,
                       .defects = defects,
                       .facts = &facts};
    status = write_field(job, &data, err);
exit:
    rx_text_free(&facts);
    free(sharp);
    free(defects);
    rx_scene_free(scene);
    rx_simulation_free(simulation);
    rx_field_free(field);
    return status;
}

/* The stage's own settings for reading and searching the tile. */
static rx_status read_stage_config(const job *job, rx_config **dst, rx_error *err)
{
    const rx_simulate_config *config = job->config;
    char threads[16];
    rx_config *stage = NULL;
    snprintf(threads, sizeof threads, "%d", config->nthreads);
    rx_status status;
    RX_TRY_EXIT(rx_config_new(&stage, err));
    if (config->inject_config[0] != '\0')
        RX_TRY_EXIT(rx_config_read(stage, config->inject_config, job->log, err));
    if (strcmp(config->psf_type, "AUTO") == 0)
        RX_TRY_EXIT(rx_config_set(stage, "PSF_TYPE", "AUTO", job->log, err));
    RX_TRY_EXIT(rx_config_set(stage, "NTHREADS", threads, job->log, err));
    RX_TRY_EXIT(rx_config_check(stage, err));
    RX_TRY_EXIT(
        rx_settings_check_inputs(&config->settings, (const rx_settings *)stage, config->inject_image, err));
    *dst = stage;
    stage = NULL;
exit:
    rx_config_free(stage);
    return status;
}

static rx_status run_injection(job *job, rx_error *err)
{
    int *hdus = NULL, n = 0;
    rx_config *stage = NULL;
    rx_options *options = NULL;
    rx_status status = read_stage_config(job, &stage, err);
    if (status == RX_OK)
        status = rx_options_from_config(stage, job->log, &options, err);
    if (status == RX_OK)
        status = rx_tile_list(job->config->inject_image, job->log, &hdus, &n, err);
    for (int i = 0; i < n && status == RX_OK; i++) {
        status = inject_image(job, options, hdus[i], i + 1, err);
        if (status == RX_OK)
            status = rx_interrupt_check(err);
    }
    free(hdus);
    rx_options_free(options);
    rx_config_free(stage);
    return status;
}

rx_status rx_simulation_run(const rx_simulate_config *config, rx_log *log, rx_error *err)
{
    job job = {.config = config, .log = log};
    rx_status status;
    RX_TRY_EXIT(record_run(&job, err));
    RX_TRY_EXIT(open_outputs(&job, err));
    RX_TRY_EXIT(config->inject_image[0] != '\0' ? run_injection(&job, err) : run_field(&job, err));
    status = finish(&job, err);
exit:
    rx_fits_abort(job.image.writer);
    rx_fits_abort(job.sharp.writer);
    rx_fits_abort(job.flags.writer);
    rx_fits_abort(job.weight.writer);
    for (int i = 0; i < job.ntables; i++)
        rx_table_free(job.tables[i]);
    free(job.tables);
    rx_outputs_free(job.outputs);
    rx_record_free(&job.record);
    return status;
}
