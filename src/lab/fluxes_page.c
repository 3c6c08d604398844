/* The report of a campaign of fluxes. */
#include <math.h>
#include <stdio.h>

#include "lab/findings.h"
#include "lab/fluxes_numbers.h"
#include "lab/kinds.h"
#include "report/page.h"

static int any_objects(const rx_fluxes_numbers *m, rx_fluxes_place p)
{
    p.bin = 0;
    long n = 0;
    for (p.condition = 0; p.condition < m->lab->nconditions; p.condition++)
        for (p.bin = 0; p.bin < RX_SNR_BINS; p.bin++)
            for (p.run = 0; p.run < m->lab->nruns; p.run++)
                n += rx_fluxes_cell_of(m, &p)->bias.n;
    return n > 0;
}

/* --- tables --- */

static const rx_report_column CELLS[] = {
    {.name = "scene", .help = "what is on the tiles"},
    {.name = "kind", .help = "star or galaxy"},
    {.name = "company", .help = "isolated, blended, told apart, neither"},
    {.name = "condition", .help = "seeing, and what restorers were given wrong"},
    {.name = "snr", .help = "bin of true S/N", .heading = "S/N"},
    {.name = "run", .help = "restorer"},
    {.name = "flux", .help = "what was measured"},
    {"bias", RX_REPORT_ESTIMATE, 4, "mag", "median error of the magnitude, measured less true", NULL},
    {"scatter", RX_REPORT_ESTIMATE, 4, "mag", "robust scatter of that error", NULL},
    {"bound", RX_REPORT_ESTIMATE, 3, "",
     "scatter over the error of a matched filter with noise of sky and photons; isolated stars", NULL},
    {"pull", RX_REPORT_ESTIMATE, 3, "", "median of (F - F0) / error", NULL},
    {"width", RX_REPORT_ESTIMATE, 3, "", "robust width of (F - F0) / error", NULL},
    {"magerr", RX_REPORT_ESTIMATE, 2, "%", "mean of 100 |F - F0| / F0", NULL},
};

static const rx_report_column PAIRS[] = {
    {.name = "sample", .help = "all: found by the run; detected: on its image"},
    {.name = "condition"},
    {.name = "separation", .help = "from and to, FWHM", .heading = "separation [FWHM]"},
    {.name = "run", .help = "restorer"},
    {.name = "flux", .help = "what was measured"},
    {"both", RX_REPORT_ESTIMATE, 3, "", "share of the pairs of which both are found", NULL},
    {"size", RX_REPORT_ESTIMATE, 3, "mag", "median |error| of their flux ratio", NULL},
    {"ratio", RX_REPORT_ESTIMATE, 3, "mag", "median error of their flux ratio, fainter less first", NULL},
    {"scatter", RX_REPORT_ESTIMATE, 3, "mag", "scatter of that error", NULL},
    {"total", RX_REPORT_ESTIMATE, 3, "mag", "median error of the total flux", NULL},
};

static const rx_report_column INVENTED[] = {
    {.name = "scene"},
    {.name = "condition"},
    {.name = "run", .help = "restorer"},
    {"right", RX_REPORT_COUNT, 0, "", "detections of objects", NULL},
    {"wrong", RX_REPORT_COUNT, 0, "", "invented detections", NULL},
    {"right_unmarked", RX_REPORT_COUNT, 0, "", "the same without marked detections", NULL},
    {"wrong_unmarked", RX_REPORT_COUNT, 0, "", "the same without marked detections", NULL},
    {"added", RX_REPORT_COUNT, 0, "", "true ones that only the residual showed", NULL},
    {"false_per_mpixel", RX_REPORT_ESTIMATE, 1, "", "", NULL},
    {"false_per_mpixel_unmarked", RX_REPORT_ESTIMATE, 1, "", "", NULL},
    {"precision", RX_REPORT_ESTIMATE, 4, "", "", NULL},
    {"precision_unmarked", RX_REPORT_ESTIMATE, 4, "", "", NULL},
    {"marked_5_7", RX_REPORT_ESTIMATE, 4, "", "share of the true ones that are marked, S/N 5 to 7", NULL},
    {"marked_above_7", RX_REPORT_ESTIMATE, 4, "", "the same above 7", NULL},
    {"pieces", RX_REPORT_ESTIMATE, 2, "", "pieces per galaxy that was found", NULL},
    {"pieces_unmarked", RX_REPORT_ESTIMATE, 2, "", "", NULL}};

