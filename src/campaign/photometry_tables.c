/* summary.json, the ECSV tables and the terminal's table of a photometry campaign. */
#include <math.h>
#include <stdio.h>

#include "campaign/photometry_page.h"

enum { CURVE_POINTS = 200 };

static void json_cell(rx_json *j, const rx_photometry_numbers *m, int f, int k, int run)
{
    const rx_photometry_cell *cell = rx_photometry_cell_of(m, f, k, run);
    rx_json_object(j, NULL, false);
    rx_json_string(j, "run", m->results->run[run]);
    for (int q = 0; q < RX_CELL_QUANTITIES; q++)
        rx_json_estimate(j, rx_cell_row_of((rx_cell_quantity)q)->name,
                         rx_cell_get(cell, (rx_cell_quantity)q));
    rx_json_array(j, "completeness", true);
    for (int p = 0; p < m->nprecisions; p++)
        rx_json_estimate(j, NULL, &cell->complete[p]);
    rx_json_end(j);
    rx_json_end(j);
}

static void json_found(rx_json *j, const char *key, const rx_found_duel *d)
{
    rx_json_object(j, key, true);
    rx_json_number(j, "only_first", (double)d->only_first);
    rx_json_number(j, "only_second", (double)d->only_second);
    rx_json_number(j, "mcnemar_p", d->p);
    rx_json_number(j, "mcnemar_p_holm", d->holm);
    rx_json_number(j, "winner", d->winner);
    rx_json_end(j);
}

static void json_duel(rx_json *j, const rx_photometry_numbers *m, int f, int k, int pair)
{
    const rx_photometry_duel *d = rx_photometry_duel_of(m, f, k, pair);
    rx_json_object(j, NULL, false);
    rx_json_string(j, "first", m->results->run[m->pair[pair].first]);
    rx_json_string(j, "second", m->results->run[m->pair[pair].second]);
    json_found(j, "found", &d->found);
    rx_json_array(j, "completeness", false);
    for (int p = 0; p < m->nprecisions; p++)
        json_found(j, NULL, &d->complete[p]);
    rx_json_end(j);
    rx_json_test(j, "error_paired", &d->paired);
    rx_json_number(j, "error_paired_holm", d->holm);
    rx_json_test(j, "error_wilcoxon", &d->wilcoxon);
    rx_json_number(j, "error_wilcoxon_holm", d->holm_wilcoxon);
    rx_json_number(j, "error_winner", d->winner);
    rx_json_end(j);
}

static void json_set(rx_json *j, const rx_photometry_numbers *m, int f, int k)
{
    const rx_photometry_set *set = &m->results->fields[f].sets[k];
    rx_json_object(j, NULL, false);
    rx_json_number(j, "mag", set->mag);
    rx_json_number(j, "snr", set->snr);
    rx_json_count(j, "tiles", (unsigned long long)set->ntiles);
    rx_json_count(j, "stars", (unsigned long long)set->nstars);
    rx_json_number(j, "mpixels", set->mpixels);
    rx_json_array(j, "runs", false);
    for (int run = 0; run < m->results->nruns; run++)
        json_cell(j, m, f, k, run);
    rx_json_end(j);
    rx_json_array(j, "duels", false);
    for (int pair = 0; pair < m->npairs; pair++)
        json_duel(j, m, f, k, pair);
    rx_json_end(j);
    rx_json_end(j);
}

static void json_whole(rx_json *j, const rx_photometry_numbers *m, int f, int run)
{
    const rx_photometry_whole *w = rx_photometry_whole_of(m, f, run);
    rx_json_object(j, NULL, false);
    rx_json_string(j, "run", m->results->run[run]);
    rx_json_estimate(j, "recall", &w->recall);
    rx_json_estimate(j, "precision", &w->precision);
    rx_json_estimate(j, "mag50", &w->mag50);
    rx_json_estimate(j, "mag90", &w->mag90);
    rx_json_estimate(j, "false_per_mpixel", &w->false_per_mpixel);
    rx_json_array(j, "equal_precision", false);
    for (int p = 0; p < m->nprecisions; p++) {
        rx_json_object(j, NULL, false);
        rx_json_number(j, "wanted", m->precision[p]);
        rx_json_number(j, "score", w->cut[p].score);
        rx_json_bool(j, "whole_list", w->cut[p].whole_list != 0);
        rx_json_estimate(j, "precision", &w->cut[p].precision);
        rx_json_estimate(j, "recall", &w->cut[p].recall);
        rx_json_estimate(j, "mag50", &w->cut[p].mag50);
        rx_json_estimate(j, "mag90", &w->cut[p].mag90);
        rx_json_end(j);
    }
    rx_json_end(j);
    rx_json_end(j);
}

