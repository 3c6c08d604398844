/* Precision-recall curve. */
#include "quality/pr.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "quality/statistics.h"

typedef struct ranked {
    double score;
    int matched;
} ranked;

static int by_falling_score(const void *left, const void *right)
{
    double l = ((const ranked *)left)->score, r = ((const ranked *)right)->score;
    return (l < r) - (l > r);
}

/* One point for each group of equal score. */
static void fill_points(const ranked *list, long n, long references, rx_pr *dst)
{
    long matched = 0;
    double before = 0, ap = 0;
    for (long i = 0; i < n; i++) {
        matched += list[i].matched;
        if (i + 1 < n && list[i + 1].score == list[i].score)
            continue;
        rx_pr_point *p = &dst->point[dst->n++];
        *p = (rx_pr_point){.score = list[i].score, .detections = i + 1, .matched = matched};
        p->precision = (double)matched / (double)(i + 1);
        p->recall = references > 0 ? (double)matched / (double)references : NAN;
        ap += (p->recall - before) * p->precision;
        before = p->recall;
    }
    dst->ap = (rx_estimate){references > 0 ? ap : NAN, NAN, NAN, references};
}

rx_status rx_pr_make(long n, const double *score, const unsigned char *matched, long references, rx_pr *dst,
                     rx_error *err)
{
    *dst = (rx_pr){0};
    ranked *list = RX_NEW(ranked, (size_t)n);
    dst->point = RX_NEW(rx_pr_point, (size_t)n);
    if (list == NULL || dst->point == NULL) {
        free(list);
        rx_pr_free(dst);
        return rx_error_memory(err, (size_t)n * sizeof *list);
    }
    for (long i = 0; i < n; i++)
        list[i] = (ranked){isnan(score[i]) ? -INFINITY : score[i], matched[i] != 0};
    qsort(list, (size_t)n, sizeof *list, by_falling_score);
    fill_points(list, n, references, dst);
    free(list);
    return RX_OK;
}

void rx_pr_free(rx_pr *pr)
{
    free(pr->point);
    *pr = (rx_pr){0};
}

/* Units of the bootstrap: matched and false detections point by point, then the missed references. */
typedef struct ap_data {
    const rx_pr *pr;
    long detections, missed;
} ap_data;

static double resampled_ap(const void *data, const uint32_t *counts)
{
    const ap_data *in = data;
    double missed = 0, matched = 0, all = 0, sum = 0;
    for (long i = 0; i < in->missed; i++)
        missed += counts[in->detections + i];
    long unit = 0, hits = 0;
    for (long k = 0; k < in->pr->n; k++) {
        const rx_pr_point *p = &in->pr->point[k];
        double before = matched;
        for (long end = unit + (p->matched - hits); unit < end; unit++) {
            matched += counts[unit];
            all += counts[unit];
        }
        hits = p->matched;
        for (; unit < p->detections; unit++)
            all += counts[unit];
        if (all > 0)
            sum += (matched - before) * matched / all;
    }
    return matched + missed > 0 ? sum / (matched + missed) : 0;
}

rx_status rx_pr_interval(const rx_pr *pr, long references, double level, rx_resampling by, rx_estimate *dst,
                         rx_error *err)
{
    ap_data data = {.pr = pr};
    long matched = pr->n > 0 ? pr->point[pr->n - 1].matched : 0;
    data.detections = pr->n > 0 ? pr->point[pr->n - 1].detections : 0;
    data.missed = references - matched;
    *dst = pr->ap;
    dst->low = 0;
    dst->high = 1;
    if (references < RX_BOOTSTRAP_FEWEST)
        return RX_OK;
    by.stream = 1;
    return rx_bootstrap_interval(by, data.detections + data.missed, resampled_ap, &data, level, dst, err);
}
