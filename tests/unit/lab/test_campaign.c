/* Campaigns through their files: what was put in comes out, and a journal knows what decides the results. */
#include "../near.h"
#include "../restore/network_model.h"
#include "../scratch.h"

#include <math.h>

#include "lab/campaign.h"
#include "num/stats.h"

/* --- a campaign, and its rows --- */

enum { COLUMNS = 40 };

typedef struct rows {
    char *text, *name[COLUMNS];
    int ncolumns;
    long n;
    char *(*cell)[COLUMNS];
} rows;

/* "NAME value NAME value ..." of a campaign whose report goes into `folder`. */
static rx_status run(const char *folder, const char *settings, rx_error *err)
{
    rx_campaign_config *config = NULL;
    char text[2048], *rest = NULL;
    snprintf(text, sizeof text, "OUTPUT_NAME %s JOURNAL_NAME %s.journal QA_FIGURES N %s", folder, folder,
             settings);
    assert_int_equal(rx_settings_new(rx_keytable_validate(), (rx_settings **)&config, NULL), RX_OK);
    for (char *name = strtok_r(text, " ", &rest); name != NULL; name = strtok_r(NULL, " ", &rest))
        if (rx_settings_set(&config->settings, name, strtok_r(NULL, " ", &rest), NULL, err) != RX_OK)
            fail_msg("%s: %s", name, err->text);
    rx_status status = rx_settings_check(&config->settings, err);
    if (status == RX_OK)
        status = rx_campaign_run(config, NULL, err);
    rx_settings_free(&config->settings);
    return status;
}

/* The cells of a line, in place. */
static int split(char *line, char *dst[COLUMNS])
{
    int n = 0, quoted = 0;
    dst[n++] = line;
    for (char *c = line; *c != '\0'; c++) {
        quoted ^= *c == '"';
        if (*c == ',' && !quoted) {
            *c = '\0';
            assert_true(n < COLUMNS);
            dst[n++] = c + 1;
        }
    }
    for (int i = 0; i < n; i++)
        if (dst[i][0] == '"') {
            dst[i]++;
            dst[i][strlen(dst[i]) - 1] = '\0';
        }
    return n;
}

static void read_rows(const char *folder, const char *name, rows *dst)
{
    char *rest = NULL;
    *dst = (rows){.text = slurp(folder, name)};
    for (char *line = strtok_r(dst->text, "\n", &rest); line != NULL; line = strtok_r(NULL, "\n", &rest)) {
        if (line[0] == '#')
            continue;
        if (dst->ncolumns == 0) {
            dst->ncolumns = split(line, dst->name);
            continue;
        }
        dst->cell = realloc(dst->cell, (size_t)(dst->n + 1) * sizeof *dst->cell);
        assert_int_equal(split(line, dst->cell[dst->n++]), dst->ncolumns);
    }
}

static void free_rows(rows *r)
{
    free(r->text);
    free(r->cell);
}

static const char *words(const rows *r, long i, const char *column)
{
    for (int c = 0; c < r->ncolumns; c++)
        if (strcmp(r->name[c], column) == 0)
            return r->cell[i][c];
    fail_msg("there is no column %s", column);
    return "";
}

static double number(const rows *r, long i, const char *column)
{
    return strtod(words(r, i, column), NULL);
}

/* Runs the campaign and reads its rows. */
static void rows_of(const char *folder, const char *settings, rows *dst)
{
    rx_error err = RX_ERROR_NONE;
    if (run(folder, settings, &err) != RX_OK)
        fail_msg("%s", err.text);
    read_rows(folder, "rows.ecsv", dst);
}

/* Row i is of that table and run ("": any). */
static int is_of(const rows *r, long i, const char *table, const char *name)
{
    return strcmp(words(r, i, "table"), table) == 0 &&
           (name[0] == '\0' || strcmp(words(r, i, "run"), name) == 0);
}

static long count_of(const rows *r, const char *table, const char *name)
{
    long n = 0;
    for (long i = 0; i < r->n; i++)
        n += is_of(r, i, table, name);
    return n;
}

/* --- sources --- */

/* What a run has found of the objects: how many, and the median of F / F0. */
static long found_by(const rows *r, const char *name, double *ratio)
{
    double *ratios = calloc((size_t)r->n, sizeof *ratios);
    long n = 0;
    for (long i = 0; i < r->n; i++)
        if (is_of(r, i, "object", name) && isfinite(number(r, i, "score"))) {
            assert_int_equal(number(r, i, "ratio") > 1, number(r, i, "pull") > 0);
            ratios[n++] = number(r, i, "ratio");
        }
    *ratio = n > 0 ? rx_median(ratios, (size_t)n) : NAN;
    free(ratios);
    return n;
}

