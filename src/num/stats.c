/* Selection instead of sorting: linear time on average, and no allocation. */
#include "num/stats.h"

#include <math.h>

/* Reorder so that values[k] is the k-th smallest, smaller ones before it (Hoare 1961, CACM 4, 321;
 * pivot: median of three, so that sorted input costs no more than random input). */
#define DEFINE_SELECT(name, type)                                                                            \
    static void name(type *values, size_t n, size_t k)                                                       \
    {                                                                                                        \
        size_t low = 0, high = n - 1;                                                                        \
        while (low < high) {                                                                                 \
            type a = values[low], b = values[low + (high - low) / 2], c = values[high];                      \
            type pivot = a < b ? (b < c ? b : (a < c ? c : a)) : (a < c ? a : (b < c ? c : b));              \
            size_t i = low, j = high;                                                                        \
            for (;;) {                                                                                       \
                while (values[i] < pivot)                                                                    \
                    i++;                                                                                     \
                while (pivot < values[j])                                                                    \
                    j--;                                                                                     \
                if (i >= j)                                                                                  \
                    break;                                                                                   \
                type swap = values[i];                                                                       \
                values[i++] = values[j];                                                                     \
                values[j--] = swap;                                                                          \
            }                                                                                                \
            /* now all before i are <= pivot and all after j are >= pivot */                                 \
            if (i == j) {                                                                                    \
                if (k == i)                                                                                  \
                    return;                                                                                  \
                if (k < i)                                                                                   \
                    high = i - 1;                                                                            \
                else                                                                                         \
                    low = i + 1;                                                                             \
            } else if (k <= j) {                                                                             \
                high = j;                                                                                    \
            } else {                                                                                         \
                low = i;                                                                                     \
            }                                                                                                \
        }                                                                                                    \
    }

DEFINE_SELECT(select_float, float)
DEFINE_SELECT(select_double, double)

float rx_median_float(float *values, size_t n)
{
    if (n == 0)
        return NAN;
    size_t half = n / 2;
    select_float(values, n, half);
    if (n % 2 == 1)
        return values[half];
    float below = values[0];
    for (size_t i = 1; i < half; i++)
        below = values[i] > below ? values[i] : below;
    return 0.5F * below + 0.5F * values[half];
}

double rx_quantile(double *values, size_t n, double q)
{
    if (n == 0)
        return NAN;
    double position = fmin(fmax(q, 0.0), 1.0) * (double)(n - 1);
    size_t index = (size_t)position;
    double share = position - (double)index;
    select_double(values, n, index);
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

void rx_clipped_mean(const double *values, size_t n, double k, double *mean, double *sigma, size_t *kept)
{
    double m = NAN, s = NAN;
    size_t count = 0;
    for (int round = 0; round < 50; round++) {
        double low = round == 0 ? -HUGE_VAL : m - k * s, high = round == 0 ? HUGE_VAL : m + k * s;
        double sum = 0.0, squares = 0.0;
        size_t inside = 0;
        for (size_t i = 0; i < n; i++)
            if (values[i] >= low && values[i] <= high) {
                sum += values[i];
                inside++;
            }
        if (inside == 0 || (inside == count && sum / (double)inside == m))
            break;
        count = inside;
        m = sum / (double)inside;
        for (size_t i = 0; i < n; i++)
            if (values[i] >= low && values[i] <= high)
                squares += (values[i] - m) * (values[i] - m);
        s = sqrt(squares / (double)inside);
    }
    if (mean != NULL)
        *mean = m;
    if (sigma != NULL)
        *sigma = s;
    if (kept != NULL)
        *kept = count;
}
