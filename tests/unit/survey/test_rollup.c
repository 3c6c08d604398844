/* Surveys of a few tiles worked out by hand, through their files. */
#include "../near.h"
#include "survey.h"

#include <math.h>

static const char three_tiles[] =
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

static void sums_and_comparisons(void **state)
{
    static const char *const keywords[] = {"TILES_NAME", "tiles.list", NULL};
    static const char *const junit[] = {"tests=\"6\" failures=\"1\" errors=\"3\" skipped=\"0\"",
                                        "<failure message=\"a &lt;gate&gt; &amp; FAILED\"/>", NULL};
    static const char *const json[] = {
        "\"fine\": 2,", "\"failed\": 1,", "\"without_record\": 2,", "\"gate_failed\": 1,",
        "{\"tile\": null, \"image\": \"e.fits\", \"exit_status\": null, \"error\": \"no record",
        "{\"tile\": null, \"image\": \"x/b.fits\", \"exit_status\": null, \"error\": \"no record",
        /* 230 of 310, 230 of 240; half of the pairs are in the step from -0.005 to 0, half in the one from 0: the median
         * lies between */
        "{\"run\": \"NONE\", \"images\": 3, \"done_by_another\": 0, \"outside\": 0, \"flux_scale_off\": 0, "
        "\"threshold_raised\": 0, \"not_explained\": 0, \"sources\": 240, \"recall\": {\"value\": "
        "0.741935484,",
        "\"precision\": {\"value\": 0.958333333,", "\"scatter_mag\": 0.0037065}",
        /* the bin that counts nothing found ends the table */
        "{\"run\": \"NONE\", \"mag_low\": 18, \"mag_high\": 18.5, \"recall\": {\"value\": 0.766666667,",
        "{\"run\": \"NONE\", \"mag_low\": 19, \"mag_high\": 19.5, \"recall\": {\"value\": 0,", NULL};
    static const char *const page[] = {"<b class=\"v FAIL\">2 of 6 tiles are fine:</b>",
                                       "a &lt;gate&gt; &amp; FAILED", NULL};
    static const char *const tiles[] = {"{name: 'off', ", /* else YAML takes it for false */
                                        ",nan,0,1,0,nan,0,1,0,0,nan,nan\n", NULL};
    write_text("tiles.list", "e.fits\na.fits\nx/b.fits\nd.fits\n");
    assert_int_equal(roll_up(three_tiles, keywords, NULL), RX_OK);
    holds("junit.xml", junit);
    holds("summary.json", json);
    holds("report.html", page);
    holds("tiles.ecsv", tiles);
    char *html = slurp("survey", "report.html"), *rows = slurp("survey", "tiles.ecsv"),
         *summary = slurp("survey", "summary.json"),
         *bias = strstr(summary, "\"pairs\": 230, \"bias_mag\": ");
    assert_non_null(bias);
    assert_near(strtod(strrchr(strtok(bias, ","), ' '), NULL), 230, 0);
    assert_near(strtod(strrchr(strtok(NULL, ","), ' '), NULL), 0, 1e-9);
    free(summary);
    assert_null(strstr(html, "<gate>"));
    /* worst first: the gate, then what finds too little, by its own errors */
    char *worst = strstr(rows, "\n\"c\",\"c.fits\",0,\"NONE\""), *next = strstr(rows, "\n\"b\",\"b.fits\",");
    assert_non_null(worst);
    assert_true(next > worst);
    assert_true(strstr(rows, "\n\"a\",\"a.fits\",") > next);
    const double p = 230.0 / 310;
    char *recall = strstr(next, ",\"recall\",");
    assert_non_null(recall);
    while (recall[-1] != ',')
        recall--;
    assert_near(strtod(recall, NULL), (p - 50.0 / 110) / sqrt(p * (1 - p) / 110), 1e-7);
    free(html);
    free(rows);
}

/* 10 pairs that are too faint beside 40, of which the median of all is that of 25 of 40 in the step of -0.005 to 0. */
static void a_bias_counts_by_its_error(void **state)
{
    static const char text[] = "TILE a.fits a\nVERSION 1\nSTATUS 0 \"\"\nEXTENSION 0 9 9 10 20 3 0 1 0\nRUN "
                               "RL 40 1\nBIN 96 40 40 40 40 "
                               "244:40\nEND\n"
                               "TILE b.fits b\nVERSION 1\nSTATUS 0 \"\"\nEXTENSION 0 9 9 11 20 3 0 1 0\nRUN "
                               "RL 10 1\nBIN 96 10 10 10 10 "
                               "254:5 264:5\nEND\n";
    double bias, scatter;
    assert_int_equal(roll_up(text, NULL, NULL), RX_OK);
    char *rows = slurp("survey", "tiles.ecsv"), *row = strstr(rows, "\n\"b\",\"b.fits\","),
         *next = strstr(rows, "\n\"a\",\"a.fits\",");
    assert_non_null(row);
    assert_true(next > row);
    *next = '\0';
    char *off = strstr(row, ",\"bias\","), *pairs = strstr(row, ",10,10,");
    assert_non_null(off);
    assert_non_null(pairs);
    assert_int_equal(sscanf(pairs, ",10,10,%lf,%lf", &bias, &scatter), 2);
    while (off[-1] != ',')
        off--;
    assert_near(strtod(off, NULL), (bias + 0.001875) / (1.2533 * scatter / sqrt(10)), 1e-4);
    free(rows);
}

