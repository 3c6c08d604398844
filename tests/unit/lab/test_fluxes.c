/* The campaign of fluxes: company of objects, scenes as they are described, objects that come out as they
 * went in, numbers of made results, verdicts. */
#include "../near.h"
#include "settings.h"
#include "verdict.h"

#include <math.h>

#include "config/keyword.h"
#include "lab/fluxes.h"

static const char *const SMALL[] = {"SIM.IMAGE_SIZE",
                                    "224",
                                    "SEEING",
                                    "3",
                                    "SCENE_TILES",
                                    "1",
                                    "RESTORE_TYPE",
                                    "NONE,RL",
                                    "STAGE.RL_NITER",
                                    "10",
                                    "SIM.PAIR_DISTANCE",
                                    "0.5,3",
                                    "SIM.PIXEL_SCALE",
                                    "0.396",
                                    "FLUX_SCENES",
                                    "FIELD,PAIRS,BLANK,RINGS,SHREDS",
                                    "STAGE.DETECT_THRESH",
                                    "2",
                                    NULL};

/* --- company --- */

/* FWHM 4: a pair within 1.5 FWHM and 2 mag; one that is 1.2 FWHM from a star 3 mag brighter; one with a faint
 * thing beside it, one with a source of the tile beside it, one alone. */
static void company_by_distance_and_brightness(void **state)
{
    static const struct {
        double x, flux, radius;
        rx_blend_state company;
        long partner;
    } what[] = {{0, 100, 0, RX_BLENDED, 1},      {5.9, 20, 0, RX_BLENDED, 0},
                {200, 1000, 0, RX_NEITHER, -1},  {204.8, 60, 0, RX_NEITHER, -1},
                {400, 1000, 0, RX_ISOLATED, -1}, {408, 9, 0, RX_NEITHER, -1},
                {600, 100, 0, RX_NEITHER, -1},   {800, 100, 3, RX_NEITHER, -1},
                {816, 50, 0, RX_NEITHER, -1},    {1000, 100, 0, RX_ISOLATED, -1}};
    enum { N = sizeof what / sizeof *what };
    const double others[][3] = {{611, 0, 90}, {1011, 0, 0.5}};
    rx_lab_object object[N];
    (void)state;
    for (int i = 0; i < N; i++)
        object[i] = (rx_lab_object){.x = what[i].x, .flux = what[i].flux, .radius = what[i].radius};
    rx_lab_company(&(rx_lab_objects){.n = N, .list = object}, 2, others, 4);
    for (int i = 0; i < N; i++) {
        if (object[i].company != what[i].company || object[i].partner != what[i].partner)
            fail_msg("object %d: company %d, partner %ld", i, (int)object[i].company, object[i].partner);
    }
    /* ten times as bright: one more FWHM */
    rx_lab_object two[] = {{.x = 0, .flux = 10}, {.x = 15.9, .flux = 100}, {.x = 100, .flux = 1}};
    rx_lab_company(&(rx_lab_objects){.n = 3, .list = two}, 0, NULL, 4);
    assert_int_equal(two[0].company, RX_NEITHER);
    two[1].x = 16.1;
    rx_lab_company(&(rx_lab_objects){.n = 3, .list = two}, 0, NULL, 4);
    assert_int_equal(two[0].company, RX_ISOLATED);
}

/* --- tiles --- */

static void check_pairs(const rx_lab_objects *objects)
{
    int galaxies = 0;
    assert_true(objects->n >= 8);
    assert_true(objects->n % 2 == 0);
    for (long i = 0; i < objects->n; i += 2) {
        const rx_lab_object *a = &objects->list[i], *b = a + 1;
        const double apart = hypot(a->x - b->x, a->y - b->y) / 3.0;
        const double mags = 2.5 * log10(a->flux / b->flux);
        assert_between(apart, 0.499, 3.001);
        assert_between(mags, -1e-6, 2.001);
        assert_int_equal(a->partner, i + 1);
        assert_int_equal(b->partner, i);
        galaxies += a->galaxy + b->galaxy;
        for (long k = 0; k < i; k += 2)
            assert_true(hypot(a->x - objects->list[k].x, a->y - objects->list[k].y) >= 23.9);
    }
    assert_true(galaxies > 0);
    assert_true(galaxies < objects->n);
}

