/* Apertures, Kron and half-light radii and windowed positions against sep's, on isolated sources without masks, which is what
 * sep measures, too. Prints what it finds with RX_TEST_PRINT set: the table of docs/from-sextractor.md. */
#include <stdio.h>
#include <time.h>

#include "../detect/field.h"
#include "../near.h"
#include "measure/measure.h"
#include <sep.h>

enum { SIDE = 600, STEP = 60, KINDS = 5 };
static const double DIAMETER = 11.0;

typedef struct outcome {
    double worst, ours, seps; /* relative, or pixels; seconds */
} outcome;

static rx_measure_params params(unsigned skip)
{
    return (rx_measure_params){.naper = 1,
                               .aperture_diameter = {DIAMETER},
                               .auto_factor = 2.5,
                               .auto_min_radius = 3.5,
                               .nradii = 1,
                               .flux_fraction = {0.5},
                               .neighbours = RX_NEIGHBOURS_NONE,
                               .skip = skip,
                               .nthreads = 1};
}

static double seconds(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double relative(double value, double of)
{
    return fabs(value / of - 1);
}

static void agree_on_isolated_sources(void **state)
{
    static const char *const names[KINDS] = {"FLUX_APER", "KRON_RADIUS", "FLUX_AUTO", "FLUX_RADIUS",
                                             "XWIN_IMAGE"};
    field f = field_new(SIDE, SIDE, 1.0, 7);
    outcome found[KINDS] = {{0}};
    for (int i = 0; i < SIDE / STEP; i++)
        for (int j = 0; j < SIDE / STEP; j++) {
            const double u = rx_random_uniform(7, 2, (uint64_t)(100 * i + j)),
                         v = rx_random_uniform(7, 3, (uint64_t)(100 * i + j));
            field_add(&f, STEP * (i + 0.5) + u, STEP * (j + 0.5) + v, 1.2 + 2 * u, 1.2 + 2 * v,
                      2000 * exp(4 * u));
        }
    rx_detect_params detect = field_params();
    detect.threshold = detect.analysis_threshold = 5;
    rx_sources *s = field_detect(&f, &detect);
    rx_image image = field_image(&f);
    rx_measure_params par = params(RX_SKIP_PETRO);
    assert_int_equal(rx_measure_run(&par, &image, NULL, NULL, s, NULL), RX_OK);
    assert_true(s->n > 90);
    sep_image im = {.data = f.pixels,
                    .dtype = SEP_TFLOAT,
                    .w = SIDE,
                    .h = SIDE,
                    .noiseval = 1,
                    .noise_type = SEP_NOISE_STDDEV};
    for (int i = 0; i < s->n; i++) {
        const rx_source *o = &s->list[i];
        double sum, error, area, kron, half, x, y, fraction = 0.5;
        int steps;
        short flag;
        double begun = seconds();
        assert_int_equal(sep_sum_circle(&im, o->x, o->y, DIAMETER / 2, 0, 5, 0, &sum, &error, &area, &flag),
                         0);
        found[0].seps += seconds() - begun;
        found[0].worst = fmax(found[0].worst, relative(o->flux_aper[0], sum));
        assert_near(o->fluxerr_aper[0], error, 0.01 * error);

        begun = seconds();
        assert_int_equal(sep_kron_radius(&im, o->x, o->y, o->cxx, o->cyy, o->cxy, 6, 0, &kron, &flag), 0);
        const double radius = fmax(2.5 * kron, 3.5);
        assert_int_equal(sep_sum_ellipse(&im, o->x, o->y, o->a, o->b, o->theta, radius, 0, 1, 0, &sum, &error,
                                         &area, &flag),
                         0);
        found[2].seps += seconds() - begun;
        found[1].worst = fmax(found[1].worst, relative(o->kron_radius, radius));
        found[2].worst = fmax(found[2].worst, relative(o->flux_auto, sum));

        begun = seconds();
        assert_int_equal(
            sep_flux_radius(&im, o->x, o->y, 6 * o->a, 0, 5, 0, &o->flux_auto, &fraction, 1, &half, &flag),
            0);
        found[3].seps += seconds() - begun;
        found[3].worst = fmax(found[3].worst, fabs(o->flux_radius[0] - half));

        begun = seconds();
        assert_int_equal(
            sep_windowed(&im, o->x, o->y, 2 / 2.35 * o->flux_radius[0], 11, 0, &x, &y, &steps, &flag), 0);
        found[4].seps += seconds() - begun;
        found[4].worst = fmax(found[4].worst, hypot(o->xwin - x, o->ywin - y));
    }
    static const unsigned only[KINDS] = {[0] = ~RX_SKIP_APER,
                                         [2] = ~RX_SKIP_AUTO,
                                         [3] = ~(RX_SKIP_RADIUS | RX_SKIP_AUTO),
                                         [4] = ~(RX_SKIP_WIN | RX_SKIP_AUTO)};
    double rest = 0;
    for (int k = -1; k < KINDS && getenv("RX_TEST_PRINT") != NULL; k++) {
        par = params(k < 0 ? ~0u : only[k]);
        const double begun = seconds();
        for (int again = 0; again < 20; again++)
            assert_int_equal(rx_measure_run(&par, &image, NULL, NULL, s, NULL), RX_OK);
        const double taken = (seconds() - begun) / 20;
        if (k < 0)
            rest = taken;
        else
            printf("%-12s differs by %.2g at most; microseconds a source: ours %.1f (measured alone), sep's "
                   "%.1f\n",
                   names[k], found[k].worst, 1e6 * (taken - rest) / s->n, 1e6 * found[k].seps / s->n);
    }
    assert_true(found[0].worst < 1e-3); /* at the rim our positions are floats, as SExtractor's */
    for (int k = 1; k < KINDS; k++)
        assert_true(found[k].worst < 1e-6);
    rx_sources_free(s);
    field_free(&f);
}

/* What sep does not have: MASK_TYPE CORRECT, SExtractor's default, by which a neighbour's pixels become those mirrored at the source; sep
 * leaves them out. Once sep has it our own sums are no longer needed. */
static void neighbours_are_mirrored(void **state)
{
    static const double FLUX = 20000, X = 150, Y = 150;
    field f = field_new(300, 300, 0.0, 1);
    double sum, error, area;
    short flag;
    field_add(&f, X, Y, 2, 2, FLUX);
    field_add(&f, X + 8, Y, 2, 2, FLUX);
    rx_detect_params detect = field_params();
    rx_sources *s = field_detect(&f, &detect);
    rx_image image = field_image(&f);
    rx_measure_params par = params(RX_SKIP_PETRO);
    par.neighbours = RX_NEIGHBOURS_CORRECT;
    par.aperture_diameter[0] = 26;
    assert_int_equal(rx_measure_run(&par, &image, NULL, NULL, s, NULL), RX_OK);
    assert_int_equal(s->n, 2);
    const rx_source *o = field_find(s, X, Y);
    const sep_image im = {.data = f.pixels,
                          .segmap = s->segments,
                          .dtype = SEP_TFLOAT,
                          .sdtype = SEP_TINT,
                          .w = 300,
                          .h = 300,
                          .noiseval = 1,
                          .noise_type = SEP_NOISE_STDDEV};
    assert_int_equal(sep_sum_circle(&im, o->x, o->y, 13, o->segment, 5, 0, &sum, &error, &area, &flag), 0);
    if (getenv("RX_TEST_PRINT") != NULL)
        printf("beside a neighbour FLUX_APER is %.1f %% above the truth (ours), %.1f %% (sep)\n",
               100 * (o->flux_aper[0] / FLUX - 1), 100 * (sum / FLUX - 1));
    assert_true(o->flux_aper[0] > 1.01 * sum);
    rx_sources_free(s);
    field_free(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(agree_on_isolated_sources),
                                       cmocka_unit_test(neighbours_are_mirrored)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
