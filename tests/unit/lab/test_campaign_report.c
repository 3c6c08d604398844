/* The reports of campaigns: numbers against scipy and by hand, verdicts, files, escapes, odd results. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../near.h"
#include "../scratch.h"
#include "base/text.h"
#include "lab/findings.h"
#include "made_results.h"
#include "report/page.h"
#include "verdict.h"

#define HOSTILE "</td><script>alert('x')</script>\"\\\n\xff"

static char *pairs[][3] = {{"RESTORE_TYPE", "NONE,RL", ""}, {"OUTPUT_NAME", HOSTILE, ""}};
static const rx_campaign_record plain = {.title = HOSTILE,
                                         .command = {.data = "rextract-validate -c " HOSTILE},
                                         .keywords = {2, 2, pairs, false},
                                         .seed = 7};
static const made_restoration small = {0, 0, 0, 24, 13, 4};
#define OUTPUT(record, folder, brief)                                                                        \
    &(rx_lab_output)                                                                                         \
    {                                                                                                        \
        record, folder, "the report", NULL, brief                                                            \
    }
static const made_photometry stars = {2, 2, 7, 3, 30, 0.3};

/* Files of a report. */
enum { RESTORATION_FILES = 7, PHOTOMETRY_FILES = 7 };

/* python3 that has scipy, run on a script of this folder; 0 and a line when there is none. */
static int python(const char *script, const char *folder)
{
    const char *top = getenv("srcdir");
    char command[1024];
    if (system("/usr/bin/python3 -c 'import numpy, scipy.stats' 2>/dev/null") != 0) {
        print_message("/usr/bin/python3 with scipy is absent: %s not run\n", script);
        return 0;
    }
    snprintf(command, sizeof command, "/usr/bin/python3 '%s/tests/unit/lab/%s' '%s' >&2",
             top != NULL ? top : ".", script, folder);
    assert_int_equal(system(command), 0);
    return 1;
}

static rx_store *store_of(const rx_lab *lab, uint64_t seed)
{
    rx_store *store = NULL;
    assert_int_equal(rx_store_make(lab, seed, &store, NULL), RX_OK);
    return store;
}

static rx_claim_verdicts verdicts_of(const rx_store *store)
{
    rx_claim_verdicts verdicts;
    rx_claims_judge(store, &verdicts);
    return verdicts;
}

/* Of results, which are freed. */
static rx_claim_state claim_state(rx_lab *lab, rx_claim_id claim)
{
    rx_store *store = store_of(lab, 1);
    rx_claim_verdicts verdicts = verdicts_of(store);
    const rx_claim_state state = verdict_of(&verdicts, claim, -1)->state;
    rx_claim_verdicts_free(&verdicts);
    rx_store_free(store);
    rx_lab_close(lab);
    return state;
}

/* ---- restoration ---- */

static void restoration_agrees_with_scipy(void **state)
{
    char folder[512];
    (void)state;
    rx_lab *r = make_restoration(&(made_restoration){1, 1, -1, 24, 7, 5});
    new_folder(folder);
    assert_int_equal(rx_lab_report(r, OUTPUT(&plain, folder, NULL), NULL), RX_OK);
    python("check_restoration.py", folder);
    assert_int_equal(clear_folder(folder), RESTORATION_FILES);
    rx_lab_close(r);
}

/* Four scenes worked out by hand: RL - SMOOTHED = 1, 2, 3, 2: mean 2, s = sqrt(2/3), t = 2 / (s / 2) =
 * sqrt(24). */
static void four_scenes_by_hand(void **state)
{
    static const double smoothed[] = {20, 21, 22, 23}, rl[] = {21, 23, 25, 25};
    (void)state;
    rx_lab *r = make_restoration(&(made_restoration){0, 0, 0, 4, 1, 0});
    for (int i = 0; i < 4; i++) {
        made_score(r, 0, i, 1)[RX_SCORE_PSNR] = smoothed[i];
        made_score(r, 0, i, 2)[RX_SCORE_PSNR] = rl[i];
    }
    rx_store *m = store_of(r, 1);
    const rx_contest *paired = rx_contest_of(m, 0, 0, RX_BY_PAIRED, 0),
                     *two = rx_contest_of(m, 0, 0, RX_BY_TWO_SAMPLES, 0);
    assert_int_equal(m->pair[0][0], 2);
    assert_int_equal(m->pair[0][1], 1);
    assert_near(paired->test.statistic, sqrt(24), 1e-12);
    assert_near(paired->test.effect, 2 / sqrt(2.0 / 3), 1e-12);
    assert_near(two->test.dof, 6, 0);
    /* variances 5/3 and 11/3, pooled 8/3: t = 2 / sqrt(8/3 * 2/4) */
    assert_near(two->test.statistic, 2 / sqrt(8.0 / 6), 1e-12);
    assert_near(paired->holm, paired->test.p, 1e-15); /* one bin: nothing to adjust */
    assert_int_equal(paired->winner, 1);
    assert_int_equal(two->winner, 0);
    assert_near(rx_store_value(m, 0, "psnr", 0, 2).value, 23.5, 1e-12);
    rx_store_free(m);
    rx_lab_close(r);
}

