/* Duels between restorers on the same stars, and what they say about the paper's claims. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/compare.h"
#include "lab/photometry_numbers.h"

static const double SIGNIFICANT = 0.05, LOW_SNR = 10;

static rx_photometry_duel *duel_at(rx_photometry_numbers *m, int field, int set, int pair)
{
    return &m->duel[((size_t)field * (size_t)m->lab->nscenes + (size_t)set) * (size_t)m->npairs +
                    (size_t)pair];
}

/* Stars that only one of two restorers has above its own threshold. */
static void compare_found(const rx_photometry_set *set, rx_run_pair pair, double first_score,
                          double second_score, rx_found_duel *dst)
{
    *dst = (rx_found_duel){0};
    for (long i = 0; i < set->nstars; i++) {
        /* NAN, not found, is below every threshold */
        int first = rx_star_of(set, pair.first, i)[RX_STAR_SCORE] >= first_score;
        int second = rx_star_of(set, pair.second, i)[RX_STAR_SCORE] >= second_score;
        dst->only_first += first && !second;
        dst->only_second += second && !first;
    }
    dst->p = rx_mcnemar(dst->only_first, dst->only_second);
}

static rx_status compare_errors(const rx_photometry_set *set, rx_run_pair pair, double *a, double *b,
                                rx_photometry_duel *dst, rx_error *err)
{
    long n = 0;
    for (long i = 0; i < set->nstars; i++) {
        double first = 100 * fabs(rx_star_of(set, pair.first, i)[RX_STAR_RATIO] - 1);
        double second = 100 * fabs(rx_star_of(set, pair.second, i)[RX_STAR_RATIO] - 1);
        if (isfinite(first) && isfinite(second)) {
            a[n] = first;
            b[n++] = second;
        }
    }
    return rx_compare_paired(n, a, b, &dst->paired, &dst->wilcoxon, err);
}

/* By Holm for the sets of a field. */
static rx_status adjust(rx_photometry_numbers *m, int field, int pair, rx_error *err)
{
    if (m->lab->nscenes == 0)
        return RX_OK;
    rx_photometry_duel *d = duel_at(m, field, 0, pair);
    const size_t stride = (size_t)m->npairs * sizeof *d;
    const long n = m->lab->nscenes;
    RX_TRY(rx_compare_holm(n, stride, &d->found.p, &d->found.holm, err));
    RX_TRY(rx_compare_holm(n, stride, &d->paired.p, &d->holm, err));
    RX_TRY(rx_compare_holm(n, stride, &d->wilcoxon.p, &d->holm_wilcoxon, err));
    for (int p = 0; p < m->nprecisions; p++)
        RX_TRY(rx_compare_holm(n, stride, &d->complete[p].p, &d->complete[p].holm, err));
    return RX_OK;
}

static void decide_found(rx_found_duel *d)
{
    if (d->holm < SIGNIFICANT)
        d->winner = d->only_first > d->only_second ? 1 : -1;
}

static rx_status compare_pair(rx_photometry_numbers *m, int f, int pair, double *a, double *b, rx_error *err)
{
    rx_run_pair two = m->pair[pair];
    const rx_photometry_cut *first = rx_photometry_whole_of(m, f, two.first)->cut;
    const rx_photometry_cut *second = rx_photometry_whole_of(m, f, two.second)->cut;
    rx_status status = RX_OK;
    for (int k = 0; k < m->lab->nscenes && status == RX_OK; k++) {
        rx_photometry_duel *d = duel_at(m, f, k, pair);
        const rx_photometry_set set = rx_photometry_set_of(m->lab, f, k);
        compare_found(&set, two, -INFINITY, -INFINITY, &d->found);
        for (int p = 0; p < m->nprecisions; p++)
            compare_found(&set, two, first[p].score, second[p].score, &d->complete[p]);
        status = compare_errors(&set, two, a, b, d, err);
    }
    if (status == RX_OK)
        status = adjust(m, f, pair, err);
    for (int k = 0; k < m->lab->nscenes && status == RX_OK; k++) {
        rx_photometry_duel *d = duel_at(m, f, k, pair);
        decide_found(&d->found);
        for (int p = 0; p < m->nprecisions; p++)
            decide_found(&d->complete[p]);
        if (d->holm < SIGNIFICANT)
            d->winner = d->paired.difference.value < 0 ? 1 : -1;
    }
    return status;
}

