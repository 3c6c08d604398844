/* report.html of a photometry campaign. */
#include "campaign/photometry_page.h"

#include <math.h>
#include <stdio.h>

#include "validate/bootstrap.h"
#include "validate/escape.h"
#include "validate/page.h"

static void heads(rx_text *dst, int n, const char *const *names)
{
    for (int i = 0; i < n; i++)
        rx_page_head(dst, RX_RIGHT, names[i]);
}

static void escaped_paragraph(rx_text *dst, const char *text)
{
    rx_text html = {0};
    rx_escape_html(&html, text);
    if (html.data != NULL && html.length > 0)
        rx_page_paragraph(dst, html.data);
    dst->failed = dst->failed || html.failed;
    rx_text_free(&html);
}

static void write_what(rx_text *dst, const rx_photometry_numbers *m)
{
    const rx_photometry_results *r = m->results;
    rx_page_paragraph(
        dst,
        "Stars of one known magnitude at a time are put onto tiles that also hold other objects and noise; "
        "every restorer restores the same tiles, and the same program detects and measures. A star is "
        "found when a detection lies on it; a false detection is one that is neither one of the stars "
        "nor any object known to be there.");
    rx_page_section(dst, "runs", "Restorers and fields");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "restorer or field");
    rx_page_head(dst, RX_LEFT, "what it is");
    rx_page_row_end(dst);
    for (int run = 0; run < r->nruns; run++) {
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, r->run[run]);
        rx_page_cell_text(dst, r->settings[run]);
        rx_page_row_end(dst);
    }
    for (int f = 0; f < r->nfields; f++) {
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, r->fields[f].name);
        rx_page_cell_text(dst, r->fields[f].about);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

static void write_words(rx_text *dst, const rx_photometry_numbers *m, int f)
{
    for (int p = 0; p < m->npairs; p++) {
        rx_text said = {0};
        rx_photometry_pair_words(&said, m, f, p);
        rx_page_said(dst, &said);
        rx_text_free(&said);
    }
}

static void threshold_row(rx_text *dst, const rx_photometry_numbers *m, int f, int run, int p)
{
    const rx_photometry_whole *w = rx_photometry_whole_of(m, f, run);
    const rx_photometry_cut *cut = &w->cut[p];
    char text[32];
    snprintf(text, sizeof text, "P=%g", m->precision[p]);
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, m->results->run[run]);
    rx_page_cell_text(dst, text);
    if (isinf(cut->score))
        rx_page_cell_html(dst, RX_RIGHT, "never reached");
    else
        rx_page_cell_number(dst, cut->score, 2);
    rx_page_cell_interval(dst, &cut->precision, 4);
    rx_page_cell_interval(dst, &cut->recall, 3);
    rx_page_cell_interval(dst, &cut->mag50, 2);
    rx_page_cell_interval(dst, &cut->mag90, 2);
    rx_page_cell_text(dst, cut->whole_list ? "list ends above" : "");
    rx_page_row_end(dst);
}

static void write_thresholds(rx_text *dst, const rx_photometry_numbers *m, int f)
{
    static const char *const names[] = {"score from", "precision", "recall", "50 % complete (mag)",
                                        "90 % complete (mag)"};
    rx_page_heading(dst, "Over all magnitudes: depth and thresholds", NULL);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "restorer");
    rx_page_head(dst, RX_LEFT, "list");
    heads(dst, (int)(sizeof names / sizeof *names), names);
    rx_page_head(dst, RX_RIGHT, "false per Mpixel");
    rx_page_row_end(dst);
    for (int run = 0; run < m->results->nruns; run++) {
        const rx_photometry_whole *w = rx_photometry_whole_of(m, f, run);
        rx_page_row(dst, NULL);
        rx_page_cell_text(dst, m->results->run[run]);
        rx_page_cell_text(dst, "whole");
        rx_page_cell_number(dst, NAN, 0);
        rx_page_cell_interval(dst, &w->precision, 4);
        rx_page_cell_interval(dst, &w->recall, 3);
        rx_page_cell_interval(dst, &w->mag50, 2);
        rx_page_cell_interval(dst, &w->mag90, 2);
        rx_page_cell_interval(dst, &w->false_per_mpixel, 2);
        rx_page_row_end(dst);
    }
    for (int p = 0; p < m->nprecisions; p++)
        for (int run = 0; run < m->results->nruns; run++)
            threshold_row(dst, m, f, run, p);
    rx_page_table_end(dst);
    rx_page_note(
        dst,
        "The threshold of a row is the lowest score (S/N of the detection) at which stars found / (stars "
        "found + false detections), all magnitudes together, is at least the precision named. Where a "
        "whole list is purer than that, a lower DETECT_THRESH would have found more, and completeness "
        "is a lower limit. A depth with an infinite end is a limit, too.");
}

