/* A survey of three tiles worked out by hand. */
#include "../near.h"
#include "../scratch.h"

#include <math.h>

#include "survey/rollup.h"

static const char records_text[] =
    /* good: 90 of 100 found, half of the errors in the step of 0 to 0.005, half in the one below */
    "TILE a.fits a\nVERSION 1\nSTATUS 0 \"\"\nEXTENSION 0 9 9 10 20 3 0 1 1\nRUN NONE 95 1\n"
    "BIN 96 100 90 95 90 244:45 245:45\nEND\n"
    /* worse: 50 of 100 found */
    "TILE b.fits b\nVERSION 1\nSTATUS 0 \"\"\nEXTENSION 0 9 9 11 20 3 0 1 1\nRUN NONE 50 1\n"
    "BIN 96 100 50 50 50 244:25 245:25\nBIN 98 10 0 0 0\nEND\n"
    /* its gate failed, though it is good */
    "TILE c.fits c\nVERSION 1\nSTATUS 5 \"a <gate> & FAILED\"\nEXTENSION 0 9 9 nan nan 3 0 1 2\nRUN NONE 95 "
    "1\n"
    "BIN 96 100 90 95 90 244:45 245:45\nRUN RL 7 0\nFLUX 40 10 1.009 0.0002 0.9 0.01\nEND\n"
    "TILE d.fits d\nVERSION 1\nSTATUS 3 \"cannot be opened\"\nEND\n";

typedef struct survey {
    rx_tiles *tiles;
    rx_settings *settings;
    rx_rollup rollup;
} survey;

static rx_status add_file(rx_rollup *rollup, const char *path, rx_error *err)
{
    rx_record_reader *reader = NULL;
    const rx_tile_record *record = NULL;
    int64_t at;
    rx_status status = rx_record_reader_open(path, 0, &reader, err);
    while (status == RX_OK && (status = rx_record_reader_next(reader, &record, &at, err)) == RX_OK &&
           record != NULL)
        status = rx_rollup_add(rollup, record, path, at, err);
    rx_record_reader_close(reader);
    return status;
}

static void make(survey *s, const char *range)
{
    char path[512];
    *s = (survey){0};
    new_file(path, records_text);
    assert_int_equal(rx_settings_new(rx_keytable_survey(), &s->settings, NULL), RX_OK);
    assert_int_equal(rx_settings_set(s->settings, "MAG_RANGE", range, NULL, NULL), RX_OK);
    rx_rollup_begin((rx_survey_config *)s->settings, &s->rollup);
    assert_int_equal(add_file(&s->rollup, path, NULL), RX_OK);
    write_text(path, "e.fits\na.fits\nx/b.fits\nd.fits\n");
    assert_int_equal(rx_tiles_read(path, &s->tiles, NULL), RX_OK);
    assert_int_equal(rx_rollup_end(&s->rollup, s->tiles, NULL), RX_OK);
    unlink(path);
}

static void drop(survey *s)
{
    rx_rollup_free(&s->rollup);
    rx_settings_free(s->settings);
    rx_tiles_free(s->tiles);
}

/* Writes the report without figures. */
static void write_report(void **state, const rx_rollup *r)
{
    assert_int_equal(rx_rollup_report(r, 0, *state, "the report", NULL, NULL), RX_OK);
}

static char *read_part(void **state, const char *name)
{
    char *text = NULL;
    const char *path = in(state, name);
    assert_int_equal(rx_text_read_file(path, 1 << 26, &text, NULL, NULL), RX_OK);
    return text;
}

/* Does a file of the report hold all words? */
static void holds(void **state, const char *name, const char *const *words)
{
    char *text = read_part(state, name);
    for (; *words != NULL; words++)
        if (strstr(text, *words) == NULL)
            fail_msg("%s lacks %s", name, *words);
    free(text);
}

