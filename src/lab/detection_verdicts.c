/* What the numbers of a detection campaign say about this program's goals. */
#include <math.h>

#include "lab/detection_numbers.h"

/* Where restorers are given the truth. */
static int counts(const rx_detection_numbers *m, int condition, int scene, rx_scene_id kind)
{
    return rx_condition_true(&m->lab->sky[condition].condition) && m->lab->scene[scene].id == kind;
}

static const rx_estimate *value(const rx_detection_numbers *m, int condition, int scene, int column, int q)
{
    return &rx_detection_cell_of(m, condition, scene, column)->value[q];
}

static int is_absent(const rx_detection_numbers *m, rx_claim_verdict *v)
{
    if (m->net < 0)
        rx_text_add(&v->said, "NET did not take part. ");
    return m->net < 0;
}

/* ap and the recall at the first precision of both lists, against one rival. */
static int above(const rx_detection_numbers *m, int rival, rx_claim_verdict *v)
{
    const rx_lab *r = m->lab;
    static const char *const names[] = {"ap", "recall"};
    int wins = 0, all = 0, sure = 0, fights = 0;
    rx_text lost = {0};
    for (int c = 0; c < r->nconditions; c++)
        for (int s = 0; s < r->nscenes; s++) {
            if (!counts(m, c, s, RX_SCENE_STARS) && !counts(m, c, s, RX_SCENE_GALAXIES))
                continue;
            for (int q = 0; q < 1 + (r->nprecisions > 0); q++) {
                const double own = value(m, c, s, m->net, q)->value;
                const double other = value(m, c, s, m->rival[rival], q)->value;
                all++;
                wins += own > other;
                if (!(own > other))
                    rx_text_printf(&lost, "%s%s of %s at FWHM %g (%.3f against %.3f)",
                                   lost.length > 0 ? ", " : "", names[q], rx_scene_name(r->scene[s].id),
                                   r->sky[c].fwhm, own, other);
            }
            const rx_detection_duel *duel = rx_detection_duel_of(m, c, s, rival);
            fights++;
            sure += duel->only_first > duel->only_second && duel->p < 0.05;
        }
    rx_text_printf(&v->said,
                   "NET against %s: above in %d of %d numbers; more objects found, McNemar's p below "
                   "0.05, in %d of %d lists",
                   rx_detection_column_name(m, m->rival[rival]), wins, all, sure, fights);
    if (lost.length > 0)
        rx_text_printf(&v->said, "; not above: %s", lost.data);
    rx_text_add(&v->said, ". ");
    v->said.failed |= lost.failed;
    rx_text_free(&lost);
    return all > 0 ? wins == all : -1;
}

static void judge_lists(const void *numbers, rx_claim_verdict *v)
{
    const rx_detection_numbers *m = numbers;
    if (is_absent(m, v))
        return;
    int holds = 1, judged = 0;
    for (int k = 0; k < m->nrivals; k++) {
        const int one = above(m, k, v);
        judged |= one >= 0;
        holds = holds && one != 0;
    }
    if (judged)
        v->state = holds ? RX_REPRODUCED : RX_NOT_REPRODUCED;
}

static void judge_pairs(const void *numbers, rx_claim_verdict *v)
{
    const rx_detection_numbers *m = numbers;
    if (is_absent(m, v))
        return;
    const int rival = m->matched >= 0 ? m->matched : m->none;
    int holds = 1, judged = 0;
    for (int c = 0; c < m->lab->nconditions && rival >= 0; c++)
        for (int s = 0; s < m->lab->nscenes; s++) {
            if (!counts(m, c, s, RX_SCENE_PAIRS))
                continue;
            /* the better one of the unrestored images */
            const double own = value(m, c, s, m->net, 0)->value;
            const double other =
                fmax(value(m, c, s, rival, 0)->value, m->none >= 0 ? value(m, c, s, m->none, 0)->value : 0);
            judged = 1;
            holds = holds && own > 0 && own >= 2 * other;
            rx_text_printf(&v->said, "FWHM %g: %.3f against %.3f. ", m->lab->sky[c].fwhm, own, other);
        }
    if (judged)
        v->state = holds ? RX_REPRODUCED : RX_NOT_REPRODUCED;
}

static void judge_plateau(const void *numbers, rx_claim_verdict *v)
{
    const rx_detection_numbers *m = numbers;
    if (is_absent(m, v))
        return;
    const double limit = 0.01;
    int holds = 1, judged = 0;
    for (int c = 0; c < m->lab->nconditions; c++)
        for (int s = 0; s < m->lab->nscenes; s++) {
            if (!counts(m, c, s, RX_SCENE_PLATEAU))
                continue;
            const double two = value(m, c, s, m->net, 0)->value, four = value(m, c, s, m->net, 1)->value;
            judged = 1;
            holds = holds && two < limit && four < limit;
            rx_text_printf(&v->said, "FWHM %g: %.2g (2 x 2), %.2g (4 x 4). ", m->lab->sky[c].fwhm, two, four);
        }
    if (judged)
        v->state = holds ? RX_REPRODUCED : RX_NOT_REPRODUCED;
}

void rx_detection_verdicts(const rx_detection_numbers *m, rx_claim_verdicts *verdicts)
{
    static const rx_claim_judge judges[] = {
        {RX_CLAIM_LISTS, judge_lists}, {RX_CLAIM_PAIRS, judge_pairs}, {RX_CLAIM_PLATEAU, judge_plateau}};
    rx_claims_judge(sizeof judges / sizeof *judges, judges, 0, m, verdicts);
}
