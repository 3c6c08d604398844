/* A survey of three tiles worked out by hand. */
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

#include "survey/rollup.h"
#include "survey/rollup_report.h"

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
    "BIN 96 100 90 95 90 244:45 245:45\nRUN RL 7 0\nEND\n"
    "TILE d.fits d\nVERSION 1\nSTATUS 3 \"cannot be opened\"\nEND\n";

typedef struct survey {
    rx_tile_records records;
    rx_tiles *tiles;
    rx_settings *settings;
    rx_rollup rollup;
} survey;

static void write_file(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    assert_true(fputs(text, file) >= 0);
    assert_int_equal(fclose(file), 0);
}

static void make(survey *s, const char *range)
{
    char path[] = "/tmp/rextract-rollup-XXXXXX";
    int file = mkstemp(path);
    assert_true(file >= 0);
    close(file);
    *s = (survey){0};
    write_file(path, records_text);
    assert_int_equal(rx_tile_records_read(&s->records, path, NULL), RX_OK);
    assert_int_equal(rx_tile_records_settle(&s->records, NULL), RX_OK);
    write_file(path, "e.fits\na.fits\nx/b.fits\nd.fits\n");
    assert_int_equal(rx_tiles_read(path, &s->tiles, NULL), RX_OK);
    assert_int_equal(rx_settings_new(rx_keytable_survey(), &s->settings, NULL), RX_OK);
    assert_int_equal(rx_settings_set(s->settings, "MAG_RANGE", range, NULL, NULL), RX_OK);
    assert_int_equal(rx_rollup_make((rx_survey_config *)s->settings, &s->records, s->tiles, &s->rollup, NULL),
                     RX_OK);
    unlink(path);
}

static void drop(survey *s)
{
    rx_rollup_free(&s->rollup);
    rx_settings_free(s->settings);
    rx_tiles_free(s->tiles);
    rx_tile_records_free(&s->records);
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
    assert_float_equal(r->run[0].whole.recall.value, 230.0 / 310, 1e-12);
    assert_float_equal(r->run[0].whole.precision.value, 230.0 / 240, 1e-12);
    assert_float_equal(r->run[0].bin[96].recall.value, 230.0 / 300, 1e-12);
    assert_int_equal(r->run[0].whole.pairs, 230);
    /* half of the pairs are in the step from -0.005 to 0, half in the one from 0: the median lies between */
    assert_float_equal(r->run[0].whole.bias, 0, 1e-9);
    assert_float_equal(r->run[0].whole.scatter, 1.4826 * 0.0025, 1e-9);
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
    assert_string_equal(s.rollup.row[0].record->name, "c");
    assert_string_equal(s.rollup.row[1].record->name, "c");
    assert_string_equal(s.rollup.row[1].run->name, "RL");
    assert_true(isnan(s.rollup.row[1].off));
    assert_string_equal(s.rollup.row[2].record->name, "b");
    assert_string_equal(s.rollup.row[2].what, "recall");
    const double p = 230.0 / 310;
    assert_float_equal(s.rollup.row[2].off, (p - 50.0 / 110) / sqrt(p * (1 - p) / 110), 1e-9);
    assert_string_equal(s.rollup.row[3].record->name, "a");
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
    survey s;
    rx_text junit = {0}, json = {0}, html = {0};
    rx_figures *figures = calloc(1, sizeof *figures);
    (void)state;
    assert_non_null(figures);
    make(&s, "0,0");
    rx_rollup_junit(&junit, &s.rollup);
    assert_non_null(strstr(junit.data, "tests=\"6\" failures=\"1\" errors=\"3\" skipped=\"0\""));
    assert_non_null(strstr(junit.data, "<failure message=\"a &lt;gate&gt; &amp; FAILED\"/>"));
    rx_rollup_json(&json, &s.rollup);
    assert_non_null(strstr(json.data, "\"without_record\": 2"));
    rx_rollup_html(&html, &s.rollup, figures);
    assert_non_null(strstr(html.data, "a &lt;gate&gt; &amp; FAILED"));
    assert_null(strstr(html.data, "<gate>"));
    assert_false(junit.failed || json.failed || html.failed);
    rx_text_free(&junit);
    rx_text_free(&json);
    rx_text_free(&html);
    free(figures);
    drop(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sums),
        cmocka_unit_test(worst_come_first),
        cmocka_unit_test(a_range_of_magnitudes),
        cmocka_unit_test(files_for_programs),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