static void sums(void **state)
{
    survey s;
    (void)state;
    make(&s, "0,0");
    const rx_rollup *r = &s.rollup;
    assert_int_equal(r->fine, 2);
    assert_int_equal(r->failed, 1);
    assert_int_equal(r->gates, 1);
    assert_int_equal(r->nmissing, 2);
    assert_string_equal(rx_tiles_image(r->tiles, r->missing[0]), "e.fits");
    assert_string_equal(rx_tiles_image(r->tiles, r->missing[1]), "x/b.fits");
    assert_int_equal(r->nruns, 2);
    assert_string_equal(r->run[0].name, "NONE");
    assert_int_equal(r->run[0].tiles, 3);
    assert_int_equal(r->run[0].sources, 240);
    assert_near(r->run[0].whole.recall.value, 230.0 / 310, 1e-12);
    assert_near(r->run[0].whole.precision.value, 230.0 / 240, 1e-12);
    assert_near(r->run[0].bin[96].recall.value, 230.0 / 300, 1e-12);
    assert_int_equal(r->run[0].whole.pairs, 230);
    /* half of the pairs are in the step from -0.005 to 0, half in the one from 0: the median lies between */
    assert_near(r->run[0].whole.bias, 0, 1e-9);
    assert_near(r->run[0].whole.scatter, 1.4826 * 0.0025, 1e-9);
    assert_int_equal(r->run[0].first, 96);
    assert_int_equal(r->run[0].last, 98);
    assert_true(r->run[1].first > r->run[1].last);
    drop(&s);
}

static void worst_come_first(void **state)
{
    survey s;
    (void)state;
    make(&s, "0,0");
    assert_int_equal(s.rollup.nrows, 4);
    assert_string_equal(s.rollup.row[0].tile->name, "c");
    assert_string_equal(s.rollup.row[1].tile->name, "c");
    assert_string_equal(s.rollup.run[s.rollup.row[1].run].name, "RL");
    assert_true(isnan(s.rollup.row[1].off));
    assert_false(s.rollup.row[1].compared);
    assert_true(isnan(s.rollup.row[1].cell.recall.value));
    assert_true(isnan(s.rollup.row[1].cell.bias));
    assert_string_equal(s.rollup.row[2].tile->name, "b");
    assert_string_equal(s.rollup.row[2].what, "recall");
    const double p = 230.0 / 310;
    assert_near(s.rollup.row[2].off, (p - 50.0 / 110) / sqrt(p * (1 - p) / 110), 1e-9);
    assert_string_equal(s.rollup.row[3].tile->name, "a");
    drop(&s);
}

static void a_range_of_magnitudes(void **state)
{
    survey s;
    (void)state;
    make(&s, "18,18.5"); /* bin 96 alone */
    assert_int_equal(s.rollup.run[0].whole.recall.n, 300);
    assert_int_equal(s.rollup.row[2].cell.recall.n, 100);
    drop(&s);
    make(&s, "19,20");
    assert_int_equal(s.rollup.run[0].whole.recall.n, 10);
    assert_int_equal(s.rollup.run[0].whole.pairs, 0);
    drop(&s);
}

static void files_for_programs(void **state)
{
    static const char *const junit[] = {"tests=\"6\" failures=\"1\" errors=\"3\" skipped=\"0\"",
                                        "<failure message=\"a &lt;gate&gt; &amp; FAILED\"/>", NULL};
    static const char *const json[] = {
        "\"without_record\": 2",
        "{\"tile\": null, \"image\": \"e.fits\", \"exit_status\": null, \"error\": \"no record",
        "{\"run\": \"NONE\", \"mag_low\": 18, \"mag_high\": 18.5, \"recall\": {\"value\": 0.766666667,",
        NULL};
    static const char *const page[] = {"<b class=\"v FAIL\">2 of 6 tiles are fine:</b>",
                                       "a &lt;gate&gt; &amp; FAILED", NULL};
    static const char *const tiles[] = {"{name: 'off', ", /* else YAML takes it for false */
                                        ",nan,0,1,0,nan,0,1,0,0,nan,nan\n", NULL};
    survey s;
    make(&s, "0,0");
    write_report(state, &s.rollup);
    holds(state, "junit.xml", junit);
    holds(state, "summary.json", json);
    holds(state, "report.html", page);
    holds(state, "tiles.ecsv", tiles);
    char *html = read_part(state, "report.html");
    assert_null(strstr(html, "<gate>"));
    free(html);
    drop(&s);
}

