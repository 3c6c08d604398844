/* The job on arrays gives what it gives on the file; files by the same keywords; what is refused. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "../pipeline/scene.h"
#include "../scratch.h"
#include "catalog/catalog.h"
#include "data/flags.h"
#include "io/tile.h"
#include "stage/job.h"
#include "template/template.h"

enum { WIDTH = 200, HEIGHT = 220 };

static const char *const columns[] = {"NUMBER",        "X_IMAGE",     "FLUX_AUTO",      "FLUX_APER(2)",
                                      "ALPHA_J2000",   "FLAGS",       "FLUX_TEMPLATE",  "FLUXERR_TEMPLATE",
                                      "FLAGS_RESTORE", "VIGNET(5,5)", "MASKED_FRACTION"};
enum { NCOLUMNS = sizeof columns / sizeof *columns };

/* A tile as a file, and the same as arrays with the file's header. */
typedef struct fixture {
    scene scene;
    rx_tile *read;
    rx_tile_arrays arrays;
} fixture;

static void open_fixture(fixture *f)
{
    rx_error err = RX_ERROR_NONE;
    scene_make(&f->scene, WIDTH, HEIGHT, 40, 5);
    scene_star(&f->scene, 100.0, 150.0, 1e6, 3.5); /* saturated */
    scene_write("tile.fits", f->scene.pixels, WIDTH, HEIGHT);
    const rx_tile_params par = {.gain = 1.0, .saturation = 5e4, .weight_threshold = NAN};
    if (rx_tile_read(&par, "tile.fits", 0, 1, NULL, &f->read, &err) != RX_OK)
        fail_msg("%s", err.text);
    f->arrays = (rx_tile_arrays){.width = WIDTH,
                                 .height = HEIGHT,
                                 .pixels = f->scene.pixels,
                                 .cards = f->read->cards,
                                 .ncards = f->read->ncards};
}

static void close_fixture(fixture *f)
{
    rx_tile_free(f->read);
    scene_free(&f->scene);
}

static const rx_job_setting settings[] = {
    {"RESTORE_TYPE", "RL"}, {"RL_NITER", "8"},         {"PHOT_APERTURES", "6,10"}, {"MAG_ZEROPOINT", "25"},
    {"PSF_TYPE", "MOFFAT"}, {"PSF_FWHM", "3.5"},       {"WEIGHT_TYPE", "NONE"},    {"VERBOSE_TYPE", "QUIET"},
    {"NTHREADS", "2"},      {"SELF_CHECK_COUNT", "60"}};
enum { NSETTINGS = sizeof settings / sizeof *settings, MORE = 4 };

/* The settings above and some more. */
static rx_job job_with(rx_job_setting dst[NSETTINGS + MORE], const rx_job_setting *more, int n)
{
    memcpy(dst, settings, sizeof settings);
    for (int i = 0; i < n; i++)
        dst[NSETTINGS + i] = more[i];
    return (rx_job){.settings = dst, .nsettings = NSETTINGS + n, .columns = columns, .ncolumns = NCOLUMNS};
}

static rx_status run(const rx_job *job, const rx_tile_arrays *arrays, rx_job_result *dst, rx_error *err)
{
    return rx_job_arrays(job, &(rx_job_images){.detect = arrays}, NULL, dst, err);
}

static void assert_same_table(const rx_table *a, const rx_table *b)
{
    assert_int_equal(a->nrows, b->nrows);
    assert_int_equal(a->ncolumns, b->ncolumns);
    for (int c = 0; c < a->ncolumns; c++) {
        const rx_column *one = &a->columns[c], *other = &b->columns[c];
        assert_string_equal(one->name, other->name);
        for (long row = 0; row < a->nrows; row++)
            for (long k = 0; k < rx_column_elements(one); k++) {
                const double x = rx_column_value(one, row, k), y = rx_column_value(other, row, k);
                if (!(x == y || (isnan(x) && isnan(y))))
                    fail_msg("%s of row %ld: %.17g, %.17g", one->name, row, x, y);
            }
    }
}

static void arrays_give_the_catalogue_of_the_file(void **state)
{
    static const rx_job_setting more[] = {
        {"CATALOG_NAME", "out.cat"}, {"CATALOG_TYPE", "FITS_1.0"}, {"PARAMETERS_NAME", "columns.param"}};
    rx_job_setting room[NSETTINGS + MORE];
    rx_error err = RX_ERROR_NONE;
    rx_job_result result;
    rx_table *written = NULL;
    fixture f;
    open_fixture(&f);
    FILE *param = fopen("columns.param", "w");
    assert_non_null(param);
    for (int i = 0; i < NCOLUMNS; i++)
        fprintf(param, "%s\n", columns[i]);
    fclose(param);
    rx_job job = job_with(room, more, 3);
    job.ncolumns = 0;
    if (rx_job_files(&job, "tile.fits", NULL, &err) != RX_OK)
        fail_msg("%s", err.text);
    assert_int_equal(rx_catalog_read("out.cat", 0, &written, NULL), RX_OK);
    assert_true(written->nrows > 30);
    job = job_with(room, NULL, 0);
    if (run(&job, &f.arrays, &result, &err) != RX_OK)
        fail_msg("%s", err.text);
    assert_same_table(result.table, written);
    assert_ptr_equal(result.detect->tile->pixels, f.scene.pixels); /* no copy */
    assert_string_equal(result.result.restored->name, "RL");
    assert_null(result.injected);
    rx_job_result_free(&result);
    rx_table_free(written);
    close_fixture(&f);
}

