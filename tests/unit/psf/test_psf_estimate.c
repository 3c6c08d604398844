/* PSF_TYPE AUTO on simulated fields of known PSF: stars among galaxies, hot pixels, saturation, halos. */
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
    double halo;   /* share of a star's light in an exponential of scale 1.5 FWHM */
    double varies; /* share by which the FWHM grows from the left to the right */
    double corner; /* share by which it grows towards the upper right corner, within corner_pixels */
} field;

static double steep = 1.0; /* the more, the more faint ones */
static double corner_pixels = 110.0;
static int highest_degree = 6;
static double galaxy_width[2] = {1.2, 1.3}, /* narrowest and range, of the star's */
    galaxy_ratio = 0.5;                     /* flattest */
static double faintest = 2.2;               /* log of a peak */
static double moffat_reach = 8.0;           /* FWHM */
static int stars_alone = 0;                 /* no galaxies */
static int cross = 0; /* the halo is a cross of spikes along the axes, of scale 3 FWHM */

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
    int reach = (int)((f->halo > 0.0 ? 20.0 : moffat_reach) * fwhm);
    /* both parts have the light that goes with them: that of a Moffat of that peak is pi hwhm^2 / (k (beta - 1)) */
    const double scale = 1.5 * fwhm,
                 light = peak * M_PI * profile.hwhm * profile.hwhm / (profile.k * (profile.beta - 1.0));
    const double level = f->halo * light / (2.0 * M_PI * scale * scale);
    const double along = 3.0 * fwhm, across = 0.21 * fwhm,
                 spike = f->halo * light / (4.0 * along * sqrt(2.0 * M_PI) * across);
    for (int j = (int)y - reach; j <= (int)y + reach; j++)
        for (int i = (int)x - reach; i <= (int)x + reach; i++)
            if (i >= 0 && j >= 0 && i < SIDE && j < SIDE)
                f->tile.pixels[j * SIDE + i] +=
                    (float)(peak * (1.0 - f->halo) * rx_moffat_pixel(&profile, i - x, j - y, NULL) +
                            (cross ? spike * (exp(-fabs(i - x) / along - 0.5 * pow((j - y) / across, 2.0)) +
                                              exp(-fabs(j - y) / along - 0.5 * pow((i - x) / across, 2.0)))
                                   : level * exp(-hypot(i - x, j - y) / scale)));
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

static double width_at(const field *f, double x, double y)
{
    const double u = (x - SIDE) / corner_pixels, v = (y - SIDE) / corner_pixels;
    return f->fwhm * (1.0 + f->varies * (x / SIDE - 0.5)) * (1.0 + f->corner * exp(-0.5 * (u * u + v * v)));
}