/* Sum of P^2 of a Moffat profile that is not integrated over pixels: (beta - 1)^2 / (pi alpha^2 (2 beta - 1)). */
static double moffat_power(double fwhm, double beta)
{
    const double alpha = 0.5 * fwhm / sqrt(exp2(1.0 / beta) - 1.0);
    return (beta - 1) * (beta - 1) / (3.14159265358979 * alpha * alpha * (2 * beta - 1));
}

/* Bright stars, S/N 200 and more, on an otherwise empty field: each is found with its flux by all, and nothing else.
 * Templates have the star's flux to what its S/N leaves, whatever was restored, on the same list. */
static void bright_stars_come_back(void **state)
{
    static const char settings[] =
        "CAMPAIGN_TYPE PHOTOMETRY SIM.IMAGE_SIZE 256 SIM.STAR_COUNT 0 SIM.GALAXY_COUNT 0 MAGNITUDES "
        "14.5,14.5,1 TILES 2 STARS_PER_TILE 120 STAGE.RL_NITER 10 RESTORE_TYPE NONE,RL FLUXES AUTO,TEMPLATE";
    static const char *const runs[] = {"NONE", "NONE TEMPLATE", "RL", "RL TEMPLATE"};
    const double flux = pow(10.0, -0.4 * (14.5 - 25.0)), sigma = 10.0;
    rows r;
    double ratio;
    rows_of("bright", settings, &r);
    assert_int_equal(count_of(&r, "tile", ""), 2);
    for (int k = 0; k < 4; k++) {
        assert_int_equal(found_by(&r, runs[k], &ratio), count_of(&r, "object", runs[k]));
        /* MAG_AUTO holds 98 % of a star here; its Kron radius on restored pixels gives 3 % too much */
        assert_near(ratio, 1, k % 2 ? 0.005 : 0.05);
        assert_true(count_of(&r, "false", runs[k]) <= 2);
    }
    assert_true(count_of(&r, "object", "RL") >= 12);
    for (long i = 0; i < r.n; i++)
        if (is_of(&r, i, "tile", "")) {
            assert_near(number(&r, i, "mpixels"), 1e-6 * 256 * 256, 1e-6);
            /* pixels widen the PSF of 4 pixels by 1.5 %: 3 % of the power; the noise is measured to 2 % */
            assert_near(number(&r, i, "snr") / (flux * sqrt(moffat_power(4.0, 4.765)) / sigma), 0.985, 0.03);
        } else if (is_of(&r, i, "object", "RL TEMPLATE") || is_of(&r, i, "object", "NONE TEMPLATE")) {
            assert_string_equal(words(&r, i, "score"), words(&r, i - 1, "score"));
            assert_string_not_equal(words(&r, i, "ratio"), words(&r, i - 1, "ratio"));
            assert_true(number(&r, i, "score") > 20);
            assert_near(number(&r, i, "ratio"), 1, 0.015);
        }
    free_rows(&r);
}

/* The sky of the defaults, and stars that no image shows: they are not found, and what is found of the sky itself is no
 * false detection. */
static void others_are_neither(void **state)
{
    static const char settings[] =
        "CAMPAIGN_TYPE PHOTOMETRY SIM.IMAGE_SIZE 256 MAGNITUDES 24,26,2 TILES 2 RESTORE_TYPE NONE";
    rows r;
    double ratio;
    rows_of("faint", settings, &r);
    assert_int_equal(count_of(&r, "tile", ""), 4);
    assert_true(found_by(&r, "NONE", &ratio) <= 1);
    assert_true(count_of(&r, "false", "") <= 2); /* on a quarter of a Mpixel with 160 stars and galaxies */
    free_rows(&r);
}

/* The simulated tile of the tests stands for a real one: stars come back, and what was there before is not false. */
static void injected_stars_come_back(void **state)
{
    char settings[1200];
    rows r;
    double ratio;
    snprintf(
        settings, sizeof settings,
        "CAMPAIGN_TYPE PHOTOMETRY FIELDS INJECTED TILE_NAME %s/tests/data/sim.fits.fz STAGE.MAG_ZEROPOINT 25 "
        "MAGNITUDES 14.5,14.5,1 TILES 1 STARS_PER_TILE 60 RESTORE_TYPE NONE,RL STAGE.RL_NITER 10",
        getenv("srcdir"));
    rows_of("injected", settings, &r);
    for (int k = 0; k < 2; k++) {
        const char *name = k ? "RL" : "NONE";
        const long n = count_of(&r, "object", name);
        assert_true(n > 0);
        assert_true(found_by(&r, name, &ratio) >= n - n / 10); /* some lie on brighter sources */
        assert_near(ratio, 1, 0.06);
        assert_true(count_of(&r, "false", name) <= 3);
    }
    free_rows(&r);
}

