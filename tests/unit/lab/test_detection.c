/* The detection campaign: scenes as they are described, and what is measured on tiles whose answer is known. */
#include "../near.h"
#include "settings.h"

#include <math.h>

#include "lab/sources.h"

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
                                    "STARS,GALAXIES,PAIRS",
                                    "STAGE.DETECT_THRESH",
                                    "2",
                                    NULL};

static void methods_of_the_restorers(void **state)
{
    static const char *const pairs[] = {
        "RESTORE_TYPE", "NONE,RL,RL_BLIND", "TUNE_NITER", "5,20", "TUNE_FILTER", "0,0.5", NULL};
    static const char *const names[] = {"NONE",    "MATCHED",   "RL 5 0",  "RL 5 0.5",
                                        "RL 20 0", "RL 20 0.5", "RL_BLIND"};
    (void)state;
    rx_campaign_config *config = make_settings(pairs);
    rx_lab *campaign = open_lab(&rx_kind_detection, config, 1);
    assert_int_equal(campaign->nruns, 7);
    for (int m = 0; m < 7; m++)
        assert_string_equal(campaign->run[m].name, names[m]);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

static void check_pairs(const rx_lab_objects *objects)
{
    const rx_lab_object *o = objects->list;
    assert_true(objects->n >= 4);
    assert_int_equal(objects->n % 2, 0);
    for (long p = 0; p < objects->n; p += 2) {
        assert_near(hypot(o[p].x - o[p + 1].x, o[p].y - o[p + 1].y) / 3.0, 0.75, 0.251);
        assert_near(2.5 * log10(o[p].flux / o[p + 1].flux), 0, 0.501);
        assert_near(o[p].snr, 110.5, 90.6);
        for (long q = 0; q < p; q += 2)
            assert_true(hypot(o[p].x - o[q].x, o[p].y - o[q].y) >= 23.9);
    }
}

/* Stars lie beyond the border, too. A source that one of them makes at the border is not false, one farther in is. */
static void check_border(const rx_lab_sky *sky, const rx_lab_objects *objects)
{
    long outside = 0;
    rx_error err = RX_ERROR_NONE;
    for (long i = 0; i < objects->n; i++) {
        const rx_lab_object *o = &objects->list[i];
        const double beyond = rx_lab_beyond(sky, o->x, o->y);
        if (!(beyond > 0)) {
            assert_near(o->reach, 0, 0);
            continue;
        }
        outside++;
        rx_lab_object alone = *o;
        const double x = fmin(fmax(o->x, 0), sky->width - 1), y = fmin(fmax(o->y, 0), sky->height - 1);
        const double in = (sky->fwhm + 1) / beyond; /* from the border on, away from the star */
        const double xs[2] = {x, x + in * (x - o->x)}, ys[2] = {y, y + in * (y - o->y)};
        rx_matches matches;
        assert_int_equal(rx_lab_match(&(rx_lab_objects){.n = 1, .list = &alone},
                                      &(rx_match_list){.n = 2, .x = xs, .y = ys}, 1, &matches, &err),
                         RX_OK);
        assert_int_equal(o->role, RX_OTHER);
        assert_int_equal(matches.outcome[0], RX_IS_NEITHER);
        assert_int_equal(matches.outcome[1], RX_IS_FALSE);
        rx_matches_free(&matches);
    }
    assert_true(outside > 0);
}

static void scenes_are_as_described(void **state)
{
    (void)state;
    rx_campaign_config *config = make_settings(SMALL);
    rx_lab *campaign = open_lab(&rx_kind_detection, config, 1);
    assert_int_equal(campaign->nscenes, 3);
    for (int s = 0; s < campaign->nscenes; s++) {
        const rx_scene_id id = campaign->scene[s].id;
        rx_lab_tile tile;
        rx_error err = RX_ERROR_NONE;
        if (rx_detection_tile(campaign, &(rx_lab_unit){0, s, 0}, &tile, &err) != RX_OK)
            fail_msg("%s: %s", rx_scene_name(id), err.text);
        assert_true(tile.objects.n > 0);
        if (id == RX_SCENE_PAIRS)
            check_pairs(&tile.objects);
        if (id == RX_SCENE_STARS)
            assert_near(tile.objects.list[0].snr * sqrt(campaign->sky[0].area) * campaign->sky[0].sigma /
                            tile.objects.list[0].flux,
                        1, 1e-9);
        if (id == RX_SCENE_STARS)
            check_border(&campaign->sky[0], &tile.objects);
        rx_lab_tile_free(&tile);
    }
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* MATCH_RADIUS is 2 pixels: at a FWHM of 8 noise moves faint sources farther. */
static void the_seeing_widens_the_match(void **state)
{
    static const double radius[] = {2, 4};
    static const char *const seeing[] = {"SIM.IMAGE_SIZE", "192", "SEEING", "3,8", "SCENES", "STARS", NULL};
    (void)state;
    rx_campaign_config *config = make_settings(seeing);
    rx_lab *campaign = open_lab(&rx_kind_detection, config, 1);
    for (int i = 0; i < 2; i++) {
        const rx_tile tile = {.name = "tile", .width = 192, .height = 192};
        double pixels;
        assert_int_equal(rx_sources_radius(campaign, &campaign->sky[i], &tile, &pixels, NULL), RX_OK);
        assert_near(pixels, radius[i], 0.02);
    }
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

/* Bright stars are found by all with their flux; a pair has the lower S/N of both; the same bytes on one thread and on
 * four. */
static void units_give_what_is_known(void **state)
{
    rx_campaign_config *config = make_settings(SMALL);
    rx_lab *campaign = open_lab(&rx_kind_detection, config, 1);
    rx_unit_values *values = run_units(state, "one", campaign, 1),
                   *more = run_units(state, "four", campaign, 4);
    assert_int_equal(campaign->nunits, 3);
    assert_same_values(3, values, more);
    for (long u = 0; u < 3; u++) {
        const rx_scene_id id = campaign->scene[campaign->unit[u].scene].id;
        rx_lab_table table[RX_LAB_TABLES];
        tables_of(campaign, values, u, table);
        const rx_lab_table *object = &table[RX_SOURCES_OBJECT];
        long bright = 0, found = 0;
        assert_int_equal(table[RX_SOURCES_TILE].n, 1);
        assert_near(rx_lab_own(&table[RX_SOURCES_TILE], 0)[RX_TILE_MPIXELS], 1e-6 * 192 * 192, 1e-8);
        for (long i = 0; i < object->n; i++) {
            const double *own = rx_lab_own(object, i);
            assert_true(own[RX_OBJECT_SNR] >= 5);
            if (id == RX_SCENE_PAIRS)
                assert_near(own[RX_OBJECT_APART], 0.75, 0.251);
            for (int run = 0; run < campaign->nruns && id == RX_SCENE_STARS && own[RX_OBJECT_SNR] > 100;
                 run++) {
                const double *v = rx_lab_each(object, i, run);
                bright++;
                found += v[RX_FOUND_SCORE] > 10 && fabs(v[RX_FOUND_RATIO] - 1) < 0.15;
            }
        }
        assert_true(id != RX_SCENE_STARS || bright > 0);
        assert_true(10 * found >= 8 * bright); /* some are blended */
        assert_true(id != RX_SCENE_PAIRS || table[RX_SOURCES_FALSE].n == 0);
        rx_lab_tables_free(RX_SOURCES_TABLES, table);
    }
    rx_unit_values_free(3, values);
    rx_unit_values_free(3, more);
    rx_lab_close(campaign);
    rx_campaign_config_free(config);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(methods_of_the_restorers),
        cmocka_unit_test(scenes_are_as_described),
        cmocka_unit_test(the_seeing_widens_the_match),
        cmocka_unit_test_setup_teardown(units_give_what_is_known, make_scratch, remove_scratch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