static const rx_report_column SETS[] = {
    {.name = "condition"},
    {.name = "scene"},
    {"fwhm", RX_REPORT_NUMBER, 2, "pix", "of the PSF", NULL},
    {"tiles", RX_REPORT_COUNT, 0, "", "", NULL},
    {"objects", RX_REPORT_COUNT, 0, "", "", NULL},
    {"mpixels", RX_REPORT_NUMBER, 3, "", "", NULL},
};

enum {
    NCELLS = sizeof CELLS / sizeof *CELLS,
    NPAIRS = sizeof PAIRS / sizeof *PAIRS,
    NINVENTED = sizeof INVENTED / sizeof *INVENTED,
    NSETS = sizeof SETS / sizeof *SETS,
    FIRST_NUMBER = 7, /* of CELLS */
    FIRST_OF_PAIRS = 5
};

typedef struct page {
    const rx_fluxes_numbers *m;
    rx_findings f;
    rx_report_table *cells[RX_SAMPLES], *pairs, *invented, *sets;
} page;

/* All objects of one kind and company on a scene. */
static void add_cells(page *g, rx_fluxes_place p)
{
    const rx_lab *r = g->m->lab;
    char condition[96];
    for (p.condition = 0; p.condition < r->nconditions; p.condition++)
        for (p.bin = 0; p.bin < RX_SNR_BINS; p.bin++)
            for (p.run = 0; p.run < r->nruns; p.run++)
                for (int flux = 0; flux < RX_FLUX_KINDS; flux++) {
                    p.flux = (rx_flux_kind)flux;
                    const rx_fluxes_cell *c = rx_fluxes_cell_of(g->m, &p);
                    if (c->bias.n == 0)
                        continue;
                    rx_lab_condition_name(r, p.condition, condition, sizeof condition);
                    rx_report_row(g->cells[p.sample],
                                  (rx_cell[]){rx_cell_words(rx_scene_name(r->scene[p.scene].id)),
                                              rx_cell_words(p.galaxy ? "galaxy" : "star"),
                                              rx_cell_words(rx_crowd_name(p.crowd)), rx_cell_words(condition),
                                              rx_cell_words(rx_snr_bin_get(p.bin)->name),
                                              rx_cell_words(r->run[p.run].name),
                                              rx_cell_words(rx_flux_name(p.flux)), rx_cell_estimate(c->bias),
                                              rx_cell_estimate(c->scatter), rx_cell_estimate(c->bound),
                                              rx_cell_estimate(c->pull), rx_cell_estimate(c->width),
                                              rx_cell_estimate(c->magerr)});
                }
}

static void show(page *g, const rx_report_table *t, long from, const rx_report_column *c, rx_report_view how)
{
    how.from = from;
    how.to = rx_report_rows(t);
    how.title = c->name;
    how.unit = c->unit;
    how.note = c->help;
    how.value = c->name;
    how.digits = c->digits;
    rx_report_show(g->f.report, t, &how);
}

/* The bias of isolated objects lies open, the rest is folded away; all samples are in the files. */
static void add_crowd(page *g, int s, int galaxy, rx_crowd crowd)
{
    static const rx_report_view how = {.rows = {"condition", "snr"}, .across = {"run", "flux"}};
    rx_fluxes_place p = {.scene = s, .galaxy = galaxy, .crowd = crowd, .sample = RX_SAMPLE_DETECTED};
    const long from = rx_report_rows(g->cells[p.sample]);
    char title[96];
    if (any_objects(g->m, p)) {
        snprintf(title, sizeof title, "%s, %s", galaxy ? "Galaxies" : "Stars", rx_crowd_name(crowd));
        add_cells(g, p);
        if (crowd != RX_CROWD_ISOLATED)
            rx_report_fold(g->f.report, title);
        else
            rx_report_heading(g->f.report, title, NULL);
        show(g, g->cells[p.sample], from, &CELLS[FIRST_NUMBER], how);
        if (crowd == RX_CROWD_ISOLATED)
            rx_report_fold(g->f.report, "Scatter, pulls, MagErr");
        for (int q = FIRST_NUMBER + 1; q < NCELLS; q++)
            if (q != FIRST_NUMBER + 2 || (!galaxy && crowd == RX_CROWD_ISOLATED))
                show(g, g->cells[p.sample], from, &CELLS[q], how);
        rx_report_unfold(g->f.report);
    }
    for (int sample = 0; sample < RX_SAMPLES; sample++) {
        p.sample = (rx_fluxes_sample)sample;
        if (p.sample != RX_SAMPLE_DETECTED)
            add_cells(g, p);
    }
}

