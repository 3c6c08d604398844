/* summary.json, the ECSV tables and the terminal's table of a restoration campaign. */
#include <math.h>

#include "campaign/restoration_page.h"

static const char *kind_of(const rx_restoration_bin *bin)
{
    return bin->by_sigma ? "sigma" : "fwhm";
}

static void json_box(rx_json *j, const char *key, const rx_five_numbers *box)
{
    rx_json_object(j, key, true);
    rx_json_number(j, "low", box->low);
    rx_json_number(j, "q1", box->q1);
    rx_json_number(j, "median", box->median);
    rx_json_number(j, "q3", box->q3);
    rx_json_number(j, "high", box->high);
    rx_json_count(j, "outliers", (unsigned long long)box->outliers);
    rx_json_end(j);
}

static void json_method(rx_json *j, const rx_restoration_numbers *m, int b, int k)
{
    const rx_method_scores *s = &m->results->bins[b].method[k];
    rx_json_object(j, NULL, false);
    rx_json_string(j, "method", m->results->method[k]);
    rx_json_string(j, "settings_psnr", s->settings_psnr);
    rx_json_bool(j, "end_psnr", s->end_psnr != 0);
    rx_json_string(j, "settings_ssim", s->settings_ssim);
    rx_json_bool(j, "end_ssim", s->end_ssim != 0);
    for (int q = 0; q < RX_QUALITIES; q++) {
        rx_json_object(j, q == RX_PSNR ? "psnr" : "ssim", false);
        rx_json_estimate(j, "mean", rx_quality_mean(m, b, (rx_quality)q, k));
        json_box(j, "box", rx_quality_box(m, b, (rx_quality)q, k));
        rx_json_end(j);
    }
    rx_json_end(j);
}

static void json_duel(rx_json *j, const rx_restoration_numbers *m, int b, rx_quality quality, int pair)
{
    const rx_quality_duel *d = rx_quality_duel_of(m, b, quality, pair);
    rx_json_object(j, NULL, false);
    rx_json_string(j, "first", m->results->method[m->pair[pair].first]);
    rx_json_string(j, "second", m->results->method[m->pair[pair].second]);
    rx_json_string(j, "metric", quality == RX_PSNR ? "psnr" : "ssim");
    rx_json_test(j, "paired", &d->paired);
    rx_json_number(j, "paired_holm", d->holm);
    rx_json_test(j, "wilcoxon", &d->wilcoxon);
    rx_json_number(j, "wilcoxon_holm", d->holm_wilcoxon);
    rx_json_test(j, "two_sample", &d->two_sample);
    rx_json_estimate(j, "bootstrap", &d->bootstrap);
    rx_json_number(j, "winner", d->winner);
    rx_json_end(j);
}

static void json_bin(rx_json *j, const rx_restoration_numbers *m, int b)
{
    const rx_restoration_bin *bin = &m->results->bins[b];
    rx_json_object(j, NULL, false);
    rx_json_string(j, "by", kind_of(bin));
    rx_json_number(j, "low", bin->low);
    rx_json_number(j, "high", bin->high);
    rx_json_number(j, "other_low", bin->other_low);
    rx_json_number(j, "other_high", bin->other_high);
    json_box(j, "noise_level", &m->level[b]);
    rx_json_bool(j, "inside_training_range", m->inside[b] != 0);
    rx_json_bool(j, "fainter_than_training_fields", m->fainter[b] != 0);
    rx_json_count(j, "scenes", (unsigned long long)bin->nscenes);
    rx_json_array(j, "methods", false);
    for (int k = 0; k < m->results->nmethods; k++)
        json_method(j, m, b, k);
    rx_json_end(j);
    rx_json_array(j, "duels", false);
    for (int q = 0; q < RX_QUALITIES; q++)
        for (int p = 0; p < m->npairs; p++)
            json_duel(j, m, b, (rx_quality)q, p);
    rx_json_end(j);
    rx_json_end(j);
}

