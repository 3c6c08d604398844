/* Numbers of the restoration report. */
#include "lab/restoration_numbers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "lab/compare.h"

static const double LEVEL = 0.95, SIGNIFICANT = 0.05;

static size_t slot(const rx_restoration_numbers *m, int bin, rx_quality quality, int method)
{
    return ((size_t)bin * RX_QUALITIES + (size_t)quality) * (size_t)m->results->nmethods + (size_t)method;
}

static size_t duel_slot(const rx_restoration_numbers *m, int bin, rx_quality quality, int pair)
{
    return ((size_t)bin * RX_QUALITIES + (size_t)quality) * (size_t)m->npairs + (size_t)pair;
}

static const double *values_of(const rx_restoration_bin *bin, rx_quality quality, int method)
{
    return quality == RX_PSNR ? bin->method[method].psnr : bin->method[method].ssim;
}

const rx_five_numbers *rx_quality_box(const rx_restoration_numbers *m, int bin, rx_quality quality,
                                      int method)
{
    return &m->box[slot(m, bin, quality, method)];
}

const rx_estimate *rx_quality_mean(const rx_restoration_numbers *m, int bin, rx_quality quality, int method)
{
    return &m->mean[slot(m, bin, quality, method)];
}

const rx_quality_duel *rx_quality_duel_of(const rx_restoration_numbers *m, int bin, rx_quality quality,
                                          int pair)
{
    return &m->duel[duel_slot(m, bin, quality, pair)];
}

int rx_method_pair_find(const rx_restoration_numbers *m, int first, int second)
{
    for (int i = 0; i < m->npairs; i++)
        if (m->pair[i].first == first && m->pair[i].second == second)
            return i;
    return -1;
}

void rx_tuning_ends(const rx_restoration_results *r, int *ends, int *choices)
{
    *ends = *choices = 0;
    for (int b = 0; b < r->nbins; b++)
        for (int k = 0; k < r->nmethods; k++) {
            const rx_method_scores *s = &r->bins[b].method[k];
            *choices += (s->settings_psnr[0] != '\0') + (s->settings_ssim[0] != '\0');
            *ends += s->end_psnr + s->end_ssim;
        }
}

double rx_bin_centre(const rx_restoration_bin *bin)
{
    return 0.5 * (bin->low + bin->high);
}

const char *rx_quality_name(rx_quality quality)
{
    return quality == RX_PSNR ? "PSNR" : "SSIM";
}

const char *rx_quality_unit(rx_quality quality)
{
    return quality == RX_PSNR ? "dB" : "";
}

static int method_named(const rx_restoration_results *r, const char *name)
{
    for (int i = 0; i < r->nmethods; i++)
        if (strcmp(r->method[i], name) == 0)
            return i;
    return -1;
}

static void add_pair(rx_restoration_numbers *m, int first, int second)
{
    if (first >= 0 && second >= 0 && first != second && rx_method_pair_find(m, first, second) < 0 &&
        m->npairs < RX_PAIRS_MAX)
        m->pair[m->npairs++] = (rx_method_pair){first, second};
}

/* Every method against RL, but RL first against what a filter alone does: the untouched image is beaten by
 * any suppression of noise. Then everything against that image. */
static void choose_pairs(rx_restoration_numbers *m)
{
    const rx_restoration_results *r = m->results;
    m->blurred = method_named(r, "BLURRED");
    m->rl = method_named(r, "RL");
    m->flat = method_named(r, "RL_FLAT");
    m->net = method_named(r, "NET");
    m->smoothed = method_named(r, "SMOOTHED");
    add_pair(m, m->net, m->rl);
    add_pair(m, m->net, m->flat);
    add_pair(m, m->rl, m->smoothed);
    add_pair(m, m->rl, m->blurred);
    add_pair(m, m->net, m->smoothed);
    for (int i = 0; i < r->nmethods; i++)
        if (i != m->blurred && i != m->smoothed)
            add_pair(m, i, m->rl);
    for (int i = 0; i < r->nmethods; i++)
        add_pair(m, i, m->blurred);
    m->chief = m->npairs > 0 ? 0 : -1;
}

