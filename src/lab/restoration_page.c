/* The report of a restoration campaign. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "lab/findings.h"
#include "lab/kinds.h"
#include "lab/restoration.h"
#include "lab/restoration_numbers.h"
#include "quality/bootstrap.h"
#include "report/escape.h"
#include "report/page.h"

static const rx_quantity QUALITIES[RX_QUALITIES] = {
    [RX_PSNR] = {"psnr", "dB", "mean over the scenes, t interval", 2, 0},
    [RX_SSIM] = {"ssim", "", "mean over the scenes, t interval", 4, 0}};

static const rx_report_column BINS[] = {
    {.name = "scene", .help = "binned quantity"},
    {.name = "condition", .help = "middle of the bin"},
    {"low", RX_REPORT_NUMBER, 2, "", "", NULL},
    {"high", RX_REPORT_NUMBER, 2, "", "", NULL},
    {"other_low", RX_REPORT_NUMBER, 2, "", "range of the other quantity", NULL},
    {"other_high", RX_REPORT_NUMBER, 2, "", "range of the other quantity", NULL},
    {"scenes", RX_REPORT_COUNT, 0, "", "", NULL},
    {"level_low", RX_REPORT_NUMBER, 3, "", "noise level on the scale of models", NULL},
    {"level_median", RX_REPORT_NUMBER, 3, "", "", NULL},
    {"level_high", RX_REPORT_NUMBER, 3, "", "", NULL},
    {"inside_training", RX_REPORT_COUNT, 0, "", "1: seeing and median noise level are inside the training",
     NULL},
    {"fainter_than_fields", RX_REPORT_COUNT, 0, "", "1: that level is above those of all whole fields of it",
     NULL},
};

static const rx_report_column BOXES[] = {
    {.name = "scene"},
    {.name = "condition"},
    {.name = "run"},
    {.name = "quantity"},
    {"low", RX_REPORT_NUMBER, 3, "", "last value within 1.5 box lengths", NULL},
    {"q1", RX_REPORT_NUMBER, 3, "", "quartile", NULL},
    {"median", RX_REPORT_NUMBER, 3, "", "", NULL},
    {"q3", RX_REPORT_NUMBER, 3, "", "quartile", NULL},
    {"high", RX_REPORT_NUMBER, 3, "", "", NULL},
    {"outliers", RX_REPORT_COUNT, 0, "", "", NULL},
};

static const rx_report_column SCENES[] = {
    {.name = "scene"},
    {.name = "condition"},
    {"number", RX_REPORT_COUNT, 0, "", "from 1 in each bin", NULL},
    {"fwhm", RX_REPORT_NUMBER, 2, "pix", "of the PSF", NULL},
    {"sigma", RX_REPORT_NUMBER, 2, "adu", "of the noise", NULL},
    {"noise_level", RX_REPORT_NUMBER, 3, "", "the noise on the scale of models", NULL},
    {.name = "run"},
    {"psnr", RX_REPORT_NUMBER, 2, "dB", "with the settings for PSNR", NULL},
    {"ssim", RX_REPORT_NUMBER, 4, "", "with the settings for SSIM", NULL},
};

static const rx_report_column PAPER[] = {
    {"table", RX_REPORT_COUNT, 0, "", "of the paper", NULL},
    {.name = "scene"},
    {.name = "quantity"},
    {"bin", RX_REPORT_NUMBER, 0, "", "", NULL},
    {"dof", RX_REPORT_NUMBER, 0, "", "degrees of freedom that give its p", NULL},
    {"paper_t", RX_REPORT_NUMBER, 2, "", "printed: its network against Richardson-Lucy", NULL},
    {"paper_p", RX_REPORT_P, 0, "", "printed", NULL},
    {"p_from_t", RX_REPORT_P, 0, "", "that follows from the printed t", NULL},
    {"fits", RX_REPORT_COUNT, 0, "", "1: within what rounding allows", NULL},
    {"t", RX_REPORT_NUMBER, 2, "", "here, two samples as in the paper", NULL},
    {"p", RX_REPORT_P, 0, "", "here", NULL},
    {"paired_t", RX_REPORT_NUMBER, 2, "", "here, on the same scenes: the fitting test", NULL},
};

#define LENGTH(table) ((int)(sizeof(table) / sizeof *(table)))

static const char *const KINDS[] = {"FWHM", "noise"};

static void bin_name(const rx_restoration_numbers *m, int b, char dst[32])
{
    snprintf(dst, 32, "%g", rx_bin_centre(&m->results->bins[b]));
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

static void write_what(rx_report *report, const rx_restoration_numbers *m)
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
                       "(cells.ecsv): there the method might do better yet.",
                       ends, choices);
    rx_report_paragraph(report, html.data != NULL ? html.data : "");
    rx_text_free(&html);
}

static void add_bins(rx_report *report, const rx_restoration_numbers *m)
{
    rx_report_table *t = rx_report_table_add(report, "bins", LENGTH(BINS), BINS, RX_REPORT_EVERYWHERE);
    char name[32];
    for (int b = 0; b < m->results->nbins; b++) {
        const rx_restoration_bin *bin = &m->results->bins[b];
        bin_name(m, b, name);
        rx_report_row(t, (rx_cell[]){rx_cell_words(KINDS[bin->by_sigma]), rx_cell_words(name),
                                     rx_cell_number(bin->low), rx_cell_number(bin->high),
                                     rx_cell_number(bin->other_low), rx_cell_number(bin->other_high),
                                     rx_cell_number((double)bin->nscenes), rx_cell_number(m->level[b].low),
                                     rx_cell_number(m->level[b].median), rx_cell_number(m->level[b].high),
                                     rx_cell_number(m->inside[b]), rx_cell_number(m->fainter[b])});
    }
}

/* Means of a quality over bins of a kind, on the page; boxes in the files. */
static void add_quality(rx_findings *f, rx_report_table *boxes, const rx_restoration_numbers *m, int by_sigma,
                        rx_quality quality)
{
    const rx_restoration_results *r = m->results;
    const long from = rx_report_rows(f->cells);
    const char *name = QUALITIES[quality].name;
    char bin[32], setting[160];
    for (int b = 0; b < r->nbins; b++)
        for (int k = 0; k < r->nmethods && r->bins[b].by_sigma == by_sigma; k++) {
            const rx_method_scores *s = &r->bins[b].method[k];
            const rx_five_numbers *box = rx_quality_box(m, b, quality, k);
            const int end = quality == RX_PSNR ? s->end_psnr : s->end_ssim;
            bin_name(m, b, bin);
            snprintf(setting, sizeof setting, "%s%s",
                     quality == RX_PSNR ? s->settings_psnr : s->settings_ssim,
                     end ? " (at an end of what was tried)" : "");
            rx_findings_cell(f, &(rx_finding){KINDS[by_sigma], bin, r->method[k], setting},
                             &QUALITIES[quality], rx_quality_mean(m, b, quality, k));
            rx_report_row(boxes,
                          (rx_cell[]){rx_cell_words(KINDS[by_sigma]), rx_cell_words(bin),
                                      rx_cell_words(r->method[k]), rx_cell_words(name),
                                      rx_cell_number(box->low), rx_cell_number(box->q1),
                                      rx_cell_number(box->median), rx_cell_number(box->q3),
                                      rx_cell_number(box->high), rx_cell_number((double)box->outliers)});
        }
    rx_findings_show(f, from, &QUALITIES[quality], 1);
}

