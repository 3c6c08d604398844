/* Reports: one table in JSON, ECSV, on the page and for the terminal; words that grow; pivots with holes. */
#include "../near.h"
#include "../scratch.h"

#include <math.h>

#include "report/report.h"

RX_COLUMNS(COLUMNS, {.name = "condition", .heading = "seeing"}, RX_TEXT("run", ""),
           RX_ESTIMATE("recall", 2, "", "share found"), RX_COUNT("n", ""),
           RX_MEASURED("p", 1, "", "and its error"), {.name = "verdict", .kind = RX_REPORT_VERDICT});
enum { NCOLUMNS = sizeof COLUMNS / sizeof *COLUMNS };

static const rx_report_view PIVOT = {.to = 3,
                                     .title = "recall",
                                     .rows = {"condition"},
                                     .across = {"run"},
                                     .value = "recall",
                                     .digits = 2,
                                     .in_brief = 1};

static void add(rx_report_table *t, const char *condition, const char *run, double recall,
                const char *verdict)
{
    rx_report_put(t, condition, run, ((rx_estimate){recall, recall - 0.1, INFINITY, 40}), 7,
                  rx_cell_measured(0, -2302.58509), verdict);
}

/* Two seeings, two runs, one of the four cells missing. */
static rx_report *make(rx_report_table **t)
{
    rx_report *r = rx_report_new("Test: ", "<b>&");
    assert_non_null(r);
    *t = rx_report_table_add(r, "cells", NCOLUMNS, COLUMNS, RX_REPORT_EVERYWHERE);
    rx_report_fact(r, "type", "a \"test\"");
    rx_report_fact(r, "nothing", NULL);
    rx_report_fact_number(r, "level", 0.95);
    rx_report_section(r, "lists", "Lists");
    add(*t, "FWHM 3", "NET", 0.5, "reproduced");
    add(*t, "FWHM 3", "a run of a longer name, <i>", 0.25, "FAIL");
    add(*t, "FWHM 5", "NET", NAN, "");
    return r;
}

static void write_report(void **state, rx_report *r, rx_text *brief)
{
    const rx_report_files files = {.folder = *state, .shown = "the report"};
    assert_int_equal(rx_report_write(r, &files, brief, NULL), RX_OK);
}

static void holds(void **state, const char *name, const char *const *words)
{
    char *text = NULL;
    const char *path = in(state, name);
    assert_int_equal(rx_text_read_file(path, 1 << 20, &text, NULL, NULL), RX_OK);
    for (; *words != NULL; words++)
        if (strstr(text, *words) == NULL)
            fail_msg("%s lacks %s:\n%s", name, *words, text);
    free(text);
}

static void one_table_in_all_files(void **state)
{
    static const char *const json[] = {
        "\"type\": \"a \\\"test\\\"\"",
        "\"nothing\": null",
        "\"level\": 0.95",
        "{\"condition\": \"FWHM 3\", \"run\": \"NET\", \"recall\": {\"value\": 0.5, \"low\": 0.4, \"high\": "
        "null, \"n\": 40}, \"n\": 7, \"p\": 0, \"p_error\": -2302.58509, \"verdict\": \"reproduced\"}",
        "\"recall\": {\"value\": null, \"low\": null, \"high\": null, \"n\": 40}, \"n\": 7, \"p\": 0, "
        "\"p_error\": -2302.58509, \"verdict\": null}",
        NULL};
    static const char *const ecsv[] = {
        "#   level: 0.95\n",
        "name: recall_high, datatype: float64, description: \"upper end",
        "condition,run,recall,recall_low,recall_high,recall_n,n,p,p_error,verdict\n",
        "\"FWHM 3\",\"NET\",0.5,0.4,inf,40,7,0,-2302.58509,\"reproduced\"\n",
        "\"a run of a longer name, <i>\",0.25,0.15,inf",
        NULL};
    static const char *const page[] = {
        "<h1>Test: &lt;b&gt;&amp;</h1>",
        "<nav aria-label=\"Sections\"><a href=\"#lists\">Lists</a></nav>",
        "<th scope=\"col\" class=\"t\">seeing</th><th scope=\"col\">NET</th><th scope=\"col\">a run of a "
        "longer name, &lt;i&gt;</th>",
        "<td class=\"t\">FWHM 3</td><td>0.50 <small>[0.40, &infin;] n=40</small></td><td>0.25 <small>",
        "<td class=\"t\">FWHM 5</td><td>&ndash; <small>[&ndash;, &infin;] n=40</small></td><td "
        "class=\"t\">&ndash;</td></tr>",
        "<td class=\"t PASS\"><b>reproduced</b></td>",
        "<td class=\"t FAIL\"><b>FAIL</b></td>",
        "<td>0.0 &plusmn; -2302.6</td>",
        NULL};
    rx_report_table *t;
    rx_report *r = make(&t);
    rx_text brief = {0};
    assert_int_equal(rx_report_rows(t), 3);
    rx_report_show(r, t, &PIVOT);
    rx_report_show(r, t, &(rx_report_view){.to = 3});
    write_report(state, r, &brief);
    rx_report_free(r);
    holds(state, "summary.json", json);
    holds(state, "cells.ecsv", ecsv);
    holds(state, "report.html", page);
    assert_string_equal(
        brief.data,
        "recall\n                                   NET a run of a longer name, <i>\nFWHM 3                  "
        "          0.50      0.25\nFWHM 5                               -         -\n");
    rx_text_free(&brief);
}

