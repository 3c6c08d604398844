/* summary.json, the ECSV tables and the terminal's table of a detection campaign. */
#include <math.h>
#include <stdio.h>

#include "campaign/detection_page.h"

static void json_cell(rx_json *j, const rx_detection_numbers *m, int c, int s, int k)
{
    const rx_detection_results *r = m->results;
    const rx_detection_cell *cell = rx_detection_cell_of(m, c, s, k);
    rx_json_object(j, NULL, false);
    rx_json_string(j, "run", rx_detection_column_name(m, k));
    for (int q = 0; q < rx_quantity_count(r, r->set[s].scene); q++) {
        rx_quantity quantity;
        rx_quantity_get(r, r->set[s].scene, q, &quantity);
        rx_json_estimate(j, quantity.name, &cell->value[q]);
    }
    rx_json_end(j);
}

static void json_set(rx_json *j, const rx_detection_numbers *m, int c, int s)
{
    const rx_detection_results *r = m->results;
    const rx_detection_set *set = &r->set[c * r->nscenes + s];
    rx_json_object(j, NULL, false);
    rx_json_string(j, "scene", rx_detection_scene_name(set->scene));
    rx_json_count(j, "tiles", (uint64_t)set->ntiles);
    rx_json_count(j, "objects", (uint64_t)set->n);
    rx_json_number(j, "mpixels", set->mpixels);
    rx_json_array(j, "runs", false);
    for (int k = 0; k < m->ncolumns; k++)
        json_cell(j, m, c, s, k);
    rx_json_end(j);
    rx_json_array(j, "duels", false);
    for (int k = 0; k < m->nrivals && rx_detection_scene_is_list(set->scene); k++) {
        const rx_detection_duel *d = rx_detection_duel_of(m, c, s, k);
        rx_json_object(j, NULL, true);
        rx_json_string(j, "first", rx_detection_column_name(m, m->hero));
        rx_json_string(j, "second", rx_detection_column_name(m, m->rival[k]));
        rx_json_number(j, "only_first", (double)d->only_first);
        rx_json_number(j, "only_second", (double)d->only_second);
        rx_json_number(j, "mcnemar_p", d->p);
        rx_json_end(j);
    }
    rx_json_end(j);
    rx_json_end(j);
}

void rx_detection_json(rx_text *dst, const void *pointer)
{
    const rx_detection_page *page = pointer;
    const rx_detection_numbers *m = page->numbers;
    const rx_detection_results *r = m->results;
    rx_json j = rx_json_on(dst);
    rx_json_campaign_begin(&j, "detection", page->record);
    rx_json_string(&j, "about", r->about);
    rx_json_numbers(&j, "precisions", r->nprecisions, r->precision);
    rx_json_array(&j, "conditions", false);
    for (int c = 0; c < r->nconditions; c++) {
        char name[96];
        rx_detection_condition_name(r, c, name, sizeof name);
        rx_json_object(&j, NULL, false);
        rx_json_string(&j, "name", name);
        rx_json_number(&j, "fwhm", r->set[c * r->nscenes].fwhm);
        rx_json_number(&j, "psf_error", r->condition[c].psf_error);
        rx_json_number(&j, "sky_error", r->condition[c].sky_error);
        rx_json_number(&j, "noise_error", r->condition[c].noise_error);
        rx_json_array(&j, "scenes", false);
        for (int s = 0; s < r->nscenes; s++)
            json_set(&j, m, c, s);
        rx_json_end(&j);
        rx_json_end(&j);
    }
    rx_json_end(&j);
    rx_json_campaign_end(&j, page->record, page->nverdicts, page->verdict);
}

static rx_ecsv begin(rx_text *dst, const rx_detection_page *page)
{
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_campaign(&t, "detection", page->record);
    rx_ecsv_column(&t, "condition", RX_ECSV_TEXT, "", "seeing, and what restorers were told wrongly");
    rx_ecsv_column(&t, "fwhm", RX_ECSV_FLOAT, "pix", "of the PSF");
    rx_ecsv_column(&t, "scene", RX_ECSV_TEXT, "", "what is on the tiles");
    return t;
}

static void row_begin(rx_ecsv *t, const rx_detection_results *r, int c, int s)
{
    char name[96];
    rx_detection_condition_name(r, c, name, sizeof name);
    rx_ecsv_text(t, name);
    rx_ecsv_number(t, r->set[c * r->nscenes].fwhm);
    rx_ecsv_text(t, rx_detection_scene_name(r->set[s].scene));
}

