/* The network's domain: what a model promises for a tile, and what becomes of one that it was not trained
 * for.
 */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../near.h"
#include "../scratch.h"
#include "../small_net.h"
#include "base/memory.h"
#include "base/random.h"
#include "base/text.h"
#include "bench.h"
#include "check/blankcheck.h"
#include "data/facts.h"
#include "io/fits_read.h"
#include "io/tile.h"
#include "num/stats.h"
#include "pipeline/domain.h"
#include "pipeline/pipeline.h"
#include "scene.h"
#include "stage/domain_facts.h"
#include "stage/stage.h"

enum { SIDE = 200, STARS = 60, BINS = 4 };

/* FWHM 2 to 5 to 8 pixels, noise 0.125 to 10 to 40; the network adds nothing to its base. */
static rx_model *make_model(rx_mode mode)
{
    rx_model *model = rx_model_new();
    assert_non_null(model);
    model->front.mode = mode;
    model->front.rl_steps = mode == RX_MODE_INFORMED;
    model->restore = small_net(rx_front_channels(mode), 1);
    model->nfwhm = model->nsigma = 2;
    model->bins = RX_NEW(rx_model_bin, BINS);
    assert_non_null(model->bins);
    for (int i = 0; i < BINS; i++)
        model->bins[i] = (rx_model_bin){.fwhm = {2 + 3 * (i % 2), 5 + 3 * (i % 2)},
                                        .sigma = {i < 2 ? 0.125 : 10, i < 2 ? 10 : 40},
                                        .loss = 0.25 + i,
                                        .list = 0.5,
                                        .recall = 0.91 - 0.01 * i,
                                        .bias = -0.0125,
                                        .scatter = i == 1 ? NAN : 0.034,
                                        .images = 50};
    snprintf(model->name, sizeof model->name, "toy");
    rx_model_digest(model, model->digest);
    return model;
}

/* Options with that model, as if they had been read with RESTORE_TYPE NET. */
static void open_bench(bench *b, rx_mode mode, const setting *settings)
{
    bench_open(b, settings);
    b->options->model = make_model(mode);
    b->options->pipeline.restore.model = b->options->model;
}

static rx_field *make_field(const bench *b)
{
    scene s;
    scene_make(&s, SIDE, SIDE, STARS, 5);
    rx_field *field = bench_field(b, s.pixels, SIDE, SIDE, 2.0);
    scene_free(&s);
    return field;
}

/* What is said to a log, as one string to be freed. */
static rx_status obey(const bench *b, const rx_field *field, rx_log *log, const rx_restorer **kind,
                      rx_domain *dst, rx_error *err)
{
    return rx_domain_obey(&b->options->pipeline.restore, field, log, kind, dst, err);
}

typedef struct heard {
    rx_log log;
    char *text;
    size_t size;
} heard;

static void listen(heard *h)
{
    *h = (heard){0};
    FILE *stream = open_memstream(&h->text, &h->size);
    assert_non_null(stream);
    rx_log_init(&h->log, "test", stream, RX_FULL);
}

static int count(const char *text, const char *what)
{
    int n = 0;
    for (const char *c = text; (c = strstr(c, what)) != NULL; c += strlen(what))
        n++;
    return n;
}

static const char *fact(const rx_record *facts, const char *name)
{
    for (int i = 0; i < facts->n; i++)
        if (strcmp(facts->pairs[i][0], name) == 0)
            return facts->pairs[i][1];
    return NULL;
}

/* --- measuring --- */

static void test_noise(void **state)
{
    (void)state;
    bench b;
    double noise = 0.0;
    size_t n = 0;
    open_bench(&b, RX_MODE_INFORMED, NULL);
    rx_field *field = make_field(&b);
    const rx_map level = rx_background_level(field->restored), sigma = rx_background_noise(field->restored);
    double *all = RX_NEW(double, (size_t)SIDE *SIDE);
    assert_non_null(all);
    for (int i = 0; i < SIDE * SIDE; i++) {
        if (i % 7 == 0) { /* must not count */
            field->tile->mask[i] = i % 2 ? RX_MASK_SATURATED : RX_MASK_BAD;
            field->tile->pixels[i] = 1e6f;
            continue;
        }
        const float light = field->tile->pixels[i] - rx_map_at(&level, i % SIDE, i / SIDE);
        all[n++] = light / rx_map_at(&sigma, i % SIDE, i / SIDE);
    }
    const rx_restorer *kind = rx_restorer_find("NET");
    rx_domain domain;
    assert_int_equal(rx_domain_noise(field, 1, &noise, NULL), RX_OK);
    assert_near(noise * rx_quantile(all, n, 0.999) / 255, 1, 1e-5);
    assert_int_equal(obey(&b, field, NULL, &kind, &domain, NULL), RX_OK);
    assert_near(domain.noise, noise, 0);
    field->model_noise = 3.25; /* what the tile had that this one is a copy of */
    assert_int_equal(obey(&b, field, NULL, &kind, &domain, NULL), RX_OK);
    assert_near(domain.noise, 3.25, 0);
    free(all);
    rx_field_free(field);
    bench_close(&b);
}

