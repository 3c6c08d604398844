/* report.html of a restoration campaign. */
#include "campaign/restoration_page.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "validate/bootstrap.h"
#include "validate/escape.h"
#include "validate/page.h"

static const char *const kind_head[] = {"FWHM (px)", "noise sigma"};

/* Two or three decimals: dB and SSIM. */
static int digits_of(rx_quality quality)
{
    return quality == RX_PSNR ? 2 : 4;
}

static void heads(rx_text *dst, int n, const char *const *names)
{
    for (int i = 0; i < n; i++)
        rx_page_head(dst, RX_RIGHT, names[i]);
}

/* "9+" beyond the training range. */
static void bin_cell(rx_text *dst, const rx_restoration_numbers *m, int b)
{
    char text[48];
    snprintf(text, sizeof text, "<b>%g</b>%s", rx_bin_centre(&m->results->bins[b]),
             rx_bin_is_beyond(m, b) ? "+" : "");
    rx_page_cell_html(dst, RX_RIGHT, text);
}

static int has_kind(const rx_restoration_results *r, int by_sigma)
{
    for (int b = 0; b < r->nbins; b++)
        if (r->bins[b].by_sigma == by_sigma)
            return 1;
    return 0;
}

/* Smallest and largest of the bins of a kind. */
static void range_of(const rx_restoration_results *r, int by_sigma, int *n, double *low, double *high,
                     long *fewest, const rx_restoration_bin **first)
{
    *n = 0;
    *low = INFINITY;
    *high = -INFINITY;
    *fewest = 0;
    for (int b = 0; b < r->nbins; b++) {
        if (r->bins[b].by_sigma != by_sigma)
            continue;
        *first = *n == 0 ? &r->bins[b] : *first;
        *fewest = *n == 0 || r->bins[b].nscenes < *fewest ? r->bins[b].nscenes : *fewest;
        *n += 1;
        *low = fmin(*low, r->bins[b].low);
        *high = fmax(*high, r->bins[b].high);
    }
}

/* Where the bins lie beside the training, on its scale. */
static void write_levels(rx_text *html, const rx_restoration_numbers *m)
{
    const rx_restoration_results *r = m->results;
    double low = INFINITY, high = 0;
    long all = 0, inside = 0, fields = 0;
    for (int b = 0; b < r->nbins; b++) {
        const rx_restoration_bin *bin = &r->bins[b];
        low = fmin(low, m->level[b].median);
        high = fmax(high, m->level[b].median);
        for (long i = 0; i < bin->nscenes; i++, all++) {
            const int seeing = bin->fwhm[i] >= r->fwhm_trained[0] && bin->fwhm[i] <= r->fwhm_trained[1];
            inside += seeing && bin->level[i] >= r->level_trained[0];
            fields += seeing && bin->level[i] >= r->level_trained[0] && bin->level[i] <= r->level_trained[1];
        }
    }
    if (all == 0)
        return;
    rx_text_printf(
        html,
        "Models know noise on another scale, the noise level: 255 times the noise over what the brightest "
        "0.1 %% of the blurred scene exceed (at least 1/40 of its brightest pixel). On it the medians of the "
        "bins go from %.3g to %.3g. ",
        low, high);
    if (r->level_trained[1] > 0)
        rx_text_printf(
            html,
            "The network was trained on fields of FWHM %.3g to %.3g pixels and levels of %.3g to %.3g, whose "
            "patches go down to empty sky: %ld of %ld scenes are inside the training, %ld of them at levels "
            "of whole fields of it. ",
            r->fwhm_trained[0], r->fwhm_trained[1], r->level_trained[0], r->level_trained[1], inside, all,
            fields);
}

