/* The simulator's job: settings, fields in memory and in files, injection into tiles. */
#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../near.h"
#include "../scratch.h"
#include "base/memory.h"
#include "catalog/catalog.h"
#include "detect/correlation.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "io/tile.h"
#include "io/wcs.h"
#include "pipeline/pipeline.h"
#include "restore/restore.h"
#include "simulate/inject.h"
#include "stage/open.h"
#include "stage/simulation.h"

/* Files in the current folder, which are removed when `remove` says so. */
static int files_here(int remove)
{
    int n = 0;
    DIR *dir = opendir(".");
    assert_non_null(dir);
    for (struct dirent *entry; (entry = readdir(dir)) != NULL;) {
        if (strcmp(entry->d_name, ".") == 0 || strcmp(entry->d_name, "..") == 0)
            continue;
        n++;
        if (remove)
            unlink(entry->d_name);
    }
    closedir(dir);
    return n;
}

/* --- shorthand --- */

typedef struct setting {
    const char *name, *value;
} setting;

static rx_simulate_config *configure(const setting *settings)
{
    static const setting common[] = {
        {"IMAGE_SIZE", "220,180"}, {"PSF_FWHM", "3.0"},     {"NTHREADS", "2"},
        {"STAR_COUNT", "700"},     {"STAR_MAG", "15,19"},   {"SKY_CENTER", "30,-40"},
        {"GALAXY_COUNT", "300"},   {"GALAXY_MAG", "17,20"}, {NULL, NULL}};
    rx_simulate_config *config = NULL;
    assert_int_equal(rx_simulate_config_new(&config, NULL), RX_OK);
    for (const setting *s = common; s->name != NULL; s++)
        assert_int_equal(rx_settings_set(&config->settings, s->name, s->value, NULL, NULL), RX_OK);
    for (const setting *s = settings; s != NULL && s->name != NULL; s++)
        assert_int_equal(rx_settings_set(&config->settings, s->name, s->value, NULL, NULL), RX_OK);
    return config;
}

static rx_simulation *simulation_of(const setting *settings)
{
    rx_error err = RX_ERROR_NONE;
    rx_simulation *simulation = NULL;
    rx_simulate_config *config = configure(settings);
    if (rx_simulation_from_config(config, NULL, &simulation, &err) != RX_OK)
        fail_msg("%s", err.text);
    rx_simulate_config_free(config);
    return simulation;
}

static rx_simulated make(const rx_simulation *simulation, uint64_t stream)
{
    rx_error err = RX_ERROR_NONE;
    rx_simulated simulated;
    if (rx_simulation_make(simulation, stream, &simulated, &err) != RX_OK)
        fail_msg("%s", err.text);
    return simulated;
}

static rx_status run(const setting *settings, rx_error *err)
{
    rx_simulate_config *config = configure(settings);
    rx_status status = rx_simulation_run(config, NULL, err);
    rx_simulate_config_free(config);
    return status;
}

static void expect_run(const setting *settings)
{
    rx_error err = RX_ERROR_NONE;
    if (run(settings, &err) != RX_OK)
        fail_msg("%s: %s", err.where, err.text);
}

static rx_tile *read_tile(const char *name, int hdu)
{
    static const rx_tile_params par = {.weight_threshold = NAN,
                                       .gain_key = "GAIN",
                                       .saturation = 50000.0,
                                       .saturation_key = "SATURATE",
                                       .zeropoint_key = "MAGZERO"};
    rx_error err = RX_ERROR_NONE;
    rx_tile *tile = NULL;
    if (rx_tile_read(&par, name, hdu, 1, NULL, &tile, &err) != RX_OK)
        fail_msg("%s: %s", err.where, err.text);
    return tile;
}

static rx_table *read_truth(const char *name, int index)
{
    rx_error err = RX_ERROR_NONE;
    rx_table *table = NULL;
    if (rx_catalog_read(name, index, &table, &err) != RX_OK)
        fail_msg("%s: %s", err.where, err.text);
    return table;
}

static double value(const rx_table *table, const char *column, long row)
{
    int k = rx_table_find(table, column);
    assert_true(k >= 0);
    return rx_column_value(&table->columns[k], row, 0);
}

/* --- settings --- */

