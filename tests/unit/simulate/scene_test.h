/* What the tests of scenes share. */
#ifndef RX_TESTS_SCENE_TEST_H
#define RX_TESTS_SCENE_TEST_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>

#include "num/stats.h"
#include "simulate/scene.h"

static inline rx_scene_params plain(void)
{
    return (rx_scene_params){.width = 1024,
                             .height = 512,
                             .zeropoint = 25.0,
                             .pixel_scale = 0.4,
                             .stars = {100.0, 14.0, 22.0, 0.2},
                             .galaxies = {200.0, 16.0, 22.0, 0.4},
                             .galaxy_kind = RX_GALAXY_MIXED,
                             .galaxy_scale = 1.0,
                             .seed = 5,
                             .stream = 3};
}

static inline rx_scene *make(const rx_scene_params *par, const rx_templates *templates)
{
    rx_scene *scene = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_scene_make(par, templates, &scene, &err) != RX_OK)
        fail_msg("%s", err.text);
    return scene;
}

/* Largest distance of the distribution of n sorted values in 0..1 from the uniform one. */
static inline double distance_to_uniform(double *values, long n)
{
    double worst = 0.0;
    rx_sort(values, (size_t)n);
    for (long i = 0; i < n; i++)
        worst = fmax(worst, fmax(fabs(values[i] - (double)i / n), fabs(values[i] - (i + 1.0) / n)));
    return worst;
}

static inline void assert_same(const rx_object *a, const rx_object *b, long n)
{
    for (long i = 0; i < n; i++) {
        assert_true(a[i].type == b[i].type);
        assert_true(a[i].x == b[i].x);
        assert_true(a[i].y == b[i].y);
        assert_true(a[i].mag == b[i].mag);
        assert_true(a[i].flux == b[i].flux);
        assert_true(a[i].radius == b[i].radius);
        assert_true(a[i].angle == b[i].angle);
        assert_true(a[i].bulge_share == b[i].bulge_share);
        assert_true(a[i].arm_phase == b[i].arm_phase);
    }
}

#endif
