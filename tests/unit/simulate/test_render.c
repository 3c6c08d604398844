/* Optics, and stars and galaxies rendered through them, against the profile integrated by brute force and the PSF
 * module; blocks, threads, PSFs that vary. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/random.h"
#include "psf/psf.h"
#include "simulate/render.h"

/* The Moffat profile written the textbook way, and integrals of it by brute force. */
typedef struct theory {
    double fwhm, beta, ratio, angle; /* fwhm: geometric mean of the axes */
} theory;

static double theory_alpha(const theory *t)
{
    return t->fwhm / (2.0 * sqrt(pow(2.0, 1.0 / t->beta) - 1.0));
}

/* Flux 1 over the plane. */
static double theory_value(const theory *t, double x, double y)
{
    double u = x * cos(t->angle) + y * sin(t->angle), v = -x * sin(t->angle) + y * cos(t->angle);
    double alpha = theory_alpha(t), r2 = u * u * t->ratio + v * v / t->ratio;
    return (t->beta - 1.0) / (M_PI * alpha * alpha) * pow(1.0 + r2 / (alpha * alpha), -t->beta);
}

/* Over the rectangle of that centre and size, by Simpson's rule on 2 steps x 2 steps intervals. */
static double theory_box(const theory *t, double x, double y, double size, int steps)
{
    const int n = 2 * steps;
    double sum = 0.0;
    for (int j = 0; j <= n; j++)
        for (int i = 0; i <= n; i++) {
            double wx = i == 0 || i == n ? 1.0
                        : i % 2          ? 4.0
                                         : 2.0,
                   wy = j == 0 || j == n ? 1.0
                        : j % 2          ? 4.0
                                         : 2.0;
            sum +=
                wx * wy * theory_value(t, x + ((double)i / n - 0.5) * size, y + ((double)j / n - 0.5) * size);
        }
    return sum * size * size / (9.0 * n * n);
}

/* Round: share of the flux within r. */
static double theory_within(const theory *t, double r)
{
    double alpha = theory_alpha(t);
    return 1.0 - pow(1.0 + r * r / (alpha * alpha), 1.0 - t->beta);
}

static rx_optics *make_moffat(const theory *t, double variation, int width, int height)
{
    rx_error err = RX_ERROR_NONE;
    rx_optics *optics;
    rx_status status = rx_optics_moffat(
        &(rx_moffat_profile){
            .fwhm = t->fwhm, .beta = t->beta, .ratio = t->ratio, .angle = t->angle, .variation = variation},
        width, height, &optics, &err);
    if (status != RX_OK)
        print_message("%s\n", err.text);
    assert_int_equal(status, RX_OK);
    return optics;
}

static double cell(const rx_optics *optics, int image, int dx, int dy)
{
    size_t size = (size_t)optics->size, half = size / 2;
    return (double)
        optics->basis[((size_t)image * size + (size_t)((long)half + dy)) * size + (size_t)((long)half + dx)];
}

/* --- optics --- */

/* Near the centre, in the wings and at the corner: within 1e-6 of the peak. */
static void test_cells_are_integrals(void **state)
{
    const theory cases[] = {{2.0, 4.765, 1.0, 0.0}, {4.0, 2.5, 1.0, 0.0},  {14.0, 4.765, 1.0, 0.0},
                            {1.0, 3.0, 1.0, 0.0},   {3.0, 2.5, 0.6, 0.7},  {0.5, 4.765, 1.0, 0.0},
                            {6.0, 1.5, 0.8, -1.1},  {2.0, 1000., 1.0, 0.0}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        rx_optics *o = make_moffat(&cases[c], 0.0, 100, 100);
        double peak = cell(o, 0, 0, 0), worst = 0.0;
        int cells = o->oversampling;
        for (int k = 0; k < 60; k++) {
            int dx = k < 49 ? k % 7 - 3 : (k - 49) * (o->size / 2) / 10,
                dy = k < 49 ? k / 7 - 3 : (k - 49) % 3 * dx / 2;
            double want = theory_box(&cases[c], (double)dx / cells, (double)dy / cells, 1.0, 100);
            worst = fmax(worst, fabs(cell(o, 0, dx, dy) - want) / peak);
        }
        assert_true(worst < 1e-6);
        rx_optics_free(o);
    }
}