/* At a low threshold the peaks of the noise on a real tile excuse themselves, for they were there before; those on its
 * blank twin do not, another realisation with every tile. */
static void noise_counts_on_real_tiles(void **state)
{
    char settings[1200];
    long n[2] = {0};
    rows r;
    snprintf(settings, sizeof settings,
             "CAMPAIGN_TYPE PHOTOMETRY RESTORE_TYPE NONE FIELDS INJECTED TILE_NAME %s/tests/data/sim.fits.fz "
             "STAGE.DETECT_THRESH 0.7 MAGNITUDES 14.5,14.5,1 TILES 2 STARS_PER_TILE 20",
             getenv("srcdir"));
    rows_of("blank", settings, &r);
    for (long i = 0; i < r.n; i++)
        if (is_of(&r, i, "false", ""))
            n[(int)number(&r, i, "tile") - 1]++;
    assert_true(n[0] > 30);
    assert_true(n[1] > 30);
    assert_int_not_equal(n[0], n[1]);
    free_rows(&r);
}

/* Bright stars are found by all with their flux; a pair has its separation, and the lower S/N of both. */
static void lists_of_scenes(void **state)
{
    static const char settings[] = "CAMPAIGN_TYPE DETECTION SIM.IMAGE_SIZE 192 SEEING 3 SCENE_TILES 1 "
                                   "TUNE_NITER 5,20 TUNE_FILTER 0.5 SIM.NOISE_TYPE GAUSS SIM.STAR_COUNT 400 "
                                   "SCENES STARS,GALAXIES,PAIRS STAGE.DETECT_THRESH 2 RESTORE_TYPE NONE,RL";
    static const char *const runs[] = {"NONE", "MATCHED", "RL 5 0.5", "RL 20 0.5"};
    long bright = 0, found = 0, npairs = 0;
    int next = 0;
    rows r;
    rows_of("lists", settings, &r);
    for (long i = 0; i < r.n; i++) {
        const int in_pairs = strcmp(words(&r, i, "scene"), "PAIRS") == 0;
        if (!is_of(&r, i, "object", "")) {
            assert_false(in_pairs && is_of(&r, i, "false", ""));
            continue;
        }
        assert_string_equal(words(&r, i, "run"), runs[next++ % 4]);
        assert_true(number(&r, i, "true_snr") >= 5);
        if (in_pairs) {
            npairs++;
            assert_near(number(&r, i, "apart"), 0.75, 0.251);
            assert_between(number(&r, i, "true_snr"), 12.6, 201);
        } else if (strcmp(words(&r, i, "scene"), "STARS") == 0 && number(&r, i, "true_snr") > 100) {
            bright++;
            found += number(&r, i, "score") > 10 && fabs(number(&r, i, "ratio") - 1) < 0.15;
        }
    }
    assert_true(npairs >= 8);
    assert_true(bright > 0);
    assert_true(10 * found >= 8 * bright); /* some are blended */
    free_rows(&r);
}

/* For each seeing the truth first, then one error at a time. */
static void conditions_have_one_error_at_a_time(void **state)
{
    static const char settings[] =
        "CAMPAIGN_TYPE DETECTION SIM.IMAGE_SIZE 96 SCENES STARS SCENE_TILES 1 RESTORE_TYPE NONE SEEING 3,5 "
        "PSF_ERROR -0.1,0,0.1 SKY_ERROR 0.3,0.1 NOISE_ERROR 0,0.2";
    static const char *const names[] = {"FWHM 3",
                                        "FWHM 3, PSF -10 %",
                                        "FWHM 3, PSF +10 %",
                                        "FWHM 3, sky +0.3 sigma",
                                        "FWHM 3, sky +0.1 sigma",
                                        "FWHM 3, noise +20 %",
                                        "FWHM 5"};
    int n = 0;
    rows r;
    rows_of("conditions", settings, &r);
    for (long i = 0; i < r.n; i++)
        if (is_of(&r, i, "tile", "") && n++ < 7)
            assert_string_equal(words(&r, i, "condition"), names[n - 1]);
    assert_int_equal(n, 12);
    free_rows(&r);
}