/* Four tests of two methods on the scenes of one bin. */
static void add_contests(rx_findings *f, const rx_restoration_numbers *m, int b, rx_quality quality, int pair)
{
    const rx_quality_duel *d = rx_quality_duel_of(m, b, quality, pair);
    const char *first = m->results->method[m->pair[pair].first],
               *second = m->results->method[m->pair[pair].second];
    const rx_estimate none = {NAN, NAN, NAN, 0};
    const rx_test *tests[] = {&d->paired, &d->wilcoxon, &d->two_sample};
    static const char *const names[] = {"paired t", "Wilcoxon", "two samples"};
    char bin[32];
    bin_name(m, b, bin);
    rx_contest c = {.scene = KINDS[m->results->bins[b].by_sigma],
                    .condition = bin,
                    .quantity = QUALITIES[quality].name,
                    .first = first,
                    .second = second,
                    .only_first = NAN,
                    .only_second = NAN};
    for (int i = 0; i < m->results->nbins; i++)
        c.ntests += m->results->bins[i].by_sigma == m->results->bins[b].by_sigma;
    for (int i = 0; i < 3; i++) {
        c.test = names[i];
        c.statistic = tests[i]->statistic;
        c.dof = tests[i]->dof;
        c.p = tests[i]->p;
        c.ln_p = tests[i]->ln_p;
        c.effect = tests[i]->effect;
        c.difference = i == 0 ? d->paired.difference : none;
        c.holm = i == 0 ? d->holm : i == 1 ? d->holm_wilcoxon : NAN;
        c.winner = i > 0 || d->winner == 0 ? NULL : d->winner > 0 ? first : second;
        rx_findings_contest(f, &c);
    }
    rx_findings_contest(f, &(rx_contest){c.scene, bin, c.quantity, first, second, "bootstrap", NAN, NAN, NAN,
                                         NAN, NAN, NAN, NULL, d->bootstrap, NAN, NAN, 0});
}