static void test_inside(void **state)
{
    (void)state;
    bench b;
    heard h;
    rx_domain domain;
    rx_record facts = {0};
    rx_text text = {0};
    rx_qa_promise promise;
    const rx_restorer *kind = rx_restorer_find("NET");
    open_bench(&b, RX_MODE_INFORMED, NULL);
    rx_field *field = make_field(&b);
    field->model_noise = 4;
    listen(&h);
    assert_non_null(kind);
    assert_int_equal(obey(&b, field, &h.log, &kind, &domain, NULL), RX_OK);
    fclose(h.log.stream);
    assert_int_equal(h.size, 0);
    assert_int_equal(domain.place, RX_DOMAIN_INSIDE);
    assert_ptr_equal(domain.bin, &b.options->model->bins[0]);
    assert_true(domain.fwhm == 3.5);
    assert_true(domain.noise == 4);
    assert_string_equal(kind->name, "NET");
    rx_domain_facts(&domain, &facts);
    static const char *const expected[][2] = {
        {"RXNETMOD", "toy"},  {"RXNETFW", "3.5000"},  {"RXNETNOI", "4.0000"},   {"RXNETIN", "T"},
        {"RXNETLOS", "0.25"}, {"RXNETREC", "0.9100"}, {"RXNETBIA", "-0.01250"}, {"RXNETSCA", "0.03400"}};
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; i++) {
        assert_non_null(fact(&facts, expected[i][0]));
        assert_string_equal(fact(&facts, expected[i][0]), expected[i][1]);
    }
    assert_string_equal(fact(&facts, "RXNETSUM"), b.options->model->digest);
    assert_null(fact(&facts, "RXNETWHY"));
    rx_domain_text(&domain, &text);
    assert_non_null(
        strstr(text.data, "promises a loss of 0.25, recall 0.91, flux bias -1.25 %, scatter 3.4 %"));
    assert_ptr_equal(rx_domain_promise(&domain, &promise), &promise);
    assert_true(promise.inside);
    assert_true(promise.scatter == 100 * 0.034);
    assert_true(promise.noise_bin[1] == 10);
    rx_record_free(&facts);
    rx_text_free(&text);
    free(h.text);
    rx_field_free(field);
    bench_close(&b);
}

/* What the model does not know is left out; other restorers are none of its business. */
static void test_gaps(void **state)
{
    (void)state;
    static const setting wide[] = {{"PSF_FWHM", "6"}, {NULL, NULL}};
    bench b;
    rx_domain domain;
    rx_record facts = {0};
    rx_text text = {0};
    rx_qa_promise promise;
    const rx_restorer *kind = rx_restorer_find("NET");
    open_bench(&b, RX_MODE_INFORMED, wide);
    rx_field *field = make_field(&b);
    field->model_noise = 4;
    assert_int_equal(obey(&b, field, NULL, &kind, &domain, NULL), RX_OK);
    rx_domain_facts(&domain, &facts);
    assert_non_null(fact(&facts, "RXNETBIA"));
    assert_null(fact(&facts, "RXNETSCA"));
    rx_domain_text(&domain, &text);
    assert_null(strstr(text.data, "scatter"));
    rx_text_free(&text);
    rx_record_free(&facts);
    kind = rx_restorer_find("RL");
    assert_int_equal(obey(&b, field, NULL, &kind, &domain, NULL), RX_OK);
    assert_int_equal(domain.place, RX_DOMAIN_NONE);
    rx_domain_facts(&domain, &facts);
    assert_int_equal(facts.n, 0);
    rx_domain_text(&domain, &text);
    assert_int_equal(text.length, 0);
    assert_null(rx_domain_promise(&domain, &promise));
    rx_field_free(field);
    bench_close(&b);
}

/* --- beyond the grid: a seeing of 12 pixels and a model for 8 --- */

typedef struct outcome {
    bench b;
    rx_field *field;
    heard h;
    rx_error err;
    rx_result result;
    rx_status status;
} outcome;

static void run_at(outcome *o, const char *fwhm, const char *what, int with_log)
{
    const setting wide[] = {{"PSF_FWHM", fwhm}, {"OUT_OF_DOMAIN", what}, {NULL, NULL}};
    *o = (outcome){.err = RX_ERROR_NONE};
    open_bench(&o->b, RX_MODE_INFORMED, wide);
    o->field = make_field(&o->b);
    o->field->model_noise = 4;
    listen(&o->h);
    o->status = rx_field_extract(&o->b.options->pipeline, rx_restorer_find("NET"), o->field, NULL,
                                 with_log ? &o->h.log : NULL, &o->result, &o->err);
    fclose(o->h.log.stream);
}

static void run_wide(outcome *o, const char *what, int with_log)
{
    run_at(o, "12", what, with_log);
}

static void end(outcome *o)
{
    rx_result_free(&o->result);
    rx_field_free(o->field);
    free(o->h.text);
    bench_close(&o->b);
}

static void test_warn(void **state)
{
    (void)state;
    outcome o;
    rx_record facts = {0};
    run_wide(&o, "WARN", 1);
    assert_int_equal(o.status, RX_OK);
    assert_string_equal(o.result.restored->name, "NET");
    assert_int_equal(o.result.domain.place, RX_DOMAIN_OUTSIDE);
    assert_int_equal(count(o.h.text, "warning: "), 1);
    assert_non_null(strstr(o.h.text, "bench[0]: FWHM 12.00 pixels is above 8, the network works for FWHM 2 "
                                     "to 8 pixels, noise from 0.125 on"));
    rx_domain_facts(&o.result.domain, &facts);
    assert_null(o.result.by);
    assert_string_equal(fact(&facts, "RXNETIN"), "F");
    assert_string_equal(fact(&facts, "RXNETWHY"), "FWHM 12.00 pixels is above 8");
    assert_null(fact(&facts, "RXNETREC"));
    rx_record_free(&facts);
    end(&o);
}