/* What is beyond the stamp: less than beyond the largest circle in it, more than beyond the smallest around.
 */
static void test_missing_flux(void **state)
{
    const double fwhms[] = {0.7, 2.0, 4.0, 8.0, 14.0, 60.0}, betas[] = {1.3, 2.0, 2.5, 4.765, 50.0};
    for (int f = 0; f < 6; f++)
        for (int b = 0; b < 5; b++) {
            theory t = {fwhms[f], betas[b], 1.0, 0.0};
            rx_optics *o = make_moffat(&t, 0.0, 100, 100);
            double half = 0.5 * o->size / o->oversampling, sum = 0.0;
            for (int i = 0; i < o->size * o->size; i++)
                sum += (double)o->basis[i];
            assert_true(fabs(1.0 - sum / (o->oversampling * o->oversampling) - o->missing) < 2e-6);
            assert_true(o->missing < 1.0 - theory_within(&t, half - 0.7) + 2e-6);
            assert_true(o->missing > 1.0 - theory_within(&t, (half + 0.7) * M_SQRT2) - 2e-6);
            /* 30 FWHM or 1000 pixels are enough from beta 2.3 on, but for the widest */
            if (betas[b] > 2.3 && !(fwhms[f] > 20.0 && betas[b] < 3.0))
                assert_true(o->missing < 1e-4);
            rx_optics_free(o);
        }
}

/* The polynomial at (x, y), cell (dx, dy). */
static double varying_cell(const rx_optics *o, double x, double y, int dx, int dy)
{
    double sum = 0.0;
    for (int t = 0; t < o->nterms; t++)
        sum += o->terms[t].factor * pow((x - o->x0) / o->xs, o->terms[t].px) *
               pow((y - o->y0) / o->ys, o->terms[t].py) * cell(o, o->terms[t].image, dx, dy);
    return sum;
}

/* Moffats whose FWHM grows towards the corners: every cell as the Moffat of that place has it, and the FWHM
 * within 0.1 %. */
static void test_variation(void **state)
{
    const struct {
        theory t;
        double variation;
    } cases[] = {{{4.0, 4.765, 1.0, 0.0}, 0.1}, {{3.0, 2.5, 0.8, 0.5}, 0.3}, {{2.5, 3.0, 1.0, 0.0}, 1.0}};
    const int width = 300, height = 200;
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        rx_optics *o = make_moffat(&cases[c].t, cases[c].variation, width, height);
        rx_psf *psf;
        rx_error err = RX_ERROR_NONE;
        assert_int_equal(rx_optics_on_pixels(o, &psf, &err), RX_OK);
        float *stamp = malloc(sizeof(float) * (size_t)psf->size * (size_t)psf->size);
        double worst = 0.0, worst_fwhm = 0.0, worst_sum = 0.0;
        for (int k = 0; k < 12; k++) {
            double x = (width - 1) * (k % 4 / 3.0), y = (height - 1) * (k / 4 / 2.0);
            double s = (pow(x - 149.5, 2) + pow(y - 99.5, 2)) / (149.5 * 149.5 + 99.5 * 99.5), fwhm, e,
                   sum = 0.0;
            theory here = cases[c].t;
            here.fwhm *= 1.0 + cases[c].variation * s;
            rx_psf_at(psf, x, y, stamp);
            double peak = theory_box(&here, 0.0, 0.0, 1.0, 60);
            for (int i = 0; i < psf->size * psf->size; i++)
                sum += (double)stamp[i];
            for (int d = 0; d <= 12; d++) {
                double want = theory_box(&here, d / 2, d % 2 * (d / 4), 1.0, 60);
                double got =
                    varying_cell(o, x, y, d / 2 * o->oversampling, d % 2 * (d / 4) * o->oversampling);
                worst = fmax(worst, fabs(got - want) / peak);
            }
            assert_int_equal(rx_psf_shape(stamp, psf->size, &fwhm, &e, NULL, &err), RX_OK);
            worst_fwhm = fmax(worst_fwhm, fabs(fwhm / here.fwhm - 1.0));
            worst_sum = fmax(worst_sum, fabs(sum - 1.0));
        }
        print_message("%s: %d images, error of a pixel %.1e of the peak, of the FWHM %.1e\n", o->description,
                      o->nbasis, worst, worst_fwhm);
        assert_true(worst < 1.5e-4);
        assert_true(worst_fwhm < 1e-3);
        assert_true(worst_sum < 2e-6);
        free(stamp);
        rx_psf_free(psf);
        rx_optics_free(o);
    }
}

