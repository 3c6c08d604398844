/* Pages, figures, JSON and ECSV: what any report is put together from. */
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
#include "report/curves.h"
#include "report/ecsv.h"
#include "report/figure.h"
#include "report/json.h"
#include "report/page.h"
#include "report/report_file.h"

#define HOSTILE "</td><script>alert('x')</script>\"\\\n\xff"

/* What `write` adds, compared and freed. */
static void assert_text(rx_text *text, const char *expected)
{
    assert_false(text->failed);
    assert_string_equal(text->data, expected);
    rx_text_free(text);
}

static void numbers_as_readers_want_them(void **state)
{
    static const struct {
        double value;
        int digits;
        const char *text;
    } numbers[] = {
        {1.005, 2, "1.00"},        {-0.0004, 2, "0.00"},      {-0.5, 1, "-0.5"},
        {NAN, 2, "&ndash;"},       {INFINITY, 2, "&infin;"},  {-INFINITY, 0, "&minus;&infin;"},
        {12345678, 2, "1.23e+07"}, {12345678, 0, "12345678"},
    };
    static const struct {
        double p, ln_p;
        const char *text;
    } ps[] = {
        {1, 0, "1"},
        {0.04567, -3.0863, "0.046"},
        {0.001, -6.907755, "0.001"},
        {5.96e-38, -85.71324, "6.0&middot;10<sup>&minus;38</sup>"},
        {9.97e-7, -13.8185, "1.0&middot;10<sup>&minus;6</sup>"},
        {0, -5000, "3.4&middot;10<sup>&minus;2172</sup>"},
        {0, -INFINITY, "&lt;10<sup>&minus;307</sup>"},
        {NAN, NAN, "&ndash;"},
    };
    (void)state;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        rx_text text = {0};
        rx_page_number(&text, numbers[i].value, numbers[i].digits);
        assert_text(&text, numbers[i].text);
    }
    for (size_t i = 0; i < sizeof ps / sizeof *ps; i++) {
        rx_text text = {0};
        rx_page_p(&text, ps[i].p, ps[i].ln_p);
        assert_text(&text, ps[i].text);
    }
    rx_text text = {0};
    rx_page_cell_estimate(&text, &(rx_estimate){0.5, 0.25, INFINITY, 7}, 2);
    assert_text(&text, "<td>0.50 <small>[0.25, &infin;] n=7</small></td>");
    rx_page_cell_estimate(&text, &(rx_estimate){NAN, 0, 1, 0}, 2);
    assert_text(&text, "<td>&ndash;</td>");
    rx_page_cell_estimate(&text, &(rx_estimate){0, 0, 2.5, 0}, 1); /* a rate of which no event was seen */
    assert_text(&text, "<td>0.0 <small>[0.0, 2.5] n=0</small></td>");
    rx_page_cell_measured(&text, 1.25, 0.5, 2);
    assert_text(&text, "<td>1.25 &plusmn; 0.50</td>");
    rx_page_cell_measured(&text, 0.000123456, NAN, -4);
    assert_text(&text, "<td>0.0001235</td>");
}

/* A page with everything on it, given hostile text. */
static void write_page(rx_text *page, const rx_figures *figures)
{
    static const char *const record[][2] = {{"SEED", "1"}, {HOSTILE, HOSTILE}};
    rx_page_begin(page, "Campaign: ", HOSTILE);
    rx_page_links_begin(page);
    rx_page_link(page, true, "tables", HOSTILE);
    rx_page_link(page, false, "nowhere", "nothing");
    rx_page_links_end(page);
    rx_page_section(page, "tables", HOSTILE);
    rx_page_heading(page, HOSTILE, HOSTILE);
    rx_page_table_begin(page);
    rx_page_row(page, NULL);
    rx_page_head(page, RX_LEFT, HOSTILE, NULL);
    rx_page_head(page, RX_RIGHT, HOSTILE, HOSTILE);
    rx_page_row_end(page);
    rx_page_row(page, RX_MARK_PALE);
    rx_page_cell_text(page, HOSTILE);
    rx_page_cell_text(page, "");
    rx_page_cell_count(page, 12);
    rx_page_cell_verdict(page, RX_MARK_GOOD, HOSTILE);
    rx_page_cell_file(page, HOSTILE);
    rx_page_cell_title(page, HOSTILE, HOSTILE);
    rx_page_row_end(page);
    rx_page_table_end(page);
    rx_page_paragraph(page, "said");
    rx_page_note(page, "told");
    rx_page_figures(page, figures, "");
    rx_page_record(page, 2, record);
    rx_page_end(page);
}

