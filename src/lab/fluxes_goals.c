/* Whether the numbers of template photometry keep the limits of the goals. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "lab/fluxes_numbers.h"

/* Fewer objects decide nothing. */
enum { FEWEST = 20 };

/* --- one number --- */

typedef struct judging {
    rx_claim_verdict *verdict;
    double worst; /* how far beyond (or within: negative) its limit the worst number is */
    char where[256];
    rx_estimate value;
    int broken; /* numbers beyond a limit by more than their error */
} judging;

static void hold(judging *j, const rx_estimate *e, const char *where)
{
    const rx_claim *g = rx_claim_get(j->verdict->claim);
    if (e->n < FEWEST || !isfinite(e->value))
        return;
    const double beyond = fmax(e->value - g->high, g->low - e->value);
    j->verdict->all++;
    j->verdict->held += beyond <= 0;
    j->broken += e->low > g->high || e->high < g->low;
    if (j->verdict->all == 1 || beyond > j->worst) {
        j->worst = beyond;
        j->value = *e;
        snprintf(j->where, sizeof j->where, "%s", where);
    }
}

static void finish(judging *j)
{
    rx_claim_verdict *v = j->verdict;
    v->state = v->all == 0         ? RX_GOAL_NOT_MEASURED
               : v->held == v->all ? RX_GOAL_HELD
               : j->broken > 0     ? RX_GOAL_NOT_HELD
                                   : RX_GOAL_UNDECIDED;
    if (v->all > 0)
        rx_text_printf(&v->said, "%d of %d numbers held; the worst is %.4g [%.4g, %.4g] (%ld objects): %s",
                       v->held, v->all, j->value.value, j->value.low, j->value.high, j->value.n, j->where);
}

/* --- goals --- */

static const char *kind_name(int galaxy)
{
    return galaxy ? "galaxies" : "stars";
}

static void place_words(const rx_lab *r, const rx_fluxes_place *p, char *dst, size_t size)
{
    char condition[96];
    rx_lab_condition_name(r, p->condition, condition, sizeof condition);
    snprintf(dst, size, "%s of %s, %s, S/N %s", kind_name(p->galaxy), rx_scene_name(r->scene[p->scene].id),
             condition, rx_snr_bin_get(p->bin)->name);
}

/* The population on a tile whose restorers are given the truth. */
static int counts(const rx_lab *r, int condition, int scene)
{
    const rx_scene_id kind = r->scene[scene].id;
    return rx_condition_true(&r->sky[condition].condition) &&
           (kind == RX_SCENE_FIELD || kind == RX_SCENE_MIXED_PAIRS || kind == RX_SCENE_INJECTED);
}

/* One number of TEMPLATE's cell of every scene and seeing. */
static void judge_cells(const rx_fluxes_numbers *m, judging *j, rx_fluxes_place p, int kinds,
                        const rx_estimate *(*number)(const rx_fluxes_cell *))
{
    char where[160];
    p.run = j->verdict->run;
    p.flux = RX_FLUX_TEMPLATE;
    for (p.condition = 0; p.condition < m->lab->nconditions; p.condition++)
        for (p.scene = 0; p.scene < m->lab->nscenes; p.scene++)
            for (p.galaxy = 0; p.galaxy < kinds; p.galaxy++) {
                if (!counts(m->lab, p.condition, p.scene))
                    continue;
                place_words(m->lab, &p, where, sizeof where);
                hold(j, number(rx_fluxes_cell_of(m, &p)), where);
            }
}

static const rx_estimate *bias_of(const rx_fluxes_cell *cell)
{
    return &cell->bias;
}

static const rx_estimate *pull_of(const rx_fluxes_cell *cell)
{
    return &cell->pull;
}

static const rx_estimate *width_of(const rx_fluxes_cell *cell)
{
    return &cell->width;
}

static const rx_estimate *bound_of(const rx_fluxes_cell *cell)
{
    return &cell->bound;
}

/* e over a number that is taken as exact. */
static rx_estimate over(const rx_estimate *e, double other)
{
    return (rx_estimate){e->value / other, e->low / other, e->high / other, e->n};
}

