/* Model files: what is written comes back, and nothing that is damaged or foreign is taken for a model. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "../near.h"
#include "../scratch.h"
#include "../small_net.h"
#include "base/memory.h"
#include "base/random.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "nn/model.h"
#include "nn/psfnet.h"
#include "num/stats.h"

enum { FLIPS = 500, CUTS = 100 };

/* Two bins of FWHM and three of noise, the paper's ranges. */
/* nets: 1 RESTORE alone, 2 and PSF, 3 and a second stage */
static rx_model *make_model(int nets)
{
    rx_model *model = rx_model_new();
    assert_non_null(model);
    model->restore = small_net(3, 1);
    rx_net_initialise(model->restore, 7, 1, 0.3, 0.1);
    model->restore->params[0] = -0.0f; /* numbers that a reader may lose */
    model->restore->params[1] = 1e-42f;
    if (nets > 1) {
        model->psf = small_net(RX_PSF_CHANNELS, 1);
        rx_net_initialise(model->psf, 7, 2, 0.3, 0.1);
    }
    if (nets > 2) {
        model->second = small_net(RX_SECOND_CHANNELS, 1);
        rx_net_initialise(model->second, 7, 3, 0.3, 0.1);
    }
    model->nfwhm = 2;
    model->nsigma = 3;
    model->bins = RX_NEW(rx_model_bin, 6);
    assert_non_null(model->bins);
    for (int i = 0; i < 6; i++)
        model->bins[i] = (rx_model_bin){.fwhm = {2 + 3 * (i % 2), 5 + 3 * (i % 2)},
                                        .sigma = {1 + 4 * (i / 2), 5 + 4 * (i / 2)},
                                        .loss = 0.1 + 1e-3 * i,
                                        .list = 1.0 / (i + 1),
                                        .recall = i == 5 ? NAN : 0.9 - 0.1 * i,
                                        .bias = -0.001 * i,
                                        .scatter = 0.02 + 1e-17,
                                        .images = 40 + i};
    snprintf(model->name, sizeof model->name, "small 'quoted' net");
    model->epochs = 12;
    model->best = 9;
    model->ended = 0;
    model->patches = 480000;
    model->seed = UINT64_C(18446744073709551615);
    model->front.tikhonov = 0.1 + 0.2;
    model->provenance = rx_strdup("WIDTH 4\nLOSS_TYPE LINEAR\n\nSEED 1\n");
    assert_non_null(model->provenance);
    return model;
}

static void write_to(const rx_model *model)
{
    unlink("m.fits");
    assert_int_equal(rx_model_write(model, "m.fits", "m.fits", NULL), RX_OK);
}

/* What is read makes the same file again, and the digest sees every parameter. */
static void test_round_trip(void **state)
{
    for (int nets = 1; nets <= 3; nets++) {
        rx_model *model = make_model(nets), *back = NULL;
        char digest[RX_MODEL_DIGEST];
        size_t n = 0, m = 0;
        write_to(model);
        char *first = file_bytes("m.fits", &n);
        assert_int_equal(rx_model_read("m.fits", &back, NULL), RX_OK);
        assert_int_equal(back->psf != NULL, nets > 1);
        assert_int_equal(back->second != NULL, nets > 2);
        assert_memory_equal(model->restore->node, back->restore->node, sizeof model->restore->node);
        assert_memory_equal(model->restore->params, back->restore->params,
                            (size_t)model->restore->nparams * sizeof(float));
        assert_true(back->front.tikhonov == model->front.tikhonov);
        assert_true(back->bins[4].scatter == model->bins[4].scatter);
        assert_true(isnan(back->bins[5].recall));
        assert_int_equal(back->bins[5].images, 45);
        assert_string_equal(back->name, model->name);
        assert_string_equal(back->provenance, model->provenance);
        assert_int_equal(back->best, 9);
        assert_true(back->seed == model->seed);
        rx_model_digest(model, digest);
        assert_string_equal(back->digest, digest);
        write_to(back);
        char *second = file_bytes("m.fits", &m);
        assert_int_equal(n, m);
        assert_memory_equal(first, second, n);
        model->restore->params[3] = nextafterf(model->restore->params[3], 9);
        rx_model_digest(model, digest);
        assert_string_not_equal(back->digest, digest);
        free(first);
        free(second);
        rx_model_free(back);
        rx_model_free(model);
    }
}