static void test_rl(void **state)
{
    (void)state;
    outcome o;
    rx_result plain;
    rx_record facts = {0};
    run_wide(&o, "RL", 1);
    assert_int_equal(o.status, RX_OK);
    assert_string_equal(o.result.restored->name, "RL");
    assert_int_equal(count(o.h.text, "warning: "), 0); /* the run's last lines warn of it */
    assert_non_null(strstr(o.h.text, "bench[0]: RL instead of NET: FWHM 12.00 pixels is above 8\n"));
    assert_int_equal(
        rx_field_extract(&o.b.options->pipeline, rx_restorer_find("RL"), o.field, NULL, NULL, &plain, NULL),
        RX_OK);
    assert_memory_equal(plain.restored->pixels, o.result.restored->pixels,
                        (size_t)SIDE * SIDE * sizeof(float));
    assert_int_equal(plain.sources->n, o.result.sources->n);
    rx_domain_facts(&o.result.domain, &facts);
    assert_string_equal(o.result.by, "RL");
    assert_string_equal(o.result.why, "FWHM 12.00 pixels is above 8");
    assert_null(plain.by);
    assert_true(plain.sources->n > 10);
    for (int i = 0; i < plain.sources->n; i++) {
        assert_int_equal(plain.sources->list[i].fit.restore & RX_RESTORE_OTHER, 0);
        assert_int_equal(o.result.sources->list[i].fit.restore & RX_RESTORE_OTHER, RX_RESTORE_OTHER);
    }
    rx_record_free(&facts);
    rx_result_free(&plain);
    end(&o);
}

/* Narrower than the output of the network, 2 pixels: there is nothing to restore for it, whatever WARN says.
 */
static void test_narrow(void **state)
{
    (void)state;
    const char *const fwhm[] = {"1.5", "1.9"}, *const runs[] = {"RL", "NET"};
    for (int i = 0; i < 2; i++) {
        outcome o;
        run_at(&o, fwhm[i], "WARN", 1);
        assert_int_equal(o.status, RX_OK);
        assert_string_equal(o.result.restored->name, runs[i]);
        assert_int_equal(o.result.domain.place, RX_DOMAIN_OUTSIDE);
        end(&o);
    }
    outcome o;
    bench b; /* of a noise beyond the grid, which is not why */
    rx_domain domain;
    const rx_restorer *kind = rx_restorer_find("NET");
    open_bench(&b, RX_MODE_INFORMED, (setting[]){{"PSF_FWHM", "1.5"}, {NULL, NULL}});
    rx_field *field = make_field(&b);
    field->model_noise = 0.05;
    assert_int_equal(obey(&b, field, NULL, &kind, &domain, NULL), RX_OK);
    assert_string_equal(kind->name, "RL");
    assert_string_equal(domain.why, "FWHM 1.5 pixels is below 1.8, 0.9 of the network's output");
    rx_field_free(field);
    bench_close(&b);
    run_at(&o, "1.5", "FAIL", 1);
    assert_int_equal(o.status, RX_NOT_RESTORED);
    end(&o);
}

/* RESTORE_FALLBACK N: what would be left to RL fails, what the network itself does goes on. */
static void test_no_fallback(void **state)
{
    (void)state;
    static const struct {
        const char *fwhm;
        rx_status status;
    } cases[] = {{"1.5", RX_NOT_RESTORED}, {"3.5", RX_OK}, {"12", RX_OK}};
    for (int i = 0; i < 3; i++) {
        const setting settings[] = {{"PSF_FWHM", cases[i].fwhm}, {"RESTORE_FALLBACK", "N"}, {NULL, NULL}};
        bench b;
        rx_result result;
        rx_error err = RX_ERROR_NONE;
        open_bench(&b, RX_MODE_INFORMED, settings);
        rx_field *field = make_field(&b);
        field->model_noise = 4;
        assert_int_equal(
            rx_field_extract(&b.options->pipeline, rx_restorer_find("NET"), field, NULL, NULL, &result, &err),
            cases[i].status);
        if (cases[i].status != RX_OK) {
            assert_string_equal(err.where, "bench");
            assert_string_equal(err.text,
                                "cannot be done by NET: FWHM 1.5 pixels is below 1.8, 0.9 of the network's "
                                "output; RESTORE_FALLBACK Y lets RL do it");
        }
        rx_result_free(&result);
        rx_field_free(field);
        bench_close(&b);
    }
}

static void test_fail(void **state)
{
    (void)state;
    for (int with_log = 0; with_log < 2; with_log++) { /* campaigns run without one */
        outcome o;
        run_wide(&o, "FAIL", with_log);
        assert_int_equal(o.status, RX_NOT_RESTORED);
        assert_string_equal(o.err.where, "bench");
        assert_string_equal(
            o.err.text,
            "FWHM 12.00 pixels is above 8, the network works for FWHM 2 to 8 pixels, noise from 0.125 on and "
            "noise factors to 3; take RESTORE_TYPE RL, another NET_MODEL, or OUT_OF_DOMAIN WARN or RL");
        assert_null(o.result.restored);
        end(&o);
    }
}

/* A model that says nothing of itself promises nothing. */
static void test_no_dictionary(void **state)
{
    (void)state;
    static const setting settings[] = {{"OUT_OF_DOMAIN", "FAIL"}, {NULL, NULL}};
    bench b;
    rx_domain domain;
    rx_error err = RX_ERROR_NONE;
    const rx_restorer *kind = rx_restorer_find("NET");
    open_bench(&b, RX_MODE_INFORMED, settings);
    free(b.options->model->bins);
    b.options->model->bins = NULL;
    rx_field *field = make_field(&b);
    assert_int_equal(obey(&b, field, NULL, &kind, &domain, &err), RX_NOT_RESTORED);
    assert_non_null(
        strstr(err.text, "the model has no dictionary, the model does not say what it was trained for; "));
    rx_field_free(field);
    bench_close(&b);
}