static void write_what(rx_text *dst, const rx_restoration_numbers *m)
{
    const rx_restoration_results *r = m->results;
    rx_text html = {0};
    int ends, choices;
    rx_text_printf(
        &html,
        "Simulated scenes of %d x %d pixels, brightest pixel of the sharp reference %g, are blurred by a "
        "Moffat PSF (integrated over the pixel), get Gaussian noise, and are restored by "
        "every method. ",
        r->side, r->side, r->peak);
    for (int kind = 0; kind < 2; kind++) {
        int n;
        double low, high;
        long fewest;
        const rx_restoration_bin *first = NULL;
        range_of(r, kind, &n, &low, &high, &fewest, &first);
        if (n > 0)
            rx_text_printf(
                &html,
                "%d bins of %s from %g to %g with %ld scenes each, uniform inside the bin, %s drawn from "
                "%g to %g. ",
                n, kind ? "noise sigma" : "FWHM", low, high, fewest, kind ? "FWHM" : "noise sigma",
                first->other_low, first->other_high);
    }
    rx_text_printf(
        &html,
        "Reference: the scene without noise at a Gaussian PSF of FWHM %g pixels. Noise and PSNR are on "
        "the scale of that peak. ",
        r->sharp_fwhm);
    write_levels(&html, m);
    rx_text_add(&html, "On the scenes: ");
    rx_escape_html(&html, r->about);
    rx_text_add(&html, ".");
    rx_tuning_ends(r, &ends, &choices);
    if (r->tune_scenes > 0)
        rx_text_printf(
            &html,
            " RL knows the true PSF; its number of iterations and the Gaussian filter after it are the best "
            "of those tried (TUNE_NITER, TUNE_FILTER), bin by bin, on %ld further scenes that are not "
            "in the test, once for PSNR and once for SSIM. SMOOTHED is the blurred image through such a "
            "filter, tuned as well, and nothing else: what RL gains over it is gained by deconvolution. "
            "RL_FLAT is RL with all below a threshold, tuned too, set to the sky.",
            r->tune_scenes);
    if (ends > 0)
        rx_text_printf(&html,
                       " In %d of %d choices the best lies at an end of what was tried "
                       "(<a href=\"#settings\">marked</a>): there the method might do better yet.",
                       ends, choices);
    if (html.data != NULL)
        rx_page_paragraph(dst, html.data);
    dst->failed = dst->failed || html.failed;
    rx_text_free(&html);
}

static void write_words(rx_text *dst, const rx_restoration_numbers *m)
{
    rx_page_section(dst, "words", "Who is better where");
    for (int p = 0; p < m->npairs; p++) {
        rx_text said = {0};
        rx_restoration_pair_words(&said, m, p);
        rx_page_said(dst, &said);
        rx_text_free(&said);
    }
    rx_page_note(dst,
                 "Above and below: Student's t of the differences on the same scenes, p adjusted by Holm for "
                 "the number of bins, below 0.05.");
}

/* The pictures of one scene side by side. */
static void example_row(rx_text *dst, const rx_figures *figures, const char *prefix, int n)
{
    rx_text_printf(dst, "<div style=\"display:grid;grid-template-columns:repeat(%d,1fr);gap:.5em\">\n", n);
    for (int i = 0; i < figures->n; i++)
        if (strncmp(figures->figure[i].id, prefix, strlen(prefix)) == 0)
            rx_page_figure(dst, &figures->figure[i]);
    rx_text_add(dst, "</div>\n");
}

static int has_examples(const rx_restoration_page *page)
{
    return page->numbers->results->nexamples > 0 && page->figures.note[0] == '\0';
}

static void write_examples(rx_text *dst, const rx_restoration_page *page)
{
    const rx_restoration_results *r = page->numbers->results;
    if (!has_examples(page))
        return;
    rx_page_section(dst, "examples", "Examples");
    for (int e = 0; e < r->nexamples; e++) {
        char text[96], prefix[24];
        snprintf(text, sizeof text, "FWHM %.2f pixels, noise %.1f", r->examples[e].fwhm,
                 r->examples[e].sigma);
        snprintf(prefix, sizeof prefix, "example%d-", e);
        rx_page_heading(dst, text, NULL);
        example_row(dst, &page->figures, prefix, r->examples[e].nplanes);
    }
    rx_page_note(dst,
                 "The middle of the scene, the same grey scale for all pictures: asinh(p / 6 %) of the peak, "
                 "black at &minus;6 %, white at 70 % of it.");
}