/* One object per cell: `nstars` stars first, galaxies (wider, of all ellipticities) in most other cells. */
static void make_varied(field *f, double fwhm, double beta, double ratio, double angle, int nstars, int hot,
                        double halo, double varies, double corner)
{
    size_t n = (size_t)SIDE * SIDE;
    *f = (field){.fwhm = fwhm,
                 .beta = beta,
                 .ratio = ratio,
                 .angle = angle,
                 .halo = halo,
                 .varies = varies,
                 .corner = corner};
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
    assert_non_null(f->tile.pixels);
    assert_non_null(f->tile.mask);
    assert_non_null(f->background.level);
    assert_non_null(f->background.sigma);
    assert_non_null(f->sources.list);
    for (int c = 0; c < CELLS * CELLS; c++) {
        rx_source *s = &f->sources.list[f->sources.n];
        int star = c * nstars / (CELLS * CELLS) != (c + 1) * nstars / (CELLS * CELLS);
        s->x = (c % CELLS + 0.3 + 0.4 * uniform(1, (uint64_t)c)) * CELL;
        s->y = (c / CELLS + 0.3 + 0.4 * uniform(2, (uint64_t)c)) * CELL;
        s->peak = star || !stars_alone
                      ? pow(10.0, faintest + (4.2 - faintest) * pow(uniform(3, (uint64_t)c), steep))
                      : 0.0;
        double wide = star ? 1.0 : galaxy_width[0] + galaxy_width[1] * uniform(4, (uint64_t)c),
               q = star ? ratio : galaxy_ratio + (1.0 - galaxy_ratio) * uniform(5, (uint64_t)c);
        add_profile(f, s->x, s->y, s->peak, wide * width_at(f, s->x, s->y), q,
                    star ? angle : 3.0 * uniform(6, (uint64_t)c));
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

static void make_field_of(field *f, double fwhm, double beta, double ratio, double angle, int nstars, int hot,
                          double halo, double varies)
{
    make_varied(f, fwhm, beta, ratio, angle, nstars, hot, halo, varies, 0.0);
}

static void make_field(field *f, double fwhm, double beta, double ratio, double angle, int nstars, int hot)
{
    make_field_of(f, fwhm, beta, ratio, angle, nstars, hot, 0.0, 0.0);
}

static void free_field(field *f)
{
    free(f->tile.pixels);
    free(f->tile.mask);
    free(f->background.level);
    free(f->background.sigma);
    free(f->sources.list);
    free(f->sources.segments);
}

static rx_status estimate_on(const field *f, int nthreads, rx_psf **psf, rx_error *err)
{
    rx_psf_params par = {.type = RX_PSF_AUTO,
                         .beta = 4.765,
                         .min_stars = 1,
                         .min_snr = 20.0,
                         .max_degree = highest_degree,
                         .nthreads = nthreads};
    const rx_image tile = rx_tile_image(&f->tile);
    rx_image image = rx_image_on_sky(&tile, &f->background);
    image.hide = RX_HIDE_RESTORED;
    return rx_psf_make(&par, &image, &f->sources, NULL, psf, err);
}

static rx_status estimate(const field *f, rx_psf **psf, rx_error *err)
{
    return estimate_on(f, 1, psf, err);
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
    assert_near(psf->fwhm / fwhm, 1.0, 0.005);
    assert_near(psf->ellipticity, 1.0 - ratio, 0.003);
    assert_between(psf->fwhm_error, 0.0, 0.02 * fwhm);
    assert_between(psf->quality.flux_error, 1e-4, 0.03);
    assert_true(psf->type == RX_PSF_AUTO);
    assert_between(psf->nstars, nstars / 2, nstars);
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

/* Trailed across the pixels: a narrow ring that holds no whole pixel spoils nothing. */
static void test_elongated(void **state)
{
    (void)state;
    static const double kinds[][2] = {{2.87, 0.57}, {2.87, 0.6}, {2.6, 0.57}, {3.2, 0.55}};
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        field f;
        rx_psf *psf;
        make_field(&f, kinds[i][0], 4.765, kinds[i][1], M_PI / 4, 36, 0);
        assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
        assert_int_equal(psf->quality.how, RX_PSF_BY_PIXELS);
        assert_near(psf->ellipticity, 1.0 - kinds[i][1], 0.002);
        rx_psf_free(psf);
        free_field(&f);
    }
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
    assert_true(first->nstars == second->nstars);
    assert_true(first->size == second->size);
    assert_memory_equal(first->basis, second->basis,
                        sizeof(float) * (size_t)first->size * (size_t)first->size);
    assert_near(first->fwhm / 3.0, 1.0, 0.005);
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
    assert_near(psf->fwhm / 3.0, 1.0, 0.008);
    for (int i = 0; i < psf->nstars; i++)
        assert_true(f.tile.pixels[(int)lround(psf->stars[i][1]) * SIDE + (int)lround(psf->stars[i][0])] <
                    2800.0F);
    rx_psf_free(psf);
    free_field(&f);
}

/* Light of the PSF within a radius of its middle, at a place. */
static double encircled(const rx_psf *psf, double x, double y, double radius)
{
    float *stamp = RX_NEW(float, (size_t)psf->size *(size_t)psf->size);
    double sum = 0.0;
    assert_non_null(stamp);
    rx_psf_at(psf, x, y, stamp);
    for (int j = 0; j < psf->size; j++)
        for (int i = 0; i < psf->size; i++)
            if (hypot(i - psf->size / 2, j - psf->size / 2) <= radius)
                sum += (double)stamp[j * psf->size + i];
    free(stamp);
    return sum;
}

/* A tenth of the light in a halo, which no Moffat has. */
static void test_halo(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    make_field_of(&f, 3.0, 4.765, 1.0, 0.0, 90, 0, 0.1, 0.0);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    print_message("%s\n", psf->description);
    assert_int_equal(psf->quality.how, RX_PSF_BY_PIXELS);
    double shape[RX_MOFFAT_SHAPE], core = 0.0;
    rx_moffat profile;
    rx_moffat_shape(3.0, 4.765, 1.0, 0.0, shape);
    rx_moffat_set(&profile, shape);
    for (int j = -6; j <= 6; j++)
        for (int i = -6; i <= 6; i++)
            if (hypot(i, j) <= 6.0)
                core += rx_moffat_pixel(&profile, i, j, NULL) * profile.k * (profile.beta - 1.0) /
                        (M_PI * profile.hwhm * profile.hwhm);
    const double halo = 1.0 - (1.0 + 6.0 / 4.5) * exp(-6.0 / 4.5);
    assert_near(encircled(psf, 320.0, 320.0, 6.0), 0.9 * core + 0.1 * halo, 0.008);
    assert_between(psf->quality.radius, 15.0, 60.0);
    assert_between(psf->quality.beyond, 0.0, 0.004);
    assert_between(psf->quality.flux_error, 1e-5, 0.01);
    rx_psf_free(psf);
    free_field(&f);
}

/* What a template's flux of a bright star at the middle would be, over the truth. */
static double flux_found(const field *of, const rx_psf *psf)
{
    field f = *of;
    const double fwhm = f.fwhm, beta = f.beta, mid = SIDE / 2;
    double shape[RX_MOFFAT_SHAPE], product = 0.0, square = 0.0;
    rx_moffat profile;
    float *stamp = RX_NEW(float, (size_t)psf->size *(size_t)psf->size);
    f.tile.pixels = RX_NEW(float, (size_t)SIDE *SIDE);
    assert_non_null(stamp);
    assert_non_null(f.tile.pixels);
    rx_moffat_shape(fwhm, beta, 1.0, 0.0, shape);
    rx_moffat_set(&profile, shape);
    add_profile(&f, mid, mid, 1.0, fwhm, 1.0, 0.0);
    rx_psf_at(psf, mid, mid, stamp);
    for (int j = 0; j < psf->size; j++)
        for (int i = 0; i < psf->size; i++) {
            const int x = i - psf->size / 2 + (int)mid, y = j - psf->size / 2 + (int)mid;
            const double p = (double)stamp[j * psf->size + i];
            if (x < 0 || y < 0 || x >= SIDE || y >= SIDE)
                continue;
            product += p * (double)f.tile.pixels[y * SIDE + x];
            square += p * p;
        }
    free(stamp);
    free(f.tile.pixels);
    return product / square * profile.k * (profile.beta - 1.0) / (M_PI * profile.hwhm * profile.hwhm);
}

/* Faint stars, and `n` of 10 to 100 times the level that saturates, each over a faint one; what reaches it is flagged and
 * has a segment. */
static void saturated_field(field *f, double fwhm, double beta, double halo, int n, double saturation)
{
    const size_t pixels = (size_t)SIDE * SIDE;
    steep = 3.0;
    make_field_of(f, fwhm, beta, 1.0, 0.0, 100, 0, halo, 0.0);
    steep = 1.0;
    float *sky = f->tile.pixels;
    f->tile.pixels = RX_NEW(float, pixels);
    f->sources.segments = RX_NEW(int32_t, pixels);
    assert_non_null(f->tile.pixels);
    assert_non_null(f->sources.segments);
    f->tile.saturation = saturation;
    for (int k = 0; k < n; k++) {
        rx_source *s = &f->sources.list[(k * 37 + 11) % (CELLS * CELLS)];
        s->peak = saturation * pow(10.0, 1.0 + (k + 0.5) / n);
        add_profile(f, s->x, s->y, s->peak, fwhm, 1.0, 0.0);
    }
    for (size_t i = 0; i < pixels; i++) {
        const double light = (double)f->tile.pixels[i];
        f->tile.pixels[i] =
            fminf((float)((double)sky[i] + light + rx_random_normal(8, 1, i) * sqrt(light / f->tile.gain)),
                  (float)saturation);
    }
    free(sky);
    for (int k = 0; k < f->sources.n; k++) {
        rx_source *s = &f->sources.list[k];
        int reach = 0;
        const int x = (int)lround(s->x), y = (int)lround(s->y);
        measure_source(f, s, fmin(2.5 * fwhm, 40.0), 1.0);
        s->peak = fmin(s->peak, saturation - 100.0);
        s->flags = f->tile.pixels[y * SIDE + x] >= (float)saturation ? RX_FLAG_SATURATED : 0;
        while (reach < 30 && x + reach < SIDE && f->tile.pixels[y * SIDE + x + reach] > 115.0F)
            reach++;
        for (int j = -reach; j <= reach; j++)
            for (int i = -reach; i <= reach; i++)
                if (hypot(i, j) <= reach && x + i >= 0 && x + i < SIDE && y + j >= 0 && y + j < SIDE)
                    f->sources.segments[(y + j) * SIDE + x + i] = s->segment;
    }
}

/* Wings that faint stars do not show are those of saturated ones. */
static void test_wings_of_saturated(void **state)
{
    (void)state;
    static const double kinds[][3] = {{3.0, 50.0, 0.1}, {3.0, 2.5, 0.0}}; /* FWHM, beta, halo */
    moffat_reach = 40.0;
    for (int kind = 0; kind < 2; kind++) {
        double off[2];
        for (int without = 0; without < 2; without++) {
            field f;
            rx_psf *psf;
            saturated_field(&f, kinds[kind][0], kinds[kind][1], kinds[kind][2], 8, 1500.0);
            for (int k = 0; k < f.sources.n && without; k++) /* as if the border cut them */
                f.sources.list[k].flags |= f.sources.list[k].flags != 0 ? RX_FLAG_TRUNCATED : 0;
            assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
            off[without] = flux_found(&f, psf) - 1.0;
            print_message("kind %d, %s saturated stars: fluxes %+.4f, claimed %.4f; %s\n", kind,
                          without ? "without" : "with", off[without], psf->quality.flux_error,
                          psf->description);
            rx_psf_free(psf);
            free_field(&f);
        }
        assert_near(off[0], 0.0, 0.003);
        assert_true(off[1] < -0.004);
    }
    moffat_reach = 8.0;
}

/* Few faint stars hardly show a halo: the claimed error holds what it may have, and is small where many bright ones do. */
static void test_unseen_halo(void **state)
{
    (void)state;
    double squares = 0.0;
    stars_alone = 1;
    for (int n = 11; n <= 31; n += 5)
        for (int halo = 0; halo < 2; halo++) {
            field f;
            rx_psf *psf;
            steep = 10.0;
            faintest = 2.4;
            make_field_of(&f, 3.0, 50.0, 1.0, 0.0, n, 0, 0.1 * halo, 0.0);
            steep = 1.0;
            faintest = 2.2;
            assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
            const double off = flux_found(&f, psf) - 1.0;
            print_message("%d stars, halo %g: fluxes %+.4f, claimed %.4f; %s\n", n, 0.1 * halo, off,
                          psf->quality.flux_error, psf->description);
            assert_int_equal(psf->quality.how, RX_PSF_BY_PIXELS);
            assert_near(off / psf->quality.flux_error, 0.0, 2.0);
            squares += pow(off / psf->quality.flux_error, 2.0) / 10.0;
            assert_near(off, 0.0, 0.03);
            assert_true(psf->quality.hidden > 0.0);
            assert_true(psf->quality.hidden < psf->quality.flux_error);
            assert_true(n < 31 || psf->quality.flux_error < 0.01);
            rx_psf_free(psf);
            free_field(&f);
        }
    stars_alone = 0;
    assert_between(sqrt(squares), 0.4, 1.3); /* what is claimed is right */
}

/* Spikes stand far above the mean of their ring, and are light all the same. */
static void test_spikes(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    double inner = 0.0, whole = 0.0;
    cross = 1;
    make_field_of(&f, 3.0, 4.765, 1.0, 0.0, 90, 0, 0.1, 0.0);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    memset(f.tile.pixels, 0, sizeof(float) * SIDE * SIDE);
    add_profile(&f, 320.0, 320.0, 1000.0, 3.0, 1.0, 0.0);
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i++) {
            whole += (double)f.tile.pixels[j * SIDE + i];
            inner += hypot(i - 320, j - 320) <= 6.0 ? (double)f.tile.pixels[j * SIDE + i] : 0.0;
        }
    print_message("%s: %.4f, %.4f\n", psf->description, encircled(psf, 320.0, 320.0, 6.0), inner / whole);
    assert_near(encircled(psf, 320.0, 320.0, 6.0), inner / whole, 0.004);
    cross = 0;
    rx_psf_free(psf);
    free_field(&f);
}

/* A PSF that pixels do not sample is known between them, too, from where the stars lie in theirs. */
static void test_narrow(void **state)
{
    (void)state;
    field f;
    rx_psf *psf, *truth;
    make_field_of(&f, 1.6, 4.0, 0.95, 0.3, 95, 0, 0.0, 0.0);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    print_message("%s\n", psf->description);
    assert_int_equal(psf->quality.how, RX_PSF_BY_PIXELS);
    assert_int_equal(rx_psf_fine(psf), 2);
    assert_int_equal(rx_psf_moffat(1.6, 4.0, 0.95, 0.3, psf->size, &truth, NULL), RX_OK);
    const int side = rx_psf_fine_side(psf), middle = side / 2;
    const double peak = (double)truth->samples[middle * side + middle];
    for (int j = -6; j <= 6; j++)
        for (int i = -6; i <= 6; i++)
            assert_near((double)psf->samples[(middle + j) * side + middle + i] / peak,
                        (double)truth->samples[(middle + j) * side + middle + i] / peak, 0.004);
    rx_psf_free(truth);
    rx_psf_free(psf);
    free_field(&f);
}

/* Width that grows over the tile: the light within a radius falls. */
static void test_varies(void **state)
{
    (void)state;
    field f;
    rx_psf *psf, *truth;
    make_field_of(&f, 3.5, 4.0, 0.95, 0.3, 95, 0, 0.0, 0.3);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    print_message("%s\n", psf->description);
    assert_true(psf->quality.degree >= 1);
    for (int k = 0; k < 3; k++) {
        const double x = 60.0 + 260.0 * k;
        assert_int_equal(
            rx_psf_moffat(3.5 * (1.0 + 0.3 * (x / SIDE - 0.5)), 4.0, 0.95, 0.3, psf->size, &truth, NULL),
            RX_OK);
        assert_near(encircled(psf, x, 320.0, 2.5), encircled(truth, 0.0, 0.0, 2.5), 0.003);
        assert_near(encircled(psf, x, 320.0, 400.0), 1.0, 1e-4);
        rx_psf_free(truth);
    }
    assert_int_equal(psf->quality.reserved > 5, 1);
    assert_near(psf->quality.trace[0], 0.0, 0.02);
    rx_psf_free(psf);
    free_field(&f);
}

/* A width that grows by half from one side to the other: its second derivative is not enough. */
static void test_varies_much(void **state)
{
    (void)state;
    field f;
    rx_psf *psf, *truth;
    make_field_of(&f, 4.0, 3.5, 1.0, 0.0, 95, 0, 0.0, 0.4);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    print_message("%s\n", psf->description);
    for (int k = 0; k < 3; k++) {
        const double x = 30.0 + 290.0 * k;
        assert_int_equal(
            rx_psf_moffat(4.0 * (1.0 + 0.4 * (x / SIDE - 0.5)), 3.5, 1.0, 0.0, psf->size, &truth, NULL),
            RX_OK);
        print_message("%g: %.5f %.5f\n", x, encircled(psf, x, 320.0, 2.5), encircled(truth, 0.0, 0.0, 2.5));
        assert_near(encircled(psf, x, 320.0, 2.5), encircled(truth, 0.0, 0.0, 2.5), 0.003);
        rx_psf_free(truth);
    }
    rx_psf_free(psf);
    free_field(&f);
}

/* Bright stars say the width to a thousandth: the light within a radius of a constant PSF. */
static void test_bright_stars(void **state)
{
    (void)state;
    field f;
    rx_psf *psf, *truth;
    make_field_of(&f, 4.0, 3.0, 0.9, 0.4, 95, 0, 0.0, 0.0);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    print_message("%s\n", psf->description);
    assert_int_equal(rx_psf_moffat(4.0, 3.0, 0.9, 0.4, psf->size, &truth, NULL), RX_OK);
    print_message("%.5f %.5f, %.5f\n", encircled(psf, 320.0, 320.0, 2.5), encircled(truth, 0.0, 0.0, 2.5),
                  psf->quality.flux_error);
    assert_near(encircled(psf, 320.0, 320.0, 2.5), encircled(truth, 0.0, 0.0, 2.5), 0.001);
    assert_between(psf->quality.flux_error, 1e-5, 0.0028); /* measured, no floor */
    rx_psf_free(truth);
    rx_psf_free(psf);
    free_field(&f);
}

/* A corner whose few stars are wider than the polynomial lets the PSF be: fluxes there have larger errors. */
static void test_bad_corner(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    make_varied(&f, 3.5, 4.0, 1.0, 0.0, 95, 0, 0.0, 0.0, 0.25);
    highest_degree = 0;
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    highest_degree = 6;
    print_message("%s: %.4f, corners %.4f %.4f, middle %.4f\n", psf->description, psf->quality.flux_error,
                  rx_psf_flux_error(psf, 0, 0), rx_psf_flux_error(psf, SIDE - 1, SIDE - 1),
                  rx_psf_flux_error(psf, 320, 320));
    assert_true(rx_psf_flux_error(psf, SIDE - 1, SIDE - 1) > 0.03);
    assert_between(rx_psf_flux_error(psf, 320, 320), psf->quality.flux_error, 0.01);
    rx_psf_free(psf);
    free_field(&f);
}

/* A larger one is followed, though its few stars are 60 % wider than those of the rest of the tile. */
static void test_followed_corner(void **state)
{
    (void)state;
    field f;
    rx_psf *psf, *truth;
    corner_pixels = 160.0;
    make_varied(&f, 3.0, 4.0, 1.0, 0.0, 55, 0, 0.0, 0.0, 0.6);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    for (int k = 0; k < 2; k++) {
        const double x = k == 0 ? 200.0 : SIDE - 40.0;
        assert_int_equal(rx_psf_moffat(width_at(&f, x, x), 4.0, 1.0, 0.0, psf->size, &truth, NULL), RX_OK);
        print_message("%s: at %g %.4f %.4f\n", psf->description, x, encircled(psf, x, x, 2.5),
                      encircled(truth, 0.0, 0.0, 2.5));
        assert_near(encircled(psf, x, x, 2.5) / encircled(truth, 0.0, 0.0, 2.5), 1.0, k == 0 ? 0.01 : 0.1);
        rx_psf_free(truth);
    }
    corner_pixels = 110.0;
    rx_psf_free(psf);
    free_field(&f);
}

/* Of few stars among galaxies: that they are wider together says that they are stars. */
static void test_corner_of_few_stars(void **state)
{
    (void)state;
    corner_pixels = 144.0;
    for (int n = 60; n <= 70; n += 10) {
        field f;
        rx_psf *psf, *truth;
        make_varied(&f, 3.0, 4.0, 0.9, 0.4, n, 0, 0.0, 0.0, 0.3);
        assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
        for (int k = 0; k < 2; k++) {
            const double x = k == 0 ? 200.0 : SIDE - 60.0;
            assert_int_equal(rx_psf_moffat(width_at(&f, x, x), 4.0, 0.9, 0.4, psf->size, &truth, NULL),
                             RX_OK);
            print_message("%d stars, %s: at %g %.4f %.4f\n", n, psf->description, x,
                          encircled(psf, x, x, 2.5), encircled(truth, 0.0, 0.0, 2.5));
            assert_near(encircled(psf, x, x, 2.5) / encircled(truth, 0.0, 0.0, 2.5), 1.0,
                        k == 0 ? 0.01 : 0.04);
            rx_psf_free(truth);
        }
        rx_psf_free(psf);
        free_field(&f);
    }
    corner_pixels = 110.0;
}

/* Round galaxies of 1.3 times their width are no stars, however many. */
static void test_compact_galaxies(void **state)
{
    (void)state;
    field f;
    rx_psf *psf, *truth;
    galaxy_width[0] = 1.25;
    galaxy_width[1] = 0.1;
    galaxy_ratio = 0.95;
    make_varied(&f, 4.0, 4.0, 1.0, 0.0, 25, 0, 0.0, 0.0, 0.0);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    assert_int_equal(rx_psf_moffat(4.0, 4.0, 1.0, 0.0, psf->size, &truth, NULL), RX_OK);
    print_message("%s: %.4f, %.4f %.4f\n", psf->description, psf->quality.flux_error,
                  encircled(psf, 320.0, 320.0, 3.0), encircled(truth, 0.0, 0.0, 3.0));
    assert_near(psf->fwhm, 4.0, 0.03);
    assert_between(psf->quality.flux_error, 0.0, 0.01);
    galaxy_width[0] = 1.2;
    galaxy_width[1] = 1.3;
    galaxy_ratio = 0.5;
    rx_psf_free(truth);
    rx_psf_free(psf);
    free_field(&f);
}

/* Stars that compact galaxies of one size outnumber, up to ten times: galaxies are wider than stars, and nothing is as much narrower. */
static void test_outnumbered(void **state)
{
    (void)state;
    galaxy_width[0] = 1.25;
    galaxy_width[1] = 0.1;
    galaxy_ratio = 0.95;
    for (int stars = 9; stars <= 100; stars += stars < 36 ? 9 : 64) {
        field f;
        rx_psf *psf;
        make_varied(&f, 4.0, 4.0, 1.0, 0.0, stars, 0, 0.0, 0.0, 0.0);
        assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
        print_message("%d stars: FWHM %.3f, error %.4f\n", stars, psf->fwhm, psf->quality.flux_error);
        assert_near(psf->fwhm, 4.0, 0.01);
        rx_psf_free(psf);
        free_field(&f);
    }
    galaxy_width[0] = 1.2;
    galaxy_width[1] = 1.3;
    galaxy_ratio = 0.5;
}

static void test_threads(void **state)
{
    (void)state;
    field f;
    rx_psf *one, *many;
    make_field_of(&f, 3.0, 3.5, 0.9, 0.3, 80, 0, 0.05, 0.1);
    assert_int_equal(estimate_on(&f, 1, &one, NULL), RX_OK);
    assert_int_equal(estimate_on(&f, 3, &many, NULL), RX_OK);
    assert_int_equal(one->nbasis, many->nbasis);
    assert_int_equal(one->size, many->size);
    assert_memory_equal(one->basis, many->basis,
                        sizeof(float) * (size_t)one->nbasis * (size_t)one->size * (size_t)one->size);
    assert_memory_equal(&one->quality, &many->quality, sizeof one->quality);
    rx_psf_free(one);
    rx_psf_free(many);
    free_field(&f);
}

/* Step by step: the pixels, a Moffat whose exponent has a prior, its width alone, nothing. */
static void test_too_few(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    static const struct {
        int stars;
        const char *how;
    } steps[] = {{7, "PIXELS"}, {3, "MOFFAT_BETA"}, {1, "WIDTH"}};
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 100, 0);
    for (int k = 0; k < 3; k++) {
        f.sources.n = steps[k].stars;
        assert_int_equal(estimate(&f, &psf, &err), RX_OK);
        assert_string_equal(rx_psf_how_name(psf->quality.how), steps[k].how);
        assert_near(psf->fwhm / 3.0, 1.0, 0.05);
        /* the error of one is what it may be, a galaxy on a PSF of any width down to a pixel's */
        assert_between(psf->fwhm_error, k == 2 ? 0.9 : 1e-4, k == 2 ? 1.2 : 0.2);
        if (k == 2)
            assert_between(psf->quality.flux_error, 0.2, 0.4);
        else if (k == 1)
            assert_between(psf->quality.flux_error, 0.05, 0.07);
        else
            assert_between(psf->quality.flux_error, 1e-3, 0.06);
        assert_between(psf->nstars, 1, steps[k].stars);
        rx_psf_free(psf);
    }
    const rx_psf_params most = {
        .type = RX_PSF_AUTO, .beta = 4.765, .min_stars = 4, .min_snr = 20.0, .max_degree = 6};
    const rx_image tile = rx_tile_image(&f.tile);
    rx_image image = rx_image_on_sky(&tile, &f.background);
    image.hide = RX_HIDE_RESTORED;
    assert_int_equal(rx_psf_make(&most, &image, &f.sources, NULL, &psf, &err), RX_INPUT); /* as asked for */
    f.sources.n = 0;
    assert_int_equal(estimate(&f, &psf, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "found 0 usable stars"));
    free_field(&f);
}