/* scipy.stats.t.sf(t, dof) * 2 of all printed columns: two do not fit. */
static void the_papers_own_numbers(void **state)
{
    int n = 0, fits = 0;
    (void)state;
    for (int i = 0; i < RX_PAPER_TABLES; i++) {
        const rx_paper_table *table = &rx_paper_tables[i];
        assert_int_equal(table->number, i + 1);
        assert_int_equal(table->by_sigma, i >= 2);
        assert_int_equal(table->ssim, i % 2 == 0);
        for (int k = 0; k < table->n; k++, n++) {
            double p, ln_p;
            int fit = rx_paper_column_fits(table, k, &p, &ln_p);
            fits += fit;
            assert_near(ln_p, log(p), 1e-9);
            if (!fit) {
                assert_true(table->number == 3);
                assert_true(table->bin[k] == 2 || table->bin[k] == 25);
            }
        }
    }
    assert_int_equal(n, 30);
    assert_int_equal(fits, 28);
    double p, ln_p;
    assert_near(rx_paper_tables[2].bin[0], 2, 0);
    assert_int_equal(rx_paper_column_fits(&rx_paper_tables[2], 0, &p, &ln_p), 0);
    assert_near(p, 0.09311549953989567, 1e-9);
}

/* The first duel asks what deconvolution earned, and what NET earned once it is there; no method meets itself
 * or another one twice. */
static void who_meets_whom(void **state)
{
    static const char *const without[][2] = {{"RL", "SMOOTHED"},
                                             {"RL", "BLURRED"},
                                             {"RL_FLAT", "RL"},
                                             {"SMOOTHED", "BLURRED"},
                                             {"RL_FLAT", "BLURRED"}},
                             *const with[][2] = {
                                 {"NET", "RL"},           {"NET", "RL_FLAT"},     {"RL", "SMOOTHED"},
                                 {"RL", "BLURRED"},       {"NET", "SMOOTHED"},    {"RL_FLAT", "RL"},
                                 {"SMOOTHED", "BLURRED"}, {"RL_FLAT", "BLURRED"}, {"NET", "BLURRED"}};
    (void)state;
    for (int net = 0; net < 2; net++) {
        rx_lab *r = make_restoration(&(made_restoration){net, 1, 1, 4, 1, 0});
        rx_store *m = store_of(r, 1);
        assert_int_equal(m->npairs, net ? 9 : 5);
        for (int p = 0; p < m->npairs; p++) {
            assert_string_equal(m->column[m->pair[p][0]], (net ? with : without)[p][0]);
            assert_string_equal(m->column[m->pair[p][1]], (net ? with : without)[p][1]);
        }
        for (int a = 0; a < r->nruns; a++)
            for (int b = 0; b < a; b++)
                assert_int_not_equal(rx_method_color(r->run[a].name), rx_method_color(r->run[b].name));
        rx_store_free(m);
        rx_lab_close(r);
    }
    assert_int_equal(rx_method_color("never heard of"), RX_PALETTE - 1);
}