static void keywords_become_values(void **state)
{
    static const setting settings[] = {{"PSF_FWHM", "2.5"},     {"PAIR_DISTANCE", "0.6,1.2"},
                                       {"LEAST_DISTANCE", "3"}, {"NOISE_TYPE", "CCD"},
                                       {"GAIN", "2"},           {"SATUR_LEVEL", "12345.678"},
                                       {"SCENE_NUMBER", "7"},   {"SEED", "5"},
                                       {"MAG_ZEROPOINT", "27"}, {NULL, NULL}};
    rx_simulation *s = simulation_of(settings);
    const double mpixels = (220.0 + 20.0) * (180.0 + 20.0) / 1e6; /* and 4 FWHM around the tile */
    assert_int_equal(s->scene.width, 220);
    assert_int_equal(s->scene.height, 180);
    assert_near(s->scene.stars.count, 700.0 * mpixels, 1e-6);
    assert_near(s->scene.galaxies.count, 300.0 * mpixels, 1e-6);
    assert_near(s->scene.pair_low, 0.6 * 2.5, 1e-6);
    assert_near(s->scene.pair_high, 1.2 * 2.5, 1e-6);
    assert_near(s->scene.least_distance, 7.5, 1e-6);
    assert_near(s->scene.zeropoint, 27.0, 1e-6);
    assert_true(s->scene.margin == 10.0); /* wings of what lies beyond the border reach the tile */
    assert_true(s->scene.stream == 7);
    assert_true(s->scene.seed == 5);
    assert_true(s->noise.seed == 5);
    assert_int_equal(s->noise.type, RX_NOISE_CCD);
    assert_true(s->noise.saturation == (double)12345.678f);
    assert_near(s->optics->fwhm, 2.5, 1e-6);
    assert_null(s->templates);
    rx_simulation_free(s);
}

/* --- fields in memory --- */

/* Exposed = clean + sky + noise of the width asked for; the sharp image holds the same light. */
static void noise_and_light(void **state)
{
    static const setting settings[] = {{"SKY_LEVEL", "500"}, {"NOISE_SIGMA", "8"}, {NULL, NULL}};
    rx_simulation *s = simulation_of(settings);
    rx_simulated field = make(s, 0);
    const size_t n = (size_t)field.width * (size_t)field.height;
    double sum = 0.0, squares = 0.0, clean = 0.0, sharp = 0.0;
    for (size_t i = 0; i < n; i++) {
        double d = (double)field.image[i] - field.clean[i];
        sum += d;
        squares += (d - 500.0) * (d - 500.0);
        clean += (double)field.clean[i];
        sharp += (double)field.sharp[i];
        assert_int_equal(field.defects[i], 0);
    }
    assert_near(sum / (double)n, 500.0, 4.0 * 8.0 / sqrt((double)n));
    assert_near(squares / (double)n, 64.0, 4.0 * 64.0 * sqrt(2.0 / (double)n));
    assert_true(field.scene->n > 20);
    /* what the borders cut differs between the two */
    assert_near(sharp / clean, 1.0, 0.005);
    rx_simulated_free(&field);
    rx_simulation_free(s);
}

static void assert_same_field(const rx_simulated *a, const rx_simulated *b)
{
    const size_t n = (size_t)a->width * (size_t)a->height;
    assert_memory_equal(a->image, b->image, n * sizeof(float));
    assert_memory_equal(a->clean, b->clean, n * sizeof(float));
    assert_memory_equal(a->defects, b->defects, n);
}

/* A scene of the series is what it is whatever is made before, with any number of threads, with or without
 * the sharp reference; another one is different in every respect. */
static void series(void **state)
{
    static const setting settings[] = {
        {"NOISE_TYPE", "CCD"},  {"GAIN", "2"},         {"SATUR_LEVEL", "1400"}, {"BAD_COLUMNS", "0.02"},
        {"COSMIC_RAYS", "300"}, {"CLUSTERING", "0.3"}, {"PAIR_SHARE", "0.3"},   {NULL, NULL}};
    rx_simulation *s = simulation_of(settings);
    rx_simulated first = make(s, 3), other = make(s, 4);
    const size_t n = (size_t)first.width * (size_t)first.height;
    size_t equal = 0, saturated = 0, columns = 0, hits = 0;
    for (size_t i = 0; i < n; i++) {
        equal += first.image[i] == other.image[i];
        saturated += (first.defects[i] & RX_DEFECT_SATURATED) != 0;
        columns += (first.defects[i] & RX_DEFECT_COLUMN) != 0;
        hits += (first.defects[i] & RX_DEFECT_COSMIC) != 0;
    }
    assert_true(saturated > 0);
    assert_true(hits > 5);
    assert_true(columns > 0);
    assert_true(columns % 180 == 0);
    assert_true(equal < n / 10);
    for (s->nthreads = 1; s->nthreads <= 3; s->nthreads++) {
        s->without_sharp = s->nthreads == 3;
        rx_simulated again = make(s, 3);
        assert_same_field(&first, &again);
        if (s->without_sharp)
            assert_null(again.sharp);
        else
            assert_memory_equal(first.sharp, again.sharp, n * sizeof(float));
        rx_simulated_free(&again);
    }
    rx_simulated_free(&first);
    rx_simulated_free(&other);
    rx_simulation_free(s);
}