/* --- restored images --- */

#define SMALL                                                                                                \
    "CAMPAIGN_TYPE RESTORATION SCENE_SIDE 64 FWHM_RANGE 4,5 SIGMA_RANGE 2,2 SCENES_FWHM 2,3 "                \
    "SCENES_SIGMA 3,4 TUNE_SCENES 2 TUNE_NITER 2,10 TUNE_FILTER 0,0.5 EXAMPLES 0 RESTORE_TYPE "

/* Scenes are what the bins say; those of SMALL are the first ones of PAPER. */
static void scenes_are_what_bins_say(void **state)
{
    static const char *const keys[] = {"table", "scene", "condition", "tile", "run", NULL};
    rows a, b;
    rows_of("small", SMALL "NONE,RL", &a);
    rows_of("paper", SMALL "NONE,RL SIZE PAPER", &b);
    assert_int_equal(count_of(&a, "scene", "BLURRED"), 2 + 2 + 3);
    assert_int_equal(count_of(&b, "scene", "BLURRED"), 3 + 3 + 4);
    for (long i = 0, k = 0; i < a.n; i++) {
        if (!is_of(&a, i, "scene", ""))
            continue;
        const int by_noise = strcmp(words(&a, i, "scene"), "noise") == 0;
        const double middle = number(&a, i, "condition"), fwhm = number(&a, i, "fwhm"),
                     sigma = number(&a, i, "sigma");
        assert_near(by_noise ? sigma : fwhm, middle, 0.5);
        assert_between(by_noise ? fwhm : sigma, by_noise ? 2 : 1, by_noise ? 8 : 15);
        assert_true(number(&a, i, "level") > 1.1 * sigma); /* what is blurred is fainter */
        for (int same = 0; keys[same] != NULL;)
            if (strcmp(words(&a, i, keys[same]), words(&b, k, keys[same])) != 0) {
                same = 0; /* a scene of PAPER alone, or of the tuning */
                assert_true(++k < b.n);
            } else {
                same++;
            }
        assert_string_equal(words(&a, i, "fwhm"), words(&b, k, "fwhm"));
        assert_string_equal(words(&a, i, "psnr"), words(&b, k, "psnr"));
    }
    free_rows(&a);
    free_rows(&b);
}

/* The settings of a method are those of the highest mean PSNR over the scenes of the tuning, of RL_SSIM the highest mean SSIM, and
 * said to lie at an end of what was tried; NET_FLAT is NET with a threshold alone. */
static void tuning_takes_the_best(void **state)
{
    enum { METHODS = 5, OTHER = METHODS };
    static const char *const tuned[METHODS] = {"SMOOTHED", "RL", "RL_FLAT", "NET_FLAT", "RL_SSIM"};
    rows r, cells;
    rx_model *model = small_model(RX_MODE_BLIND, 1);
    assert_int_equal(rx_model_write(model, "small.fits", "small.fits", NULL), RX_OK);
    rx_model_free(model);
    rows_of("tuning", SMALL "NONE,RL,NET STAGE.NET_MODEL ./small.fits", &r);
    read_rows("tuning", "cells.ecsv", &cells);
    for (long i = 0; i < cells.n; i++) {
        int method = 0;
        while (method < METHODS && strcmp(words(&cells, i, "run"), tuned[method]) != 0)
            method++;
        if (method == OTHER) {
            assert_string_equal(words(&cells, i, "setting"), "");
            continue;
        }
        enum { MOST = 200 };
        double sum[MOST] = {0}, best = -1;
        long chosen = -1, last = 0;
        const int by_ssim = method == 4, candidates_of = by_ssim ? 1 : method;
        for (long k = 0; k < r.n; k++)
            if (is_of(&r, k, "tuning", "") && strcmp(words(&r, k, "scene"), words(&cells, i, "scene")) == 0 &&
                strcmp(words(&r, k, "condition"), words(&cells, i, "condition")) == 0) {
                const long candidate = (long)number(&r, k, "number");
                sum[candidate] += number(&r, k, by_ssim ? "ssim" : "psnr");
                last = candidate > last ? candidate : last;
            }
        for (long k = 0; k < r.n; k++) {
            const long candidate = (long)number(&r, k, "number");
            if (!is_of(&r, k, "tuning", "") || isnan(sum[candidate]))
                continue;
            const int net = candidate > last - 6, cut = number(&r, k, "threshold") >= 0;
            const int of = net ? (cut ? 3 : OTHER) : number(&r, k, "niter") > 0 ? 1 + cut : cut ? OTHER : 0;
            if (of == candidates_of && sum[candidate] > best) {
                best = sum[candidate];
                chosen = k;
            }
        }
        char setting[64] = "filter";
        if (method == 3)
            snprintf(setting, sizeof setting, "sky below %g sigma", number(&r, chosen, "threshold"));
        else if (method > 0)
            snprintf(setting, sizeof setting, "RL_NITER %g, ", number(&r, chosen, "niter"));
        assert_int_equal(strncmp(words(&cells, i, "setting"), setting, strlen(setting)), 0);
        if (method != 0 && method != 3) /* of two numbers of iterations both are ends */
            assert_non_null(strstr(words(&cells, i, "setting"), "(at an end of what was tried)"));
    }
    free_rows(&r);
    free_rows(&cells);
}