static void claims_about_the_network(void **state)
{
    static const made_restoration best = {1, 5, 5, 24, 13, 24}, once_worse = {1, 5, -2, 24, 13, 24};
    (void)state;
    assert_int_equal(claim_state(make_restoration(&small), RX_CLAIM_EVERY_BIN), RX_NOT_YET_TESTABLE);
    assert_int_equal(claim_state(make_restoration(&small), RX_CLAIM_ALL_P), RX_NOT_YET_TESTABLE);
    assert_int_equal(claim_state(make_restoration(&small), RX_CLAIM_BEYOND), RX_NOT_YET_TESTABLE);
    assert_int_equal(claim_state(make_restoration(&best), RX_CLAIM_EVERY_BIN), RX_REPRODUCED);
    assert_int_equal(claim_state(make_restoration(&best), RX_CLAIM_ALL_P), RX_REPRODUCED);
    assert_int_equal(claim_state(make_restoration(&best), RX_CLAIM_INSIDE), RX_REPRODUCED);
    assert_int_equal(claim_state(make_restoration(&best), RX_CLAIM_BEYOND), RX_REPRODUCED);
    assert_int_equal(claim_state(make_restoration(&best), RX_CLAIM_SPEED), RX_NOT_TESTED);
    assert_int_equal(claim_state(make_restoration(&best), RX_CLAIM_ABOVE_RL), RX_REPRODUCED);
    assert_int_equal(claim_state(make_restoration(&best), RX_CLAIM_ABOVE_FLAT), RX_REPRODUCED);
    assert_int_equal(claim_state(make_restoration(&small), RX_CLAIM_ABOVE_RL), RX_NOT_YET_TESTABLE);
    /* the bin of 14 pixels is beyond the training range */
    assert_int_equal(claim_state(make_restoration(&once_worse), RX_CLAIM_EVERY_BIN), RX_NOT_REPRODUCED);
    assert_int_equal(claim_state(make_restoration(&once_worse), RX_CLAIM_INSIDE), RX_REPRODUCED);
    assert_int_equal(claim_state(make_restoration(&once_worse), RX_CLAIM_BEYOND), RX_NOT_REPRODUCED);
}

/* What is inside is said on the model's scale, not by sigma: bins of FWHM 2 to 5 and 14 here, their levels set. */
static void bins_lie_where_their_noise_level_is(void **state)
{
    static const made_restoration how = {1, 3, 5, 24, 4, 0};
    static const struct {
        double level;
        int inside, fainter;
    } cases[] = {{0.5, 0, 0}, {4, 1, 0}, {33, 1, 1}};
    (void)state;
    rx_lab *r = make_restoration(&how);
    for (int b = 0; b < 3; b++)
        for (long i = 0; i < how.nscenes; i++)
            made_scene(r, b, i)[RX_SCENE_LEVEL] = cases[b].level;
    rx_store *m = store_of(r, 1);
    for (int b = 0; b < 3; b++) {
        const rx_restoration_bin *bin = rx_restoration_bin_of(m, 0, b);
        assert_near(bin->level.median, cases[b].level, 0);
        assert_int_equal(bin->inside, cases[b].inside);
        assert_int_equal(bin->fainter, cases[b].fainter);
        assert_int_equal(rx_bin_is_beyond(m, 0, b), !cases[b].inside || cases[b].fainter);
    }
    rx_store_free(m);
    r->level_trained[0] = r->level_trained[1] = 0; /* no model */
    m = store_of(r, 1);
    for (int b = 0; b < 3; b++)
        assert_int_equal(rx_bin_is_beyond(m, 0, b), 0);
    rx_store_free(m);
    rx_lab_close(r);
}

/* A bin in which one is clearly better, one in which it is worse, one undecided. */
static void words_follow_the_numbers(void **state)
{
    rx_text words = {0};
    (void)state;
    rx_lab *r = make_restoration(&(made_restoration){0, 0, 0, 6, 3, 0});
    for (int b = 0; b < 3; b++)
        for (int i = 0; i < 6; i++) {
            double shift[] = {2, -1, 0}, wobble = 0.1 * (i % 2 ? 1 : -1);
            made_score(r, b, i, 1)[RX_SCORE_PSNR] = 20 + i;
            made_score(r, b, i, 2)[RX_SCORE_PSNR] = 20 + i + shift[b] + wobble;
        }
    rx_store *m = store_of(r, 1);
    const rx_contest_place fwhm = {.group = 0, .last = m->nabouts - 1};
    static const struct {
        int a, b, every, won;
        const char *words;
    } cases[] = {{2, 1, 1, 0,
                  "RL against SMOOTHED, psnr of FWHM: better at 2 by 2; worse at 3 by 1; undecided at 4. "},
                 {1, 2, 0, 0,
                  "SMOOTHED against RL, psnr of FWHM: better at 3 by 1; worse at 2 by 2; undecided at 4. "}};
    for (int i = 0; i < 2; i++) {
        assert_int_equal(rx_contests_won(m, &fwhm, cases[i].a, cases[i].b, cases[i].every, &words),
                         cases[i].won);
        assert_non_null(strstr(words.data, cases[i].words));
        rx_text_free(&words);
    }
    assert_int_equal(rx_contests_won(m, &fwhm, 1, 1, 0, &words), -1); /* no such pair */
    rx_store_free(m);
    rx_lab_close(r);
}