/* The printed numbers, so that the file can be read without the paper. */
static void json_paper(rx_json *j)
{
    rx_json_array(j, "paper_tables", false);
    for (int i = 0; i < RX_PAPER_TABLES; i++) {
        const rx_paper_table *table = rx_paper_table_get(i);
        rx_json_object(j, NULL, false);
        rx_json_count(j, "table", (unsigned long long)table->number);
        rx_json_string(j, "by", table->by_sigma ? "sigma" : "fwhm");
        rx_json_string(j, "metric", table->ssim ? "ssim" : "psnr");
        rx_json_number(j, "dof", table->dof);
        rx_json_array(j, "columns", false);
        for (int k = 0; k < table->n; k++) {
            double p, ln_p;
            int fits = rx_paper_column_fits(table, &table->column[k], &p, &ln_p);
            rx_json_object(j, NULL, true);
            rx_json_number(j, "bin", table->column[k].bin);
            rx_json_number(j, "t", table->column[k].t);
            rx_json_number(j, "p", table->column[k].p);
            rx_json_number(j, "p_from_t", p);
            rx_json_bool(j, "fits", fits);
            rx_json_end(j);
        }
        rx_json_end(j);
        rx_json_end(j);
    }
    rx_json_end(j);
}

void rx_restoration_json(rx_text *dst, const rx_restoration_page *page)
{
    const rx_restoration_numbers *m = page->numbers;
    const rx_restoration_results *r = m->results;
    rx_json j = rx_json_on(dst);
    int ends, choices;
    rx_json_campaign_begin(&j, "restoration", page->record);
    rx_json_string(&j, "about", r->about);
    rx_json_count(&j, "scene_side", (unsigned long long)r->side);
    rx_json_number(&j, "peak", r->peak);
    rx_json_number(&j, "sharp_fwhm", r->sharp_fwhm);
    rx_json_numbers(&j, "fwhm_trained", 2, r->fwhm_trained);
    rx_json_numbers(&j, "noise_level_trained", 2, r->level_trained);
    rx_json_count(&j, "tune_scenes", (unsigned long long)r->tune_scenes);
    rx_tuning_ends(r, &ends, &choices);
    rx_json_count(&j, "tune_choices", (unsigned long long)choices);
    rx_json_count(&j, "tune_choices_at_end", (unsigned long long)ends);
    rx_json_array(&j, "bins", false);
    for (int b = 0; b < r->nbins; b++)
        json_bin(&j, m, b);
    rx_json_end(&j);
    json_paper(&j);
    rx_json_campaign_end(&j, page->record, page->nverdicts, page->verdict);
}

static void bin_columns(rx_ecsv *t)
{
    rx_ecsv_column(t, "by", RX_ECSV_TEXT, "", "binned quantity: fwhm (pixels) or sigma (ADU)");
    rx_ecsv_column(t, "low", RX_ECSV_FLOAT, "", "bin");
    rx_ecsv_column(t, "high", RX_ECSV_FLOAT, "", "bin");
}

static void bin_cells(rx_ecsv *t, const rx_restoration_bin *bin)
{
    rx_ecsv_text(t, kind_of(bin));
    rx_ecsv_number(t, bin->low);
    rx_ecsv_number(t, bin->high);
}

void rx_restoration_bins_ecsv(rx_text *dst, const rx_restoration_page *page)
{
    const rx_restoration_numbers *m = page->numbers;
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_campaign(&t, "restoration", page->record);
    bin_columns(&t);
    rx_ecsv_column(&t, "method", RX_ECSV_TEXT, "", "method");
    rx_ecsv_estimate_columns(&t, "psnr_mean", "dB", "mean PSNR, t interval");
    rx_ecsv_column(&t, "psnr_median", RX_ECSV_FLOAT, "dB", "median PSNR");
    rx_ecsv_estimate_columns(&t, "ssim_mean", "", "mean SSIM, t interval");
    rx_ecsv_column(&t, "ssim_median", RX_ECSV_FLOAT, "", "median SSIM");
    rx_ecsv_column(&t, "settings_psnr", RX_ECSV_TEXT, "", "what tuning chose for PSNR");
    rx_ecsv_column(&t, "end_psnr", RX_ECSV_INT, "", "1: at an end of what was tried");
    rx_ecsv_column(&t, "settings_ssim", RX_ECSV_TEXT, "", "what tuning chose for SSIM");
    rx_ecsv_column(&t, "end_ssim", RX_ECSV_INT, "", "1: at an end of what was tried");
    rx_ecsv_columns_end(&t);
    for (int b = 0; b < m->results->nbins; b++)
        for (int k = 0; k < m->results->nmethods; k++) {
            bin_cells(&t, &m->results->bins[b]);
            rx_ecsv_text(&t, m->results->method[k]);
            for (int q = 0; q < RX_QUALITIES; q++) {
                rx_ecsv_estimate(&t, rx_quality_mean(m, b, (rx_quality)q, k));
                rx_ecsv_number(&t, rx_quality_box(m, b, (rx_quality)q, k)->median);
            }
            const rx_method_scores *s = &m->results->bins[b].method[k];
            rx_ecsv_text(&t, s->settings_psnr);
            rx_ecsv_count(&t, s->end_psnr);
            rx_ecsv_text(&t, s->settings_ssim);
            rx_ecsv_count(&t, s->end_ssim);
            rx_ecsv_row_end(&t);
        }
}

