/* Template photometry of small images whose truth is known. */
#include "../near.h"
#include "field.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"
#include "num/convolve.h"
#include "psf/psf.h"

/* Nothing that blurs comparisons with closed forms: no background, no sky, a perfect PSF. */
static rx_tphot_params plain_params(void)
{
    rx_tphot_params par = rx_tphot_defaults();
    par.background_sigma = 0;
    par.sky_cell = 0;
    par.psf_error = 0;
    return par;
}

static rx_tphot *run(const rx_tphot_params *par, const field *f)
{
    const rx_tphot_input input = field_input(f);
    rx_tphot *tphot = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_tphot_run(par, &input, &tphot, &err), RX_OK);
    return tphot;
}

static void list_star(field *f, double x, double y)
{
    field_list(f, x, y, 1.5 * f->fwhm, f->fwhm / 2.355, f->fwhm / 2.355, 0);
}

static double psf_power(const field *f)
{
    double sum = 0;
    for (int k = 0; k < f->psf->size * f->psf->size; k++)
        sum += (double)f->psf->basis[k] * f->psf->basis[k];
    return sum;
}

static void test_star(void **state)
{
    (void)state;
    for (int k = 0; k < 3; k++) {
        const double fwhm = 3.0 + 1.5 * k, flux = 1e5;
        field f;
        field_open(&f, 120, 110, fwhm, 1, 1);
        field_star(&f, 57.3, 50.8, flux);
        list_star(&f, 57.1, 50.9);
        field_restore_none(&f);
        const rx_tphot_params par = plain_params();
        rx_tphot *t = run(&par, &f);
        const rx_tphot_source *s = &t->list[0];
        assert_close(s->flux, flux, 1e-4);
        assert_close(s->fluxerr, 1 / sqrt(psf_power(&f)), 1e-3); /* of the matched filter */
        assert_near(s->x, 57.3, 1e-3);
        assert_near(s->y, 50.8, 1e-3);
        assert_int_equal(s->kind, RX_TPHOT_POINT);
        assert_int_equal(s->flags, 0);
        assert_true(s->star > 0.9);
        assert_true(s->blend == 0);
        assert_true(s->point == 1);
        assert_true(s->inside > 0.999);
        assert_close(s->snr, s->flux / s->fluxerr, 1e-12);
        rx_tphot_free(t);
        field_close(&f);
    }
}

static void test_disk(void **state)
{
    (void)state;
    field f;
    field_open(&f, 140, 130, 4, 1, 1);
    field_disk(&f, 70.4, 64.7, 1e5, 3, 0.5, 0.6);
    field_list(&f, 70.4, 64.7, 8, 3, 2, 0.6);
    field_restore_none(&f);
    const rx_tphot_params par = plain_params();
    rx_tphot *t = run(&par, &f);
    const rx_tphot_source *s = &t->list[0];
    assert_close(s->flux, 1e5, 1e-4);
    assert_int_equal(s->kind, RX_TPHOT_PROFILE);
    assert_close(s->radius, 3, 5e-3);
    assert_close(s->ratio, 0.5, 5e-3);
    assert_close(s->angle, 0.6, 5e-3);
    assert_near(s->index, 0.5, 0.008);
    assert_true(s->star < 1e-6);
    assert_true(s->shape_error > 1);
    rx_tphot_free(t);
    field_close(&f);
}

/* Two stars, and a star beside a disk. */
static void test_pairs(void **state)
{
    (void)state;
    for (int k = 0; k < 3; k++) {
        field f;
        const double apart = k == 2 ? 14 : 4 - 1.5 * k;
        field_open(&f, 140, 130, 4, 1, 2);
        field_star(&f, 60.2, 60.7, 1e5);
        if (k == 2)
            field_disk(&f, 60.2 + apart, 60.2, 4e4, 3, 0.5, 0.6);
        else
            field_star(&f, 60.2 + apart, 60.2, 4e4);
        list_star(&f, 60.3, 60.6);
        field_list(&f, 60.1 + apart, 60.3, 6, k == 2 ? 3 : 1.7, k == 2 ? 2 : 1.7, 0.6);
        field_restore_none(&f);
        rx_tphot_params par = plain_params();
        par.extended = k == 2;
        par.rounds = 4;
        rx_tphot *t = run(&par, &f);
        assert_close(t->list[0].flux, 1e5, k == 1 ? 2e-4 : 1e-4);
        assert_close(t->list[1].flux, 4e4, k == 1 ? 5e-4 : 1e-4);
        assert_int_equal(t->ngroups, k == 2 ? 2 : 1);
        rx_tphot_free(t);
        field_close(&f);
    }
}

