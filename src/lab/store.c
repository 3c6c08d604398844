/* What a campaign has found. */
#include "lab/store.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

static const double SIGNIFICANT = 0.05;

void rx_store_free(rx_store *s)
{
    if (s == NULL)
        return;
    for (int g = 0; g < s->ngroups; g++) {
        free(s->group[g].condition);
        free(s->group[g].finding);
        free(s->group[g].contest);
    }
    free(s->group);
    for (int i = 0; i < 3; i++)
        free(s->own[i]);
    free(s);
}

rx_status rx_store_groups(rx_store *s, int ngroups, rx_error *err)
{
    RX_TRY(RX_MAKE(s->group, (size_t)ngroups, err));
    s->ngroups = ngroups;
    return RX_OK;
}

rx_status rx_group_open(rx_store *s, int group, int nconditions, rx_error *err)
{
    rx_store_group *g = &s->group[group];
    const size_t n = (size_t)nconditions, findings = (size_t)g->nquantities * n * (size_t)s->ncolumns,
                 contests = (size_t)s->npairs * (size_t)s->nabouts * n;
    g->nconditions = nconditions;
    g->condition = rx_alloc(n, sizeof *g->condition);
    g->finding = RX_NEW(rx_finding, findings);
    g->contest = RX_NEW(rx_contest, contests);
    if (g->condition == NULL || g->finding == NULL || g->contest == NULL)
        return rx_error_memory(err, findings * sizeof *g->finding + contests * sizeof *g->contest);
    for (size_t i = 0; i < contests; i++)
        g->contest[i] = rx_contest_none();
    return RX_OK;
}

int rx_store_column(const rx_store *s, const char *name)
{
    for (int k = 0; k < s->ncolumns; k++)
        if (strcmp(s->column[k], name) == 0)
            return k;
    return -1;
}

int rx_store_pair(const rx_store *s, int first, int second)
{
    for (int i = 0; i < s->npairs; i++)
        if (s->pair[i][0] == first && s->pair[i][1] == second)
            return i;
    return -1;
}

void rx_store_add_pair(rx_store *s, int first, int second)
{
    if (first < 0 || second < 0 || first == second || rx_store_pair(s, first, second) >= 0 ||
        s->npairs == RX_PAIRS_MAX)
        return;
    s->pair[s->npairs][0] = first;
    s->pair[s->npairs++][1] = second;
}

rx_finding *rx_store_at(const rx_store *s, int group, int quantity, int condition, int column)
{
    const rx_store_group *g = &s->group[group];
    return &g->finding[((size_t)quantity * (size_t)g->nconditions + (size_t)condition) * (size_t)s->ncolumns +
                       (size_t)column];
}

rx_estimate rx_store_value(const rx_store *s, int group, const char *quantity, int condition, int column)
{
    for (int q = 0; q < s->group[group].nquantities && column >= 0; q++)
        if (strcmp(s->group[group].quantity[q].name, quantity) == 0)
            return rx_store_at(s, group, q, condition, column)->value;
    return (rx_estimate){NAN, NAN, NAN, 0};
}

rx_contest *rx_contest_of(const rx_store *s, int group, int pair, int about, int condition)
{
    const rx_store_group *g = &s->group[group];
    return &g->contest[((size_t)pair * (size_t)s->nabouts + (size_t)about) * (size_t)g->nconditions +
                       (size_t)condition];
}

/* --- contests --- */

rx_contest rx_contest_none(void)
{
    return (rx_contest){{NAN, NAN, NAN, NAN, NAN, {NAN, NAN, NAN, 0}}, NAN, NAN, NAN, 0};
}

rx_contest rx_contest_found(long only_first, long only_second)
{
    rx_contest c = rx_contest_none();
    c.only_first = (double)only_first;
    c.only_second = (double)only_second;
    c.test.p = rx_mcnemar(only_first, only_second);
    c.test.ln_p = log(c.test.p);
    return c;
}

int rx_has_spread(long n, const double *a, const double *b)
{
    for (long i = 1; i < n; i++)
        if (a[i] - b[i] != a[0] - b[0])
            return 1;
    return 0;
}

rx_status rx_contest_paired(long n, const double *a, const double *b, rx_contest *paired,
                            rx_contest *wilcoxon, rx_error *err)
{
    *paired = *wilcoxon = rx_contest_none();
    if (!rx_has_spread(n, a, b))
        return RX_OK;
    RX_TRY(rx_test_paired(n, a, b, &paired->test, err));
    RX_TRY(rx_test_wilcoxon(n, a, b, &wilcoxon->test, err));
    wilcoxon->test.difference = rx_contest_none().test.difference; /* the paired one is shown */
    return RX_OK;
}