/* Without a PSF an informed network leaves the tile as it is, a blind one restores it and is not judged. */
static void test_no_psf(void **state)
{
    (void)state;
    static const setting settings[] = {{"OUT_OF_DOMAIN", "FAIL"}, {NULL, NULL}};
    for (int mode = RX_MODE_BLIND; mode <= RX_MODE_INFORMED; mode++) {
        bench b;
        rx_result result;
        rx_record facts = {0};
        open_bench(&b, (rx_mode)mode, settings);
        rx_field *field = make_field(&b);
        rx_psf_free(field->psf);
        field->psf = NULL;
        field->unrestorable = 1;
        assert_int_equal(
            rx_field_extract(&b.options->pipeline, rx_restorer_find("NET"), field, NULL, NULL, &result, NULL),
            RX_OK);
        rx_domain_facts(&result.domain, &facts);
        if (mode == RX_MODE_INFORMED) {
            assert_string_equal(result.restored->name, "NONE");
            assert_string_equal(result.by, "NONE");
            assert_string_equal(result.why, "its PSF is not known");
            assert_true(result.sources->n > 10);
            assert_int_equal(result.sources->list[0].fit.restore & RX_RESTORE_OTHER, RX_RESTORE_OTHER);
            assert_int_equal(result.domain.place, RX_DOMAIN_NONE);
            assert_int_equal(facts.n, 0);
        } else {
            assert_string_equal(result.restored->name, "NET");
            assert_null(result.by);
            assert_int_equal(result.domain.place, RX_DOMAIN_UNKNOWN);
            assert_string_equal(fact(&facts, "RXNETWHY"), "the FWHM of the tile is not known");
            assert_null(fact(&facts, "RXNETIN"));
            assert_null(fact(&facts, "RXNETFW"));
        }
        rx_record_free(&facts);
        rx_result_free(&result);
        b.options->pipeline.restore.fallback = 0;
        assert_int_equal(
            rx_field_extract(&b.options->pipeline, rx_restorer_find("NET"), field, NULL, NULL, &result, NULL),
            mode == RX_MODE_INFORMED ? RX_NOT_RESTORED : RX_OK);
        rx_result_free(&result);
        rx_field_free(field);
        bench_close(&b);
    }
}

/* Two images, the second without a PSF: detection is the restorer's, fluxes are of untouched pixels. */
static void test_second_image(void **state)
{
    (void)state;
    bench b;
    rx_result result;
    open_bench(&b, RX_MODE_INFORMED, NULL);
    rx_field *detect = make_field(&b), *measure = make_field(&b);
    rx_psf_free(measure->psf);
    measure->psf = NULL;
    measure->unrestorable = 1;
    assert_int_equal(
        rx_field_extract(&b.options->pipeline, rx_restorer_find("RL"), detect, measure, NULL, &result, NULL),
        RX_OK);
    assert_string_equal(result.restored->name, "RL");
    assert_string_equal(result.by, "NONE");
    assert_string_equal(result.why, "measurement image: its PSF is not known");
    assert_int_equal(result.original, 1);
    assert_true(result.sources->n > 10);
    assert_int_equal(result.sources->list[0].fit.restore & RX_RESTORE_OTHER, RX_RESTORE_OTHER);
    rx_result_free(&result);
    assert_int_equal(
        rx_field_extract(&b.options->pipeline, rx_restorer_find("RL"), detect, detect, NULL, &result, NULL),
        RX_OK);
    assert_null(result.by);
    assert_int_equal(result.original, 0);
    rx_result_free(&result);
    rx_field_free(measure);
    rx_field_free(detect);
    bench_close(&b);
}

/* Copies of a tile are restored as it is, whatever their own pixels say. */
static void test_copies(void **state)
{
    (void)state;
    static const setting settings[] = {{"OUT_OF_DOMAIN", "FAIL"}, {"BLANK_CHECK", "1"}, {NULL, NULL}};
    bench b;
    rx_noise_correlation noise;
    rx_blankcheck check;
    rx_result result;
    rx_field *blank = NULL;
    double tile = 0.0;
    open_bench(&b, RX_MODE_INFORMED, settings);
    rx_field *field = make_field(&b);
    assert_int_equal(rx_domain_noise(field, 3, &tile, NULL), RX_OK);
    assert_true(tile > 0.125);
    assert_true(tile < 40);
    assert_int_equal(
        rx_field_extract(&b.options->pipeline, rx_restorer_find("NONE"), field, NULL, NULL, &result, NULL),
        RX_OK);
    assert_int_equal(rx_blankcheck_noise(field, result.sources->segments, 1, &noise, NULL), RX_OK);
    rx_result_free(&result);
    assert_int_equal(
        rx_blankcheck_run(&b.options->pipeline,
                          &(rx_blank_input){rx_restorer_find("NET"), field, &noise, NULL, 1, NULL}, NULL,
                          &check, NULL),
        RX_OK);
    assert_int_equal(check.realisations, 1);
    assert_int_equal(rx_blankcheck_field(&b.options->pipeline,
                                         &(rx_blank_input){.field = field, .noise = &noise}, NULL,
                                         (rx_random_stream){1, 1}, &blank, NULL),
                     RX_OK);
    assert_near(blank->model_noise, tile, 0);
    assert_near(blank->model_factor, field->noise_factor, 0);
    blank->model_factor = 3.5;
    assert_int_equal(
        rx_field_extract(&b.options->pipeline, rx_restorer_find("NET"), blank, NULL, NULL, &result, NULL),
        RX_NOT_RESTORED);
    rx_field_free(blank);
    rx_field_free(field);
    bench_close(&b);
}

