/* PSF_TYPE AUTO on simulated fields of known Moffat PSF: stars among galaxies, hot pixels, saturation. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "../near.h"
#include "base/memory.h"
#include "base/random.h"
#include "psf/moffat.h"
#include "psf/psf.h"

enum { CELL = 64, CELLS = 10, SIDE = CELL * CELLS };

typedef struct field {
    rx_tile tile;
    rx_background background;
    rx_sources sources;
    double fwhm, beta, ratio, angle;
} field;

static double uniform(uint64_t stream, uint64_t i)
{
    return rx_random_uniform(7, stream, i);
}

static void add_profile(field *f, double x, double y, double peak, double fwhm, double ratio, double angle)
{
    double shape[RX_MOFFAT_SHAPE];
    rx_moffat profile;
    rx_moffat_shape(fwhm, f->beta, ratio, angle, shape);
    rx_moffat_set(&profile, shape);
    int reach = (int)(8.0 * fwhm);
    for (int j = (int)y - reach; j <= (int)y + reach; j++)
        for (int i = (int)x - reach; i <= (int)x + reach; i++)
            if (i >= 0 && j >= 0 && i < SIDE && j < SIDE)
                f->tile.pixels[j * SIDE + i] += (float)(peak * rx_moffat_pixel(&profile, i - x, j - y, NULL));
}

static int by_radius(const void *a, const void *b)
{
    const double *x = a, *y = b;
    return (x[0] > y[0]) - (x[0] < y[0]);
}

/* What detection and photometry would say: flux in a disc, its error, the half-light radius, axes. */
static void measure_source(const field *f, rx_source *s, double radius, double ratio)
{
    enum { MOST = 101 * 101 };
    static double pixel[MOST][2];
    int n = 0, reach = (int)radius;
    double half = 0.0;
    s->flux_auto = 0.0;
    for (int j = (int)s->y - reach; j <= (int)s->y + reach; j++)
        for (int i = (int)s->x - reach; i <= (int)s->x + reach; i++) {
            double r = hypot(i - s->x, j - s->y);
            if (r > radius || i < 0 || j < 0 || i >= SIDE || j >= SIDE || n == MOST)
                continue;
            pixel[n][0] = r;
            pixel[n++][1] = (double)f->tile.pixels[j * SIDE + i] - 100.0;
            s->flux_auto += pixel[n - 1][1];
        }
    s->fluxerr_auto = sqrt(n * 25.0 + fmax(s->flux_auto, 0.0) / f->tile.gain);
    qsort(pixel, (size_t)n, sizeof *pixel, by_radius);
    for (int i = 0; i < n && half < 0.5 * s->flux_auto; i++) {
        half += pixel[i][1];
        s->flux_radius[0] = pixel[i][0];
    }
    s->a = 2.0;
    s->b = 2.0 * ratio;
}

