/* summary.json, the ECSV tables and the terminal's table of a campaign of fluxes. */
#include <math.h>
#include <stdio.h>

#include "campaign/fluxes_page.h"

/* --- summary.json --- */

static void json_cells(rx_json *j, const rx_fluxes_numbers *m, int c, int s)
{
    const rx_fluxes_results *r = m->results;
    rx_fluxes_place p = {.condition = c, .scene = s, .sample = RX_SAMPLE_ALL};
    rx_json_array(j, "cells", false);
    for (p.galaxy = 0; p.galaxy < 2; p.galaxy++)
        for (int crowd = 0; crowd < RX_CROWDS; crowd++)
            for (p.bin = 0; p.bin < RX_SNR_BINS; p.bin++)
                for (p.run = 0; p.run < r->nruns; p.run++)
                    for (int flux = 0; flux < RX_FLUX_KINDS; flux++) {
                        p.crowd = (rx_crowd)crowd;
                        p.flux = (rx_flux_kind)flux;
                        const rx_fluxes_cell *cell = rx_fluxes_cell_of(m, &p);
                        if (cell->bias.n == 0)
                            continue;
                        rx_json_object(j, NULL, true);
                        rx_json_string(j, "kind", p.galaxy ? "galaxy" : "star");
                        rx_json_string(j, "company", rx_crowd_name(p.crowd));
                        rx_json_string(j, "snr", rx_snr_bin_get(p.bin)->name);
                        rx_json_string(j, "run", r->run[p.run]);
                        rx_json_string(j, "flux", rx_flux_name(p.flux));
                        for (int q = 0; q < RX_FLUX_QUANTITIES; q++)
                            rx_json_estimate(j, rx_flux_quantity_get(q)->name, rx_flux_quantity_of(cell, q));
                        rx_json_end(j);
                    }
    rx_json_end(j);
}

static void json_invented(rx_json *j, const rx_fluxes_numbers *m, int c, int s)
{
    rx_json_array(j, "invented", false);
    for (int run = 0; run < m->results->nruns; run++) {
        const rx_invented_cell *v = rx_invented_of(m, c, s, run);
        rx_json_object(j, NULL, true);
        rx_json_string(j, "run", m->results->run[run]);
        rx_json_count(j, "true", (uint64_t)v->right[0]);
        rx_json_count(j, "true_unmarked", (uint64_t)v->right[1]);
        rx_json_count(j, "false", (uint64_t)v->wrong[0]);
        rx_json_count(j, "false_unmarked", (uint64_t)v->wrong[1]);
        rx_json_count(j, "added", (uint64_t)v->added);
        rx_json_estimate(j, "precision", &v->precision[0]);
        rx_json_estimate(j, "precision_unmarked", &v->precision[1]);
        rx_json_estimate(j, "marked_5_7", &v->flagged_weak);
        rx_json_estimate(j, "marked_above_7", &v->flagged_strong);
        rx_json_end(j);
    }
    rx_json_end(j);
}

static void json_goals(rx_json *j, const rx_fluxes_page *page)
{
    rx_json_array(j, "goals", false);
    for (int i = 0; i < page->nverdicts; i++) {
        const rx_goal_verdict *v = &page->verdict[i];
        rx_json_object(j, NULL, false);
        rx_json_string(j, "goal", rx_goal_name(v->goal));
        rx_json_string(j, "words", rx_goal_words(v->goal));
        rx_json_string(j, "run", page->numbers->results->run[v->run]);
        rx_json_string(j, "verdict", rx_goal_state_name(v->state));
        rx_json_string(j, "said", v->said.data);
        rx_json_end(j);
    }
    rx_json_end(j);
}

void rx_fluxes_json(rx_text *dst, const void *pointer)
{
    const rx_fluxes_page *page = pointer;
    const rx_fluxes_numbers *m = page->numbers;
    const rx_fluxes_results *r = m->results;
    char name[96];
    rx_json j = rx_json_on(dst);
    rx_json_campaign_begin(&j, "fluxes", page->record);
    rx_json_string(&j, "about", r->about);
    json_goals(&j, page);
    rx_json_array(&j, "sets", false);
    for (int c = 0; c < r->nconditions; c++)
        for (int s = 0; s < r->nscenes; s++) {
            const rx_fluxes_set *set = &r->set[c * r->nscenes + s];
            rx_fluxes_condition_name(r, c, name, sizeof name);
            rx_json_object(&j, NULL, false);
            rx_json_string(&j, "condition", name);
            rx_json_number(&j, "fwhm", set->fwhm);
            rx_json_string(&j, "scene", rx_fluxes_scene_name(set->scene));
            rx_json_count(&j, "tiles", (uint64_t)set->ntiles);
            rx_json_count(&j, "objects", (uint64_t)set->n);
            rx_json_number(&j, "mpixels", set->mpixels);
            json_invented(&j, m, c, s);
            if (rx_fluxes_has_objects(set->scene))
                json_cells(&j, m, c, s);
            rx_json_end(&j);
        }
    rx_json_end(&j);
    rx_json_campaign_end(&j, page->record, 0, NULL);
}

