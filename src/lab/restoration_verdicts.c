/* What the numbers of a restoration campaign say about the paper's claims. */
#include <math.h>
#include <string.h>

#include "lab/restoration_numbers.h"

/* Bins that a sentence is about. */
typedef enum region { ANYWHERE, INSIDE, BEYOND } region;

typedef struct selection {
    const rx_restoration_numbers *m;
    int by_sigma; /* -1: both */
    rx_quality quality;
    region where;
    int pair;
} selection;

static int selected(const selection *s, int b)
{
    const rx_restoration_bin *bin = &s->m->results->bins[b];
    if (s->by_sigma >= 0 && bin->by_sigma != s->by_sigma)
        return 0;
    return s->where == ANYWHERE || (s->where == INSIDE ? s->m->inside[b] : rx_bin_is_beyond(s->m, b));
}

static int winner_of(const selection *s, int b)
{
    return rx_quality_duel_of(s->m, b, s->quality, s->pair)->winner;
}

/* Bins of this outcome (-1, 0, +1; 2: any). */
static int count(const selection *s, int winner)
{
    int n = 0;
    for (int b = 0; b < s->m->results->nbins; b++)
        n += selected(s, b) && (winner == 2 || winner_of(s, b) == winner);
    return n;
}

/* "2 to 5, 7 and 9 to 11": centres of the bins of one kind with this outcome. */
static void centres_in_words(rx_text *dst, const selection *s, int winner)
{
    const rx_restoration_results *r = s->m->results;
    int any = 0;
    for (int b = 0; b < r->nbins; b++) {
        if (!selected(s, b) || winner_of(s, b) != winner)
            continue;
        int last = b;
        while (last + 1 < r->nbins && selected(s, last + 1) && winner_of(s, last + 1) == winner)
            last++;
        rx_text_printf(dst, "%s%g", any ? ", " : "", rx_bin_centre(&r->bins[b]));
        if (last > b)
            rx_text_printf(dst, " to %g", rx_bin_centre(&r->bins[last]));
        any = 1;
        b = last;
    }
    rx_text_add(dst, s->by_sigma ? "" : " px");
}

/* Smallest and largest mean difference among them, as positive numbers. */
static void amounts_in_words(rx_text *dst, const selection *s, int winner)
{
    double least = INFINITY, most = 0;
    for (int b = 0; b < s->m->results->nbins; b++)
        if (selected(s, b) && winner_of(s, b) == winner) {
            double d = fabs(rx_quality_duel_of(s->m, b, s->quality, s->pair)->paired.difference.value);
            least = fmin(least, d);
            most = fmax(most, d);
        }
    const char *unit = rx_quality_unit(s->quality);
    rx_text_printf(dst, "by %.2g", least);
    if (most > least)
        rx_text_printf(dst, " to %.2g", most);
    rx_text_printf(dst, "%s%s", unit[0] != '\0' ? " " : "", unit);
}

/* One sentence for one quality and one kind of bin. */
static void sentence(rx_text *dst, const selection *s)
{
    static const struct {
        int winner;
        const char *words;
    } outcomes[] = {{1, "above"}, {-1, "below"}, {0, "no clear difference"}};
    const rx_restoration_results *r = s->m->results;
    const rx_method_pair *pair = &s->m->pair[s->pair];
    int all = count(s, 2), any = 0;
    if (all == 0)
        return;
    rx_text_printf(dst, "%s by %s, %s against %s: ", rx_quality_name(s->quality),
                   s->by_sigma ? "noise" : "FWHM", r->method[pair->first], r->method[pair->second]);
    for (size_t i = 0; i < sizeof outcomes / sizeof *outcomes; i++) {
        int n = count(s, outcomes[i].winner);
        if (n == 0)
            continue;
        rx_text_printf(dst, "%s%s in %d of %d bins (", any ? "; " : "", outcomes[i].words, n, all);
        centres_in_words(dst, s, outcomes[i].winner);
        if (outcomes[i].winner != 0) {
            rx_text_add(dst, ", ");
            amounts_in_words(dst, s, outcomes[i].winner);
        }
        rx_text_add(dst, ")");
        any = 1;
    }
    rx_text_add(dst, ". ");
}

static void sentences(rx_text *dst, const rx_restoration_numbers *m, int pair, int by_sigma, region where)
{
    for (int q = 0; q < RX_QUALITIES && pair >= 0; q++)
        for (int kind = 0; kind < 2; kind++)
            if (by_sigma < 0 || by_sigma == kind)
                sentence(dst, &(selection){m, kind, (rx_quality)q, where, pair});
}

