/* Figures: one script for gnuplot, run once, and its SVG files made fit for a page. */
#include "report/figure.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/memory.h"
#include "io/output.h"
#include "report/escape.h"
#include "report/gnuplot.h"

enum { MAX_SVG = 64 << 20 };
static const char TERMINAL[] =
    "set terminal svg size %d,%d dynamic noenhanced font 'Helvetica,13' background '#ffffff'\n";

static void write_head(rx_text *dst)
{
    static const char *const colors[RX_PALETTE] = {"0072B2", "D55E00", "009E73", "CC79A7",
                                                   "E69F00", "56B4E9", "000000"};
    static const int points[RX_PALETTE] = {7, 5, 9, 13, 11, 6, 4};
    rx_text_add(dst, "set encoding utf8\nset grid lc rgb '#e4e4e4' lt 1\nset samples 400\nset style fill "
                     "solid 1 noborder\nset palette gray\nset palette maxcolors 256\nhex(k) = ");
    for (int i = 0; i + 1 < RX_PALETTE; i++)
        rx_text_printf(dst, "k == %d ? 0x%s : ", i + 1, colors[i]);
    rx_text_printf(dst, "0x%s\ncolor(k, transparency) = transparency * 0x1000000 + hex(k)\n",
                   colors[RX_PALETTE - 1]);
    for (int i = 0; i < RX_PALETTE; i++)
        rx_text_printf(dst, "set style line %d lc rgb '#%s' lw 1.6 pt %d ps 0.6\n", i + 1, colors[i],
                       points[i]);
}

/* What the kinds of figures need of gnuplot's state; pictures set their own size. */
static void write_kind(rx_text *dst, rx_figure_kind kind)
{
    if (kind == RX_FIGURE_PICTURE) {
        rx_text_add(dst, "unset border\nunset tics\nunset colorbox\nunset xlabel\nunset ylabel\nunset key\n"
                         "set margins 0,0,0,0\n");
        return;
    }
    rx_text_printf(dst, TERMINAL, kind == RX_FIGURE_WIDE ? 1280 : 640, 400);
    rx_text_add(dst, "set border 3 lc rgb '#404040'\nset tics nomirror out\nunset x2tics\nunset "
                     "y2tics\nset xtics nomirror\nset ytics nomirror\nset key outside top center "
                     "horizontal\nset margins -1,-1,-1,-1\n");
}

int rx_method_color(const char *name)
{
    static const char *const known[] = {"BLURRED", "RL", "NET", "RL_BLIND", "RL_FLAT", "SMOOTHED"};
    const size_t n = strcspn(name, " "); /* "NONE TEMPLATE" has the colour of NONE */
    if (n == 4 && strncmp(name, "NONE", n) == 0)
        return 0;
    int color = 0;
    while (color < (int)(sizeof known / sizeof *known) &&
           (strlen(known[color]) != n || strncmp(name, known[color], n) != 0))
        color++;
    return color;
}

void rx_figures_begin(rx_figures *dst)
{
    *dst = (rx_figures){0};
    write_head(&dst->script);
}

static const char *name_of(const char *program)
{
    return program != NULL && program[0] != '\0' ? program : "gnuplot";
}

static int end_gnuplot(rx_figures *figures, const char *program)
{
    const pid_t child = figures->gnuplot;
    figures->gnuplot = 0;
    return child != 0 &&
           rx_gnuplot_wait(child, name_of(program), figures->work, figures->note, sizeof figures->note);
}

static void remove_work(rx_figures *figures)
{
    if (figures->work != NULL)
        rx_output_remove(figures->work);
    free(figures->work);
    figures->work = NULL;
}

void rx_figures_free(rx_figures *figures)
{
    end_gnuplot(figures, NULL);
    remove_work(figures);
    for (int i = 0; i < figures->n; i++) {
        free(figures->figure[i].title);
        free(figures->figure[i].reading);
        free(figures->figure[i].svg);
    }
    rx_text_free(&figures->script);
    *figures = (rx_figures){0};
}

