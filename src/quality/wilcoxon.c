/* Wilcoxon's signed-rank test and the estimate that belongs to it. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/special.h"
#include "num/stats.h"
#include "quality/hypothesis.h"
#include "quality/sample.h"

enum { EXACT = 50, MOST_SUMS = EXACT * (EXACT + 1) / 2 + 1 };
static const double TAIL = 0.025, NORMAL_QUANTILE = 1.959963984540054;

/* How many of the 2^n sign patterns give each rank sum: each rank is in or out. Whole numbers below 2^53. */
static void sum_counts(long n, double counts[MOST_SUMS])
{
    memset(counts, 0, MOST_SUMS * sizeof *counts);
    counts[0] = 1;
    for (long rank = 1, last = 0; rank <= n; rank++) {
        last += rank;
        for (long sum = last; sum >= rank; sum--)
            counts[sum] += counts[sum - rank];
    }
}

static double exact_p(long n, double smaller)
{
    double counts[MOST_SUMS], below = 0;
    sum_counts(n, counts);
    for (long sum = 0; sum <= (long)smaller; sum++)
        below += counts[sum];
    return fmin(1, ldexp(below, 1 - (int)n));
}

/* Largest k such that k - 1 is exceeded with probability 1 - TAIL: the k-th order statistics of the means of
 * pairs end the interval; 0 = none. Above EXACT the normal approximation. */
static double interval_rank(long n)
{
    double pairs = 0.5 * (double)n * ((double)n + 1);
    if (n > EXACT) {
        double width = sqrt(pairs * (2 * (double)n + 1) / 12);
        return floor(0.5 * pairs - NORMAL_QUANTILE * width + 0.5);
    }
    double counts[MOST_SUMS], below = 0, limit = ldexp(TAIL, (int)n);
    long k = 0;
    sum_counts(n, counts);
    while ((below += counts[k]) <= limit)
        k++;
    return (double)k;
}

/* Doubles as integers of the same order, so that bisection ends at neighbours. */
static int64_t to_key(double value)
{
    int64_t bits;
    value = value == 0 ? 0 : value; /* one zero only */
    memcpy(&bits, &value, sizeof bits);
    return bits >= 0 ? bits : INT64_MIN - bits;
}

static double from_key(int64_t key)
{
    double value;
    key = key >= 0 ? key : INT64_MIN - key;
    memcpy(&value, &key, sizeof value);
    return value;
}

/* Pairs i <= j of sorted values with a mean up to `limit`. */
static double pairs_up_to(long n, const double *sorted, double limit)
{
    double count = 0;
    long j = n - 1;
    for (long i = 0; i < n; i++) {
        while (j >= 0 && 0.5 * sorted[i] + 0.5 * sorted[j] > limit)
            j--;
        if (j < i)
            break;
        count += (double)(j - i + 1);
    }
    return count;
}

/* The `rank`-th smallest (from 1) mean of pairs, without forming n^2 of them. */
static double pair_mean(long n, const double *sorted, double rank)
{
    int64_t low = to_key(sorted[0]), high = to_key(sorted[n - 1]);
    while (low < high) {
        int64_t middle = (int64_t)((uint64_t)low + ((uint64_t)high - (uint64_t)low) / 2);
        if (pairs_up_to(n, sorted, from_key(middle)) >= rank)
            high = middle;
        else
            low = middle + 1;
    }
    return from_key(low);
}

static rx_estimate hodges_lehmann(long n, const double *sorted)
{
    double pairs = 0.5 * (double)n * ((double)n + 1), k = interval_rank(n);
    double below = floor(0.5 * (pairs + 1)), above = ceil(0.5 * (pairs + 1));
    rx_estimate e = {.low = -INFINITY, .high = INFINITY, .n = n};
    e.value = 0.5 * pair_mean(n, sorted, below) + 0.5 * pair_mean(n, sorted, above);
    if (k >= 1) {
        e.low = pair_mean(n, sorted, k);
        e.high = pair_mean(n, sorted, pairs + 1 - k);
    }
    return e;
}

typedef struct ranks {
    long n;                    /* differences that are not zero */
    double positive, negative; /* sums of ranks */
    double ties;               /* sum of t^3 - t over groups of t equal ones */
} ranks;

static int by_size(const void *left, const void *right)
{
    double l = fabs(*(const double *)left), r = fabs(*(const double *)right);
    return (l > r) - (l < r);
}

/* Ranks of |difference|, equal ones share the mean of theirs. Reorders. */
static ranks rank_signs(long n, double *difference)
{
    ranks r = {0};
    qsort(difference, (size_t)n, sizeof *difference, by_size);
    long zeros = 0;
    while (zeros < n && difference[zeros] == 0)
        zeros++;
    r.n = n - zeros;
    for (long i = zeros, next; i < n; i = next) {
        for (next = i + 1; next < n && fabs(difference[next]) == fabs(difference[i]); next++)
            ;
        double rank = 0.5 * (double)(i - zeros + 1 + next - zeros), t = (double)(next - i);
        r.ties += t * t * t - t;
        for (long k = i; k < next; k++)
            *(difference[k] > 0 ? &r.positive : &r.negative) += rank;
    }
    return r;
}

static void judge(const ranks *r, rx_test *dst)
{
    double n = (double)r->n, all = 0.5 * n * (n + 1);
    dst->dof = n;
    dst->statistic = fmin(r->positive, r->negative);
    dst->effect = r->n > 0 ? (r->positive - r->negative) / all : 0;
    dst->p = 1;
    if (r->n == 0)
        return;
    if (r->n <= EXACT && r->ties == 0) {
        dst->p = exact_p(r->n, dst->statistic);
        dst->ln_p = log(dst->p);
        return;
    }
    double width = sqrt(all * (2 * n + 1) / 12 - r->ties / 48);
    double away = dst->statistic - 0.5 * all;
    double z = (away < 0 ? away + 0.5 : away) / width;
    dst->ln_p = rx_normal_log_p(z);
    dst->p = exp(dst->ln_p);
}

rx_status rx_test_wilcoxon(long n, const double *a, const double *b, rx_test *dst, rx_error *err)
{
    double *difference;
    RX_TRY(rx_sample_difference(n, a, b, 1, &difference, err));
    *dst = (rx_test){0};
    rx_sort(difference, (size_t)n);
    dst->difference = hodges_lehmann(n, difference);
    ranks r = rank_signs(n, difference);
    judge(&r, dst);
    free(difference);
    return RX_OK;
}
