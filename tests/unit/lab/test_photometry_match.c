/* Right, false and neither: stars among known objects. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "lab/photometry_match.h"

enum { STARS = 4, DETECTIONS = 9 };

static void verdicts(void **state)
{
    (void)state;
    /* star 0 is clear; star 1 lies near a brighter object, star 2 near a fainter one, star 3 is lost */
    const double sx[STARS] = {10, 50, 90, 130}, sy[STARS] = {20, 20, 20, 20};
    const rx_photometry_stars stars = {STARS, sx, sy, 100.0};
    rx_known known;
    assert_int_equal(rx_known_new(4, &known, NULL), RX_OK);
    const double kx[] = {51, 90.5, 200, 300}, kflux[] = {500, 50, 10, 1000}, kr[] = {4, 4, 4, 30};
    for (int i = 0; i < 4; i++) {
        known.x[i] = kx[i];
        known.y[i] = 20;
        known.flux[i] = kflux[i];
        known.radius[i] = kr[i];
    }
    const double x[DETECTIONS] = {
        10.5,  /* star 0 */
        11.8,  /* a second piece of star 0: false */
        50.8,  /* nearer to the brighter object than to star 1: the object's */
        90.4,  /* nearer to the fainter object than to star 2, which is the star's all the same */
        203,   /* within the radius of a known one: neither */
        205,   /* beyond it: false */
        325,   /* in a large galaxy: neither */
        132.5, /* too far from star 3: false */
        400,   /* nothing there: false */
    };
    const double y[DETECTIONS] = {20, 20, 20, 20, 20, 20, 20, 20, 20};
    const unsigned char wanted[DETECTIONS] = {0, 1, 0, 0, 0, 1, 0, 1, 1};
    long found[STARS];
    unsigned char is_false[DETECTIONS];
    assert_int_equal(rx_photometry_match(&stars, &known, DETECTIONS, x, y, 2.0, found, is_false, NULL),
                     RX_OK);
    assert_int_equal(found[0], 0);
    assert_int_equal(found[1], -1);
    assert_int_equal(found[2], 3);
    assert_int_equal(found[3], -1);
    assert_memory_equal(is_false, wanted, DETECTIONS);
    rx_known_free(&known);
}

/* A star beside a brighter object is found once both are. */
static void blends_told_apart(void **state)
{
    (void)state;
    const double sx[1] = {50}, sy[1] = {20}, x[2] = {50.2, 52.9}, y[2] = {20, 20};
    const rx_photometry_stars stars = {1, sx, sy, 100.0};
    rx_known known;
    long found;
    unsigned char is_false[2];
    assert_int_equal(rx_known_new(1, &known, NULL), RX_OK);
    known.x[0] = 53, known.y[0] = 20, known.flux[0] = 1000, known.radius[0] = 1;
    assert_int_equal(rx_photometry_match(&stars, &known, 2, x, y, 2.0, &found, is_false, NULL), RX_OK);
    assert_int_equal(found, 0);
    assert_false(is_false[0] || is_false[1]);
    rx_known_free(&known);
}

/* The map of what was found before the injection. */
static void covered_pixels_are_known(void **state)
{
    (void)state;
    const double x[3] = {3.4, 3.6, -7}, y[3] = {2, 2, 2};
    const rx_photometry_stars none = {0, NULL, NULL, 1.0};
    rx_known known;
    unsigned char is_false[3];
    assert_int_equal(rx_known_new(0, &known, NULL), RX_OK);
    known.width = 8;
    known.height = 4;
    known.covered = test_calloc(32, 1);
    known.covered[2 * 8 + 3] = 1;
    unsigned char *covered = known.covered;
    long found;
    assert_int_equal(rx_photometry_match(&none, &known, 3, x, y, 2.0, &found, is_false, NULL), RX_OK);
    assert_false(is_false[0]); /* rounds to pixel 3 */
    assert_true(is_false[1]);
    assert_true(is_false[2]); /* outside the map */
    known.covered = NULL;
    test_free(covered);
    rx_known_free(&known);
}

static void nothing_found(void **state)
{
    (void)state;
    const double sx[1] = {5}, sy[1] = {5};
    const rx_photometry_stars stars = {1, sx, sy, 1.0};
    const rx_known known = {0};
    long found = 7;
    unsigned char is_false;
    assert_int_equal(rx_photometry_match(&stars, &known, 0, NULL, NULL, 2.0, &found, &is_false, NULL), RX_OK);
    assert_int_equal(found, -1);
    assert_int_equal(rx_photometry_match(&stars, &known, 0, NULL, NULL, -1.0, &found, &is_false, NULL),
                     RX_USAGE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(verdicts),
        cmocka_unit_test(blends_told_apart),
        cmocka_unit_test(covered_pixels_are_known),
        cmocka_unit_test(nothing_found),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
