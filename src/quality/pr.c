/* Precision-recall curve. */
#include "quality/pr.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"
#include "quality/statistics.h"

/* One point for each group of equal score. */
static void fill_points(const rx_ranked *list, const unsigned char *is_matched, long n, long references,
                        rx_pr *dst)
{
    long matched = 0;
    double before = 0, ap = 0;
    for (long i = 0; i < n; i++) {
        matched += is_matched[list[i].index] != 0;
        if (i + 1 < n && list[i + 1].value == list[i].value)
            continue;
        rx_pr_point *p = &dst->point[dst->n++];
        *p = (rx_pr_point){.score = list[i].value, .detections = i + 1, .matched = matched};
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
    rx_ranked *list = NULL;
    rx_status status;
    RX_TRY_EXIT(RX_MAKE(list, (size_t)n, err));
    RX_TRY_EXIT(RX_MAKE(dst->point, (size_t)n, err));
    for (int i = 0; i < n; i++)
        list[i] = (rx_ranked){isnan(score[i]) ? -INFINITY : score[i], i};
    rx_rank_falling(list, (size_t)n);
    fill_points(list, matched, n, references, dst);
exit:
    free(list);
    return status;
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