/* Two stars and a disk on top of each other, of S/N 10,000: all that is left is what rounds have not yet
 * found. */
static void test_blend(void **state)
{
    (void)state;
    field f;
    const double flux[3] = {1e5, 4e4, 1e5};
    field_open(&f, 140, 130, 4, 1, 3);
    field_star(&f, 60.2, 60.7, flux[0]);
    field_star(&f, 64.4, 60.2, flux[1]); /* 1.05 FWHM away */
    field_disk(&f, 70.4, 66.7, flux[2], 3, 0.5, 0.6);
    list_star(&f, 60.3, 60.6);
    list_star(&f, 64.3, 60.3);
    field_list(&f, 70.4, 66.7, 6, 3, 2, 0.6);
    field_restore_none(&f);
    rx_tphot_params par = plain_params();
    par.covariance = par.keep_model = 1;
    par.rounds = 6;
    rx_tphot *t = run(&par, &f);
    for (int i = 0; i < 3; i++)
        assert_close(t->list[i].flux, flux[i], 6e-3);
    assert_int_equal(t->ngroups, 1);
    assert_int_equal(t->npairs, 3);
    assert_true(t->pairs[0].i == 0);
    assert_true(t->pairs[0].j == 1);
    assert_true(t->pairs[0].covariance < 0);
    const double coefficient = fabs(t->pairs[0].covariance) / (t->list[0].fluxerr * t->list[1].fluxerr);
    assert_close(t->list[0].blend, coefficient, 1e-6);
    assert_true(coefficient > 0.2);
    for (size_t k = 0; k < 140 * 130; k++)
        assert_near((double)f.pixels[k] - t->model[k], t->residual[k], 1e-2);
    rx_tphot_free(t);
    field_close(&f);
}

static void crowd(field *f, uint64_t seed)
{
    field_open(f, 260, 250, 3, 1, 60);
    for (int i = 0; i < 60; i++) {
        const double x = 260 * rx_random_uniform(seed, 1, (uint64_t)i);
        const double y = 250 * rx_random_uniform(seed, 2, (uint64_t)i);
        const double flux = 100 * pow(100, rx_random_uniform(seed, 3, (uint64_t)i));
        if (i % 10 == 0)
            field_disk(f, x, y, flux, 2.5, 0.6, i);
        else
            field_star(f, x, y, flux);
    }
    for (int i = 0; i < 60; i++) {
        const double x = 260 * rx_random_uniform(seed, 1, (uint64_t)i);
        const double y = 250 * rx_random_uniform(seed, 2, (uint64_t)i);
        field_list(f, x, y, 5, i % 10 == 0 ? 2.5 : 1.3, i % 10 == 0 ? 2 : 1.3, 0.1 * i);
    }
    field_noise(f, seed);
    for (size_t k = 0; k < 260 * 250; k++)
        f->mask[k] = k % 97 == 0 ? 1 : 0;
    memcpy(f->restored->mask, f->mask, 260 * 250);
    field_restore_none(f);
}

static void assert_same(const rx_tphot *a, const rx_tphot *b)
{
    assert_int_equal(a->n, b->n);
    assert_int_equal(a->npairs, b->npairs);
    assert_memory_equal(a->list, b->list, (size_t)a->n * sizeof *a->list);
    if (a->npairs > 0)
        assert_memory_equal(a->pairs, b->pairs, (size_t)a->npairs * sizeof *a->pairs);
    assert_memory_equal(a->model, b->model, (size_t)a->width * (size_t)a->height * sizeof(float));
    assert_memory_equal(a->residual, b->residual, (size_t)a->width * (size_t)a->height * sizeof(float));
}