/* Correlated noise: beyond what the model is known to work for, as OUT_OF_DOMAIN says. */
static void test_correlated(void **state)
{
    (void)state;
    static const char *const what[] = {"WARN", "RL", "FAIL"};
    for (int i = 0; i < 3; i++) {
        const setting settings[] = {{"OUT_OF_DOMAIN", what[i]}, {NULL, NULL}};
        bench b;
        rx_result result;
        rx_error err = RX_ERROR_NONE;
        open_bench(&b, RX_MODE_INFORMED, settings);
        rx_field *field = make_field(&b);
        field->model_noise = 4;
        field->model_factor = 3.25;
        const rx_status status =
            rx_field_extract(&b.options->pipeline, rx_restorer_find("NET"), field, NULL, NULL, &result, &err);
        assert_int_equal(status, i == 2 ? RX_NOT_RESTORED : RX_OK);
        if (i == 2) {
            assert_non_null(strstr(err.text, "noise factor 3.25 is above 3"));
        } else {
            const int bit = i == 0 ? RX_RESTORE_OUTSIDE : RX_RESTORE_OTHER;
            assert_string_equal(result.restored->name, i == 0 ? "NET" : "RL");
            assert_string_equal(result.domain.why, "noise factor 3.25 is above 3");
            assert_true(result.sources->n > 10);
            for (int k = 0; k < result.sources->n; k++)
                assert_int_equal(result.sources->list[k].fit.restore & ~RX_RESTORE_UNEXPLAINED, bit);
            assert_int_equal(result.outside, i == 0 ? result.sources->n : 0);
        }
        rx_result_free(&result);
        b.options->model->factor = 3.5; /* trained for it */
        rx_domain domain;
        const rx_restorer *kind = rx_restorer_find("NET");
        assert_int_equal(obey(&b, field, NULL, &kind, &domain, &err), RX_OK);
        assert_int_equal(domain.place, RX_DOMAIN_INSIDE);
        rx_field_free(field);
        bench_close(&b);
    }
}

/* A tile that is as good as empty is inside: so are patches of the training. */
static void test_faint(void **state)
{
    (void)state;
    bench b;
    rx_domain domain;
    const rx_restorer *kind = rx_restorer_find("NET");
    open_bench(&b, RX_MODE_INFORMED, (setting[]){{"OUT_OF_DOMAIN", "FAIL"}, {NULL, NULL}});
    rx_field *field = make_field(&b);
    field->model_noise = 80;
    assert_int_equal(obey(&b, field, NULL, &kind, &domain, NULL), RX_OK);
    assert_int_equal(domain.place, RX_DOMAIN_INSIDE);
    assert_ptr_equal(domain.bin, &b.options->model->bins[2]);
    field->model_noise = 0.1;
    assert_int_equal(obey(&b, field, NULL, &kind, &domain, NULL), RX_NOT_RESTORED);
    rx_field_free(field);
    bench_close(&b);
}

/* By source: brighter pixels than the training had, and a sky that is darker. */
static void test_marks_by_source(void **state)
{
    (void)state;
    enum { WIDE = 256 };
    for (int dark = 0; dark < 2; dark++) {
        scene s;
        bench b;
        rx_result result;
        int marked = 0, bright = 0, sunk = 0;
        scene_make(&s, WIDE, WIDE, 80, 5);
        for (int y = 0; dark && y < 64; y++) /* 10 below, with sources on it; given a flat sky */
            for (int x = 0; x < 64; x++)
                s.pixels[y * WIDE + x] -= 10.0f;
        open_bench(&b, RX_MODE_INFORMED,
                   (setting[]){{"BACK_TYPE", "MANUAL"}, {"BACK_VALUE", "1000"}, {NULL, NULL}});
        rx_field *field = bench_field(&b, s.pixels, WIDE, WIDE, 2.0);
        field->model_noise = 4;
        if (!dark)
            for (int i = 0; i < BINS; i++) /* pixels to 40 x 255 / 255 = 40 sigma, and the tile is inside */
                b.options->model->bins[i].sigma[i < 2 ? 0 : 1] = i < 2 ? 255 : 300,
                                                            b.options->model->bins[i].sigma[i < 2] = 280;
        if (!dark)
            field->model_noise = 260;
        assert_int_equal(
            rx_field_extract(&b.options->pipeline, rx_restorer_find("NET"), field, NULL, NULL, &result, NULL),
            RX_OK);
        assert_int_equal(result.domain.place, RX_DOMAIN_INSIDE);
        for (int i = 0; i < result.sources->n; i++) {
            const rx_source *source = &result.sources->list[i];
            const double peak = (s.pixels[source->ypeak * WIDE + source->xpeak] - 1000.0) / 5.0;
            const int is = (source->fit.restore & RX_RESTORE_OUTSIDE) != 0;
            marked += is;
            bright += is && peak > 32;
            sunk += is && source->x < 63.5 && source->y < 63.5;
            if (!dark && fabs(peak - 40) > 8) /* the noise is measured to some percent, and its correlation */
                assert_int_equal(is, peak > 40);
            if (dark && is) /* where stars are bright the box is not dark */
            {
                assert_true(source->x < 63.5);
                assert_true(source->y < 63.5);
            }
        }
        assert_int_equal(result.outside, marked);
        assert_true(dark ? sunk > 0 : bright > 2);
        assert_true(marked < result.sources->n);
        assert_int_equal(rx_residual_is_dark(result.residual.dark), dark);
        rx_result_free(&result);
        if (dark) { /* a model that knows such a sky */
            b.options->model->dark = 0.2;
            assert_int_equal(rx_field_extract(&b.options->pipeline, rx_restorer_find("NET"), field, NULL,
                                              NULL, &result, NULL),
                             RX_OK);
            assert_int_equal(result.outside, 0);
            rx_result_free(&result);
        }
        rx_field_free(field);
        bench_close(&b);
        scene_free(&s);
    }
}

