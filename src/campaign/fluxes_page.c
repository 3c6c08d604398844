/* report.html of a campaign of fluxes. */
#include "campaign/fluxes_page.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "validate/escape.h"
#include "validate/page.h"

const rx_flux_quantity *rx_flux_quantity_get(int q)
{
    static const rx_flux_quantity all[RX_FLUX_QUANTITIES] = {
        {"bias", "mag", "median error of the magnitude, measured less true", 4},
        {"scatter", "mag", "robust scatter of that error", 4},
        {"bound", "",
         "scatter over the error of a matched filter with noise of sky and photons; isolated stars", 3},
        {"pull", "", "median of (F - F0) / error", 3},
        {"width", "", "robust width of (F - F0) / error", 3},
        {"magerr", "%", "mean of 100 |F - F0| / F0", 2}};
    return &all[q];
}

const rx_estimate *rx_flux_quantity_of(const rx_fluxes_cell *cell, int q)
{
    const rx_estimate *const all[RX_FLUX_QUANTITIES] = {&cell->bias, &cell->scatter, &cell->bound,
                                                        &cell->pull, &cell->width,   &cell->magerr};
    return all[q];
}

int rx_fluxes_has_objects(rx_fluxes_scene scene)
{
    return scene != RX_FLUXES_BLANK;
}

static const char *const ABOUT[RX_FLUXES_SCENES] = {
    [RX_FLUXES_FIELD] = "Stars and galaxies, all that the population puts on a tile.",
    [RX_FLUXES_PAIRS] = "Pairs of stars or galaxies, up to 2 mag different, far from other pairs.",
    [RX_FLUXES_BLANK] = "Noise without any object: all that is found is invented.",
    [RX_FLUXES_RINGS] = "Bright stars and nothing else: what is found around them is invented.",
    [RX_FLUXES_SHREDS] =
        "Bright, large galaxies and nothing else: the detection nearest to the middle is the "
        "galaxy, all other pieces are invented.",
    [RX_FLUXES_INJECTED] =
        "Stars and galaxies added to a real tile. What is on it already is neither right nor "
        "wrong; its unresolved and undetected objects are part of the errors."};

int rx_fluxes_any_objects(const rx_fluxes_numbers *m, rx_fluxes_place p)
{
    p.bin = 0;
    long n = 0;
    for (p.condition = 0; p.condition < m->results->nconditions; p.condition++)
        for (p.bin = 0; p.bin < RX_SNR_BINS; p.bin++)
            for (p.run = 0; p.run < m->results->nruns; p.run++)
                n += rx_fluxes_cell_of(m, &p)->bias.n;
    return n > 0;
}

/* --- tables --- */

static void head_of_fluxes(rx_text *dst, const rx_fluxes_results *r)
{
    char name[64];
    rx_page_head(dst, RX_RIGHT, "S/N");
    for (int run = 0; run < r->nruns; run++)
        for (int flux = 0; flux < RX_FLUX_KINDS; flux++) {
            snprintf(name, sizeof name, "%s %s", r->run[run], rx_flux_name((rx_flux_kind)flux));
            rx_page_head(dst, RX_RIGHT, name);
        }
}

static void cell_table(rx_text *dst, const rx_fluxes_numbers *m, rx_fluxes_place p, int q)
{
    const rx_fluxes_results *r = m->results;
    const rx_flux_quantity *quantity = rx_flux_quantity_get(q);
    char name[96];
    rx_page_heading(dst, quantity->name, quantity->unit[0] != '\0' ? quantity->unit : NULL);
    rx_page_note(dst, quantity->help);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "condition");
    head_of_fluxes(dst, r);
    rx_page_row_end(dst);
    for (p.condition = 0; p.condition < r->nconditions; p.condition++)
        for (p.bin = 0; p.bin < RX_SNR_BINS; p.bin++) {
            rx_page_row(dst, NULL);
            rx_fluxes_condition_name(r, p.condition, name, sizeof name);
            rx_page_cell_text(dst, name);
            rx_page_cell_html(dst, RX_RIGHT, rx_snr_bin_get(p.bin)->name);
            for (p.run = 0; p.run < r->nruns; p.run++)
                for (int flux = 0; flux < RX_FLUX_KINDS; flux++) {
                    p.flux = (rx_flux_kind)flux;
                    rx_page_cell_estimate(dst, rx_flux_quantity_of(rx_fluxes_cell_of(m, &p), q),
                                          quantity->digits);
                }
            rx_page_row_end(dst);
        }
    rx_page_table_end(dst);
}