static void values_table(rx_text *dst, const rx_restoration_numbers *m, int by_sigma, rx_quality quality)
{
    const rx_restoration_results *r = m->results;
    char text[64];
    snprintf(text, sizeof text, "%s by %s", rx_quality_name(quality), by_sigma ? "noise" : "FWHM");
    rx_page_heading(dst, text, rx_quality_unit(quality)[0] != '\0' ? rx_quality_unit(quality) : NULL);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_RIGHT, kind_head[by_sigma]);
    rx_page_head(dst, RX_RIGHT, "scenes");
    for (int k = 0; k < r->nmethods; k++) {
        snprintf(text, sizeof text, "%s median", r->method[k]);
        rx_page_head(dst, RX_RIGHT, text);
        rx_page_head(dst, RX_RIGHT, "mean");
    }
    rx_page_row_end(dst);
    for (int b = 0; b < r->nbins; b++) {
        if (r->bins[b].by_sigma != by_sigma)
            continue;
        rx_page_row(dst, NULL);
        bin_cell(dst, m, b);
        rx_page_cell_count(dst, r->bins[b].nscenes);
        for (int k = 0; k < r->nmethods; k++) {
            rx_page_cell_number(dst, rx_quality_box(m, b, quality, k)->median, digits_of(quality));
            rx_page_cell_interval(dst, rx_quality_mean(m, b, quality, k), digits_of(quality));
        }
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
}

static void duel_row(rx_text *dst, const rx_restoration_numbers *m, int b, rx_quality quality, int pair)
{
    const rx_quality_duel *d = rx_quality_duel_of(m, b, quality, pair);
    rx_page_row(dst, NULL);
    bin_cell(dst, m, b);
    rx_page_cell_count(dst, d->n);
    rx_page_cell_difference(dst, &d->paired.difference, digits_of(quality), d->winner);
    rx_page_cell_difference(dst, &d->bootstrap, digits_of(quality), 0);
    rx_page_cell_number(dst, d->paired.statistic, 2);
    rx_page_cell_number(dst, d->paired.effect, 2);
    rx_page_cell_p(dst, d->paired.p, d->paired.ln_p);
    rx_page_cell_p(dst, d->holm, log(d->holm));
    rx_page_cell_p(dst, d->wilcoxon.p, d->wilcoxon.ln_p);
    rx_page_cell_p(dst, d->holm_wilcoxon, log(d->holm_wilcoxon));
    rx_page_row_end(dst);
}

static void duel_table(rx_text *dst, const rx_restoration_numbers *m, int by_sigma, rx_quality quality,
                       int pair)
{
    static const char *const names[] = {
        "scenes",  "difference (t)", "difference (bootstrap)", "t", "d_z", "p",
        "p, Holm", "Wilcoxon",       "Wilcoxon, Holm"};
    char text[64];
    snprintf(text, sizeof text, "%s by %s", rx_quality_name(quality), by_sigma ? "noise" : "FWHM");
    rx_page_heading(dst, text, rx_quality_unit(quality)[0] != '\0' ? rx_quality_unit(quality) : NULL);
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_RIGHT, kind_head[by_sigma]);
    heads(dst, (int)(sizeof names / sizeof *names), names);
    rx_page_row_end(dst);
    for (int b = 0; b < m->results->nbins; b++)
        if (m->results->bins[b].by_sigma == by_sigma)
            duel_row(dst, m, b, quality, pair);
    rx_page_table_end(dst);
}

static void write_tables(rx_text *dst, const rx_restoration_numbers *m)
{
    rx_page_section(dst, "tables", "Tables");
    for (int kind = 0; kind < 2; kind++)
        for (int q = 0; q < RX_QUALITIES && has_kind(m->results, kind); q++)
            values_table(dst, m, kind, (rx_quality)q);
    rx_page_note(dst, "Means with 95 % t intervals. A plus: a larger FWHM or a higher noise level than in "
                      "the fields of the training.");
}

/* The first pair lies open, the others are folded away. */
static void write_duels(rx_text *dst, const rx_restoration_numbers *m)
{
    const rx_restoration_results *r = m->results;
    rx_page_section(dst, "duels", "Duels on the same scenes");
    for (int p = 0; p < m->npairs; p++) {
        rx_text_add(dst, p == m->chief ? "<details open><summary><b>" : "<details><summary><b>");
        rx_escape_html(dst, r->method[m->pair[p].first]);
        rx_text_add(dst, " &minus; ");
        rx_escape_html(dst, r->method[m->pair[p].second]);
        rx_text_add(dst, "</b></summary>\n");
        for (int kind = 0; kind < 2; kind++)
            for (int q = 0; q < RX_QUALITIES && has_kind(r, kind); q++)
                duel_table(dst, m, kind, (rx_quality)q, p);
        rx_text_add(dst, "</details>\n");
    }
    rx_page_note(
        dst,
        "Means of the differences with t and bootstrap intervals. Green: the first is better, red: the "
        "second (Holm p below 0.05). t and p: Student's t of the "
        "differences (n &minus; 1 degrees of freedom); d_z: mean difference over its standard deviation; "
        "Wilcoxon: signed ranks. Holm multiplies for the bins of one table.");
}