void rx_figure_add(rx_figures *dst, const char *id, const char *title, const char *reading,
                   rx_figure_kind kind)
{
    if (dst->n >= RX_FIGURES_MAX) {
        dst->script.failed = true;
        return;
    }
    if (dst->n == 0 || dst->figure[dst->n - 1].kind != kind)
        write_kind(&dst->script, kind);
    rx_figure *f = &dst->figure[dst->n++];
    *f = (rx_figure){.kind = kind, .title = rx_strdup(title), .reading = rx_strdup(reading)};
    rx_escape_stem(f->id, sizeof f->id, id);
    dst->script.failed = dst->script.failed || f->title == NULL || f->reading == NULL;
}

void rx_plot_value(rx_text *script, double value)
{
    if (isfinite(value))
        rx_text_printf(script, " %.6g", value);
    else
        rx_text_add(script, " NaN"); /* gnuplot's own name for what is not there */
}

void rx_plot_interval(rx_text *script, double value, double low, double high, double y0, double y1)
{
    bool bounded = isfinite(low) && isfinite(high);
    rx_plot_value(script, value);
    rx_plot_value(script, bounded ? fmax(low, y0) : value);
    rx_plot_value(script, bounded ? fmin(high, y1) : value);
}

void rx_plot_title(rx_text *script, const char *name)
{
    char plain[64];
    rx_escape_plain(plain, sizeof plain, name);
    if (plain[0] != '\0')
        rx_text_printf(script, " title '%s'", plain);
    else
        rx_text_add(script, " notitle");
}

/* In single quotes gnuplot knows no escape but the doubled quote. */
static void write_label(rx_text *script, const char *axis, const char *label)
{
    rx_text_printf(script, "set %s '", axis);
    for (const char *c = label != NULL ? label : ""; *c != '\0'; c++) {
        if (*c == '\'')
            rx_text_add(script, "'");
        rx_text_add_bytes(script, (unsigned char)*c < ' ' ? " " : c, 1);
    }
    rx_text_add(script, "'\n");
}

/* gnuplot gives up on ranges without extent, and on those of a logarithmic axis that reach zero. */
static void write_range(rx_text *script, const char *axis, double from, double to, bool logarithmic)
{
    if (!isfinite(from) || !isfinite(to) || (logarithmic && from <= 0 && to <= 0)) {
        from = 0.1;
        to = 1;
    }
    if (logarithmic && from <= 0)
        from = 1e-6 * to;
    if (logarithmic && to <= 0)
        to = 1e-6 * from;
    if (from == to) {
        double margin = from == 0 ? 0.5 : 0.5 * fabs(from);
        from -= margin;
        to += margin;
    }
    rx_text_printf(script, "set %s [%.9g:%.9g]\n", axis, from, to);
}

void rx_plot_begin(rx_figures *dst, const rx_axes *axes)
{
    rx_text *script = &dst->script;
    if (dst->n > 0)
        rx_text_printf(script, "set output '%s.svg'\n", dst->figure[dst->n - 1].id);
    write_label(script, "xlabel", axes->xlabel);
    write_label(script, "ylabel", axes->ylabel);
    rx_text_printf(script, "%s%s", axes->log_x ? "set logscale x\n" : "",
                   axes->log_y ? "set logscale y\n" : "");
    write_range(script, "xrange", axes->x0, axes->x1, axes->log_x);
    write_range(script, "yrange", axes->y0, axes->y1, axes->log_y);
}

/* Names inside an SVG must differ from those of the others in the page: put `id` before each. */
static void add_svg(rx_text *dst, const char *id, const char *title, const char *svg)
{
    static const char *const marks[] = {" id='", " id=\"", "href='#", "href=\"#", "url(#"};
    const char *c = strstr(svg, "<svg");
    if (c != NULL) {
        rx_text_add(dst, "<svg role=\"img\"");
        c += strlen("<svg");
    }
    for (; c != NULL && *c != '\0';) {
        size_t skip = 0;
        const size_t plain = strcspn(c, " hu<"); /* with one of these every mark begins */
        rx_text_add_bytes(dst, c, plain);
        c += plain;
        for (size_t i = 0; i < sizeof marks / sizeof *marks && skip == 0; i++)
            if (strncmp(c, marks[i], strlen(marks[i])) == 0)
                skip = strlen(marks[i]);
        if (skip > 0) {
            rx_text_add_bytes(dst, c, skip);
            rx_text_printf(dst, "%s-", id);
            c += skip;
        } else if (strncmp(c, "<title>", 7) == 0 && strstr(c, "</desc>") != NULL) {
            /* gnuplot's own title and version give way to ours */
            rx_text_add(dst, "<title>");
            rx_escape_html(dst, title);
            rx_text_add(dst, "</title>");
            c = strstr(c, "</desc>") + 7;
        } else if (strncmp(c, "<title>gnuplot_plot", 19) == 0 && strstr(c, "</title>") != NULL) {
            c = strstr(c, "</title>") + 8; /* of a curve without a name: says nothing */
        } else if (*c != '\0') {
            rx_text_add_bytes(dst, c, 1);
            c++;
        }
    }
}