/* With one bin nothing is adjusted: p stands in the page twice side by side. */
static void adjusted_p_is_shown(void **state)
{
    char folder[512];
    rx_text cells = {0};
    (void)state;
    rx_lab *r = make_restoration(&(made_restoration){0, 0, 0, 24, 1, 0});
    rx_store *m = store_of(r, plain.seed);
    const rx_test *paired = &rx_contest_of(m, 0, 0, RX_BY_PAIRED, 0)->test;
    for (int i = 0; i < 2; i++)
        rx_page_cell_p(&cells, paired->p, paired->ln_p);
    new_folder(folder);
    assert_int_equal(rx_lab_report(r, OUTPUT(&plain, folder, NULL), NULL), RX_OK);
    char *page = slurp(folder, "report.html");
    assert_non_null(strstr(page, cells.data));
    free(page);
    rx_text_free(&cells);
    assert_int_equal(clear_folder(folder), RESTORATION_FILES);
    rx_store_free(m);
    rx_lab_close(r);
}

/* p and Holm's p below the smallest double: the logarithm of the latter is that of p times the number of tests. */
static void logarithm_of_a_vanished_holm(void **state)
{
    char folder[512];
    double ln = NAN;
    (void)state;
    rx_lab *r = make_restoration(&(made_restoration){0, 0, 0, 24, 4, 0});
    for (int b = 0; b < 4; b++)
        for (int i = 0; i < 24; i++) /* t of 10^15 */
            made_score(r, b, i, 2)[RX_SCORE_PSNR] = 1e9 + made_score(r, b, i, 1)[RX_SCORE_PSNR] + 1e-6 * i;
    rx_store *m = store_of(r, plain.seed);
    const rx_contest *contest = rx_contest_of(m, 0, 0, RX_BY_PAIRED, 0);
    assert_near(contest->holm, 0, 0);
    assert_true(isfinite(contest->test.ln_p));
    new_folder(folder);
    assert_int_equal(rx_lab_report(r, OUTPUT(&plain, folder, NULL), NULL), RX_OK);
    char *json = slurp(folder, "summary.json");
    const char *at = strstr(json, "\"ln_holm\": ");
    assert_non_null(at);
    assert_int_equal(sscanf(at, "\"ln_holm\": %lf", &ln), 1);
    assert_near(ln, contest->test.ln_p + log(4), 1e-5);
    free(json);
    rx_store_free(m);
    rx_lab_close(r);
    assert_int_equal(clear_folder(folder), RESTORATION_FILES);
}

/* Where tuning took an end of what was tried, page, summary and terminal say so. */
static void ends_of_tuning_are_told(void **state)
{
    char folder[512];
    rx_text brief = {0};
    (void)state;
    rx_lab *r = make_restoration(&(made_restoration){0, 0, 0, 24, 1, 0});
    new_folder(folder);
    assert_int_equal(rx_lab_report(r, OUTPUT(&plain, folder, &brief), NULL), RX_OK);
    char *page = slurp(folder, "report.html"), *json = slurp(folder, "summary.json");
    assert_non_null(strstr(page, "RL against SMOOTHED"));
    assert_non_null(strstr(json, "filter 0.7 FWHM"));
    assert_non_null(strstr(page, "in 1 of 6 choices"));
    assert_non_null(strstr(json, "\"tune_choices_at_end\": 1"));
    assert_non_null(strstr(json, "filter 0.9 FWHM (at an end"));
    assert_null(strstr(json, "filter 0.5 FWHM (at"));
    assert_non_null(strstr(brief.data, "in 1 of 6 choices"));
    free(page);
    free(json);
    rx_text_free(&brief);
    assert_int_equal(clear_folder(folder), RESTORATION_FILES);
    rx_lab_close(r);
}

/* One scene, no spread, infinite PSNR, no bins: no number is invented and nothing breaks. */
static void odd_restoration_results(void **state)
{
    static const made_restoration odd[] = {
        {0, 0, 0, 1, 2, 1}, {1, 0, 0, 2, 1, 0}, {0, 0, 0, 0, 1, 1}, {0, 0, 0, 3, 0, 0}};
    (void)state;
    for (size_t k = 0; k < sizeof odd / sizeof *odd; k++) {
        char folder[512];
        rx_lab *r = make_restoration(&odd[k]);
        if (odd[k].nfwhm > 0 && odd[k].nscenes > 0) {
            made_score(r, 0, 0, 0)[RX_SCORE_PSNR] = INFINITY;
            made_score(r, 0, 0, 1)[RX_SCORE_SSIM] = NAN;
        }
        new_folder(folder);
        assert_int_equal(rx_lab_report(r, OUTPUT(&plain, folder, NULL), NULL), RX_OK);
        char *json = slurp(folder, "summary.json");
        assert_null(strstr(json, "inf"));
        assert_null(strstr(json, ": nan"));
        free(json);
        assert_int_equal(clear_folder(folder), RESTORATION_FILES);
        rx_lab_close(r);
    }
}