static void paper_row(rx_text *dst, const rx_restoration_numbers *m, const rx_paper_table *table, int b)
{
    const rx_restoration_bin *bin = &m->results->bins[b];
    const rx_paper_column *c = rx_paper_column_at(table, rx_bin_centre(bin));
    const rx_quality_duel *d = rx_quality_duel_of(m, b, table->ssim ? RX_SSIM : RX_PSNR, m->chief);
    if (c == NULL)
        return;
    double p, ln_p;
    int fits = rx_paper_column_fits(table, c, &p, &ln_p);
    rx_page_row(dst, NULL);
    rx_page_cell_number(dst, c->bin, 0);
    rx_page_cell_number(dst, c->t, 2);
    rx_page_cell_p(dst, c->p, log(c->p));
    rx_page_cell_p(dst, p, ln_p);
    rx_page_cell_verdict(dst, fits ? RX_MARK_GOOD : RX_MARK_BAD, fits ? "yes" : "no");
    rx_page_cell_number(dst, d->two_sample.statistic, 2);
    rx_page_cell_number(dst, d->two_sample.dof, 0);
    rx_page_cell_p(dst, d->two_sample.p, d->two_sample.ln_p);
    rx_page_cell_number(dst, d->two_sample.effect, 2);
    rx_page_cell_number(dst, d->paired.statistic, 2);
    rx_page_cell_p(dst, d->paired.p, d->paired.ln_p);
    rx_page_row_end(dst);
}

static void write_paper(rx_text *dst, const rx_restoration_numbers *m)
{
    static const char *const names[] = {"paper: t", "p", "p from its t", "fits", "here: t", "dof",
                                        "p",        "d", "paired: t",    "p"};
    const rx_restoration_results *r = m->results;
    char text[160];
    rx_text html = {0};
    if (m->chief < 0)
        return;
    const char *first = r->method[m->pair[m->chief].first], *second = r->method[m->pair[m->chief].second];
    rx_page_section(dst, "paper", "Beside the paper's Tables 1 to 4");
    if (m->pair[m->chief].first != m->net) {
        rx_text_add(&html, "<b>The two sides compare different things.</b> The paper's columns are NET "
                           "against RL; NET did not take part here, so ours are ");
        rx_escape_html(&html, first);
        rx_text_add(&html, " against ");
        rx_escape_html(&html, second);
        rx_text_add(&html, ". The paper's are shown for reference.");
    }
    if (html.data != NULL)
        rx_page_paragraph(dst, html.data);
    dst->failed = dst->failed || html.failed;
    rx_text_free(&html);
    for (int i = 0; i < RX_PAPER_TABLES; i++) {
        const rx_paper_table *table = rx_paper_table_get(i);
        if (!has_kind(r, table->by_sigma))
            continue;
        snprintf(text, sizeof text, "Table %d: %s by %s; here %.24s against %.24s", table->number,
                 table->ssim ? "SSIM" : "PSNR", table->by_sigma ? "noise" : "FWHM", first, second);
        rx_page_heading(dst, text, NULL);
        rx_page_table_begin(dst);
        rx_page_row(dst, NULL);
        rx_page_head(dst, RX_RIGHT, table->by_sigma ? "sigma" : "FWHM");
        heads(dst, (int)(sizeof names / sizeof *names), names);
        rx_page_row_end(dst);
        for (int b = 0; b < r->nbins; b++)
            if (r->bins[b].by_sigma == table->by_sigma)
                paper_row(dst, m, table, b);
        rx_page_table_end(dst);
    }
    rx_page_note(
        dst, "As in the paper: two samples, pooled variance, two-sided. Its degrees of freedom are not "
             "printed; 138 (Tables 1, 2) and 78 (Tables 3, 4) give its p. d: Cohen's d. The scenes are the "
             "same for both methods, so the paired test on the right is the fitting one.");
}

static void chosen_cell(rx_text *dst, const char *settings, int end)
{
    rx_text html = {0};
    rx_escape_html(&html, settings);
    if (end)
        rx_text_printf(&html, " <span class=\"%s\">at an end</span>", RX_MARK_OPEN);
    rx_page_cell_html(dst, RX_LEFT, html.data != NULL ? html.data : "");
    dst->failed = dst->failed || html.failed;
    rx_text_free(&html);
}