/* --- tables --- */

static rx_ecsv begin(rx_text *dst, const rx_fluxes_page *page)
{
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_campaign(&t, "fluxes", page->record);
    rx_ecsv_column(&t, "condition", RX_ECSV_TEXT, "", "seeing, and what restorers were told wrongly");
    rx_ecsv_column(&t, "fwhm", RX_ECSV_FLOAT, "pix", "of the PSF");
    rx_ecsv_column(&t, "scene", RX_ECSV_TEXT, "", "what is on the tiles");
    return t;
}

static void row_begin(rx_ecsv *t, const rx_fluxes_results *r, int c, int s)
{
    char name[96];
    rx_fluxes_condition_name(r, c, name, sizeof name);
    rx_ecsv_text(t, name);
    rx_ecsv_number(t, r->set[c * r->nscenes + s].fwhm);
    rx_ecsv_text(t, rx_fluxes_scene_name(r->set[s].scene));
}

static void cell_row(rx_ecsv *t, const rx_fluxes_numbers *m, const rx_fluxes_place *p)
{
    const rx_fluxes_cell *cell = rx_fluxes_cell_of(m, p);
    if (cell->bias.n == 0)
        return;
    row_begin(t, m->results, p->condition, p->scene);
    rx_ecsv_text(t, rx_fluxes_sample_name(p->sample));
    rx_ecsv_text(t, p->galaxy ? "galaxy" : "star");
    rx_ecsv_text(t, rx_crowd_name(p->crowd));
    rx_ecsv_text(t, rx_snr_bin_get(p->bin)->name);
    rx_ecsv_text(t, m->results->run[p->run]);
    rx_ecsv_text(t, rx_flux_name(p->flux));
    for (int q = 0; q < RX_FLUX_QUANTITIES; q++)
        rx_ecsv_estimate(t, rx_flux_quantity_of(cell, q));
    rx_ecsv_row_end(t);
}

static void cell_rows(rx_ecsv *t, const rx_fluxes_numbers *m, int c, int s)
{
    rx_fluxes_place p = {.condition = c, .scene = s};
    for (int sample = 0; sample < RX_SAMPLES; sample++)
        for (p.galaxy = 0; p.galaxy < 2; p.galaxy++)
            for (int crowd = 0; crowd < RX_CROWDS; crowd++)
                for (p.bin = 0; p.bin < RX_SNR_BINS; p.bin++)
                    for (p.run = 0; p.run < m->results->nruns; p.run++)
                        for (int flux = 0; flux < RX_FLUX_KINDS; flux++) {
                            p.sample = (rx_fluxes_sample)sample;
                            p.crowd = (rx_crowd)crowd;
                            p.flux = (rx_flux_kind)flux;
                            cell_row(t, m, &p);
                        }
}

void rx_fluxes_cells_ecsv(rx_text *dst, const void *pointer)
{
    const rx_fluxes_page *page = pointer;
    const rx_fluxes_results *r = page->numbers->results;
    rx_ecsv t = begin(dst, page);
    rx_ecsv_column(&t, "sample", RX_ECSV_TEXT, "",
                   "all: found by the run; detected: on its image; common: detected by all runs");
    rx_ecsv_column(&t, "kind", RX_ECSV_TEXT, "", "star or galaxy");
    rx_ecsv_column(&t, "company", RX_ECSV_TEXT, "", "isolated, blended, told apart, neither");
    rx_ecsv_column(&t, "snr", RX_ECSV_TEXT, "", "bin of true S/N");
    rx_ecsv_column(&t, "run", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&t, "flux", RX_ECSV_TEXT, "", "what was measured");
    for (int q = 0; q < RX_FLUX_QUANTITIES; q++) {
        const rx_flux_quantity *quantity = rx_flux_quantity_get(q);
        rx_ecsv_estimate_columns(&t, quantity->name, quantity->unit, quantity->help);
    }
    rx_ecsv_columns_end(&t);
    for (int c = 0; c < r->nconditions; c++)
        for (int s = 0; s < r->nscenes; s++)
            cell_rows(&t, page->numbers, c, s);
}