/* A constant Moffat on pixels is the one that the PSF module makes. */
static void test_on_pixels_is_the_psf(void **state)
{
    const theory cases[] = {{2.0, 4.765, 1.0, 0.0}, {5.0, 2.5, 0.7, 0.4}, {14.0, 3.0, 1.0, 0.0}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        rx_error err = RX_ERROR_NONE;
        rx_optics *o = make_moffat(&cases[c], 0.0, 1000, 1000);
        rx_psf *got, *want;
        assert_int_equal(rx_optics_on_pixels(o, &got, &err), RX_OK);
        assert_int_equal(
            rx_psf_moffat(cases[c].fwhm, cases[c].beta, cases[c].ratio, cases[c].angle, 0, &want, &err),
            RX_OK);
        assert_int_equal(got->size, want->size);
        assert_int_equal(got->nbasis, 1);
        assert_int_equal(got->type, RX_PSF_MOFFAT);
        for (int i = 0; i < got->size * got->size; i++)
            assert_true(fabsf(got->basis[i] - want->basis[i]) <
                        2e-6f * want->basis[got->size * got->size / 2]);
        assert_true(got->fwhm == want->fwhm);
        assert_true(got->beta == want->beta);
        assert_true(got->ellipticity == want->ellipticity);
        rx_psf_free(got);
        rx_psf_free(want);
        rx_optics_free(o);
    }
}

/* A PSF that varies goes through the optics unharmed. */
static void test_psf_there_and_back(void **state)
{
    rx_error err = RX_ERROR_NONE;
    rx_psf *psf = rx_psf_new(RX_PSF_PSFEX, 9, 3), *back;
    rx_optics *o;
    assert_non_null(psf);
    for (int b = 0; b < 3; b++) {
        double sum = 0.0;
        for (int i = 0; i < 81; i++) {
            double x = i % 9 - 4, y = i / 9 - 4;
            double v = exp(-0.3 * (x * x + y * y)) * (b == 0 ? 1.0 : b == 1 ? x * x - 1.7 : y * y - 1.7);
            psf->basis[b * 81 + i] = (float)v;
            sum += v;
        }
        for (int i = 0; i < 81; i++)
            psf->basis[b * 81 + i] =
                b == 0 ? psf->basis[i] / (float)sum : psf->basis[b * 81 + i] - (float)(sum / 81.0);
        psf->px[b] = b == 1;
        psf->py[b] = b == 2;
    }
    psf->x0 = 12.0, psf->y0 = 20.0, psf->xs = 100.0, psf->ys = 120.0;
    psf->fwhm = 3.3;
    snprintf(psf->description, sizeof psf->description, "made by hand");
    assert_int_equal(rx_optics_psf(psf, &o, &err), RX_OK);
    assert_int_equal(rx_optics_on_pixels(o, &back, &err), RX_OK);
    assert_int_equal(back->size, 9);
    assert_int_equal(back->nbasis, 3);
    assert_int_equal(back->type, RX_PSF_PSFEX);
    assert_string_equal(back->description, "made by hand");
    for (int k = 0; k < 4; k++) {
        float want[81], got[81];
        rx_psf_at(psf, 30.0 * k, 25.0 * k, want);
        rx_psf_at(back, 30.0 * k, 25.0 * k, got);
        for (int i = 0; i < 81; i++)
            assert_true(fabsf(want[i] - got[i]) < 1e-6f);
    }
    rx_psf_free(psf);
    rx_psf_free(back);
    rx_optics_free(o);
}