/* Tables and figures of one binned quantity. */
static void add_kind(rx_findings *f, rx_report_table *boxes, const rx_restoration_numbers *m, int by_sigma)
{
    static const char *const columns[] = {"condition", "test", "difference", "statistic",
                                          "effect",    "p",    "holm",       "winner"};
    const rx_restoration_results *r = m->results;
    char text[96];
    int n = 0;
    for (int b = 0; b < r->nbins; b++)
        n += r->bins[b].by_sigma == by_sigma;
    if (n == 0)
        return;
    rx_report_section(f->report, KINDS[by_sigma], by_sigma ? "By noise" : "By FWHM");
    rx_report_place(f->report, by_sigma ? "sigma-" : "fwhm-");
    for (int q = 0; q < RX_QUALITIES; q++)
        add_quality(f, boxes, m, by_sigma, (rx_quality)q);
    for (int pair = 0; pair < m->npairs; pair++) {
        snprintf(text, sizeof text, "%s against %s, on the same scenes", r->method[m->pair[pair].first],
                 r->method[m->pair[pair].second]);
        rx_report_fold(f->report, text);
        for (int q = 0; q < RX_QUALITIES; q++) {
            const long from = rx_report_rows(f->contests);
            for (int b = 0; b < r->nbins; b++)
                if (r->bins[b].by_sigma == by_sigma)
                    add_contests(f, m, b, (rx_quality)q, pair);
            rx_findings_show_contests(f, from, QUALITIES[q].name, LENGTH(columns), columns);
        }
        rx_report_unfold(f->report);
    }
}

static void add_words(rx_report *report, const rx_restoration_numbers *m)
{
    rx_text words = {0};
    rx_report_section(report, "words", "Who is better where");
    for (int p = 0; p < m->npairs; p++) {
        const size_t before = words.length;
        rx_restoration_pair_words(&words, m, p);
        rx_report_sentence(report, words.data != NULL ? words.data + before : "");
        if (p == 1 || p + 1 == m->npairs)
            rx_text_printf(rx_report_brief_of(report), "%s\n", words.data != NULL && p < 2 ? words.data : "");
    }
    rx_report_brief_of(report)->failed |= words.failed;
    rx_text_free(&words);
    rx_report_note(
        report, "Above and below: Student's t of the differences on the same scenes, p adjusted by Holm for "
                "the number of bins, below 0.05.");
}