/* --- files --- */

/* The tile in memory is the one that the stage reads from the file. */
static void file_and_memory(void **state)
{
    static const setting settings[] = {{"NOISE_TYPE", "CCD"},     {"GAIN", "2.5"},
                                       {"SATUR_LEVEL", "1400.1"}, {"BAD_COLUMNS", "0.02"},
                                       {"COSMIC_RAYS", "300"},    {"MAG_ZEROPOINT", "26"},
                                       {"IMAGE_NAME", "a.fits"},  {"TRUTH_NAME", "truth.fits"},
                                       {"SHARP_NAME", "s.fits"},  {"FLAG_NAME", "f.fits"},
                                       {"SCENE_NUMBER", "2"},     {NULL, NULL}};
    expect_run(settings);
    assert_int_equal(files_here(0), 4);
    rx_simulation *s = simulation_of(settings);
    rx_simulated field = make(s, 2);
    rx_tile *made = NULL, *read = read_tile("a.fits", 0);
    assert_int_equal(rx_simulation_tile(s, &field, "a.fits", &made, NULL), RX_OK);
    const size_t n = (size_t)made->width * (size_t)made->height;
    assert_string_equal(rx_tile_checksum(made), rx_tile_checksum(read));
    assert_string_equal(made->name, read->name);
    assert_int_equal(made->width, read->width);
    assert_int_equal(made->height, read->height);
    assert_memory_equal(made->pixels, read->pixels, n * sizeof(float));
    assert_memory_equal(made->mask, read->mask, n);
    assert_true(made->gain == read->gain);
    assert_true(made->gain == 2.5);
    assert_true(made->saturation == read->saturation);
    assert_true(made->saturation == (double)1400.1f);
    assert_true(made->zeropoint == read->zeropoint);
    assert_true(made->zeropoint == 26.0);
    assert_true(made->exptime == read->exptime);
    assert_near(made->pixel_scale, read->pixel_scale, 1e-9);
    assert_near(made->pixel_scale, 0.396, 1e-5);
    for (size_t i = 0; i < n; i++) {
        assert_int_equal((made->mask[i] & RX_MASK_BAD) != 0, (field.defects[i] & RX_DEFECT_COLUMN) != 0);
        if (!(made->mask[i] & RX_MASK_BAD))
            assert_int_equal((made->mask[i] & RX_MASK_SATURATED) != 0,
                             (field.defects[i] & RX_DEFECT_SATURATED) != 0);
    }
    double x = 109.5, y = 89.5, alpha, delta, alpha_made, delta_made;
    rx_wcs_to_sky(read->wcs, 1, &x, &y, &alpha, &delta);
    rx_wcs_to_sky(made->wcs, 1, &x, &y, &alpha_made, &delta_made);
    assert_near(alpha, 30.0, 1e-5);
    assert_near(delta, -40.0, 1e-5);
    assert_true(alpha == alpha_made);
    assert_true(delta == delta_made);
    float *sharp, *flags;
    int width, height;
    assert_int_equal(rx_fits_read_image("s.fits", &sharp, &width, &height, NULL), RX_OK);
    assert_memory_equal(sharp, field.sharp, n * sizeof(float));
    assert_int_equal(rx_fits_read_image("f.fits", &flags, &width, &height, NULL), RX_OK);
    for (size_t i = 0; i < n; i++)
        assert_true(flags[i] == (float)field.defects[i]);
    free(sharp);
    free(flags);
    rx_tile_free(made);
    rx_tile_free(read);
    rx_simulated_free(&field);
    rx_simulation_free(s);
}