/* A tile as RESTORE_TYPE NONE leaves it: what is said of it, its sources and the facts of its header. */
typedef struct examined {
    heard h;
    bench b;
    rx_field *field;
    rx_result result;
    rx_record facts;
} examined;

static void examine(const float *pixels, int side, examined *dst)
{
    *dst = (examined){0};
    open_bench(&dst->b, RX_MODE_INFORMED, NULL);
    listen(&dst->h);
    assert_int_equal(rx_field_prepare(&dst->b.options->pipeline, RX_FIELD_PSF,
                                      bench_tile(pixels, side, side, 2.0), NULL, &dst->h.log, &dst->field,
                                      NULL),
                     RX_OK);
    fclose(dst->h.log.stream);
    assert_int_equal(rx_field_extract(&dst->b.options->pipeline, rx_restorer_find("NONE"), dst->field, NULL,
                                      NULL, &dst->result, NULL),
                     RX_OK);
    rx_result_facts(&dst->result, &dst->facts);
}

static void forget(examined *e)
{
    rx_record_free(&e->facts);
    rx_result_free(&e->result);
    rx_field_free(e->field);
    free(e->h.text);
    bench_close(&e->b);
}

/* Fringes pass for noise: whatever restores, it is said in the log, the header and for every source. */
static void test_fringes(void **state)
{
    (void)state;
    enum { WIDE = 400 };
    for (int fringes = 0; fringes < 2; fringes++) {
        scene s;
        examined e;
        scene_make(&s, WIDE, WIDE, STARS, 5);
        for (int i = 0; fringes && i < WIDE * WIDE; i++)
            s.pixels[i] += (float)(10.0 * sin(2.0 * M_PI * (i % WIDE + 0.4 * (i / WIDE)) / 30.0));
        examine(s.pixels, WIDE, &e);
        assert_int_equal(count(e.h.text, "more than any resampling leaves it"), fringes);
        assert_string_equal(fact(&e.facts, "RXNOISOK"), fringes ? "F" : "T");
        assert_true(e.result.sources->n > 10);
        for (int i = 0; i < e.result.sources->n; i++)
            assert_int_equal(e.result.sources->list[i].fit.restore,
                             fringes ? RX_RESTORE_STRUCTURE | RX_RESTORE_UNEXPLAINED : 0);
        forget(&e);
        scene_free(&s);
    }
}

/* Values that hide the noise, all of it or a half: said in the log, the header and for every source. */
static void test_steps(void **state)
{
    (void)state;
    enum { WIDE = 400, FINE = 0, ROUNDED, GONE, CUT, KINDS };
    for (int kind = FINE; kind < KINDS; kind++) {
        scene s;
        examined e;
        scene_make(&s, WIDE, WIDE, STARS, 5); /* noise of 5 on a sky of 1000 */
        for (int i = 0; kind != FINE && i < WIDE * WIDE; i++)
            s.pixels[i] = kind == ROUNDED ? 16.0f * roundf((s.pixels[i] - 995.0f) / 16.0f)
                          : kind == GONE  ? 50.0f * roundf(s.pixels[i] / 50.0f)
                                          : fmaxf(s.pixels[i], 998.2f);
        examine(s.pixels, WIDE, &e);
        assert_int_equal(count(e.h.text, "no noise that could be measured"), kind == GONE);
        assert_near(atof(fact(&e.facts, "RXMODEL")), kind == FINE ? 0 : 1, 0.03);
        assert_int_equal(e.result.residual.cause, kind == FINE ? RX_MISFIT_NONE : RX_MISFIT_NOISE);
        assert_true(e.result.sources->n > 0);
        for (int i = 0; i < e.result.sources->n; i++)
            assert_int_equal(e.result.sources->list[i].fit.restore & RX_RESTORE_UNEXPLAINED,
                             kind == FINE ? 0 : RX_RESTORE_UNEXPLAINED);
        forget(&e);
        scene_free(&s);
    }
}

/* In dual-image mode fluxes are of the second image. */
static void test_steps_of_the_second_image(void **state)
{
    (void)state;
    enum { WIDE = 400 };
    for (int rounded = 0; rounded < 2; rounded++) {
        scene s;
        bench b;
        rx_result result;
        rx_record facts = {0};
        scene_make(&s, WIDE, WIDE, STARS, 5);
        open_bench(&b, RX_MODE_INFORMED, NULL);
        rx_field *detect = bench_field(&b, s.pixels, WIDE, WIDE, 2.0);
        for (int i = 0; rounded && i < WIDE * WIDE; i++)
            s.pixels[i] = 16.0f * roundf((s.pixels[i] - 995.0f) / 16.0f);
        rx_field *measure = bench_field(&b, s.pixels, WIDE, WIDE, 2.0);
        assert_int_equal(rx_field_extract(&b.options->pipeline, rx_restorer_find("NONE"), detect, measure,
                                          NULL, &result, NULL),
                         RX_OK);
        rx_result_facts(&result, &facts);
        assert_near(atof(fact(&facts, "RXMODEL")), rounded, 0.03);
        assert_true(result.sources->n > 10);
        for (int i = 0; i < result.sources->n; i++)
            assert_int_equal(result.sources->list[i].fit.restore, rounded ? RX_RESTORE_UNEXPLAINED : 0);
        rx_record_free(&facts);
        rx_result_free(&result);
        rx_field_free(detect);
        rx_field_free(measure);
        bench_close(&b);
        scene_free(&s);
    }
}

