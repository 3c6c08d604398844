/* The job of rextract-simulate: fields, or every image of a tile with objects added, to files. */
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
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "io/output.h"
#include "io/tile.h"
#include "pipeline/pipeline.h"
#include "restore/restore.h"
#include "simulate/inject.h"
#include "simulate/truth.h"
#include "stage/listed_objects.h"
#include "stage/open.h"
#include "stage/provenance.h"

/* --- what a real tile says of the objects that are added --- */

/* MAG_ZEROPOINT where it was set by hand, else what the tile states (0, the stage's default, states nothing). */
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

rx_status rx_simulation_for_tile(const rx_simulate_config *config, const rx_options *options,
                                 const rx_field *field, rx_log *log, rx_simulation **dst, rx_error *err)
{
    const rx_tile *tile = field->tile;
    const int automatic = strcmp(config->psf_type, "AUTO") == 0;
    rx_simulation *simulation = NULL;
    /* a PSF that was only stated would pass for the tile's own */
    if (automatic && (field->psf == NULL || field->psf->type != RX_PSF_AUTO))
        return rx_error_at(
            err, RX_INPUT, tile->name, tile->hdu, 0,
            "too few stars to measure the PSF; give -PSF_TYPE MOFFAT -PSF_FWHM <pixels>, or a PSF file");
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
    rx_status status = config->catalog_name[0] != '\0'
                           ? rx_listed_objects(config->catalog_name, tile->wcs, simulation, err)
                           : RX_OK;
    simulation->noise.type = RX_NOISE_NONE;
    simulation->noise.sky = simulation->noise.sigma = 0.0;
    simulation->noise.gain = tile->gain > 0.0 ? tile->gain : config->gain;
    if (!(simulation->noise.gain > 0.0))
        rx_log_warning(log, "%s[%d]: no gain is known; the added light brings no photon noise (give GAIN)",
                       tile->name, tile->hdu);
    simulation->noise.saturation = tile->saturation;
    if (status == RX_OK)
        status = allow(config, options, field, simulation->optics->fwhm, log, &simulation->allowed, err);
    if (status == RX_OK)
        *dst = simulation;
    else
        rx_simulation_free(simulation);
    return status;
}

/* --- the job --- */

enum { IMAGE, SHARP, FLAGS, WEIGHT, NFILES };

typedef struct job {
    const rx_simulate_config *config;
    rx_log *log;
    rx_outputs *outputs;
    rx_fits_writer *file[NFILES]; /* NULL where it is not wanted */
    const char *truth_temporary;  /* NULL without truth catalogue */
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
    const bool failed = facts.failed;
    if (!failed)
        rx_record_cards(&facts, cards);
    rx_record_free(&facts);
    return failed || cards->failed ? rx_error_memory(err, cards->length) : RX_OK;
}

/* --- outputs --- */

static rx_status open_outputs(job *job, rx_error *err)
{
    const rx_simulate_config *config = job->config;
    const char *const names[NFILES] = {config->image_name, config->sharp_name, config->flag_name,
                                       config->weight_name};
    const char *temporary;
    RX_TRY(rx_outputs_new(&job->outputs, err));
    for (int k = 0; k < NFILES; k++) {
        if (names[k][0] == '\0')
            continue;
        RX_TRY(rx_outputs_file(job->outputs, names[k], &temporary, err));
        RX_TRY(rx_fits_create(temporary, names[k], &job->file[k], err));
    }
    if (config->truth_name[0] != '\0')
        RX_TRY(rx_outputs_file(job->outputs, config->truth_name, &job->truth_temporary, err));
    return RX_OK;
}

/* Floats or integers of the shape of the tile. */
static rx_status write_plane(rx_fits_writer *writer, const float *floats, const int32_t *integers,
                             const rx_tile *tile, const rx_text *extra, rx_error *err)
{
    rx_fits_plane plane = rx_fits_plane_of(tile);
    plane.floats = floats;
    plane.integers = integers;
    return rx_fits_image(writer, &plane, extra, err);
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
    rx_status status = write_plane(job->file[IMAGE], pixels, NULL, tile, extra, err);
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
    rx_status status = write_plane(job->file[FLAGS], NULL, flags, tile, extra, err);
    free(flags);
    return status;
}

static rx_status add_truth(job *job, const field_data *data, rx_error *err)
{
    rx_table *table = NULL;
    rx_text facts = {0};
    RX_TRY(RX_GROW(job->tables, (size_t)job->ntables + 1, err));
    RX_TRY(rx_truth_table(data->scene, data->tile->wcs, 0, &table, err));
    job->tables[job->ntables++] = table;
    rx_text_add_bytes(&facts, data->facts->data, data->facts->length);
    table->facts = facts.data;
    table->nfacts = (long)(facts.length / RX_CARD);
    return facts.failed ? rx_error_memory(err, 0)
                        : rx_table_copy_cards(table, data->tile->cards, data->tile->ncards, err);
}