static void test_threads_and_masks(void **state)
{
    (void)state;
    field f;
    crowd(&f, 4);
    rx_tphot_params par = rx_tphot_defaults();
    par.covariance = par.keep_model = 1;
    rx_tphot *one = run(&par, &f);
    for (int n = 2; n <= 3; n++) {
        par.nthreads = n;
        rx_tphot *more = run(&par, &f);
        assert_same(one, more);
        rx_tphot_free(more);
    }
    par.nthreads = 1;
    for (size_t k = 0; k < 260 * 250; k++)
        if (f.mask[k] != 0) {
            f.pixels[k] = k % 2 ? NAN : 1e9f;
            f.sigma[k] = k % 3 ? NAN : 0;
            f.restored->pixels[k] = k % 2 ? 1e9f : NAN;
        }
    rx_tphot *other = run(&par, &f);
    assert_same(one, other);
    rx_tphot_free(other);
    rx_tphot_free(one);
    field_close(&f);
}

/* Shapes from one image, fluxes from another of wider PSF. */
static void test_forced(void **state)
{
    (void)state;
    field a, b;
    field_open(&a, 140, 130, 3, 1, 2);
    field_star(&a, 50.2, 60.7, 1e5);
    field_disk(&a, 80.4, 66.7, 1e5, 3, 0.5, 0.6);
    list_star(&a, 50.2, 60.7);
    field_list(&a, 80.4, 66.7, 8, 3, 2, 0.6);
    field_restore_none(&a);
    field_open(&b, 140, 130, 5, 1, 0);
    field_star(&b, 50.2, 60.7, 300);
    field_disk(&b, 80.4, 66.7, 700, 3, 0.5, 0.6);
    const rx_tphot_params par = plain_params();
    rx_tphot *first = run(&par, &a), *second = NULL;
    rx_tphot_input input = field_input(&a);
    input.image.pixels = b.pixels;
    input.image.psf = b.psf;
    input.shapes = first;
    assert_int_equal(rx_tphot_run(&par, &input, &second, NULL), RX_OK);
    assert_close(second->list[0].flux, 300, 1e-3);
    assert_close(second->list[1].flux, 700, 2e-3);
    assert_true(second->list[0].x == first->list[0].x);
    assert_true(second->list[1].radius == first->list[1].radius);
    rx_tphot_free(second);
    first->nlisted = 1;
    assert_int_equal(rx_tphot_run(&par, &input, &second, NULL), RX_INPUT);
    rx_tphot_free(first);
    field_close(&a);
    field_close(&b);
}

/* The brightest pixel of the residual, once. */
static rx_status look(void *user, const rx_tphot_search *at, double (**dst)[2], int *n, rx_error *err)
{
    rx_fit_image *image = at->image;
    double most = -HUGE_VAL, sigma = 0;
    size_t best = 0;
    (*(int *)user)++;
    for (int y = 0; y < image->height; y++) {
        assert_int_equal(rx_fit_image_load_rows(image, y, y + 1, err), RX_OK);
        for (int x = 0; x < image->width; x++) {
            const size_t k = rx_fit_image_row(image, y) + (size_t)x;
            if (!((double)image->data[k] - (double)image->model[k] > most))
                continue;
            most = (double)image->data[k] - (double)image->model[k];
            sigma = 1 / sqrt((double)image->weight[k]);
            best = (size_t)y * (size_t)image->width + (size_t)x;
        }
    }
    assert_true(most > 10 * sigma);
    *dst = rx_alloc(1, sizeof **dst);
    assert_non_null(*dst);
    (*dst)[0][0] = (double)(best % (size_t)image->width);
    (*dst)[0][1] = (double)(best / (size_t)image->width);
    *n = 1;
    return RX_OK;
}

/* Two places, whatever is there. */
static rx_status look_twice(void *user, const rx_tphot_search *at, double (**dst)[2], int *n, rx_error *err)
{
    (*(int *)user)++;
    (void)at;
    (void)err;
    *dst = rx_alloc(2, sizeof **dst);
    assert_non_null(*dst);
    (*dst)[0][0] = 90;
    (*dst)[0][1] = 250;
    (*dst)[1][0] = 24;
    (*dst)[1][1] = 92;
    *n = 2;
    return RX_OK;
}

