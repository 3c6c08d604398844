/* simulate/coadd: stars keep flux, place and width; noise has the correlation of the geometry; weights. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
#include "simulate/coadd.h"

static const rx_coadd_params DRIZZLE = {.type = RX_COADD_DRIZZLE, .frames = 16, .pixfrac = 0.8, .scale = 0.6};
static const rx_coadd_params LANCZOS = {.type = RX_COADD_LANCZOS, .frames = 3, .pixfrac = 1, .scale = 1};
static const rx_noise_params SILENT = {.type = RX_NOISE_NONE, .saturation = HUGE_VAL, .seed = 5};

/* --- shorthand --- */

static rx_coadd coadd_of(const rx_coadd_params *par, const rx_scene *scene, double fwhm,
                         const rx_noise_params *noise, int nthreads)
{
    const size_t n = (size_t)scene->width * (size_t)scene->height;
    rx_coadd made = {.image = RX_NEW(float, n), .weight = RX_NEW(float, n), .defects = RX_NEW(uint8_t, n)};
    rx_optics *optics = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_optics_moffat(&(rx_moffat_profile){.fwhm = fwhm * par->scale, .beta = 4.765, .ratio = 1},
                         scene->width, scene->height, &optics, &err) != RX_OK ||
        rx_coadd_make(par, scene, optics, noise, nthreads, &made, &err) != RX_OK)
        fail_msg("%s", err.text);
    rx_optics_free(optics);
    return made;
}

static void free_coadd(rx_coadd *coadd)
{
    free(coadd->image);
    free(coadd->weight);
    free(coadd->defects);
}

static rx_scene *scene_of(int side, long n)
{
    rx_scene *scene = NULL;
    assert_int_equal(rx_scene_new(side, side, n, &scene, NULL), RX_OK);
    return scene;
}

static rx_coadd blank(const rx_coadd_params *par, int side, const rx_noise_params *noise)
{
    rx_scene *scene = scene_of(side, 0);
    rx_coadd made = coadd_of(par, scene, 4.0, noise, 2);
    rx_scene_free(scene);
    return made;
}

/* --- a lone star --- */

enum { SIDE = 70 };

/* Sum, and centre under a round Gaussian window, iterated as XWIN_IMAGE is. */
static double measure(const float *image, double *x, double *y)
{
    double flux = 0.0;
    for (int i = 0; i < SIDE * SIDE; i++)
        flux += (double)image[i];
    for (int step = 0; step < 30; step++) {
        double weight = 0.0, dx = 0.0, dy = 0.0;
        for (int i = 0; i < SIDE * SIDE; i++) {
            double u = i % SIDE - *x, v = i / SIDE - *y, w = exp(-(u * u + v * v) / 8.0) * (double)image[i];
            weight += w;
            dx += w * u;
            dy += w * v;
        }
        *x += 2.0 * dx / weight;
        *y += 2.0 * dy / weight;
    }
    return flux;
}

static void a_lone_star_keeps_flux_and_place(void **state)
{
    const rx_coadd_params *kinds[] = {&DRIZZLE, &LANCZOS};
    rx_scene *scene = scene_of(SIDE, 1);
    for (int kind = 0; kind < 2; kind++)
        for (int place = 0; place < 6; place++) {
            const double x = 33.0 + 0.37 * place, y = 36.0 - 0.23 * place;
            scene->objects[0] = (rx_object){.type = RX_OBJECT_STAR, .x = x, .y = y, .flux = 1e4};
            rx_coadd made = coadd_of(kinds[kind], scene, 4.0, &SILENT, 2);
            double u = x + 0.2, v = y - 0.2;
            assert_close(measure(made.image, &u, &v), 1e4, 1e-3);
            assert_near(u, x, 0.02);
            assert_near(v, y, 0.02);
            free_coadd(&made);
        }
    rx_scene_free(scene);
}