/* ---- photometry ---- */

static double *star_of(const rx_lab *r, int field, int set, int run, long i)
{
    return rx_lab_each(&rx_lab_set_of(r, field, set)->table[RX_PHOTOMETRY_STAR], i, run);
}

static void set_star(double *v, double score, double ratio, double pull)
{
    v[RX_STAR_SCORE] = score;
    v[RX_STAR_RATIO] = ratio;
    v[RX_STAR_PULL] = pull;
    v[RX_STAR_CROWDED] = 0;
}

static void write_raw(const rx_lab *r, const char *folder)
{
    char path[600];
    snprintf(path, sizeof path, "%s/raw.csv", folder);
    FILE *out = fopen(path, "w");
    assert_non_null(out);
    for (int f = 0; f < r->nconditions; f++)
        for (int k = 0; k < r->nscenes; k++)
            for (int run = 0; run < r->nruns; run++) {
                const rx_lab_set *set = rx_lab_set_of(r, f, k);
                const rx_lab_table *wrong = &set->table[RX_PHOTOMETRY_FALSE];
                for (long i = 0; i < set->table[RX_PHOTOMETRY_STAR].n; i++) {
                    const double *v = star_of(r, f, k, run, i);
                    fprintf(out, "%d,%d,%d,1,%.9g,%.9g,%.9g,%g\n", f, k, run, v[RX_STAR_SCORE],
                            v[RX_STAR_RATIO], v[RX_STAR_PULL], v[RX_STAR_CROWDED]);
                }
                for (long i = 0; i < wrong->n; i++)
                    if (rx_lab_own(wrong, i)[RX_WRONG_RUN] == run)
                        fprintf(out, "%d,%d,%d,0,%.9g,0,0,0\n", f, k, run,
                                rx_lab_own(wrong, i)[RX_WRONG_SCORE]);
            }
    fclose(out);
}

static void photometry_agrees_with_scipy(void **state)
{
    char folder[512];
    (void)state;
    rx_lab *r = make_photometry(&(made_photometry){3, 2, 6, 4, 25, 0.3});
    new_folder(folder);
    write_raw(r, folder);
    assert_int_equal(rx_lab_report(r, OUTPUT(&plain, folder, NULL), NULL), RX_OK);
    python("check_photometry.py", folder);
    assert_int_equal(clear_folder(folder), PHOTOMETRY_FILES + 1);
    rx_lab_close(r);
}

/* The depth of a field of many magnitudes: of 80, the 70 brightest found. */
static void depth_of_many_magnitudes(void **state)
{
    enum { SETS = 80, FOUND = 70, STARS = 4 };
    (void)state;
    rx_lab *r = make_photometry(&(made_photometry){1, 1, SETS, 1, STARS, 0});
    for (int k = 0; k < SETS; k++)
        for (int i = 0; i < STARS; i++)
            set_star(star_of(r, 0, k, 0, i), k < FOUND ? 9 : NAN, k < FOUND ? 1 : NAN, k < FOUND ? 0 : NAN);
    rx_store *m = store_of(r, 1);
    const rx_estimate *mag50 = &rx_photometry_cut_of(m, 0, 0, -1)->mag50;
    assert_int_equal(mag50->n, SETS * STARS);
    assert_near(mag50->value, r->scene[FOUND].mag, 1.0);
    rx_store_free(m);
    rx_lab_close(r);
}

/* Four stars, scores 9 8 7 -, two false detections of 7.5 and 6: precision is 2/2 down to 8, 3/4 at 7, 3/5
 * at 6. */