/* The bias lies open, the rest is folded away. */
static void write_crowd(rx_text *dst, const rx_fluxes_numbers *m, rx_fluxes_place p)
{
    char title[96];
    snprintf(title, sizeof title, "%s, %s", p.galaxy ? "Galaxies" : "Stars", rx_crowd_name(p.crowd));
    if (!rx_fluxes_any_objects(m, p))
        return;
    rx_text_printf(dst, "<details%s><summary><b>%s</b></summary>\n",
                   p.crowd == RX_CROWD_ISOLATED ? " open" : "", title);
    cell_table(dst, m, p, 0);
    rx_text_add(dst, "<details><summary>Scatter, pulls, MagErr</summary>\n");
    for (int q = 1; q < RX_FLUX_QUANTITIES; q++)
        if (q != 2 || (!p.galaxy && p.crowd == RX_CROWD_ISOLATED))
            cell_table(dst, m, p, q);
    rx_text_add(dst, "</details></details>\n");
}

static void pair_head(rx_text *dst, const rx_fluxes_results *r, const char *title, int fluxes)
{
    char name[96];
    rx_page_heading(dst, title, fluxes ? "mag" : NULL);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "condition");
    rx_page_head(dst, RX_RIGHT, "separation [FWHM]");
    for (int run = 0; run < r->nruns; run++)
        for (int t = 0; t < (fluxes ? 2 : 1); t++) {
            snprintf(name, sizeof name, "%s%s", r->run[run], !fluxes ? "" : t ? " TEMPLATE" : " AUTO");
            rx_page_head(dst, RX_RIGHT, name);
        }
    rx_page_row_end(dst);
}

/* number NULL: the share of the pairs. */
static void pair_table(rx_text *dst, const rx_fluxes_numbers *m, rx_pair_place p, const char *title,
                       const rx_estimate *(*number)(const rx_pair_cell *))
{
    const rx_fluxes_results *r = m->results;
    char name[96];
    pair_head(dst, r, title, number != NULL);
    for (p.condition = 0; p.condition < r->nconditions; p.condition++)
        for (p.bin = 0; p.bin < RX_PAIR_BINS; p.bin++) {
            rx_page_row(dst, NULL);
            rx_fluxes_condition_name(r, p.condition, name, sizeof name);
            rx_page_cell_text(dst, name);
            snprintf(name, sizeof name, "%g to %g", RX_PAIR_EDGE[p.bin], RX_PAIR_EDGE[p.bin + 1]);
            rx_page_cell_html(dst, RX_RIGHT, name);
            for (p.run = 0; p.run < r->nruns; p.run++) {
                if (number == NULL) {
                    rx_page_cell_estimate(dst, rx_pair_share(m, &p), 3);
                    continue;
                }
                rx_page_cell_estimate(dst, number(rx_pair_cell_of(m, &p, RX_FLUX_AUTO)), 3);
                rx_page_cell_estimate(dst, number(rx_pair_cell_of(m, &p, RX_FLUX_TEMPLATE)), 3);
            }
            rx_page_row_end(dst);
        }
    rx_page_table_end(dst);
}

static const rx_estimate *ratio_of(const rx_pair_cell *cell)
{
    return &cell->ratio;
}

static const rx_estimate *scatter_of(const rx_pair_cell *cell)
{
    return &cell->scatter;
}

static const rx_estimate *size_of(const rx_pair_cell *cell)
{
    return &cell->size;
}

static const rx_estimate *total_of(const rx_pair_cell *cell)
{
    return &cell->total;
}