static void json_field(rx_json *j, const rx_photometry_numbers *m, int f)
{
    const rx_photometry_field *field = &m->results->fields[f];
    rx_json_object(j, NULL, false);
    rx_json_string(j, "name", field->name);
    rx_json_string(j, "about", field->about);
    rx_json_array(j, "runs", false);
    for (int run = 0; run < m->results->nruns; run++)
        json_whole(j, m, f, run);
    rx_json_end(j);
    rx_json_array(j, "sets", false);
    for (int k = 0; k < field->nsets; k++)
        json_set(j, m, f, k);
    rx_json_end(j);
    rx_json_end(j);
}

void rx_photometry_json(rx_text *dst, const rx_photometry_page *page)
{
    const rx_photometry_numbers *m = page->numbers;
    rx_json j = rx_json_on(dst);
    rx_json_campaign_begin(&j, "photometry", page->record);
    rx_json_numbers(&j, "precisions", m->nprecisions, m->precision);
    rx_json_object(&j, "metrics", false);
    for (int q = 0; q < RX_CELL_QUANTITIES; q++) {
        const rx_cell_row *row = rx_cell_row_of((rx_cell_quantity)q);
        rx_json_object(&j, row->name, true);
        rx_json_string(&j, "unit", row->unit);
        rx_json_string(&j, "meaning", row->help);
        rx_json_end(&j);
    }
    rx_json_end(&j);
    rx_json_array(&j, "runs", false);
    for (int run = 0; run < m->results->nruns; run++) {
        rx_json_object(&j, NULL, true);
        rx_json_string(&j, "name", m->results->run[run]);
        rx_json_string(&j, "settings", m->results->settings[run]);
        rx_json_end(&j);
    }
    rx_json_end(&j);
    rx_json_array(&j, "fields", false);
    for (int f = 0; f < m->results->nfields; f++)
        json_field(&j, m, f);
    rx_json_end(&j);
    rx_json_campaign_end(&j, page->record, page->nverdicts, page->verdict);
}

static rx_ecsv begin(rx_text *dst, const rx_photometry_page *page)
{
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_campaign(&t, "photometry", page->record);
    rx_ecsv_column(&t, "field", RX_ECSV_TEXT, "", "field");
    return t;
}

void rx_photometry_sets_ecsv(rx_text *dst, const rx_photometry_page *page)
{
    const rx_photometry_numbers *m = page->numbers;
    char name[32], help[64];
    rx_ecsv t = begin(dst, page);
    rx_ecsv_column(&t, "mag", RX_ECSV_FLOAT, "mag", "of the stars");
    rx_ecsv_column(&t, "snr", RX_ECSV_FLOAT, "", "of the stars in a matched filter on the background");
    rx_ecsv_column(&t, "run", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&t, "stars", RX_ECSV_LONG, "", "stars of the set");
    rx_ecsv_column(&t, "nfalse", RX_ECSV_LONG, "", "false detections on its tiles");
    for (int q = 0; q < RX_CELL_QUANTITIES; q++) {
        const rx_cell_row *row = rx_cell_row_of((rx_cell_quantity)q);
        rx_ecsv_estimate_columns(&t, row->name, row->unit, row->help);
    }
    for (int p = 0; p < m->nprecisions; p++) {
        snprintf(name, sizeof name, "completeness%d", p + 1);
        snprintf(help, sizeof help, "share of the stars found at precision %g", m->precision[p]);
        rx_ecsv_estimate_columns(&t, name, "", help);
    }
    rx_ecsv_columns_end(&t);
    for (int f = 0; f < m->results->nfields; f++)
        for (int k = 0; k < m->results->fields[f].nsets; k++)
            for (int run = 0; run < m->results->nruns; run++) {
                const rx_photometry_cell *cell = rx_photometry_cell_of(m, f, k, run);
                const rx_photometry_set *set = &m->results->fields[f].sets[k];
                rx_ecsv_text(&t, m->results->fields[f].name);
                rx_ecsv_number(&t, set->mag);
                rx_ecsv_number(&t, set->snr);
                rx_ecsv_text(&t, m->results->run[run]);
                rx_ecsv_count(&t, set->nstars);
                rx_ecsv_count(&t, set->run[run].nfalse);
                for (int q = 0; q < RX_CELL_QUANTITIES; q++)
                    rx_ecsv_estimate(&t, rx_cell_get(cell, (rx_cell_quantity)q));
                for (int p = 0; p < m->nprecisions; p++)
                    rx_ecsv_estimate(&t, &cell->complete[p]);
                rx_ecsv_row_end(&t);
            }
}

