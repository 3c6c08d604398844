/* Where the objects of a scene are: border, clumps, pairs, distances, maps. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "scene_test.h"

static void test_uniform_places(void **state)
{
    (void)state;
    rx_scene_params par = plain();
    par.galaxies.count = 0.0;
    par.stars.count = 10000.0;
    const double margins[] = {0.0, 30.0, -100.0};
    for (int k = 0; k < 3; k++) {
        par.margin = margins[k];
        rx_scene *scene = make(&par, NULL);
        double *u = calloc(10000, sizeof *u), *v = calloc(10000, sizeof *v);
        for (long i = 0; i < 10000; i++) {
            u[i] = (scene->objects[i].x + 0.5 + par.margin) / (1024.0 + 2.0 * par.margin);
            v[i] = (scene->objects[i].y + 0.5 + par.margin) / (512.0 + 2.0 * par.margin);
        }
        assert_true(distance_to_uniform(u, 10000) < 0.0163);
        assert_true(distance_to_uniform(v, 10000) < 0.0163);
        free(u);
        free(v);
        rx_scene_free(scene);
    }
}

/* Pairs of objects within r: those of a Thomas process of one clump per 65536 pixels, sigma 20:
 * K(r) = pi r^2 + 65536 (1 - exp(-r^2 / 1600)). */
static void test_clumps(void **state)
{
    (void)state;
    rx_scene_params par = plain();
    par.width = par.height = 1024;
    par.stars.count = 300.0;
    par.galaxies.count = 300.0;
    for (int clumped = 0; clumped < 2; clumped++) {
        double pairs = 0.0;
        par.clustering = clumped;
        for (par.stream = 0; par.stream < 40; par.stream++) {
            rx_scene *scene = make(&par, NULL);
            for (long i = 0; i < scene->n; i++)
                for (long j = 0; j < i; j++)
                    pairs += hypot(scene->objects[i].x - scene->objects[j].x,
                                   scene->objects[i].y - scene->objects[j].y) < 30.0;
            rx_scene_free(scene);
        }
        double area = 1024.0 * 1024.0, k = 3.14159265 * 900.0;
        double expected = 40.0 * 0.5 * 600.0 * 600.0 / area;
        if (clumped)
            k += 65536.0 * (1.0 - exp(-900.0 / 1600.0));
        /* the border takes 2 % of the pairs; the 16 clumps of a scene are more or less apart */
        assert_true(fabs(pairs / (expected * k) - 1.0) < (clumped ? 0.15 : 0.05));
    }
}

static void test_pairs(void **state)
{
    (void)state;
    rx_scene_params par = plain();
    par.stars.count = 5000.0;
    par.galaxies.count = 0.0;
    par.pair_share = 0.3;
    par.pair_low = 2.0;
    par.pair_high = 4.0;
    rx_scene *scene = make(&par, NULL);
    rx_scene_params single = par;
    single.pair_share = 0.0;
    rx_scene *alone = make(&single, NULL);
    double separation[5000];
    long pairs = 0, at = 0;
    for (long i = 0; i < 5000; i++) {
        const rx_object *o = &scene->objects[at++];
        assert_same(o, &alone->objects[i], 1);
        if (at == scene->n || (i + 1 < 5000 && scene->objects[at].x == alone->objects[i + 1].x))
            continue;
        const rx_object *other = &scene->objects[at++];
        double distance = hypot(other->x - o->x, other->y - o->y);
        assert_true(distance >= 2.0);
        assert_true(distance <= 4.0);
        assert_true(fabs(other->mag - o->mag) <= 0.5);
        assert_true(fabs(other->flux / o->flux - pow(10.0, 0.4 * (o->mag - other->mag))) < 1e-12);
        separation[pairs++] = (distance - 2.0) / 2.0;
    }
    assert_int_equal(at, scene->n);
    assert_true(fabs(pairs / 5000.0 - 0.3) < 4.0 * sqrt(0.21 / 5000.0));
    assert_true(distance_to_uniform(separation, pairs) < 1.63 / sqrt((double)pairs));
    rx_scene_free(scene);
    rx_scene_free(alone);
}