/* --- what is refused --- */

/* Reading fails as RX_INPUT with that in its text, one line that begins with no capital and has no stop. */
static void refused(const char *text)
{
    rx_model *back = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_model_read("m.fits", &back, &err), RX_INPUT);
    assert_null(back);
    if (strstr(err.text, text) == NULL)
        fail_msg("'%s' is not in '%s'", text, err.text);
    assert_string_equal(err.where, "m.fits");
    assert_null(strchr(err.text, '\n'));
    assert_true(err.text[0] != '\0');
    assert_true(err.text[strlen(err.text) - 1] != '.');
}

static void write_fits(const rx_text *cards, rx_table *const *tables, int ntables)
{
    rx_fits_writer *writer = NULL;
    unlink("m.fits");
    assert_int_equal(rx_fits_create("m.fits", "m.fits", &writer, NULL), RX_OK);
    assert_int_equal(rx_fits_primary(writer, cards, NULL), RX_OK);
    for (int i = 0; i < ntables; i++)
        assert_int_equal(rx_fits_table(writer, tables[i], NULL, NULL), RX_OK);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
}

static void test_foreign(void **state)
{
    float pixels[64 * 64] = {0};
    rx_fits_writer *writer = NULL;
    unlink("m.fits");
    refused("cannot be opened");
    write_bytes("m.fits", "", 0);
    refused("empty");
    write_bytes("m.fits", "#!/bin/sh\necho no model\n", 24);
    refused("not a FITS file");
    unlink("m.fits");
    assert_int_equal(rx_fits_create("m.fits", "tile", &writer, NULL), RX_OK);
    assert_int_equal(
        rx_fits_image(writer, &(rx_fits_plane){.width = 64, .height = 64, .floats = pixels}, NULL, NULL),
        RX_OK);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    refused("is no model");
}

/* The parts of a good model file, to be put together again after a change. */
typedef struct parts {
    char *cards;
    long ncards;
    rx_table *table[6];
    int n;
} parts;

static parts take_apart(void **state)
{
    static const char *const names[] = {"RESTORE_NODES", "RESTORE_PARAMS", "PSF_NODES",
                                        "PSF_PARAMS",    "DICTIONARY",     "PROVENANCE"};
    parts p = {.n = 6};
    rx_model *model = make_model(2);
    int hdu = 0;
    write_to(model);
    rx_model_free(model);
    char *all = NULL;
    long n = 0;
    assert_int_equal(rx_fits_read_header("m.fits", 0, &all, &n, NULL), RX_OK);
    p.cards = RX_NEW(char, (size_t)n * 80);
    assert_non_null(p.cards);
    for (long i = 0; i < n; i++) /* ours; the rest is written anew */
        if (strncmp(all + i * 80, "RX", 2) == 0 || strncmp(all + i * 80, "NEXTEND", 7) == 0)
            memcpy(p.cards + 80 * p.ncards++, all + i * 80, 80);
    free(all);
    for (int i = 0; i < 6; i++) {
        assert_int_equal(rx_fits_read_named("m.fits", names[i], &p.table[i], &hdu, NULL), RX_OK);
        assert_int_equal(hdu, i + 1);
    }
    return p;
}

static void put_together(parts *p)
{
    write_fits(&(rx_text){.data = p->cards, .length = (size_t)p->ncards * 80}, p->table, p->n);
    for (int i = 0; i < 6; i++)
        rx_table_free(p->table[i]);
    free(p->cards);
}

/* The value of a card, ten characters from column 21. */
static void set_card(parts *p, const char *key, const char *value)
{
    for (long i = 0; i < p->ncards; i++) {
        char *card = p->cards + 80 * i;
        char text[81];
        snprintf(text, sizeof text, "%-8s= %20s%50s", key, value, "");
        if (strncmp(card, text, 8) == 0) {
            memcpy(card, text, 80);
            return;
        }
    }
    fail_msg("no card %s", key);
}

static int32_t *node_cell(parts *p, int column, int row)
{
    return (int32_t *)p->table[0]->columns[column].data + row;
}