static void scenes_are_as_described(void **state)
{
    (void)state;
    rx_campaign_config *config = make_settings(SMALL);
    rx_lab *campaign = open_lab(&rx_kind_fluxes, config, 1);
    const double sigma = campaign->sky[0].sigma, root = sqrt(campaign->sky[0].area);
    assert_int_equal(campaign->nunits, 5);
    for (int s = 0; s < campaign->nscenes; s++) {
        const rx_scene_id id = campaign->scene[s].id;
        rx_lab_tile tile;
        rx_error err = RX_ERROR_NONE;
        if (rx_lab_tile_make(campaign, &(rx_lab_unit){0, s, 0}, &tile, &err) != RX_OK)
            fail_msg("%s: %s", rx_scene_name(id), err.text);
        assert_int_equal(tile.objects.n == 0, id == RX_SCENE_BLANK);
        for (long i = 0; i < tile.objects.n; i++) {
            const rx_lab_object *o = &tile.objects.list[i];
            if (id != RX_SCENE_FIELD && id != RX_SCENE_MIXED_PAIRS)
                assert_int_equal(o->galaxy, id == RX_SCENE_SHREDS);
            if (!o->galaxy) /* without photon noise the bound is 1 over the S/N */
                assert_near(o->bound * o->snr, 1, 0.01);
            if (id == RX_SCENE_RINGS) {
                assert_true(o->snr > 299);
                assert_true(o->snr < 30100);
            }
            if (id == RX_SCENE_SHREDS) {
                assert_true(o->flux / (sigma * root) > 299);
                assert_true(o->flux / (sigma * root) < 3010);
            }
        }
        if (id == RX_SCENE_MIXED_PAIRS)
            check_pairs(&tile.objects);
        rx_lab_tile_free(&tile);
    }
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* Bright stars are found with their flux by template photometry; lengths are what the format says; the same
 * bytes on one thread and on four. */
static void units_give_what_is_known(void **state)
{
    rx_campaign_config *config = make_settings(SMALL);
    rx_lab *campaign = open_lab(&rx_kind_fluxes, config, 1);
    rx_unit_values *values = run_units(state, "one", campaign, 1),
                   *more = run_units(state, "four", campaign, 4);
    assert_int_equal(campaign->nunits, 5);
    assert_same_values(5, values, more);
    for (long u = 0; u < 5; u++) {
        rx_lab_table table[RX_LAB_TABLES];
        tables_of(campaign, values, u, table);
        const rx_lab_table *object = &table[RX_FLUXES_OBJECT];
        assert_int_equal(table[RX_FLUXES_TILE].n, 1);
        assert_near(rx_lab_own(&table[RX_FLUXES_TILE], 0)[RX_FLUXES_MPIXELS], 1e-6 * 224 * 224, 1e-7);
        for (int run = 0; run < campaign->nruns; run++) {
            const double *tally = rx_lab_each(&table[RX_FLUXES_TILE], 0, run);
            long found = 0;
            for (long i = 0; i < object->n; i++) {
                const double *v = rx_lab_each(object, i, run);
                found += !isnan(v[RX_FOUND]);
                if (campaign->scene[campaign->unit[u].scene].id != RX_SCENE_RINGS)
                    continue;
                assert_near(v[RX_FOUND], 0, 0); /* detected, not marked */
                assert_near(v[RX_RATIO_TEMPLATE], 1, 0.025);
                assert_near(v[RX_ERROR_TEMPLATE], 0.005, 0.00499);
            }
            assert_int_equal(found, (long)tally[RX_TALLY_RIGHT]);
            assert_true(tally[RX_TALLY_RIGHT_KEPT] <= tally[RX_TALLY_RIGHT]);
            assert_true(tally[RX_TALLY_FALSE_KEPT] <= tally[RX_TALLY_FALSE]);
        }
        rx_lab_tables_free(RX_FLUXES_TABLES, table);
    }
    rx_unit_values_free(5, values);
    rx_unit_values_free(5, more);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

static void settings_that_make_no_sense(void **state)
{
    static const struct {
        const char *pairs[9], *says;
    } wrong[] = {
        {{"CAMPAIGN_TYPE", "FLUXES", "FLUX_SCENES", "INJECTED", NULL}, "TILE_NAME"},
        {{"CAMPAIGN_TYPE", "FLUXES", "FLUX_SCENES", "INJECTED,FIELD", "TILE_NAME", "a.fits", NULL},
         "INJECTED stands alone"},
        {{"CAMPAIGN_TYPE", "FLUXES", "FLUX_SCENES", "INJECTED", "TILE_NAME", "a.fits", "SEEING", "3", NULL},
         "INJECTED stands alone"},
        {{"CAMPAIGN_TYPE", "FLUXES", "FLUX_SCENES", "FIELD,FIELD", NULL}, "FIELD is named twice"},
        {{"FLUXES", "AUTO,AUTO", NULL}, "AUTO is named twice"},
        {{"FIELDS", "SIMULATED,SIMULATED", NULL}, "SIMULATED is named twice"},
        {{"RESTORE_TYPE", "RL,NONE,RL", NULL}, "RL is named twice"},
        {{"SHRED_SNR", "300,30", NULL}, "300 is above 30"}};
    (void)state;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        rx_error err = RX_ERROR_NONE;
        rx_campaign_config *config = make_settings(wrong[i].pairs);
        assert_int_equal(rx_campaign_relations(&config->settings, &err), RX_USAGE);
        if (strstr(err.text, wrong[i].says) == NULL || strchr(err.text, '\n') != NULL)
            fail_msg("%s", err.text);
        rx_campaign_config_free(config);
    }
}

/* --- made results: a FIELD and a PAIRS of one condition, two restorers --- */

enum { OBJECTS = 42, PAIRED = 44 };

/* FIELD: 41 isolated stars of S/N 20, bound 0.05; number i has r = 1.02 + 0.01 (i - 20) with TEMPLATE of the
 * first restorer and an error of 0.1; the second one has r = 1.02 for all and misses the first ten. The last
 * object is a galaxy of S/N 7, which both find with r = 0.5. AUTO is twice TEMPLATE's. */
static void fill_field(rx_lab_set *set)
{
    rx_lab_table *object = &set->table[RX_FLUXES_OBJECT];
    rx_lab_own(&set->table[RX_FLUXES_TILE], 0)[RX_FLUXES_MPIXELS] = 2;
    object->n = OBJECTS;
    for (int i = 0; i < OBJECTS; i++) {
        double *prop = rx_lab_own(object, i);
        const int galaxy = i == OBJECTS - 1;
        prop[RX_PROP_SNR] = galaxy ? 7 : 20;
        prop[RX_PROP_GALAXY] = (float)galaxy;
        prop[RX_PROP_BLEND_STATE] = RX_ISOLATED;
        prop[RX_PROP_BOUND] = 0.05f;
        for (int run = 0; run < 2; run++) {
            double *v = rx_lab_each(object, i, run);
            const double r = galaxy ? 0.5 : run == 0 ? 1.02 + 0.01 * (i - 20) : 1.02;
            v[RX_FOUND] = run == 1 && i < 10 ? NAN : 0;
            for (int k = 0; k < RX_FLUX_KINDS; k++) {
                v[RX_RATIO + k] = (float)(k == RX_FLUX_TEMPLATE ? r : 2 * r);
                v[RX_ERROR + k] = 0.1f;
            }
        }
    }
    const double tally[RX_FLUXES_TALLIES] = {
        [RX_TALLY_RIGHT] = 90,     [RX_TALLY_RIGHT_KEPT] = 81, [RX_TALLY_FALSE] = 30,
        [RX_TALLY_FALSE_KEPT] = 9, [RX_TALLY_WEAK] = 20,       [RX_TALLY_WEAK_KEPT] = 15,
        [RX_TALLY_STRONG] = 70,    [RX_TALLY_STRONG_KEPT] = 66};
    memcpy(rx_lab_each(&set->table[RX_FLUXES_TILE], 0, 0), tally, sizeof tally);
}

/* PAIRS: 22 pairs 0.6 FWHM apart, the second member 1 mag fainter, of which the first restorer tells 20
 * apart: r of the first members 1.1, of the second ones 0.9; TEMPLATE 1 and 1. */
static void fill_pairs(rx_lab_set *set)
{
    rx_lab_table *object = &set->table[RX_FLUXES_OBJECT];
    for (int i = 0; i < PAIRED; i++) {
        double *prop = rx_lab_own(object, i);
        prop[RX_PROP_SNR] = 50;
        prop[RX_PROP_BLEND_STATE] = RX_BLENDED;
        prop[RX_PROP_BOUND] = 0.02f;
        prop[RX_PROP_PARTNER] = i % 2 ? -1 : 1;
        prop[RX_PROP_APART] = 0.6f;
        prop[RX_PROP_MAGS] = i % 2 ? 1 : -1;
        for (int run = 0; run < 2; run++) {
            double *v = rx_lab_each(object, i, run);
            v[RX_FOUND] = run == 1 || i == 0 ? NAN : i == 3 ? 2 : 0;
            v[RX_BOTH] = run == 0 && i >= 2;
            for (int k = 0; k < RX_FLUX_KINDS; k++) {
                v[RX_RATIO + k] = k == RX_FLUX_TEMPLATE ? 1 : i % 2 ? 0.9f : 1.1f;
                v[RX_ERROR + k] = 0.02f;
            }
        }
    }
}

static rx_lab *make_results(void)
{
    static const char *const names[] = {"NONE", "NET"};
    static const rx_scene_id scenes[] = {RX_SCENE_FIELD, RX_SCENE_MIXED_PAIRS};
    rx_lab *r = calloc(1, sizeof *r);
    double *row;
    r->kind = &rx_kind_fluxes;
    r->nruns = 2;
    r->nconditions = r->nskies = 1;
    r->sky = calloc(1, sizeof *r->sky);
    r->sky->fwhm = 4;
    r->set = calloc(2, sizeof *r->set);
    for (int run = 0; run < 2; run++)
        snprintf(r->run[run].name, sizeof r->run[run].name, "%s", names[run]);
    for (int s = 0; s < 2; s++) {
        assert_int_equal(rx_lab_add_scene(r, scenes[s], s, 0, NULL), RX_OK);
        for (int t = 0; t < RX_FLUXES_TABLES; t++)
            rx_lab_table_begin(&rx_fluxes_tables[t], 2, &r->set[s].table[t]);
        assert_int_equal(rx_lab_rows_add(&r->set[s].table[RX_FLUXES_TILE], 1, &row, NULL), RX_OK);
        row[RX_FLUXES_MPIXELS] = 1;
        assert_int_equal(rx_lab_rows_add(&r->set[s].table[RX_FLUXES_OBJECT], PAIRED, &row, NULL), RX_OK);
    }
    fill_field(&r->set[0]);
    fill_pairs(&r->set[1]);
    return r;
}

static rx_store *store_of(const rx_lab *lab)
{
    rx_store *store = NULL;
    assert_int_equal(rx_store_make(lab, 1, &store, NULL), RX_OK);
    return store;
}

#define CELL(...) rx_fluxes_at(m, RX_FLUXES_CELLS, (rx_fluxes_place){__VA_ARGS__})
#define PAIR(...) rx_fluxes_at(m, RX_FLUXES_PAIRS, (rx_fluxes_place){.scene = 1, __VA_ARGS__})
#define ALL .sample = RX_SAMPLE_ALL
#define BIN(bin) .snr = bin, .flux = RX_FLUX_TEMPLATE

/* By hand: the median of 1.02 + 0.01 (i - 20), i = 0..40, is 1.02, the median of |i - 20| is 10. */
static void cells_by_hand(void **state)
{
    (void)state;
    rx_lab *r = make_results();
    rx_store *m = store_of(r);
    const rx_estimate *cell = CELL(ALL, BIN(RX_SNR_ABOVE_10));
    const double mad = 1.4826 * 0.1, mag = 2.5 / log(10);
    assert_int_equal(cell[RX_CELL_BIAS].n, 41);
    assert_near(cell[RX_CELL_BIAS].value, -2.5 * log10(1.02), 1e-6);
    assert_near(cell[RX_CELL_BIAS].low, -2.5 * log10(1.02 + 1.96 * 1.2533 * mad / sqrt(41)), 1e-6);
    assert_near(cell[RX_CELL_SCATTER].value, mad * mag, 1e-6);
    assert_near(cell[RX_CELL_BOUND].value, mad / 0.05, 1e-4);
    assert_near(cell[RX_CELL_PULL].value, 0.2, 1e-5);
    assert_near(cell[RX_CELL_WIDTH].value, 1.4826, 1e-4);
    /* |0.02 + 0.01 k|, k = -20..20: 0.01 (sum of 1..22 and of 1..18) */
    assert_near(cell[RX_CELL_MAGERR].value, (253 + 171) / 41.0, 1e-3);
    assert_int_equal(CELL(ALL, BIN(2))[RX_CELL_BIAS].n, 41);       /* S/N 20 to 50 */
    assert_int_equal(CELL(ALL, BIN(1))[RX_CELL_BIAS].n, 0);        /* 10 to 20 */
    cell = CELL(.sample = RX_SAMPLE_COMMON, BIN(RX_SNR_ABOVE_10)); /* numbers 10 to 40 */
    assert_int_equal(cell[RX_CELL_BIAS].n, 31);
    assert_near(cell[RX_CELL_BIAS].value, -2.5 * log10(1.07), 1e-6);
    cell = CELL(.sample = RX_SAMPLE_COMMON, .snr = RX_SNR_ABOVE_10, .flux = RX_FLUX_AUTO);
    assert_near(cell[RX_CELL_BIAS].value, -2.5 * log10(2.14), 1e-6);
    cell = CELL(ALL, .kind = 1, .run = 1, BIN(0));
    assert_int_equal(cell[RX_CELL_BIAS].n, 1);
    assert_near(cell[RX_CELL_BIAS].value, -2.5 * log10(0.5), 1e-6);
    assert_int_equal(cell[RX_CELL_BOUND].n, 0);
    rx_store_free(m);
    rx_lab_close(r);
}

static void pairs_and_invented_by_hand(void **state)
{
    (void)state;
    rx_lab *r = make_results();
    rx_store *m = store_of(r);
    assert_near(PAIR(ALL)[RX_PAIR_BOTH].value, 21.0 / 22, 1e-12);
    assert_near(PAIR(.sample = RX_SAMPLE_DETECTED)[RX_PAIR_BOTH].value, 20.0 / 22, 1e-12);
    assert_near(PAIR(ALL, .run = 1)[RX_PAIR_BOTH].value, 0, 1e-12);
    assert_int_equal(PAIR(ALL, .separation = 1)[RX_PAIR_BOTH].n, 0);
    assert_int_equal(rx_fluxes_at(m, RX_FLUXES_PAIRS, (rx_fluxes_place){ALL})[RX_PAIR_BOTH].n, 0); /* FIELD */
    const rx_estimate *cell = PAIR(ALL, .flux = RX_FLUX_AUTO);
    assert_int_equal(cell[RX_PAIR_RATIO].n, 21);
    assert_near(cell[RX_PAIR_RATIO].value, -2.5 * log10(0.9 / 1.1), 1e-6);
    assert_near(cell[RX_PAIR_SIZE].value, -2.5 * log10(0.9 / 1.1), 1e-6);
    const double share = pow(10, -0.4);
    assert_near(cell[RX_PAIR_TOTAL].value, -2.5 * log10((1.1 + 0.9 * share) / (1 + share)), 1e-6);
    assert_near(PAIR(.flux = RX_FLUX_TEMPLATE)[RX_PAIR_SIZE].value, 0, 1e-9);
    /* blended: 43 are found, of 42 the partner, too */
    assert_int_equal(CELL(ALL, .scene = 1, .crowd = RX_CROWD_BLENDED, BIN(RX_SNR_ABOVE_10))->n, 43);
    assert_int_equal(CELL(ALL, .scene = 1, .crowd = RX_CROWD_APART, BIN(RX_SNR_ABOVE_10))->n, 42);
    assert_int_equal(CELL(.scene = 1, .crowd = RX_CROWD_APART, BIN(RX_SNR_ABOVE_10))->n, 41);
    const rx_estimate *v = rx_fluxes_at(m, RX_FLUXES_INVENTED, (rx_fluxes_place){0});
    assert_near(v[RX_INVENTED_RIGHT_KEPT].value, 81, 0);
    assert_near(v[RX_INVENTED_PER_MPIXEL].value, 15, 1e-12);
    assert_near(v[RX_INVENTED_PER_MPIXEL_KEPT].value, 4.5, 1e-12);
    assert_near(v[RX_INVENTED_PRECISION].value, 0.75, 1e-12);
    assert_near(v[RX_INVENTED_PRECISION_KEPT].value, 0.9, 1e-12);
    assert_near(v[RX_INVENTED_MARKED_WEAK].value, 0.25, 1e-12);
    assert_near(v[RX_INVENTED_MARKED_STRONG].value, 4.0 / 70, 1e-12);
    rx_store_free(m);
    rx_lab_close(r);
}

/* The first restorer's bias of -0.0215 mag is within its error of the limit, the second one's has none. Its
 * pairs are better than those of AUTO. */
static void verdicts_follow_the_numbers(void **state)
{
    (void)state;
    rx_lab *r = make_results();
    rx_store *m = store_of(r);
    rx_claim_verdicts all;
    rx_claims_judge(m, &all);
    assert_int_equal(verdict_of(&all, RX_GOAL_BIAS_ISOLATED, 0)->state, RX_GOAL_UNDECIDED);
    assert_int_equal(verdict_of(&all, RX_GOAL_BIAS_ISOLATED, 1)->state, RX_GOAL_NOT_HELD);
    assert_int_equal(verdict_of(&all, RX_GOAL_BIAS_BINS, 1)->state, RX_GOAL_NOT_HELD);
    assert_int_equal(verdict_of(&all, RX_GOAL_BIAS_BINS, 1)->all, 1);
    assert_int_equal(verdict_of(&all, RX_GOAL_BIAS_APART, 0)->state, RX_GOAL_HELD);
    assert_int_equal(verdict_of(&all, RX_GOAL_BIAS_APART, 1)->state, RX_GOAL_NOT_MEASURED);
    assert_int_equal(verdict_of(&all, RX_GOAL_BOUND, 0)->state, RX_GOAL_NOT_HELD); /* 2.97 */
    assert_int_equal(verdict_of(&all, RX_GOAL_MAGERR, 0)->state, RX_GOAL_HELD);
    assert_int_equal(verdict_of(&all, RX_GOAL_PAIRS, 0)->state, RX_GOAL_HELD);
    assert_int_equal(verdict_of(&all, RX_GOAL_PAIRS, 1)->state, RX_GOAL_NOT_MEASURED);
    assert_non_null(strstr(verdict_of(&all, RX_GOAL_BIAS_ISOLATED, 1)->said.data, "stars of FIELD"));
    rx_claim_verdicts_free(&all);
    /* what restorers are told wrongly is no matter of the goals */
    r->sky[0].condition.psf_error = 0.05;
    rx_claims_judge(m, &all);
    for (int i = 0; i < all.n; i++)
        assert_int_equal(all.list[i].state, RX_GOAL_NOT_MEASURED);
    rx_claim_verdicts_free(&all);
    rx_store_free(m);
    rx_lab_close(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(company_by_distance_and_brightness),
        cmocka_unit_test(scenes_are_as_described),
        cmocka_unit_test_setup_teardown(units_give_what_is_known, make_scratch, remove_scratch),
        cmocka_unit_test(settings_that_make_no_sense),
        cmocka_unit_test(cells_by_hand),
        cmocka_unit_test(pairs_and_invented_by_hand),
        cmocka_unit_test(verdicts_follow_the_numbers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