/* Errors of the width cover it where stars are few, whatever the exponent is: PSF_BETA is 4.765. */
static void test_width_of_few_stars(void **state)
{
    (void)state;
    static const double exponents[] = {2.8, 4.765, 12.0};
    int within = 0, all = 0;
    for (double fwhm = 2.0; fwhm < 7.0; fwhm *= 1.6)
        for (int k = 0; k < 3; k++) {
            field f;
            rx_psf *psf;
            make_field(&f, fwhm, exponents[k], 1.0, 0.0, 60, 0);
            rx_source *list = f.sources.list;
            for (int first = 0; first < 40; first += 4) {
                f.sources.list = list + first;
                f.sources.n = 2 + first % 3;
                if (estimate(&f, &psf, NULL) != RX_OK)
                    continue;
                if (psf->nstars > 1) {
                    all++;
                    within += fabs(psf->fwhm - fwhm) < psf->fwhm_error;
                    assert_near(psf->fwhm / fwhm, 1.0, 0.08);
                }
                rx_psf_free(psf);
            }
            f.sources.list = list;
            free_field(&f);
        }
    print_message("%d of %d are within 1 sigma\n", within, all);
    assert_between(all, 30, 120);
    assert_between((double)within / all, 0.68, 1.0); /* of two, their error is that they may be galaxies */
}