static void thresholds_by_hand(void **state)
{
    static const double scores[] = {9, 8, 7, NAN}, false_scores[] = {6, 7.5};
    (void)state;
    rx_lab *r = make_photometry(&(made_photometry){1, 1, 1, 1, 4, 0});
    rx_lab_table *wrong = &rx_lab_set_of(r, 0, 0)->table[RX_PHOTOMETRY_FALSE];
    for (int i = 0; i < 4; i++) {
        double ratio = isnan(scores[i]) ? NAN : 1 + 0.25 * (i - 1); /* 0.75, 1, 1.25 */
        set_star(star_of(r, 0, 0, 0, i), scores[i], ratio, ratio - 1);
    }
    assert_int_equal(wrong->n, 2);
    for (int i = 0; i < 2; i++)
        rx_lab_own(wrong, i)[RX_WRONG_SCORE] = false_scores[i];
    r->nprecisions = 3;
    r->precision[0] = 0.7;
    r->precision[1] = 0.9;
    r->precision[2] = 0.5;
    rx_store *m = store_of(r, 1);
    assert_near(rx_photometry_cut_of(m, 0, 0, 0)->score, 7, 0);
    assert_near(rx_store_value(m, 0, "recall_p0.7", 0, 0).value, 0.75, 1e-12);
    assert_near(rx_photometry_cut_of(m, 0, 0, 0)->precision.value, 0.75, 1e-12);
    assert_int_equal(rx_photometry_cut_of(m, 0, 0, 0)->whole_list, 0);
    assert_near(rx_photometry_cut_of(m, 0, 0, 1)->score, 8, 0);
    assert_near(rx_store_value(m, 0, "recall_p0.9", 0, 0).value, 0.5, 1e-12);
    assert_near(rx_photometry_cut_of(m, 0, 0, 2)->score, 6, 0);
    assert_int_equal(rx_photometry_cut_of(m, 0, 0, 2)->whole_list, 1);
    assert_near(rx_store_value(m, 0, "recall", 0, 0).value, 0.75, 1e-12);
    assert_near(rx_store_value(m, 0, "precision", 0, 0).value, 0.6, 1e-12);
    assert_near(rx_store_value(m, 0, "ap", 0, 0).value, 0.25 + 0.25 + 0.25 * 0.75, 1e-12);
    assert_near(rx_store_value(m, 0, "magerr", 0, 0).value, 100 * 0.5 / 3, 1e-5);
    assert_near(rx_store_value(m, 0, "bias_percent", 0, 0).value, 0, 1e-12);
    rx_store_free(m);
    /* surest of all is a false detection: no threshold gives more than 3/4 */
    rx_lab_own(wrong, 1)[RX_WRONG_SCORE] = 100;
    r->precision[1] = 0.99;
    m = store_of(r, 1);
    assert_true(isinf(rx_photometry_cut_of(m, 0, 0, 1)->score));
    assert_near(rx_store_value(m, 0, "recall_p0.99", 0, 0).value, 0, 0);
    rx_store_free(m);
    rx_lab_close(r);
}

/* Of two runs on the same stars the second one is that of template photometry. */
static void claim_of_templates(void **state)
{
    static const made_photometry two = {2, 1, 4, 4, 50, 0.4};
    (void)state;
    for (int better = 0; better < 2; better++) {
        rx_lab *r = make_photometry(&two);
        r->run[1].templates = 1;
        for (int s = 0; s < 4; s++)
            for (long i = 0; i < rx_lab_set_of(r, 0, s)->table[RX_PHOTOMETRY_STAR].n; i++) {
                double *a = star_of(r, 0, s, 0, i), *b = star_of(r, 0, s, 1, i);
                const double error = i % 2 ? 0.1 : 0.12;
                a[RX_STAR_SCORE] = b[RX_STAR_SCORE] = 20;
                a[RX_STAR_RATIO] = 1 + error;
                b[RX_STAR_RATIO] = 1 - error * (better || s != 3 ? 0.5 : 1.5);
            }
        rx_store *m = store_of(r, 1);
        rx_claim_verdicts verdicts = verdicts_of(m);
        const rx_claim_verdict *templates = verdict_of(&verdicts, RX_CLAIM_TEMPLATES, -1);
        assert_non_null(strstr(templates->said.data, better ? "4 of 4 sets" : "3 of 4 sets"));
        assert_int_equal(templates->state, better ? RX_REPRODUCED : RX_NOT_REPRODUCED);
        assert_int_equal(verdict_of(&verdicts, RX_CLAIM_RESTORED_BETTER, -1)->state,
                         RX_NOT_YET_TESTABLE); /* templates restore nothing */
        rx_claim_verdicts_free(&verdicts);
        rx_store_free(m);
        rx_lab_close(r);
    }
}