void rx_detection_cells_ecsv(rx_text *dst, const void *pointer)
{
    const rx_detection_page *page = pointer;
    const rx_detection_numbers *m = page->numbers;
    const rx_detection_results *r = m->results;
    rx_ecsv t = begin(dst, page);
    rx_ecsv_column(&t, "run", RX_ECSV_TEXT, "", "method; RL: at its best");
    rx_ecsv_column(&t, "setting", RX_ECSV_TEXT, "", "RL at its best: which one it is");
    rx_ecsv_column(&t, "quantity", RX_ECSV_TEXT, "", "what was measured");
    rx_ecsv_estimate_columns(&t, "value", "", "of the quantity");
    rx_ecsv_columns_end(&t);
    for (int c = 0; c < r->nconditions; c++)
        for (int s = 0; s < r->nscenes; s++)
            for (int k = 0; k < m->ncolumns; k++)
                for (int q = 0; q < rx_quantity_count(r, r->set[s].scene); q++) {
                    const rx_detection_cell *cell = rx_detection_cell_of(m, c, s, k);
                    rx_quantity quantity;
                    rx_quantity_get(r, r->set[s].scene, q, &quantity);
                    row_begin(&t, r, c, s);
                    rx_ecsv_text(&t, rx_detection_column_name(m, k));
                    rx_ecsv_text(&t, cell->chosen[q]);
                    rx_ecsv_text(&t, quantity.name);
                    rx_ecsv_estimate(&t, &cell->value[q]);
                    rx_ecsv_row_end(&t);
                }
}

void rx_detection_duels_ecsv(rx_text *dst, const void *pointer)
{
    const rx_detection_page *page = pointer;
    const rx_detection_numbers *m = page->numbers;
    const rx_detection_results *r = m->results;
    rx_ecsv t = begin(dst, page);
    rx_ecsv_column(&t, "first", RX_ECSV_TEXT, "", "method");
    rx_ecsv_column(&t, "second", RX_ECSV_TEXT, "", "method");
    rx_ecsv_column(&t, "only_first", RX_ECSV_LONG, "", "objects that only the first found, first precision");
    rx_ecsv_column(&t, "only_second", RX_ECSV_LONG, "", "objects that only the second found");
    rx_ecsv_column(&t, "p", RX_ECSV_FLOAT, "", "McNemar exact, two-sided");
    rx_ecsv_columns_end(&t);
    for (int c = 0; c < r->nconditions; c++)
        for (int s = 0; s < r->nscenes; s++)
            for (int k = 0; k < m->nrivals && rx_detection_scene_is_list(r->set[s].scene); k++) {
                const rx_detection_duel *d = rx_detection_duel_of(m, c, s, k);
                row_begin(&t, r, c, s);
                rx_ecsv_text(&t, rx_detection_column_name(m, m->hero));
                rx_ecsv_text(&t, rx_detection_column_name(m, m->rival[k]));
                rx_ecsv_count(&t, d->only_first);
                rx_ecsv_count(&t, d->only_second);
                rx_ecsv_number(&t, d->p);
                rx_ecsv_row_end(&t);
            }
}

/* The first two quantities of every scene. */
void rx_detection_brief(rx_text *dst, const rx_detection_page *page)
{
    const rx_detection_numbers *m = page->numbers;
    const rx_detection_results *r = m->results;
    for (int s = 0; s < r->nscenes; s++)
        for (int q = 0; q < 2 && q < rx_quantity_count(r, r->set[s].scene); q++) {
            rx_quantity quantity;
            rx_quantity_get(r, r->set[s].scene, q, &quantity);
            rx_text_printf(dst, "%s %s\n%-28s", rx_detection_scene_name(r->set[s].scene), quantity.name, "");
            for (int k = 0; k < m->ncolumns; k++)
                if (rx_detection_shown(m, k))
                    rx_text_printf(dst, " %9s", rx_detection_column_name(m, k));
            for (int c = 0; c < r->nconditions; c++) {
                char name[96];
                rx_detection_condition_name(r, c, name, sizeof name);
                rx_text_printf(dst, "\n%-28s", name);
                for (int k = 0; k < m->ncolumns; k++)
                    if (rx_detection_shown(m, k))
                        rx_text_printf(dst, " %9.*f", quantity.digits,
                                       rx_detection_cell_of(m, c, s, k)->value[q].value);
            }
            rx_text_add(dst, "\n");
        }
    rx_brief_verdicts(dst, page->nverdicts, page->verdict);
}