static void test_second_pass(void **state)
{
    (void)state;
    field f;
    int calls = 0;
    field_open(&f, 120, 110, 4, 1, 1);
    field_star(&f, 50.2, 50.7, 1e5);
    field_star(&f, 56.4, 53.2, 5e3);
    list_star(&f, 50.2, 50.7);
    field_restore_none(&f);
    rx_tphot_params par = plain_params();
    par.extended = 0;
    par.rounds = 4;
    rx_tphot_input input = field_input(&f);
    input.more = look;
    input.user = &calls;
    rx_tphot *t = NULL;
    assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
    assert_true(calls == 1);
    assert_true(t->n == 2);
    assert_true(t->nlisted == 1);
    assert_true((t->list[1].flags & RX_TPHOT_EXTRA) != 0);
    assert_close(t->list[0].flux, 1e5, 3e-3);
    assert_close(t->list[1].flux, 5e3, 0.005);
    rx_tphot_free(t);
    const double at[1][2] = {{56.4, 53.2}};
    input.more = NULL;
    input.extra = at;
    input.nextra = 1;
    assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
    assert_close(t->list[0].flux, 1e5, 1e-3);
    assert_close(t->list[1].flux, 5e3, 1e-2);
    rx_tphot_free(t);
    field_close(&f);
}

/* Stars in rows that touch, and disks, on a tile that is much higher than what is shown of it at a time: the
 * same bytes, with groups that are cut and with the restored pixels' structure, too. */
static void test_shown(void **state)
{
    (void)state;
    field f;
    rx_tphot *t[3] = {NULL, NULL, NULL};
    int cut = 0;
    field_open(&f, 110, 330, 4, 1, 45);
    for (int i = 0; i < 45; i++)
        if (i % 9 == 4)
            field_disk(&f, 20 + 7.5 * (i % 9), 20 + 70 * (i / 9), 3e4, 4, 0.6, 0.4);
        else
            field_star(&f, 20 + 7.5 * (i % 9), 20 + 70 * (i / 9), 1e4 + 300 * i);
    field_noise(&f, 4);
    for (int i = 0; i < 45; i++)
        list_star(&f, 20 + 7.5 * (i % 9), 20 + 70 * (i / 9));
    for (int k = 0; k < 110 * 330; k += 97)
        f.mask[k] = 1;
    field_restore_none(&f);
    rx_tphot_params par = rx_tphot_defaults();
    par.group_limit = 6;
    par.covariance = par.keep_model = 1;
    par.sky_cell = 60;
    par.crowding = RX_CROWDING_NO;
    rx_tphot_input input = field_input(&f);
    input.image.gain = 2;
    for (int i = 0; i < 3; i++) {
        int calls = 0;
        input.more = look_twice;
        input.user = &calls;
        par.shown = (size_t)110 * (size_t)(int[3]){330, 40, 100}[i]; /* all; data made anew; data kept */
        par.nthreads = 1 + i;
        assert_int_equal(rx_tphot_run(&par, &input, &t[i], NULL), RX_OK);
    }
    assert_true(t[0]->n == 47);
    assert_true(t[0]->npairs > 0);
    for (int i = 0; i < t[0]->n; i++)
        cut += (t[0]->list[i].flags & RX_TPHOT_GROUP_CUT) != 0;
    assert_true(cut > 0);
    for (int i = 1; i < 3; i++) {
        assert_true(t[i]->n == t[0]->n);
        assert_true(t[i]->npairs == t[0]->npairs);
        assert_memory_equal(t[0]->list, t[i]->list, (size_t)t[0]->n * sizeof *t[0]->list);
        assert_memory_equal(t[0]->pairs, t[i]->pairs, (size_t)t[0]->npairs * sizeof *t[0]->pairs);
        assert_memory_equal(t[0]->model, t[i]->model, sizeof(float) * 110 * 330);
        assert_memory_equal(t[0]->residual, t[i]->residual, sizeof(float) * 110 * 330);
        assert_true(t[0]->chi2 == t[i]->chi2);
        assert_true(t[0]->visible == t[i]->visible);
        assert_true(t[0]->sky == t[i]->sky);
    }
    for (int i = 0; i < 3; i++)
        rx_tphot_free(t[i]);
    field_close(&f);
}