/* --- what decides the results --- */

/* With another value of a keyword the journal of "tiny" is refused by that name, or taken. */
static void check_changes(const char *change, int changes)
{
    char settings[400];
    rx_error err = RX_ERROR_NONE;
    snprintf(settings, sizeof settings,
             "CAMPAIGN_TYPE RESTORATION RESTORE_TYPE NONE SCENE_SIDE 64 FWHM_RANGE 4,4 SIGMA_RANGE 2,2 "
             "SCENES_FWHM 2,3 SCENES_SIGMA 2,3 EXAMPLES 0 TILE_NAME one %s",
             change);
    assert_int_equal(run("tiny", settings, &err), changes ? RX_USAGE : RX_OK);
    assert_int_equal(changes, strstr(err.text, "was begun with") != NULL);
}

static void settings_and_contents_of_files_decide(void **state)
{
    static const char *const decides[] = {"SEED 2", "SIZE PAPER", "TUNE_NITER 3,4", "SIM.PSF_FWHM 3",
                                          "STAGE.RL_NITER 7"};
    static const char *const others[] = {"NTHREADS 2",
                                         "VERBOSE_TYPE QUIET",
                                         "PRECISIONS 0.5",
                                         "STAGE.NTHREADS 3",
                                         "SIM.IMAGE_NAME other.fits",
                                         "STAGE.CATALOG_NAME other.cat",
                                         "OUTPUT_NAME elsewhere",
                                         "MERGE Y",
                                         "TILE_NAME two"};
    write_text("one", "abc");
    write_text("two", "abc");
    check_changes("SEED 1", 0);
    for (size_t i = 0; i < sizeof decides / sizeof *decides; i++)
        check_changes(decides[i], 1);
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        check_changes(others[i], 0);
    char *journal = slurp(".", "tiny.journal"), *summary = slurp("tiny", "summary.json");
    assert_non_null(
        strstr(journal, "= TILE_NAME 06b05ab6733a618578af5f94892f3950\n")); /* xxh128sum of "abc" */
    assert_non_null(strstr(summary, "\"seed\": \"1\""));
    assert_non_null(strstr(summary, "\"STAGE.RL_NITER\""));
    assert_null(strstr(summary, "\"STAGE.NTHREADS\""));
    free(journal);
    free(summary);
    check_changes("TILE_NAME one[2]", 1);
    write_text("one", "abd");
    check_changes("SEED 1", 1);
}

static void settings_that_cannot_be(void **state)
{
    static const char *const wrong[] = {"FIELDS INJECTED", "MAGNITUDES 20,18,1", "MAGNITUDES 18,20,0",
                                        "SIM.INJECT_IMAGE tile.fits", "RESTORE_TYPE AUTO"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char settings[80];
        rx_error err = RX_ERROR_NONE;
        snprintf(settings, sizeof settings, "CAMPAIGN_TYPE PHOTOMETRY %s", wrong[i]);
        assert_int_equal(run("wrong", settings, &err), RX_USAGE);
        assert_true(strlen(err.text) > 10);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bright_stars_come_back),
        cmocka_unit_test(others_are_neither),
        cmocka_unit_test(injected_stars_come_back),
        cmocka_unit_test(noise_counts_on_real_tiles),
        cmocka_unit_test(lists_of_scenes),
        cmocka_unit_test(conditions_have_one_error_at_a_time),
        cmocka_unit_test(scenes_are_what_bins_say),
        cmocka_unit_test(tuning_takes_the_best),
        cmocka_unit_test(settings_and_contents_of_files_decide),
        cmocka_unit_test(settings_that_cannot_be),
    };
    return cmocka_run_group_tests(tests, enter_scratch, leave_scratch);
}
