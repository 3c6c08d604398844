/* The detection campaign: scenes as they are described, judgements on tiles whose answer is known, numbers of
 * made results. */
#include "../near.h"
#include "settings.h"

#include <math.h>

#include "lab/detection_numbers.h"

static const char *const SMALL[] = {"SIM.IMAGE_SIZE",
                                    "192",
                                    "SEEING",
                                    "3",
                                    "SCENE_TILES",
                                    "1",
                                    "TUNE_NITER",
                                    "5",
                                    "TUNE_FILTER",
                                    "0.5",
                                    "SIM.NOISE_TYPE",
                                    "GAUSS",
                                    "SIM.STAR_COUNT",
                                    "400",
                                    "SCENES",
                                    "STARS,GALAXIES,PAIRS,BLANK,RINGS,PLATEAU,OUTSKIRTS",
                                    "STAGE.DETECT_THRESH",
                                    "2",
                                    NULL};

static rx_detection_state *open_campaign(const rx_campaign_config *config)
{
    void *state = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_kind_detection.open(config, 1, NULL, &state, &err) != RX_OK)
        fail_msg("%s", err.text);
    return state;
}

static void methods_of_the_restorers(void **state)
{
    static const char *const pairs[] = {
        "RESTORE_TYPE", "NONE,RL,RL_BLIND", "TUNE_NITER", "5,20", "TUNE_FILTER", "0,0.5", NULL};
    static const char *const names[] = {"NONE",    "MATCHED",   "RL 5 0",  "RL 5 0.5",
                                        "RL 20 0", "RL 20 0.5", "RL_BLIND"};
    (void)state;
    rx_campaign_config *config = make_settings(pairs);
    rx_detection_state *campaign = open_campaign(config);
    assert_int_equal(campaign->nmethods, 7);
    for (int m = 0; m < 7; m++)
        assert_string_equal(campaign->method[m].name, names[m]);
    rx_kind_detection.close(campaign);
    rx_campaign_config_free(config);
}

static void check_pairs(const rx_detection_tile *tile)
{
    assert_true(tile->n >= 4 && tile->n % 2 == 0);
    for (long p = 0; p < tile->n / 2; p++) {
        const double apart =
            hypot(tile->x[2 * p] - tile->x[2 * p + 1], tile->y[2 * p] - tile->y[2 * p + 1]) / 3.0;
        assert_true(apart >= 0.499 && apart <= 1.001);
        assert_true(fabs(2.5 * log10(tile->flux[2 * p] / tile->flux[2 * p + 1])) <= 0.501);
        assert_true(tile->snr[2 * p] >= 19.9 && tile->snr[2 * p] <= 201);
        for (long q = 0; q < p; q++)
            assert_true(hypot(tile->x[2 * p] - tile->x[2 * q], tile->y[2 * p] - tile->y[2 * q]) >= 23.9);
    }
}

/* The values of the plateau; sky and noise are told exactly. */
static void check_plateau(const rx_detection_state *campaign, const rx_detection_tile *tile)
{
    const rx_field *field = tile->field;
    const double sigma = campaign->sky[0].sigma, sky = campaign->config->sim->sky_level;
    assert_near(field->tile->pixels[96 * 192 + 96], sky + 200 * sigma, 1e-3);
    assert_near(field->tile->pixels[4 * 192 + 4], sky, 1e-3);
    const rx_map levels = rx_background_level(field->plain), noise = rx_background_noise(field->restored);
    assert_near(rx_map_at(&noise, 5, 0), sigma, 1e-6);
    assert_near(rx_map_at(&levels, 5, 0), sky, 1e-3);
}

static void scenes_are_as_described(void **state)
{
    (void)state;
    rx_campaign_config *config = make_settings(SMALL);
    rx_detection_state *campaign = open_campaign(config);
    for (int k = 0; k < RX_SCENE_KINDS; k++) {
        rx_detection_tile tile;
        rx_error err = RX_ERROR_NONE;
        if (rx_detection_tile_make(campaign, 0, (rx_detection_scene)k, 0, &tile, &err) != RX_OK)
            fail_msg("%s: %s", rx_detection_scene_name((rx_detection_scene)k), err.text);
        if (k == RX_SCENE_BLANK || k == RX_SCENE_PLATEAU)
            assert_int_equal(tile.n, 0);
        else
            assert_true(tile.n > 0);
        if (k == RX_SCENE_PAIRS)
            check_pairs(&tile);
        if (k == RX_SCENE_PLATEAU)
            check_plateau(campaign, &tile);
        if (k == RX_SCENE_STARS)
            assert_near(tile.snr[0] * sqrt(campaign->sky[0].area) * campaign->sky[0].sigma / tile.flux[0], 1,
                        1e-9);
        assert_int_equal(tile.truth[0] != NULL && tile.truth[1] != NULL, k == RX_SCENE_OUTSKIRTS);
        rx_detection_tile_free(&tile);
    }
    rx_kind_detection.close(campaign);
    rx_campaign_config_free(config);
}

