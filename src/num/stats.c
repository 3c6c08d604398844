/* Selection instead of sorting: linear time on average, and no allocation. */
#include "num/stats.h"
#include "base/constants.h"

#include <math.h>
#include <stdlib.h>

enum { SAMPLE = 64 };

/* Those of values[low .. end - 1] below the pivot, or (`same`) that are it, to the front; where the others begin. Without a branch that
 * cannot be foreseen: every value changes places. */
static size_t partition(double *values, size_t low, size_t end, double pivot, int same)
{
    size_t front = low;
    for (size_t i = low; i < end; i++) {
        const double value = values[i];
        values[i] = values[front];
        values[front] = value;
        front += (size_t)(same ? value <= pivot : value < pivot);
    }
    return front;
}

/* Reorder so that values[k] is the k-th smallest, smaller ones before it (Hoare 1961, CACM 4, 321; pivot: of an even sample
 * the value of the same rank, so that two passes leave few; of few the median of three). */
static void select_kth(double *values, size_t n, size_t k)
{
    size_t low = 0, end = n;
    while (end - low > 1) {
        const double a = values[low], b = values[low + (end - low) / 2], c = values[end - 1];
        double pivot = a < b ? (b < c ? b : (a < c ? c : a)) : (a < c ? a : (b < c ? c : b)), sample[SAMPLE];
        if (end - low > 8 * SAMPLE) {
            const size_t rank = (k - low) * SAMPLE / (end - low);
            for (size_t i = 0; i < SAMPLE; i++)
                sample[i] = values[low + (end - low) / SAMPLE * i];
            select_kth(sample, SAMPLE, rank);
            pivot = sample[rank];
        }
        const size_t less = partition(values, low, end, pivot, 0);
        if (k < less) {
            end = less;
            continue;
        }
        low = partition(values, less, end, pivot, 1);
        if (k < low || low == less) /* or NAN */
            return;
    }
}

double rx_quantile(double *values, size_t n, double q)
{
    if (n == 0)
        return NAN;
    double position = fmin(fmax(q, 0.0), 1.0) * (double)(n - 1);
    size_t index = (size_t)position;
    double share = position - (double)index;
    select_kth(values, n, index);
    if (share <= 0.0 || index + 1 >= n)
        return values[index];
    double above = values[index + 1];
    for (size_t i = index + 2; i < n; i++)
        above = values[i] < above ? values[i] : above;
    return values[index] + share * (above - values[index]);
}

double rx_median(double *values, size_t n)
{
    return rx_quantile(values, n, 0.5);
}

double rx_sigma_mad(double *values, size_t n, double *median)
{
    double middle = rx_median(values, n);
    if (median != NULL)
        *median = middle;
    for (size_t i = 0; i < n; i++)
        values[i] = fabs(values[i] - middle);
    return RX_MAD_SIGMA * rx_median(values, n);
}

static int by_value(const void *left, const void *right)
{
    double l = *(const double *)left, r = *(const double *)right;
    return (l > r) - (l < r);
}

void rx_sort(double *values, size_t n)
{
    if (n > 1)
        qsort(values, n, sizeof *values, by_value);
}

static int rising(const void *left, const void *right)
{
    const rx_ranked *a = left, *b = right;
    return a->value != b->value ? (a->value > b->value) - (a->value < b->value)
                                : (a->index > b->index) - (a->index < b->index);
}

static int falling(const void *left, const void *right)
{
    const rx_ranked *a = left, *b = right;
    return a->value != b->value ? (a->value < b->value) - (a->value > b->value)
                                : (a->index > b->index) - (a->index < b->index);
}

void rx_rank(rx_ranked *list, size_t n)
{
    if (n > 1)
        qsort(list, n, sizeof *list, rising);
}

void rx_rank_falling(rx_ranked *list, size_t n)
{
    if (n > 1)
        qsort(list, n, sizeof *list, falling);
}