/* The pixels of f become one object: of Sersic's index on that PSF, half of its light within 4 pixels; index 0: a star. */
static void make_single(field *f, double index, double fwhm, double exponent)
{
    enum { REACH = 40, FINE = 5, N = 2 * REACH + 1 };
    static double light[N * N];
    rx_psf *psf;
    make_field(f, 4.0, 4.0, 1.0, 0.0, 100, 0);
    rx_source *s = &f->sources.list[0];
    f->sources.n = 1;
    s->x = s->y = SIDE / 2;
    assert_int_equal(rx_psf_moffat(fwhm, exponent, 1.0, 0.0, 0, &psf, NULL), RX_OK);
    memset(light, 0, sizeof light);
    const double radius = 4.0, b = 2.0 * index - 1.0 / 3.0 + 0.009876 / fmax(index, 1.0);
    const int half = psf->size / 2;
    double whole = 0.0;
    for (int at = 0; at < N * N; at++) {
        double value = index > 0.0 ? 0.0 : at == N * N / 2;
        for (int k = 0; k < FINE * FINE && index > 0.0; k++)
            value += exp(-b * pow(hypot(at % N - REACH + (k % FINE - FINE / 2) / (double)FINE,
                                        at / N - REACH + (k / FINE - FINE / 2) / (double)FINE) /
                                      radius,
                                  1.0 / index));
        light[at] = value;
        whole += value;
    }
    for (int i = 0; i < SIDE * SIDE; i++)
        f->tile.pixels[i] = 100.0F;
    for (int at = 0; at < N * N; at++)
        for (int k = 0; k < psf->size * psf->size && light[at] > 0.0; k++) {
            const int x = SIDE / 2 + at % N - REACH + k % psf->size - half,
                      y = SIDE / 2 + at / N - REACH + k / psf->size - half;
            if (x >= 0 && y >= 0 && x < SIDE && y < SIDE)
                f->tile.pixels[y * SIDE + x] += (float)(3e5 * light[at] / whole * (double)psf->basis[k]);
        }
    s->peak = (double)f->tile.pixels[SIDE / 2 * SIDE + SIDE / 2] - 100.0;
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
        f->tile.pixels[i] +=
            (float)(rx_random_normal(9, 0, i) *
                    sqrt(25.0 + fmax((double)f->tile.pixels[i] - 100.0, 0.0) / f->tile.gain));
    measure_source(f, s, index > 0.0 ? 25.0 : 3.0 * fwhm, 1.0);
    rx_psf_free(psf);
}