/* Positions of the truth are on the WCS of the tile, magnitudes on its zero point; headers say what made
 * them. */
static void truth(void **state)
{
    static const char *const types[] = {"ASCII_HEAD", "ASCII_VOTABLE", "FITS_1.0", "FITS_LDAC"};
    for (size_t k = 0; k < sizeof types / sizeof *types; k++) {
        const setting settings[] = {
            {"TRUTH_TYPE", types[k]}, {"IMAGE_NAME", "a.fits"}, {"TRUTH_NAME", "t.cat"}, {NULL, NULL}};
        expect_run(settings);
        rx_tile *tile = read_tile("a.fits", 0);
        rx_table *table = read_truth("t.cat", 0);
        assert_true(table->nrows > 15);
        for (long row = 0; row < table->nrows; row++) {
            double x = value(table, "X_IMAGE", row) - 1.0, y = value(table, "Y_IMAGE", row) - 1.0, alpha,
                   delta;
            rx_wcs_to_sky(tile->wcs, 1, &x, &y, &alpha, &delta);
            assert_near(value(table, "ALPHA_J2000", row), alpha, 1e-6);
            assert_near(value(table, "DELTA_J2000", row), delta, 1e-6);
            assert_true(x >= -0.5);
            assert_true(x < 219.5);
            assert_true(y >= -0.5);
            assert_true(y < 179.5);
            assert_near(value(table, "MAG", row), 25.0 - 2.5 * log10(value(table, "FLUX", row)), 1e-3);
        }
        double sigma = 0.0, seed = 0.0;
        char keyword[80];
        if (k >= 2) {
            assert_true(rx_cards_number(table->cards, table->ncards, "RXSIGMA", &sigma));
            assert_true(rx_cards_number(table->cards, table->ncards, "RXSEED", &seed));
            assert_true(rx_cards_text(table->cards, table->ncards, "RXVERS", keyword, sizeof keyword));
            assert_near(sigma, 10.0, 1e-6);
            assert_near(seed, 1.0, 1e-6);
        }
        rx_table_free(table);
        rx_tile_free(tile);
        files_here(1);
    }
}

/* --- injection --- */

static const setting tile_settings[] = {{"IMAGE_NAME", "tile.fits"}, {"SEED", "77"},
                                        {"IMAGE_SIZE", "400,360"},   {"GAIN", "3"},
                                        {"NOISE_TYPE", "CCD"},       {"SATUR_LEVEL", "60000"},
                                        {"BAD_COLUMNS", "0.01"},     {"SKY_LEVEL", "100"},
                                        {"STAR_MAG", "15.5,20"},     {NULL, NULL}};

/* Flux that the truth tells = flux by which the tile grew; header and holes of the tile stay. */
static void adds_known_flux(void **state)
{
    static const setting settings[] = {{"IMAGE_NAME", "out.fits"},
                                       {"INJECT_IMAGE", "tile.fits"},
                                       {"STAR_COUNT", "300"},
                                       {"TRUTH_NAME", "truth.fits"},
                                       {"SHARP_NAME", "sharp.fits"},
                                       {"STAR_MAG", "18,19"},
                                       {"GALAXY_COUNT", "0"},
                                       {"FLAG_NAME", "flags.fits"},
                                       {"GAIN", "0"},
                                       {"NOISE_TYPE", "GAUSS"},
                                       {"SEED", "5"},
                                       {NULL, NULL}};
    expect_run(tile_settings);
    expect_run(settings);
    rx_tile *before = read_tile("tile.fits", 0), *after = read_tile("out.fits", 0);
    rx_table *table = read_truth("truth.fits", 0);
    const size_t n = (size_t)before->width * (size_t)before->height;
    double added = 0.0, light = 0.0, sharp_sum = 0.0;
    float *sharp;
    int width, height;
    assert_int_equal(rx_fits_read_image("sharp.fits", &sharp, &width, &height, NULL), RX_OK);
    for (size_t i = 0; i < n; i++) {
        assert_int_equal(before->mask[i] & RX_MASK_BAD, after->mask[i] & RX_MASK_BAD);
        if (!(before->mask[i] & RX_MASK_BAD))
            added += (double)after->pixels[i] - before->pixels[i];
        sharp_sum += (double)sharp[i];
    }
    assert_true(table->nrows >= 30);
    for (long row = 0; row < table->nrows; row++) {
        light += value(table, "FLUX", row);
        /* no object's centre on a hole */
        int x = (int)lround(value(table, "X_IMAGE", row)) - 1,
            y = (int)lround(value(table, "Y_IMAGE", row)) - 1;
        assert_int_equal(before->mask[(size_t)y * (size_t)before->width + (size_t)x] & RX_MASK_BAD, 0);
    }
    /* borders, dead columns and photon noise (sqrt(light / 3)) take their part */
    assert_near(added / light, 1.0, 0.03);
    assert_near(sharp_sum / light, 1.0, 0.02);
    assert_true(before->gain == after->gain);
    assert_true(before->saturation == after->saturation);
    assert_near(before->pixel_scale, after->pixel_scale, 1e-9);
    char text[80];
    assert_true(rx_cards_text(after->cards, (long)after->ncards, "RXINSUM", text, sizeof text));
    assert_string_equal(text, rx_tile_checksum(before));
    free(sharp);
    rx_table_free(table);
    rx_tile_free(before);
    rx_tile_free(after);
}