/* Against the least of all other fluxes in the same bin, on the same stars. */
static void judge_magerr(const rx_fluxes_numbers *m, judging *j)
{
    const rx_lab *r = m->lab;
    char where[160], name[64];
    rx_fluxes_place p = {.sample = RX_SAMPLE_COMMON, .crowd = RX_CROWD_ISOLATED};
    for (p.condition = 0; p.condition < r->nconditions; p.condition++)
        for (p.scene = 0; p.scene < r->nscenes; p.scene++)
            for (p.bin = 0; p.bin < RX_SNR_SINGLE; p.bin++) {
                double best = HUGE_VAL;
                if (!counts(r, p.condition, p.scene))
                    continue;
                for (p.run = 0; p.run < r->nruns; p.run++)
                    for (int flux = 0; flux < RX_FLUX_TEMPLATE; flux++) {
                        p.flux = (rx_flux_kind)flux;
                        const double other = rx_fluxes_cell_of(m, &p)->magerr.value;
                        if (other < best) {
                            best = other;
                            snprintf(name, sizeof name, ", against %s %s", r->run[p.run].name,
                                     rx_flux_name(p.flux));
                        }
                    }
                p.run = j->verdict->run;
                p.flux = RX_FLUX_TEMPLATE;
                if (!isfinite(best))
                    continue;
                place_words(r, &p, where, sizeof where);
                const rx_estimate ratio = over(&rx_fluxes_cell_of(m, &p)->magerr, best);
                char both[sizeof where + sizeof name];
                snprintf(both, sizeof both, "%s%s", where, name);
                hold(j, &ratio, both);
            }
}

/* The lower median |error| of AUTO on NONE and on RL. */
static double best_auto(const rx_fluxes_numbers *m, rx_pair_place p)
{
    double best = HUGE_VAL;
    for (p.run = 0; p.run < m->lab->nruns; p.run++) {
        const rx_estimate *other = &rx_pair_cell_of(m, &p, RX_FLUX_AUTO)->size;
        const char *name = m->lab->run[p.run].name;
        const int rival = strcmp(name, "NONE") == 0 || strcmp(name, "RL") == 0;
        if (rival && other->n >= FEWEST)
            best = fmin(best, other->value);
    }
    return best;
}

static void judge_pairs(const rx_fluxes_numbers *m, judging *j)
{
    const rx_lab *r = m->lab;
    char where[160], condition[96];
    rx_pair_place p = {.sample = RX_SAMPLE_DETECTED, .run = j->verdict->run};
    for (p.condition = 0; p.condition < r->nconditions; p.condition++)
        for (p.scene = 0; p.scene < r->nscenes; p.scene++)
            for (p.bin = 0; p.bin < RX_PAIR_BINS; p.bin++) {
                const double best = best_auto(m, p);
                if (!counts(r, p.condition, p.scene) || !isfinite(best))
                    continue;
                rx_lab_condition_name(r, p.condition, condition, sizeof condition);
                snprintf(where, sizeof where, "%s, %g to %g FWHM", condition, RX_PAIR_EDGE[p.bin],
                         RX_PAIR_EDGE[p.bin + 1]);
                const rx_estimate ratio = over(&rx_pair_cell_of(m, &p, RX_FLUX_TEMPLATE)->size, best);
                hold(j, &ratio, where);
            }
}

static void judge(const void *numbers, rx_claim_verdict *verdict)
{
    const rx_fluxes_numbers *m = numbers;
    judging own = {.verdict = verdict}, *j = &own;
    rx_fluxes_place p = {.sample = RX_SAMPLE_ALL, .crowd = RX_CROWD_ISOLATED, .bin = RX_SNR_ABOVE_10};
    switch (verdict->claim) {
    case RX_GOAL_BIAS_BINS:
        for (p.bin = 1; p.bin < RX_SNR_SINGLE; p.bin++) /* the first one is below 10 */
            judge_cells(m, j, p, 2, bias_of);
        break;
    case RX_GOAL_PULL:
    case RX_GOAL_WIDTH:
        p.bin = RX_SNR_5_100;
        judge_cells(m, j, p, 1, verdict->claim == RX_GOAL_PULL ? pull_of : width_of);
        break;
    case RX_GOAL_BOUND:
        judge_cells(m, j, p, 1, bound_of);
        break;
    case RX_GOAL_MAGERR:
        judge_magerr(m, j);
        break;
    case RX_GOAL_PAIRS:
        judge_pairs(m, j);
        break;
    default: /* the biases of all from S/N 10 on */
        p.crowd = verdict->claim == RX_GOAL_BIAS_APART     ? RX_CROWD_APART
                  : verdict->claim == RX_GOAL_BIAS_BLENDED ? RX_CROWD_BLENDED
                                                           : RX_CROWD_ISOLATED;
        judge_cells(m, j, p, 2, bias_of);
    }
    finish(j);
}

void rx_fluxes_verdicts(const rx_fluxes_numbers *m, rx_claim_verdicts *verdicts)
{
    static const rx_claim_judge judges[] = {
        {RX_GOAL_BIAS_ISOLATED, judge}, {RX_GOAL_BIAS_BINS, judge}, {RX_GOAL_BIAS_APART, judge},
        {RX_GOAL_BIAS_BLENDED, judge},  {RX_GOAL_PULL, judge},      {RX_GOAL_WIDTH, judge},
        {RX_GOAL_BOUND, judge},         {RX_GOAL_MAGERR, judge},    {RX_GOAL_PAIRS, judge}};
    rx_claims_judge(sizeof judges / sizeof *judges, judges, m->lab->nruns, m, verdicts);
}