/* A single galaxy is not the PSF where its wings, or the want of them, are no star's; a disc on a PSF may have a star's, and the
 * error covers. A single star of any instrument is the PSF. */
static void test_single_object(void **state)
{
    (void)state;
    static const struct {
        double index, exponent;
        int known;
    } kinds[] = {{4.0, 4.0, 0}, {0.5, 4.0, 0}, {1.0, 4.0, 1}, {0.0, 2.5, 1}, {0.0, 6.0, 1}};
    const double fwhm = 3.35;
    for (int k = 0; k < 5; k++) {
        field f;
        rx_psf *psf;
        rx_error err = RX_ERROR_NONE;
        make_single(&f, kinds[k].index, fwhm, kinds[k].exponent);
        const rx_status status = estimate(&f, &psf, &err);
        print_message("index %g: %s\n", kinds[k].index, status == RX_OK ? psf->description : err.text);
        assert_int_equal(status, kinds[k].known ? RX_OK : RX_INPUT);
        if (status != RX_OK) {
            assert_non_null(strstr(err.text, "no star's"));
            assert_non_null(strstr(err.text, "PSF_FWHM"));
        } else {
            assert_int_equal(psf->quality.how, RX_PSF_BY_WIDTH);
            assert_near((psf->fwhm - fwhm) / psf->fwhm_error, 0.0, 1.5);
            assert_between(psf->beta, 2.4, 6.5);
        }
        if (kinds[k].index == 0.0) {
            assert_near(psf->fwhm / fwhm, 1.0, 0.02);
            assert_near(1.0 / psf->beta, 1.0 / kinds[k].exponent, 0.03);
        }
        rx_psf_free(psf);
        free_field(&f);
    }
}

