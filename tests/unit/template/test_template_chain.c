/* The chain of template.c by hand: three sources in one group, step by step. */
#include "../near.h"
#include "field.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "template/evidence.h"
#include "template/fit_sources.h"
#include "template/joint.h"
#include "template/prior.h"
#include "template/refine.h"

enum { W = 110, H = 100, N = 3 };

typedef struct chain {
    rx_tphot_params par;
    rx_tphot_input input;
    rx_fit_image canvas;
    rx_template_otf *lens;
    rx_tile_prior usual;
    rx_refine_view view;
    rx_fit_source s[N];
    rx_joint_member m[N];
    double background, covariance[N * N];
} chain;

static void draw(chain *c)
{
    rx_layer *layers = RX_NEW(rx_layer, N);
    assert_non_null(layers);
    for (int i = 0; i < N; i++)
        layers[i] = (rx_layer){c->s[i].footprint, c->s[i].flux};
    rx_fit_image_set(&c->canvas, layers, N);
    assert_int_equal(rx_fit_image_load_rows(&c->canvas, 0, H, NULL), RX_OK);
}

/* Each against the others as they were. */
static void refine(chain *c, int frozen, int moved_only)
{
    const rx_refine_params par = {.extended = c->par.extended,
                                  .star_penalty = c->par.star_penalty,
                                  .usual = &c->usual,
                                  .frozen = frozen};
    rx_fit_source after[N];
    for (int i = 0; i < N; i++)
        if (!moved_only || c->s[i].moved)
            assert_int_equal(rx_refine(&par, &c->view, c->lens, &c->s[i], &after[i], NULL), RX_OK);
    for (int i = 0; i < N; i++)
        if (!moved_only || c->s[i].moved) {
            free(c->s[i].footprint.values);
            c->s[i] = after[i];
        }
    draw(c);
}

static void fit(chain *c)
{
    const rx_joint_params par = {c->par.background_sigma, c->par.non_negative, 1};
    for (int i = 0; i < N; i++) {
        rx_fit_source *s = &c->s[i];
        c->m[i] = (rx_joint_member){.grain = 1,
                                    .footprint = &s->footprint,
                                    .before = s->flux,
                                    .shift_width = rx_refine_reach(c->view.fwhm),
                                    .shift_centre = {s->x0 - s->x, s->y0 - s->y}};
    }
    assert_int_equal(rx_joint_fit(&par, &c->canvas, N, c->m, &c->background, c->covariance, NULL), RX_OK);
    for (int i = 0; i < N; i++)
        c->s[i].flux = c->m[i].flux;
    draw(c);
}

/* Twice the positions follow what the joint fit wants, a quarter of a FWHM at once. */
static int fit_and_shift(chain *c)
{
    int held = 0;
    fit(c);
    for (int turn = 0; turn < 2; turn++) {
        for (int i = 0; i < N; i++) {
            const double length = hypot(c->m[i].shift[0], c->m[i].shift[1]);
            const double scale = fmin(1, 0.25 * c->view.fwhm / length);
            c->s[i].moved = length > 1e-4;
            c->s[i].x += c->s[i].moved ? scale * c->m[i].shift[0] : 0;
            c->s[i].y += c->s[i].moved ? scale * c->m[i].shift[1] : 0;
            held += scale < 1;
        }
        refine(c, 1, 1);
        fit(c);
    }
    return held;
}

