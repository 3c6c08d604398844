/* report.html of a detection campaign. */
#include "campaign/detection_page.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "validate/escape.h"
#include "validate/page.h"

int rx_detection_shown(const rx_detection_numbers *m, int column)
{
    return column >= m->results->nmethods || !m->results->tuned[column];
}

/* "FWHM 4, sky +0.3 sigma"; of one seeing without a name: its width. */
void rx_detection_condition_name(const rx_detection_results *r, int condition, char *dst, size_t size)
{
    rx_condition named = r->condition[condition];
    if (!(named.fwhm > 0))
        named.fwhm = r->set[condition * r->nscenes].fwhm;
    rx_condition_name(&named, dst, size);
}

static const char *const ABOUT[RX_SCENE_KINDS] = {
    [RX_SCENE_STARS] =
        "Stars alone, all that the population puts on a tile, blends and all. A detection that is "
        "no star of the least S/N, nor a fainter one, is false.",
    [RX_SCENE_GALAXIES] = "Galaxies alone. A galaxy in two pieces is one right and one false detection.",
    [RX_SCENE_PAIRS] =
        "Close pairs of stars: told apart when there are two detections, each nearer than half the "
        "separation to its star, both above the threshold.",
    [RX_SCENE_BLANK] = "Noise without any object: all that is found is invented.",
    [RX_SCENE_RINGS] = "Bright stars and nothing else: what is found around them is invented.",
    [RX_SCENE_PLATEAU] = "A bright, flat square without noise: what a restorer adds to it that repeats every "
                         "second or fourth pixel.",
    [RX_SCENE_OUTSKIRTS] =
        "Faint galaxies: flux in round apertures at their true place on the restored pixels, "
        "over what the same scene without noise has there (restored images: at the "
        "target PSF). Below 1 flux was lost."};

static int scene_index(const rx_detection_results *r, rx_detection_scene kind)
{
    for (int s = 0; s < r->nscenes; s++)
        if (r->set[s].scene == kind)
            return s;
    return -1;
}

