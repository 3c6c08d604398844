/* Tiles of the photometry campaign: stars that are put in come out. */
#include "../near.h"
#include "settings.h"

#include <math.h>

#include "lab/photometry_sky.h"
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

static rx_photometry_state *open_campaign(const rx_campaign_config *config, int nthreads)
{
    void *state = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_kind_photometry.open(config, nthreads, NULL, &state, &err) != RX_OK)
        fail_msg("%s", err.text);
    return state;
}

/* Sum of P^2 of a Moffat profile that is not integrated over pixels: (beta - 1)^2 / (pi alpha^2 (2 beta -
 * 1)).
 */
static double moffat_power(double fwhm, double beta)
{
    const double alpha = 0.5 * fwhm / sqrt(exp2(1.0 / beta) - 1.0);
    return (beta - 1) * (beta - 1) / (3.14159265358979 * alpha * alpha * (2 * beta - 1));
}

/* Every star is found with its flux, and nothing else. dst: the false detections of all runs. */
static void check_bright(const rx_photometry_state *campaign, const rx_unit_values *unit, double lowest,
                         double highest)
{
    const double *v = unit->v;
    const long nstars = (long)v[0];
    assert_true(nstars >= 6);
    v += 3;
    for (int r = 0; r < campaign->nruns; r++) {
        double *ratios = calloc((size_t)nstars, sizeof *ratios);
        for (long i = 0; i < nstars; i++, v += 4) {
            assert_true(v[0] > 20); /* detection S/N */
            ratios[i] = v[1];
            /* the pull is the flux's difference in units of its error */
            assert_true((v[1] > 1) == (v[2] > 0));
        }
        const double median = rx_median(ratios, (size_t)nstars);
        assert_true(median > lowest && median < highest);
        free(ratios);
        const long nfalse = (long)*v;
        assert_true(nfalse <= 1);
        v += 1 + 2 * nfalse;
    }
    assert_ptr_equal(v, unit->v + unit->n);
}

static void bright_stars_come_back(void **state)
{
    rx_campaign_config *config = make_settings(BRIGHT);
    rx_photometry_state *campaign = open_campaign(config, 1);
    long n = 0;
    rx_unit_values *values = run_units(state, "bright", &rx_kind_photometry, campaign, 1, &n);
    assert_int_equal(n, 2);
    const double flux = pow(10.0, -0.4 * (14.5 - 25.0)), sigma = 10.0;
    for (long u = 0; u < n; u++) {
        /* MAG_AUTO holds 98 % of a star here; its Kron radius on restored pixels gives 3 % too much */
        check_bright(campaign, &values[u], 0.95, 1.05);
        assert_near(values[u].v[1], 1e-6 * 256 * 256, 1e-6);
        /* pixels widen the PSF of 4 pixels by 1.5 %: 3 % of the power; the noise is measured to 2 % */
        assert_near(values[u].v[2] / (flux * sqrt(moffat_power(4.0, 4.765)) / sigma), 0.985, 0.03);
    }
    rx_unit_values_free(n, values);
    rx_kind_photometry.close(campaign);
    rx_campaign_config_free(config);
}

/* Every restorer has a run for each flux; the lists are the same, and templates have the star's flux to what
 * its S/N of 200 leaves, whatever was restored. */
static void templates_compete(void **state)
{
    rx_campaign_config *config = make_settings(TEMPLATES);
    rx_photometry_state *campaign = open_campaign(config, 1);
    long n = 0;
    rx_unit_values *values = run_units(state, "templates", &rx_kind_photometry, campaign, 1, &n);
    const long nstars = (long)values[0].v[0];
    const double *v = values[0].v + 3, *before = NULL;
    assert_int_equal(campaign->nruns, 4);
    for (int r = 0; r < campaign->nruns; r++) {
        assert_int_equal(campaign->templates[r], r % 2);
        assert_ptr_equal(campaign->run[r], campaign->run[r / 2 * 2]);
        for (long i = 0; i < nstars && r % 2; i++) {
            assert_near(v[4 * i], before[4 * i], 0); /* the score */
            assert_near(v[4 * i + 1], 1, 0.03);
            assert_true(v[4 * i + 1] != before[4 * i + 1]);
        }
        before = v;
        v += 4 * nstars;
        v += 1 + 2 * (long)*v;
    }
    assert_ptr_equal(v, values[0].v + values[0].n);
    rx_unit_values_free(n, values);
    rx_kind_photometry.close(campaign);
    rx_campaign_config_free(config);
}

/* Stars are apart, inside, and on other places on each tile; all restorers meet the same ones. */
static void stars_are_apart(void **state)
{
    (void)state;
    rx_campaign_config *config = make_settings(BRIGHT);
    rx_photometry_state *campaign = open_campaign(config, 1);
    rx_photometry_tile tile[3];
    for (int t = 0; t < 3; t++)
        assert_int_equal(rx_photometry_tile_make(campaign, &campaign->sky[0], 14.5, t == 2 ? 0 : (uint64_t)t,
                                                 &tile[t], NULL),
                         RX_OK);
    for (long i = 0; i < tile[0].n; i++) {
        assert_true(tile[0].x[i] >= 16 && tile[0].x[i] <= 255 - 16);
        for (long k = 0; k < i; k++)
            assert_true(hypot(tile[0].x[i] - tile[0].x[k], tile[0].y[i] - tile[0].y[k]) >= 24);
    }
    assert_true(tile[0].x[0] != tile[1].x[0]);
    assert_int_equal(tile[0].n, tile[2].n);
    assert_memory_equal(tile[0].x, tile[2].x, (size_t)tile[0].n * sizeof(double));
    assert_memory_equal(tile[0].field->tile->pixels, tile[2].field->tile->pixels, 256 * 256 * sizeof(float));
    for (int t = 0; t < 3; t++)
        rx_photometry_tile_free(&tile[t]);
    rx_kind_photometry.close(campaign);
    rx_campaign_config_free(config);
}