/* Files with right checksums and wrong content. */
static void test_wrong_content(void **state)
{
    parts p = take_apart(state); /* taking apart and putting together changes nothing */
    put_together(&p);
    rx_model *back = NULL;
    assert_int_equal(rx_model_read("m.fits", &back, NULL), RX_OK);
    rx_model_free(back);
    static const struct {
        const char *key, *value, *text;
    } cards[] = {
        {"RXMODEL", "3", "format version 3, this program reads 1 and 2"},
        {"RXMODEL", "2", "has no table SECOND_NODES"},
        {"RXMODEL", "T", "is no model"},
        {"RXMODE", "'SOMETHING'", "RXMODE is 'SOMETHING'"},
        {"RXMODE", "'BLIND   '", "2 Richardson-Lucy steps after a network of mode BLIND"},
        {"RXTFWHM", "-2.0", "RXTFWHM is -2, a number from 0.5 to 30 was expected ([pix] FWHM of the output"},
        {"RXTFWHM", "'two'", "RXTFWHM is missing or no number"},
        {"RXTIKH", "0.0", "regularisation"},
        {"RXPEDST", "0.0", "pedestal"},
        {"RXRLSTEP", "7", "RXRLSTEP"},
        {"RXSEED", "'many'", "RXSEED"},
        {"RXEPOCHS", "1.5", "RXEPOCHS is 1.5, an integer from"},
        {"RXNFWHM", "3", "has 6 bins, the header says 3 x 3"},
        {"RXNSIGMA", "0", "has 6 bins, the header says 2 x 0"},
        {"RXDIGEST", "'0123456789abcdef'", "put together from others"},
        {"NEXTEND", "5", "has 7 HDUs, 6 were written"}};
    for (size_t i = 0; i < sizeof cards / sizeof cards[0]; i++) {
        p = take_apart(state);
        set_card(&p, cards[i].key, cards[i].value);
        put_together(&p);
        refused(cards[i].text);
    }
}

static void test_wrong_network(void **state)
{
    parts p = take_apart(state);
    ((float *)p.table[1]->columns[0].data)[5] = NAN;
    put_together(&p);
    refused("parameter 6 is not finite");
    p = take_apart(state);
    p.table[1]->nrows--;
    put_together(&p);
    refused("parameters, the table has");
    p = take_apart(state);
    *node_cell(&p, 1, 3) = 60; /* takes a node that comes later */
    put_together(&p);
    refused("make no network");
    p = take_apart(state);
    snprintf(p.table[0]->columns[0].data, 5, "NONE");
    put_together(&p);
    refused("unknown operation 'NONE'");
    p = take_apart(state);
    p.table[0]->nrows = 0;
    put_together(&p);
    refused("has 0 nodes");
    p = take_apart(state);
    snprintf(p.table[0]->columns[2].name, 8, "PLUS");
    put_together(&p);
    refused("column 3 of RESTORE_NODES");
    p = take_apart(state);
    snprintf(p.table[0]->name, 8, "NODES");
    put_together(&p);
    refused("has no table RESTORE_NODES");
    p = take_apart(state); /* the PSF network takes other channels */
    rx_table *keep[2] = {p.table[0], p.table[1]};
    p.table[0] = p.table[2];
    p.table[1] = p.table[3];
    p.table[2] = keep[0];
    p.table[3] = keep[1];
    for (int i = 0; i < 2; i++) {
        char *name = p.table[i]->name;
        p.table[i]->name = p.table[i + 2]->name;
        p.table[i + 2]->name = name;
    }
    put_together(&p);
    refused("takes 2 channels, the mode gives 3");
    p = take_apart(state);
    ((double *)p.table[4]->columns[1].data)[0] = 9;
    put_together(&p);
    refused("no grid");
}

/* A model cannot be written that cannot be read. */
static void test_write_refuses(void **state)
{
    rx_error err = RX_ERROR_NONE;
    rx_model *model = make_model(1);
    model->front.mode = RX_MODE_BLIND;
    model->front.rl_steps = 0;
    unlink("m.fits");
    assert_int_equal(rx_model_write(model, "m.fits", "m.fits", &err), RX_SYSTEM);
    assert_non_null(strstr(err.text, "takes 3 channels, the mode gives 1"));
    assert_int_equal(access("m.fits", F_OK), -1);
    rx_model_free(model);
}