static void test_bad_values(void **state)
{
    const double cases[][5] = {{0.2, 3, 1, 0, 0},  {300, 3, 1, 0, 0}, {4, 1.0, 1, 0, 0},
                               {4, 3, 0.01, 0, 0}, {4, 3, 1.5, 0, 0}, {4, 3, 1, INFINITY, 0},
                               {4, 3, 1, 0, -0.9}, {4, 3, 1, 0, 3},   {NAN, 3, 1, 0, 0}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        rx_error err = RX_ERROR_NONE;
        rx_optics *o = (rx_optics *)&err;
        const double *v = cases[c];
        assert_int_equal(rx_optics_moffat(
                             &(rx_moffat_profile){
                                 .fwhm = v[0], .beta = v[1], .ratio = v[2], .angle = v[3], .variation = v[4]},
                             100, 100, &o, &err),
                         RX_USAGE);
        assert_null(o);
        assert_true(strlen(err.text) > 20);
    }
    rx_error err = RX_ERROR_NONE;
    rx_optics *o;
    assert_int_equal(rx_optics_gauss(0.0, &o, &err), RX_USAGE);
    assert_null(o);
    rx_optics_free(NULL);
}

/* --- scenes --- */

typedef struct field {
    rx_scene scene;
    float *image;
} field;

static void field_open(field *f, int width, int height, long n)
{
    memset(f, 0, sizeof *f);
    f->scene.width = width;
    f->scene.height = height;
    f->scene.n = n;
    f->scene.objects = calloc((size_t)n, sizeof *f->scene.objects);
    f->image = calloc((size_t)width * (size_t)height, sizeof *f->image);
    assert_non_null(f->scene.objects);
    assert_non_null(f->image);
}

static void field_close(field *f)
{
    free(f->scene.objects);
    free(f->image);
}

static void set_star(rx_object *o, double x, double y, double flux)
{
    *o = (rx_object){.type = RX_OBJECT_STAR, .x = x, .y = y, .flux = flux};
}

static void set_disk(rx_object *o, double x, double y, double flux, double radius)
{
    *o = (rx_object){.type = RX_OBJECT_GALAXY,
                     .x = x,
                     .y = y,
                     .flux = flux,
                     .radius = radius,
                     .ratio = 0.6,
                     .angle = 0.4,
                     .disk_radius = radius};
}

static void render(const field *f, const rx_optics *optics, int block, int threads, float *image)
{
    rx_error err = RX_ERROR_NONE;
    rx_status status = rx_render_blocks(&f->scene, 1, &optics, &image, block, threads, &err);
    if (status != RX_OK)
        print_message("%s\n", err.text);
    assert_int_equal(status, RX_OK);
}

static double draw(int seed, int k)
{
    return rx_random_uniform(5, (uint64_t)seed, (uint64_t)k);
}

/* --- one star --- */

/* Every pixel of stars at random places: the Moffat integrated over the pixel, by brute force. The shift and
 * the flux that fit the differences best are the errors of centroid and flux. */