static void set_cell(rx_text *dst, const rx_photometry_set *set)
{
    char text[96];
    snprintf(text, sizeof text, "<b>%g</b> <small>S/N %.3g</small>", set->mag, set->snr);
    rx_page_cell_html(dst, RX_LEFT, text);
}

static void quantity_table(rx_text *dst, const rx_photometry_numbers *m, int f, rx_cell_quantity quantity)
{
    const rx_photometry_field *field = &m->results->fields[f];
    const rx_cell_row *row = rx_cell_row_of(quantity);
    rx_page_heading(dst, row->name, row->unit[0] != '\0' ? row->unit : NULL);
    rx_text help = {0};
    rx_escape_html(&help, row->help);
    rx_page_note(dst, help.data != NULL ? help.data : "");
    dst->failed = dst->failed || help.failed;
    rx_text_free(&help);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "magnitude");
    for (int run = 0; run < m->results->nruns; run++)
        rx_page_head(dst, RX_RIGHT, m->results->run[run]);
    rx_page_row_end(dst);
    for (int k = 0; k < field->nsets; k++) {
        rx_page_row(dst, NULL);
        set_cell(dst, &field->sets[k]);
        for (int run = 0; run < m->results->nruns; run++)
            rx_page_cell_estimate(dst, rx_cell_get(rx_photometry_cell_of(m, f, k, run), quantity),
                                  row->digits);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

static void winner_cell(rx_text *dst, const rx_photometry_numbers *m, int pair, int winner)
{
    const char *name =
        winner == 0 ? "" : m->results->run[winner > 0 ? m->pair[pair].first : m->pair[pair].second];
    if (winner == 0)
        rx_page_cell_text(dst, "");
    else
        rx_page_cell_verdict(dst, winner > 0 ? RX_MARK_GOOD : RX_MARK_BAD, name);
}

static void pair_heading(rx_text *dst, const rx_photometry_numbers *m, int pair, const char *what)
{
    char text[160];
    snprintf(text, sizeof text, "%.24s against %.24s: %.80s", m->results->run[m->pair[pair].first],
             m->results->run[m->pair[pair].second], what);
    rx_page_heading(dst, text, NULL);
}

/* which: -1 whole lists, else a precision; shares of both beside the counts of the stars that differ. */
static void found_table(rx_text *dst, const rx_photometry_numbers *m, int f, int pair, int which)
{
    const rx_photometry_field *field = &m->results->fields[f];
    const rx_run_pair two = m->pair[pair];
    char text[64] = "stars found, whole lists";
    if (which >= 0)
        snprintf(text, sizeof text, "completeness at precision %g", m->precision[which]);
    pair_heading(dst, m, pair, text);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "magnitude");
    rx_page_head(dst, RX_RIGHT, m->results->run[two.first]);
    rx_page_head(dst, RX_RIGHT, m->results->run[two.second]);
    static const char *const names[] = {"only the first", "only the second", "p", "p, Holm"};
    heads(dst, (int)(sizeof names / sizeof *names), names);
    rx_page_head(dst, RX_LEFT, "more");
    rx_page_row_end(dst);
    for (int k = 0; k < field->nsets; k++) {
        const rx_photometry_duel *d = rx_photometry_duel_of(m, f, k, pair);
        const rx_found_duel *found = which < 0 ? &d->found : &d->complete[which];
        const rx_photometry_cell *a = rx_photometry_cell_of(m, f, k, two.first);
        const rx_photometry_cell *b = rx_photometry_cell_of(m, f, k, two.second);
        rx_page_row(dst, NULL);
        set_cell(dst, &field->sets[k]);
        rx_page_cell_estimate(dst, which < 0 ? &a->recall : &a->complete[which], 3);
        rx_page_cell_estimate(dst, which < 0 ? &b->recall : &b->complete[which], 3);
        rx_page_cell_count(dst, found->only_first);
        rx_page_cell_count(dst, found->only_second);
        rx_page_cell_p(dst, found->p, log(found->p));
        rx_page_cell_p(dst, found->holm, log(found->holm));
        winner_cell(dst, m, pair, found->winner);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

static void error_table(rx_text *dst, const rx_photometry_numbers *m, int f, int pair)
{
    static const char *const names[] = {"stars",      "mean difference", "t", "p", "p, Holm", "d_z",
                                        "Wilcoxon p", "Wilcoxon p, Holm"};
    const rx_photometry_field *field = &m->results->fields[f];
    pair_heading(dst, m, pair, "100 |F - F0| / F0 of the stars that both found, %");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "magnitude");
    heads(dst, (int)(sizeof names / sizeof *names), names);
    rx_page_head(dst, RX_LEFT, "smaller errors");
    rx_page_row_end(dst);
    for (int k = 0; k < field->nsets; k++) {
        const rx_photometry_duel *d = rx_photometry_duel_of(m, f, k, pair);
        rx_page_row(dst, NULL);
        set_cell(dst, &field->sets[k]);
        rx_page_cell_count(dst, d->paired.difference.n);
        rx_page_cell_difference(dst, &d->paired.difference, 3, d->winner);
        rx_page_cell_number(dst, d->paired.statistic, 2);
        rx_page_cell_p(dst, d->paired.p, d->paired.ln_p);
        rx_page_cell_p(dst, d->holm, log(d->holm));
        rx_page_cell_number(dst, d->paired.effect, 3);
        rx_page_cell_p(dst, d->wilcoxon.p, d->wilcoxon.ln_p);
        rx_page_cell_p(dst, d->holm_wilcoxon, log(d->holm_wilcoxon));
        winner_cell(dst, m, pair, d->winner);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

static void write_duels(rx_text *dst, const rx_photometry_numbers *m, int f)
{
    rx_text_add(dst, "<details open><summary><b>Duels on the same stars</b></summary>\n");
    for (int pair = 0; pair < m->npairs; pair++) {
        for (int p = 0; p < m->nprecisions; p++)
            found_table(dst, m, f, pair, p);
        found_table(dst, m, f, pair, -1);
        error_table(dst, m, f, pair);
    }
    rx_page_note(
        dst,
        "Found: McNemar's exact test on the stars that only one of the two found. Errors: Student's paired t "
        "and Wilcoxon's signed ranks; green where the first has the smaller errors. Holm adjusts for the "
        "magnitudes of a table; a winner is named for an adjusted p below 0.05.");
    rx_text_add(dst, "</details>\n");
}

static void write_field(rx_text *dst, const rx_photometry_page *page, int f)
{
    const rx_photometry_numbers *m = page->numbers;
    const rx_photometry_field *field = &m->results->fields[f];
    char id[24], prefix[24];
    rx_text title = {0};
    long stars = 0, tiles = 0;
    double mpixels = 0;
    for (int k = 0; k < field->nsets; k++) {
        stars += field->sets[k].nstars;
        tiles += field->sets[k].ntiles;
        mpixels += field->sets[k].mpixels;
    }
    snprintf(id, sizeof id, "field%d", f);
    rx_text_printf(&title, "Field: %s", field->name);
    rx_page_section(dst, id, title.data != NULL ? title.data : "");
    rx_text_free(&title);
    escaped_paragraph(dst, field->about);
    rx_text_printf(dst, "<p>%d magnitudes, %ld tiles (%.4g Mpixel), %ld stars.</p>\n", field->nsets, tiles,
                   mpixels, stars);
    write_words(dst, m, f);
    write_thresholds(dst, m, f);
    snprintf(prefix, sizeof prefix, "field%d-", f);
    rx_page_figures(dst, &page->figures, prefix);
    rx_page_heading(dst, "Precision against recall", NULL);
    snprintf(prefix, sizeof prefix, "curve%d-", f);
    rx_page_figures(dst, &page->figures, prefix);
    rx_page_note(
        dst, "From the surest detections to the whole list, by falling score. Further up and to the right is "
             "better.");
    write_duels(dst, m, f);
    rx_text_add(dst, "<details open><summary><b>Tables by magnitude</b></summary>\n");
    for (int q = 0; q < RX_CELL_QUANTITIES; q++)
        quantity_table(dst, m, f, (rx_cell_quantity)q);
    rx_text_add(dst, "</details>\n");
}

static void write_reading(rx_text *dst)
{
    char html[1600];
    rx_page_section(dst, "reading", "How to read this");
    snprintf(
        html, sizeof html,
        "Every number is followed by its 95 %% interval and the number of stars behind it. Shares have "
        "Clopper-Pearson intervals, medians and sigma_MAD (1.4826 times the median absolute deviation) "
        "intervals from order statistics, MagErr, ap and the depths bootstrap intervals (%d draws, none for "
        "fewer than %d stars). Stars of one tile share its noise and its neighbours; the intervals take them "
        "as "
        "independent, and a threshold at equal precision as given.",
        RX_BOOTSTRAP_ROUNDS, RX_BOOTSTRAP_FEWEST);
    rx_page_paragraph(dst, html);
    rx_page_paragraph(
        dst,
        "<b>Recall and precision</b> of a magnitude: of the stars of that magnitude, with the false "
        "detections of the very tiles they are on; precision therefore depends on how many stars a tile "
        "holds, the same for every restorer. <b>Equal precision</b>: a cut at k sigma means different "
        "things on raw and on restored pixels, so each restorer gets the threshold at which its own "
        "precision, all magnitudes of the field together, has the value named; then completeness is "
        "compared. <b>MagErr</b> is a mean of absolute values: it hides the sign, which bias_percent and "
        "bias_mag tell, and single gross errors weigh in it. It, bias, scatter and pull are of the stars "
        "that a "
        "restorer found: near the limit those that noise has lifted, and one that finds more has more of "
        "the difficult ones; only the duels compare errors on the same stars. F0 is the flux that was put "
        "in; nothing is "
        "calibrated away. On a real tile, whatever is found before the stars are added counts neither as "
        "right nor as false, for nobody can tell its faint sources from peaks of its noise; false there is "
        "what the stars bring with them, and all that is found on as many realisations of the tile's own "
        "noise without sources. What a restorer makes of real sources, rings say, is not counted. S/N is "
        "that of a matched filter on the bare background.");
    rx_page_paragraph(
        dst, "All numbers are in summary.json, sets.ecsv (restorers), duels.ecsv (pairs) and cuts.ecsv "
             "(thresholds); curves.ecsv holds points of the precision-recall curves.");
}

void rx_photometry_html(rx_text *dst, const rx_photometry_page *page)
{
    const rx_photometry_results *r = page->numbers->results;
    rx_page_begin(dst, "Validation: ", page->record->title);
    rx_page_links_begin(dst);
    rx_page_link(dst, 1, "verdicts", "The paper's claims");
    rx_page_link(dst, 1, "runs", "Restorers and fields");
    for (int f = 0; f < r->nfields; f++) {
        char id[24];
        snprintf(id, sizeof id, "field%d", f);
        rx_page_link(dst, 1, id, r->fields[f].name);
    }
    rx_page_link(dst, 1, "reading", "How to read");
    rx_page_link(dst, 1, "record", "Record");
    rx_page_links_end(dst);
    write_what(dst, page->numbers);
    rx_page_verdicts(dst, page->nverdicts, page->verdict);
    for (int f = 0; f < r->nfields; f++)
        write_field(dst, page, f);
    write_reading(dst);
    rx_page_campaign_record(dst, page->record);
    rx_page_end(dst);
}