/* Every byte counts: one changed anywhere, or the file ended anywhere, is told. */
static void test_damage(void **state)
{
    rx_model *model = make_model(2);
    size_t n = 0;
    write_to(model);
    rx_model_free(model);
    char *data = file_bytes("m.fits", &n);
    for (uint64_t i = 0; i < FLIPS; i++) {
        uint32_t words[4];
        rx_random_block(11, 1, i, words);
        /* headers, where structure is, as often as everything */
        size_t at = i % 2 == 0 ? words[0] % n : words[0] % (2880 * 2);
        char keep = data[at];
        data[at] = (char)(keep ^ (char)(1 + words[1] % 255));
        write_bytes("m.fits", data, n);
        refused("");
        data[at] = keep;
    }
    for (uint64_t i = 0; i < CUTS; i++) {
        uint32_t words[4];
        rx_random_block(11, 2, i, words);
        size_t length = i < n / 2880 ? 2880 * i : words[0] % n;
        write_bytes("m.fits", data, length);
        refused("");
    }
    char *longer = calloc(1, n + 2880);
    assert_non_null(longer);
    memcpy(longer, data, n);
    write_bytes("m.fits", longer, n + 2880);
    refused("no HDU begins where this one should");
    free(longer);
    free(data);
}

/* --- words and numbers --- */

static void test_describe(void **state)
{
    rx_model *model = make_model(2);
    rx_text text = {0};
    rx_model_describe(model, &text);
    assert_false(text.failed);
    static const char *const parts[] = {
        "small 'quoted' net",
        "(not yet written)",
        "INFORMED",
        "FWHM 2 pixels",
        "12 epochs, 480000 images, seed 18446744073709551615; these are the parameters of epoch 9\n"
        "            has not ended",
        "2.00-5.00    1.00-5.00    0.1         1.000   0.900",
        "5.00-8.00    9.00-13.00   0.105",
        "correlated up to a factor of 1.00 in the training; works up to 3.00",
        "up to 255 noise units, of pixels up to 10200; dark structure in 0 of",
        "LOSS_TYPE LINEAR",
        "UNSHUFFLE"};
    for (size_t i = 0; i < sizeof parts / sizeof parts[0]; i++)
        if (strstr(text.data, parts[i]) == NULL)
            fail_msg("'%s' is not in\n%s", parts[i], text.data);
    assert_null(strstr(text.data, "nan"));
    for (const char *c = text.data; *c != '\0'; c++)
        assert_true(*c == '\n' || (*c >= 0x20 && *c <= 0x7e));
    rx_text_free(&text);
    rx_model_free(model);
}

static void test_find(void **state)
{
    rx_model *model = make_model(1);
    char why[200];
    const struct {
        double fwhm, sigma;
        int bin;
        const char *why;
    } cases[] = {{2, 1, 0, ""},
                 {4.99, 4.99, 0, ""},
                 {5, 1, 1, ""},
                 {3, 5, 2, ""},
                 {8, 13, 5, ""},
                 {9.3, 3, -1, "FWHM 9.30 pixels is above 8"},
                 {1.9984, 3, -1, "FWHM 1.9984 pixels is below 2"},
                 {1.5, 3, -1, "FWHM 1.50 pixels is below 2"},
                 {3, 0.25, -1, "noise 0.25 is below 1"},
                 {3, 82.5, 4, ""}, /* fainter than any field of the training, not than all its patches */
                 {6, HUGE_VAL, 5, ""},
                 {12, 0.5, -1, "FWHM 12.00 pixels is above 8, noise 0.50 is below 1"},
                 {NAN, 3, -1, "FWHM is not known"},
                 {3, NAN, -1, "noise is not known"}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const rx_model_bin *bin = rx_model_find(model, cases[i].fwhm, cases[i].sigma, why, sizeof why);
        assert_true(cases[i].bin < 0 ? bin == NULL : bin == &model->bins[cases[i].bin]);
        assert_string_equal(why, cases[i].why);
        assert_true(rx_model_find(model, cases[i].fwhm, cases[i].sigma, NULL, 0) == bin);
    }
    rx_model_free(model);
}

