/* A tile in other units, by a power of two: the same catalogue, its fluxes by that power. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
#include "bench.h"
#include "pipeline/pipeline.h"
#include "scene.h"

enum { WIDTH = 130, HEIGHT = 120, N = WIDTH * HEIGHT, STARS = 24 };

/* One restorer, with a PSF that is given or measured, and with a map of the noise or without. */
typedef struct kind {
    const char *name, *psf;
    int map;
    double error; /* relative: NET takes the mean of the logarithms of noise, which rounds */
} kind;

/* Sources of the scene times 2^power; the detection image keeps its units where dual. */
static rx_result measure(const bench *b, const kind *k, int power, int dual, rx_field *fields[2])
{
    rx_result result;
    scene s;
    scene_make(&s, WIDTH, HEIGHT, STARS, 11);
    scene_star(&s, s.stars[0][0] + 3.2, s.stars[0][1], 0.2 * s.stars[0][2], 3.5); /* shows in a residual */
    for (int i = 0; i < 2; i++) {
        const int by = i == 0 && dual ? 0 : power;
        rx_tile *tile = bench_tile(s.pixels, WIDTH, HEIGHT, ldexp(2.0, -by));
        tile->weight = k->map ? RX_NEW(float, N) : NULL;
        tile->weight_type = k->map ? RX_WEIGHT_MAP_RMS : RX_WEIGHT_NONE;
        for (int p = 0; p < N; p++) {
            const int bad = p % WIDTH == 70; /* a column */
            tile->pixels[p] = bad ? 0.0f : ldexpf(tile->pixels[p], by);
            tile->mask[p] = bad ? RX_MASK_BAD : 0;
            if (k->map)
                tile->weight[p] = ldexpf(p < N / 2 ? 5.0f : 5.5f, by);
        }
        tile->zeropoint += 2.5 * log10(2.0) * by;
        assert_int_equal(
            rx_field_prepare(&b->options->pipeline, RX_FIELD_PSF, tile, NULL, NULL, &fields[i], NULL), RX_OK);
    }
    assert_int_equal(rx_field_extract(&b->options->pipeline, rx_restorer_find(k->name), fields[0],
                                      dual ? fields[1] : NULL, NULL, &result, NULL),
                     RX_OK);
    scene_free(&s);
    return result;
}

static void alike(double a, double b, double error)
{
    if (isnan(a) && isnan(b))
        return;
    assert_near(b, a, error * fabs(a));
}

static void same_source(const rx_source *a, const rx_source *b, double unit, int dual, double exact)
{
    /* In dual-image mode fluxes are fitted from a first guess on the detection image, which has other units, until they change by
     * less than 1e-5 or so. */
    const double error = dual ? 1e-5 : exact,
                 *same[][2] = {{&a->x, &b->x},
                               {&a->y, &b->y},
                               {&a->a, &b->a},
                               {&a->errx2, &b->errx2},
                               {&a->snr_win, &b->snr_win},
                               {&a->errx2win, &b->errx2win},
                               {&a->fit.snr, &b->fit.snr},
                               {&a->fit.chi2, &b->fit.chi2},
                               {&a->fit.x, &b->fit.x},
                               {&a->fit.star, &b->fit.star},
                               {&a->fit.evidence, &b->fit.evidence},
                               {&a->point_fit.x, &b->point_fit.x},
                               {&a->point_fit.spread_error, &b->point_fit.spread_error}};
    const double *scaled[][2] = {{&a->peak, &b->peak},
                                 {&a->background, &b->background},
                                 {&a->flux_iso, &b->flux_iso},
                                 {&a->fluxerr_iso, &b->fluxerr_iso},
                                 {&a->flux_auto, &b->flux_auto},
                                 {&a->fluxerr_auto, &b->fluxerr_auto},
                                 {&a->fit.flux, &b->fit.flux},
                                 {&a->fit.fluxerr, &b->fit.fluxerr},
                                 {&a->point_fit.flux, &b->point_fit.flux},
                                 {&a->point_fit.fluxerr, &b->point_fit.fluxerr}};
    for (size_t i = 0; i < sizeof same / sizeof *same; i++)
        alike(*same[i][0], *same[i][1], error);
    for (size_t i = 0; i < sizeof scaled / sizeof *scaled; i++)
        alike(*scaled[i][0], *scaled[i][1] / unit, error);
    if (error <
        1e-9) { /* from another first guess profiles end within their tolerance of chi2, not at the same numbers */
        alike(a->sersic_fit.flux, b->sersic_fit.flux / unit, error);
        alike(a->sersic_fit.fluxerr, b->sersic_fit.fluxerr / unit, error);
        alike(a->sersic_fit.index[1], b->sersic_fit.index[1], error);
    }
    alike(a->threshold, b->threshold / (dual ? 1.0 : unit), error);
    assert_int_equal(a->flags, b->flags);
    assert_int_equal(a->isoarea, b->isoarea);
    assert_int_equal(a->fit.flags, b->fit.flags);
    assert_int_equal(a->fit.restore, b->fit.restore);
}