/* Scratch of one bin. */
typedef struct columns {
    double *a, *b, *zero;
} columns;

static int in_range(double value, const double range[2])
{
    return range[1] > range[0] && value >= range[0] && value <= range[1];
}

/* Where a bin lies beside the training, by the middle of its scenes. */
static rx_status place_bin(rx_restoration_numbers *m, int b, columns *c, rx_error *err)
{
    const rx_restoration_results *r = m->results;
    const rx_restoration_bin *bin = &r->bins[b];
    rx_five_numbers *level = &m->level[b];
    *level = (rx_five_numbers){NAN, NAN, NAN, NAN, NAN, 0, 0, NAN};
    if (bin->nscenes > 0) {
        memcpy(c->a, bin->level, (size_t)bin->nscenes * sizeof *c->a);
        RX_TRY(rx_five_numbers_of(bin->nscenes, c->a, level, err));
    }
    const double fwhm = bin->by_sigma ? 0.5 * (bin->other_low + bin->other_high) : rx_bin_centre(bin);
    m->inside[b] = (char)(in_range(fwhm, r->fwhm_trained) && !(level->median < r->level_trained[0]));
    m->fainter[b] = (char)(r->level_trained[1] > 0.0 && level->median > r->level_trained[1]);
    return RX_OK;
}

int rx_bin_is_beyond(const rx_restoration_numbers *numbers, int bin)
{
    return !numbers->inside[bin] || numbers->fainter[bin];
}

static long finite_values(long n, const double *values, double *dst)
{
    long kept = 0;
    for (long i = 0; i < n; i++)
        if (isfinite(values[i]))
            dst[kept++] = values[i];
    return kept;
}

static rx_status summarise(const rx_restoration_bin *bin, const double *values, columns *c,
                           rx_five_numbers *box, rx_estimate *mean, rx_error *err)
{
    rx_test test;
    long n = finite_values(bin->nscenes, values, c->a);
    *box = (rx_five_numbers){NAN, NAN, NAN, NAN, NAN, 0, 0, NAN};
    *mean = (rx_estimate){NAN, NAN, NAN, n};
    if (n == 0)
        return RX_OK;
    rx_status status = rx_five_numbers_of(n, c->a, box, err);
    mean->value = box->mean;
    if (status == RX_OK && rx_has_spread(n, c->a, c->zero)) {
        status = rx_test_paired(n, c->a, c->zero, &test, err);
        mean->low = test.difference.low;
        mean->high = test.difference.high;
    }
    return status;
}

static rx_status fight(const rx_restoration_bin *bin, const double *first, const double *second,
                       uint64_t seed, columns *c, rx_quality_duel *dst, rx_error *err)
{
    long n = 0;
    for (long i = 0; i < bin->nscenes; i++)
        if (isfinite(first[i]) && isfinite(second[i])) {
            c->a[n] = first[i];
            c->b[n++] = second[i];
        }
    *dst = (rx_quality_duel){.n = n, .holm = NAN, .holm_wilcoxon = NAN};
    dst->paired = dst->wilcoxon = dst->two_sample = rx_no_test();
    dst->bootstrap = (rx_estimate){NAN, NAN, NAN, n};
    if (!rx_has_spread(n, c->a, c->b) || !rx_has_spread(n, c->a, c->zero))
        return RX_OK;
    rx_status status = rx_compare_paired(n, c->a, c->b, &dst->paired, &dst->wilcoxon, err);
    if (status == RX_OK)
        status = rx_test_two_sample(n, c->a, n, c->b, &dst->two_sample, err);
    if (status == RX_OK)
        status = rx_paired_bootstrap(n, c->a, c->b, LEVEL, seed, &dst->bootstrap, err);
    return status;
}