static void add_pairs(page *g, int s, rx_fluxes_sample sample)
{
    static const rx_report_view how = {.rows = {"condition", "separation"}, .across = {"run", "flux"}};
    const rx_lab *r = g->m->lab;
    const long from = rx_report_rows(g->pairs);
    rx_pair_place p = {.scene = s, .sample = sample};
    char condition[96], separation[32];
    for (p.condition = 0; p.condition < r->nconditions; p.condition++)
        for (p.bin = 0; p.bin < RX_PAIR_BINS; p.bin++)
            for (p.run = 0; p.run < r->nruns; p.run++)
                for (int flux = 0; flux < RX_FLUX_KINDS; flux++) {
                    const rx_pair_cell *c = rx_pair_cell_of(g->m, &p, (rx_flux_kind)flux);
                    rx_lab_condition_name(r, p.condition, condition, sizeof condition);
                    snprintf(separation, sizeof separation, "%g to %g", RX_PAIR_EDGE[p.bin],
                             RX_PAIR_EDGE[p.bin + 1]);
                    rx_report_row(g->pairs,
                                  (rx_cell[]){rx_cell_words(rx_fluxes_sample_name(sample)),
                                              rx_cell_words(condition), rx_cell_words(separation),
                                              rx_cell_words(r->run[p.run].name),
                                              rx_cell_words(rx_flux_name((rx_flux_kind)flux)),
                                              rx_cell_estimate(*rx_pair_share(g->m, &p)),
                                              rx_cell_estimate(c->size), rx_cell_estimate(c->ratio),
                                              rx_cell_estimate(c->scatter), rx_cell_estimate(c->total)});
                }
    rx_report_fold(g->f.report, sample == RX_SAMPLE_DETECTED
                                    ? "Pairs of which both are detected, each at its place"
                                    : "The same with sources that only the residual of the templates shows");
    for (int q = FIRST_OF_PAIRS; q < NPAIRS; q++)
        show(g, g->pairs, from, &PAIRS[q], how);
    rx_report_unfold(g->f.report);
}

static void add_invented(page *g, int s)
{
    const rx_lab *r = g->m->lab;
    const long from = rx_report_rows(g->invented);
    char condition[96];
    for (int c = 0; c < r->nconditions; c++)
        for (int run = 0; run < r->nruns; run++) {
            const rx_invented_cell *v = rx_invented_of(g->m, c, s, run);
            rx_lab_condition_name(r, c, condition, sizeof condition);
            rx_report_row(g->invented,
                          (rx_cell[]){rx_cell_words(rx_scene_name(r->scene[s].id)), rx_cell_words(condition),
                                      rx_cell_words(r->run[run].name), rx_cell_number((double)v->right[0]),
                                      rx_cell_number((double)v->wrong[0]),
                                      rx_cell_number((double)v->right[1]),
                                      rx_cell_number((double)v->wrong[1]), rx_cell_number((double)v->added),
                                      rx_cell_estimate(v->per_mpixel[0]), rx_cell_estimate(v->per_mpixel[1]),
                                      rx_cell_estimate(v->precision[0]), rx_cell_estimate(v->precision[1]),
                                      rx_cell_estimate(v->flagged_weak), rx_cell_estimate(v->flagged_strong),
                                      rx_cell_estimate(v->pieces[0]), rx_cell_estimate(v->pieces[1])});
            rx_text_printf(rx_report_brief_of(g->f.report),
                           "%s %s %s: %ld true, %ld false; unmarked %ld true, %ld false\n",
                           rx_scene_name(r->scene[s].id), condition, r->run[run].name, v->right[0],
                           v->wrong[0], v->right[1], v->wrong[1]);
        }
    rx_report_show(
        g->f.report, g->invented,
        &(rx_report_view){.from = from, .to = rx_report_rows(g->invented), .title = "Invented sources"});
}