static void quantity_table(rx_text *dst, const rx_detection_numbers *m, int s, int q)
{
    const rx_detection_results *r = m->results;
    rx_quantity quantity;
    char name[96];
    rx_text help = {0};
    rx_quantity_get(r, r->set[s].scene, q, &quantity);
    rx_page_heading(dst, quantity.name, quantity.unit[0] != '\0' ? quantity.unit : NULL);
    rx_escape_html(&help, quantity.help);
    rx_page_note(dst, help.data != NULL ? help.data : "");
    dst->failed = dst->failed || help.failed;
    rx_text_free(&help);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "condition");
    for (int k = 0; k < m->ncolumns; k++)
        if (rx_detection_shown(m, k))
            rx_page_head(dst, RX_RIGHT, rx_detection_column_name(m, k));
    if (m->best >= 0)
        rx_page_head(dst, RX_LEFT, "RL is");
    rx_page_row_end(dst);
    for (int c = 0; c < r->nconditions; c++) {
        rx_page_row(dst, NULL);
        rx_detection_condition_name(r, c, name, sizeof name);
        rx_page_cell_text(dst, name);
        for (int k = 0; k < m->ncolumns; k++)
            if (rx_detection_shown(m, k))
                rx_page_cell_estimate(dst, &rx_detection_cell_of(m, c, s, k)->value[q], quantity.digits);
        if (m->best >= 0)
            rx_page_cell_text(dst, rx_detection_cell_of(m, c, s, m->best)->chosen[q]);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

static void duel_table(rx_text *dst, const rx_detection_numbers *m, int s)
{
    const rx_detection_results *r = m->results;
    char text[96];
    if (m->hero < 0 || m->nrivals == 0 || r->nprecisions == 0)
        return;
    snprintf(text, sizeof text, "Objects found at precision %g by only one of two", r->precision[0]);
    rx_page_heading(dst, text, NULL);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "condition");
    for (int k = 0; k < m->nrivals; k++) {
        snprintf(text, sizeof text, "only %.24s", rx_detection_column_name(m, m->hero));
        rx_page_head(dst, RX_RIGHT, text);
        snprintf(text, sizeof text, "only %.24s", rx_detection_column_name(m, m->rival[k]));
        rx_page_head(dst, RX_RIGHT, text);
        rx_page_head(dst, RX_RIGHT, "McNemar p");
    }
    rx_page_row_end(dst);
    for (int c = 0; c < r->nconditions; c++) {
        rx_page_row(dst, NULL);
        rx_detection_condition_name(r, c, text, sizeof text);
        rx_page_cell_text(dst, text);
        for (int k = 0; k < m->nrivals; k++) {
            const rx_detection_duel *d = rx_detection_duel_of(m, c, s, k);
            rx_page_cell_count(dst, d->only_first);
            rx_page_cell_count(dst, d->only_second);
            rx_page_cell_p(dst, d->p, log(d->p));
        }
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

/* The first tables lie open, the rest is folded away. */
static void write_scene(rx_text *dst, const rx_detection_page *page, int s)
{
    enum { OPEN = 2 };
    const rx_detection_numbers *m = page->numbers;
    const rx_detection_scene scene = m->results->set[s].scene;
    const int n = rx_quantity_count(m->results, scene);
    char prefix[32];
    rx_page_section(dst, rx_detection_scene_name(scene), rx_detection_scene_name(scene));
    rx_page_paragraph(dst, ABOUT[scene]);
    snprintf(prefix, sizeof prefix, "%s-", rx_detection_scene_name(scene));
    if (rx_detection_scene_is_list(scene))
        rx_page_figures(dst, &page->figures, prefix);
    for (int q = 0; q < n && q < OPEN; q++)
        quantity_table(dst, m, s, q);
    if (n > OPEN) {
        rx_text_add(dst, "<details><summary><b>More tables</b></summary>\n");
        for (int q = OPEN; q < n; q++)
            quantity_table(dst, m, s, q);
        if (rx_detection_scene_is_list(scene))
            duel_table(dst, m, s);
        rx_text_add(dst, "</details>\n");
    }
}

static void write_reading(rx_text *dst)
{
    rx_page_section(dst, "reading", "How to read this");
    rx_page_paragraph(
        dst,
        "Every number is followed by its 95 % interval and by how many objects (or counts) are behind it. "
        "Shares "
        "have Clopper-Pearson intervals, counts Poisson ones, ap and flux ratios bootstrap intervals; "
        "objects of "
        "one tile share its noise, which the intervals do not know. PLATEAU: the interval holds all tiles.");
    rx_page_paragraph(
        dst,
        "<b>MATCHED</b> is the unrestored image with a Gaussian of the PSF's width as its detection filter, "
        "NONE "
        "the same with FILTER_NAME. <b>RL</b> is Richardson-Lucy at its best: for ap, the recalls and PAIRS "
        "the setting "
        "of the highest value, each for itself and chosen on the tiles of the test, which is in its favour; "
        "for "
        "everything else the setting of the highest ap over STARS and GALAXIES together. The settings one by "
        "one are in cells.ecsv. <b>Thresholds</b>: recall at a precision is at the lowest score with that "
        "precision on the scene itself; PAIRS, BLANK and RINGS use the thresholds of STARS and GALAXIES "
        "together.");
}

/* ap and recall over the seeing, where restorers are told the truth. */
static void plot(rx_figures *dst, const rx_detection_numbers *m, int s, int q)
{
    const rx_detection_results *r = m->results;
    const size_t n = (size_t)r->nconditions;
    rx_quantity quantity;
    rx_curve curves[RX_METHODS_MAX];
    char id[RX_FIGURE_ID];
    int ncurves = 0;
    double low = HUGE_VAL, high = 0;
    rx_quantity_get(r, r->set[s].scene, q, &quantity);
    double *data = RX_NEW(double, 4 * n * RX_METHODS_MAX);
    if (data == NULL) {
        dst->script.failed = true;
        return;
    }
    for (int k = 0; k < m->ncolumns && ncurves < RX_METHODS_MAX; k++) {
        if (!rx_detection_shown(m, k))
            continue;
        double *x = data + 4 * n * (size_t)ncurves, *y = x + n, *lows = y + n, *highs = lows + n;
        long points = 0;
        for (int c = 0; c < r->nconditions; c++) {
            const rx_estimate *e = &rx_detection_cell_of(m, c, s, k)->value[q];
            if (!rx_condition_true(&r->condition[c]))
                continue;
            x[points] = r->set[c * r->nscenes].fwhm + 0.03 * ncurves;
            low = fmin(low, x[points]);
            high = fmax(high, x[points]);
            y[points] = e->value;
            lows[points] = e->low;
            highs[points++] = e->high;
        }
        curves[ncurves] = (rx_curve){.name = rx_detection_column_name(m, k), .kind = RX_CURVE_BARS};
        curves[ncurves].color = rx_method_color(curves[ncurves].name);
        curves[ncurves].n = points;
        curves[ncurves].x = x;
        curves[ncurves].y = y;
        curves[ncurves].low = lows;
        curves[ncurves++].high = highs;
    }
    const rx_axes axes = {
        "FWHM of the PSF (pixels)", quantity.name, low - 0.5, high + 0.5, 0, 1.02, false, false};
    snprintf(id, sizeof id, "%s-%d", rx_detection_scene_name(r->set[s].scene), q);
    rx_figure_add(dst, id, quantity.name, quantity.help, RX_FIGURE_CHART);
    rx_plot_curves(dst, &axes, ncurves, curves);
    free(data);
}

void rx_detection_figures(rx_figures *dst, const rx_detection_numbers *m)
{
    rx_figures_begin(dst);
    for (int s = 0; s < m->results->nscenes; s++)
        for (int q = 0; q < 2 && rx_detection_scene_is_list(m->results->set[s].scene); q++)
            plot(dst, m, s, q);
}

void rx_detection_html(rx_text *dst, const void *pointer)
{
    const rx_detection_page *page = pointer;
    const rx_detection_results *r = page->numbers->results;
    rx_text about = {0};
    rx_page_begin(dst, "Validation: ", page->record->title);
    rx_page_links_begin(dst);
    rx_page_link(dst, 1, "verdicts", "Goals");
    for (int k = 0; k < RX_SCENE_KINDS; k++)
        rx_page_link(dst, scene_index(r, (rx_detection_scene)k) >= 0,
                     rx_detection_scene_name((rx_detection_scene)k),
                     rx_detection_scene_name((rx_detection_scene)k));
    rx_page_link(dst, 1, "reading", "How to read");
    rx_page_link(dst, 1, "record", "Record");
    rx_page_links_end(dst);
    rx_text_add(&about, "Scenes through every restorer, then the same detection: ");
    rx_escape_html(&about, r->about);
    rx_text_printf(&about, ". Objects are to be found from S/N %g on.", r->truth_snr);
    rx_page_paragraph(dst, about.data != NULL ? about.data : "");
    dst->failed = dst->failed || about.failed;
    rx_text_free(&about);
    rx_page_verdicts(dst, page->nverdicts, page->verdict);
    for (int k = 0; k < RX_SCENE_KINDS; k++)
        if (scene_index(r, (rx_detection_scene)k) >= 0)
            write_scene(dst, page, scene_index(r, (rx_detection_scene)k));
    write_reading(dst);
    rx_page_campaign_record(dst, page->record);
    rx_page_end(dst);
}