/* A row of stars, each touching the next: groups end at the limit, fluxes hardly suffer. */
static void test_limit(void **state)
{
    (void)state;
    field f;
    field_open(&f, 200, 60, 4, 1, 25);
    for (int i = 0; i < 25; i++)
        field_star(&f, 20 + 6.5 * i, 30, 1e4 + 300 * i);
    for (int i = 0; i < 25; i++)
        list_star(&f, 20 + 6.5 * i, 30);
    field_restore_none(&f);
    rx_tphot_params par = plain_params();
    par.extended = 0;
    par.group_limit = 6;
    rx_tphot *t = run(&par, &f);
    int cut = 0;
    assert_true(t->largest <= 6);
    assert_true(t->ngroups >= 5);
    for (int i = 0; i < 25; i++) {
        cut += (t->list[i].flags & RX_TPHOT_GROUP_CUT) != 0;
        assert_close(t->list[i].flux, 1e4 + 300 * i, 5e-3);
    }
    assert_true(cut >= 8);
    rx_tphot_free(t);
    par.group_limit = 40;
    t = run(&par, &f);
    assert_true(t->ngroups == 1);
    assert_true(t->list[3].flags == 0);
    rx_tphot_free(t);
    field_close(&f);
}

/* What would take back the light that a neighbour has too much is held at 0; a dark place by itself is measured. */
static void test_bound(void **state)
{
    (void)state;
    field f;
    field_open(&f, 100, 100, 4, 1, 3);
    field_star(&f, 40, 50, 1e4);
    field_star(&f, 43, 50, -500);
    field_star(&f, 70, 50, -500);
    list_star(&f, 40, 50);
    list_star(&f, 43, 50);
    list_star(&f, 70, 50);
    field_restore_none(&f);
    const rx_tphot_params par = plain_params();
    rx_tphot *t = run(&par, &f);
    assert_true(t->list[1].flux == 0);
    assert_true((t->list[1].flags & RX_TPHOT_BOUND) != 0);
    assert_true(t->list[1].fluxerr > 0);
    assert_close(t->list[0].flux, 1e4 - 500, 0.05);
    assert_close(t->list[2].flux, -500, 0.005);
    assert_true((t->list[2].flags & RX_TPHOT_BOUND) == 0);
    rx_tphot_free(t);
    field_close(&f);
}

static void test_border_and_mask(void **state)
{
    (void)state;
    field f;
    field_open(&f, 120, 110, 4, 1, 3);
    field_star(&f, 1.3, 50.2, 1e5);
    field_star(&f, 60.3, 50.2, 1e5);
    field_star(&f, 100, 90, 1e5);
    list_star(&f, 1.3, 50.2);
    list_star(&f, 60.3, 50.2);
    list_star(&f, 100, 90);
    for (int y = 49; y <= 50; y++)
        for (int x = 59; x <= 61; x++)
            f.mask[y * 120 + x] = 4;
    for (int y = 60; y < 110; y++)
        for (int x = 70; x < 120; x++)
            f.mask[y * 120 + x] = 1;
    memcpy(f.restored->mask, f.mask, 120 * 110);
    field_restore_none(&f);
    rx_tphot_params par = plain_params();
    par.extended = 0;
    rx_tphot *t = run(&par, &f);
    assert_true((t->list[0].flags & RX_TPHOT_BORDER) != 0);
    assert_true(t->list[0].inside < 0.9);
    assert_close(t->list[0].flux, 1e5, 1e-3);
    assert_true((t->list[1].flags & RX_TPHOT_MASKED) != 0);
    assert_true(t->list[1].masked > 0.1);
    assert_close(t->list[1].flux, 1e5, 1e-3);
    assert_true(t->list[1].fluxerr > t->list[0].fluxerr * 0.9);
    assert_true((t->list[2].flags & RX_TPHOT_NO_DATA) != 0 || t->list[2].masked > 0.9);
    rx_tphot_free(t);
    field_close(&f);
}