/* A galaxy in frame pixels is as large on the coadd as it would be on one exposure: half-light radii agree. */
static void galaxies_keep_flux_and_size(void **state)
{
    rx_scene *scene = scene_of(SIDE, 1);
    scene->objects[0] = (rx_object){.type = RX_OBJECT_GALAXY,
                                    .x = 34.3,
                                    .y = 35.1,
                                    .flux = 1e4,
                                    .radius = 3.0,
                                    .ratio = 1.0,
                                    .disk_radius = 3.0,
                                    .bulge_n = 1.0,
                                    .bulge_ratio = 1.0,
                                    .bulge_radius = 1.0};
    const rx_coadd_params fine = {.type = RX_COADD_DRIZZLE, .frames = 16, .pixfrac = 0.1, .scale = 0.5},
                          same = {.type = RX_COADD_LANCZOS, .frames = 1, .scale = 1.0};
    rx_coadd one = coadd_of(&fine, scene, 3.0, &SILENT, 2), two = coadd_of(&same, scene, 3.0, &SILENT, 2);
    double moment[2] = {0};
    for (int i = 0; i < SIDE * SIDE; i++) {
        double u = i % SIDE - 34.3, v = i / SIDE - 35.1, rr = u * u + v * v;
        moment[0] += rr < 400.0 ? rr * (double)one.image[i] / 1e4 : 0.0;
        moment[1] += rr < 400.0 ? rr * (double)two.image[i] / 1e4 : 0.0;
    }
    /* pixels are twice as wide: 2 (4 - 1) / 12; drops: 2 0.2^2 / 12; they fall into pixels: 2 / 12 */
    assert_near(moment[0] - moment[1], 2.0 * (4.0 - 1.0 + 0.04 + 1.0) / 12.0, 0.02);
    assert_near(moment[1], 20.0, 8.0);
    free_coadd(&one);
    free_coadd(&two);
    rx_scene_free(scene);
}

/* Radius where ln of the profile along x, a parabola through three pixels, has fallen by ln 2. */
static void the_width_of_a_star_is_foretold(void **state)
{
    rx_coadd_params par = DRIZZLE;
    rx_scene *scene = scene_of(SIDE, 1);
    scene->objects[0] = (rx_object){.type = RX_OBJECT_STAR, .x = 35, .y = 35, .flux = 1e4};
    for (int kind = 0; kind < 2; kind++) {
        par.frames = 24;
        par.type = kind == 0 ? RX_COADD_DRIZZLE : RX_COADD_LANCZOS;
        rx_coadd made = coadd_of(&par, scene, 4.0, &SILENT, 2);
        const float *row = made.image + 35 * SIDE + 35;
        double f[4], r = 2.2;
        for (int i = 1; i < 4; i++)
            f[i] = log(((double)row[i] + (double)row[-i]) / (2.0 * (double)row[0]));
        for (int step = 0; step < 20; step++) {
            double a = 0.5 * (f[1] - 2.0 * f[2] + f[3]), b = 0.5 * (f[3] - f[1]), t = r - 2.0;
            r -= (f[2] + b * t + a * t * t + M_LN2) / (b + 2.0 * a * t);
        }
        assert_near(2.0 * r, rx_coadd_fwhm(&par, 4.0, 4.765), 0.025);
        assert_between(2.0 * r, 4.05, 4.6);
        free_coadd(&made);
    }
    rx_scene_free(scene);
}

/* --- noise --- */

enum { BLANK = 260, LAG = 2 };

static double correlation(const float *image, double mean, int dx, int dy)
{
    double sum = 0.0, squares = 0.0;
    for (int y = 0; y < BLANK - dy; y++)
        for (int x = 0; x < BLANK - dx; x++) {
            double z = (double)image[y * BLANK + x] - mean;
            sum += z * ((double)image[(y + dy) * BLANK + x + dx] - mean);
            squares += z * z;
        }
    return sum / squares;
}

/* Along one axis: how drops that fall anywhere are shared by two output pixels `lag` apart, by counting points
 * of the drop that lie in each. */
static double shared(double drop, int lag)
{
    enum { PLACES = 900, POINTS = 300 };
    double sum = 0.0;
    for (int p = 0; p < PLACES; p++) {
        const double at = -2.0 + 6.0 * (p + 0.5) / PLACES;
        int first = 0, second = 0;
        for (int i = 0; i < POINTS; i++) {
            const double x = at + drop * ((i + 0.5) / POINTS - 0.5);
            first += fabs(x) < 0.5;
            second += fabs(x - lag) < 0.5;
        }
        sum += (double)first * second;
    }
    return sum;
}