/* PSFs: those of lower rungs are listed, residuals are correlated, whatever the order of the records. */
static void psfs(void **state)
{
    static const char a[] = "TILE a.fits a\nVERSION 1\nSTATUS 0 \"\"\nEXTENSION 0 9 9 10 20 3 0 1 0\n"
                            "PSF PIXELS 40 10 0.003 0.001 0.01 0.001 0.002 -0.003 0.004 0.005 0.006\n"
                            "STARS 10 100 20 0 0.05\nRHO 3 45 900 1800\nRUN RL 95 0\nEND\n",
                      b[] = "TILE b.fits b\nVERSION 1\nSTATUS 0 \"\"\nEXTENSION 0 9 9 11 20 3 0 1 0\n"
                            "PSF STATED 25 0 0.05 0 0 0 0 0 0 0 0\nRUN RL 95 0\nEND\n",
                      c[] = "TILE c.fits c\nVERSION 1\nSTATUS 0 \"\"\nEXTENSION 0 9 9 10 21 3 0 1 0\n"
                            "PSF PIXELS 40 5 0.003 0.001 0.01 0.001 0.002 -0.003 0.004 0.005 0.006\n"
                            "STARS 5 200 10 3 0.05\nRHO 3 10 -100 500\nRUN RL 95 0\nEND\n";
    static const char *const names[] = {"summary.json", "psfs.ecsv", "psf_rho.ecsv", "report.html"};
    static const char *const words[][3] = {
        {"\"psf_not_from_stars\": 1", "\"how\": \"STATED\"", NULL},
        /* the one of a lower rung comes first */
        {"de2_error\n\"b\",0,\"STATED\",25,0,0.05,0,0,nan,nan,nan,nan,nan,nan\n", NULL},
        {"\n32,64,50,", NULL},
        {"1 of 3 images", "STATED", NULL}};
    char *texts[2][4] = {{NULL}};
    for (int order = 0; order < 2; order++) {
        rx_rollup r = {0};
        char path[512], text[2000];
        snprintf(text, sizeof text, "%s%s%s", order ? c : a, b, order ? a : c);
        new_file(path, text);
        assert_int_equal(add_file(&r, path, NULL), RX_OK);
        unlink(path);
        assert_int_equal(rx_rollup_end(&r, NULL, NULL), RX_OK);
        assert_int_equal(r.npsfs, 3);
        assert_int_equal(r.lower, 1);
        assert_near(r.rho[3].pairs, 55, 0);
        assert_near(r.rho[3].t, 800e-8 / 55, 1e-18);
        assert_near(r.rho[3].e, 2300e-8 / 55, 1e-18);
        /* a and c, 60 arcmin apart: 50 pairs of products 100 * 200 and 20 * 10 */
        assert_near(r.rho[7].pairs, 50, 0);
        assert_near(r.rho[7].t, 20000e-8 / 50, 1e-15);
        assert_near(r.rho[7].e, 200e-8 / 50, 1e-15);
        write_report(state, &r);
        for (int i = 0; i < 4; i++)
            texts[order][i] = read_part(state, names[i]);
        rx_rollup_free(&r);
    }
    for (int i = 0; i < 4; i++) {
        assert_string_equal(texts[0][i], texts[1][i]);
        holds(state, names[i], words[i]);
        free(texts[0][i]);
        free(texts[1][i]);
    }
}