static void pages_are_whole(void **state)
{
    rx_text page = {0};
    static rx_figures figures;
    char folder[512], command[1024];
    rx_error err = RX_ERROR_NONE;
    (void)state;
    rx_figures_begin(&figures);
    rx_figure_add(&figures, "one", HOSTILE, HOSTILE, RX_FIGURE_CHART);
    write_page(&page, &figures);
    assert_false(page.failed);
    assert_null(strstr(page.data, "<script"));
    assert_null(strchr(page.data, '\xff'));
    assert_null(strstr(page.data, "nowhere"));
    assert_non_null(strstr(page.data, "not drawn"));
    assert_non_null(strstr(page.data, "<tr class=\"pale\">"));
    new_folder(folder);
    assert_int_equal(rx_report_file(folder, "the report", "page.html", &page, &err), RX_OK);
    assert_null(page.data);
    if (works("xmllint --version 2>/dev/null")) {
        snprintf(command, sizeof command,
                 "xmllint --html --noout %s/page.html 2>&1 | grep -v 'Tag .* invalid' "
                 "| grep -q 'error' && exit 1 || exit 0",
                 folder);
        assert_int_equal(system(command), 0);
    } else {
        print_message("xmllint is absent: the page not parsed\n");
    }
    clear_folder(folder);
    rx_text_add(&page, "x");
    assert_int_equal(rx_report_file(folder, "the report", "page.html", &page, &err), RX_SYSTEM);
    assert_string_equal(err.where, "the report/page.html");
    assert_null(page.data);
    rx_figures_free(&figures);
}

/* Points beyond the room of a curve move with it; lines to compare with alone are no figure. */
static void curves_grow(void **state)
{
    (void)state;
    rx_figures figures;
    rx_curves c = {0};
    const rx_axes axes = {.x1 = 1, .y1 = 1};
    rx_figures_begin(&figures);
    rx_curves_add(&c, RX_CURVE_LINE, -1, NULL);
    rx_curves_put(&c, 0, 0, NAN, NAN);
    rx_curves_figure(&figures, "none", "", "", &axes, &c);
    assert_int_equal(figures.n, 0);
    for (int k = 0; k < 2; k++) {
        rx_curves_add(&c, RX_CURVE_BARS, k, "x");
        for (int i = 0; i < 100; i++)
            rx_curves_put(&c, i, k, i - 1, i + 1);
    }
    assert_int_equal(c.points, 200);
    for (int k = 0; k < 2; k++)
        for (int i = 0; i < 100; i++) {
            assert_near(c.curve[k].x[i], i, 0);
            assert_near(c.curve[k].y[i], k, 0);
            assert_near(c.curve[k].low[i], i - 1, 0);
            assert_near(c.curve[k].high[i], i + 1, 0);
        }
    rx_curves_figure(&figures, "two", "", "", &axes, &c);
    assert_int_equal(figures.n, 1);
    assert_int_equal(c.n, 0);
    assert_false(figures.script.failed);
    rx_figures_free(&figures);
}

enum { GROUPS = 13, METHODS = 3, POINTS = 5000 };