static void add_scene(page *g, int s)
{
    const rx_lab *r = g->m->lab;
    const rx_scene_id scene = r->scene[s].id;
    char prefix[96];
    rx_report_section(g->f.report, rx_scene_name(scene), rx_scene_name(scene));
    snprintf(prefix, sizeof prefix, "%s-", rx_scene_name(scene));
    if (scene != RX_SCENE_BLANK)
        rx_report_place(g->f.report, prefix);
    rx_report_paragraph(g->f.report, rx_scene_about(scene));
    for (int c = 0; c < r->nconditions; c++) {
        const rx_lab_set *set = rx_lab_set_of(r, c, s);
        const rx_lab_table *tile = &set->table[RX_FLUXES_TILE];
        double mpixels = 0;
        for (long t = 0; t < tile->n; t++)
            mpixels += rx_lab_own(tile, t)[RX_FLUXES_MPIXELS];
        rx_lab_condition_name(r, c, prefix, sizeof prefix);
        rx_report_row(g->sets,
                      (rx_cell[]){rx_cell_words(prefix), rx_cell_words(rx_scene_name(scene)),
                                  rx_cell_number(r->sky[c].fwhm), rx_cell_number((double)set->ntiles),
                                  rx_cell_number((double)set->table[RX_FLUXES_OBJECT].n),
                                  rx_cell_number(mpixels)});
    }
    if (scene == RX_SCENE_MIXED_PAIRS) {
        add_pairs(g, s, RX_SAMPLE_DETECTED);
        add_pairs(g, s, RX_SAMPLE_ALL);
    }
    for (int crowd = 0; crowd < RX_CROWDS && scene != RX_SCENE_BLANK; crowd++)
        for (int galaxy = 0; galaxy < 2; galaxy++)
            add_crowd(g, s, galaxy, (rx_crowd)crowd);
    add_invented(g, s);
}

static const char READING[] =
    "Every number is followed by its 95 % interval and by how many objects are behind it. The tables here "
    "are of the "
    "objects that were detected on the image of the restorer of the column; all of its fluxes are of the "
    "same objects. "
    "Sources that only the residual of the templates showed (added) are left out, for AUTO and apertures "
    "know nothing "
    "of them; goals are compared with all (cells.ecsv, summary.json); cells_common.ecsv has those that every "
    "restorer has "
    "detected. S/N is "
    "the true one, in a matched filter on the bare sky. <b>APER</b> is the first of STAGE.PHOT_APERTURES and "
    "<b>WIDE</b> an aperture of 2 FWHM radius, both without a correction for what lies outside of them. "
    "<b>Isolated</b>: no other object of more than 1 % of the flux within (3 + log10 f) FWHM and twice both "
    "half-light "
    "radii, f how many times brighter the other one is. <b>Blended</b>: another one within 1.5 FWHM and 2 "
    "mag; <b>told "
    "apart</b>: both were found, each nearer to its place than half the separation, so that the flux of an "
    "object means "
    "something. <b>Marked</b>: FLAGS_RESTORE calls the source spurious. <b>Goals</b> are compared with "
    "FIELD, "
    "PAIRS and "
    "INJECTED under conditions in which restorers are given the truth; undecided: beyond the limit, but by "
    "less than "
    "the error of the number.";

/* --- figures --- */

enum { CURVES = 1 + RX_FLUXES_RUNS };