static void test_pixels_of_a_star(void **state)
{
    const double fwhms[] = {1.0, 2.0, 4.0, 8.0, 14.0}, betas[] = {4.765, 2.5};
    for (int c = 0; c < 10; c++) {
        theory t = {fwhms[c / 2], betas[c % 2], c == 5 ? 0.7 : 1.0, c == 5 ? 0.6 : 0.0};
        rx_optics *o = make_moffat(&t, 0.0, 0, 0);
        double worst = 0.0, worst_shift = 0.0, worst_flux = 0.0;
        for (int trial = 0; trial < 4; trial++) {
            const int side = 41;
            field f;
            field_open(&f, side, side, 1);
            double x = 20.0 + draw(c, 2 * trial) - 0.5, y = 20.0 + draw(c, 2 * trial + 1) - 0.5;
            double peak = theory_box(&t, 0.0, 0.0, 1.0, 30), gx = 0.0, gy = 0.0, g2 = 0.0, m = 0.0, m2 = 0.0;
            set_star(f.scene.objects, x, y, 1.0);
            render(&f, o, RX_RENDER_BLOCK, 1, f.image);
            for (int j = 0; j < side; j++)
                for (int i = 0; i < side; i++) {
                    double want = theory_box(&t, i - x, j - y, 1.0, t.fwhm < 2.0 ? 25 : t.fwhm < 4.0 ? 8 : 4);
                    double by_x = (theory_box(&t, i - x - 0.01, j - y, 1.0, 2) -
                                   theory_box(&t, i - x + 0.01, j - y, 1.0, 2)) /
                                  0.02;
                    double by_y = (theory_box(&t, i - x, j - y - 0.01, 1.0, 2) -
                                   theory_box(&t, i - x, j - y + 0.01, 1.0, 2)) /
                                  0.02;
                    double error = (double)f.image[j * side + i] - want;
                    worst = fmax(worst, fabs(error) / peak);
                    gx += error * by_x, gy += error * by_y, g2 += 0.5 * (by_x * by_x + by_y * by_y);
                    m += error * want, m2 += want * want;
                }
            worst_shift = fmax(worst_shift, hypot(gx, gy) / g2);
            worst_flux = fmax(worst_flux, fabs(m / m2));
            field_close(&f);
        }
        print_message("FWHM %4.1f beta %.3f: pixels to %.1e of the peak, centroid to %.1e px, flux to %.1e\n",
                      t.fwhm, t.beta, worst, worst_shift, worst_flux);
        assert_true(worst < (t.fwhm < 2.0 ? 1e-4 : 3e-5));
        assert_true(worst_shift < 1e-4);
        assert_true(worst_flux < 1e-4);
        rx_optics_free(o);
    }
}

/* --- many objects --- */

static void fill_field(field *f, int width, int height)
{
    field_open(f, width, height, 120);
    for (int k = 0; k < 120; k++) {
        double x = (width + 60.0) * draw(20, 3 * k) - 30.0, y = (height + 60.0) * draw(20, 3 * k + 1) - 30.0;
        double flux = 1000.0 * pow(100.0, draw(20, 3 * k + 2));
        if (k % 3)
            set_star(&f->scene.objects[k], x, y, flux);
        else
            set_disk(&f->scene.objects[k], x, y, flux, k == 0 ? 60.0 : 1.0 + 5.0 * draw(21, k));
    }
}

static double worst_difference(const float *a, const float *b, long n, double *peak)
{
    double worst = 0.0;
    *peak = 0.0;
    for (long i = 0; i < n; i++) {
        worst = fmax(worst, fabs((double)a[i] - (double)b[i]));
        *peak = fmax(*peak, fabs((double)a[i]));
    }
    return worst;
}

/* Blocks of any size, oblong tiles, constant and varying optics: the same image to rounding. */
static void test_blocks_add_up(void **state)
{
    const int blocks[] = {57, 100, 160}, width = 260, height = 190;
    for (int varying = 0; varying < 2; varying++) {
        field f;
        fill_field(&f, width, height);
        float *other = malloc(sizeof(float) * (size_t)width * (size_t)height);
        rx_optics *o = make_moffat(&(theory){3.0, 3.5, 0.8, 0.3}, varying ? 0.2 : 0.0, width, height);
        render(&f, o, RX_RENDER_BLOCK, 1, f.image);
        for (int b = 0; b < 3; b++) {
            double peak;
            memset(other, 0, sizeof(float) * (size_t)width * (size_t)height);
            render(&f, o, blocks[b], 1, other);
            double worst = worst_difference(f.image, other, (long)width * height, &peak);
            assert_true(peak > 1000.0);
            assert_true(worst < (varying ? 4e-6 : 2e-6) * peak);
        }
        free(other);
        rx_optics_free(o);
        field_close(&f);
    }
}