/* What another restorer did, and a flux scale that is off, with and without a reference. */
static void whose_work_and_flux_scale(void **state)
{
    static const char text[] = "TILE a.fits a\nVERSION 1\nSTATUS 0 \"\"\nEXTENSION 0 9 9 10 20 3 0 1 0\n"
                               "RUN RL 95 0\nFLUX 50 10 1.009 0.0001 0.95 0.001\n"
                               "RUN NET 60 0\nDONE RL \"FWHM 1.5 is <2\"\n"
                               "RUN AUTO 61 0\nTOOK NONE \"no other\"\nEND\n"
                               "TILE b.fits b\nVERSION 1\nSTATUS 0 \"\"\nEXTENSION 0 9 9 10 20 3 0 1 0\n"
                               "RUN RL 95 0\nFLUX 50 10 1.05 0.005 0.95 0.001\nRUN NET 61 0\nOUTSIDE \"noise "
                               "factor 3.2 is above 3\"\nGUARD 9.5 1.25 0.25\nEND\n";
    static const char *const junit[] = {
        "name=\"a.fits\"><system-out>HDU 0: NET: done by RL, FWHM 1.5 is &lt;2</system-out></testcase>",
        "HDU 0: RL: the flux scale is off: 1.0500 +- 0.0050, FLUX_AUTO 0.950",
        "HDU 0: NET: not made for this tile: noise factor 3.2 is above 3; HDU 0: NET: 25 % of the tile are "
        "not "
        "explained by the restored image; HDU 0: NET: DETECT_THRESH was raised 1.25 times",
        NULL};
    static const char *const json[] = {"\"done_by_another\": 1",
                                       "\"flux_scale_off\": 1",
                                       "\"outside\": 1,",
                                       "\"outside\": \"noise factor 3.2 is above 3\"",
                                       "\"threshold_raised\": 1,",
                                       "\"false_per_mpixel\": 9.5, \"threshold_raised\": 1.25",
                                       "\"done_by\": \"RL\", \"why\": \"FWHM 1.5 is <2\"",
                                       "\"done_by\": \"NONE\", \"why\": \"no other\"",
                                       "\"flux_scale_is\": \"off\"",
                                       NULL};
    /* both stand out, and the verdict says so */
    static const char *const page[] = {"<b class=\"v INSUFFICIENT\">0 of 2 tiles are fine:</b>",
                                       "<td class=\"t\">RL</td><td class=\"t\">FWHM 1.5 is &lt;2</td>",
                                       "flux scale off",
                                       "<th scope=\"col\" class=\"t\">not made for</th>",
                                       "<td class=\"t\">noise factor 3.2 is above 3</td>",
                                       NULL};
    static const char *const tiles[] = {",1.05,0.005,\"off\",", ",\"noise factor 3.2 is above 3\",", NULL};
    rx_rollup r = {0};
    char path[512];
    new_file(path, text);
    assert_int_equal(add_file(&r, path, NULL), RX_OK);
    unlink(path);
    assert_int_equal(rx_rollup_end(&r, NULL, NULL), RX_OK);
    assert_string_equal(r.run[0].name, "RL");
    assert_int_equal(r.run[0].by_others, 0);
    assert_int_equal(r.run[0].flux_off, 1);
    assert_int_equal(r.run[1].by_others, 1);
    assert_int_equal(r.run[1].flux_off, 0);
    assert_int_equal(r.run[0].outside, 0);
    assert_int_equal(r.run[1].outside, 1);
    assert_int_equal(r.run[0].raised, 0);
    assert_int_equal(r.run[1].raised, 1);
    /* the one that is off comes first, 10 of its errors from 1; nothing else has a reference */
    assert_string_equal(r.row[0].tile->name, "b");
    assert_string_equal(r.row[0].what, "flux scale");
    assert_near(r.row[0].off, 10, 1e-9);
    for (int i = 1; i < r.nrows; i++)
        assert_true(isnan(r.row[i].off));
    assert_int_equal(r.run[1].unexplained, 1);
    assert_int_equal(r.noutliers, 2);
    assert_int_equal(r.apart, 2);
    assert_int_equal(r.fine, 0);
    write_report(state, &r);
    holds(state, "junit.xml", junit);
    holds(state, "summary.json", json);
    holds(state, "report.html", page);
    holds(state, "tiles.ecsv", tiles);
    rx_rollup_free(&r);
}

static rx_status add_one(rx_rollup *rollup, const char *image, const char *name, int code, const char *run,
                         rx_error *err)
{
    const rx_tile_record record = {
        .image = (char *)image,
        .name = (char *)name,
        .version = (char *)"1",
        .status = code,
        .what = (char *)"",
        .facts = {.n = 1, .extension = &(rx_extension_facts){.nruns = 1, .run = {{.sources = 5}}}}};
    snprintf(record.facts.extension->run[0].name, sizeof record.facts.extension->run[0].name, "%s", run);
    return rx_rollup_add(rollup, &record, "all.records", 0, err);
}