static void add_boxes(rx_figures *f, const char *id, int groups, int filled, rx_figure_kind kind, bool log_y)
{
    static const char *const names[GROUPS] = {"2-3",
                                              "3-4",
                                              "4-5",
                                              "5-6",
                                              "6-7",
                                              "7-8",
                                              "8-9",
                                              "9-10",
                                              "10-11",
                                              "11-12",
                                              "12-13",
                                              "it's",
                                              "a very long name"};
    static const char *const methods[METHODS] = {"BLURRED", "RL", "RL 'filtered'"};
    static const int colors[METHODS] = {5, 0, 9};
    rx_five_numbers box[GROUPS * METHODS] = {0};
    for (int i = 0; i < groups * METHODS && filled; i++)
        if (i != 4)
            box[i] = (rx_five_numbers){1 + i, 2 + i, 3 + i, 4 + i, 6 + i, 70, 0, 3.5 + i};
    rx_figure_add(f, id, "Boxes", "reading", kind);
    rx_plot_boxes(f, &(rx_axes){.xlabel = "FWHM's [pixels]", .ylabel = "PSNR [dB]", .log_y = log_y},
                  &(rx_boxes){groups, METHODS, names, methods, colors, box});
}

static void add_curves(rx_figures *f, const char *id, int n, bool log_y)
{
    static double x[POINTS], y[POINTS], low[POINTS], high[POINTS];
    rx_curve curve[8];
    for (int i = 0; i < n; i++) {
        x[i] = 10.0 * i / n;
        y[i] = exp(-x[i]);
        low[i] = 0.5 * y[i];
        high[i] = i == 1 ? INFINITY : 2 * y[i];
    }
    if (n > 3)
        y[3] = NAN;
    int most = 0;
    for (int k = 0; k < 8; k++)
        if (n < POINTS || k % 7 == RX_CURVE_LINE || k == RX_CURVE_STEPS || k == RX_CURVE_DOTS)
            curve[most++] =
                (rx_curve){k == 3 ? "" : "it's", (rx_curve_kind)(k % 7), k - 1, k % 2, n, x, y, low, high};
    rx_figure_add(f, id, "Curves", "", RX_FIGURE_CHART);
    rx_plot_curves(f, &(rx_axes){"x", "y\n'", 0, 10, log_y ? 1e-6 : 0, 1, false, log_y}, n < 0 ? 0 : most,
                   curve);
}

static void add_picture(rx_figures *f, const char *id, double soft)
{
    float pixels[12 * 8];
    for (int i = 0; i < 12 * 8; i++)
        pixels[i] = (float)i;
    pixels[5] = NAN;
    rx_figure_add(f, id, "Picture", "", RX_FIGURE_PICTURE);
    rx_plot_picture(
        f, &(rx_grey_image){
               .width = 12, .height = 8, .side = 200, .pixels = pixels, .low = 0, .high = 95, .soft = soft});
}

/* A line that comes from below the plot and goes out above it. */
static void add_crossing(rx_figures *f)
{
    static const double x[] = {0, 10}, y[] = {-1, 2};
    rx_figure_add(f, "crossing", "Crossing", "", RX_FIGURE_CHART);
    rx_plot_curves(f, &(rx_axes){"x", "y", 0, 10, 0, 1, false, false}, 1,
                   &(rx_curve){"", RX_CURVE_LINE, 0, false, 2, x, y, NULL, NULL});
}

static void add_all(rx_figures *f)
{
    rx_figures_begin(f);
    add_boxes(f, "box-wide", GROUPS, 1, RX_FIGURE_WIDE, false);
    add_boxes(f, "box-log", 4, 1, RX_FIGURE_CHART, true);
    add_boxes(f, "box-none", 4, 0, RX_FIGURE_CHART, false);
    add_boxes(f, "box-log-none", 4, 0, RX_FIGURE_CHART, true);
    add_picture(f, "picture-linear", 0);
    add_picture(f, "picture-soft", 10);
    add_curves(f, "curves", 40, false);
    add_curves(f, "curves-log", 40, true);
    add_curves(f, "curves-many", POINTS, false);
    add_curves(f, "curves-empty", 0, false);
    add_curves(f, "curves-nothing", -1, true);
    add_crossing(f);
}

static rx_status draw(rx_figures *f, const char *program, const char *folder, const char *shown,
                      rx_error *err)
{
    const rx_status status = rx_figures_start(f, program, folder, shown, err);
    return status == RX_OK ? rx_figures_finish(f, program, err) : status;
}