static void a_range_of_magnitudes(void **state)
{
    static const char *const keywords[] = {"MAG_RANGE", "18,18.5", NULL}, *const faint[] = {"MAG_RANGE",
                                                                                            "19,20", NULL};
    static const char *const one[] = {"\"sources\": 240, \"recall\": {\"value\": 0.766666667,", NULL};
    static const char *const none[] = {"\"sources\": 240, \"recall\": {\"value\": 0,", "\"n\": 10}",
                                       "\"pairs\": 0,", NULL};
    assert_int_equal(roll_up(three_tiles, keywords, NULL), RX_OK);
    holds("summary.json", one);
    assert_int_equal(roll_up(three_tiles, faint, NULL), RX_OK);
    holds("summary.json", none);
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
    static const char *const words[][4] = {
        {"\"psf_not_from_stars\": 1", "\"how\": \"STATED\"",
         /* a and c, 60 arcmin apart: 50 pairs of products 20 * 10 and 100 * 200 */
         "\"pairs\": 50, \"rho1\": 4e-08, \"rho1_error\": null, \"rho_t\": 4e-06,", NULL},
        /* the one of a lower rung comes first */
        {"de2_error\n\"b\",0,\"STATED\",25,0,0.05,0,0,nan,nan,nan,nan,nan,nan\n", NULL},
        {"\n32,64,50,", ",55,4.18181818e-07,", NULL}, /* 2300 and 800 of 55 pairs */
        {"1 of 3 images", "STATED", NULL}};
    char *texts[2][4] = {{NULL}};
    for (int order = 0; order < 2; order++) {
        char text[2000];
        snprintf(text, sizeof text, "%s%s%s", order ? c : a, b, order ? a : c);
        assert_int_equal(roll_up(text, NULL, NULL), RX_OK);
        for (int i = 0; i < 4; i++)
            texts[order][i] = slurp("survey", names[i]);
    }
    for (int i = 0; i < 4; i++) {
        assert_string_equal(texts[0][i], texts[1][i]);
        holds(names[i], words[i]);
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
                               "factor 3.2 is above 3\"\nGUARD 9.5 1.25 0.75\nEND\n";
    static const char *const junit[] = {
        "name=\"a.fits\"><system-out>HDU 0: NET: done by RL, FWHM 1.5 is &lt;2</system-out></testcase>",
        "HDU 0: RL: the flux scale is off: 1.0500 +- 0.0050, FLUX_AUTO 0.950",
        "HDU 0: NET: not made for this tile: noise factor 3.2 is above 3; HDU 0: NET: the model does not "
        "explain 75 % of the tile; HDU 0: NET: DETECT_THRESH was raised 1.25 times",
        NULL};
    static const char *const json[] = {
        "\"fine\": 0,", "\"stand_out\": 2,",
        "{\"run\": \"RL\", \"images\": 2, \"done_by_another\": 0, \"outside\": 0, \"flux_scale_off\": 1, "
        "\"threshold_raised\": 0, \"not_explained\": 0,",
        "{\"run\": \"NET\", \"images\": 2, \"done_by_another\": 1, \"outside\": 1, \"flux_scale_off\": 0, "
        "\"threshold_raised\": 1, \"not_explained\": 1,",
        "\"outside\": \"noise factor 3.2 is above 3\"",
        "\"false_per_mpixel\": 9.5, \"threshold_raised\": 1.25",
        "\"done_by\": \"RL\", \"why\": \"FWHM 1.5 is <2\"", "\"done_by\": \"NONE\", \"why\": \"no other\"",
        "\"flux_scale_is\": \"off\"",
        /* 10 of its errors from 1; nothing else has a reference */
        "\"off\": 10, \"worst_in\": \"flux scale\"", NULL};
    /* both stand out, and the verdict says so */
    static const char *const page[] = {"<b class=\"v INSUFFICIENT\">0 of 2 tiles are fine:</b>",
                                       "<td class=\"t\">RL</td><td class=\"t\">FWHM 1.5 is &lt;2</td>",
                                       "flux scale off",
                                       "<th scope=\"col\" class=\"t\">not made for</th>",
                                       "<td class=\"t\">noise factor 3.2 is above 3</td>",
                                       NULL};
    /* the one that is off comes first */
    static const char *const tiles[] = {"scatter_mag\n\"b\",\"b.fits\",0,\"RL\",", ",1.05,0.005,\"off\",",
                                        ",\"noise factor 3.2 is above 3\",", NULL};
    assert_int_equal(roll_up(text, NULL, NULL), RX_OK);
    holds("junit.xml", junit);
    holds("summary.json", json);
    holds("report.html", page);
    holds("tiles.ecsv", tiles);
}

static void add_record(rx_text *dst, const char *image, const char *name, int code, const char *run)
{
    rx_text_printf(dst,
                   "TILE \"%s\" \"%s\"\nVERSION \"1\"\nSTATUS %d \"\"\nEXTENSION 0 0 0 0 0 0 0 0 0\nRUN "
                   "\"%s\" 5 0\nEND\n",
                   image, name, code, run);
}

/* By tiles, restorers in the order of the tiles, whatever came first; one that comes twice counts once. */
static void records_are_sorted_and_merged(void **state)
{
    static const char *const keywords[] = {"MERGED_NAME", "merged", NULL};
    static const char *const json[] = {
        "\"all_tiles\": 3,", "\"runs\": [\n    {\"run\": \"RL\", \"images\": 1,", "\"sources\": 5,", NULL};
    rx_text records = {0}, sorted = {0};
    rx_error err = RX_ERROR_NONE;
    add_record(&records, "n/b.fits", "b", 0, "NONE");
    add_record(&records, "n/a.fits", "a", 3, "RL");
    add_record(&records, "m/b.fits", "b", 0, "NET");
    add_record(&records, "n/a.fits", "a", 3, "RL");
    add_record(&sorted, "n/a.fits", "a", 3, "RL");
    add_record(&sorted, "m/b.fits", "b", 0, "NET");
    add_record(&sorted, "n/b.fits", "b", 0, "NONE");
    assert_int_equal(roll_up(records.data, keywords, NULL), RX_OK);
    holds("summary.json", json);
    char *merged = slurp(".", "merged"), *page = slurp("survey", "summary.json");
    assert_string_equal(merged, sorted.data);
    assert_int_equal(roll_up(sorted.data, NULL, NULL), RX_OK);
    char *again = slurp("survey", "summary.json");
    assert_string_equal(page, again);
    add_record(&records, "m/b.fits", "b", 4, "NET");
    assert_int_equal(roll_up(records.data, keywords, &err), RX_INPUT);
    assert_string_equal(err.where, "m/b.fits");
    free(merged);
    free(page);
    free(again);
    rx_text_free(&records);
    rx_text_free(&sorted);
}

/* A page that one can look at, which says what it leaves out; the tables have everything. */
static void many_tiles(void **state)
{
    enum { MANY = 9000 };
    static const char *const page[] = {"200 of 3000 rows. All are in summary.json.",
                                       "200 of 9000 rows. All are in tiles.ecsv.", NULL};
    static const char *const keywords[] = {"QA_FIGURES", "Y", NULL};
    rx_text records = {0};
    long lines = 0;
    for (int i = 0; i < MANY; i++)
        rx_text_printf(&records,
                       "TILE t%d t%d\nVERSION 1\nSTATUS %d \"\"\nEXTENSION 0 9 9 %d %d 3 0 1 0\nRUN RL 9 "
                       "1\nBIN 96 10 9 9 9\nEND\n",
                       i, i, i % 3 == 0 ? 3 : 0, i % 100, i / 100);
    assert_int_equal(roll_up(records.data, keywords, NULL), RX_OK);
    holds("report.html", page);
    char *html = slurp("survey", "report.html"), *table = slurp("survey", "tiles.ecsv");
    if (strstr(html, "<svg") != NULL) /* there is gnuplot */
        assert_non_null(strstr(html, "A square is the mean of the images in a cell"));
    assert_true(strlen(html) < 800000);
    for (const char *c = table; *c != '\0'; c++)
        lines += *c == '\n';
    assert_true(lines > MANY);
    free(html);
    free(table);
    rx_text_free(&records);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sums_and_comparisons),
        cmocka_unit_test(a_range_of_magnitudes),
        cmocka_unit_test(a_bias_counts_by_its_error),
        cmocka_unit_test(psfs),
        cmocka_unit_test(whose_work_and_flux_scale),
        cmocka_unit_test(records_are_sorted_and_merged),
        cmocka_unit_test(many_tiles),
    };
    return cmocka_run_group_tests(tests, enter_scratch, leave_scratch);
}