/* Two peaks in one segment, seen by a restored image whose PSF is a Gaussian of 2 pixels. */
static void test_pixels(void **state)
{
    (void)state;
    field f;
    const double x[2] = {57, 63}, y[2] = {50, 53}, flux[2] = {1e5, 6e4};
    field_open(&f, 120, 110, 4, 1, 1);
    rx_psf *narrow = rx_psf_new(RX_PSF_GAUSS, 11, 1);
    assert_non_null(narrow);
    float weights[11];
    assert_int_equal(rx_gauss_radius(2), 5);
    rx_gauss_weights(2, 5, weights);
    for (int k = 0; k < 121; k++)
        narrow->basis[k] = weights[k / 11] * weights[k % 11];
    narrow->fwhm = 2;
    for (int i = 0; i < 2; i++) {
        field_star(&f, x[i], y[i], flux[i]);
        for (int k = 0; k < 121; k++)
            f.restored->pixels[((int)y[i] + k / 11 - 5) * 120 + (int)x[i] + k % 11 - 5] +=
                (float)flux[i] * narrow->basis[k];
    }
    field_list(&f, 59.3, 51.1, 9, 3.4, 1.8, 0.46);
    rx_psf_free(f.restored->psf);
    f.restored->psf = narrow;
    f.restored->blur = rx_psf_copy(f.psf);
    assert_non_null(f.restored->blur);
    const rx_tphot_params par = plain_params();
    rx_tphot *t = run(&par, &f);
    assert_int_equal(t->list[0].kind, RX_TPHOT_PIXELS);
    assert_close(t->list[0].flux, flux[0] + flux[1], 5e-3);
    rx_tphot_free(t);
    field_close(&f);
}

/* A PSF that widens along x: the flux follows the PSF of the place. */
static void test_varying(void **state)
{
    (void)state;
    field f;
    rx_psf *wide = NULL;
    field_open(&f, 200, 80, 3, 1, 3);
    assert_int_equal(rx_psf_moffat(5, 4.765, 1, 0, f.psf->size, &wide, NULL), RX_OK);
    rx_psf *psf = rx_psf_new(RX_PSF_PSFEX, f.psf->size, 2);
    assert_non_null(psf);
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    for (size_t k = 0; k < n; k++) { /* PSF = narrow + x/200 (wide - narrow) */
        psf->basis[k] = f.psf->basis[k];
        psf->basis[n + k] = wide->basis[k] - f.psf->basis[k];
    }
    psf->px[1] = 1;
    psf->xs = 200;
    psf->fwhm = 4;
    rx_psf_free(f.psf);
    rx_psf_free(wide);
    f.psf = psf;
    float *stamp = RX_NEW(float, n);
    assert_non_null(stamp);
    for (int i = 0; i < 3; i++) { /* on whole pixels the PSF is the stamp itself */
        const int x = 30 + 70 * i, y = 40, half = psf->size / 2;
        rx_psf_at(psf, x, y, stamp);
        for (int v = -half; v <= half; v++)
            for (int u = -half; u <= half; u++)
                if (x + u >= 0 && x + u < 200 && y + v >= 0 && y + v < 80)
                    f.pixels[(y + v) * 200 + x + u] += 1e5f * stamp[(v + half) * psf->size + u + half];
        list_star(&f, x + 0.1, y - 0.1);
    }
    free(stamp);
    field_restore_none(&f);
    rx_tphot_params par = plain_params();
    par.nthreads = 2;
    rx_tphot *t = run(&par, &f);
    for (int i = 0; i < 3; i++) {
        assert_true(t->list[i].kind == RX_TPHOT_POINT);
        assert_close(t->list[i].flux, 1e5, 1e-4);
    }
    rx_tphot_free(t);
    field_close(&f);
}

static void test_refused(void **state)
{
    (void)state;
    field f;
    rx_tphot *t = NULL;
    rx_error err = RX_ERROR_NONE;
    field_open(&f, 60, 50, 3, 1, 1);
    field_restore_none(&f);
    const rx_tphot_params par = rx_tphot_defaults();
    rx_tphot_input input = field_input(&f);
    assert_int_equal(rx_tphot_run(&par, &input, &t, &err), RX_OK); /* no sources */
    assert_true(t->n == 0);
    assert_true(t->ngroups == 0);
    rx_tphot_free(t);
    input.image.width = 50;
    assert_int_equal(rx_tphot_run(&par, &input, &t, &err), RX_INPUT);
    assert_null(t);
    input.image.width = 60;
    input.image.psf = NULL;
    assert_int_equal(rx_tphot_run(&par, &input, &t, &err), RX_INPUT);
    input.image.psf = f.psf;
    f.psf->basis[3] = NAN;
    assert_int_equal(rx_tphot_run(&par, &input, &t, &err), RX_INPUT);
    field_close(&f);
}