static void bad_pixels_and_masks_hide(void **state)
{
    rx_job_setting room[NSETTINGS + MORE];
    const rx_job job = job_with(room, NULL, 0);
    rx_error err = RX_ERROR_NONE;
    rx_job_result results[2];
    fixture f;
    open_fixture(&f);
    float *pixels = malloc(sizeof(float) * WIDTH * HEIGHT);
    uint8_t *mask = calloc(WIDTH, HEIGHT);
    assert_non_null(pixels);
    assert_non_null(mask);
    memcpy(pixels, f.scene.pixels, sizeof(float) * WIDTH * HEIGHT);
    for (int i = 20 * WIDTH + 30; i < 20 * WIDTH + 60; i++) {
        pixels[i] = NAN;
        mask[i] = 1;
    }
    rx_tile_arrays by_value = f.arrays, by_mask = f.arrays;
    by_value.pixels = pixels;
    by_mask.mask = mask;
    assert_int_equal(run(&job, &by_value, &results[0], &err), RX_OK);
    assert_int_equal(run(&job, &by_mask, &results[1], &err), RX_OK);
    assert_same_table(results[0].table, results[1].table);
    assert_true(isnan(pixels[20 * WIDTH + 30])); /* the caller's stay as they are */
    assert_false(results[0].detect->tile->lent);
    assert_true(results[1].detect->tile->lent);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        pixels[i] = NAN;
    rx_job_result none;
    assert_int_equal(run(&job, &by_value, &none, &err), RX_INPUT);
    assert_null(none.options);
    memset(mask, 1, WIDTH * HEIGHT);
    assert_int_equal(run(&job, &by_mask, &none, &err), RX_INPUT);
    for (int i = 0; i < 2; i++)
        rx_job_result_free(&results[i]);
    free(mask);
    free(pixels);
    close_fixture(&f);
}

static void weights_count_as_those_of_a_file(void **state)
{
    static const rx_job_setting mapped[] = {{"WEIGHT_TYPE", "MAP_WEIGHT"}};
    rx_job_setting room[NSETTINGS + MORE];
    rx_error err = RX_ERROR_NONE;
    rx_job_result result;
    fixture f;
    open_fixture(&f);
    for (int i = 0; i < 50 * WIDTH; i++)
        f.scene.weights[i] = i % 2 ? NAN : 0.0f;
    rx_tile_arrays arrays = f.arrays;
    arrays.weight = f.scene.weights;
    rx_job job = job_with(room, NULL, 0);
    assert_int_equal(run(&job, &arrays, &result, &err), RX_USAGE); /* WEIGHT_TYPE NONE */
    assert_non_null(strstr(err.text, "WEIGHT_TYPE"));
    assert_null(result.options);
    job = job_with(room, mapped, 1);
    assert_int_equal(run(&job, &f.arrays, &result, &err), RX_USAGE); /* no map */
    assert_null(result.options);
    assert_int_equal(run(&job, &arrays, &result, &err), RX_OK);
    assert_int_equal(result.detect->tile->mask[10], RX_MASK_WEIGHT);
    assert_int_equal(result.detect->tile->mask[60 * WIDTH], 0);
    rx_job_result_free(&result);
    close_fixture(&f);
}

static void a_psf_by_itself_and_again(void **state)
{
    rx_job_setting room[NSETTINGS + MORE];
    rx_job job = job_with(room, NULL, 0);
    rx_error err = RX_ERROR_NONE;
    rx_job_result first, again, stamped;
    fixture f;
    open_fixture(&f);
    job.psf_only = true;
    assert_int_equal(run(&job, &f.arrays, &first, &err), RX_OK);
    assert_null(first.table);
    assert_null(first.result.restored);
    const rx_psf *psf = first.detect->psf;
    assert_near(psf->fwhm, 3.5, 0.01);
    const rx_psf_pixels stamp = {psf->size, psf->size, psf->basis};
    job.psf_only = false;
    assert_int_equal(
        rx_job_arrays(&job, &(rx_job_images){.detect = &f.arrays, .psf = {psf}}, NULL, &again, &err), RX_OK);
    assert_int_equal(rx_job_arrays(&job, &(rx_job_images){.detect = &f.arrays, .image_of_psf = {&stamp}},
                                   NULL, &stamped, &err),
                     RX_OK);
    assert_near(stamped.detect->psf->fwhm, 3.5, 0.01);
    assert_int_equal(stamped.table->nrows, again.table->nrows);
    rx_job_result_free(&first);
    rx_job_result_free(&again);
    rx_job_result_free(&stamped);
    close_fixture(&f);
}