static void duel_row(rx_ecsv *t, const rx_photometry_numbers *m, int f, int k, int pair)
{
    const rx_photometry_duel *d = rx_photometry_duel_of(m, f, k, pair);
    rx_ecsv_text(t, m->results->fields[f].name);
    rx_ecsv_number(t, m->results->fields[f].sets[k].mag);
    rx_ecsv_text(t, m->results->run[m->pair[pair].first]);
    rx_ecsv_text(t, m->results->run[m->pair[pair].second]);
    for (int which = -1; which < m->nprecisions; which++) {
        const rx_found_duel *found = which < 0 ? &d->found : &d->complete[which];
        rx_ecsv_count(t, found->only_first);
        rx_ecsv_count(t, found->only_second);
        rx_ecsv_number(t, found->p);
        rx_ecsv_number(t, found->holm);
    }
    rx_ecsv_estimate(t, &d->paired.difference);
    rx_ecsv_number(t, d->paired.statistic);
    rx_ecsv_number(t, d->paired.effect);
    rx_ecsv_number(t, d->paired.p);
    rx_ecsv_number(t, d->holm);
    rx_ecsv_number(t, d->wilcoxon.p);
    rx_ecsv_number(t, d->holm_wilcoxon);
    rx_ecsv_row_end(t);
}

void rx_photometry_duels_ecsv(rx_text *dst, const rx_photometry_page *page)
{
    static const char *const parts[] = {"only_first", "only_second", "p", "p_holm"};
    static const char *const helps[] = {"stars that only the first found", "stars that only the second found",
                                        "McNemar exact, two-sided", "adjusted for the magnitudes"};
    const rx_photometry_numbers *m = page->numbers;
    char name[48], help[96];
    rx_ecsv t = begin(dst, page);
    rx_ecsv_column(&t, "mag", RX_ECSV_FLOAT, "mag", "of the stars");
    rx_ecsv_column(&t, "first", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&t, "second", RX_ECSV_TEXT, "", "restorer");
    for (int which = -1; which < m->nprecisions; which++)
        for (int i = 0; i < 4; i++) {
            if (which < 0) {
                snprintf(name, sizeof name, "found_%s", parts[i]);
                snprintf(help, sizeof help, "%s, whole lists", helps[i]);
            } else {
                snprintf(name, sizeof name, "completeness%d_%s", which + 1, parts[i]);
                snprintf(help, sizeof help, "%s, at precision %g", helps[i], m->precision[which]);
            }
            rx_ecsv_column(&t, name, i < 2 ? RX_ECSV_LONG : RX_ECSV_FLOAT, "", help);
        }
    rx_ecsv_estimate_columns(&t, "error", "%", "mean of the difference of 100 |F - F0| / F0, first - second");
    rx_ecsv_column(&t, "error_t", RX_ECSV_FLOAT, "", "paired t");
    rx_ecsv_column(&t, "error_d_z", RX_ECSV_FLOAT, "", "mean over standard deviation of the differences");
    rx_ecsv_column(&t, "error_p", RX_ECSV_FLOAT, "", "of t, two-sided");
    rx_ecsv_column(&t, "error_p_holm", RX_ECSV_FLOAT, "", "adjusted for the magnitudes");
    rx_ecsv_column(&t, "error_wilcoxon_p", RX_ECSV_FLOAT, "", "signed ranks, two-sided");
    rx_ecsv_column(&t, "error_wilcoxon_p_holm", RX_ECSV_FLOAT, "", "adjusted for the magnitudes");
    rx_ecsv_columns_end(&t);
    for (int f = 0; f < m->results->nfields; f++)
        for (int k = 0; k < m->results->fields[f].nsets; k++)
            for (int pair = 0; pair < m->npairs; pair++)
                duel_row(&t, m, f, k, pair);
}

