/* Tiles of the photometry campaign: stars that are put in come out. */
#include "../near.h"
#include "settings.h"

#include <math.h>

#include "lab/sources.h"
#include "num/stats.h"
#include "pipeline/pipeline.h"

/* Bright stars, S/N 200 and more, on an otherwise empty field. */
static const char *const BRIGHT[] = {
    "SIM.IMAGE_SIZE", "256", "SIM.STAR_COUNT", "0",   "SIM.GALAXY_COUNT", "0",  "MAGNITUDES", "14.5,14.5,1",
    "TILES",          "2",   "STARS_PER_TILE", "120", "STAGE.RL_NITER",   "10", NULL};
/* The same, MAG_AUTO beside template photometry. */
static const char *const TEMPLATES[] = {"SIM.IMAGE_SIZE",
                                        "256",
                                        "SIM.STAR_COUNT",
                                        "0",
                                        "SIM.GALAXY_COUNT",
                                        "0",
                                        "MAGNITUDES",
                                        "14.5,14.5,1",
                                        "TILES",
                                        "1",
                                        "STARS_PER_TILE",
                                        "120",
                                        "STAGE.RL_NITER",
                                        "10",
                                        "FLUXES",
                                        "AUTO,TEMPLATE",
                                        NULL};
/* The sky of the defaults, and stars that no image shows. */
static const char *const FAINT[] = {"SIM.IMAGE_SIZE", "256", "MAGNITUDES", "24,26,2", "TILES", "2",
                                    "STAGE.RL_NITER", "10",  NULL};

/* Sum of P^2 of a Moffat profile that is not integrated over pixels: (beta - 1)^2 / (pi alpha^2 (2 beta -
 * 1)).
 */
static double moffat_power(double fwhm, double beta)
{
    const double alpha = 0.5 * fwhm / sqrt(exp2(1.0 / beta) - 1.0);
    return (beta - 1) * (beta - 1) / (3.14159265358979 * alpha * alpha * (2 * beta - 1));
}

static long nfalse_of(const rx_lab_table *table, int run)
{
    long n = 0;
    for (long i = 0; i < table[RX_SOURCES_FALSE].n; i++)
        n += rx_lab_own(&table[RX_SOURCES_FALSE], i)[RX_FALSE_RUN] == run;
    return n;
}

/* Every star is found with its flux, and nothing else. */
static void check_bright(const rx_lab *campaign, const rx_lab_table *table, double lowest, double highest)
{
    const rx_lab_table *star = &table[RX_SOURCES_OBJECT];
    assert_true(star->n >= 6);
    for (int r = 0; r < campaign->nruns; r++) {
        double *ratios = calloc((size_t)star->n, sizeof *ratios);
        for (long i = 0; i < star->n; i++) {
            const double *v = rx_lab_each(star, i, r);
            assert_true(v[RX_FOUND_SCORE] > 20);
            ratios[i] = v[RX_FOUND_RATIO];
            /* the pull is the flux's difference in units of its error */
            assert_int_equal(v[RX_FOUND_RATIO] > 1, v[RX_FOUND_PULL] > 0);
        }
        assert_in_range((unsigned long)(1e6 * rx_median(ratios, (size_t)star->n)),
                        (unsigned long)(1e6 * lowest), (unsigned long)(1e6 * highest));
        free(ratios);
        assert_true(nfalse_of(table, r) <= 1);
    }
}