static void figures_are_drawn(void **state)
{
    static rx_figures first, second;
    char folder[512];
    (void)state;
    if (!works("gnuplot --version >/dev/null 2>&1")) {
        print_message("gnuplot is absent: figures not drawn\n");
        skip();
    }
    new_folder(folder);
    add_all(&first);
    add_all(&second);
    assert_int_equal(draw(&first, NULL, folder, "the report", NULL), RX_OK);
    assert_int_equal(draw(&second, "", folder, "the report", NULL), RX_OK);
    assert_int_equal(clear_folder(folder), 0);
    assert_string_equal(first.note, "");
    assert_int_equal(first.n, 12);
    for (int i = 0; i < first.n; i++) {
        const rx_figure *f = &first.figure[i];
        char id[64];
        assert_non_null(f->svg);
        assert_non_null(strstr(f->svg, "</svg>"));
        assert_null(strstr(f->svg, "GNUPLOT"));
        assert_null(strstr(f->svg, "onmouse"));
        assert_null(strstr(f->svg, "fill=\"#ffffff\"")); /* the ground of the page is theirs */
        assert_null(strstr(f->svg, "black"));
        snprintf(id, sizeof id, "id=\"%s-", f->id); /* names differ from figure to figure */
        assert_true(f->kind == RX_FIGURE_PICTURE || strstr(f->svg, id) != NULL);
        assert_string_equal(f->svg, second.figure[i].svg);
        assert_true((f->kind == RX_FIGURE_PICTURE) == (strstr(f->svg, "<image") != NULL));
    }
    assert_non_null(strstr(first.figure[0].svg, "FWHM's [pixels]"));
    assert_non_null(strstr(first.figure[0].svg, "PSNR [dB]"));
    assert_null(strstr(first.figure[0].svg, "filtered'")); /* names are made plain */
    assert_non_null(
        strstr(first.figure[6].svg, "<g class=\"h\"><title>its: x 0.5, y 0.6065 [0.3033, 1]</title>"));
    assert_null(strstr(first.figure[8].svg, "class=\"h\"")); /* of many points none */
    assert_non_null(strstr(first.figure[11].svg, "#0072B2"));
    size_t dots = 0; /* thinned: 2000 of the 5000 at most, and the last one */
    for (const char *c = first.figure[8].svg; (c = strstr(c, "h0")) != NULL; c++)
        dots++;
    assert_in_range(dots, 1000, 2002);
    rx_figures_free(&first);
    rx_figures_free(&second);
}

static void figures_that_cannot_be(void **state)
{
    static rx_figures f;
    char folder[512];
    rx_error err = RX_ERROR_NONE;
    (void)state;
    new_folder(folder);
    add_all(&f);
    assert_int_equal(draw(&f, "no-such-gnuplot", folder, "the report", &err), RX_OK);
    assert_non_null(strstr(f.note, "no-such-gnuplot"));
    rx_text page = {0};
    rx_page_figures(&page, &f, "");
    assert_non_null(strstr(page.data, "No figures"));
    rx_text_free(&page);
    rx_figures_free(&f);
    rx_figures_begin(&f);
    for (int i = 0; i <= RX_FIGURES_MAX; i++)
        rx_figure_add(&f, "again", "", "", RX_FIGURE_CHART);
    assert_int_equal(f.n, RX_FIGURES_MAX);
    assert_int_equal(draw(&f, NULL, folder, "the report", &err), RX_SYSTEM);
    rx_figures_free(&f);
    assert_int_equal(clear_folder(folder), 0);
    add_all(&f);
    assert_int_equal(draw(&f, NULL, folder, "the report", &err), RX_SYSTEM);
    assert_string_equal(err.where, "the report");
    rx_figures_free(&f);
}

