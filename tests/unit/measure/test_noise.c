/* Noise law of a correlation against exact sums, and widened; pulls after Richardson-Lucy. */
#include "../detect/field.h"
#include "../near.h"
#include "measure/measure.h"
#include "measure/view.h"
#include "num/stats.h"
#include "psf/psf.h"
#include "restore/restore.h"

enum { W = 400, H = 400 };

static rx_image image_of(const field *f)
{
    return (rx_image){.width = f->width,
                      .height = f->height,
                      .pixels = f->pixels,
                      .noise = rx_map_plane(f->sigma, f->width),
                      .mask = f->mask,
                      .hide = 7,
                      .global_noise = 1.0};
}

static rx_noise_law fit(const field *f)
{
    rx_sources none = {.width = f->width, .height = f->height, .segments = RX_NEW(int32_t, f->n)};
    rx_image image = image_of(f);
    rx_noise_law law;
    assert_int_equal(rx_noise_law_fit(&image, &none, &(rx_noise_apertures){2000, 3, 1}, &law, NULL, NULL),
                     RX_OK);
    free(none.segments);
    return law;
}

/* Gaussian smoothing with unit sum; returns the kernel [15][15]. */
static void smooth(field *f, double sigma, double *kernel)
{
    double sum = 0.0;
    for (int i = 0; i < 225; i++) {
        double dx = i % 15 - 7, dy = i / 15 - 7;
        kernel[i] = exp(-(dx * dx + dy * dy) / (2.0 * sigma * sigma));
        sum += kernel[i];
    }
    float *out = RX_NEW(float, f->n);
    for (int y = 0; y < f->height; y++)
        for (int x = 0; x < f->width; x++) {
            double value = 0.0;
            for (int i = 0; i < 225; i++) {
                int u = (x + i % 15 - 7 + f->width) % f->width, v = (y + i / 15 - 7 + f->height) % f->height;
                value += kernel[i] / sum * f->pixels[v * f->width + u];
            }
            out[y * f->width + x] = (float)value;
        }
    for (int i = 0; i < 225; i++)
        kernel[i] /= sum;
    free(f->pixels);
    f->pixels = out;
}

/* sigma of a sum over a circle of smoothed unit noise: sqrt(sum (circle * kernel)^2), mean over the
 * places of the centre within a pixel. */
static double exact_sigma(double radius, const double *kernel)
{
    enum { REACH = 30, PLACES = 9 };
    double total = 0.0;
    for (int place = 0; place < PLACES; place++)
        for (int y = -REACH; y <= REACH; y++)
            for (int x = -REACH; x <= REACH; x++) {
                double value = 0.0;
                for (int i = 0; i < 225; i++) {
                    if (kernel[i] == 0.0)
                        continue;
                    double dx = x + i % 15 - 7 + (place % 3 - 1) / 3.0,
                           dy = y + i / 15 - 7 + (place / 3 - 1) / 3.0;
                    value += kernel[i] * rx_pixel_in_circle((float)dx, (float)dy, (float)radius, 5);
                }
                total += value * value;
            }
    return sqrt(total / PLACES);
}

/* sigma^2 of independent pixels goes with the area: 40 pixels more add 40. */
static void widened_law_has_the_noise_of_the_wider_area(void **state)
{
    field f = field_new(W, H, 1.0, 1);
    const rx_noise_law law = fit(&f);
    rx_noise_law wide = law;
    rx_noise_law_widen(&wide, 40.0);
    for (int i = 0; i < law.nradii; i++) {
        const double square = wide.ratio[i] * wide.ratio[i];
        assert_near(square / (law.area[i] + 40.0), 1.0, 0.12);
        assert_true(wide.area[i] == law.area[i]);
    }
    assert_near(rx_noise_law_factor(&wide, law.area[0]) * sqrt(law.area[0]), wide.ratio[0], 1e-9);
    rx_noise_law none = {.scale = 1.0, .power = 0.5};
    rx_noise_law_widen(&none, 40.0);
    assert_true(none.scale == 1.0);
    assert_true(none.power == 0.5);
    assert_true(rx_noise_law_factor(&none, 9.0) == 1.0);
    field_free(&f);
}