/* Two images at once, each as if it had been alone. */
static void test_together(void **state)
{
    enum { WIDE = 310, HIGH = 207, N = WIDE * HIGH };
    static float together[2][N], alone[N];
    float *images[2] = {together[0], together[1]};
    field f;
    fill_field(&f, WIDE, HIGH);
    rx_optics *o[2] = {make_moffat(&(theory){3.0, 4.765, 1.0, 0.0}, 0.15, WIDE, HIGH), NULL};
    assert_int_equal(rx_optics_gauss(2.0, &o[1], NULL), RX_OK);
    assert_int_equal(rx_render_blocks(&f.scene, 2, (const rx_optics *const *)o, images, 128, 2, NULL), RX_OK);
    for (int i = 0; i < 2; i++) {
        double peak;
        memset(alone, 0, sizeof alone);
        render(&f, o[i], 128, 1, alone);
        assert_true(worst_difference(together[i], alone, N, &peak) <= 3e-6 * peak);
        rx_optics_free(o[i]);
    }
    field_close(&f);
}

/* A disk through a Gaussian: flux, centre and second moments add. */
static void test_moments_of_a_galaxy(void **state)
{
    rx_error err = RX_ERROR_NONE;
    rx_optics *o;
    field f;
    field_open(&f, 201, 201, 1);
    set_disk(f.scene.objects, 100.3, 99.6, 1e5, 3.0);
    f.scene.objects[0].ratio = 1.0;
    assert_int_equal(rx_optics_gauss(4.0, &o, &err), RX_OK);
    render(&f, o, RX_RENDER_BLOCK, 2, f.image);
    double sum = 0.0, x = 0.0, y = 0.0, r2 = 0.0, alone[3] = {0.0};
    for (int j = 0; j < 201; j++)
        for (int i = 0; i < 201; i++) {
            double v = (double)f.image[j * 201 + i];
            sum += v, x += v * i, y += v * j, r2 += v * (pow(i - 100.3, 2) + pow(j - 99.6, 2));
        }
    /* the galaxy by itself on a much finer grid */
    rx_fine_grid grid = {.width = 1401, .height = 1401, .x0 = 30.3, .y0 = 29.6, .step = 0.1, .stride = 1401};
    grid.cells = calloc(1401 * 1401, sizeof *grid.cells);
    assert_int_equal(rx_galaxy_draw(f.scene.objects, &grid, NULL), RX_OK);
    for (int j = 0; j < 1401; j++)
        for (int i = 0; i < 1401; i++) {
            double v = (double)grid.cells[j * 1401 + i];
            alone[0] += v, alone[1] += v * 0.01 * (pow(i - 700, 2) + pow(j - 700, 2));
        }
    double added = 2.0 * (pow(4.0 / 2.354820045, 2) + 1.0 / 12.0);
    assert_true(fabs(sum / 1e5 - 1.0) < 1e-3);
    assert_true(fabs(sum / alone[0] - 1.0) < 1e-3);
    assert_true(hypot(x / sum - 100.3, y / sum - 99.6) < 2e-3);
    assert_true(fabs(r2 / sum / (alone[1] / alone[0] + added) - 1.0) < 3e-3);
    free(grid.cells);
    rx_optics_free(o);
    field_close(&f);
}

/* --- PSFs that vary --- */

/* A star looks as through constant optics of the FWHM of its place. */
static void test_varying_star(void **state)
{
    const int width = 220, height = 160;
    const double places[][2] = {{109.5, 79.5}, {20.3, 30.7}, {200.2, 12.9}, {60.6, 140.1}};
    theory t = {3.0, 4.765, 1.0, 0.0};
    rx_optics *varying = make_moffat(&t, 0.25, width, height);
    for (int k = 0; k < 4; k++) {
        field f;
        double x = places[k][0], y = places[k][1], peak;
        double s = (pow(x - 109.5, 2) + pow(y - 79.5, 2)) / (109.5 * 109.5 + 79.5 * 79.5);
        theory here = {3.0 * (1.0 + 0.25 * s), 4.765, 1.0, 0.0};
        rx_optics *constant = make_moffat(&here, 0.0, 0, 0);
        float *want = calloc((size_t)width * height, sizeof *want);
        field_open(&f, width, height, 1);
        set_star(f.scene.objects, x, y, 1e4);
        render(&f, varying, 100, 2, f.image);
        render(&f, constant, 100, 2, want);
        double worst = worst_difference(want, f.image, (long)width * height, &peak);
        assert_true(worst < 2e-4 * peak);
        free(want);
        rx_optics_free(constant);
        field_close(&f);
    }
    rx_optics_free(varying);
}