static void json_to_the_byte(void **state)
{
    static const double values[] = {1, NAN, 0.1};
    static const char *const record[][2] = {{"SEED", "1"}};
    rx_text text = {0};
    rx_json json = rx_json_on(&text);
    (void)state;
    rx_json_object(&json, NULL, false);
    rx_json_string(&json, "text", "a\"b\\\n");
    rx_json_string(&json, "none", NULL);
    rx_json_count(&json, "seed", UINT64_MAX);
    rx_json_array(&json, "list", false);
    rx_json_object(&json, NULL, true);
    rx_json_number(&json, "x", -0.0);
    rx_json_numbers(&json, "values", 3, values);
    rx_json_end(&json);
    rx_json_estimate(&json, NULL, &(rx_estimate){0.5, 0.25, INFINITY, 7});
    rx_json_end(&json);
    rx_json_array(&json, "empty", false);
    rx_json_end(&json);
    rx_json_record(&json, 1, record);
    rx_json_end(&json);
    assert_text(&text, "{\n"
                       "  \"text\": \"a\\\"b\\\\\xEF\xBF\xBD\",\n"
                       "  \"none\": null,\n"
                       "  \"seed\": 18446744073709551615,\n"
                       "  \"list\": [\n"
                       "    {\"x\": 0, \"values\": [1, null, 0.1]},\n"
                       "    {\"value\": 0.5, \"low\": 0.25, \"high\": null, \"n\": 7}\n"
                       "  ],\n"
                       "  \"empty\": [],\n"
                       "  \"record\": [\n"
                       "    {\"name\": \"SEED\", \"value\": \"1\"}\n"
                       "  ]\n"
                       "}\n");
    json = rx_json_on(&text);
    rx_json_end(&json);
    assert_true(text.failed);
    rx_text_free(&text);
    text = (rx_text){0};
    json = rx_json_on(&text);
    for (int i = 0; i <= RX_JSON_DEPTH; i++)
        rx_json_array(&json, NULL, true);
    assert_true(text.failed);
    rx_text_free(&text);
}

static void ecsv_to_the_byte(void **state)
{
    rx_text text = {0};
    rx_ecsv table = rx_ecsv_on(&text);
    (void)state;
    rx_ecsv_meta(&table, "tile", "a\"b");
    rx_ecsv_meta_number(&table, "level", 0.95);
    rx_ecsv_column(&table, "name", RX_ECSV_TEXT, "", "of the method");
    rx_ecsv_column(&table, "kind", RX_ECSV_TEXT, "", "a word");
    rx_ecsv_column(&table, "n", RX_ECSV_LONG, "", "number");
    rx_ecsv_column(&table, "off", RX_ECSV_LONG, "", "no switch");
    rx_ecsv_column(&table, "psnr", RX_ECSV_FLOAT, "dB", "mean");
    rx_ecsv_column(&table, "high", RX_ECSV_FLOAT, "dB", "");
    rx_ecsv_columns_end(&table);
    rx_ecsv_text(&table, "R\"L, 1");
    rx_ecsv_text(&table, "tuned");
    rx_ecsv_count(&table, 3);
    rx_ecsv_count(&table, 0);
    rx_ecsv_number(&table, NAN);
    rx_ecsv_number(&table, INFINITY);
    rx_ecsv_row_end(&table);
    assert_text(&text,
                "# %ECSV 1.0\n# ---\n# delimiter: ','\n# meta:\n#   tile: \"a\\\"b\"\n#   level: 0.95\n"
                "# datatype:\n"
                "# - {name: name, datatype: string, description: \"of the method\"}\n"
                "# - {name: kind, datatype: string, description: \"a word\"}\n"
                "# - {name: n, datatype: int64, description: \"number\"}\n"
                "# - {name: 'off', datatype: int64, description: \"no switch\"}\n"
                "# - {name: psnr, datatype: float64, unit: 'dB', description: \"mean\"}\n"
                "# - {name: high, datatype: float64, unit: 'dB', description: \"\"}\n"
                "# schema: astropy-2.0\nname,kind,n,off,psnr,high\n"
                "\"R\"\"L, 1\",\"tuned\",3,0,nan,inf\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_as_readers_want_them),
        cmocka_unit_test(pages_are_whole),
        cmocka_unit_test(curves_grow),
        cmocka_unit_test(figures_are_drawn),
        cmocka_unit_test(figures_that_cannot_be),
        cmocka_unit_test(json_to_the_byte),
        cmocka_unit_test(ecsv_to_the_byte),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
