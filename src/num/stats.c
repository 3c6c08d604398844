/* Selection instead of sorting: linear time on average, and no allocation. */
#include "num/stats.h"

#include <math.h>
#include <stdlib.h>

/* Reorder so that values[k] is the k-th smallest, smaller ones before it (Hoare 1961, CACM 4, 321;
 * pivot: median of three, so that sorted input costs no more than random input). */
static void select_kth(double *values, size_t n, size_t k)
{
    size_t low = 0, high = n - 1;
    while (low < high) {
        double a = values[low], b = values[low + (high - low) / 2], c = values[high];
        double pivot = a < b ? (b < c ? b : (a < c ? c : a)) : (a < c ? a : (b < c ? c : b));
        size_t i = low, j = high;
        for (;;) {
            while (values[i] < pivot)
                i++;
            while (pivot < values[j])
                j--;
            if (i >= j)
                break;
            double swap = values[i];
            values[i++] = values[j];
            values[j--] = swap;
        }
        /* now all before i are <= pivot and all after j are >= pivot */
        if (i == j) {
            if (k == i)
                return;
            if (k < i)
                high = i - 1;
            else
                low = i + 1;
        } else if (k <= j) {
            high = j;
        } else {
            low = i;
        }
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
    return 1.4826 * rx_median(values, n);
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