/* Light in a ninth of the tile, and cosmic rays: said by source, and in the header by shares. */
static void test_anomalies(void **state)
{
    (void)state;
    enum { WIDE = 400, RAYS = 20, STEP = 37 };
    for (int bad = 0; bad < 2; bad++) {
        scene s;
        examined e;
        int sharp = 0, doubtful = 0, beyond = 0;
        scene_make(&s, WIDE, WIDE, STARS, 5);
        for (int i = 0; bad && i < WIDE * WIDE; i++)
            s.pixels[i] += (float)(i % WIDE < 134 && i / WIDE < 134
                                       ? 4.0 * (cos(0.15 * (i % WIDE)) + cos(0.15 * (i / WIDE)))
                                       : 0.0);
        for (int i = 1; bad && i <= RAYS; i++)
            s.pixels[(STEP * i % WIDE) * WIDE + 18 * i] += 400.0f;
        examine(s.pixels, WIDE, &e);
        for (int i = 0; i < e.result.sources->n; i++) {
            const rx_source *source = &e.result.sources->list[i];
            int near = 0;
            for (int k = 1; k <= RAYS; k++)
                near |= abs(source->xpeak - 18 * k) < 3 && abs(source->ypeak - STEP * k % WIDE) < 3;
            if (source->fit.restore & RX_RESTORE_SHARP)
                assert_int_equal(near, 1);
            sharp += (source->fit.restore & RX_RESTORE_SHARP) != 0;
            doubtful += (source->fit.restore & RX_RESTORE_UNEXPLAINED) != 0;
            beyond +=
                (source->fit.restore & RX_RESTORE_UNEXPLAINED) != 0 && fmax(source->x, source->y) > 134 + 67;
        }
        print_message("%d sources, %d sharp, %d in doubt; cells %s\n", e.result.sources->n, sharp, doubtful,
                      fact(&e.facts, "RXMODEL"));
        assert_between(sharp, bad ? RAYS / 2 : 0, bad ? RAYS : 0);
        assert_between(doubtful, bad ? 3 : 0, bad ? 300 : 0);
        assert_true(10 * beyond <= doubtful);
        assert_near(atof(fact(&e.facts, "RXSHARP")), (double)sharp / e.result.sources->n, 1e-4);
        assert_false(rx_residual_is_large(e.result.residual.share));
        assert_null(fact(&e.facts, "RXMISFIT")); /* of a ninth of the tile alone */
        rx_record header = {0};
        rx_facts_of_header(&e.facts, false, &header);
        assert_false(header.failed);
        assert_null(fact(&header, "RXSHARP"));
        assert_null(fact(&header, "RXNODATA"));
        assert_between(header.n, 8, 25);
        rx_record_free(&header);
        forget(&e);
        scene_free(&s);
    }
}

/* --- the whole stage --- */

static rx_status run_stage(const char *fwhm, const char *out_of_domain, rx_error *err)
{
    const setting settings[] = {{"PARAMETERS_NAME", "columns.param"},
                                {"CATALOG_NAME", "out.cat"},
                                {"CATALOG_TYPE", "FITS_1.0"},
                                {"CHECKIMAGE_TYPE", "RESTORED"},
                                {"CHECKIMAGE_NAME", "restored.fits"},
                                {"MAG_ZEROPOINT", "25"},
                                {"PSF_TYPE", "MOFFAT"},
                                {"PSF_FWHM", fwhm},
                                {"RL_NITER", "5"},
                                {"RESTORE_TYPE", "RL,NET"},
                                {"NET_MODEL", "toy.fits"},
                                {"OUT_OF_DOMAIN", out_of_domain},
                                {"REFERENCE_NAME", "truth.fits"},
                                {"QA_NAME", "qa"},
                                {"SELF_CHECK", "Y"},
                                {"SELF_CHECK_COUNT", "20"},
                                {"SELF_CHECK_NAME", "check"},
                                {"QA_FIGURES", "N"},
                                {NULL, NULL}};
    rx_config *config = NULL;
    FILE *file = fopen("columns.param", "w");
    assert_non_null(file);
    fputs("NUMBER\nX_IMAGE\nY_IMAGE\nMAG_AUTO\nFLUX_AUTO\nFLUXERR_AUTO\nFLAGS\n", file);
    fclose(file);
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    for (const setting *s = settings; s->name != NULL; s++)
        if (rx_settings_set(&config->settings, s->name, s->value, NULL, err) != RX_OK)
            fail_msg("%s: %s", s->name, err->text);
    rx_status status = rx_stage_run(config, "tile.fits", stdout, NULL, NULL, err);
    rx_config_free(config);
    return status;
}