void rx_photometry_cuts_ecsv(rx_text *dst, const rx_photometry_page *page)
{
    const rx_photometry_numbers *m = page->numbers;
    rx_ecsv t = begin(dst, page);
    rx_ecsv_column(&t, "run", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&t, "wanted", RX_ECSV_FLOAT, "", "precision wanted; nan: the whole list");
    rx_ecsv_column(&t, "score", RX_ECSV_FLOAT, "", "lowest score; inf: the precision is never reached");
    rx_ecsv_column(&t, "whole_list", RX_ECSV_INT, "", "1: the list ends above this precision");
    rx_ecsv_estimate_columns(&t, "precision", "", "over all sets of the field");
    rx_ecsv_estimate_columns(&t, "recall", "", "over all sets of the field");
    rx_ecsv_estimate_columns(&t, "mag50", "mag", "magnitude of 50 % completeness");
    rx_ecsv_estimate_columns(&t, "mag90", "mag", "magnitude of 90 % completeness");
    rx_ecsv_columns_end(&t);
    for (int f = 0; f < m->results->nfields; f++)
        for (int run = 0; run < m->results->nruns; run++)
            for (int p = -1; p < m->nprecisions; p++) {
                const rx_photometry_whole *w = rx_photometry_whole_of(m, f, run);
                rx_ecsv_text(&t, m->results->fields[f].name);
                rx_ecsv_text(&t, m->results->run[run]);
                rx_ecsv_number(&t, p < 0 ? NAN : m->precision[p]);
                rx_ecsv_number(&t, p < 0 ? -INFINITY : w->cut[p].score);
                rx_ecsv_count(&t, p < 0 || w->cut[p].whole_list);
                rx_ecsv_estimate(&t, p < 0 ? &w->precision : &w->cut[p].precision);
                rx_ecsv_estimate(&t, p < 0 ? &w->recall : &w->cut[p].recall);
                rx_ecsv_estimate(&t, p < 0 ? &w->mag50 : &w->cut[p].mag50);
                rx_ecsv_estimate(&t, p < 0 ? &w->mag90 : &w->cut[p].mag90);
                rx_ecsv_row_end(&t);
            }
}

void rx_photometry_curves_ecsv(rx_text *dst, const rx_photometry_page *page)
{
    const rx_photometry_numbers *m = page->numbers;
    rx_ecsv t = begin(dst, page);
    rx_ecsv_column(&t, "mag", RX_ECSV_FLOAT, "mag", "of the stars");
    rx_ecsv_column(&t, "run", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&t, "score", RX_ECSV_FLOAT, "", "S/N of the detection");
    rx_ecsv_column(&t, "recall", RX_ECSV_FLOAT, "", "of the stars with this score or a higher one");
    rx_ecsv_column(&t, "precision", RX_ECSV_FLOAT, "", "the same");
    rx_ecsv_columns_end(&t);
    for (int f = 0; f < m->results->nfields; f++)
        for (int k = 0; k < m->results->fields[f].nsets; k++)
            for (int run = 0; run < m->results->nruns; run++) {
                const rx_pr *pr = &rx_photometry_cell_of(m, f, k, run)->pr;
                long skip = pr->n / CURVE_POINTS + 1;
                for (long i = 0; i < pr->n; i++) {
                    if (i % skip != 0 && i + 1 < pr->n)
                        continue;
                    rx_ecsv_text(&t, m->results->fields[f].name);
                    rx_ecsv_number(&t, m->results->fields[f].sets[k].mag);
                    rx_ecsv_text(&t, m->results->run[run]);
                    rx_ecsv_number(&t, pr->point[i].score);
                    rx_ecsv_number(&t, pr->point[i].recall);
                    rx_ecsv_number(&t, pr->point[i].precision);
                    rx_ecsv_row_end(&t);
                }
            }
}

static void column(rx_text *dst, double value, int digits)
{
    if (isfinite(value))
        rx_text_printf(dst, " %9.*f", digits, value);
    else
        rx_text_printf(dst, " %9s", "-");
}

void rx_photometry_brief(rx_text *dst, const rx_photometry_page *page)
{
    const rx_photometry_numbers *m = page->numbers;
    for (int f = 0; f < m->results->nfields; f++) {
        rx_text_printf(dst, "field %s\n%-14s %9s %9s %9s", m->results->fields[f].name, "run", "recall",
                       "precision", "mag50");
        for (int p = 0; p < m->nprecisions; p++)
            rx_text_printf(dst, "  R at %-4g mag50 at", m->precision[p]);
        rx_text_add(dst, "\n");
        for (int run = 0; run < m->results->nruns; run++) {
            const rx_photometry_whole *w = rx_photometry_whole_of(m, f, run);
            rx_text_printf(dst, "%-14s", m->results->run[run]);
            column(dst, w->recall.value, 3);
            column(dst, w->precision.value, 3);
            column(dst, w->mag50.value, 2);
            for (int p = 0; p < m->nprecisions; p++) {
                column(dst, w->cut[p].recall.value, 3);
                column(dst, w->cut[p].mag50.value, 2);
            }
            rx_text_add(dst, "\n");
        }
    }
    rx_brief_verdicts(dst, page->nverdicts, page->verdict);
}