static void a_self_check_lists_what_it_injected(void **state)
{
    static const rx_job_setting checked[] = {{"SELF_CHECK", "Y"}};
    rx_job_setting room[NSETTINGS + MORE];
    const rx_job job = job_with(room, checked, 1);
    rx_error err = RX_ERROR_NONE;
    rx_job_result result;
    fixture f;
    open_fixture(&f);
    if (run(&job, &f.arrays, &result, &err) != RX_OK)
        fail_msg("%s", err.text);
    assert_non_null(result.injected);
    long found = 0, injected = 0, stated = 0;
    const rx_column *c = result.injected->columns;
    for (long i = 0; i < result.injected->nrows; i++) {
        found += rx_column_value(&c[rx_table_find(result.injected, "FOUND")], i, 0) > 0;
        assert_between(rx_column_value(&c[rx_table_find(result.injected, "X_IMAGE")], i, 0), 0.5,
                       WIDTH + 0.5);
        assert_between(rx_column_value(&c[rx_table_find(result.injected, "Y_IMAGE")], i, 0), 0.5,
                       HEIGHT + 0.5);
    }
    for (int i = 0; i < result.facts.n; i++) {
        injected = strcmp(result.facts.pairs[i][0], "RXSCN") == 0 ? atol(result.facts.pairs[i][1]) : injected;
        stated = strcmp(result.facts.pairs[i][0], "RXSCFND") == 0 ? atol(result.facts.pairs[i][1]) : stated;
    }
    assert_int_equal(result.injected->nrows, 60);
    assert_int_equal(injected, 60);
    assert_int_equal(found, stated);
    assert_between((double)found, 5.0, 59.0);
    rx_job_result_free(&result);
    close_fixture(&f);
}

static void what_is_for_files_is_refused(void **state)
{
    static const struct {
        rx_job_setting setting;
        const char *said;
    } cases[] = {
        {{"WEIGHT_IMAGE", "w.fits"}, "WEIGHT_IMAGE"}, {{"REFERENCE_NAME", "truth.fits"}, "REFERENCE_NAME"},
        {{"RECORD_NAME", "r.json"}, "RECORD_NAME"},   {{"RESTORE_TYPE", "NONE,RL"}, "once for each"},
        {{"DETECT_TRESH", "3"}, "DETECT_THRESH"},     {{"DETECT_THRESH", "many"}, "DETECT_THRESH"}};
    rx_job_setting room[NSETTINGS + MORE];
    fixture f;
    open_fixture(&f);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const rx_job job = job_with(room, &cases[i].setting, 1);
        rx_error err = RX_ERROR_NONE;
        rx_job_result result;
        assert_int_equal(run(&job, &f.arrays, &result, &err), RX_USAGE);
        assert_non_null(strstr(err.text, cases[i].said));
        assert_null(result.options);
    }
    rx_job job = job_with(room, NULL, 0);
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_job_files(&job, "tile.fits", NULL, &err), RX_USAGE); /* columns */
    job.ncolumns = 0;
    assert_int_equal(rx_job_files(&job, "@list", NULL, &err), RX_USAGE);
    assert_int_equal(rx_job_files(&job, "none.fits", NULL, &err), RX_INPUT);
    assert_string_equal(err.where, "none.fits");
    job = job_with(room, &(rx_job_setting){"RECORD_NAME", "r.json"}, 1);
    job.ncolumns = 0;
    assert_int_equal(rx_job_files(&job, "tile.fits", NULL, &err), RX_USAGE);
    static const char *const odd[] = {"FLUX_AUTO", "MAG_DISK"};
    job = job_with(room, NULL, 0);
    job.columns = odd;
    job.ncolumns = 2;
    rx_job_result result;
    assert_int_equal(run(&job, &f.arrays, &result, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "MAG_DISK"));
    assert_null(result.options);
    close_fixture(&f);
}

/* Each bit of a column once, and those that other headers name by number. */
static void every_flag_has_a_name(void **state)
{
    static const int fitted[] = {RX_TPHOT_GROUP_CUT, RX_TPHOT_BORDER,  RX_TPHOT_MASKED,   RX_TPHOT_BOUND,
                                 RX_TPHOT_SINGULAR,  RX_TPHOT_NO_DATA, RX_TPHOT_POSITION, RX_TPHOT_EXTRA};
    int n, k = 0;
    const rx_flag *flags = rx_flags(&n);
    for (int i = 0; i < n; i++) {
        const int first = i == 0 || strcmp(flags[i].column, flags[i - 1].column) != 0;
        assert_int_equal(flags[i].bit, first ? 1 : 2 * flags[i - 1].bit);
        if (strcmp(flags[i].column, "FLAGS_TEMPLATE") == 0)
            assert_int_equal(flags[i].bit, fitted[k++]);
    }
    assert_int_equal(k, 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(arrays_give_the_catalogue_of_the_file, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(bad_pixels_and_masks_hide, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(weights_count_as_those_of_a_file, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(a_psf_by_itself_and_again, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(a_self_check_lists_what_it_injected, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(what_is_for_files_is_refused, enter_scratch, leave_scratch),
        cmocka_unit_test(every_flag_has_a_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