static void open_field(const char *name, rx_config **config, rx_options **options, rx_field **field)
{
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_config_new(config, NULL), RX_OK);
    if (rx_options_from_config(*config, NULL, options, &err) != RX_OK ||
        rx_field_open(*options, RX_FIELD_PSF, &(rx_image_place){name, 0, 1}, NULL, field, &err) != RX_OK)
        fail_msg("%s: %s", err.where, err.text);
}

/* PSF, gain and saturation are the tile's, the zero point what was set by hand, AWAY keeps its distance. */
static void settings_of_a_tile(void **state)
{
    static const setting settings[] = {{"INJECT_IMAGE", "tile.fits"},
                                       {"PSF_TYPE", "AUTO"},
                                       {"INJECT_PLACE", "AWAY"},
                                       {"STAR_COUNT", "400"},
                                       {"MAG_ZEROPOINT", "26.5"},
                                       {"GALAXY_COUNT", "0"},
                                       {NULL, NULL}};
    rx_config *config = NULL;
    rx_options *options = NULL;
    rx_field *field = NULL;
    rx_simulation *s = NULL;
    rx_error err = RX_ERROR_NONE;
    expect_run(tile_settings);
    open_field("tile.fits", &config, &options, &field);
    rx_simulate_config *ours = configure(settings);
    if (rx_simulation_for_tile(ours, options, field, NULL, &s, &err) != RX_OK)
        fail_msg("%s", err.text);
    assert_near(s->optics->fwhm, 3.0, 0.06);
    assert_true(s->noise.gain == 3.0);
    assert_true(s->noise.saturation == 60000.0);
    assert_true(s->scene.zeropoint == 26.5);
    assert_true(s->scene.width == 400);
    assert_true(s->scene.height == 360);
    rx_result result;
    rx_scene *scene = NULL;
    const size_t n = (size_t)400 * 360;
    float *pixels = RX_NEW(float, n);
    assert_int_equal(
        rx_field_extract(&options->pipeline, rx_restorer_find("NONE"), field, NULL, NULL, &result, NULL),
        RX_OK);
    assert_int_equal(rx_simulation_inject(s, 0, pixels, NULL, &scene, NULL), RX_OK);
    assert_true(scene->n > 10);
    for (long k = 0; k < scene->n; k++) {
        const rx_object *object = &scene->objects[k];
        for (size_t i = 0; i < n; i++) {
            double distance =
                hypot((double)(i % 400) - round(object->x), (double)(i / 400) - round(object->y));
            if (result.sources->segments[i] != 0)
                assert_true(distance > 4.0 * s->optics->fwhm);
        }
    }
    rx_result_free(&result);
    rx_scene_free(scene);
    free(pixels);
    rx_simulation_free(s);
    rx_simulate_config_free(ours);
    rx_field_free(field);
    rx_options_free(options);
    rx_config_free(config);
}

/* Every image of a file gets objects of its own; values that its images took from the primary header stay
 * known. */
