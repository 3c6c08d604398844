/* Figures: one script for gnuplot, run once, and its SVG files made fit for a page. */
#include "report/figure.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "io/folders.h"
#include "report/formats.h"

enum { MAX_SVG = 64 << 20, INK = 64 }; /* grey up to INK: has the colour of text */
static const char TERMINAL[] =
    "set terminal svg size %d,%d dynamic noenhanced font 'Helvetica,13' background '#ffffff'\n";

static void write_head(rx_text *dst)
{
    static const char *const colors[RX_PALETTE] = {"0072B2", "D55E00", "009E73", "C872A2",
                                                   "B97B00", "3A9AD0", "000000"};
    static const int points[RX_PALETTE] = {7, 5, 9, 13, 11, 6, 4};
    rx_text_add(dst, "set encoding utf8\nset clip two\nset grid lc rgb '#e4e4e4' lt 1\nset samples 400\nset "
                     "style fill solid 1 noborder\nset palette gray\nset palette maxcolors 256\nhex(k) = ");
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
        rx_text_add(dst, "unset border\nunset tics\nunset colorbox\nunset xlabel\nunset ylabel\nunset "
                         "key\nset margins 0,0,0,0\n");
        return;
    }
    rx_text_printf(dst, TERMINAL, kind == RX_FIGURE_WIDE ? 1280 : 640, 400);
    rx_text_add(dst, "set border 3 lc rgb '#404040'\nset tics nomirror out\nunset x2tics\nunset y2tics\nset "
                     "xtics nomirror\nset ytics nomirror\nset key outside top center horizontal reverse Left "
                     "samplen 2\nset margins -1,-1,-1,-1\n");
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

/* --- gnuplot: the one other program that is started --- */

#define SCRIPT "figures.gp"
/* PATIENCE: seconds for the figures of a report, which take about one. */
enum { MOST_WORDS = 1 << 20, PATIENCE = 600 };

extern char **environ;

/* The environment without what would change numbers or the terminal; pointers only, `locale` among them. */
static char **clean_environment(char *locale)
{
    size_t n = 0, kept = 0;
    while (environ != NULL && environ[n] != NULL)
        n++;
    char **copy = RX_NEW(char *, n + 2);
    for (size_t i = 0; i < n && copy != NULL; i++)
        if (strncmp(environ[i], "LC_ALL=", 7) != 0 && strncmp(environ[i], "GNUTERM=", 8) != 0)
            copy[kept++] = environ[i];
    if (copy != NULL)
        copy[kept] = locale;
    return copy;
}

/* Start `program -d figures.gp` inside `folder`. No shell; nothing read, what it prints goes to gnuplot.log in that folder.
 * The parent blocks the signals that end it, to clean up after itself; the child must not inherit that.
 * What is ignored (nohup) stays ignored, but for SIGPIPE. 0 or an error number. */
static int spawn(pid_t *child, const char *program, const char *folder)
{
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t none, pipe;
    char options[] = "-d", script[] = SCRIPT, locale[] = "LC_ALL=C";
    char *name = rx_strdup(program), **environment = clean_environment(locale);
    char *arguments[] = {name, options, script, NULL};
    sigemptyset(&none);
    sigemptyset(&pipe);
    sigaddset(&pipe, SIGPIPE);
    posix_spawn_file_actions_init(&actions); /* as the next one it only sets fields */
    posix_spawnattr_init(&attributes);
    int failed =
        name != NULL && environment != NULL ? posix_spawn_file_actions_addchdir_np(&actions, folder) : ENOMEM;
    if (failed == 0)
        failed = posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    if (failed == 0)
        failed =
            posix_spawn_file_actions_addopen(&actions, 1, "gnuplot.log", O_WRONLY | O_CREAT | O_TRUNC, 0600);
    if (failed == 0)
        failed = posix_spawn_file_actions_adddup2(&actions, 1, 2);
    if (failed == 0) { /* these only set fields */
        posix_spawnattr_setsigmask(&attributes, &none);
        posix_spawnattr_setsigdefault(&attributes, &pipe);
        posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
        failed = posix_spawnp(child, program, &actions, &attributes, arguments, environment);
    }
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    free(name);
    free(environment);
    return failed;
}

/* The last line of its messages, where gnuplot says what it did not understand; "" when there is none. */
static void last_words(const char *folder, char *dst, size_t size)
{
    rx_text path = {0};
    char *log = NULL, *line = NULL;
    dst[0] = '\0';
    rx_text_printf(&path, "%s/gnuplot.log", folder);
    if (!path.failed && rx_text_read_file(path.data, MOST_WORDS, &log, NULL, NULL) == RX_OK)
        for (char *state = NULL, *c = strtok_r(log, "\r\n", &state); c != NULL;
             c = strtok_r(NULL, "\r\n", &state))
            line = c[strspn(c, " \t^")] != '\0' ? c : line;
    if (line != NULL) {
        snprintf(dst, size, ": %s", line);
        for (char *c = dst; *c != '\0'; c++)
            *c = *c >= ' ' && *c < 0x7f ? *c : '?';
    }
    free(log);
    rx_text_free(&path);
}