/* The contests of one pair in one thing, n conditions. */
static rx_status decide(const rx_about *about, int n, rx_contest *contest, double *p, rx_error *err)
{
    int used = 0;
    for (int c = 0; c < n; c++)
        if (!isnan(contest[c].test.p))
            p[used++] = contest[c].test.p;
    if (used == 0 || !about->adjusted)
        return RX_OK;
    RX_TRY(rx_holm(used, p, p, err));
    used = 0;
    for (int c = 0; c < n; c++) {
        rx_contest *one = &contest[c];
        if (isnan(one->test.p))
            continue;
        one->holm = p[used++];
        const int more =
            isnan(one->only_first) ? one->test.difference.value > 0 : one->only_first > one->only_second;
        if (one->holm < SIGNIFICANT && about->winner != 0)
            one->winner = more == (about->winner > 0) ? 1 : -1;
    }
    return RX_OK;
}

/* Holm's p and winners of all contests; those without a p do not count. */
static rx_status decide_all(rx_store *s, rx_error *err)
{
    rx_status status = RX_OK;
    for (int g = 0; g < s->ngroups && status == RX_OK; g++) {
        const int n = s->group[g].nconditions;
        double *p = RX_NEW(double, (size_t)n);
        if (p == NULL)
            return rx_error_memory(err, (size_t)n * sizeof *p);
        for (int i = 0; i < s->npairs * s->nabouts && n > 0 && status == RX_OK; i++)
            status = decide(&s->about[i % s->nabouts], n,
                            rx_contest_of(s, g, i / s->nabouts, i % s->nabouts, 0), p, err);
        free(p);
    }
    return status;
}

rx_status rx_store_make(const rx_lab *lab, uint64_t seed, rx_store **dst, rx_error *err)
{
    rx_store *s = NULL;
    RX_TRY(RX_MAKE(s, 1, err));
    s->lab = lab;
    s->seed = seed;
    s->ncolumns = lab->nruns;
    for (int r = 0; r < lab->nruns; r++)
        s->column[r] = lab->run[r].name;
    rx_status status = lab->kind->results->measure(s, err);
    if (status == RX_OK)
        status = decide_all(s, err);
    if (status == RX_OK)
        *dst = s;
    else
        rx_store_free(s);
    return status;
}

/* The conditions with one outcome as ranges, and by how much; returns how many there are. */
static int say_outcome(const rx_store *s, const rx_contest_place *p, const rx_contest *contest, int winner,
                       const char *words, rx_text *said)
{
    const rx_store_group *g = &s->group[p->group];
    double least = INFINITY, most = 0;
    int n = 0;
    for (int c = 0, from = -1; c <= g->nconditions; c++) {
        const int is = c < g->nconditions && contest[c].winner == winner &&
                       (p->where == NULL || p->where(s, p->group, c, p->which));
        n += is;
        if (is && from < 0)
            rx_text_printf(said, "%s%s", n == 1 ? words : ", ", g->condition[from = c]);
        if (is && isfinite(contest[c].test.difference.value)) {
            least = fmin(least, fabs(contest[c].test.difference.value));
            most = fmax(most, fabs(contest[c].test.difference.value));
        }
        if (!is && from >= 0 && c > from + 1)
            rx_text_printf(said, " to %s", g->condition[c - 1]);
        from = is ? from : -1;
    }
    if (least <= most && winner != 0)
        rx_text_printf(said, " by %.2g", least);
    if (least < most && winner != 0)
        rx_text_printf(said, " to %.2g", most);
    return n;
}

int rx_contests_won(const rx_store *s, const rx_contest_place *place, int a, int b, int every, rx_text *said)
{
    const int turned = rx_store_pair(s, a, b) < 0,
              pair = turned ? rx_store_pair(s, b, a) : rx_store_pair(s, a, b);
    const int sign = turned ? -1 : 1;
    int won = -1;
    for (int g = 0; g < s->ngroups && pair >= 0; g++)
        for (int about = place->first; about <= place->last; about++) {
            const rx_contest *contest = rx_contest_of(s, g, pair, about, 0);
            rx_contest_place here = *place;
            rx_text outcome = {0};
            if ((place->group >= 0 && place->group != g) || s->about[about].winner == 0)
                continue;
            here.group = g;
            const int wins = say_outcome(s, &here, contest, sign, "; better at ", &outcome),
                      losses = say_outcome(s, &here, contest, -sign, "; worse at ", &outcome),
                      undecided = say_outcome(s, &here, contest, 0, "; undecided at ", &outcome);
            if (wins + losses + undecided > 0) {
                won = won != 0 && losses == 0 && (every ? undecided == 0 : wins > 0);
                rx_text_printf(said, "%s against %s, %s of %s: %s. ", s->column[a], s->column[b],
                               s->about[about].quantity, s->group[g].name,
                               outcome.data != NULL ? outcome.data + 2 : "");
            }
            said->failed |= outcome.failed;
            rx_text_free(&outcome);
        }
    return won;
}