static void duel_cells(rx_ecsv *t, const rx_quality_duel *d)
{
    rx_ecsv_estimate(t, &d->paired.difference);
    rx_ecsv_estimate(t, &d->bootstrap);
    rx_ecsv_number(t, d->paired.statistic);
    rx_ecsv_number(t, d->paired.effect);
    rx_ecsv_number(t, d->paired.p);
    rx_ecsv_number(t, d->holm);
    rx_ecsv_number(t, d->wilcoxon.p);
    rx_ecsv_number(t, d->holm_wilcoxon);
    rx_ecsv_number(t, d->two_sample.statistic);
    rx_ecsv_number(t, d->two_sample.dof);
    rx_ecsv_number(t, d->two_sample.p);
    rx_ecsv_number(t, d->two_sample.effect);
}

void rx_restoration_duels_ecsv(rx_text *dst, const rx_restoration_page *page)
{
    const rx_restoration_numbers *m = page->numbers;
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_campaign(&t, "restoration", page->record);
    bin_columns(&t);
    rx_ecsv_column(&t, "metric", RX_ECSV_TEXT, "", "psnr (dB) or ssim");
    rx_ecsv_column(&t, "first", RX_ECSV_TEXT, "", "method");
    rx_ecsv_column(&t, "second", RX_ECSV_TEXT, "", "method");
    rx_ecsv_estimate_columns(&t, "difference", "", "mean of first - second, t interval");
    rx_ecsv_estimate_columns(&t, "bootstrap", "", "the same, bootstrap interval");
    rx_ecsv_column(&t, "t", RX_ECSV_FLOAT, "", "paired t, n - 1 degrees of freedom");
    rx_ecsv_column(&t, "d_z", RX_ECSV_FLOAT, "", "mean over standard deviation of the differences");
    rx_ecsv_column(&t, "p", RX_ECSV_FLOAT, "", "of t, two-sided");
    rx_ecsv_column(&t, "p_holm", RX_ECSV_FLOAT, "", "adjusted for the bins");
    rx_ecsv_column(&t, "wilcoxon_p", RX_ECSV_FLOAT, "", "signed ranks, two-sided");
    rx_ecsv_column(&t, "wilcoxon_p_holm", RX_ECSV_FLOAT, "", "adjusted for the bins");
    rx_ecsv_column(&t, "two_sample_t", RX_ECSV_FLOAT, "", "as the paper: pooled variance");
    rx_ecsv_column(&t, "two_sample_dof", RX_ECSV_FLOAT, "", "its degrees of freedom");
    rx_ecsv_column(&t, "two_sample_p", RX_ECSV_FLOAT, "", "its p, two-sided");
    rx_ecsv_column(&t, "cohen_d", RX_ECSV_FLOAT, "", "its effect size");
    rx_ecsv_columns_end(&t);
    for (int b = 0; b < m->results->nbins; b++)
        for (int q = 0; q < RX_QUALITIES; q++)
            for (int p = 0; p < m->npairs; p++) {
                bin_cells(&t, &m->results->bins[b]);
                rx_ecsv_text(&t, q == RX_PSNR ? "psnr" : "ssim");
                rx_ecsv_text(&t, m->results->method[m->pair[p].first]);
                rx_ecsv_text(&t, m->results->method[m->pair[p].second]);
                duel_cells(&t, rx_quality_duel_of(m, b, (rx_quality)q, p));
                rx_ecsv_row_end(&t);
            }
}