/* A PSF_FWHM that stars contradict counts where they are few, and they do where they are many: what is said is what is
 * done (pipeline/field.c takes PSF_FWHM for few). */
static void test_contradicted_width(void **state)
{
    (void)state;
    rx_psf_params par = {
        .type = RX_PSF_AUTO, .beta = 4.765, .fwhm = 2.0, .min_stars = 1, .min_snr = 20.0, .max_degree = 0};
    for (int few = 0; few < 2; few++) {
        field f;
        rx_psf *psf = NULL;
        rx_text said = {0};
        rx_log log = {.level = RX_QUIET, .warnings = &said};
        make_field(&f, 3.0, 4.765, 1.0, 0.0, 60, 0);
        const rx_image tile = rx_tile_image(&f.tile);
        rx_image image = rx_image_on_sky(&tile, &f.background);
        image.hide = RX_HIDE_RESTORED;
        rx_status status = RX_INPUT;
        for (int first = 0; first < 40 && status != RX_OK; first += 4) { /* some are galaxies */
            rx_sources some = f.sources;
            some.n = 3;
            some.list += first;
            rx_text_free(&said);
            status = rx_psf_make(&par, &image, few ? &some : &f.sources, &log, &psf, NULL);
        }
        assert_int_equal(status, RX_OK);
        assert_int_equal(psf->quality.how == RX_PSF_BY_MOFFAT_BETA, few);
        const char *at = NULL; /* each message ends in 0 */
        for (const char *c = said.data; at == NULL && c < said.data + said.length; c += strlen(c) + 1)
            at = strstr(c, "PSF_FWHM is 2 pixels");
        if (at == NULL)
            fail_msg("few %d, FWHM %g: '%s'", few, psf->fwhm, said.data);
        assert_int_equal(strstr(at, "which is taken") != NULL, !few);
        rx_text_free(&said);
        rx_psf_free(psf);
        free_field(&f);
    }
}

/* Every star that the PSF is from is one of the field's own, and `good` says so too. */
static void check_stars(const field *f, const rx_psf *psf, int (*good)(const field *, const rx_source *))
{
    for (int i = 0; i < psf->nstars; i++) {
        int found = 0;
        for (int k = 0; k < f->sources.n; k++) {
            const rx_source *s = &f->sources.list[k];
            found += s->class_star == 1.0 && hypot(s->x - psf->stars[i][0], s->y - psf->stars[i][1]) < 0.5 &&
                     good(f, s);
        }
        assert_int_equal(found, 1);
    }
}

static int any(const field *f, const rx_source *s)
{
    (void)f;
    (void)s;
    return 1;
}

/* A source that is drawn after the noise: a speck of light of that width, of a height of its own. */
static void add_speck(field *f, double x, double y, double peak, double wide, double high)
{
    rx_source *s = &f->sources.list[f->sources.n];
    *s = (rx_source){.x = x, .y = y, .peak = peak, .class_star = 5.0};
    s->number = s->segment = ++f->sources.n;
    for (int j = (int)y - 9; j <= (int)y + 9; j++)
        for (int i = (int)x - 9; i <= (int)x + 9; i++)
            if (i >= 0 && j >= 0 && i < SIDE && j < SIDE)
                f->tile.pixels[j * SIDE + i] +=
                    (float)(peak * exp2(-4.0 * (pow((i - x) / wide, 2) + pow((j - y) / high, 2))));
    measure_source(f, s, 6.0, fmin(wide, high) / fmax(wide, high));
}