static void write_pairs(rx_text *dst, const rx_fluxes_numbers *m, int s)
{
    const rx_pair_place detected = {.scene = s, .sample = RX_SAMPLE_DETECTED};
    const rx_pair_place all = {.scene = s, .sample = RX_SAMPLE_ALL};
    pair_table(dst, m, detected, "Share of the pairs of which both are detected, each at its place", NULL);
    pair_table(dst, m, all, "The same with sources that only the residual of the templates shows", NULL);
    pair_table(dst, m, detected, "Detected pairs: median |error| of the flux ratio", size_of);
    rx_text_add(dst, "<details><summary>Median, scatter, total flux, and those that the residual shows"
                     "</summary>\n");
    pair_table(dst, m, detected, "Median error of the flux ratio, fainter less first", ratio_of);
    pair_table(dst, m, detected, "Scatter of that error", scatter_of);
    pair_table(dst, m, detected, "Median error of the total flux", total_of);
    pair_table(dst, m, all, "With those of the residual: median |error| of the flux ratio", size_of);
    rx_text_add(dst, "</details>\n");
}

static void invented_head(rx_text *dst, int shreds)
{
    static const char *const heads[] = {"restorer",
                                        "true",
                                        "false",
                                        "true, unmarked",
                                        "false, unmarked",
                                        "added",
                                        "false per Mpixel",
                                        "unmarked",
                                        "precision",
                                        "unmarked",
                                        "true ones marked, S/N 5 to 7",
                                        "above 7"};
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "condition");
    for (size_t i = 0; i < sizeof heads / sizeof *heads; i++)
        rx_page_head(dst, i == 0 ? RX_LEFT : RX_RIGHT, heads[i]);
    if (shreds) {
        rx_page_head(dst, RX_RIGHT, "pieces per galaxy");
        rx_page_head(dst, RX_RIGHT, "unmarked");
    }
    rx_page_row_end(dst);
}

static void invented_row(rx_text *dst, const rx_fluxes_numbers *m, int c, int s, int run)
{
    const rx_fluxes_results *r = m->results;
    const rx_invented_cell *v = rx_invented_of(m, c, s, run);
    char name[96];
    rx_page_row(dst, NULL);
    rx_fluxes_condition_name(r, c, name, sizeof name);
    rx_page_cell_text(dst, name);
    rx_page_cell_text(dst, r->run[run]);
    for (int k = 0; k < 2; k++) {
        rx_page_cell_count(dst, v->right[k]);
        rx_page_cell_count(dst, v->wrong[k]);
    }
    rx_page_cell_count(dst, v->added);
    for (int k = 0; k < 2; k++)
        rx_page_cell_interval(dst, &v->per_mpixel[k], 1);
    for (int k = 0; k < 2; k++)
        rx_page_cell_interval(dst, &v->precision[k], 4);
    rx_page_cell_estimate(dst, &v->flagged_weak, 4);
    rx_page_cell_estimate(dst, &v->flagged_strong, 4);
    for (int k = 0; k < 2 && r->set[s].scene == RX_FLUXES_SHREDS; k++)
        rx_page_cell_estimate(dst, &v->pieces[k], 2);
    rx_page_row_end(dst);
}

static void write_invented(rx_text *dst, const rx_fluxes_numbers *m, int s)
{
    const rx_fluxes_results *r = m->results;
    rx_page_heading(dst, "Invented sources", NULL);
    rx_page_table_begin(dst);
    invented_head(dst, r->set[s].scene == RX_FLUXES_SHREDS);
    for (int c = 0; c < r->nconditions; c++)
        for (int run = 0; run < r->nruns; run++)
            invented_row(dst, m, c, s, run);
    rx_page_table_end(dst);
}