static void test_least_distance(void **state)
{
    (void)state;
    rx_scene_params par = plain();
    par.clustering = 0.5;
    par.least_distance = 12.0;
    rx_scene *scene = make(&par, NULL);
    assert_true(scene->n > 250);
    assert_true(scene->n + scene->left_out == 300);
    for (long i = 0; i < scene->n; i++)
        for (long j = 0; j < i; j++)
            assert_true(hypot(scene->objects[i].x - scene->objects[j].x,
                              scene->objects[i].y - scene->objects[j].y) >= 12.0);
    rx_scene_free(scene);
    /* a companion may be near its star, but near no other */
    par.pair_share = 1.0;
    par.pair_low = 3.0;
    par.pair_high = 5.0;
    par.galaxies.count = 0.0;
    scene = make(&par, NULL);
    assert_true(scene->n > 150);
    for (long i = 0; i < scene->n; i++) {
        int near = 0;
        for (long j = 0; j < scene->n; j++)
            near += j != i && hypot(scene->objects[i].x - scene->objects[j].x,
                                    scene->objects[i].y - scene->objects[j].y) < 12.0;
        assert_true(near <= 1);
    }
    rx_scene_free(scene);
    /* no room: what finds no place is left out and counted */
    par = plain();
    par.width = par.height = 30;
    par.least_distance = 20.0;
    scene = make(&par, NULL);
    assert_true(scene->n >= 2);
    assert_true(scene->n < 8);
    assert_true(scene->left_out == 300 - scene->n);
    rx_scene_free(scene);
}

/* Distances that the field is no multiple of, small and large against it, on both axes. */
static void test_any_least_distance(void **state)
{
    (void)state;
    rx_scene_params par = plain();
    par.stars.count = 400.0;
    par.galaxies.count = 0.0;
    const double distances[] = {9.7, 15.1, 26.0, 34.0, 51.0, 99.0};
    for (par.stream = 0; par.stream < 20; par.stream++)
        for (size_t k = 0; k < sizeof distances / sizeof *distances; k++) {
            par.width = 101;
            par.height = 68 + (int)par.stream;
            par.least_distance = distances[k];
            rx_scene *scene = make(&par, NULL);
            assert_true(scene->n >= 1);
            for (long i = 0; i < scene->n; i++)
                for (long j = 0; j < i; j++)
                    assert_true(hypot(scene->objects[i].x - scene->objects[j].x,
                                      scene->objects[i].y - scene->objects[j].y) >= distances[k]);
            rx_scene_free(scene);
        }
}

static void test_allowed(void **state)
{
    (void)state;
    rx_scene_params par = plain();
    unsigned char *map = calloc((size_t)par.width * (size_t)par.height, 1);
    for (int y = 100; y < 140; y++)
        for (int x = 700; x < 800; x++)
            map[y * par.width + x] = 1;
    par.allowed = map;
    par.margin = 50.0;
    par.pair_share = 0.5;
    par.pair_low = 1.0;
    par.pair_high = 20.0;
    rx_scene *scene = make(&par, NULL);
    assert_true(scene->n > 250);
    for (long i = 0; i < scene->n; i++) {
        long x = lround(scene->objects[i].x), y = lround(scene->objects[i].y);
        assert_true(x >= 700);
        assert_true(x < 800);
        assert_true(y >= 100);
        assert_true(y < 140);
    }
    rx_scene_free(scene);
    memset(map, 0, (size_t)par.width * (size_t)par.height);
    par.pair_share = 0.0;
    scene = make(&par, NULL);
    assert_true(scene->n == 0);
    assert_true(scene->left_out == 300);
    rx_scene_free(scene);
    free(map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_uniform_places),
        cmocka_unit_test(test_clumps),
        cmocka_unit_test(test_pairs),
        cmocka_unit_test(test_least_distance),
        cmocka_unit_test(test_any_least_distance),
        cmocka_unit_test(test_allowed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