static void claims_about_photometry(void **state)
{
    static const made_photometry deeper = {3, 1, 8, 4, 50, 0.4}, shallower = {3, 1, 8, 4, 50, -0.4},
                                 rl_only = {2, 1, 8, 4, 50, 0.4}, alone = {1, 1, 8, 4, 50, 0};
    (void)state;
    assert_int_equal(claim_state(make_photometry(&deeper), RX_CLAIM_RESTORED_BETTER), RX_REPRODUCED);
    assert_int_equal(claim_state(make_photometry(&deeper), RX_CLAIM_NET_BEST), RX_REPRODUCED);
    assert_int_equal(claim_state(make_photometry(&deeper), RX_CLAIM_LOW_SNR), RX_REPRODUCED);
    assert_int_equal(claim_state(make_photometry(&deeper), RX_CLAIM_ACCURACY),
                     RX_NOT_REPRODUCED); /* made noisier */
    assert_int_equal(claim_state(make_photometry(&shallower), RX_CLAIM_RESTORED_BETTER), RX_NOT_REPRODUCED);
    assert_int_equal(claim_state(make_photometry(&shallower), RX_CLAIM_NET_BEST), RX_NOT_REPRODUCED);
    assert_int_equal(claim_state(make_photometry(&rl_only), RX_CLAIM_RESTORED_BETTER), RX_REPRODUCED);
    assert_int_equal(claim_state(make_photometry(&rl_only), RX_CLAIM_NET_BEST), RX_NOT_YET_TESTABLE);
    assert_int_equal(claim_state(make_photometry(&rl_only), RX_CLAIM_ACCURACY), RX_NOT_YET_TESTABLE);
    assert_int_equal(claim_state(make_photometry(&alone), RX_CLAIM_RESTORED_BETTER), RX_NOT_YET_TESTABLE);
}

static void odd_photometry_results(void **state)
{
    static const made_photometry odd[] = {
        {1, 1, 1, 1, 1, 0}, {2, 1, 0, 1, 1, 0}, {2, 1, 2, 1, 0, 0}, {2, 0, 0, 1, 1, 0}};
    (void)state;
    for (size_t k = 0; k < sizeof odd / sizeof *odd; k++) {
        char folder[512];
        rx_lab *r = make_photometry(&odd[k]);
        for (int s = 0; s < r->nconditions * r->nscenes; s++)
            r->set[s].table[RX_PHOTOMETRY_FALSE].n = 0;
        new_folder(folder);
        rx_text brief = {0};
        assert_int_equal(rx_lab_report(r, OUTPUT(&plain, folder, &brief), NULL), RX_OK);
        char *json = slurp(folder, "summary.json");
        assert_null(strstr(json, "inf,"));
        assert_null(strstr(json, "nan,"));
        free(json);
        rx_text_free(&brief);
        assert_int_equal(clear_folder(folder), PHOTOMETRY_FILES);
        rx_lab_close(r);
    }
}

/* ---- both ---- */

static void check_page(const char *folder)
{
    char command[700];
    char *page = slurp(folder, "report.html");
    assert_null(strstr(page, "<script"));
    assert_null(strchr(page, '\xff'));
    assert_non_null(strstr(page, "&lt;script&gt;alert(&#39;x&#39;)"));
    assert_non_null(strstr(page, "No figures"));
    assert_non_null(strstr(page, "</html>"));
    assert_null(strstr(page, folder));
    free(page);
    if (system("xmllint --version >/dev/null 2>&1") != 0) {
        print_message("xmllint is absent: HTML not parsed\n");
        return;
    }
    /* libxml2's parser is older than HTML 5: it does not know some tags, all else must be right */
    snprintf(
        command, sizeof command,
        "! xmllint --html --noout '%s/report.html' 2>&1 | grep 'error' | grep -v 'Tag [a-z]* invalid' >&2",
        folder);
    assert_int_equal(system(command), 0);
}

static void check_tables(const char *folder, const char *files)
{
    char command[900];
    if (system("/usr/bin/python3 -c 'import astropy' 2>/dev/null") != 0) {
        print_message("astropy is absent: ECSV not opened\n");
        return;
    }
    snprintf(command, sizeof command,
             "/usr/bin/python3 -c \"import json; from astropy.table import Table; "
             "json.load(open('%s/summary.json'));"
             "[print(f, len(Table.read('%s/' + f + '.ecsv'))) for f in '%s'.split()]\" >&2",
             folder, folder, files);
    assert_int_equal(system(command), 0);
}

static void pages_are_sound(void **state)
{
    char folder[512];
    (void)state;
    rx_lab *r = make_restoration(&small);
    rx_lab *p = make_photometry(&stars);
    snprintf(p->sky[0].about, sizeof p->sky[0].about, "%s", HOSTILE);
    new_folder(folder);
    assert_int_equal(rx_lab_report(r, OUTPUT(&plain, folder, NULL), NULL), RX_OK);
    check_page(folder);
    check_tables(folder, "bins cells boxes contests scenes");
    assert_int_equal(clear_folder(folder), RESTORATION_FILES);
    new_folder(folder);
    assert_int_equal(rx_lab_report(p, OUTPUT(&plain, folder, NULL), NULL), RX_OK);
    check_page(folder);
    check_tables(folder, "sets cells contests cuts curves");
    assert_int_equal(clear_folder(folder), PHOTOMETRY_FILES);
    rx_lab_close(r);
    rx_lab_close(p);
}