static rx_status measure_bin(rx_restoration_numbers *m, int b, uint64_t seed, columns *c, rx_error *err)
{
    const rx_restoration_bin *bin = &m->results->bins[b];
    rx_status status = rx_interrupt_check(err);
    for (int q = 0; q < RX_QUALITIES && status == RX_OK; q++) {
        rx_quality quality = (rx_quality)q;
        for (int k = 0; k < m->results->nmethods && status == RX_OK; k++)
            status = summarise(bin, values_of(bin, quality, k), c, &m->box[slot(m, b, quality, k)],
                               &m->mean[slot(m, b, quality, k)], err);
        for (int p = 0; p < m->npairs && status == RX_OK; p++)
            status = fight(bin, values_of(bin, quality, m->pair[p].first),
                           values_of(bin, quality, m->pair[p].second), seed, c,
                           &m->duel[duel_slot(m, b, quality, p)], err);
    }
    return status;
}

/* By Holm over the bins of one quantity, FWHM or noise; the former come first. */
static rx_status adjust(rx_restoration_numbers *m, rx_error *err)
{
    const rx_restoration_results *r = m->results;
    const size_t stride = RX_QUALITIES * (size_t)m->npairs * sizeof *m->duel;
    int nfwhm = 0;
    while (nfwhm < r->nbins && !r->bins[nfwhm].by_sigma)
        nfwhm++;
    for (int k = 0; k < 2 * RX_QUALITIES * m->npairs; k++) {
        const int by_sigma = k % 2, first = by_sigma ? nfwhm : 0, n = by_sigma ? r->nbins - nfwhm : nfwhm;
        if (n == 0)
            continue;
        rx_quality_duel *d = &m->duel[(size_t)first * RX_QUALITIES * (size_t)m->npairs + (size_t)k / 2];
        RX_TRY(rx_compare_holm(n, stride, &d->paired.p, &d->holm, err));
        RX_TRY(rx_compare_holm(n, stride, &d->wilcoxon.p, &d->holm_wilcoxon, err));
    }
    for (int i = 0; i < r->nbins * RX_QUALITIES * m->npairs; i++)
        if (m->duel[i].holm < SIGNIFICANT)
            m->duel[i].winner = m->duel[i].paired.difference.value > 0 ? 1 : -1;
    return RX_OK;
}

rx_status rx_restoration_numbers_make(const rx_restoration_results *results, uint64_t seed,
                                      rx_restoration_numbers *dst, rx_error *err)
{
    long most = 1;
    columns c = {0};
    *dst = (rx_restoration_numbers){.results = results};
    choose_pairs(dst);
    for (int b = 0; b < results->nbins; b++)
        most = results->bins[b].nscenes > most ? results->bins[b].nscenes : most;
    size_t slots = (size_t)results->nbins * RX_QUALITIES;
    dst->box = RX_NEW(rx_five_numbers, slots * (size_t)results->nmethods);
    dst->mean = RX_NEW(rx_estimate, slots * (size_t)results->nmethods);
    dst->duel = RX_NEW(rx_quality_duel, slots * (size_t)dst->npairs);
    dst->level = RX_NEW(rx_five_numbers, (size_t)results->nbins);
    dst->inside = RX_NEW(char, (size_t)results->nbins);
    dst->fainter = RX_NEW(char, (size_t)results->nbins);
    c = (columns){RX_NEW(double, (size_t)most), RX_NEW(double, (size_t)most), RX_NEW(double, (size_t)most)};
    rx_status status = RX_OK;
    if (!dst->box || !dst->mean || !dst->duel || !dst->level || !dst->inside || !dst->fainter || !c.a ||
        !c.b || !c.zero)
        status = rx_error_memory(err, slots * sizeof *dst->duel);
    for (int b = 0; b < results->nbins && status == RX_OK; b++) {
        status = place_bin(dst, b, &c, err);
        if (status == RX_OK)
            status = measure_bin(dst, b, seed, &c, err);
    }
    if (status == RX_OK)
        status = adjust(dst, err);
    free(c.a);
    free(c.b);
    free(c.zero);
    if (status != RX_OK)
        rx_restoration_numbers_free(dst);
    return status;
}

void rx_restoration_numbers_free(rx_restoration_numbers *m)
{
    free(m->box);
    free(m->mean);
    free(m->duel);
    free(m->level);
    free(m->inside);
    free(m->fainter);
    *m = (rx_restoration_numbers){0};
}