static void bright_stars_come_back(void **state)
{
    rx_campaign_config *config = make_settings(BRIGHT);
    rx_lab *campaign = open_lab(&rx_kind_photometry, config, 1);
    rx_unit_values *values = run_units(state, "bright", campaign, 1);
    assert_int_equal(campaign->nunits, 2);
    const double flux = pow(10.0, -0.4 * (14.5 - 25.0)), sigma = 10.0;
    for (long u = 0; u < 2; u++) {
        rx_lab_table table[RX_LAB_TABLES];
        tables_of(campaign, values, u, table);
        const double *tile = rx_lab_own(&table[RX_SOURCES_TILE], 0);
        /* MAG_AUTO holds 98 % of a star here; its Kron radius on restored pixels gives 3 % too much */
        check_bright(campaign, table, 0.95, 1.05);
        assert_near(tile[RX_TILE_MPIXELS], 1e-6 * 256 * 256, 1e-6);
        /* pixels widen the PSF of 4 pixels by 1.5 %: 3 % of the power; the noise is measured to 2 % */
        assert_near(tile[RX_TILE_SNR] / (flux * sqrt(moffat_power(4.0, 4.765)) / sigma), 0.985, 0.03);
        rx_lab_tables_free(RX_SOURCES_TABLES, table);
    }
    rx_unit_values_free(2, values);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* Every restorer has a run for each flux; the lists are the same, and templates have the star's flux to what
 * its S/N of 200 leaves, whatever was restored. */
static void templates_compete(void **state)
{
    rx_campaign_config *config = make_settings(TEMPLATES);
    rx_lab *campaign = open_lab(&rx_kind_photometry, config, 1);
    rx_unit_values *values = run_units(state, "templates", campaign, 1);
    rx_lab_table table[RX_LAB_TABLES];
    tables_of(campaign, values, 0, table);
    assert_int_equal(campaign->nruns, 4);
    for (int r = 0; r < campaign->nruns; r++) {
        assert_int_equal(campaign->run[r].templates, r % 2);
        assert_ptr_equal(campaign->run[r].restorer, campaign->run[r / 2 * 2].restorer);
        for (long i = 0; i < table[RX_SOURCES_OBJECT].n && r % 2; i++) {
            const double *before = rx_lab_each(&table[RX_SOURCES_OBJECT], i, r - 1),
                         *v = before + RX_SOURCES_FOUND_WIDTH;
            assert_near(v[RX_FOUND_SCORE], before[RX_FOUND_SCORE], 0);
            assert_near(v[RX_FOUND_RATIO], 1, 0.015);
            assert_true(v[RX_FOUND_RATIO] != before[RX_FOUND_RATIO]);
        }
    }
    rx_lab_tables_free(RX_SOURCES_TABLES, table);
    rx_unit_values_free(campaign->nunits, values);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* Stars are apart, inside, and on other places on each tile; all restorers meet the same ones. */
static void stars_are_apart(void **state)
{
    (void)state;
    rx_campaign_config *config = make_settings(BRIGHT);
    rx_lab *campaign = open_lab(&rx_kind_photometry, config, 1);
    rx_lab_tile tile[3];
    for (int t = 0; t < 3; t++)
        assert_int_equal(rx_photometry_tile(campaign, &(rx_lab_unit){0, 0, t % 2}, &tile[t], NULL), RX_OK);
    const rx_lab_object *one = tile[0].objects.list, *other = tile[1].objects.list;
    assert_true(tile[0].objects.n >= 6);
    for (long i = 0; i < tile[0].objects.n; i++) {
        assert_near(one[i].x, 127.5, 111.5);
        for (long k = 0; k < i; k++)
            assert_true(hypot(one[i].x - one[k].x, one[i].y - one[k].y) >= 24);
    }
    assert_true(one[0].x != other[0].x);
    assert_int_equal(tile[0].objects.n, tile[2].objects.n);
    for (long i = 0; i < tile[0].objects.n; i++) {
        assert_near(one[i].x, tile[2].objects.list[i].x, 0);
        assert_near(one[i].y, tile[2].objects.list[i].y, 0);
    }
    assert_memory_equal(tile[0].field->tile->pixels, tile[2].field->tile->pixels, 256 * 256 * sizeof(float));
    for (int t = 0; t < 3; t++)
        rx_lab_tile_free(&tile[t]);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* Stars far below the noise are not found, and what is found of the sky itself is no false detection. */
static void others_are_neither(void **state)
{
    rx_campaign_config *config = make_settings(FAINT);
    rx_lab *campaign = open_lab(&rx_kind_photometry, config, 2);
    long found = 0, nfalse = 0;
    rx_unit_values *values = run_units(state, "faint1", campaign, 1);
    rx_unit_values *again = run_units(state, "faint2", campaign, 2);
    rx_unit_values *more = run_units(state, "faint3", campaign, 3);
    assert_int_equal(campaign->nunits, 4);
    assert_same_values(4, values, again);
    assert_same_values(4, values, more);
    for (long u = 0; u < 4; u++) {
        rx_lab_table table[RX_LAB_TABLES];
        tables_of(campaign, values, u, table);
        for (long i = 0; i < table[RX_SOURCES_OBJECT].n; i++)
            for (int r = 0; r < campaign->nruns; r++) {
                const double *v = rx_lab_each(&table[RX_SOURCES_OBJECT], i, r);
                found += isfinite(v[RX_FOUND_SCORE]);
                assert_int_equal(isfinite(v[RX_FOUND_SCORE]), isfinite(v[RX_FOUND_RATIO]));
            }
        nfalse += nfalse_of(table, 0);
        rx_lab_tables_free(RX_SOURCES_TABLES, table);
    }
    assert_true(found <= 1);
    assert_true(nfalse <= 2); /* NONE, on a quarter of a Mpixel with 160 stars and galaxies */
    rx_unit_values_free(4, values);
    rx_unit_values_free(4, again);
    rx_unit_values_free(4, more);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* The simulated tile of the tests stands for a real one. */
static void injected_stars_come_back(void **state)
{
    const char *top = getenv("srcdir");
    char tile[1024];
    snprintf(tile, sizeof tile, "%s/tests/data/sim.fits.fz", top != NULL ? top : ".");
    const char *const pairs[] = {
        "FIELDS",         "INJECTED",    "TILE_NAME", tile, "STAGE.MAG_ZEROPOINT", "25",
        "MAGNITUDES",     "14.5,14.5,1", "TILES",     "1",  "STARS_PER_TILE",      "60",
        "STAGE.RL_NITER", "10",          NULL};
    rx_campaign_config *config = make_settings(pairs);
    rx_lab *campaign = open_lab(&rx_kind_photometry, config, 2);
    rx_unit_values *values = run_units(state, "injected", campaign, 1);
    rx_lab_table table[RX_LAB_TABLES];
    assert_int_equal(campaign->nunits, 1);
    tables_of(campaign, values, 0, table);
    const long nstars = table[RX_SOURCES_OBJECT].n;
    assert_true(campaign->sky[0].known.n > 10);
    assert_non_null(campaign->sky[0].covered);
    for (int r = 0; r < campaign->nruns; r++) {
        long found = 0;
        double *ratios = calloc((size_t)nstars, sizeof *ratios);
        for (long i = 0; i < nstars; i++) {
            const double *v = rx_lab_each(&table[RX_SOURCES_OBJECT], i, r);
            if (isfinite(v[RX_FOUND_SCORE]))
                ratios[found++] = v[RX_FOUND_RATIO];
        }
        assert_true(found >= nstars - nstars / 10); /* some lie on brighter sources */
        assert_near(rx_median(ratios, (size_t)found), 1.0, 0.06);
        free(ratios);
        assert_true(nfalse_of(table, r) <= 3); /* what was there before is not false */
    }
    rx_lab_tables_free(RX_SOURCES_TABLES, table);
    rx_unit_values_free(1, values);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* At a low threshold the peaks of the noise on a real tile excuse themselves, for they were there before;
 * those on its blank twin do not, and they are as many as on any other realisation. */
static void noise_counts_on_real_tiles(void **state)
{
    const char *top = getenv("srcdir");
    char tile[1024];
    snprintf(tile, sizeof tile, "%s/tests/data/sim.fits.fz", top != NULL ? top : ".");
    const char *const pairs[] = {
        "RESTORE_TYPE",        "NONE", "FIELDS",     "INJECTED",    "TILE_NAME", tile,
        "STAGE.DETECT_THRESH", "0.7",  "MAGNITUDES", "14.5,14.5,1", "TILES",     "2",
        "STARS_PER_TILE",      "20",   NULL};
    rx_campaign_config *config = make_settings(pairs);
    rx_lab *campaign = open_lab(&rx_kind_photometry, config, 2);
    long nfalse[2];
    rx_unit_values *values = run_units(state, "blank", campaign, 2);
    assert_int_equal(campaign->nunits, 2);
    for (int unit = 0; unit < 2; unit++) {
        rx_lab_table table[RX_LAB_TABLES];
        rx_lab_tile tile;
        rx_result result;
        rx_error err = RX_ERROR_NONE;
        tables_of(campaign, values, unit, table);
        nfalse[unit] = nfalse_of(table, 0);
        rx_lab_tables_free(RX_SOURCES_TABLES, table);
        assert_int_equal(rx_photometry_tile(campaign, &campaign->unit[unit], &tile, &err), RX_OK);
        assert_int_equal(rx_field_extract(&campaign->options->pipeline, campaign->run[0].restorer, tile.blank,
                                          NULL, NULL, &result, &err),
                         RX_OK);
        assert_true(result.sources->n > 30);
        assert_in_range((unsigned long)nfalse[unit], (unsigned long)result.sources->n,
                        (unsigned long)result.sources->n + 40);
        rx_result_free(&result);
        rx_lab_tile_free(&tile);
    }
    assert_true(nfalse[0] != nfalse[1]); /* another realisation with every tile */
    rx_unit_values_free(2, values);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

static void settings_that_cannot_be(void **state)
{
    (void)state;
    static const char *const wrong[][5] = {
        {"FIELDS", "INJECTED", NULL, NULL, NULL},
        {"MAGNITUDES", "20,18,1", NULL, NULL, NULL},
        {"MAGNITUDES", "18,20,0", NULL, NULL, NULL},
        {"SIM.INJECT_IMAGE", "tile.fits", NULL, NULL, NULL},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        rx_error err = RX_ERROR_NONE;
        rx_lab *pointer = NULL;
        rx_campaign_config *config = make_settings(wrong[i]);
        assert_int_equal(rx_lab_open(&rx_kind_photometry, config, 1, NULL, &pointer, &err), RX_USAGE);
        assert_true(strlen(err.text) > 10);
        assert_null(pointer);
        rx_campaign_config_free(config);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bright_stars_come_back),   cmocka_unit_test(templates_compete),
        cmocka_unit_test(stars_are_apart),          cmocka_unit_test(others_are_neither),
        cmocka_unit_test(injected_stars_come_back), cmocka_unit_test(noise_counts_on_real_tiles),
        cmocka_unit_test(settings_that_cannot_be),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