/* Without any apertures: from the kernel that white noise was smoothed with. */
static void law_of_a_correlation_has_the_exact_sums(void **state)
{
    double kernel[225], power = 0.0;
    float given[225];
    field f = field_new(W, H, 1.0, 2);
    smooth(&f, 1.5, kernel);
    for (int i = 0; i < 225; i++) {
        given[i] = (float)kernel[i];
        power += kernel[i] * kernel[i];
    }
    const rx_noise_correlation noise = rx_noise_of_kernel(given, 15, 15);
    const rx_noise_law law = rx_noise_law_of(&noise);
    const double radius[10] = {1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0};
    assert_int_equal(law.apertures, 0);
    assert_true(law.nradii > 10);
    for (int i = 0; i < 10; i++) {
        assert_near(law.ratio[i] * sqrt(power) / exact_sigma(radius[i], kernel), 1.0, 0.005);
        assert_near(rx_noise_law_factor(&law, law.area[i]) * sqrt(law.area[i]), law.ratio[i],
                    1e-9 * law.ratio[i]);
    }
    /* of very wide ones all that the kernel adds up to */
    assert_near(rx_noise_law_factor(&law, 1e6) * sqrt(power), 1.0, 0.005);
    const rx_noise_correlation white = rx_noise_white(RX_NOISE_MEASURED);
    const rx_noise_law none[2] = {rx_noise_law_of(&white), rx_noise_law_of(NULL)};
    for (int i = 0; i < 2; i++) {
        assert_true(none[i].nradii == 0);
        assert_true(rx_noise_law_factor(&none[i], 50.0) == 1.0);
    }
    field_free(&f);
}

static void no_free_sky_no_law(void **state)
{
    field f = field_new(W, H, 1.0, 3);
    for (size_t i = 0; i < f.n; i++)
        f.mask[i] = i % 4 == 0;
    rx_noise_law law = fit(&f);
    assert_int_equal(law.apertures, 0);
    assert_near(rx_noise_law_factor(&law, 50.0), 1.0, 0.0);
    field_free(&f);
}

enum { STARS = 196, SPACING = 28, FIELDS = 4 };

/* Moffat stars of S/N 10..60 on unit noise, jittered off their grid. */
static double add_star(field *f, int i, uint64_t seed, double *x, double *y)
{
    const double fwhm = 4.0, beta = 4.765;
    double gamma = fwhm / (2.0 * sqrt(pow(2.0, 1.0 / beta) - 1.0));
    uint64_t k = 3 * (uint64_t)i;
    *x = SPACING * (i % 14 + 0.5) + 4.0 * (rx_random_uniform(seed, 5, k) - 0.5);
    *y = SPACING * (i / 14 + 0.5) + 4.0 * (rx_random_uniform(seed, 5, k + 1) - 0.5);
    double flux = 60.0 * pow(6.0, rx_random_uniform(seed, 5, k + 2));
    double norm = flux * (beta - 1.0) / (3.14159265 * gamma * gamma * 25.0);
    for (int v = (int)*y - 20; v <= (int)*y + 20; v++)
        for (int u = (int)*x - 20; u <= (int)*x + 20; u++)
            for (int s = 0; s < 25; s++) {
                double dx = u + (s % 5 - 2) / 5.0 - *x, dy = v + (s / 5 - 2) / 5.0 - *y;
                if (u >= 0 && v >= 0 && u < f->width && v < f->height)
                    f->pixels[v * f->width + u] +=
                        (float)(norm * pow(1.0 + (dx * dx + dy * dy) / (gamma * gamma), -beta));
            }
    return flux;
}