/* Of the list the first n stars that are bright. */
static void keep_stars(field *f, int n)
{
    int kept = 0;
    for (int i = 0; i < f->sources.n && kept < n; i++)
        if (f->sources.list[i].class_star == 1.0 && f->sources.list[i].peak > 1000.0)
            f->sources.list[kept++] = f->sources.list[i];
    f->sources.n = kept;
}

/* Two wide stars among hits of particles, which are narrower than 1.2 pixels, unlike each other and outshone; two sources that are
 * not alike say nothing. */
static void test_particles_and_sizes(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    make_field(&f, 7.6, 4.0, 1.0, 0.0, 60, 0);
    keep_stars(&f, 2);
    for (int i = 0; i < 18; i++)
        add_speck(&f, 30.3 + 20 * i, 25.4 + 17 * (i % 5), 1500.0 - 40 * i, 0.35 + 0.03 * (i % 7),
                  0.35 + 0.03 * ((i + 3) % 7));
    assert_int_equal(estimate(&f, &psf, &err), RX_OK);
    assert_near(psf->fwhm, 7.6, 0.4);
    assert_int_equal(psf->nstars, 2);
    rx_psf_free(psf);
    free_field(&f);
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 60, 0);
    keep_stars(&f, 1);
    add_speck(&f, 300.3, 250.4, 1500.0, 3.0, 3.0);
    assert_int_equal(estimate(&f, &psf, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "no two alike"));
    free_field(&f);
}

/* Grain: many more specks than stars, as like one another, narrower, and of no bright members. */
static void test_specks(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    make_field(&f, 4.0, 4.0, 1.0, 0.0, 30, 200);
    f.sources.n -= 200;
    for (int i = 0; i < 160; i++)
        add_speck(&f, (i % 16 + 0.1) * 40.0 + uniform(11, (uint64_t)i),
                  (i / 16 + 0.03) * CELL + uniform(12, (uint64_t)i), 1500.0 + 10.0 * i, 2.0, 2.0);
    assert_int_equal(estimate(&f, &psf, &err), RX_OK);
    assert_near(psf->fwhm / 4.0, 1.0, 0.005);
    check_stars(&f, psf, any);
    rx_psf_free(psf);
    free_field(&f);
}

/* Hits of particles: short tracks of any direction. */
static void test_cosmic_rays(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 40, 200);
    f.sources.n -= 200;
    for (int i = 0; i < 150; i++)
        add_speck(&f, (i % 16 + 0.1) * 40.0 + uniform(11, (uint64_t)i),
                  (i / 16 + 0.03) * CELL + uniform(12, (uint64_t)i),
                  pow(10.0, 2.5 + 2.0 * uniform(13, (uint64_t)i)),
                  i % 2 ? 1.0 : 1.0 + 4.0 * uniform(14, (uint64_t)i),
                  i % 2 ? 1.0 + 4.0 * uniform(15, (uint64_t)i) : 1.0);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    assert_near(psf->fwhm / 3.0, 1.0, 0.005);
    check_stars(&f, psf, any);
    rx_psf_free(psf);
    free_field(&f);
}

static int without_trail(const field *f, const rx_source *s)
{
    (void)f;
    return s->peak <= 4000.0;
}

/* Saturated columns that bleed out of bright stars. */
static void test_bleeding(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 60, 0);
    f.tile.saturation = 5000.0;
    for (int k = 0; k < f.sources.n; k++) {
        const rx_source *s = &f.sources.list[k];
        for (int j = (int)lround(s->y) - 25; j <= (int)lround(s->y) + 25 && s->peak > 4000.0; j++)
            if (j >= 0 && j < SIDE)
                f.tile.pixels[j * SIDE + (int)lround(s->x)] = 5000.0F;
    }
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    assert_near(psf->fwhm / 3.0, 1.0, 0.006);
    check_stars(&f, psf, without_trail);
    rx_psf_free(psf);
    free_field(&f);
}

static int inside(const field *f, const rx_source *s)
{
    (void)f;
    return s->x > 5.0 && s->x < SIDE - 6.0;
}

/* The tile cuts stars. */
static void test_borders(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 40, 200);
    f.sources.n -= 200;
    for (int i = 0; i < 40; i++)
        add_speck(&f, i % 2 ? 0.5 + 0.1 * i : SIDE - 1.0 - 0.1 * i, (i + 0.5) * 16.0, 4000.0, 3.0, 3.0);
    for (int k = f.sources.n - 40; k < f.sources.n; k++)
        f.sources.list[k].class_star = 1.0; /* stars, too */
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    assert_near(psf->fwhm / 3.0, 1.0, 0.005);
    check_stars(&f, psf, inside);
    rx_psf_free(psf);
    free_field(&f);
}

/* A plate that saturates softly, at a level that the tile does not know; `few`: by the widths of its bright stars, where
 * too few pile up. */
static void soft_field(field *f, int few)
{
    enum { LEVEL = 3000 };
    int n = 0, bright = 0;
    make_field(f, 3.0, 4.0, 1.0, 0.0, 100, 0);
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
        if (f->tile.pixels[i] > 100.0F)
            f->tile.pixels[i] = 100.0F + (float)LEVEL * (1.0F - expf((100.0F - f->tile.pixels[i]) / LEVEL));
    for (int k = 0; k < f->sources.n; k++) {
        rx_source s = f->sources.list[k];
        if (few && s.peak > 4000.0 && ++bright > 8)
            continue;
        measure_source(f, &s, 7.5, 1.0);
        s.peak = LEVEL * (1.0 - exp(-s.peak / LEVEL));
        f->sources.list[n++] = s;
    }
    f->sources.n = n;
}

static int not_flat(const field *f, const rx_source *s)
{
    (void)f;
    return s->peak < 2600.0;
}

static void test_soft_saturation(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    for (int few = 0; few < 2; few++) {
        soft_field(&f, few);
        assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
        assert_between(psf->quality.limit, 1500.0, 2700.0);
        assert_near(psf->fwhm / 3.0, 1.0, 0.12); /* what is left is flattened a little, too */
        check_stars(&f, psf, not_flat);
        rx_psf_free(psf);
        free_field(&f);
    }
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 60, 0);
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    assert_near(psf->quality.limit, 0.0, 0.0);
    rx_psf_free(psf);
    free_field(&f);
}