static void tell(const job *job, const field_data *data)
{
    const rx_scene *scene = data->scene;
    rx_log_info(job->log, "%s: %d x %d pixels, %ld stars, %ld galaxies, %ld template galaxies; %s%s",
                job->config->image_name, data->tile->width, data->tile->height, count(scene, RX_OBJECT_STAR),
                count(scene, RX_OBJECT_GALAXY), count(scene, RX_OBJECT_TEMPLATE),
                data->simulation->optics->description,
                data->simulation->coadd.type != RX_COADD_NONE ? " (of the frames, in their pixels)" : "");
    if (scene->shrunk > 0)
        rx_log_info(job->log,
                    "%s: %ld template galaxies are smaller than their magnitude asks for, or their own PSF "
                    "would show",
                    job->config->image_name, scene->shrunk);
    if (scene->left_out > 0)
        rx_log_warning(job->log, "%s: %ld objects found no place and are left out", job->config->image_name,
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
    if (job->file[SHARP] != NULL)
        RX_TRY_EXIT(write_plane(job->file[SHARP], data->sharp, NULL, tile, &extra, err));
    if (job->file[WEIGHT] != NULL)
        RX_TRY_EXIT(write_plane(job->file[WEIGHT], data->weight, NULL, tile, &extra, err));
    if (job->file[FLAGS] != NULL)
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

static rx_status finish(job *job, rx_error *err)
{
    for (int k = 0; k < NFILES; k++) {
        rx_fits_writer *writer = job->file[k];
        job->file[k] = NULL;
        RX_TRY(rx_fits_close(writer, err));
    }
    const rx_catalog truth = {.type = truth_type(job->config->truth_type),
                              .n = job->ntables,
                              .tables = job->tables,
                              .record = &job->record};
    if (job->truth_temporary != NULL)
        RX_TRY(rx_catalog_write(&truth, job->config->truth_name, job->truth_temporary, NULL, err));
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
    simulation->without_sharp = job->file[SHARP] == NULL;
    if (job->config->catalog_name[0] != '\0')
        RX_TRY_EXIT(rx_listed_objects(job->config->catalog_name, NULL, simulation, err));
    RX_TRY_EXIT(rx_simulation_make(simulation, simulation->scene.stream, &simulated, err));
    RX_TRY_EXIT(rx_simulation_tile(simulation, &simulated, job->config->image_name, &tile, err));
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

/* What an earlier run of ours said of its own pixels goes; what the tile's reader took from elsewhere (primary header, configuration) goes with
 * the pixels. */
static rx_status complete_cards(const rx_options *options, const rx_simulation *simulation, rx_tile *tile,
                                rx_error *err)
{
    const rx_tile_params *par = &options->tile[0];
    rx_text cards = {0};
    const long n = (long)tile->ncards;
    double value;
    for (const char *card = tile->cards; card < tile->cards + tile->ncards * RX_CARD; card += RX_CARD)
        if (strncmp(card, "RX", 2) != 0 && strncmp(card, "PROGRAM ", 8) != 0)
            rx_text_add_bytes(&cards, card, RX_CARD);
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
                                     job->file[SHARP] != NULL ? sharp : NULL, &scene, err));
    RX_TRY_EXIT(make_facts(simulation, &(rx_simulated){.scene = scene, .noise = simulation->noise}, field,
                           &facts, err));
    RX_TRY_EXIT(complete_cards(options, simulation, field->tile, err));
    for (size_t i = 0; i < n; i++) /* what the added light brought to the saturation level */
        if (!(field->tile->mask[i] & RX_MASK_BAD) &&
            (double)field->tile->pixels[i] >= field->tile->saturation)
            defects[i] = RX_DEFECT_SATURATED;
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
        RX_TRY_EXIT(rx_settings_read(&stage->settings, config->inject_config, job->log, err));
    if (strcmp(config->psf_type, "AUTO") == 0)
        RX_TRY_EXIT(rx_settings_set(&stage->settings, "PSF_TYPE", "AUTO", job->log, err));
    RX_TRY_EXIT(rx_settings_set(&stage->settings, "NTHREADS", threads, job->log, err));
    RX_TRY_EXIT(rx_settings_check(&stage->settings, err));
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
    rx_status status;
    RX_TRY_EXIT(read_stage_config(job, &stage, err));
    RX_TRY_EXIT(rx_options_from_config(stage, job->log, &options, err));
    RX_TRY_EXIT(rx_tile_list(job->config->inject_image, job->log, &hdus, &n, err));
    for (int i = 0; i < n; i++) {
        RX_TRY_EXIT(inject_image(job, options, hdus[i], i + 1, err));
        RX_TRY_EXIT(rx_interrupt_check(err));
    }
exit:
    free(hdus);
    rx_options_free(options);
    rx_config_free(stage);
    return status;
}

rx_status rx_simulation_run(const rx_simulate_config *config, rx_log *log, rx_error *err)
{
    job job = {.config = config, .log = log};
    rx_status status;
    rx_record_add(&job.record, "PROGRAM", "made by", "rextract-simulate");
    rx_record_add(&job.record, "RXVERS", "version of rextract", "%s", RX_VERSION);
    if (!rx_settings_visit(&config->settings, false, add_keyword, &job.record) || job.record.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(open_outputs(&job, err));
    RX_TRY_EXIT(config->inject_image[0] != '\0' ? run_injection(&job, err) : run_field(&job, err));
    status = finish(&job, err);
exit:
    for (int k = 0; k < NFILES; k++)
        rx_fits_abort(job.file[k]);
    for (int i = 0; i < job.ntables; i++)
        rx_table_free(job.tables[i]);
    free(job.tables);
    rx_outputs_free(job.outputs);
    rx_record_free(&job.record);
    return status;
}