static void test_chain(void **state)
{
    (void)state;
    static const double at[N][3] = {{50.3, 50.8, 900}, {54.9, 52.2, 400}, {45.8, 55.3, 150}};
    for (int extended = 0; extended < 2; extended++) {
        field f;
        chain c = {.par = rx_tphot_defaults()};
        rx_tphot *t = NULL;
        int held = 0;
        field_open(&f, W, H, 4, 1, N);
        for (int i = 0; i < N; i++) {
            field_star(&f, at[i][0], at[i][1], at[i][2]);
            field_list(&f, at[i][0] + (i == 2 ? -1.2 : 0.3), at[i][1] - (i == 2 ? -1.3 : 0.2), 4, 1.9, 1.8,
                       0.3);
        }
        field_noise(&f, 3);
        field_restore_none(&f);
        c.par.extended = extended;
        c.par.rounds = c.par.covariance = 1;
        c.par.sky_cell = 0;
        c.par.psf_error = 0;
        c.input = field_input(&f);
        assert_int_equal(rx_tphot_run(&c.par, &c.input, &t, NULL), RX_OK);
        assert_int_equal(t->ngroups, 1);

        rx_fit_image_open(&c.input, (size_t)W * H, 1, &c.canvas);
        assert_int_equal(rx_fit_image_load_rows(&c.canvas, 0, H, NULL), RX_OK);
        assert_int_equal(rx_template_otf_new(f.psf, f.restored->psf, &c.lens, NULL), RX_OK);
        c.usual = rx_tile_prior_start(4);
        c.view = (rx_refine_view){
            .canvas = &c.canvas, .restored = f.restored, .segments = f.sources->segments, .fwhm = 4};
        rx_fit_sources_start(&c.par, &c.input, c.s);
        refine(&c, 1, 0);
        held += fit_and_shift(&c);
        refine(&c, 0, 0);
        held += fit_and_shift(&c);
        print_message("%d steps were too long\n", held);
        assert_true(extended || held > 0);

        const rx_refine_params par = {
            .extended = extended, .star_penalty = c.par.star_penalty, .usual = &c.usual};
        for (int i = 0; i < N; i++) {
            const rx_fit_neighbour rival = rx_evidence_neighbour(c.s, c.m, (int[]){0, 1, 2}, N, i);
            assert_int_equal(rx_evidence_of(&par, &c.view, c.lens, c.s, &rival, &c.s[i].presence, NULL),
                             RX_OK);
            assert_int_equal(rx_evidence_amid_sky(&c.canvas, &c.s[i], rival.alone, &c.s[i].presence, NULL),
                             RX_OK);
        }
        for (int i = 0; i < N; i++) {
            rx_tphot_source told = {.blend = c.m[i].blend, .flags = c.m[i].flags};
            rx_fit_source_result(&c.canvas, f.sources->segments, &c.s[i], &c.m[i], c.background, &told);
            const rx_tphot_source *s = &t->list[i];
            const double got[] = {s->x,     s->y,    s->flux,   s->fluxerr,  s->snr,        s->chi2,
                                  s->blend, s->star, s->radius, s->evidence, s->background, s->shape_error};
            const double want[] = {told.x,      told.y,        told.flux,       told.fluxerr,
                                   told.snr,    told.chi2,     told.blend,      told.star,
                                   told.radius, told.evidence, told.background, told.shape_error};
            for (size_t k = 0; k < sizeof got / sizeof *got; k++)
                assert_near(got[k], want[k], 1e-9 * fabs(want[k]));
            assert_int_equal(s->kind, told.kind);
            assert_int_equal(s->flags, told.flags);
            assert_int_equal(s->group, 0);
        }
        for (int k = 0; k < t->npairs; k++) {
            const int i = t->pairs[k].i, j = t->pairs[k].j;
            assert_close(t->pairs[k].covariance,
                         c.covariance[i * N + j] * c.s[i].shape_error * c.s[j].shape_error, 1e-9);
        }
        assert_int_equal(t->npairs, 3);
        for (int i = 0; i < N; i++)
            free(c.s[i].footprint.values);
        rx_tphot_free(t);
        rx_template_otf_free(c.lens);
        rx_fit_image_clear(&c.canvas);
        field_close(&f);
    }
}

/* Two pairs on skies of their own: each has its background and its covariance, and the sky that is taken off
 * is told. */
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
            assert_near(t->list[i].background, 2 + (i < 2 ? 0.05 : -0.02) - off, 5e-3);
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

/* A row of stars that hardly touch, in groups of two: each group is fitted against what the one before has found,
 * and nothing is lost on the way. */
static void test_cut_groups(void **state)
{
    (void)state;
    enum { STARS = 7 };
    field f;
    rx_tphot *t = NULL;
    field_open(&f, 160, 70, 4, 1, STARS);
    for (int i = 0; i < STARS; i++) {
        field_star(&f, 30.3 + 16 * i, 35.2, 4e3 + 1e3 * i);
        field_list(&f, 30.3 + 16 * i, 35.2, 4, 1.7, 1.7, 0);
    }
    field_restore_none(&f);
    rx_tphot_params par = rx_tphot_defaults();
    par.extended = par.sky_cell = 0;
    par.psf_error = par.background_sigma = 0;
    par.link = 1e-6;
    par.group_limit = 2;
    const rx_tphot_input input = field_input(&f);
    assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
    assert_int_equal(t->largest, 2);
    int cut = 0;
    for (int i = 0; i < STARS; i++) {
        cut += t->list[i].flags == RX_TPHOT_GROUP_CUT;
        assert_close(t->list[i].flux, 4e3 + 1e3 * i, 3e-4);
    }
    assert_true(cut > 3);
    rx_tphot_free(t);
    field_close(&f);
}