/* Bias over S/N: TEMPLATE of every restorer, AUTO of the first. */
static void plot(rx_figures *dst, const rx_fluxes_numbers *m, rx_fluxes_place p)
{
    const rx_lab *r = m->lab;
    static const double middle[RX_SNR_SINGLE] = {7.1, 14, 32, 71, 320, 2000};
    double data[CURVES][4][RX_SNR_SINGLE];
    rx_curve curves[CURVES];
    char names[CURVES][64], id[RX_FIGURE_ID], title[160], condition[96];
    int n = 0, points = 0;
    for (int k = -1; k < r->nruns; k++, n++) {
        p.run = k < 0 ? 0 : k;
        p.flux = k < 0 ? RX_FLUX_AUTO : RX_FLUX_TEMPLATE;
        snprintf(names[n], sizeof names[n], "%s %s", r->run[p.run].name, rx_flux_name(p.flux));
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
                               .color = rx_method_color(r->run[p.run].name),
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
    rx_lab_condition_name(r, p.condition, condition, sizeof condition);
    snprintf(title, sizeof title, "%s, %s, %s", p.galaxy ? "Galaxies" : "Stars", rx_crowd_name(p.crowd),
             condition);
    snprintf(id, sizeof id, "%s-%d-%d-%d", rx_scene_name(r->scene[p.scene].id), p.galaxy, (int)p.crowd,
             p.condition);
    rx_figure_add(dst, id, title, "", RX_FIGURE_CHART);
    rx_plot_curves(dst, &axes, n, curves);
}

static void add_figures(rx_figures *dst, const rx_fluxes_numbers *m)
{
    static const rx_crowd crowds[] = {RX_CROWD_ISOLATED, RX_CROWD_APART};
    const rx_lab *r = m->lab;
    for (int s = 0; s < r->nscenes; s++)
        for (int c = 0; c < r->nconditions && r->scene[s].id != RX_SCENE_BLANK; c++)
            for (int galaxy = 0; galaxy < 2; galaxy++)
                for (int k = 0; k < 2 && dst->n < RX_FIGURES_MAX; k++) {
                    const rx_fluxes_place p = {.condition = c,
                                               .scene = s,
                                               .sample = RX_SAMPLE_DETECTED,
                                               .galaxy = galaxy,
                                               .crowd = crowds[k]};
                    if (any_objects(m, p))
                        plot(dst, m, p);
                }
}

static rx_status report(const rx_lab *lab, const rx_lab_output *output, rx_error *err)
{
    rx_fluxes_numbers m = {0};
    rx_claim_verdicts verdicts;
    page g = {.m = &m};
    rx_status status = rx_fluxes_numbers_make(lab, &m, err);
    if (status == RX_OK)
        status = rx_findings_begin(&g.f, "fluxes", lab->about, 1, output, err);
    if (status != RX_OK)
        goto exit;
    g.sets = rx_report_table_add(g.f.report, "sets", NSETS, SETS, RX_REPORT_IN_JSON);
    for (int sample = 0; sample < RX_SAMPLES; sample++) {
        static const char *const names[RX_SAMPLES] = {[RX_SAMPLE_ALL] = "cells",
                                                      [RX_SAMPLE_DETECTED] = "cells_detected",
                                                      [RX_SAMPLE_COMMON] = "cells_common"};
        g.cells[sample] =
            rx_report_table_add(g.f.report, names[sample], NCELLS, CELLS,
                                sample == RX_SAMPLE_ALL ? RX_REPORT_EVERYWHERE : RX_REPORT_IN_FILE);
    }
    g.pairs = rx_report_table_add(g.f.report, "pairs", NPAIRS, PAIRS, RX_REPORT_EVERYWHERE);
    g.invented = rx_report_table_add(g.f.report, "invented", NINVENTED, INVENTED, RX_REPORT_EVERYWHERE);
    rx_fluxes_verdicts(&m, &verdicts);
    rx_findings_claims(&g.f, &verdicts, lab->run);
    rx_report_sentence(g.f.report, lab->about);
    add_figures(rx_report_figures_of(g.f.report), &m);
    for (int s = 0; s < lab->nscenes; s++)
        add_scene(&g, s);
    rx_report_section(g.f.report, "reading", "How to read this");
    rx_report_paragraph(g.f.report, READING);
    status = rx_findings_end(&g.f, err);
exit:
    rx_fluxes_numbers_free(&m);
    return status;
}

const rx_lab_kind rx_kind_fluxes = {.name = "FLUXES",
                                    .title = "Campaign of fluxes",
                                    .tag = 0x666c757865,
                                    .ntables = RX_FLUXES_TABLES,
                                    .tables = rx_fluxes_tables,
                                    .deep = 1,
                                    .fluxes = 1,
                                    .open = rx_fluxes_open,
                                    .prepare = rx_fluxes_prepare,
                                    .unit = rx_fluxes_unit,
                                    .describe = rx_fluxes_describe,
                                    .report = report};