rx_status rx_photometry_duels_make(rx_photometry_numbers *m, int f, rx_error *err)
{
    size_t most = (size_t)m->lab->nscenes + 1;
    rx_status status = RX_OK;
    for (int k = 0; k < m->lab->nscenes; k++)
        most += (size_t)rx_lab_set_of(m->lab, f, k)->table[RX_PHOTOMETRY_STAR].n;
    double *a = RX_NEW(double, most), *b = RX_NEW(double, most);
    if (a == NULL || b == NULL)
        status = rx_error_memory(err, most * sizeof *a);
    for (int pair = 0; pair < m->npairs && status == RX_OK; pair++)
        status = compare_pair(m, f, pair, a, b, err);
    free(a);
    free(b);
    return status;
}

/* ---- words ---- */

/* What a sentence is about: stars found (whole lists), found at a precision (0.. = which), errors. */
enum { ABOUT_ERRORS = -2, ABOUT_FOUND = -1 };

static int winner_of(const rx_photometry_duel *d, int about)
{
    if (about == ABOUT_ERRORS)
        return d->winner;
    return about == ABOUT_FOUND ? d->found.winner : d->complete[about].winner;
}

/* Sets with this outcome; low: only those of low S/N. */
static int count(const rx_photometry_numbers *m, int f, int pair, int about, int winner, int low)
{
    int n = 0;
    for (int k = 0; k < m->lab->nscenes; k++)
        if (!low || rx_photometry_set_of(m->lab, f, k).snr < LOW_SNR)
            n += winner_of(rx_photometry_duel_of(m, f, k, pair), about) == winner;
    return n;
}

/* "20 to 21.5, 22.5" */
static void mags_in_words(rx_text *dst, const rx_photometry_numbers *m, int f, int pair, int about,
                          int winner)
{
    int any = 0;
    for (int k = 0; k < m->lab->nscenes; k++) {
        if (winner_of(rx_photometry_duel_of(m, f, k, pair), about) != winner)
            continue;
        int last = k;
        while (last + 1 < m->lab->nscenes &&
               winner_of(rx_photometry_duel_of(m, f, last + 1, pair), about) == winner)
            last++;
        rx_text_printf(dst, "%s%g", any ? ", " : "", m->lab->scene[k].mag);
        if (last > k)
            rx_text_printf(dst, " to %g", m->lab->scene[last].mag);
        any = 1;
        k = last;
    }
}

static void sentence(rx_text *dst, const rx_photometry_numbers *m, int f, int pair, int about)
{
    static const struct {
        int winner;
        const char *found, *errors;
    } outcomes[] = {{1, "more at magnitude", "smaller at magnitude"},
                    {-1, "fewer at magnitude", "larger at magnitude"},
                    {0, "no clear difference at", "no clear difference at"}};
    const rx_lab *r = m->lab;
    int any = 0;
    rx_text_printf(dst, "%s against %s, ", r->run[m->pair[pair].first].name,
                   r->run[m->pair[pair].second].name);
    if (about == ABOUT_ERRORS)
        rx_text_add(dst, "flux errors: ");
    else if (about == ABOUT_FOUND)
        rx_text_add(dst, "stars found, whole lists: ");
    else
        rx_text_printf(dst, "stars found at precision %g: ", m->precision[about]);
    for (size_t i = 0; i < sizeof outcomes / sizeof *outcomes; i++)
        if (count(m, f, pair, about, outcomes[i].winner, 0) > 0) {
            rx_text_printf(dst, "%s%s ", any++ ? "; " : "",
                           about == ABOUT_ERRORS ? outcomes[i].errors : outcomes[i].found);
            mags_in_words(dst, m, f, pair, about, outcomes[i].winner);
        }
    rx_text_add(dst, ". ");
}

void rx_photometry_pair_words(rx_text *dst, const rx_photometry_numbers *m, int field, int pair)
{
    for (int about = ABOUT_FOUND; about < m->nprecisions; about++)
        sentence(dst, m, field, pair, about);
    sentence(dst, m, field, pair, ABOUT_ERRORS);
}

/* ---- verdicts ---- */

static int pair_of(const rx_photometry_numbers *m, int a, int b, int *sign)
{
    for (int i = 0; i < m->npairs && a >= 0 && b >= 0; i++) {
        *sign = m->pair[i].first == a ? 1 : -1;
        if ((m->pair[i].first == a && m->pair[i].second == b) ||
            (m->pair[i].first == b && m->pair[i].second == a))
            return i;
    }
    return -1;
}

/* a beats b somewhere and loses nowhere, on this field. */
static int beats(const rx_photometry_numbers *m, int f, int a, int b, int about, int low)
{
    int sign = 1, pair = pair_of(m, a, b, &sign);
    return pair >= 0 && count(m, f, pair, about, sign, low) > 0 && count(m, f, pair, about, -sign, low) == 0;
}