/* Stars far below the noise are not found, and what is found of the sky itself is no false detection. */
static void others_are_neither(void **state)
{
    rx_campaign_config *config = make_settings(FAINT);
    rx_photometry_state *campaign = open_campaign(config, 2);
    long n = 0, m = 0, found = 0, nfalse = 0;
    rx_unit_values *values = run_units(state, "faint1", &rx_kind_photometry, campaign, 1, &n);
    rx_unit_values *again = run_units(state, "faint2", &rx_kind_photometry, campaign, 2, &m);
    rx_unit_values *more = run_units(state, "faint3", &rx_kind_photometry, campaign, 3, &m);
    assert_int_equal(n, 4);
    assert_same_values(n, values, again);
    assert_same_values(n, values, more);
    for (long u = 0; u < n; u++) {
        const double *v = values[u].v + 3;
        const long nstars = (long)values[u].v[0];
        for (int r = 0; r < campaign->nruns; r++, v += 1 + 2 * (long)*v) {
            for (long i = 0; i < nstars; i++, v += 4) {
                found += isfinite(v[0]);
                assert_int_equal(isfinite(v[0]), isfinite(v[1]));
            }
            nfalse += r == 0 ? (long)*v : 0;
        }
    }
    assert_true(found <= 1);
    assert_true(nfalse <= 2); /* NONE, on a quarter of a Mpixel with 160 stars and galaxies */
    rx_unit_values_free(n, values);
    rx_unit_values_free(n, again);
    rx_unit_values_free(n, more);
    rx_kind_photometry.close(campaign);
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
    rx_photometry_state *campaign = open_campaign(config, 2);
    const rx_photometry_sky *sky = &campaign->sky[0];
    long n = 0;
    rx_unit_values *values = run_units(state, "injected", &rx_kind_photometry, campaign, 1, &n);
    assert_int_equal(n, 1);
    assert_true(sky->before.n > 10);
    assert_non_null(sky->before.covered);
    const double *v = values[0].v;
    const long nstars = (long)v[0];
    v += 3;
    for (int r = 0; r < campaign->nruns; r++) {
        long found = 0;
        double *ratios = calloc((size_t)nstars, sizeof *ratios);
        for (long i = 0; i < nstars; i++, v += 4)
            if (isfinite(v[0]))
                ratios[found++] = v[1];
        assert_true(found >= nstars - nstars / 10); /* some lie on brighter sources */
        assert_near(rx_median(ratios, (size_t)found), 1.0, 0.06);
        free(ratios);
        assert_true(*v <= 3); /* what was there before is not false */
        v += 1 + 2 * (long)*v;
    }
    rx_unit_values_free(n, values);
    rx_kind_photometry.close(campaign);
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
    rx_photometry_state *campaign = open_campaign(config, 2);
    long n = 0;
    double nfalse[2];
    rx_unit_values *values = run_units(state, "blank", &rx_kind_photometry, campaign, 2, &n);
    assert_int_equal(n, 2);
    for (int unit = 0; unit < 2; unit++) {
        const double *v = values[unit].v;
        nfalse[unit] = v[3 + 4 * (long)v[0]];
        rx_field *blank = NULL;
        rx_result result;
        rx_error err = RX_ERROR_NONE;
        assert_int_equal(rx_photometry_blank_make(campaign, &campaign->sky[0], (uint64_t)unit, &blank, &err),
                         RX_OK);
        assert_int_equal(rx_field_extract(&campaign->options->pipeline, campaign->run[0], blank, NULL, NULL,
                                          &result, &err),
                         RX_OK);
        assert_true(result.sources->n > 30);
        assert_in_range((unsigned long)nfalse[unit], (unsigned long)result.sources->n,
                        (unsigned long)result.sources->n + 40);
        rx_result_free(&result);
        rx_field_free(blank);
    }
    assert_true(nfalse[0] != nfalse[1]); /* another realisation with every tile */
    rx_unit_values_free(n, values);
    rx_kind_photometry.close(campaign);
    rx_campaign_config_free(config);
}

static void settings_that_cannot_be(void **state)
{
    (void)state;
    static const char *const wrong[][5] = {
        {"FIELDS", "INJECTED", NULL, NULL, NULL},        {"MAGNITUDES", "20,18,1", NULL, NULL, NULL},
        {"MAGNITUDES", "18,20,0", NULL, NULL, NULL},     {"FIELDS", "SIMULATED,SIMULATED", NULL, NULL, NULL},
        {"RESTORE_TYPE", "NONE,NONE", NULL, NULL, NULL}, {"SIM.INJECT_IMAGE", "tile.fits", NULL, NULL, NULL},
    };
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        rx_error err = RX_ERROR_NONE;
        void *pointer = NULL;
        rx_campaign_config *config = make_settings(wrong[i]);
        assert_int_equal(rx_kind_photometry.open(config, 1, NULL, &pointer, &err), RX_USAGE);
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