/* Stars of all brightnesses through 1200 tanh(f / 1200): the profile is of those that are not flattened, and the limit is where they
 * are, whatever the sky at the tile's centre. */
static void test_flattened(void **state)
{
    (void)state;
    const size_t centre = (size_t)(SIDE / 2) * SIDE + SIDE / 2;
    const float level = 1200.0F;
    field f;
    rx_psf *psf;
    steep = 2.0;
    make_field(&f, 4.0, 4.0, 1.0, 0.0, 100, 0);
    steep = 1.0;
    for (size_t i = 0; i < (size_t)SIDE * SIDE; i++)
        if (f.tile.pixels[i] > 100.0F)
            f.tile.pixels[i] = 100.0F + level * tanhf((f.tile.pixels[i] - 100.0F) / level);
    for (int k = 0; k < f.sources.n; k++) {
        measure_source(&f, &f.sources.list[k], 10.0, 1.0);
        f.sources.list[k].peak = (double)level * tanh(f.sources.list[k].peak / (double)level);
    }
    f.background.level[centre] += 5000.0F;
    f.tile.pixels[centre] += 5000.0F;
    assert_int_equal(estimate(&f, &psf, NULL), RX_OK);
    print_message("limit %g: %s\n", psf->quality.limit, psf->description);
    assert_near(psf->fwhm, 4.0, 0.15);
    assert_between(psf->quality.limit, 400.0, 1200.0);
    rx_psf_free(psf);
    free_field(&f);
}

static int listed(const field *f, const rx_source *s)
{
    (void)f;
    return s->number_assoc == 1;
}

/* PSF_STARS_NAME: none but those of the list, which are looked at all the same. */
static void test_list(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    rx_psf_params par = {.type = RX_PSF_AUTO,
                         .beta = 4.765,
                         .min_stars = 1,
                         .min_snr = 20.0,
                         .max_degree = 4,
                         .stars_file = "a"};
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 60, 0);
    f.tile.saturation = 5000.0;
    const rx_image tile = rx_tile_image(&f.tile);
    rx_image image = rx_image_on_sky(&tile, &f.background);
    image.hide = RX_HIDE_RESTORED;
    assert_int_equal(rx_psf_make(&par, &image, &f.sources, NULL, &psf, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "found 0 usable stars of S/N above 20 among those of PSF_STARS_NAME"));
    for (int k = 0; k < f.sources.n; k += 2)
        f.sources.list[k].number_assoc = f.sources.list[k].class_star == 1.0;
    assert_int_equal(rx_psf_make(&par, &image, &f.sources, NULL, &psf, &err), RX_OK);
    assert_near(psf->fwhm / 3.0, 1.0, 0.005);
    assert_between(psf->nstars, 8, 30);
    check_stars(&f, psf, listed);
    for (int i = 0; i < psf->nstars; i++)
        assert_true(f.tile.pixels[(int)lround(psf->stars[i][1]) * SIDE + (int)lround(psf->stars[i][0])] <
                    4600.0F);
    rx_psf_free(psf);
    free_field(&f);
}

/* What sources say where none is a usable star; what is wider than faint sources is no star. */
static void test_bound(void **state)
{
    (void)state;
    field f;
    rx_psf *psf;
    rx_error err = RX_ERROR_NONE;
    rx_psf_params par = {
        .type = RX_PSF_AUTO, .beta = 4.765, .min_stars = 1, .min_snr = 20.0, .max_degree = 4};
    make_field(&f, 3.0, 4.0, 1.0, 0.0, 60, 0);
    const rx_image tile = rx_tile_image(&f.tile);
    rx_image image = rx_image_on_sky(&tile, &f.background);
    image.hide = RX_HIDE_RESTORED;
    assert_between(rx_psf_bound(&par, &image, &f.sources), 3.0, 4.2);
    int n = 0, faint = 0;
    for (int k = 0; k < f.sources.n; k++) { /* one galaxy, and stars too faint for a PSF */
        rx_source s = f.sources.list[k];
        const int galaxy = s.class_star > 2.0 && n == faint;
        if (s.class_star == 1.0 && faint < 6) {
            s.fluxerr_auto = s.flux_auto / 15.0;
            faint++;
        } else if (!galaxy) {
            continue;
        }
        f.sources.list[n++] = s;
    }
    f.sources.n = n;
    assert_true(n == faint + 1);
    assert_true(faint == 6);
    assert_int_equal(rx_psf_make(&par, &image, &f.sources, NULL, &psf, &err), RX_INPUT);
    f.sources.n = 2;
    assert_near(rx_psf_bound(&par, &image, &f.sources), 0.0, 0.0);
    free_field(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_known_widths),
        cmocka_unit_test(test_elongated),
        cmocka_unit_test(test_few_stars_and_hot_pixels),
        cmocka_unit_test(test_masked_pixels),
        cmocka_unit_test(test_saturated_stars),
        cmocka_unit_test(test_halo),
        cmocka_unit_test(test_wings_of_saturated),
        cmocka_unit_test(test_unseen_halo),
        cmocka_unit_test(test_spikes),
        cmocka_unit_test(test_varies),
        cmocka_unit_test(test_varies_much),
        cmocka_unit_test(test_bright_stars),
        cmocka_unit_test(test_bad_corner),
        cmocka_unit_test(test_followed_corner),
        cmocka_unit_test(test_corner_of_few_stars),
        cmocka_unit_test(test_compact_galaxies),
        cmocka_unit_test(test_outnumbered),
        cmocka_unit_test(test_narrow),
        cmocka_unit_test(test_threads),
        cmocka_unit_test(test_too_few),
        cmocka_unit_test(test_width_of_few_stars),
        cmocka_unit_test(test_single_object),
        cmocka_unit_test(test_contradicted_width),
        cmocka_unit_test(test_particles_and_sizes),
        cmocka_unit_test(test_specks),
        cmocka_unit_test(test_cosmic_rays),
        cmocka_unit_test(test_bleeding),
        cmocka_unit_test(test_borders),
        cmocka_unit_test(test_soft_saturation),
        cmocka_unit_test(test_flattened),
        cmocka_unit_test(test_list),
        cmocka_unit_test(test_bound),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