/* *dst NULL when the file is not there or cannot be an SVG; one that is there and cannot be read is an error.
 */
static rx_status read_svg(const char *folder, const char *id, const char *title, char **dst, rx_error *err)
{
    rx_text path = {0}, svg = {0};
    char *content = NULL;
    rx_error trouble = rx_error_part(err);
    rx_status status = RX_OK;
    rx_text_printf(&path, "%s/%s.svg", folder, id);
    if (path.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    if (access(path.data, F_OK) != 0)
        goto exit;
    if (rx_text_read_file(path.data, MAX_SVG, &content, NULL, &trouble) != RX_OK)
        RX_TRY_EXIT(rx_error_at(err, RX_SYSTEM, id, -1, 0, "the figure that gnuplot made %s", trouble.text));
    if (strstr(content, "</svg>") != NULL)
        add_svg(&svg, id, title, content);
    if (svg.failed) {
        rx_text_free(&svg);
        status = rx_error_memory(err, 0);
    }
    *dst = svg.data;
exit:
    free(content);
    rx_text_free(&path);
    return status;
}

static rx_status cannot_be_written(rx_error *err, const char *shown)
{
    return rx_error_at(err, RX_SYSTEM, shown, -1, 0, "cannot be written (its figures): %s", strerror(errno));
}

static rx_status write_script(const rx_text *script, const char *folder, const char *shown, rx_error *err)
{
    rx_text path = {0};
    rx_status status = RX_OK;
    FILE *file = NULL;
    rx_text_printf(&path, "%s/figures.gp", folder);
    if (script->failed || path.failed)
        RX_TRY_EXIT(rx_error_memory(err, script->length));
    file = fopen(path.data, "wb");
    if (file == NULL || fwrite(script->data, 1, script->length, file) != script->length || fflush(file) != 0)
        status = cannot_be_written(err, shown);
exit:
    if (file != NULL)
        fclose(file);
    rx_text_free(&path);
    return status;
}

rx_status rx_figures_start(rx_figures *dst, const char *program, const char *folder, const char *shown,
                           rx_error *err)
{
    rx_text work = {0};
    rx_text_printf(&work, "%s/.figures-XXXXXX", folder);
    if (work.failed)
        return rx_error_memory(err, 0);
    if (mkdtemp(work.data) == NULL) {
        const rx_status failed = cannot_be_written(err, shown);
        rx_text_free(&work);
        return failed;
    }
    dst->work = work.data;
    rx_status status = write_script(&dst->script, dst->work, shown, err);
    if (status == RX_OK)
        dst->gnuplot =
            rx_gnuplot_start(name_of(program), dst->work, "figures.gp", dst->note, sizeof dst->note);
    if (dst->gnuplot == 0)
        remove_work(dst);
    return status;
}

rx_status rx_figures_finish(rx_figures *dst, const char *program, rx_error *err)
{
    rx_status status = RX_OK;
    if (end_gnuplot(dst, program))
        for (int i = 0; i < dst->n && status == RX_OK; i++) {
            rx_figure *f = &dst->figure[i];
            status = read_svg(dst->work, f->id, f->title, &f->svg, err);
        }
    if (dst->work != NULL)
        rx_output_remove(dst->work);
    if (status == RX_OK && dst->work != NULL &&
        access(dst->work, F_OK) == 0) /* it would stay in the report */
        status = rx_error_at(err, RX_SYSTEM, "figures", -1, 0, "what gnuplot left cannot be removed: %s",
                             strerror(errno));
    remove_work(dst);
    return status;
}