/* The printed numbers of the paper beside ours. */
static void add_paper(rx_report *report, const rx_restoration_numbers *m)
{
    rx_report_table *t = rx_report_table_add(report, "paper", LENGTH(PAPER), PAPER, RX_REPORT_IN_JSON);
    for (int i = 0; i < RX_PAPER_TABLES; i++) {
        const rx_paper_table *table = rx_paper_table_get(i);
        for (int k = 0; k < table->n; k++) {
            const rx_paper_column *c = &table->column[k];
            const rx_quality_duel *d = NULL;
            double p, ln_p;
            const int fits = rx_paper_column_fits(table, c, &p, &ln_p);
            for (int b = 0; b < m->results->nbins && m->chief >= 0; b++)
                if (m->results->bins[b].by_sigma == table->by_sigma &&
                    rx_paper_column_at(table, rx_bin_centre(&m->results->bins[b])) == c)
                    d = rx_quality_duel_of(m, b, table->ssim ? RX_SSIM : RX_PSNR, m->chief);
            rx_report_row(t, (rx_cell[]){rx_cell_number(table->number), rx_cell_words(KINDS[table->by_sigma]),
                                         rx_cell_words(table->ssim ? "ssim" : "psnr"), rx_cell_number(c->bin),
                                         rx_cell_number(table->dof), rx_cell_number(c->t),
                                         rx_cell_p(c->p, log(c->p)), rx_cell_p(p, ln_p), rx_cell_number(fits),
                                         rx_cell_number(d != NULL ? d->two_sample.statistic : NAN),
                                         rx_cell_p(d != NULL ? d->two_sample.p : NAN,
                                                   d != NULL ? d->two_sample.ln_p : NAN),
                                         rx_cell_number(d != NULL ? d->paired.statistic : NAN)});
        }
    }
    rx_report_section(report, "paper", "Beside the paper's Tables 1 to 4");
    if (m->chief >= 0 && m->pair[m->chief].first != m->net) {
        rx_text words = {0};
        rx_text_printf(
            &words,
            "The two sides compare different things: the paper's columns are NET against RL; NET did not "
            "take part here, so ours are %s against %s.",
            m->results->method[m->pair[m->chief].first], m->results->method[m->pair[m->chief].second]);
        rx_report_sentence(report, words.data);
        rx_text_free(&words);
    }
    rx_report_show(report, t, &(rx_report_view){.to = rx_report_rows(t)});
}

static void add_scenes(rx_report *report, const rx_restoration_numbers *m)
{
    const rx_restoration_results *r = m->results;
    rx_report_table *t = rx_report_table_add(report, "scenes", LENGTH(SCENES), SCENES, RX_REPORT_IN_FILE);
    char name[32];
    for (int b = 0; b < r->nbins; b++)
        for (long i = 0; i < r->bins[b].nscenes; i++)
            for (int k = 0; k < r->nmethods; k++) {
                bin_name(m, b, name);
                rx_report_row(
                    t, (rx_cell[]){rx_cell_words(KINDS[r->bins[b].by_sigma]), rx_cell_words(name),
                                   rx_cell_number((double)i + 1), rx_cell_number(r->bins[b].fwhm[i]),
                                   rx_cell_number(r->bins[b].sigma[i]), rx_cell_number(r->bins[b].level[i]),
                                   rx_cell_words(r->method[k]), rx_cell_number(r->bins[b].method[k].psnr[i]),
                                   rx_cell_number(r->bins[b].method[k].ssim[i])});
            }
}

static void add_examples(rx_report *report, const rx_restoration_results *r)
{
    char text[96];
    if (r->nexamples == 0)
        return;
    rx_report_section(report, "examples", "Examples");
    for (int e = 0; e < r->nexamples; e++) {
        snprintf(text, sizeof text, "FWHM %.2f pixels, noise %.1f", r->examples[e].fwhm,
                 r->examples[e].sigma);
        rx_report_heading(report, text, NULL);
        snprintf(text, sizeof text, "example%d-", e);
        rx_report_place(report, text);
    }
    rx_report_note(
        report, "The middle of the scene, the same grey scale for all pictures: asinh(p / 6 %) of the peak, "
                "black at &minus;6 %, white at 70 % of it.");
}