static void write_inputs(void)
{
    scene s;
    rx_model *model = make_model(RX_MODE_INFORMED);
    scene_make(&s, SIDE, SIDE, STARS, 5);
    scene_write("tile.fits", s.pixels, SIDE, SIDE);
    scene_write_truth("truth.fits", &s);
    assert_int_equal(rx_model_write(model, "toy.fits", "toy.fits", NULL), RX_OK);
    rx_model_free(model);
    scene_free(&s);
}

static void card_is(const char *path, int hdu, const char *key, const char *expected)
{
    char *cards = NULL, value[300] = "";
    long n = 0;
    assert_int_equal(rx_fits_read_header(path, hdu, &cards, &n, NULL), RX_OK);
    int there = rx_cards_text(cards, n, key, value, sizeof value);
    free(cards);
    assert_int_equal(there, expected != NULL);
    if (expected != NULL)
        assert_string_equal(value, expected);
}

static void holds(const char *path, const char *what, int expected)
{
    char *text = NULL;
    size_t n = 0;
    assert_int_equal(rx_text_read_file(path, 1 << 24, &text, &n, NULL), RX_OK);
    if ((strstr(text, what) != NULL) != expected)
        fail_msg("%s: '%s' is %s", path, what, expected ? "missing" : "there");
    free(text);
}

static void expect_stage(const char *fwhm, const char *out_of_domain)
{
    rx_error err = RX_ERROR_NONE;
    if (run_stage(fwhm, out_of_domain, &err) != RX_OK)
        fail_msg("%s: %s", err.where, err.text);
}

static void test_outputs_inside(void **state)
{
    (void)state;
    static const char *const outputs[] = {"out_NET.cat", "restored_NET.fits"};
    write_inputs();
    expect_stage("3.5", "FAIL");
    for (int i = 0; i < 2; i++) {
        int hdu = i == 0;
        card_is(outputs[i], hdu, "RXREST", "NET");
        card_is(outputs[i], hdu, "RXASKED", "NET");
        card_is(outputs[i], hdu, "RXWHY", NULL);
        card_is(outputs[i], hdu, "RXNETMOD", "toy");
        card_is(outputs[i], hdu, "RXNETIN", "T");
        card_is(outputs[i], hdu, "RXNETREC", NULL); /* HEADER_FACTS SHORT */
    }
    card_is("out_RL.cat", 1, "RXASKED", "RL");
    static const char *const pages[] = {"qa/report.html", "check/report.html"};
    for (int i = 0; i < 2; i++) {
        holds(pages[i], "id=\"models\"", 1);
        holds(pages[i], ">model</th><td class=\"t\">name</td><td class=\"t\">toy</td>", 1);
        holds(pages[i], "promises nothing here", 0);
        holds(pages[i], ">done by</th>", 0);
        holds(pages[i], ">FWHM from [pix]</th><td class=\"t\">bin of the model, from</td><td>2</td>", 1);
        holds(pages[i], ">FWHM to [pix]</th><td class=\"t\">to</td><td>5</td>", 1);
    }
    holds("qa/summary.json", "\"bias_percent\": -1.25", 1);
}

static void test_outputs_rl(void **state)
{
    (void)state;
    write_inputs();
    expect_stage("12", "RL");
    static const char *const outputs[] = {"out_NET.cat", "restored_NET.fits"};
    for (int i = 0; i < 2; i++) {
        int hdu = i == 0;
        card_is(outputs[i], hdu, "RXREST", "RL");
        card_is(outputs[i], hdu, "RXASKED", "NET");
        card_is(outputs[i], hdu, "RXWHY", "FWHM 12.00 pixels is above 8");
    }
    card_is("out_RL.cat", 1, "RXWHY", NULL);
    static const char *const pages[] = {"qa/report.html", "check/report.html"};
    for (int i = 0; i < 2; i++) {
        holds(pages[i], "NET: restored by RL instead</b> (FWHM 12.00 pixels is above 8)", 1);
        holds(pages[i], ">done by</th>", 1);
        holds(pages[i], "RL: restored by", 0);
        holds(pages[i], "</td><td class=\"t\">FWHM 12.00 pixels is above 8</td>", 1);
    }
    holds("qa/summary.json",
          "\"run\": \"NET\", \"done_by\": \"RL\", \"why\": \"FWHM 12.00 pixels is above 8\"", 1);
}

static void test_outputs_fail(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    write_inputs();
    assert_int_equal(run_stage("12", "FAIL", &err), RX_NOT_RESTORED);
    assert_string_equal(err.where, "tile.fits");
    assert_non_null(strstr(err.text, "FWHM 12.00 pixels is above 8"));
    assert_int_equal(access("out_NET.cat", F_OK), -1);
    assert_int_equal(access("out_RL.cat", F_OK), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_noise),
        cmocka_unit_test(test_inside),
        cmocka_unit_test(test_gaps),
        cmocka_unit_test(test_warn),
        cmocka_unit_test(test_rl),
        cmocka_unit_test(test_narrow),
        cmocka_unit_test(test_no_fallback),
        cmocka_unit_test(test_fail),
        cmocka_unit_test(test_no_dictionary),
        cmocka_unit_test(test_no_psf),
        cmocka_unit_test(test_second_image),
        cmocka_unit_test(test_copies),
        cmocka_unit_test(test_correlated),
        cmocka_unit_test(test_faint),
        cmocka_unit_test(test_marks_by_source),
        cmocka_unit_test(test_fringes),
        cmocka_unit_test(test_steps),
        cmocka_unit_test(test_steps_of_the_second_image),
        cmocka_unit_test(test_anomalies),
        cmocka_unit_test_setup_teardown(test_outputs_inside, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_outputs_rl, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_outputs_fail, enter_scratch, leave_scratch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