void rx_restoration_scenes_ecsv(rx_text *dst, const rx_restoration_page *page)
{
    const rx_restoration_results *r = page->numbers->results;
    rx_ecsv t = rx_ecsv_on(dst);
    rx_ecsv_campaign(&t, "restoration", page->record);
    bin_columns(&t);
    rx_ecsv_column(&t, "scene", RX_ECSV_LONG, "", "from 1 in each bin");
    rx_ecsv_column(&t, "fwhm", RX_ECSV_FLOAT, "pix", "of the PSF");
    rx_ecsv_column(&t, "sigma", RX_ECSV_FLOAT, "adu", "of the noise");
    rx_ecsv_column(&t, "noise_level", RX_ECSV_FLOAT, "", "the noise on the scale of models");
    rx_ecsv_column(&t, "method", RX_ECSV_TEXT, "", "method");
    rx_ecsv_column(&t, "psnr", RX_ECSV_FLOAT, "dB", "with the settings for PSNR");
    rx_ecsv_column(&t, "ssim", RX_ECSV_FLOAT, "", "with the settings for SSIM");
    rx_ecsv_columns_end(&t);
    for (int b = 0; b < r->nbins; b++)
        for (long i = 0; i < r->bins[b].nscenes; i++)
            for (int k = 0; k < r->nmethods; k++) {
                bin_cells(&t, &r->bins[b]);
                rx_ecsv_count(&t, i + 1);
                rx_ecsv_number(&t, r->bins[b].fwhm[i]);
                rx_ecsv_number(&t, r->bins[b].sigma[i]);
                rx_ecsv_number(&t, r->bins[b].level[i]);
                rx_ecsv_text(&t, r->method[k]);
                rx_ecsv_number(&t, r->bins[b].method[k].psnr[i]);
                rx_ecsv_number(&t, r->bins[b].method[k].ssim[i]);
                rx_ecsv_row_end(&t);
            }
}

/* Mean over bins of the means. */
static double overall(const rx_restoration_numbers *m, int by_sigma, rx_quality quality, int method)
{
    double sum = 0;
    int n = 0;
    for (int b = 0; b < m->results->nbins; b++)
        if (m->results->bins[b].by_sigma == by_sigma &&
            isfinite(rx_quality_mean(m, b, quality, method)->value)) {
            sum += rx_quality_mean(m, b, quality, method)->value;
            n++;
        }
    return n > 0 ? sum / n : NAN;
}

void rx_restoration_brief(rx_text *dst, const rx_restoration_page *page)
{
    const rx_restoration_numbers *m = page->numbers;
    rx_text said = {0};
    int ends, choices;
    rx_text_printf(dst, "%-12s %14s %14s %14s %14s\n", "method", "PSNR by FWHM", "SSIM by FWHM",
                   "PSNR by noise", "SSIM by noise");
    for (int k = 0; k < m->results->nmethods; k++) {
        rx_text_printf(dst, "%-12s", m->results->method[k]);
        for (int kind = 0; kind < 2; kind++)
            for (int q = 0; q < RX_QUALITIES; q++)
                rx_text_printf(dst, " %14.*f", q == RX_PSNR ? 2 : 4, overall(m, kind, (rx_quality)q, k));
        rx_text_add(dst, "\n");
    }
    for (int p = 0; p < m->npairs && p < 2; p++)
        rx_restoration_pair_words(&said, m, p);
    if (said.data != NULL)
        rx_text_printf(dst, "%s\n", said.data);
    dst->failed = dst->failed || said.failed;
    rx_text_free(&said);
    rx_tuning_ends(m->results, &ends, &choices);
    if (ends > 0)
        rx_text_printf(dst,
                       "tuning took an end of what was tried in %d of %d choices; longer TUNE_NITER or "
                       "TUNE_FILTER may serve the tuned methods better\n",
                       ends, choices);
    rx_brief_verdicts(dst, page->nverdicts, page->verdict);
}