/* Two pairs on skies of their own: each has its background and its covariance, and the sky that is taken off
 * is reported. */
static void test_two_groups(void **state)
{
    (void)state;
    field f;
    rx_tphot *t = NULL;
    field_open(&f, 260, 120, 4, 1, 4);
    for (int i = 0; i < 4; i++) {
        const double x = 60.3 + i / 2 * 140 + i % 2 * (i / 2 ? 5 : 7), y = 60.4;
        field_star(&f, x, y, 4e3 + 1e3 * i);
        field_list(&f, x, y, 3, 1.7, 1.7, 0);
    }
    for (int k = 0; k < 260 * 120; k++)
        f.pixels[k] += 2 + (k % 260 < 130 ? 0.05f : -0.02f);
    field_restore_none(&f);
    rx_tphot_params par = rx_tphot_defaults();
    par.extended = 0;
    par.covariance = 1;
    par.psf_error = 0;
    par.background_sigma = 10; /* hardly a prior */
    for (int sky = 0; sky < 2; sky++) {
        par.sky_cell = sky ? 400 : 0;
        const rx_tphot_input input = field_input(&f);
        assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
        assert_int_equal(t->ngroups, 2);
        assert_int_equal(t->largest, 2);
        assert_int_equal(t->npairs, 2);
        double off = t->sky;
        assert_near(off, sky ? 2.015 : 0, 1e-3);
        for (int i = 0; i < 4; i++) {
            assert_close(t->list[i].flux, 4e3 + 1e3 * i, 1e-3);
            /* what is measured as structure of the sky no group's background needs to take */
            const double step = 2 + (i < 2 ? 0.05 : -0.02) - off;
            assert_near(t->list[i].background, sky ? 0 : step, sky ? fabs(step) : 5e-3);
            const rx_tphot_pair *p = &t->pairs[i / 2];
            assert_int_equal(p->i, i / 2 * 2);
            assert_int_equal(p->j, i / 2 * 2 + 1);
            assert_close(fabs(p->covariance),
                         t->list[i].blend * t->list[p->i].fluxerr * t->list[p->j].fluxerr, 1e-6);
        }
        rx_tphot_free(t);
    }
    field_close(&f);
}

/* A point that is in no list stays where it was asked for when nothing is refined. */
static void test_extra(void **state)
{
    (void)state;
    static const double at[2][2] = {{40.3, 50.8}, {80.6, 44.1}};
    field f;
    rx_tphot *t = NULL;
    field_open(&f, 110, 100, 4, 1, 0);
    for (int i = 0; i < 2; i++)
        field_star(&f, at[i][0], at[i][1], 5e3);
    field_restore_none(&f);
    rx_tphot_params par = rx_tphot_defaults();
    par.rounds = par.sky_cell = 0;
    rx_tphot_input input = field_input(&f);
    input.extra = at;
    input.nextra = 2;
    assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
    assert_int_equal(t->n, 2);
    for (int i = 0; i < 2; i++) {
        assert_near(t->list[i].x, at[i][0], 0);
        assert_near(t->list[i].y, at[i][1], 0);
        assert_close(t->list[i].flux, 5e3, 1e-3);
    }
    rx_tphot_free(t);
    field_close(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_star),
                                       cmocka_unit_test(test_disk),
                                       cmocka_unit_test(test_pairs),
                                       cmocka_unit_test(test_blend),
                                       cmocka_unit_test(test_threads_and_masks),
                                       cmocka_unit_test(test_forced),
                                       cmocka_unit_test(test_second_pass),
                                       cmocka_unit_test(test_shown),
                                       cmocka_unit_test(test_limit),
                                       cmocka_unit_test(test_bound),
                                       cmocka_unit_test(test_border_and_mask),
                                       cmocka_unit_test(test_pixels),
                                       cmocka_unit_test(test_varying),
                                       cmocka_unit_test(test_two_groups),
                                       cmocka_unit_test(test_extra),
                                       cmocka_unit_test(test_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