/* The same on every field and at every precision. */
static int finds_more(const rx_photometry_numbers *m, int a, int b, int low)
{
    int all = m->lab->nconditions > 0;
    for (int f = 0; f < m->lab->nconditions; f++)
        for (int p = 0; p < m->nprecisions && rx_condition_true(&m->lab->sky[f].condition); p++)
            all = all && beats(m, f, a, b, p, low);
    return all;
}

static int errs_less(const rx_photometry_numbers *m, int a, int b)
{
    int all = m->lab->nconditions > 0;
    for (int f = 0; f < m->lab->nconditions; f++)
        all = all && (!rx_condition_true(&m->lab->sky[f].condition) || beats(m, f, a, b, ABOUT_ERRORS, 0));
    return all;
}

static void tell(rx_text *dst, const rx_photometry_numbers *m, int a, int b, int errors)
{
    int sign, pair = pair_of(m, a, b, &sign);
    for (int f = 0; f < m->lab->nconditions && pair >= 0; f++) {
        if (!rx_condition_true(&m->lab->sky[f].condition))
            continue;
        rx_text_printf(dst, "Field %s: ", m->lab->sky[f].name);
        for (int p = 0; p < m->nprecisions && !errors; p++)
            sentence(dst, m, f, pair, p);
        if (errors)
            sentence(dst, m, f, pair, ABOUT_ERRORS);
    }
}

static void judge_restored(const void *numbers, rx_claim_verdict *v)
{
    const rx_photometry_numbers *m = numbers;
    int others = 0, holds = 1;
    for (int run = 0; run < m->lab->nruns && m->none >= 0; run++) {
        if (run == m->none || m->lab->run[run].templates) /* the same list */
            continue;
        others++;
        holds = holds && finds_more(m, run, m->none, 0);
        tell(&v->said, m, run, m->none, 0);
    }
    if (others > 0)
        v->state = holds ? RX_REPRODUCED : RX_NOT_REPRODUCED;
    else
        rx_text_add(&v->said, "NONE and a restorer must both take part. ");
}

/* The network against NONE and against every other restorer, or what the others do where it is absent. */
static void judge_net(const rx_photometry_numbers *m, int low, int errors, rx_claim_verdict *v)
{
    int holds = 1, rivals = 0;
    if (m->net < 0)
        rx_text_add(&v->said, "NET did not take part. ");
    for (int run = 0; run < m->lab->nruns; run++) {
        int a = m->net >= 0 ? m->net : run, b = m->net >= 0 ? run : m->none;
        if (a == b || (errors && b != m->none) || m->lab->run[run].templates)
            continue;
        rivals++;
        holds = holds && (errors ? errs_less(m, a, b) : finds_more(m, a, b, low));
        if (m->net >= 0 || errors || low)
            tell(&v->said, m, a, b, errors);
    }
    if (m->net >= 0 && rivals > 0)
        v->state = holds ? RX_REPRODUCED : RX_NOT_REPRODUCED;
}

/* One field: MagErr against RL, bias and scatter against the unrestored image; what fails is said. */
static int fluxes_hold(const rx_photometry_numbers *m, int f, int rl, rx_text *said)
{
    const double sure_snr = 12, most_bias = 1, most_scatter = 1.5;
    int holds = 1;
    for (int k = 0; k < m->lab->nscenes; k++) {
        const rx_photometry_cell *net = rx_photometry_cell_of(m, f, k, m->net);
        const rx_photometry_cell *none = rx_photometry_cell_of(m, f, k, m->none);
        const rx_photometry_cell *other = rx_photometry_cell_of(m, f, k, rl);
        const double bias = fabs(net->bias_percent.value);
        const double scatter = net->scatter_percent.value / none->scatter_percent.value;
        rx_text lost = {0};
        if (net->magerr.value > other->magerr.value)
            rx_text_printf(&lost, " MagErr %.2f %% (RL %.2f %%)", net->magerr.value, other->magerr.value);
        if (rx_photometry_set_of(m->lab, f, k).snr > sure_snr && !(bias < most_bias))
            rx_text_printf(&lost, " bias %.2f %%", net->bias_percent.value);
        if (rx_photometry_set_of(m->lab, f, k).snr > sure_snr && !(scatter <= most_scatter))
            rx_text_printf(&lost, " scatter %.2f times NONE's", scatter);
        if (lost.length > 0)
            rx_text_printf(said, "Field %s, magnitude %g:%s. ", m->lab->sky[f].name, m->lab->scene[k].mag,
                           lost.data);
        holds = holds && lost.length == 0;
        said->failed |= lost.failed;
        rx_text_free(&lost);
    }
    return holds;
}