/* Wait for its end. Returns 1 when it ended well, else 0 and the reason. One that hangs is killed after 10 minutes, or when a
 * signal asks this process to end. The pauses grow from 1 to 20 ms: short against a figure, nothing against the processor. */
static int wait_gnuplot(pid_t child, const char *program, const char *folder, char *note, size_t size)
{
    struct timespec pause = {.tv_nsec = 1000000}, begin, now;
    int state = 0, impatient = 0;
    char words[160];
    clock_gettime(CLOCK_MONOTONIC, &begin);
    for (pid_t ended; (ended = waitpid(child, &state, impatient ? 0 : WNOHANG)) != child;) {
        if (ended < 0 && errno != EINTR) {
            snprintf(note, size, "%s got lost: %s", program, strerror(errno));
            return 0;
        }
        clock_gettime(CLOCK_MONOTONIC, &now);
        if (!impatient && (now.tv_sec - begin.tv_sec > PATIENCE || rx_interrupt_pending())) {
            impatient = 1;
            kill(child, SIGKILL);
        }
        nanosleep(&pause, NULL);
        pause.tv_nsec = pause.tv_nsec < 20000000 ? pause.tv_nsec + 1000000 : pause.tv_nsec;
    }
    if (WIFEXITED(state) && WEXITSTATUS(state) == 0)
        return 1;
    if (impatient && WIFSIGNALED(state)) {
        snprintf(note, size, "%s was ended: it had not finished after %d seconds, or the run was interrupted",
                 program, PATIENCE);
    } else if (WIFSIGNALED(state)) {
        snprintf(note, size, "%s was ended by signal %d", program, WTERMSIG(state));
    } else {
        last_words(folder, words, sizeof words);
        snprintf(note, size, "%s failed with exit code %d%s", program, WEXITSTATUS(state), words);
    }
    return 0;
}

/* --- figures --- */

static int end_gnuplot(rx_figures *figures)
{
    const pid_t child = figures->gnuplot;
    figures->gnuplot = 0;
    return child != 0 &&
           wait_gnuplot(child, figures->program, figures->work, figures->note, sizeof figures->note);
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
    end_gnuplot(figures);
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
    rx_text_printf(script, "%s%sset format x '%s'\nset format y '%s'\n",
                   axes->log_x ? "set logscale x\n" : "", axes->log_y ? "set logscale y\n" : "",
                   axes->log_x ? "%g" : "% h", axes->log_y ? "%g" : "% h");
    write_range(script, "xrange", axes->x0, axes->x1, axes->log_x);
    write_range(script, "yrange", axes->y0, axes->y1, axes->log_y);
}

/* The end of the first `what` in `from`, or NULL. */
static const char *after(const char *from, const char *what)
{
    const char *at = strstr(from, what);
    return at != NULL ? at + strlen(what) : NULL;
}

/* Pale dots one below the other, each a line of 100 bytes: EACH of them are one path of round ends. Where they overlap
 * they still add up but for those of one path. Returns where they end, NULL where there are none. */
static const char *add_dots(rx_text *dst, const char *c)
{
    enum { EACH = 16 };
    double x, y, scale, opacity;
    unsigned red, green, blue;
    int length = 0, n = 0;
    while (sscanf(c,
                  "<use xlink:href='#gpPt6' transform='translate(%lf,%lf) scale(%lf)' color='rgb(%u,%u,%u)' "
                  "opacity='%lf'/> %n",
                  &x, &y, &scale, &red, &green, &blue, &opacity, &length) == 7 &&
           length > 0) {
        if (n % EACH == 0)
            rx_text_printf(dst,
                           "%s<path stroke-linecap=\"round\" stroke=\"#%02X%02X%02X\" stroke-width=\"%.2f\" "
                           "opacity=\"%.2f\" d=\"",
                           n > 0 ? "\"/>\n" : "", red & 255, green & 255, blue & 255, 2 * scale, opacity);
        rx_text_printf(dst, "M%.1f,%.1fh0", x, y);
        c += length;
        length = 0;
        n++;
    }
    rx_text_add(dst, n > 0 ? "\"/>\n" : "");
    return n > 0 ? c : NULL;
}

/* An SVG of gnuplot as a page needs it: names begin with `id`, as they must differ from those of the other figures;
 * what is black or nearly so takes the colour of the page's text, the ground is the page's; what says nothing goes
 * (a figure has thousands of such words). */