/* Stars restored by RL, then detected and measured; flux, error and truth of what was found. */
static int restore_and_measure(const rx_psf *psf, uint64_t seed, double (*auto_flux)[3],
                               double (*aper_flux)[3])
{
    field f = field_new(W, H, 1.0, seed);
    double x[STARS], y[STARS], flux[STARS];
    for (int i = 0; i < STARS; i++)
        flux[i] = add_star(&f, i, seed, &x[i], &y[i]);
    rx_background sky = {
        .width = W, .height = H, .level = RX_NEW(float, f.n), .sigma = f.sigma, .global_sigma = 1.0};
    rx_tile tile = {.width = W, .height = H, .pixels = f.pixels, .mask = f.mask, .saturation = HUGE_VAL};
    rx_restore_params restore = {
        .rl_niter = 30, .rl_denoise = 0.8, .rl_denoise_by_psf = 1, .rl_pedestal = 4.0, .nthreads = 2};
    rx_restored *restored = NULL;
    const rx_image whole = rx_tile_image(&tile);
    rx_image observed = rx_image_on_sky(&whole, &sky);
    observed.psf = psf;
    assert_int_equal(rx_restorer_find("RL")->run(&restore, &observed, NULL, &restored, NULL), RX_OK);
    rx_detect_params detect = field_params();
    rx_image detect_image = field_image(&f);
    detect_image.pixels = restored->pixels;
    detect.threshold = 2.5;
    rx_sources *s = NULL;
    assert_int_equal(rx_detect_run(&detect, &detect_image, NULL, NULL, &s, NULL), RX_OK);
    rx_image image = image_of(&f);
    image.pixels = restored->pixels;
    rx_noise_law law;
    assert_int_equal(rx_noise_law_fit(&image, s, &(rx_noise_apertures){1000, 1, 1}, &law, NULL, NULL), RX_OK);
    assert_true(law.apertures > 1000);
    image.law = &law;
    rx_measure_params par = {.naper = 1,
                             .aperture_diameter = {12.0},
                             .auto_factor = 2.5,
                             .auto_min_radius = 3.5,
                             .neighbours = RX_NEIGHBOURS_CORRECT,
                             .nthreads = 2,
                             .skip = RX_SKIP_PETRO | RX_SKIP_RADIUS | RX_SKIP_WIN};
    assert_int_equal(rx_measure_run(&par, &image, NULL, NULL, s, NULL), RX_OK);
    int n = 0;
    for (int i = 0; i < STARS; i++) {
        const rx_source *q = field_find(s, x[i], y[i]);
        if (q == NULL || (q->flags & 3) != 0)
            continue;
        const double a[3] = {q->flux_auto, q->fluxerr_auto, flux[i]},
                     b[3] = {q->flux_aper[0], q->fluxerr_aper[0], flux[i]};
        memcpy(auto_flux[n], a, sizeof a);
        memcpy(aper_flux[n++], b, sizeof b);
    }
    rx_sources_free(s);
    rx_restored_free(restored);
    free(sky.level);
    field_free(&f);
    return n;
}

/* Robust width of (measured - true) / error, nothing taken out; *median of it tells the bias in sigmas. */
static double pull_width(double (*rows)[3], int n, double *median)
{
    double *pulls = RX_NEW(double, (size_t)n);
    assert_non_null(pulls);
    for (int i = 0; i < n; i++)
        pulls[i] = (rows[i][0] - rows[i][2]) / rows[i][1];
    double width = rx_sigma_mad(pulls, (size_t)n, median);
    free(pulls);
    return width;
}

static void pulls_have_unit_width_after_restoration(void **state)
{
    static double auto_flux[STARS * FIELDS][3], aper_flux[STARS * FIELDS][3];
    rx_psf *psf = NULL;
    int n = 0;
    assert_int_equal(rx_psf_moffat(4.0, 4.765, 1.0, 0.0, 0, &psf, NULL), RX_OK);
    for (uint64_t seed = 0; seed < FIELDS; seed++)
        n += restore_and_measure(psf, 100 + seed, auto_flux + n, aper_flux + n);
    rx_psf_free(psf);
    double median_auto, median_aper;
    double width_auto = pull_width(auto_flux, n, &median_auto);
    double width_aper = pull_width(aper_flux, n, &median_aper);
    print_message("%d stars: pull width (median) AUTO %.3f (%.2f), aperture %.3f (%.2f)\n", n, width_auto,
                  median_auto, width_aper, median_aper);
    assert_true(n > STARS * FIELDS / 2);
    assert_near(width_aper, 1.0, 0.08);
    assert_near(width_auto, 1.0, 0.06);
    /* the aperture is unbiased; RL's dark rings make AUTO, which ends inside them, 4 to 8 % too bright */
    assert_near(median_aper, 0.0, 0.2);
    assert_between(median_auto, 0.0, 1.5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(widened_law_has_the_noise_of_the_wider_area),
                                       cmocka_unit_test(law_of_a_correlation_has_the_exact_sums),
                                       cmocka_unit_test(no_free_sky_no_law),
                                       cmocka_unit_test(pulls_have_unit_width_after_restoration)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