static void write_scene(rx_text *dst, const rx_fluxes_page *page, int s)
{
    const rx_fluxes_numbers *m = page->numbers;
    const rx_fluxes_scene scene = m->results->set[s].scene;
    char prefix[32];
    rx_page_section(dst, rx_fluxes_scene_name(scene), rx_fluxes_scene_name(scene));
    rx_page_paragraph(dst, ABOUT[scene]);
    snprintf(prefix, sizeof prefix, "%s-", rx_fluxes_scene_name(scene));
    if (rx_fluxes_has_objects(scene))
        rx_page_figures(dst, &page->figures, prefix);
    if (scene == RX_FLUXES_PAIRS)
        write_pairs(dst, m, s);
    for (int crowd = 0; crowd < RX_CROWDS && rx_fluxes_has_objects(scene); crowd++)
        for (int galaxy = 0; galaxy < 2; galaxy++)
            write_crowd(
                dst, m,
                (rx_fluxes_place){
                    .scene = s, .galaxy = galaxy, .crowd = (rx_crowd)crowd, .sample = RX_SAMPLE_DETECTED});
    write_invented(dst, m, s);
}

static void write_goals(rx_text *dst, const rx_fluxes_page *page)
{
    static const char *const marks[] = {RX_MARK_GOOD, RX_MARK_BAD, RX_MARK_OPEN, RX_MARK_PALE};
    rx_page_section(dst, "goals", "Goals");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "goal");
    rx_page_head(dst, RX_LEFT, "shapes from");
    rx_page_head(dst, RX_LEFT, "verdict");
    rx_page_head(dst, RX_LEFT, "what was found");
    rx_page_row_end(dst);
    for (int i = 0; i < page->nverdicts; i++) {
        const rx_goal_verdict *v = &page->verdict[i];
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, v->run == 0 ? rx_goal_words(v->goal) : "");
        rx_page_cell_text(dst, page->numbers->results->run[v->run]);
        rx_page_cell_verdict(dst, marks[v->state], rx_goal_state_name(v->state));
        rx_page_cell_text(dst, v->said.data);
        dst->failed = dst->failed || v->said.failed;
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

static void write_reading(rx_text *dst)
{
    rx_page_section(dst, "reading", "How to read this");
    rx_page_paragraph(
        dst, "Every number is followed by its 95 % interval and by how many objects are behind it. The "
             "tables here are of the objects that were detected on the image of the restorer of the "
             "column; all of its fluxes are of the same objects. Sources that only the residual of the "
             "templates showed (added) are left out, for AUTO and apertures know nothing of them; goals "
             "are held against all. cells.ecsv has both, and the objects that every restorer has detected. "
             "S/N is the true one, in a matched filter on the bare sky. <b>APER</b> is the first of "
             "STAGE.PHOT_APERTURES and <b>WIDE</b> an aperture of 2 FWHM radius, both without a correction "
             "for what lies outside of them.");
    rx_page_paragraph(
        dst, "<b>Isolated</b>: no other object of more than 1 % of the flux within (3 + log10 f) FWHM and "
             "twice both half-light radii, f how many times brighter the other one is. <b>Blended</b>: "
             "another one within 1.5 FWHM and 2 mag; <b>told apart</b>: both were found, each nearer to "
             "its place than half the separation, so that the flux of an object means something. "
             "<b>Marked</b>: FLAGS_RESTORE calls the source made up. <b>Goals</b> are held against FIELD, "
             "PAIRS and INJECTED under conditions in which restorers are told the truth; undecided: beyond "
             "the limit, but by less than the error of the number.");
}

/* --- figures --- */

enum { CURVES = 1 + RX_FLUXES_RUNS };