static void records_are_sorted_and_merged(void **state)
{
    rx_rollup r = {0};
    rx_error err = RX_ERROR_NONE;
    (void)state;
    assert_int_equal(add_one(&r, "n/b.fits", "b", 0, "NONE", NULL), RX_OK);
    assert_int_equal(add_one(&r, "n/a.fits", "a", 3, "RL", NULL), RX_OK);
    assert_int_equal(add_one(&r, "m/b.fits", "b", 0, "NET", NULL), RX_OK);
    assert_int_equal(add_one(&r, "n/a.fits", "a", 3, "RL", NULL), RX_OK);
    assert_int_equal(add_one(&r, "m/b.fits", "b", 4, "NET", &err), RX_INPUT);
    assert_string_equal(err.where, "m/b.fits");
    assert_int_equal(rx_rollup_end(&r, NULL, NULL), RX_OK);
    assert_int_equal(r.ntiles, 3);
    assert_int_equal(r.nrows, 3);
    assert_string_equal(r.tile[0]->image, "n/a.fits");
    assert_string_equal(r.tile[1]->image, "m/b.fits");
    assert_string_equal(r.tile[2]->image, "n/b.fits");
    /* restorers in the order of the tiles, whatever came first */
    assert_string_equal(r.run[0].name, "RL");
    assert_string_equal(r.run[1].name, "NET");
    assert_string_equal(r.run[2].name, "NONE");
    assert_int_equal(r.run[0].sources, 5);
    for (int i = 0; i < 3; i++)
        assert_ptr_equal(r.row[i].tile, r.tile[i]);
    rx_rollup_free(&r);
}

/* A page that one can look at, which says what it leaves out; the tables have everything. */
static void many_tiles(void **state)
{
    enum { MANY = 9000 };
    rx_rollup r = {0};
    static const char *const page[] = {"200 of 3000 rows. All are in summary.json.",
                                       "200 of 9000 rows. All are in tiles.ecsv.", NULL};
    rx_figures *figures = calloc(1, sizeof *figures);
    rx_tally *tally = calloc(1, sizeof *tally);
    assert_non_null(figures);
    assert_non_null(tally);
    tally->bin[96] = (rx_tally_bin){.references = 10, .found = 9, .detections = 9, .right = 9};
    for (int i = 0; i < MANY; i++) {
        char name[20];
        snprintf(name, sizeof name, "t%d", i);
        const rx_tile_record record = {
            .image = name,
            .name = name,
            .version = (char *)"1",
            .status = i % 3 == 0 ? 3 : 0,
            .what = (char *)"",
            .facts = {.n = 1,
                      .extension = &(rx_extension_facts){.alpha = i % 100,
                                                         .delta = i / 100,
                                                         .nruns = 1,
                                                         .run = {{.name = "RL", .tally = tally}}}}};
        assert_int_equal(rx_rollup_add(&r, &record, "all.records", 0, NULL), RX_OK);
    }
    assert_int_equal(rx_rollup_end(&r, NULL, NULL), RX_OK);
    rx_rollup_figures(figures, &r);
    assert_false(figures->script.failed);
    assert_true(figures->script.length < 500000);
    assert_int_equal(strncmp(figures->figure[0].id, "all-recall", RX_FIGURE_ID), 0);
    bool mapped = false; /* there are no pairs, and no figure of their errors */
    for (int i = 0; i < figures->n; i++)
        mapped = mapped || strstr(figures->figure[i].reading, "mean") != NULL;
    assert_true(mapped);
    write_report(state, &r);
    holds(state, "report.html", page);
    char *html = read_part(state, "report.html"), *table = read_part(state, "tiles.ecsv");
    assert_true(strlen(html) < 500000);
    long lines = 0;
    for (const char *c = table; *c != '\0'; c++)
        lines += *c == '\n';
    assert_true(lines > MANY);
    free(html);
    free(table);
    rx_figures_free(figures);
    free(figures);
    free(tally);
    rx_rollup_free(&r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sums),
        cmocka_unit_test(worst_come_first),
        cmocka_unit_test(a_range_of_magnitudes),
        cmocka_unit_test_setup_teardown(files_for_programs, make_scratch, remove_scratch),
        cmocka_unit_test_setup_teardown(psfs, make_scratch, remove_scratch),
        cmocka_unit_test_setup_teardown(whose_work_and_flux_scale, make_scratch, remove_scratch),
        cmocka_unit_test(records_are_sorted_and_merged),
        cmocka_unit_test_setup_teardown(many_tiles, make_scratch, remove_scratch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