/* PSFEx's model of a real exposure: in the middle of a pixel as rx_psf_at() has it, in between as its sinc
 * interpolation, off the tile's border as on it. */
static void test_psfex_model(void **state)
{
    const char *shared = getenv("RX_SHARED_DATA");
    char name[4096];
    snprintf(name, sizeof name, "%s/psfex/c4d_140818_002108_ooi_z_v1.ext27.psf",
             shared != NULL ? shared : "");
    FILE *file = shared != NULL ? fopen(name, "rb") : NULL;
    if (file == NULL) {
        print_message("no RX_SHARED_DATA with a PSFEx model: not tested\n");
        skip();
    }
    fclose(file);
    const int width = 2046, height = 600;
    rx_error err = RX_ERROR_NONE;
    rx_psf *psf;
    rx_optics *o;
    assert_int_equal(rx_psf_psfex(&(rx_psf_params){.file = name}, width, height, NULL, &psf, &err), RX_OK);
    assert_int_equal(rx_optics_psf(psf, &o, &err), RX_OK);
    assert_true(psf->nbasis > 1);
    const double stars[][2] = {
        {100.0, 100.0}, {1900.0, 80.0}, {1024.0, 301.0}, {700.4, 450.7}, {1500.25, 333.5}};
    field f;
    field_open(&f, width, height, 5);
    for (int k = 0; k < 5; k++)
        set_star(&f.scene.objects[k], stars[k][0], stars[k][1], 1000.0);
    render(&f, o, RX_RENDER_BLOCK, 2, f.image);
    const int size = psf->size, half = size / 2;
    float *stamp = malloc(sizeof(float) * (size_t)size * (size_t)size);
    for (int k = 0; k < 5; k++) {
        double worst = 0.0, x = stars[k][0], y = stars[k][1];
        rx_psf_at(psf, x, y, stamp);
        double peak = (double)stamp[half * size + half];
        for (int j = -half; j <= half; j++)
            for (int i = -half; i <= half; i++) {
                double want = 0.0, dx = floor(x + 0.5) + i - x, dy = floor(y + 0.5) + j - y;
                for (int b = 0; b < size; b++)
                    for (int a = 0; a < size; a++) {
                        double u = dx - (a - half), v = dy - (b - half);
                        want += (double)stamp[b * size + a] * (u == 0.0 ? 1.0 : sin(M_PI * u) / (M_PI * u)) *
                                (v == 0.0 ? 1.0 : sin(M_PI * v) / (M_PI * v));
                    }
                double got =
                    (double)f.image[(int)(floor(y + 0.5) + j) * width + (int)(floor(x + 0.5) + i)] / 1000.0;
                worst = fmax(worst, fabs(got - want) / peak);
            }
        print_message("PSFEx star %d: within %.1e of the peak\n", k, worst);
        assert_true(worst < 1e-4);
    }
    free(stamp);
    field_close(&f);
    rx_optics_free(o);
    rx_psf_free(psf);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_cells_are_integrals),
        cmocka_unit_test(test_missing_flux),
        cmocka_unit_test(test_variation),
        cmocka_unit_test(test_on_pixels_is_the_psf),
        cmocka_unit_test(test_psf_there_and_back),
        cmocka_unit_test(test_bad_values),
        cmocka_unit_test(test_pixels_of_a_star),
        cmocka_unit_test(test_blocks_add_up),
        cmocka_unit_test(test_together),
        cmocka_unit_test(test_moments_of_a_galaxy),
        cmocka_unit_test(test_varying_star),
        cmocka_unit_test(test_psfex_model),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