/* Bright stars are found by all, a plateau comes back flat, aperture fluxes of an unrestored image are those
 * of the truth; the same bytes on one thread and on four. */
static void units_give_what_is_known(void **state)
{
    rx_campaign_config *config = make_settings(SMALL);
    rx_detection_state *campaign = open_campaign(config);
    long n = 0, again = 0;
    rx_unit_values *values = run_units(state, "one", &rx_kind_detection, campaign, 1, &n);
    rx_unit_values *more = run_units(state, "four", &rx_kind_detection, campaign, 4, &again);
    assert_int_equal(n, 7);
    assert_int_equal(again, n);
    assert_same_values(n, values, more);
    for (long u = 0; u < n; u++) { /* lengths are what the format says */
        const double *v = values[u].v;
        const long objects = (long)v[0];
        v += 2 + RX_DETECTION_PROPS * objects;
        for (int m = 0; m < campaign->nmethods; m++) {
            const double *first = v;
            v += rx_detection_columns(campaign->scene[u]) * objects;
            for (long i = 0; i < objects && campaign->scene[u] == RX_SCENE_RINGS; i++)
                assert_true(first[i] > 10);
            if (campaign->scene[u] == RX_SCENE_PLATEAU)
                assert_true(first[0] < 1e-3 && first[1] < 1e-3 && first[2] < 4e-3);
            if (campaign->scene[u] == RX_SCENE_OUTSKIRTS && m == 0)
                for (long i = 0; i < objects; i++)
                    /* noise of an aperture of 4 r50: some 1 / (S/N) (area / matched area)^0.5 of the flux */
                    assert_near(first[6 * i + 1], first[6 * i + 4],
                                25 / values[u].v[2 + RX_DETECTION_PROPS * i]);
            v += 1 + 2 * (long)*v;
        }
        assert_ptr_equal(v, values[u].v + values[u].n);
    }
    rx_unit_values_free(n, values);
    rx_unit_values_free(n, more);
    rx_kind_detection.close(campaign);
    rx_campaign_config_free(config);
}

/* --- made results: STARS, PAIRS, BLANK of one condition; NONE, MATCHED, two settings of RL, NET --- */

enum { STARS = 100, RUNS = 5 };

static rx_detection_results *make_results(int net_better)
{
    static const char *const names[RUNS] = {"NONE", "MATCHED", "RL 5 0", "RL 9 0", "NET"};
    static const int found[RUNS] = {50, 60, 55, 65, 80}, apart[RUNS] = {10, 5, 20, 15, 30};
    static const rx_detection_scene scenes[] = {RX_SCENE_STARS, RX_SCENE_PAIRS, RX_SCENE_BLANK};
    rx_detection_results *r = calloc(1, sizeof *r);
    r->nmethods = RUNS;
    r->nconditions = 1;
    r->nscenes = 3;
    r->condition = calloc(1, sizeof *r->condition);
    r->set = calloc(3, sizeof *r->set);
    r->nprecisions = 2;
    r->precision[0] = 0.9;
    r->precision[1] = 0.99;
    r->truth_snr = 5;
    for (int m = 0; m < RUNS; m++) {
        snprintf(r->method[m], sizeof r->method[m], "%s", names[m]);
        r->tuned[m] = m == 2 || m == 3;
    }
    for (int s = 0; s < 3; s++) {
        rx_detection_set *set = &r->set[s];
        *set = (rx_detection_set){.scene = scenes[s], .fwhm = 4, .columns = 1, .ntiles = 1, .mpixels = 2};
        set->n = s < 2 ? STARS : 0;
        set->prop = calloc(2 * STARS, sizeof *set->prop);
        for (int i = 0; i < STARS; i++) {
            set->prop[2 * i] = i < 50 ? 30 : 7;
            set->prop[2 * i + 1] = i % 2 ? 0.6f : 0.9f;
        }
        for (int m = 0; m < RUNS; m++) {
            rx_detection_tally *run = &set->run[m];
            const int right = s == 0 ? (m == 4 && !net_better ? 61 : found[m]) : apart[m];
            run->value = calloc(STARS, sizeof *run->value);
            run->nfalse = s == 0 ? 10 : s == 2 ? 6 : 0;
            run->false_score = calloc(10, sizeof *run->false_score);
            run->false_distance = calloc(10, sizeof *run->false_distance);
            for (int i = 0; i < STARS; i++) /* scores 200, 199 ... */
                run->value[i] = i < right ? (float)(200 - i) : NAN;
            for (int i = 0; i < run->nfalse; i++) /* scores below those of all right ones */
                run->false_score[i] = s == 0 ? (float)(50 - i) : (float)(250 - 50 * i);
        }
    }
    return r;
}