static void add_svg(rx_text *dst, const char *id, const char *title, const char *svg)
{
    static const char *const marks[] = {" id='", " id=\"", "href='#", "href=\"#", "url(#"};
    static const char *const words[][2] = {
        {" stroke-linecap=\"butt\" stroke-linejoin=\"miter\"", ""},
        {" stroke-width=\"1.00\"", ""},
        {" fill=\"none\" color=\"black\" stroke=\"currentColor\"", ""},
        {" stroke=\"none\" fill=\"black\" font-family=\"Helvetica\" font-size=\"13.00\" ", ""},
        {" stroke=\"none\" fill=\"rgb(64,64,64)\" font-family=\"Helvetica\" font-size=\"13.00\" ", ""},
        {" stroke='black'", ""},
        {" stroke='rgb( 64,  64,  64)'", ""},
        {" stroke='rgb(228, 228, 228)'", ""},
        {"<title> </title>", ""},
        {"\n\t<title>", "\n<title>"},
        {"\n\t", "\n"},
    };
    const char *c = strstr(svg, "<svg");
    if (c != NULL) {
        rx_text_add(dst, "<svg role=\"img\"");
        c += strlen("<svg");
    }
    while (c != NULL && *c != '\0') {
        const char *skipped = NULL;
        unsigned red, green, blue;
        const size_t plain = strcspn(c, " hu<r\n"); /* with one of these everything below begins */
        rx_text_add_bytes(dst, c, plain);
        c += plain;
        if (strncmp(c, "<title>", 7) == 0 &&
            strstr(c, "</desc>") != NULL) { /* gnuplot's own title and version */
            rx_text_add(dst, "<title>");
            rx_escape_html(dst, title);
            rx_text_add(dst, "</title>");
            skipped = after(c, "</desc>");
        } else if (strncmp(c, "<title>gnuplot_plot", 19) == 0) { /* of a curve without a name */
            skipped = after(c, "</title>");
        } else if (strncmp(c, "<rect x=\"0\" y=\"0\"", 17) == 0) { /* the ground */
            skipped = after(c, "/>");
        } else if (strncmp(c, "<g ", 3) == 0 && after(c, ">") != NULL &&
                   strncmp(after(c, ">"), "\n</g>\n", 6) == 0) {
            skipped = after(c, "</g>\n"); /* nothing in it */
        }
        if (strncmp(c, "<use ", 5) == 0)
            skipped = add_dots(dst, c);
        for (size_t i = 0; i < sizeof words / sizeof *words && skipped == NULL; i++)
            if (strncmp(c, words[i][0], strlen(words[i][0])) == 0) {
                rx_text_add(dst, words[i][1]);
                skipped = c + strlen(words[i][0]);
            }
        for (size_t i = 0; i < sizeof marks / sizeof *marks && skipped == NULL; i++)
            if (strncmp(c, marks[i], strlen(marks[i])) == 0) {
                rx_text_printf(dst, "%s%s-", marks[i], id);
                skipped = c + strlen(marks[i]);
            }
        if (skipped == NULL && sscanf(c, "rgb(%u,%u,%u", &red, &green, &blue) == 3 && after(c, ")") != NULL) {
            if (red == green && green == blue && red <= INK)
                rx_text_add(dst, "currentColor");
            else
                rx_text_printf(dst, "#%02X%02X%02X", red & 255, green & 255, blue & 255);
            skipped = after(c, ")");
        }
        if (skipped == NULL && *c != '\0') {
            rx_text_add_bytes(dst, c, 1);
            skipped = c + 1;
        }
        c = skipped;
    }
}

/* *dst NULL when the file is not there or cannot be an SVG; one that is there and cannot be read is an error. */
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

rx_status rx_figures_start(rx_figures *dst, const char *program, const char *folder, const char *shown,
                           rx_error *err)
{
    rx_text work = {0}, path = {0};
    rx_status status;
    rx_text_printf(&work, "%s/.figures-XXXXXX", folder);
    if (work.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    if (mkdtemp(work.data) == NULL)
        RX_TRY_EXIT(rx_error_at(err, RX_SYSTEM, shown, -1, 0, "cannot be written (its figures): %s",
                                strerror(errno)));
    dst->work = work.data;
    work = (rx_text){0};
    dst->program = program != NULL && program[0] != '\0' ? program : "gnuplot";
    rx_text_printf(&path, "%s/" SCRIPT, dst->work);
    status = path.failed ? rx_error_memory(err, 0) : rx_text_write_file(&dst->script, path.data, shown, err);
    if (status == RX_OK) {
        /* a path with a folder in it is meant from here, not from where the child works */
        char *absolute = strchr(dst->program, '/') != NULL ? realpath(dst->program, NULL) : NULL;
        pid_t child = 0;
        const int failed = spawn(&child, absolute != NULL ? absolute : dst->program, dst->work);
        dst->gnuplot = failed == 0 ? child : 0;
        if (failed != 0)
            snprintf(dst->note, sizeof dst->note, "%s cannot be started (%s); install gnuplot", dst->program,
                     strerror(failed));
        free(absolute);
    }
    if (dst->gnuplot == 0)
        remove_work(dst);
exit:
    rx_text_free(&work);
    rx_text_free(&path);
    return status;
}

rx_status rx_figures_finish(rx_figures *dst, rx_error *err)
{
    rx_status status = RX_OK;
    if (end_gnuplot(dst))
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