static void judge_fluxes(const void *numbers, rx_claim_verdict *v)
{
    const rx_photometry_numbers *m = numbers;
    int rl = -1, holds = 1, fields = 0;
    for (int run = 0; run < m->lab->nruns; run++)
        if (strcmp(m->lab->run[run].name, "RL") == 0)
            rl = run;
    if (m->net < 0 || m->none < 0 || rl < 0) {
        rx_text_add(&v->said, "NET, RL and NONE must all take part. ");
        return;
    }
    for (int f = 0; f < m->lab->nconditions; f++) {
        if (!rx_condition_true(&m->lab->sky[f].condition))
            continue;
        fields++;
        holds = fluxes_hold(m, f, rl, &v->said) && holds;
    }
    if (fields > 0)
        v->state = holds ? RX_REPRODUCED : RX_NOT_REPRODUCED;
}

/* MagErr of a run less that of another one on the stars that all runs found, and the error of that. */
static double errs_more(const rx_lab *r, const rx_photometry_set *set, int run, int other, double *error,
                        double *magerr, long *n)
{
    double sum = 0, square = 0;
    *n = 0;
    *magerr = 0;
    for (long i = 0; i < set->nstars; i++) {
        int all = 1;
        for (int k = 0; k < r->nruns; k++)
            all = all && isfinite(rx_star_of(set, k, i)[RX_STAR_RATIO]);
        if (!all)
            continue;
        const double a = 100 * fabs(rx_star_of(set, run, i)[RX_STAR_RATIO] - 1);
        const double d = a - 100 * fabs(rx_star_of(set, other, i)[RX_STAR_RATIO] - 1);
        *magerr += a;
        sum += d;
        square += d * d;
        ++*n;
    }
    const double count = (double)*n, mean = sum / count;
    *magerr /= count;
    *error = sqrt(fmax(square / count - mean * mean, 0) / (count - 1));
    return mean;
}

/* One magnitude; 1: held, 0: not, and what is lost is said. */
static int templates_hold(const rx_photometry_numbers *m, int f, int k, int run, rx_text *said)
{
    const rx_lab *r = m->lab;
    const rx_photometry_set own = rx_photometry_set_of(r, f, k), *set = &own;
    int holds = 1;
    for (int other = 0; other < r->nruns; other++) {
        double error, magerr;
        long n;
        const double more = r->run[other].templates ? 0 : errs_more(r, set, run, other, &error, &magerr, &n);
        if (r->run[other].templates || n < 2 || !(more > 1.96 * error))
            continue;
        holds = 0;
        rx_text_printf(said, "Field %s, magnitude %g: %s %.2f %%, %s %.2f %%. ", r->sky[f].name, set->mag,
                       r->run[run].name, magerr, r->run[other].name, magerr - more);
    }
    return holds;
}

static void judge_templates(const void *numbers, rx_claim_verdict *v)
{
    const rx_photometry_numbers *m = numbers;
    const rx_lab *r = m->lab;
    int held = 0, all = 0;
    for (int run = 0; run < r->nruns; run++)
        for (int f = 0; f < r->nconditions && r->run[run].templates; f++)
            for (int k = 0; k < r->nscenes && rx_condition_true(&r->sky[f].condition); k++) {
                all++;
                held += templates_hold(m, f, k, run, &v->said);
            }
    if (all > 0)
        v->state = held == all ? RX_REPRODUCED : RX_NOT_REPRODUCED;
    if (all > 0)
        rx_text_printf(&v->said, "Held in %d of %d sets of stars. ", held, all);
    else
        rx_text_add(&v->said, "No run had the fluxes of template photometry. ");
}

static void judge_best(const void *numbers, rx_claim_verdict *v)
{
    judge_net(numbers, v->claim == RX_CLAIM_LOW_SNR, v->claim == RX_CLAIM_ACCURACY, v);
}

void rx_photometry_verdicts(const rx_photometry_numbers *m, rx_claim_verdicts *verdicts)
{
    static const rx_claim_judge judges[] = {{RX_CLAIM_RESTORED_BETTER, judge_restored},
                                            {RX_CLAIM_NET_BEST, judge_best},
                                            {RX_CLAIM_LOW_SNR, judge_best},
                                            {RX_CLAIM_ACCURACY, judge_best},
                                            {RX_CLAIM_SPEED, NULL},
                                            {RX_CLAIM_FLUXES, judge_fluxes},
                                            {RX_CLAIM_TEMPLATES, judge_templates}};
    rx_claims_judge(sizeof judges / sizeof *judges, judges, 0, m, verdicts);
}