/* One object per cell: `nstars` stars first, galaxies (wider, of all ellipticities) in most other cells. */
static void make_field(field *f, double fwhm, double beta, double ratio, double angle, int nstars, int hot)
{
    size_t n = (size_t)SIDE * SIDE;
    *f = (field){.fwhm = fwhm, .beta = beta, .ratio = ratio, .angle = angle};
    f->tile = (rx_tile){.name = "field.fits",
                        .width = SIDE,
                        .height = SIDE,
                        .gain = 2.0,
                        .saturation = 60000.0,
                        .pixels = RX_NEW(float, n),
                        .mask = RX_NEW(uint8_t, n)};
    f->background = (rx_background){.width = SIDE,
                                    .height = SIDE,
                                    .global_level = 100.0,
                                    .global_sigma = 5.0,
                                    .level = RX_NEW(float, n),
                                    .sigma = RX_NEW(float, n)};
    f->sources = (rx_sources){.list = RX_NEW(rx_source, CELLS * CELLS + (size_t)hot),
                              .width = SIDE,
                              .height = SIDE,
                              .nradii = 1,
                              .flux_fraction = {0.5}};
    assert_true(f->tile.pixels && f->tile.mask && f->background.level && f->background.sigma &&
                f->sources.list);
    for (int c = 0; c < CELLS * CELLS; c++) {
        rx_source *s = &f->sources.list[f->sources.n];
        int star = c * nstars / (CELLS * CELLS) != (c + 1) * nstars / (CELLS * CELLS);
        s->x = (c % CELLS + 0.3 + 0.4 * uniform(1, (uint64_t)c)) * CELL;
        s->y = (c / CELLS + 0.3 + 0.4 * uniform(2, (uint64_t)c)) * CELL;
        s->peak = pow(10.0, 2.2 + 2.0 * uniform(3, (uint64_t)c));
        double wide = star ? 1.0 : 1.2 + 1.3 * uniform(4, (uint64_t)c),
               q = star ? ratio : 0.5 + 0.5 * uniform(5, (uint64_t)c);
        add_profile(f, s->x, s->y, s->peak, wide * fwhm, q, star ? angle : 3.0 * uniform(6, (uint64_t)c));
        s->class_star = wide; /* kept for measuring */
        s->b = q;
        s->number = s->segment = ++f->sources.n;
    }
    for (size_t i = 0; i < n; i++) {
        double light = (double)f->tile.pixels[i];
        f->tile.pixels[i] =
            (float)(100.0 + light + rx_random_normal(8, 0, i) * sqrt(25.0 + light / f->tile.gain));
        f->background.level[i] = 100.0F;
        f->background.sigma[i] = 5.0F;
    }
    for (int i = 0; i < f->sources.n; i++)
        measure_source(f, &f->sources.list[i], fmin(2.5 * fwhm * f->sources.list[i].class_star, 40.0),
                       f->sources.list[i].b);
    for (int h = 0; h < hot; h++) {
        rx_source *s = &f->sources.list[f->sources.n];
        s->x = (h % CELLS + 0.05) * CELL;
        s->y = (h / CELLS % CELLS + 0.95) * CELL;
        s->x = floor(s->x) + 3.0;
        s->y = floor(s->y) - 3.0;
        s->peak = 3000.0 + 10.0 * h;
        f->tile.pixels[(int)s->y * SIDE + (int)s->x] += (float)s->peak;
        s->number = s->segment = ++f->sources.n;
        measure_source(f, s, 4.0, 1.0);
        s->flux_radius[0] = 0.5;
    }
}

static void free_field(field *f)
{
    free(f->tile.pixels);
    free(f->tile.mask);
    free(f->background.level);
    free(f->background.sigma);
    free(f->sources.list);
}

static rx_status estimate(const field *f, rx_psf **psf, rx_error *err)
{
    rx_psf_params par = {.type = RX_PSF_AUTO, .beta = 4.765, .min_stars = 5, .min_snr = 20.0};
    const rx_image tile = rx_tile_image(&f->tile);
    rx_image image = rx_image_on_sky(&tile, &f->background);
    image.hide = RX_HIDE_RESTORED;
    return rx_psf_make(&par, &image, &f->sources, NULL, psf, err);
}