/* Only the file, or only summary.json. */
static void tables_stand_where_they_are_asked_for(void **state)
{
    static const char *const both[] = {"\"shown\": [\n    {\"word\": \"here\"}\n  ]", NULL};
    RX_COLUMNS(columns, RX_TEXT("word", ""));
    rx_report *r = rx_report_new("", "x");
    rx_report_put(RX_REPORT_TABLE(r, "shown", columns, RX_REPORT_IN_JSON), "here");
    rx_report_put(RX_REPORT_TABLE(r, "listed", columns, RX_REPORT_IN_FILE), "there");
    write_report(state, r, NULL);
    rx_report_free(r);
    holds(state, "summary.json", both);
    char *text = slurp(*state, "summary.json");
    assert_null(strstr(text, "there"));
    free(text);
    assert_int_equal(count_files(*state), 3); /* the page, summary.json, listed.ecsv */
}

/* Rows by the hundred; YAML takes the name of a column for a truth value unless it is quoted. */
static void tables_grow(void **state)
{
    RX_COLUMNS(columns, RX_TEXT("word", ""), RX_COUNT("off", ""));
    static const char *const ecsv[] = {"# - {name: 'off', datatype: int64, description: \"\"}\n",
                                       "word,off\n\"\",0\n\"a \"\"b\"\", c\",1\n",
                                       "\"\",498\n\"a \"\"b\"\", c\",499\n", NULL};
    rx_report *r = rx_report_new("", "x");
    rx_report_table *t = rx_report_table_add(r, "t", 2, columns, RX_REPORT_IN_FILE);
    for (int k = 0; k < 500; k++)
        rx_report_put(t, k % 2 ? "a \"b\", c" : NULL, k);
    write_report(state, r, NULL);
    rx_report_free(r);
    holds(state, "t.ecsv", ecsv);
}

/* One row a run, turned: a line for each column that says something, with its help; a link, a value with its error. A
 * pivot whose rows are numbers, those that say nothing left out. In the terminal columns are as wide as their words. */
static void tables_turned(void **state)
{
    RX_COLUMNS(columns, RX_TEXT("run", ""), {"flux", RX_REPORT_MEASURED, 2, "adu", "of all <b>", "light"},
               {.name = "list", .kind = RX_REPORT_FILE}, RX_NUMBER("nothing", 0, "", ""),
               RX_NUMBER("mag", -4, "mag", ""), RX_ESTIMATE("share", -2, "", ""));
    static const char *const page[] = {
        "<tr><th scope=\"col\" class=\"t\">run</th><th scope=\"col\" class=\"t\">what it is</th><th "
        "scope=\"col\">NET</th><th scope=\"col\">RL</th></tr>\n<tr class=\"u\"><th scope=\"row\" "
        "class=\"t\">light [adu]</th><td class=\"t\">of all &lt;b&gt;</td><td>1.50 &plusmn; "
        "0.25</td><td>2.50</td></tr>\n<tr class=\"u\"><th scope=\"row\" class=\"t\">list</th><td "
        "class=\"t\">&ndash;</td><td class=\"t\"><a href=\"a.ecsv\">a.ecsv</a></td>",
        "<th scope=\"col\">mag [mag]</th><th scope=\"col\">NET</th><th "
        "scope=\"col\">RL</th></tr>\n<tr><td>18.25</td><td>0.5 <small>[0.25, 0.75] n=4</small></td><td "
        "class=\"t\">&ndash;</td></tr>\n</table>",
        NULL};
    static const char *const ecsv[] = {
        "# meta:\n#   of: \"a \\\"t\\\"\"\n",
        "run,flux,flux_error,list,nothing,mag,share,share_low,share_high,share_n\n",
        "\"NET\",1.5,0.25,\"a.ecsv\",nan,18.25,0.5,0.25,0.75,4\n", NULL};
    static const char *const names[] = {"run", "mag", "share"};
    const rx_estimate none = {NAN, NAN, NAN, 0};
    rx_text brief = {0};
    rx_report *r = rx_report_new("", "x");
    rx_report_table *t = rx_report_table_add(r, "t", 6, columns, RX_REPORT_EVERYWHERE);
    rx_report_table_fact(t, "of", "a \"t\"");
    rx_report_put(t, "NET", rx_cell_measured(1.5, 0.25), "a.ecsv", NAN, 18.25,
                  ((rx_estimate){0.5, 0.25, 0.75, 4}));
    rx_report_put(t, "RL", rx_cell_measured(2.5, NAN), "", NAN, 19, none);
    rx_report_show(r, t, &(rx_report_view){.turned = 1, .without_empty = 1});
    rx_report_show(
        r, t,
        &(rx_report_view){
            .rows = {"mag"}, .across = {"run"}, .value = "share", .digits = -2, .without_empty = 1});
    rx_report_show(
        r, t, &(rx_report_view){.in_brief = RX_BRIEF_ALONE, .ncolumns = 3, .columns = names, .intervals = 1});
    write_report(state, r, &brief);
    rx_report_free(r);
    holds(state, "report.html", page);
    holds(state, "t.ecsv", ecsv);
    assert_string_equal(brief.data, "run    mag                 share\nNET  18.25  0.5 [0.25, 0.75] n=4\nRL  "
                                    "    19                     -\n");
    rx_text_free(&brief);
}

