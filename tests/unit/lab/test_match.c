/* Right, false and neither: stars among known objects. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "lab/sources.h"

enum { OBJECTS = 8, DETECTIONS = 9 };

static void check(const rx_lab_objects *objects, const rx_match_list *list, const long *found,
                  const unsigned char *outcome)
{
    rx_matches m;
    assert_int_equal(rx_lab_match(objects, list, 2.0, &m, NULL), RX_OK);
    for (long i = 0; i < objects->n; i++)
        assert_int_equal(m.found[i], found[i]);
    for (long k = 0; k < list->n; k++)
        assert_int_equal(m.outcome[k], outcome[k]);
    rx_matches_free(&m);
}

/* Stars among known objects: star 0 is clear; star 1 lies near a brighter object, star 2 near a fainter one, star 3 is
 * lost. */
static void stars_among_what_is_known(void **state)
{
    rx_lab_object list[OBJECTS] = {
        {.x = 10, .y = 20},
        {.x = 50, .y = 20},
        {.x = 90, .y = 20},
        {.x = 130, .y = 20},
        {.x = 51, .y = 20, .reach = 4, .role = RX_RIVAL},
        {.x = 90.5, .y = 20, .reach = 4, .role = RX_OTHER},
        {.x = 200, .y = 20, .reach = 4, .role = RX_OTHER},
        {.x = 300, .y = 20, .reach = 30, .role = RX_RIVAL},
    };
    const double x[DETECTIONS] = {
        10.5,  /* star 0 */
        11.8,  /* a second piece of star 0: false */
        50.8,  /* nearer to the brighter object than to star 1: the object's */
        90.4,  /* nearer to the fainter object than to star 2, which is the star's all the same */
        203,   /* within the reach of a known one: neither */
        205,   /* beyond it: false */
        325,   /* in a large galaxy: neither */
        132.5, /* too far from star 3: false */
        400,   /* nothing there: false */
    };
    const double y[DETECTIONS] = {20, 20, 20, 20, 20, 20, 20, 20, 20};
    const long found[OBJECTS] = {0, -1, 3, -1, -1, -1, -1, -1};
    const unsigned char outcome[DETECTIONS] = {RX_IS_RIGHT,   RX_IS_FALSE,   RX_IS_NEITHER,
                                               RX_IS_RIGHT,   RX_IS_NEITHER, RX_IS_FALSE,
                                               RX_IS_NEITHER, RX_IS_FALSE,   RX_IS_FALSE};
    check(&(rx_lab_objects){.n = OBJECTS, .list = list}, &(rx_match_list){DETECTIONS, x, y, NULL}, found,
          outcome);
}

/* Others without a reach take what is left one to one; what is not in use is neither. */
static void others_take_what_is_left(void **state)
{
    rx_lab_object list[] = {{.x = 10}, {.x = 11.5, .role = RX_OTHER}, {.x = 50, .role = RX_OTHER}};
    const double x[] = {11.4, 11.0, 50, 51, 9}, y[5] = {0};
    const unsigned char use[] = {1, 1, 1, 1, 0};
    const long found[] = {1, -1, -1}; /* of 11.0 and 9 the second is not in use */
    const unsigned char outcome[] = {RX_IS_NEITHER, RX_IS_RIGHT, RX_IS_NEITHER, RX_IS_FALSE, RX_IS_NEITHER};
    check(&(rx_lab_objects){.n = 3, .list = list}, &(rx_match_list){5, x, y, use}, found, outcome);
}

/* A star beside a brighter object is found once both are. */
static void blends_are_resolved(void **state)
{
    rx_lab_object list[] = {{.x = 50, .y = 20}, {.x = 53, .y = 20, .reach = 1, .role = RX_RIVAL}};
    const double x[2] = {50.2, 52.9}, y[2] = {20, 20};
    check(&(rx_lab_objects){.n = 2, .list = list}, &(rx_match_list){2, x, y, NULL}, (const long[]){0, -1},
          (const unsigned char[]){RX_IS_RIGHT, RX_IS_NEITHER});
}

/* The map of what was found before the injection: the first rounds to its pixel, the last lies outside. */
static void covered_pixels_are_known(void **state)
{
    const double x[3] = {3.4, 3.6, -7}, y[3] = {2, 2, 2};
    unsigned char covered[32] = {[2 * 8 + 3] = 1};
    check(&(rx_lab_objects){.width = 8, .height = 4, .covered = covered}, &(rx_match_list){3, x, y, NULL},
          NULL, (const unsigned char[]){RX_IS_NEITHER, RX_IS_FALSE, RX_IS_FALSE});
}

static void nothing_found(void **state)
{
    rx_lab_object one = {.x = 5, .y = 5};
    const rx_lab_objects objects = {.n = 1, .list = &one};
    rx_matches m;
    check(&objects, &(rx_match_list){0, NULL, NULL, NULL}, (const long[]){-1}, NULL);
    assert_int_equal(rx_lab_match(&objects, &(rx_match_list){0, NULL, NULL, NULL}, -1.0, &m, NULL), RX_USAGE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stars_among_what_is_known),
        cmocka_unit_test(others_take_what_is_left),
        cmocka_unit_test(blends_are_resolved),
        cmocka_unit_test(covered_pixels_are_known),
        cmocka_unit_test(nothing_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