static void check_field(double fwhm, double beta, double ratio, double angle, int nstars, int hot)
{
    field f;
    rx_psf *psf, *truth;
    rx_error err = RX_ERROR_NONE;
    make_field(&f, fwhm, beta, ratio, angle, nstars, hot);
    if (estimate(&f, &psf, &err) != RX_OK)
        fail_msg("FWHM %g: %s", fwhm, err.text);
    print_message("true FWHM %g, beta %g, ellipticity %g: %s\n", fwhm, beta, 1.0 - ratio, psf->description);
    assert_near(psf->fwhm / fwhm, 1.0, 0.02);
    assert_near(psf->ellipticity, 1.0 - ratio, 0.02);
    assert_between(psf->fwhm_error, 0.0, 0.02 * fwhm);
    assert_true(psf->type == RX_PSF_AUTO && psf->nstars >= nstars / 2 && psf->nstars <= nstars);
    for (int i = 0; i < psf->nstars; i++) { /* every one is a star */
        int found = 0;
        for (int k = 0; k < f.sources.n; k++)
            found +=
                f.sources.list[k].class_star == 1.0 &&
                hypot(f.sources.list[k].x - psf->stars[i][0], f.sources.list[k].y - psf->stars[i][1]) < 0.5;
        assert_int_equal(found, 1);
    }
    assert_int_equal(rx_psf_moffat(fwhm, beta, ratio, angle, psf->size, &truth, NULL), RX_OK);
    double off = 0.0;
    for (int i = 0; i < psf->size * psf->size; i++)
        off += 0.5 * fabs((double)psf->basis[i] - (double)truth->basis[i]);
    assert_true(off < 0.02); /* share of the light that is in the wrong place */
    rx_psf_free(truth);
    rx_psf_free(psf);
    free_field(&f);
}

static void test_known_widths(void **state)
{
    (void)state;
    check_field(2.5, 3.5, 0.92, 0.7, 50, 0);
    check_field(4.0, 4.765, 0.9, -0.5, 50, 0);
    check_field(6.0, 3.0, 1.0, 0.0, 50, 0);
}

static void test_few_stars_and_hot_pixels(void **state)
{
    (void)state;
    check_field(3.0, 3.5, 1.0, 0.0, 12, 60);
}

/* What lies under the mask must not matter, not to the last bit. */
static void test_masked_pixels(void **state)
{
    (void)state;
    field f;
    rx_psf *first, *second;
    make_field(&f, 3.0, 4.0, 0.95, 0.2, 50, 0);
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
        if (uniform(9, i) < 0.002 || i % SIDE == 200)
            f.tile.mask[i] = RX_MASK_BAD;
    assert_int_equal(estimate(&f, &first, NULL), RX_OK);
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
        if (f.tile.mask[i] != 0)
            f.tile.pixels[i] = (float)(1e6 * (uniform(10, i) - 0.3));
    assert_int_equal(estimate(&f, &second, NULL), RX_OK);
    assert_true(first->nstars == second->nstars && first->size == second->size);
    assert_memory_equal(first->basis, second->basis,
                        sizeof(float) * (size_t)first->size * (size_t)first->size);
    assert_near(first->fwhm / 3.0, 1.0, 0.02);
    rx_psf_free(first);
    rx_psf_free(second);
    free_field(&f);
}

/* Saturated stars: flat tops at a level that the tile knows. */
static void test_saturated_stars(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 60, 0);
    f.tile.saturation = 3000.0;
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
        if (f.tile.pixels[i] >= 3000.0F)
            f.tile.pixels[i] = 3000.0F;
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    assert_near(psf->fwhm / 3.0, 1.0, 0.02);
    for (int i = 0; i < psf->nstars; i++)
        assert_true(f.tile.pixels[(int)lround(psf->stars[i][1]) * SIDE + (int)lround(psf->stars[i][0])] <
                    2800.0F);
    rx_psf_free(psf);
    free_field(&f);
}

static void test_too_few(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 50, 0);
    f.sources.n = 3;
    assert_int_equal(estimate(&f, &psf, &err), RX_INPUT);
    assert_null(psf);
    assert_non_null(strstr(err.text, "needs 5"));
    assert_non_null(strstr(err.text, "PSF_FWHM"));
    f.sources.n = 0;
    assert_int_equal(estimate(&f, &psf, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "found 0 usable stars"));
    free_field(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_known_widths),  cmocka_unit_test(test_few_stars_and_hot_pixels),
        cmocka_unit_test(test_masked_pixels), cmocka_unit_test(test_saturated_stars),
        cmocka_unit_test(test_too_few),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