static void write_reading(rx_report *report)
{
    char html[1200];
    snprintf(
        html, sizeof html,
        "<b>PSNR</b> = 20 log<sub>10</sub>(max(reference) / &radic;MSE) in dB, MSE the mean of the squared "
        "differences (the paper prints it without the square). <b>SSIM</b>: Wang et al. 2004, 11 x 11 "
        "Gaussian "
        "window of sigma 1.5, K1 = K2 = 0.001 as in the paper, range of the reference. With so small K the "
        "noise "
        "of empty sky weighs heavily in it, which favours smooth pictures. Both are better when larger. "
        "Bootstrap "
        "intervals: %d draws, none for fewer than %d scenes. The paired test takes out what the scenes "
        "differ in, "
        "the two-sample test, which is the paper's, does not. scenes.ecsv holds every scene.",
        RX_BOOTSTRAP_ROUNDS, RX_BOOTSTRAP_FEWEST);
    rx_report_paragraph(report, html);
}

rx_status rx_restoration_report(const rx_restoration_results *results, const rx_lab_output *output,
                                rx_error *err)
{
    rx_restoration_numbers m = {0};
    rx_claim_verdicts verdicts;
    int ends, choices;
    rx_findings f;
    rx_status status = rx_restoration_numbers_make(results, output->record->seed, &m, err);
    if (status == RX_OK)
        status = rx_findings_begin(&f, "restoration", results->about, 0, output, err);
    if (status != RX_OK)
        goto exit;
    rx_tuning_ends(results, &ends, &choices);
    rx_report_fact_number(f.report, "scene_side", results->side);
    rx_report_fact_number(f.report, "peak", results->peak);
    rx_report_fact_number(f.report, "sharp_fwhm", results->sharp_fwhm);
    rx_report_fact_numbers(f.report, "fwhm_trained", 2, results->fwhm_trained);
    rx_report_fact_numbers(f.report, "noise_level_trained", 2, results->level_trained);
    rx_report_fact_number(f.report, "tune_scenes", (double)results->tune_scenes);
    rx_report_fact_number(f.report, "tune_choices", choices);
    rx_report_fact_number(f.report, "tune_choices_at_end", ends);
    rx_restoration_verdicts(&m, &verdicts);
    rx_findings_claims(&f, &verdicts, NULL);
    rx_restoration_figures(rx_report_figures_of(f.report), &m);
    rx_report_table *boxes =
        rx_report_table_add(f.report, "boxes", LENGTH(BOXES), BOXES, RX_REPORT_EVERYWHERE);
    for (int kind = 0; kind < 2; kind++)
        add_kind(&f, boxes, &m, kind);
    if (ends > 0)
        rx_text_printf(rx_report_brief_of(f.report),
                       "tuning took an end of what was tried in %d of %d choices; longer TUNE_NITER or "
                       "TUNE_FILTER may serve the tuned methods better\n",
                       ends, choices);
    add_examples(f.report, results);
    add_words(f.report, &m);
    add_bins(f.report, &m);
    add_paper(f.report, &m);
    add_scenes(f.report, &m);
    rx_report_section(f.report, "reading", "How to read this");
    write_what(f.report, &m);
    write_reading(f.report);
    status = rx_findings_end(&f, err);
exit:
    rx_restoration_numbers_free(&m);
    return status;
}

static rx_status report(const rx_lab *lab, const rx_lab_output *output, rx_error *err)
{
    return rx_restoration_report(lab->restored, output, err);
}

static void close_results(rx_lab *lab)
{
    rx_restoration_results_free(lab->restored);
}

const rx_lab_kind rx_kind_restoration = {.name = "RESTORATION",
                                         .title = "Restoration campaign",
                                         .tag = 0x726573746f7265,
                                         .ntables = RX_RESTORATION_TABLES,
                                         .tables = rx_restoration_tables,
                                         .in_turns = 1,
                                         .open = rx_restoration_open,
                                         .unit = rx_restoration_unit,
                                         .describe = rx_restoration_describe,
                                         .report = report,
                                         .close = close_results};