/* Bias over S/N: TEMPLATE of every restorer, AUTO of the first. */
static void plot(rx_figures *dst, const rx_fluxes_numbers *m, rx_fluxes_place p)
{
    const rx_fluxes_results *r = m->results;
    static const double middle[RX_SNR_SINGLE] = {7.1, 14, 32, 71, 320, 2000};
    double data[CURVES][4][RX_SNR_SINGLE];
    rx_curve curves[CURVES];
    char names[CURVES][64], id[RX_FIGURE_ID], title[160], condition[96];
    int n = 0, points = 0;
    for (int k = -1; k < r->nruns; k++, n++) {
        p.run = k < 0 ? 0 : k;
        p.flux = k < 0 ? RX_FLUX_AUTO : RX_FLUX_TEMPLATE;
        snprintf(names[n], sizeof names[n], "%s %s", r->run[p.run], rx_flux_name(p.flux));
        for (p.bin = 0; p.bin < RX_SNR_SINGLE; p.bin++) {
            const rx_estimate *e = &rx_fluxes_cell_of(m, &p)->bias;
            data[n][0][p.bin] = middle[p.bin] * (1 + 0.03 * n);
            data[n][1][p.bin] = e->n >= 5 ? e->value : NAN;
            points += e->n >= 5;
            data[n][2][p.bin] = e->low;
            data[n][3][p.bin] = e->high;
        }
        curves[n] = (rx_curve){.name = names[n],
                               .kind = RX_CURVE_BARS,
                               .color = rx_method_color(r->run[p.run]),
                               .dashed = k < 0,
                               .n = RX_SNR_SINGLE};
        curves[n].x = data[n][0];
        curves[n].y = data[n][1];
        curves[n].low = data[n][2];
        curves[n].high = data[n][3];
    }
    if (points == 0)
        return;
    const rx_axes axes = {"S/N", "median error (mag)", 5, 4000, -0.1, 0.1, true, false};
    rx_fluxes_condition_name(r, p.condition, condition, sizeof condition);
    snprintf(title, sizeof title, "%s, %s, %s", p.galaxy ? "Galaxies" : "Stars", rx_crowd_name(p.crowd),
             condition);
    snprintf(id, sizeof id, "%s-%d-%d-%d", rx_fluxes_scene_name(r->set[p.scene].scene), p.galaxy,
             (int)p.crowd, p.condition);
    rx_figure_add(dst, id, title, "", RX_FIGURE_CHART);
    rx_plot_curves(dst, &axes, n, curves);
}

void rx_fluxes_figures(rx_figures *dst, const rx_fluxes_numbers *m)
{
    static const rx_crowd crowds[] = {RX_CROWD_ISOLATED, RX_CROWD_APART};
    const rx_fluxes_results *r = m->results;
    rx_figures_begin(dst);
    for (int s = 0; s < r->nscenes; s++)
        for (int c = 0; c < r->nconditions && rx_fluxes_has_objects(r->set[s].scene); c++)
            for (int galaxy = 0; galaxy < 2; galaxy++)
                for (int k = 0; k < 2 && dst->n < RX_FIGURES_MAX; k++) {
                    const rx_fluxes_place p = {.condition = c,
                                               .scene = s,
                                               .sample = RX_SAMPLE_DETECTED,
                                               .galaxy = galaxy,
                                               .crowd = crowds[k]};
                    if (rx_fluxes_any_objects(m, p))
                        plot(dst, m, p);
                }
}

void rx_fluxes_html(rx_text *dst, const void *pointer)
{
    const rx_fluxes_page *page = pointer;
    const rx_fluxes_results *r = page->numbers->results;
    rx_text about = {0};
    rx_page_begin(dst, "Validation: ", page->record->title);
    rx_page_links_begin(dst);
    rx_page_link(dst, 1, "goals", "Goals");
    for (int s = 0; s < r->nscenes; s++)
        rx_page_link(dst, 1, rx_fluxes_scene_name(r->set[s].scene), rx_fluxes_scene_name(r->set[s].scene));
    rx_page_link(dst, 1, "reading", "How to read");
    rx_page_link(dst, 1, "record", "Record");
    rx_page_links_end(dst);
    rx_escape_html(&about, r->about);
    rx_text_printf(&about, ". Objects count from S/N %g on; APER is %g pixels wide.", r->truth_snr,
                   r->aperture);
    rx_page_paragraph(dst, about.data != NULL ? about.data : "");
    dst->failed = dst->failed || about.failed;
    rx_text_free(&about);
    write_goals(dst, page);
    for (int s = 0; s < r->nscenes; s++)
        write_scene(dst, page, s);
    write_reading(dst);
    rx_page_campaign_record(dst, page->record);
    rx_page_end(dst);
}