static void same_results_same_bytes(void **state)
{
    static const char *const files[] = {"report.html", "summary.json", "cells.ecsv", "contests.ecsv",
                                        "scenes.ecsv"};
    char folder[2][512];
    rx_campaign_record drawn = plain;
    (void)state;
    drawn.figures = 1;
    rx_lab *r = make_restoration(&small);
    for (int i = 0; i < 2; i++) {
        rx_text brief = {0};
        new_folder(folder[i]);
        assert_int_equal(rx_lab_report(r, OUTPUT(&drawn, folder[i], &brief), NULL), RX_OK);
        assert_non_null(strstr(brief.data, "RL_FLAT"));
        assert_non_null(strstr(brief.data, "RL against SMOOTHED, psnr of FWHM: "));
        assert_non_null(strstr(brief.data, "RL against BLURRED, psnr of FWHM: "));
        rx_text_free(&brief);
    }
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        char *a = slurp(folder[0], files[k]), *b = slurp(folder[1], files[k]);
        assert_string_equal(a, b);
        if (k == 0 && system("gnuplot --version >/dev/null 2>&1") == 0) {
            assert_null(strstr(a, "No figures"));
            assert_null(strstr(a, "not drawn"));
            assert_non_null(strstr(a, "<svg"));
        }
        free(a);
        free(b);
    }
    assert_int_equal(clear_folder(folder[0]), RESTORATION_FILES);
    assert_int_equal(clear_folder(folder[1]), RESTORATION_FILES);
    rx_lab_close(r);
}

static void photometry_has_figures(void **state)
{
    char folder[512];
    rx_campaign_record drawn = plain;
    (void)state;
    drawn.figures = 1;
    rx_lab *p = make_photometry(&stars);
    star_of(p, 1, 0, 0, 0)[RX_STAR_RATIO] = 0; /* no magnitude */
    new_folder(folder);
    assert_int_equal(rx_lab_report(p, OUTPUT(&drawn, folder, NULL), NULL), RX_OK);
    char *page = slurp(folder, "report.html");
    if (system("gnuplot --version >/dev/null 2>&1") == 0) {
        assert_null(strstr(page, "not drawn"));
        assert_non_null(strstr(page, "<svg"));
    } else {
        print_message("gnuplot is absent: figures not looked at\n");
    }
    free(page);
    assert_int_equal(clear_folder(folder), PHOTOMETRY_FILES);
    rx_lab_close(p);
}

static void folder_that_is_not_there(void **state)
{
    rx_error err = RX_ERROR_NONE;
    (void)state;
    rx_lab *r = make_restoration(&small);
    rx_lab *p = make_photometry(&stars);
    assert_int_equal(rx_lab_report(r, OUTPUT(&plain, "/no/such", NULL), &err), RX_SYSTEM);
    assert_string_equal(err.where, "the report/summary.json");
    assert_int_equal(rx_lab_report(p, OUTPUT(&plain, "/no/such", NULL), &err), RX_SYSTEM);
    assert_null(strstr(err.text, "/no/such"));
    rx_lab_close(r);
    rx_lab_close(p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(restoration_agrees_with_scipy),
        cmocka_unit_test(four_scenes_by_hand),
        cmocka_unit_test(who_meets_whom),
        cmocka_unit_test(the_papers_own_numbers),
        cmocka_unit_test(claims_about_the_network),
        cmocka_unit_test(bins_lie_where_their_noise_level_is),
        cmocka_unit_test(words_follow_the_numbers),
        cmocka_unit_test(adjusted_p_is_shown),
        cmocka_unit_test(logarithm_of_a_vanished_holm),
        cmocka_unit_test(ends_of_tuning_are_told),
        cmocka_unit_test(odd_restoration_results),
        cmocka_unit_test(photometry_agrees_with_scipy),
        cmocka_unit_test(depth_of_many_magnitudes),
        cmocka_unit_test(thresholds_by_hand),
        cmocka_unit_test(claims_about_photometry),
        cmocka_unit_test(claim_of_templates),
        cmocka_unit_test(odd_photometry_results),
        cmocka_unit_test(pages_are_sound),
        cmocka_unit_test(same_results_same_bytes),
        cmocka_unit_test(photometry_has_figures),
        cmocka_unit_test(folder_that_is_not_there),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