static void pair_rows(rx_ecsv *t, const rx_fluxes_numbers *m, rx_pair_place p)
{
    for (p.bin = 0; p.bin < RX_PAIR_BINS; p.bin++)
        for (p.run = 0; p.run < m->results->nruns; p.run++)
            for (int flux = 0; flux < RX_FLUX_KINDS; flux++) {
                const rx_pair_cell *cell = rx_pair_cell_of(m, &p, (rx_flux_kind)flux);
                row_begin(t, m->results, p.condition, p.scene);
                rx_ecsv_text(t, rx_fluxes_sample_name(p.sample));
                rx_ecsv_number(t, RX_PAIR_EDGE[p.bin]);
                rx_ecsv_number(t, RX_PAIR_EDGE[p.bin + 1]);
                rx_ecsv_text(t, m->results->run[p.run]);
                rx_ecsv_text(t, rx_flux_name((rx_flux_kind)flux));
                rx_ecsv_estimate(t, rx_pair_share(m, &p));
                rx_ecsv_estimate(t, &cell->ratio);
                rx_ecsv_estimate(t, &cell->scatter);
                rx_ecsv_estimate(t, &cell->size);
                rx_ecsv_estimate(t, &cell->total);
                rx_ecsv_row_end(t);
            }
}

void rx_fluxes_pairs_ecsv(rx_text *dst, const void *pointer)
{
    const rx_fluxes_page *page = pointer;
    const rx_fluxes_numbers *m = page->numbers;
    const rx_fluxes_results *r = m->results;
    rx_ecsv t = begin(dst, page);
    rx_ecsv_column(&t, "sample", RX_ECSV_TEXT, "", "all: found by the run; detected: on its image");
    rx_ecsv_column(&t, "from", RX_ECSV_FLOAT, "", "separation, FWHM");
    rx_ecsv_column(&t, "to", RX_ECSV_FLOAT, "", "separation, FWHM");
    rx_ecsv_column(&t, "run", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&t, "flux", RX_ECSV_TEXT, "", "what was measured");
    rx_ecsv_estimate_columns(&t, "both", "", "share of the pairs of which both are found");
    rx_ecsv_estimate_columns(&t, "ratio", "mag", "median error of their flux ratio, fainter less first");
    rx_ecsv_estimate_columns(&t, "scatter", "mag", "scatter of that error");
    rx_ecsv_estimate_columns(&t, "size", "mag", "median of its absolute value");
    rx_ecsv_estimate_columns(&t, "total", "mag", "median error of the total flux");
    rx_ecsv_columns_end(&t);
    for (int c = 0; c < r->nconditions; c++)
        for (int s = 0; s < r->nscenes; s++)
            for (int k = 0; k < RX_PAIR_SAMPLES && r->set[s].scene == RX_FLUXES_PAIRS; k++)
                pair_rows(&t, m, (rx_pair_place){c, s, (rx_fluxes_sample)k, 0, 0});
}

void rx_fluxes_invented_ecsv(rx_text *dst, const void *pointer)
{
    static const char *const ways[] = {"", "_unmarked"};
    const rx_fluxes_page *page = pointer;
    const rx_fluxes_results *r = page->numbers->results;
    char name[40];
    rx_ecsv t = begin(dst, page);
    rx_ecsv_column(&t, "run", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&t, "added", RX_ECSV_LONG, "", "true ones that only the residual showed");
    for (int k = 0; k < 2; k++) {
        const char *what[] = {"right", "wrong", "false_per_mpixel", "precision", "pieces"};
        for (int i = 0; i < 2; i++) {
            snprintf(name, sizeof name, "%s%s", what[i], ways[k]);
            rx_ecsv_column(&t, name, RX_ECSV_LONG, "", i ? "invented detections" : "detections of objects");
        }
        for (int i = 2; i < 5; i++) {
            snprintf(name, sizeof name, "%s%s", what[i], ways[k]);
            rx_ecsv_estimate_columns(&t, name, "", k ? "without marked detections" : "all detections");
        }
    }
    rx_ecsv_estimate_columns(&t, "marked_5_7", "", "share of the true ones that are marked, S/N 5 to 7");
    rx_ecsv_estimate_columns(&t, "marked_above_7", "", "the same above 7");
    rx_ecsv_columns_end(&t);
    for (int c = 0; c < r->nconditions; c++)
        for (int s = 0; s < r->nscenes; s++)
            for (int run = 0; run < r->nruns; run++) {
                const rx_invented_cell *v = rx_invented_of(page->numbers, c, s, run);
                row_begin(&t, r, c, s);
                rx_ecsv_text(&t, r->run[run]);
                rx_ecsv_count(&t, v->added);
                for (int k = 0; k < 2; k++) {
                    rx_ecsv_count(&t, v->right[k]);
                    rx_ecsv_count(&t, v->wrong[k]);
                    rx_ecsv_estimate(&t, &v->per_mpixel[k]);
                    rx_ecsv_estimate(&t, &v->precision[k]);
                    rx_ecsv_estimate(&t, &v->pieces[k]);
                }
                rx_ecsv_estimate(&t, &v->flagged_weak);
                rx_ecsv_estimate(&t, &v->flagged_strong);
                rx_ecsv_row_end(&t);
            }
}