static void several_images(void **state)
{
    static const setting settings[] = {{"IMAGE_NAME", "out.fits"},
                                       {"INJECT_IMAGE", "two.fits"},
                                       {"TRUTH_NAME", "truth.fits"},
                                       {"TRUTH_TYPE", "FITS_LDAC"},
                                       {NULL, NULL}};
    rx_fits_writer *writer = NULL;
    rx_text cards = {0};
    expect_run(tile_settings);
    rx_tile *tile = read_tile("tile.fits", 0);
    rx_card_number(&cards, "GAIN", 1.75, "");
    assert_int_equal(rx_fits_create("two.fits", "two.fits", &writer, NULL), RX_OK);
    assert_int_equal(rx_fits_image(writer,
                                   &(rx_fits_plane){.width = 400,
                                                    .height = 360,
                                                    .floats = tile->pixels,
                                                    .cards = cards.data,
                                                    .ncards = cards.length / 80},
                                   NULL, NULL),
                     RX_OK);
    assert_int_equal(
        rx_fits_image(
            writer,
            &(rx_fits_plane){.extname = "SECOND", .width = 400, .height = 360, .floats = tile->pixels}, NULL,
            NULL),
        RX_OK);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    expect_run(settings);
    rx_tile *first = read_tile("out.fits", 0), *second = read_tile("out.fits", 1);
    rx_table *truths[2] = {read_truth("truth.fits", 0), read_truth("truth.fits", 1)};
    assert_true(first->gain == 1.75);
    assert_true(second->gain == 1.75);
    assert_string_equal(second->extname, "SECOND");
    assert_true(memcmp(first->pixels, second->pixels, 400 * 360 * sizeof(float)) != 0);
    assert_true(value(truths[0], "X_IMAGE", 0) != value(truths[1], "X_IMAGE", 0));
    rx_table_free(truths[0]);
    rx_table_free(truths[1]);
    rx_tile_free(tile);
    rx_tile_free(first);
    rx_tile_free(second);
    rx_text_free(&cards);
}

/* --- noise of a real tile --- */

/* The SDSS frame's pixels are independent. Without the sources that were found and their surroundings; numpy,
 * with sep's background and sources (1.5 sigma, 5 pixels around them left out), has 0.008 at the next pixel
 * in x, 0.002 in y and 1.01 as width, once the floor of 0.009 is taken off that the faint sources leave at
 * all lags. */
static void noise_of_a_real_frame(void **state)
{
    const char *folder = getenv("RX_SHARED_DATA");
    char name[4096];
    rx_config *config = NULL;
    rx_options *options = NULL;
    rx_field *field = NULL;
    rx_result result;
    rx_noise_correlation noise;
    snprintf(name, sizeof name, "%s/sdss/94-1-12/frame-r-000094-1-0012.fits.bz2",
             folder != NULL ? folder : "");
    if (access(name, R_OK) != 0) {
        printf("# %s is absent: skipped\n", name);
        skip();
    }
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    assert_int_equal(rx_options_from_config(config, NULL, &options, NULL), RX_OK);
    if (rx_field_open(options, 0, &(rx_image_place){name, 0, 1}, NULL, &field, NULL) != RX_OK) {
        printf("# cfitsio without bzip2: skipped\n");
        rx_options_free(options);
        rx_config_free(config);
        skip();
    }
    const rx_tile *tile = field->tile;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    unsigned char *used = RX_NEW(unsigned char, n);
    assert_int_equal(
        rx_field_extract(&options->pipeline, rx_restorer_find("NONE"), field, NULL, NULL, &result, NULL),
        RX_OK);
    assert_int_equal(
        rx_inject_allowed(tile->width, tile->height, result.sources->segments, tile->mask, 5.0, used, NULL),
        RX_OK);
    const rx_image image = rx_field_observed(field);
    assert_int_equal(rx_correlation_measure(&image, used, 2, &noise, NULL), RX_OK);
    assert_false(noise.correlated);
    assert_true(noise.pixels > 400000);
    assert_near(noise.scale, 1.01, 0.02);
    free(used);
    rx_result_free(&result);
    rx_field_free(field);
    rx_options_free(options);
    rx_config_free(config);
}

int main(void)
{
#define HERE(test) cmocka_unit_test_setup_teardown(test, enter_scratch, leave_scratch)
    const struct CMUnitTest tests[] = {
        HERE(keywords_become_values), HERE(noise_and_light), HERE(series),
        HERE(file_and_memory),        HERE(truth),           HERE(adds_known_flux),
        HERE(settings_of_a_tile),     HERE(several_images),  cmocka_unit_test(noise_of_a_real_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