static void drizzled_noise_has_the_correlation_of_the_drops(void **state)
{
    const rx_noise_params noise = {
        .type = RX_NOISE_GAUSS, .sky = 100, .sigma = 10, .gain = 2, .saturation = 1e4, .seed = 3};
    static const double drops[] = {0.8, 0.5};
    for (int k = 0; k < 2; k++) {
        rx_coadd_params par = DRIZZLE;
        par.frames = 24;
        par.pixfrac = drops[k];
        rx_coadd made = blank(&par, BLANK, &noise);
        const double r = par.pixfrac / par.scale;
        /* Casertano et al. 2000, AJ 120, 2747 */
        const double ratio = r >= 1.0 ? r / (1.0 - 1.0 / (3.0 * r)) : 1.0 / (1.0 - r / 3.0);
        double mean = 0.0, variance = 0.0, inverse = 0.0, sum = 0.0;
        for (int i = 0; i < BLANK * BLANK; i++) {
            mean += (double)made.image[i] / (BLANK * BLANK);
            inverse += 1.0 / (double)made.weight[i] / (BLANK * BLANK);
        }
        for (int i = 0; i < BLANK * BLANK; i++)
            variance += pow((double)made.image[i] - mean, 2.0) / (BLANK * BLANK);
        for (int dy = 0; dy <= LAG; dy++)
            for (int dx = 0; dx <= LAG; dx++) {
                const double found = correlation(made.image, mean, dx, dy);
                assert_near(found, shared(r, dx) * shared(r, dy) / pow(shared(r, 0), 2.0), 0.03);
                sum += found * (dx > 0 ? 2.0 : 1.0) * (dy > 0 ? 2.0 : 1.0);
            }
        assert_close(sqrt(sum), ratio, 0.02);
        assert_close(made.wide, ratio, 0.01);
        assert_close(made.sigma, sqrt(variance), 0.01);
        assert_close(made.sigma * made.wide, 0.6 * 10 / sqrt(24), 0.003);
        assert_close(sqrt(inverse), made.sigma * made.wide, 0.01);
        assert_near(mean, 36.0, 0.05);
        assert_near(made.noise.sky, 36.0, 1e-9);
        assert_near(made.noise.gain, 48.0, 1e-9);
        assert_near(made.noise.saturation, 3600.0, 1e-9);
        free_coadd(&made);
    }
}

/* Variance of image * root of weight, of the fifths of the pixels by weight, over some skies. */
static void uneven_weights_are_the_variance(void **state)
{
    enum { PARTS = 5, SKIES = 6, SIDE_OF_SKY = 200, PIXELS = SIDE_OF_SKY * SIDE_OF_SKY };
    rx_coadd_params par = LANCZOS;
    double steepest = 1.0;
    par.uneven = 1.0;
    for (int sky = 0; sky < SKIES; sky++) {
        const rx_noise_params noise = {.type = RX_NOISE_CCD,
                                       .sky = 200,
                                       .gain = 1.5,
                                       .read_noise = 6,
                                       .saturation = HUGE_VAL,
                                       .seed = 9,
                                       .stream = (uint64_t)sky};
        rx_coadd made = blank(&par, SIDE_OF_SKY, &noise);
        double low = HUGE_VAL, high = 0.0, squares[PARTS] = {0}, power = 0.0;
        long n[PARTS] = {0};
        for (int i = 0; i < PIXELS; i++) {
            low = fmin(low, (double)made.weight[i]);
            high = fmax(high, (double)made.weight[i]);
        }
        for (int i = 0; i < PIXELS; i++) {
            const double z = ((double)made.image[i] - 200.0) * sqrt((double)made.weight[i]);
            const int part = (int)(PARTS * 0.999 * log((double)made.weight[i] / low) / log(high / low));
            squares[part] += z * z;
            power += z * z;
            n[part]++;
        }
        steepest = fmax(steepest, high / low);
        assert_near(power / PIXELS, 1.0, 0.03);
        for (int part = 0; part < PARTS; part++) /* neighbours go together: errors are up to twice as large */
            if (n[part] > 200)
                assert_near(squares[part] / (double)n[part], 1.0, 8.0 * sqrt(2.0 / (double)n[part]));
        free_coadd(&made);
    }
    assert_between(steepest, 2.0, 20.0);
}

static void defects_of_frames_do_not_show(void **state)
{
    const rx_noise_params noise = {.type = RX_NOISE_CCD,
                                   .sky = 500,
                                   .gain = 2,
                                   .read_noise = 5,
                                   .saturation = HUGE_VAL,
                                   .bad_columns = 0.03,
                                   .cosmic_rays = 500,
                                   .seed = 8};
    for (int kind = 0; kind < 2; kind++) {
        rx_coadd made = blank(kind == 0 ? &DRIZZLE : &LANCZOS, 200, &noise);
        long empty = 0;
        for (int i = 0; i < 200 * 200; i++) {
            empty += made.weight[i] == 0.0f;
            assert_int_equal(made.weight[i] == 0.0f, made.defects[i] == RX_DEFECT_COLUMN);
            assert_int_equal(isnan(made.image[i]), made.weight[i] == 0.0f);
            if (made.weight[i] > 0.0f)
                assert_between(((double)made.image[i] - made.noise.sky) * sqrt((double)made.weight[i]), -7.0,
                               7.0);
        }
        assert_between((double)empty, 0.0, 400.0);
        free_coadd(&made);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_lone_star_keeps_flux_and_place),
        cmocka_unit_test(galaxies_keep_flux_and_size),
        cmocka_unit_test(the_width_of_a_star_is_foretold),
        cmocka_unit_test(drizzled_noise_has_the_correlation_of_the_drops),
        cmocka_unit_test(uneven_weights_are_the_variance),
        cmocka_unit_test(defects_of_frames_do_not_show),

    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