/* Twenty-five sources that do not touch, twice refined: the second time they lean on what is usual among them. */
static void test_learning(void **state)
{
    (void)state;
    enum { ACROSS = 5, M = ACROSS * ACROSS, CELL = 44, SIDE = ACROSS * CELL };
    static rx_fit_source s[M], after[M];
    field f;
    rx_fit_image canvas;
    rx_template_otf *lens = NULL;
    rx_tphot *t = NULL;
    rx_joint_member m[M];
    static rx_prior_sample cases[M];
    double background[M];
    field_open(&f, SIDE, SIDE, 3, 1, M);
    for (int i = 0; i < M; i++) {
        const double x = i % ACROSS * CELL + 21.3, y = i / ACROSS * CELL + 22.4, flux = 300 + 20 * i;
        if (i % 5 == 0)
            field_star(&f, x, y, flux);
        else
            field_disk(&f, x, y, flux, 1.2 + 0.04 * i, 0.7, i);
        field_list(&f, x, y, 4, 1.9, 1.8, 0.3);
    }
    field_noise(&f, 3);
    field_restore_none(&f);
    rx_tphot_params par = rx_tphot_defaults();
    par.sky_cell = 0;
    par.psf_error = 0;
    const rx_tphot_input input = field_input(&f);
    assert_int_equal(rx_tphot_run(&par, &input, &t, NULL), RX_OK);
    assert_int_equal(t->ngroups, M);

    rx_tile_prior usual = rx_tile_prior_start(3);
    rx_fit_image_open(&input, (size_t)SIDE * SIDE, 1, &canvas);
    assert_int_equal(rx_template_otf_new(f.psf, f.restored->psf, &lens, NULL), RX_OK);
    const rx_refine_view view = {
        .canvas = &canvas, .restored = f.restored, .segments = f.sources->segments, .fwhm = 3};
    rx_fit_sources_start(&par, &input, s);
    for (int round = 0; round < 3; round++) {
        const rx_refine_params how = {.extended = 1, .usual = &usual, .frozen = round == 0};
        const rx_joint_params joint = {par.background_sigma, 0, 1};
        for (int turn = 0; turn < 2; turn++) { /* shapes, then fluxes */
            assert_int_equal(rx_fit_image_load_rows(&canvas, 0, SIDE, NULL), RX_OK);
            for (int i = 0; i < M && turn == 0; i++)
                assert_int_equal(rx_refine(&how, &view, lens, &s[i], &after[i], NULL), RX_OK);
            for (int i = 0; i < M && turn == 0; i++) {
                free(s[i].footprint.values);
                s[i] = after[i];
            }
            for (int i = 0; i < M && turn == 1; i++) {
                m[i] = (rx_joint_member){.grain = 1, .footprint = &s[i].footprint, .before = s[i].flux};
                assert_int_equal(rx_joint_fit(&joint, &canvas, 1, &m[i], &background[i], NULL, NULL), RX_OK);
            }
            rx_layer *layers = RX_NEW(rx_layer, M);
            assert_non_null(layers);
            for (int i = 0; i < M; i++) {
                s[i].flux = turn == 1 ? m[i].flux : s[i].flux;
                layers[i] = (rx_layer){s[i].footprint, s[i].flux};
            }
            rx_fit_image_set(&canvas, layers, M);
        }
        for (int i = 0; i < M; i++)
            cases[i] = (rx_prior_sample){.flux = s[i].flux,
                                         .snr = s[i].flux / sqrt(m[i].variance),
                                         .evidence = s[i].evidence,
                                         .radius = s[i].size,
                                         .nu = s[i].slope};
        if (round > 0)
            rx_tile_prior_fit(cases, M, par.star_penalty, 3, &usual);
    }
    assert_true(usual.star_odds < 0.9);
    assert_near(t->star_odds, usual.star_odds, 1e-9);
    for (int i = 0; i < M; i++) {
        rx_tphot_source told = {0};
        assert_int_equal(rx_fit_image_load_rows(&canvas, 0, SIDE, NULL), RX_OK);
        rx_fit_source_result(&canvas, f.sources->segments, &s[i], &m[i], background[i], &told);
        const rx_tphot_source *got = &t->list[i];
        assert_close(got->x, told.x, 1e-9);
        assert_close(got->flux, told.flux, 1e-9);
        assert_close(got->fluxerr, told.fluxerr, 1e-9);
        assert_near(got->radius, told.radius, 1e-9);
        assert_near(got->star, told.star, 1e-9);
        free(s[i].footprint.values);
    }
    rx_tphot_free(t);
    rx_template_otf_free(lens);
    rx_fit_image_clear(&canvas);
    field_close(&f);
}

/* A point that is in no list stays where it was asked for when nothing is refined. */
static void test_extra(void **state)
{
    (void)state;
    static const double at[2][2] = {{40.3, 50.8}, {80.6, 44.1}};
    field f;
    rx_tphot *t = NULL;
    field_open(&f, W, H, 4, 1, 0);
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
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_chain), cmocka_unit_test(test_two_groups),
                                       cmocka_unit_test(test_cut_groups), cmocka_unit_test(test_learning),
                                       cmocka_unit_test(test_extra)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