/* By hand: all right detections come before the false ones, so ap is the recall; precision 0.9 allows
 * right / 9 false ones. */
static void numbers_by_hand(void **state)
{
    (void)state;
    rx_detection_results *r = make_results(1);
    rx_detection_numbers m;
    assert_int_equal(rx_detection_numbers_make(r, 1, &m, NULL), RX_OK);
    assert_int_equal(m.best, RUNS);
    assert_int_equal(m.net, 4);
    assert_int_equal(m.nrivals, 3);
    assert_string_equal(rx_detection_column_name(&m, m.best), "RL");
    const rx_detection_cell *none = rx_detection_cell_of(&m, 0, 0, 0);
    assert_near(none->value[0].value, 0.5, 1e-12);       /* ap */
    assert_near(none->value[1].value, 0.5, 1e-12);       /* recall at 0.9 */
    assert_near(none->value[4].value, 50.0 / 60, 1e-12); /* precision of the list */
    assert_near(none->value[5].value, 5, 1e-12);         /* 10 false in 2 Mpixels */
    assert_near(none->value[6].value, 0, 1e-12);         /* of S/N 5 to 10: numbers 50 to 99 */
    assert_near(none->value[8].value, 1, 1e-12);         /* of S/N 20 to 50: numbers 0 to 49 */
    /* RL at its best: for lists by ap, for pairs by pairs */
    const rx_detection_cell *best = rx_detection_cell_of(&m, 0, 0, m.best);
    assert_string_equal(best->chosen[0], "RL 9 0");
    assert_near(best->value[0].value, 0.65, 1e-12);
    best = rx_detection_cell_of(&m, 0, 1, m.best);
    assert_string_equal(best->chosen[0], "RL 5 0");
    assert_near(best->value[0].value, 0.2, 1e-12);
    /* pairs of even number are wide: 15 of 50 for NET */
    assert_near(rx_detection_cell_of(&m, 0, 1, 4)->value[2].value, 0.3, 1e-12);
    /* BLANK at the cut of precision 0.99, the score of the last star found (200 - 49): 200, 250 are above */
    assert_near(rx_detection_cell_of(&m, 0, 2, 0)->value[0].value, 1, 1e-12);
    assert_near(rx_detection_cell_of(&m, 0, 2, 0)->value[1].value, 3, 1e-12);
    /* NET has 20 stars that the matched filter lacks, and lacks none */
    const rx_detection_duel *duel = rx_detection_duel_of(&m, 0, 0, 1);
    assert_int_equal(duel->only_first, 20);
    assert_int_equal(duel->only_second, 0);
    assert_near(duel->p, ldexp(1, -19), 1e-9);
    rx_detection_numbers_free(&m);
    rx_detection_results_free(r);
}

static rx_claim_state state_of(int better, rx_claim_id claim)
{
    rx_claim_verdict verdict[RX_CLAIM_COUNT];
    rx_claim_state state = RX_NOT_TESTED;
    rx_detection_numbers m;
    int n = 0;
    rx_detection_results *r = make_results(better);
    assert_int_equal(rx_detection_numbers_make(r, 1, &m, NULL), RX_OK);
    rx_detection_verdicts(&m, verdict, &n);
    for (int i = 0; i < n; i++)
        if (verdict[i].claim == claim)
            state = verdict[i].state;
    rx_claim_verdicts_free(n, verdict);
    rx_detection_numbers_free(&m);
    rx_detection_results_free(r);
    return state;
}

static void verdicts_follow_the_numbers(void **state)
{
    (void)state;
    assert_int_equal(state_of(1, RX_CLAIM_LISTS), RX_REPRODUCED);
    assert_int_equal(state_of(0, RX_CLAIM_LISTS), RX_NOT_REPRODUCED); /* 0.61 against RL's 0.65 */
    assert_int_equal(state_of(1, RX_CLAIM_PAIRS), RX_REPRODUCED);
    assert_int_equal(state_of(1, RX_CLAIM_PLATEAU), RX_NOT_YET_TESTABLE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(methods_of_the_restorers),
        cmocka_unit_test(scenes_are_as_described),
        cmocka_unit_test_setup_teardown(units_give_what_is_known, make_scratch, remove_scratch),
        cmocka_unit_test(numbers_by_hand),
        cmocka_unit_test(verdicts_follow_the_numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
