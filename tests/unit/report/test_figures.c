/* Figures: drawn by gnuplot, made fit for a page, and what becomes of those that cannot be drawn. */
#include "../near.h"
#include "../scratch.h"

#include <math.h>

#include "report/figure.h"

enum { GROUPS = 4, METHODS = 3, POINTS = 5000 };

static void add_boxes(rx_figures *f, const char *id, int groups, int filled, rx_figure_kind kind)
{
    static const char *const names[GROUPS] = {"a long name of a group", "another long name", "it's",
                                              "a third one, as long as these"};
    static const char *const methods[METHODS] = {"BLURRED", "RL", "RL 'filtered'"};
    static const int colors[METHODS] = {5, 0, 9};
    rx_five_numbers box[GROUPS * METHODS] = {0};
    for (int i = 0; i < groups * METHODS && filled; i++)
        if (i != 4)
            box[i] = (rx_five_numbers){1 + i, 2 + i, 3 + i, 4 + i, 6 + i, 3.5 + i, 70};
    rx_figure_add(f, id, "Boxes", "reading", kind);
    rx_plot_boxes(f, &(rx_axes){.xlabel = "FWHM's [pixels]", .ylabel = "PSNR [dB]"},
                  &(rx_boxes){groups, METHODS, names, methods, colors, box});
}

static void add_curves(rx_figures *f, const char *id, int n, bool log_y)
{
    rx_curves c = {0};
    for (int k = 0; k < 8; k++) {
        if (n == POINTS && k % 7 != RX_CURVE_LINE && k != RX_CURVE_STEPS && k != RX_CURVE_DOTS)
            continue;
        rx_curves_add(&c, (rx_curve_kind)(k % 7), k - 1, k == 3 ? "" : "it's");
        for (int i = 0; i < n; i++) {
            const double y = exp(-10.0 * i / n);
            rx_curves_put(&c, 10.0 * i / n, i == 3 ? NAN : y, 0.5 * y, i == 1 ? INFINITY : 2 * y);
        }
    }
    rx_curves_figure(f, id, "Curves", "", &(rx_axes){"x", "y\n'", 0, 10, log_y ? 1e-6 : 0, 1, false, log_y},
                     &c);
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

/* A line that comes from below the plot and goes out above it; lines to compare with alone are no figure. */
static void add_crossing(rx_figures *f)
{
    rx_curves c = {0};
    rx_curves_add(&c, RX_CURVE_LINE, 0, "");
    rx_curves_put(&c, 0, -1, NAN, NAN);
    rx_curves_put(&c, 10, 2, NAN, NAN);
    rx_curves_figure(f, "crossing", "Crossing", "", &(rx_axes){"x", "y", 0, 10, 0, 1, false, false}, &c);
    rx_curves_reference(&c, 0, 0, 1, 1);
    rx_curves_figure(f, "none", "", "", &(rx_axes){"x", "y", 0, 10, 0, 1, false, false}, &c);
}

static void add_all(rx_figures *f)
{
    rx_figures_begin(f);
    add_boxes(f, "box-wide", GROUPS, 1, RX_FIGURE_WIDE);
    add_boxes(f, "box-none", 4, 0, RX_FIGURE_CHART);
    add_picture(f, "picture-linear", 0);
    add_picture(f, "picture-soft", 10);
    add_curves(f, "curves", 40, false);
    add_curves(f, "curves-log", 40, true);
    add_curves(f, "curves-many", POINTS, false);
    add_crossing(f);
}

static rx_status draw(rx_figures *f, const char *program, const char *folder, const char *shown,
                      rx_error *err)
{
    const rx_status status = rx_figures_start(f, program, folder, shown, err);
    return status == RX_OK ? rx_figures_finish(f, err) : status;
}

static void figures_are_drawn(void **state)
{
    static rx_figures first, second;
    char folder[512];
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
    assert_int_equal(first.n, 8);
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
    assert_non_null(strstr(first.figure[7].svg, "#0072B2"));
    size_t dots = 0; /* thinned: 2000 of the 5000 at most, and the last one */
    for (const char *c = first.figure[6].svg; (c = strstr(c, "h0")) != NULL; c++)
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
    new_folder(folder);
    add_all(&f);
    assert_int_equal(draw(&f, "no-such-gnuplot", folder, "the report", &err), RX_OK);
    assert_non_null(strstr(f.note, "no-such-gnuplot"));
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(figures_are_drawn),
                                       cmocka_unit_test(figures_that_cannot_be)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