/* Against the quantile of GSL, and where the answer is known. */
static void test_noise_level(void **state)
{
    for (size_t n = 1; n < 30000; n = n * 5 / 2 + 1) {
        float *v = RX_NEW(float, n);
        double *w = RX_NEW(double, n);
        assert_non_null(v);
        assert_non_null(w);
        for (size_t i = 0; i < n; i++)
            w[i] = v[i] = (float)(20 + (i % 3 == 0 ? 4 : rx_random_normal(5, n, i)));
        assert_near(rx_brightness(v, n, 0), rx_quantile(w, n, 0.999), 1e-9);
        free(v);
        free(w);
    }
    enum { N = 1000000 };
    float *sky = RX_NEW(float, N);
    assert_non_null(sky);
    for (int i = 0; i < N; i++)
        sky[i] = (float)rx_random_normal(1, 1, (uint64_t)i);
    /* pure noise: 255/3.0902 (scipy.stats.norm.isf(1e-3)); error of the quantile 0.3 % */
    assert_near(rx_noise_level(rx_brightness(sky, N, 10)) / 82.519, 1, 0.005);
    for (int i = 0; i < N; i++)
        sky[i] = i < 2000 ? 51 : -1;
    assert_near(rx_brightness(sky, N, 0), 51, 0);
    assert_near(rx_noise_level(51), 5, 0);
    /* sparse: 30 pixels of stars, however bright, or only what may be a cosmic ray */
    static const struct {
        int apart;
        float peak;
        size_t few;
        double brightness;
    } cases[] = {{33333, 1020, 10, 25.5},
                 {33333, 102000, 10, 2550},
                 {125000, 102000, 10, 2},
                 {125000, 102000, 0, 2550}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        for (int i = 0; i < N; i++)
            sky[i] = i % cases[k].apart == 0 ? cases[k].peak : i % 10 == 0 ? 2 : -1;
        assert_near(rx_brightness(sky, N, cases[k].few), cases[k].brightness, 0);
    }
    for (int i = 0; i < N; i++)
        sky[i] = -1;
    assert_true(isinf(rx_noise_level(rx_brightness(sky, N, 0))));
    assert_true(isnan(rx_noise_level(rx_brightness(sky, 0, 0))));
    free(sky);
}

static void test_what_was_trained(void **state)
{
    rx_model *model = make_model(1), *back = NULL;
    assert_near(rx_model_peak(model), 40 * 255, 0);
    assert_near(rx_model_factor(model), 3, 0);
    model->factor = 4.25;
    model->dark = 0.125;
    write_to(model);
    assert_int_equal(rx_model_read("m.fits", &back, NULL), RX_OK);
    assert_near(back->factor, 4.25, 0);
    assert_near(back->dark, 0.125, 0);
    assert_near(rx_model_factor(back), 4.25, 0);
    rx_model_free(back);
    model->dark = 1.5;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_model_write(model, "n.fits", "n.fits", &err), RX_SYSTEM);
    assert_non_null(strstr(err.text, "RXTDARK"));
    rx_model_free(model);
    static const char *const box[] = {"psfnet", "psfnet-fast", "psfnet-blind", "psfnet-paper"};
    for (int i = 0; i < 4; i++) {
        char path[300];
        snprintf(path, sizeof path, "%s/config/%s.fits", getenv("srcdir") != NULL ? getenv("srcdir") : ".",
                 box[i]);
        assert_int_equal(rx_model_read(path, &model, NULL), RX_OK);
        if (i < 2) /* skies as surveys deliver them */
            assert_true(model->factor > 3);
        else
            assert_near(model->factor, 1, 0);
        assert_near(model->dark, i < 2 ? 0.15 : 0, 1e-12);
        assert_near(rx_model_peak(model), 40 * (i == 3 ? 255 : 510), 1e-9);
        rx_model_free(model);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_round_trip, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_foreign, enter_scratch, leave_scratch),

        cmocka_unit_test_setup_teardown(test_wrong_content, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_wrong_network, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_write_refuses, enter_scratch, leave_scratch),
        cmocka_unit_test_setup_teardown(test_damage, enter_scratch, leave_scratch),
        cmocka_unit_test(test_describe),
        cmocka_unit_test(test_find),
        cmocka_unit_test(test_noise_level),
        cmocka_unit_test_setup_teardown(test_what_was_trained, enter_scratch, leave_scratch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