static void write_settings(rx_text *dst, const rx_restoration_numbers *m)
{
    const rx_restoration_results *r = m->results;
    rx_page_section(dst, "settings", "Settings chosen");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "bin");
    rx_page_head(dst, RX_LEFT, "method");
    rx_page_head(dst, RX_LEFT, "for PSNR");
    rx_page_head(dst, RX_LEFT, "for SSIM");
    rx_page_row_end(dst);
    for (int b = 0; b < r->nbins; b++)
        for (int k = 0; k < r->nmethods; k++) {
            const rx_method_scores *s = &r->bins[b].method[k];
            char text[48];
            if (s->settings_psnr[0] == '\0' && s->settings_ssim[0] == '\0')
                continue;
            snprintf(text, sizeof text, "%s %g", kind_head[r->bins[b].by_sigma], rx_bin_centre(&r->bins[b]));
            rx_page_row(dst, NULL);
            rx_page_cell_text(dst, text);
            rx_page_cell_text(dst, r->method[k]);
            chosen_cell(dst, s->settings_psnr, s->end_psnr);
            chosen_cell(dst, s->settings_ssim, s->end_ssim);
            rx_page_row_end(dst);
        }
    rx_page_table_end(dst);
    rx_page_note(dst, "At an end: the lowest or highest number of iterations, the widest filter or the "
                      "highest threshold tried; longer lists (TUNE_NITER, TUNE_FILTER) may hold better "
                      "ones, and the method is then not shown at its best.");
}

static void write_reading(rx_text *dst)
{
    char html[1400];
    rx_page_section(dst, "reading", "How to read this");
    snprintf(
        html, sizeof html,
        "<b>PSNR</b> = 20 log<sub>10</sub>(max(reference) / &radic;MSE) in dB, MSE the mean of the squared "
        "differences (the paper prints it without the square). <b>SSIM</b>: Wang et al. 2004, 11 x 11 "
        "Gaussian "
        "window of sigma 1.5, K1 = K2 = 0.001 as in the paper, range of the reference. With so small K the "
        "noise of empty sky weighs heavily in it, which favours smooth pictures. Both are better when "
        "larger. Bootstrap intervals: %d draws, none for fewer than %d scenes. The scenes are the same for "
        "all "
        "methods: the paired test takes out what the scenes differ in, the two-sample test does not.",
        RX_BOOTSTRAP_ROUNDS, RX_BOOTSTRAP_FEWEST);
    rx_page_paragraph(dst, html);
    rx_page_paragraph(
        dst, "All numbers are in summary.json, bins.ecsv (methods) and duels.ecsv (pairs); scenes.ecsv "
             "holds every scene.");
}

void rx_restoration_html(rx_text *dst, const rx_restoration_page *page)
{
    const rx_restoration_numbers *m = page->numbers;
    rx_page_begin(dst, "Validation: ", page->record->title);
    write_what(dst, m);
    rx_page_links_begin(dst);
    rx_page_link(dst, 1, "verdicts", "The paper's claims");
    rx_page_link(dst, 1, "words", "Who is better where");
    rx_page_link(dst, 1, "figures", "Figures");
    rx_page_link(dst, has_examples(page), "examples", "Examples");
    rx_page_link(dst, 1, "tables", "Tables");
    rx_page_link(dst, 1, "duels", "Duels");
    rx_page_link(dst, m->chief >= 0, "paper", "The paper's tables");
    rx_page_link(dst, 1, "settings", "Settings");
    rx_page_link(dst, 1, "reading", "How to read");
    rx_page_link(dst, 1, "record", "Record");
    rx_page_links_end(dst);
    rx_page_verdicts(dst, page->nverdicts, page->verdict);
    write_words(dst, m);
    rx_page_section(dst, "figures", "Figures");
    rx_page_figures(dst, &page->figures, "box-");
    rx_page_figures(dst, &page->figures, "difference-");
    write_examples(dst, page);
    write_tables(dst, m);
    write_duels(dst, m);
    write_paper(dst, m);
    write_settings(dst, m);
    write_reading(dst);
    rx_page_campaign_record(dst, page->record);
    rx_page_end(dst);
}