/* What a page leaves out of the rows as they are: those beyond `most`, columns that say nothing; a long whole
 * number keeps its digits. */
static void what_a_page_leaves_out(void **state)
{
    static const char *const page[] = {
        "<tr><th scope=\"col\" class=\"t\">word</th><th scope=\"col\">n</th></tr>\n<tr><td "
        "class=\"t\">a</td><td>12345678901</td></tr>\n<tr><td "
        "class=\"t\">&ndash;</td><td>1</td></tr>\n</table></div>\n<p class=\"r\">2 of 3 rows. All are in "
        "t.ecsv.</p>",
        "<pre>two\n&lt;lines&gt;\n</pre>", NULL};
    static const char *const json[] = {"\"n\": 12345678901, ", NULL};
    RX_COLUMNS(columns, RX_TEXT("word", ""), RX_TEXT("nothing", ""), RX_COUNT("n", ""),
               RX_NUMBER("value", 1, "", ""), RX_ESTIMATE("share", 1, "", ""),
               {.name = "verdict", .kind = RX_REPORT_VERDICT});
    rx_report *r = rx_report_new("", "x");
    rx_report_table *t = rx_report_table_add(r, "t", 6, columns, RX_REPORT_EVERYWHERE);
    for (int k = 0; k < 3; k++)
        rx_report_put(t, k == 0 ? "a" : NULL, k < 2 ? "" : "b", k == 0 ? 12345678901.0 : k, k < 2 ? NAN : 1,
                      ((rx_estimate){NAN, 0, 1, k < 2 ? 0 : 1}), k < 2 ? "" : "PASS");
    rx_report_show(r, t, &(rx_report_view){.to = 3, .most = 2, .without_empty = 1});
    rx_report_lines(r, "two\n<lines>\n");
    const rx_report_files files = {.folder = *state, .shown = "the report", .page = "other.html"};
    assert_int_equal(rx_report_write(r, &files, NULL, NULL), RX_OK);
    rx_report_free(r);
    holds(state, "other.html", page);
    holds(state, "summary.json", json);
}

/* Numbers and values with errors as readers want them; what is hostile comes out as text. */
static void numbers_as_readers_want_them(void **state)
{
    RX_COLUMNS(columns, RX_NUMBER("a", 2, "", ""), RX_NUMBER("b", 0, "", ""), RX_MEASURED("m", 2, "", ""),
               RX_ESTIMATE("e", 1, "", ""));
    static const char *const page[] = {
        "<tr><td>1.00</td><td>12345678</td><td>1.25 &plusmn; 0.50</td><td>0.0 <small>[0.0, 2.5] "
        "n=0</small></td></tr>",
        "<tr><td>0.00</td><td>&minus;&infin;</td><td>1.25</td><td>0.5 <small>[0.2, &infin;] "
        "n=7</small></td></tr>",
        "<tr><td>1.23e+07</td><td>&ndash;</td><td>&ndash;</td><td>&ndash;</td></tr>", NULL};
    const rx_estimate none = {NAN, 0, 1, 0}, half = {0.5, 0.24, INFINITY, 7}, zero = {0, 0, 2.5, 0};
    rx_report *r = rx_report_new("", "x");
    rx_report_table *t = RX_REPORT_TABLE(r, "t", columns, RX_REPORT_IN_JSON);
    rx_report_put(t, 1.005, 12345678, rx_cell_measured(1.25, 0.5), zero);
    rx_report_put(t, -0.0004, -INFINITY, rx_cell_measured(1.25, NAN), half);
    rx_report_put(t, 12345678, NAN, rx_cell_measured(NAN, 0.5), none);
    rx_report_show(r, t, RX_VIEW(.from = 0));
    write_report(state, r, NULL);
    rx_report_free(r);
    holds(state, "report.html", page);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(one_table_in_all_files, make_scratch, remove_scratch),
        cmocka_unit_test_setup_teardown(tables_stand_where_they_are_asked_for, make_scratch, remove_scratch),
        cmocka_unit_test_setup_teardown(tables_grow, make_scratch, remove_scratch),
        cmocka_unit_test_setup_teardown(tables_turned, make_scratch, remove_scratch),
        cmocka_unit_test_setup_teardown(what_a_page_leaves_out, make_scratch, remove_scratch),
        cmocka_unit_test_setup_teardown(numbers_as_readers_want_them, make_scratch, remove_scratch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