void rx_restoration_pair_words(rx_text *dst, const rx_restoration_numbers *m, int pair)
{
    sentences(dst, m, pair, -1, ANYWHERE);
}

/* The first of a pair wins wherever one looks. */
static int wins_all(const rx_restoration_numbers *m, int pair, int by_sigma, region where)
{
    int wins = 0, all = 0;
    for (int q = 0; q < RX_QUALITIES && pair >= 0; q++) {
        selection s = {m, by_sigma, (rx_quality)q, where, pair};
        wins += count(&s, 1);
        all += count(&s, 2);
    }
    return all > 0 && wins == all;
}

static const char ABSENT[] = "NET did not take part. ";

/* What RL alone shows in these bins, where the claim speaks of a network that is not there. */
static void instead(rx_text *dst, const rx_restoration_numbers *m, region where)
{
    rx_text_add(dst, ABSENT);
    sentences(dst, m, m->rl >= 0 ? rx_method_pair_find(m, m->rl, m->blurred) : -1, -1, where);
    sentences(dst, m, m->rl >= 0 ? rx_method_pair_find(m, m->rl, m->smoothed) : -1, -1, where);
}

static rx_claim_state state_of(int holds)
{
    return holds ? RX_REPRODUCED : RX_NOT_REPRODUCED;
}

/* The printed columns: which of them are not significant by their own t, and whether p follows from t. */
static void paper_itself(rx_text *dst)
{
    int fits = 0, all = 0;
    rx_text other = {0};
    for (int i = 0; i < RX_PAPER_TABLES; i++) {
        const rx_paper_table *table = rx_paper_table_get(i);
        for (int k = 0; k < table->n; k++, all++) {
            double p, ln_p;
            const rx_paper_column *c = &table->column[k];
            if (rx_paper_column_fits(table, c, &p, &ln_p)) {
                fits++;
                continue;
            }
            rx_text_printf(&other, "; Table %d at %s %g prints p = %.3g, but t = %.2f gives %.2g%s",
                           table->number, table->by_sigma ? "sigma" : "FWHM", c->bin, c->p, c->t, p,
                           p < 0.05 ? "" : ", which is not significant");
        }
    }
    rx_text_printf(dst, "The paper's own tables: p follows from t in %d of %d columns%s.", fits, all,
                   other.data != NULL ? other.data : "");
    dst->failed = dst->failed || other.failed;
    rx_text_free(&other);
}

/* Printed columns for which there is a bin here, and how many of these have p < 0.05. */
static void two_sample_count(const rx_restoration_numbers *m, int pair, int *below, int *tested)
{
    *below = *tested = 0;
    for (int i = 0; i < RX_PAPER_TABLES; i++) {
        const rx_paper_table *table = rx_paper_table_get(i);
        for (int b = 0; b < m->results->nbins; b++) {
            const rx_restoration_bin *bin = &m->results->bins[b];
            if (bin->by_sigma != table->by_sigma || rx_paper_column_at(table, rx_bin_centre(bin)) == NULL)
                continue;
            const rx_quality_duel *d = rx_quality_duel_of(m, b, table->ssim ? RX_SSIM : RX_PSNR, pair);
            *tested += 1;
            *below += d->two_sample.p < 0.05;
        }
    }
}

static void judge_every_bin(const void *numbers, rx_claim_verdict *v)
{
    const rx_restoration_numbers *m = numbers;
    int pair = m->net >= 0 ? rx_method_pair_find(m, m->net, m->rl) : -1;
    if (pair < 0) {
        rx_text_add(&v->said, ABSENT);
        return;
    }
    v->state = state_of(wins_all(m, pair, -1, ANYWHERE));
    sentences(&v->said, m, pair, -1, ANYWHERE);
}

static void judge_all_p(const void *numbers, rx_claim_verdict *v)
{
    const rx_restoration_numbers *m = numbers;
    int pair = m->net >= 0 ? rx_method_pair_find(m, m->net, m->rl) : -1, shown = pair >= 0 ? pair : m->chief;
    int below = 0, tested = 0;
    if (shown >= 0)
        two_sample_count(m, shown, &below, &tested);
    if (pair < 0)
        rx_text_add(&v->said, ABSENT);
    else
        v->state = state_of(tested > 0 && below == tested);
    if (shown >= 0)
        rx_text_printf(&v->said,
                       "%s against %s: p below 0.05 in %d of the %d printed columns that have a bin here. ",
                       m->results->method[m->pair[shown].first], m->results->method[m->pair[shown].second],
                       below, tested);
    paper_itself(&v->said);
}