/* --- the terminal --- */

static void brief_cells(rx_text *dst, const rx_fluxes_numbers *m, rx_fluxes_place p)
{
    const rx_fluxes_results *r = m->results;
    char name[96];
    rx_text_printf(dst, "%s: bias of %s, %s, S/N above 10 (mag)\n%-28s",
                   rx_fluxes_scene_name(r->set[p.scene].scene), p.galaxy ? "galaxies" : "stars",
                   rx_crowd_name(p.crowd), "");
    for (int run = 0; run < r->nruns; run++) {
        snprintf(name, sizeof name, "%.8s AUTO", r->run[run]);
        rx_text_printf(dst, " %14s", name);
        snprintf(name, sizeof name, "%.8s TMPL", r->run[run]);
        rx_text_printf(dst, " %14s", name);
    }
    rx_text_add(dst, "\n");
    for (p.condition = 0; p.condition < r->nconditions; p.condition++) {
        rx_fluxes_condition_name(r, p.condition, name, sizeof name);
        rx_text_printf(dst, "%-28s", name);
        for (p.run = 0; p.run < r->nruns; p.run++)
            for (int flux = RX_FLUX_AUTO; flux < RX_FLUX_KINDS; flux += RX_FLUX_TEMPLATE) {
                p.flux = (rx_flux_kind)flux;
                rx_text_printf(dst, " %14.4f", rx_fluxes_cell_of(m, &p)->bias.value);
            }
        rx_text_add(dst, "\n");
    }
}

/* Bias of AUTO and TEMPLATE of isolated objects (PAIRS: of those told apart), invented sources, goals. */
void rx_fluxes_brief(rx_text *dst, const rx_fluxes_page *page)
{
    const rx_fluxes_numbers *m = page->numbers;
    const rx_fluxes_results *r = m->results;
    char name[96];
    for (int s = 0; s < r->nscenes; s++) {
        const rx_fluxes_scene scene = r->set[s].scene;
        for (int galaxy = 0; galaxy < 2; galaxy++) {
            const rx_fluxes_place p = {.scene = s,
                                       .galaxy = galaxy,
                                       .sample = RX_SAMPLE_DETECTED,
                                       .crowd = scene == RX_FLUXES_PAIRS ? RX_CROWD_APART : RX_CROWD_ISOLATED,
                                       .bin = RX_SNR_ABOVE_10};
            if (rx_fluxes_any_objects(m, p))
                brief_cells(dst, m, p);
        }
        for (int c = 0; c < r->nconditions; c++)
            for (int run = 0; run < r->nruns; run++) {
                const rx_invented_cell *v = rx_invented_of(m, c, s, run);
                rx_fluxes_condition_name(r, c, name, sizeof name);
                rx_text_printf(dst, "%s %s %s: %ld true, %ld false; unmarked %ld true, %ld false\n",
                               rx_fluxes_scene_name(scene), name, r->run[run], v->right[0], v->wrong[0],
                               v->right[1], v->wrong[1]);
            }
    }
    for (int i = 0; i < page->nverdicts; i++) {
        const rx_goal_verdict *v = &page->verdict[i];
        rx_text_printf(dst, "%-16s %-8s %-12s %s\n", rx_goal_name(v->goal), r->run[v->run],
                       rx_goal_state_name(v->state), v->said.data != NULL ? v->said.data : "");
    }
}