static void test_units_change_nothing(void **state)
{
    (void)state;
    static const kind kinds[] = {{"NONE", "MOFFAT", 0, 1e-12},
                                 {"NONE", "MOFFAT", 1, 1e-12},
                                 {"RL", "AUTO", 0, 1e-12},
                                 {"NET", "MOFFAT", 0, 4e-4}};
    static const int powers[] = {-110, -66, 62, 108};
    char model[1024];
    snprintf(model, sizeof model, "%s/config/psfnet-fast.fits", getenv("srcdir"));
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        const setting settings[] = {{"RESTORE_TYPE", kinds[i].name},
                                    {"NET_MODEL", model},
                                    {"PSF_TYPE", kinds[i].psf},
                                    {"NTHREADS", "1"},
                                    {"OUT_OF_DOMAIN", "WARN"},
                                    {"CHECKIMAGE_TYPE", "TEMPLATE_RESIDUAL"},
                                    {"CHECKIMAGE_NAME", "residual.fits"},
                                    {NULL, NULL}};
        rx_field *of_a[2], *of_b[2];
        bench b;
        bench_open(&b, settings);
        rx_template_params *templates = &b.options->pipeline.templates;
        templates->wanted = templates->par.keep_model = 1;
        templates->par.point_fits = templates->par.sersic_fits = 1;
        for (int dual = 0; dual < (i == 0 ? 2 : 1); dual++) {
            rx_result one = measure(&b, &kinds[i], 0, dual, of_a);
            assert_true(one.sources->n > STARS / 2);
            if (i == 0)
                assert_true(one.templates.added > 0);
            for (size_t j = 0; j < sizeof powers / sizeof *powers; j++) {
                const double unit = ldexp(1.0, powers[j]);
                rx_result other = measure(&b, &kinds[i], powers[j], dual, of_b);
                assert_int_equal(one.sources->n, other.sources->n);
                for (int k = 0; k < one.sources->n; k++)
                    same_source(&one.sources->list[k], &other.sources->list[k], unit, dual, kinds[i].error);
                for (int p = 0; p < N; p++)
                    assert_near(ldexp((double)other.templates.tphot->residual[p], -powers[j]),
                                (double)one.templates.tphot->residual[p], dual ? 1e-3 : 1e3 * kinds[i].error);
                assert_near(other.templates.tphot->sky / unit, one.templates.tphot->sky,
                            dual ? 1e-6 : kinds[i].error);
                rx_result_free(&other);
                rx_field_free(of_b[0]);
                rx_field_free(of_b[1]);
            }
            rx_result_free(&one);
            rx_field_free(of_a[0]);
            rx_field_free(of_a[1]);
        }
        bench_close(&b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_units_change_nothing)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