/* Mean PSNR of the first noise bin less that of the last. */
static double fall_with_noise(const rx_restoration_numbers *m, int method)
{
    int first = -1, last = -1;
    for (int b = 0; b < m->results->nbins; b++)
        if (m->results->bins[b].by_sigma) {
            first = first < 0 ? b : first;
            last = b;
        }
    if (first < 0 || method < 0)
        return NAN;
    return rx_quality_mean(m, first, RX_PSNR, method)->value -
           rx_quality_mean(m, last, RX_PSNR, method)->value;
}

static void judge_noise(const void *numbers, rx_claim_verdict *v)
{
    const rx_restoration_numbers *m = numbers;
    int pair = m->net >= 0 ? rx_method_pair_find(m, m->net, m->rl) : -1;
    if (pair >= 0) {
        v->state = state_of(wins_all(m, pair, 1, ANYWHERE) &&
                            fall_with_noise(m, m->net) < fall_with_noise(m, m->rl));
        sentences(&v->said, m, pair, 1, ANYWHERE);
    } else {
        rx_text_add(&v->said, ABSENT);
    }
    rx_text_add(&v->said, "Mean PSNR from the first noise bin to the last falls by");
    for (int i = 0, any = 0; i < m->results->nmethods; i++)
        if (isfinite(fall_with_noise(m, i)))
            rx_text_printf(&v->said, "%s %.2f dB (%s)", any++ ? "," : "", fall_with_noise(m, i),
                           m->results->method[i]);
    rx_text_add(&v->said, ".");
}

static void judge_range(const void *numbers, rx_claim_verdict *v)
{
    const rx_restoration_numbers *m = numbers;
    const region where = v->claim == RX_CLAIM_INSIDE ? INSIDE : BEYOND;
    int blurred = m->net >= 0 ? rx_method_pair_find(m, m->net, m->blurred) : -1;
    int rl = m->net >= 0 ? rx_method_pair_find(m, m->net, m->rl) : -1;
    if (blurred < 0) {
        instead(&v->said, m, where);
        return;
    }
    v->state = state_of(wins_all(m, blurred, -1, where) &&
                        (where == INSIDE || rl < 0 || wins_all(m, rl, -1, where)));
    sentences(&v->said, m, blurred, -1, where);
    sentences(&v->said, m, rx_method_pair_find(m, m->net, m->smoothed), -1, where);
    if (where == BEYOND)
        sentences(&v->said, m, rl, -1, where);
}

/* Above `rival` beyond doubt inside the training, and in most bins that are not. */
static void judge_goal(const void *numbers, rx_claim_verdict *v)
{
    const rx_restoration_numbers *m = numbers;
    const int rival = v->claim == RX_CLAIM_ABOVE_RL ? m->rl : m->flat;
    const double beyond_doubt = 0.001;
    const int pair = m->net >= 0 ? rx_method_pair_find(m, m->net, rival) : -1;
    int sure = 0, inside = 0, wins = 0, beyond = 0;
    if (m->net < 0)
        rx_text_add(&v->said, ABSENT);
    for (int b = 0; b < m->results->nbins && pair >= 0; b++)
        for (int q = 0; q < RX_QUALITIES; q++) {
            const rx_quality_duel *d = rx_quality_duel_of(m, b, (rx_quality)q, pair);
            inside += m->inside[b] != 0;
            beyond += m->inside[b] == 0;
            sure += m->inside[b] && d->winner > 0 && d->holm < beyond_doubt;
            wins += !m->inside[b] && d->winner > 0;
        }
    if (inside + beyond == 0)
        return;
    v->state = state_of(sure == inside && (beyond == 0 || 2 * wins > beyond));
    rx_text_printf(&v->said,
                   "Above with p below %g in %d of %d bins inside the training, above in %d of %d outside "
                   "of it (each bin once for PSNR, once for SSIM). ",
                   beyond_doubt, sure, inside, wins, beyond);
    sentences(&v->said, m, pair, -1, ANYWHERE);
}

void rx_restoration_verdicts(const rx_restoration_numbers *m, rx_claim_verdicts *verdicts)
{
    static const rx_claim_judge judges[] = {{RX_CLAIM_EVERY_BIN, judge_every_bin},
                                            {RX_CLAIM_ALL_P, judge_all_p},
                                            {RX_CLAIM_NOISE, judge_noise},
                                            {RX_CLAIM_INSIDE, judge_range},
                                            {RX_CLAIM_BEYOND, judge_range},
                                            {RX_CLAIM_SPEED, NULL},
                                            {RX_CLAIM_NO_FAKES, NULL},
                                            {RX_CLAIM_ABOVE_RL, judge_goal},
                                            {RX_CLAIM_ABOVE_FLAT, judge_goal}};
    rx_claims_judge(sizeof judges / sizeof *judges, judges, 0, m, verdicts);
}
