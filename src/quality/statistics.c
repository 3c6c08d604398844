/* Statistics of samples and counts. */
#include "quality/statistics.h"

#include <float.h>
#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/interrupt.h"
#include "base/memory.h"
#include "base/random.h"
#include "num/special.h"
#include "num/stats.h"

/* --- counts --- */

rx_estimate rx_binomial_interval(long k, long n, double level)
{
    double tail = 0.5 * (1 - level);
    rx_estimate out = {.value = NAN, .low = 0, .high = 1, .n = n};
    if (n <= 0)
        return out;
    out.value = (double)k / (double)n;
    if (k > 0)
        out.low = rx_beta_inverse((double)k, (double)(n - k) + 1, tail);
    if (k < n)
        out.high = rx_beta_inverse((double)k + 1, (double)(n - k), 1 - tail);
    return out;
}

/* P(N >= k) of a Poisson mean is P(k, mean), P(N <= k) is Q(k + 1, mean): num/special.h. */
rx_estimate rx_poisson_rate(long count, double extent, double level)
{
    const double tail = 0.5 * (1 - level);
    if (count < 0 || !(level > 0 && level < 1))
        return (rx_estimate){NAN, NAN, NAN, count};
    return (rx_estimate){.value = (double)count / extent,
                         .low = count > 0 ? rx_gamma_p_inverse((double)count, tail) / extent : 0,
                         .high = rx_gamma_q_inverse((double)count + 1, tail) / extent,
                         .n = count};
}

double rx_poisson_upper(long count, double extent, double level)
{
    return count >= 0 ? rx_gamma_q_inverse((double)count + 1, 1 - level) / extent : NAN;
}

/* --- order statistics --- */

/* Rank r >= 1 such that the r-th smallest and the r-th largest of n values enclose the median of their
 * distribution with probability >= level; 0 when n is too small for that (below 6 at 0.95). */
static long median_rank(long n, double level)
{
    double tail = 0.5 * (1 - level);
    /* P(X <= rank - 1) <= tail of X ~ Binomial(n, 1/2) holds at low, not beyond high */
    long low = 0, high = (n + 1) / 2;
    while (low < high) {
        long middle = low + (high - low + 1) / 2;
        if (rx_beta_inc((double)(n - middle + 1), (double)middle, 0.5) <= tail)
            low = middle;
        else
            high = middle - 1;
    }
    return low;
}

void rx_robust_estimates(double *values, long n, double level, rx_estimate *median, rx_estimate *sigma)
{
    long rank = median_rank(n, level);
    *median = (rx_estimate){NAN, -INFINITY, INFINITY, n};
    *sigma = (rx_estimate){NAN, 0, INFINITY, n};
    if (n == 0)
        return;
    for (int pass = 0; pass < 2; pass++) {
        rx_estimate *dst = pass == 0 ? median : sigma;
        double scale = pass == 0 ? 1 : RX_MAD_SIGMA;
        rx_sort(values, (size_t)n);
        dst->value = scale * 0.5 * (values[(n - 1) / 2] + values[n / 2]);
        if (rank > 0) {
            dst->low = scale * values[rank - 1];
            dst->high = scale * values[n - rank];
        }
        for (long i = 0; i < n && pass == 0; i++)
            values[i] = fabs(values[i] - median->value);
    }
}

/* --- means, box plots --- */

/* Mean and the sum of squared deviations from it. Two passes, the second also mends the mean. */
static double moments_of(long n, const double *values, double *squares)
{
    double sum = 0, rest = 0, largest = 0;
    *squares = 0;
    for (long i = 0; i < n; i++) {
        sum += values[i] - values[0];
        largest = fmax(largest, fabs(values[i]));
    }
    double mean = values[0] + sum / (double)n;
    for (long i = 0; i < n; i++) {
        const double d = values[i] - mean;
        rest += d;
        *squares += d * d;
    }
    mean += rest / (double)n;
    *squares = fmax(*squares - rest * rest / (double)n, 0);
    const double rounding = 4 * DBL_EPSILON * largest;
    if (*squares <= (double)n * rounding * rounding)
        *squares = 0;
    return mean;
}

rx_estimate rx_mean_estimate(long n, const double *values, double level)
{
    if (n < 1)
        return (rx_estimate){NAN, NAN, NAN, 0};
    double squares;
    const double count = (double)n, mean = moments_of(n, values, &squares);
    const double reach =
        n > 1 ? rx_student_quantile(1 - level, count - 1) * sqrt(squares / (count - 1) / count) : NAN;
    return (rx_estimate){mean, mean - reach, mean + reach, n};
}

rx_status rx_five_numbers_of(long n, const double *values, rx_five_numbers *dst, rx_error *err)
{
    double squares, *sorted;
    if (n < 1)
        return rx_error_set(err, RX_USAGE, "a sample without values");
    RX_TRY(RX_MAKE(sorted, (size_t)n, err));
    memcpy(sorted, values, (size_t)n * sizeof *sorted);
    rx_sort(sorted, (size_t)n);
    *dst = (rx_five_numbers){.n = n, .mean = moments_of(n, sorted, &squares)};
    dst->q1 = rx_quantile(sorted, (size_t)n, 0.25); /* sorted input stays sorted */
    dst->median = rx_quantile(sorted, (size_t)n, 0.5);
    dst->q3 = rx_quantile(sorted, (size_t)n, 0.75);
    const double reach = 1.5 * (dst->q3 - dst->q1);
    dst->low = dst->q1; /* a quartile between two values may have none within its reach */
    dst->high = dst->q3;
    for (long i = 0; i < n; i++) {
        if (sorted[i] < dst->q1 - reach || sorted[i] > dst->q3 + reach)
            continue;
        dst->low = fmin(dst->low, sorted[i]);
        dst->high = fmax(dst->high, sorted[i]);
    }
    free(sorted);
    return RX_OK;
}

/* --- bootstrap --- */

/* TOGETHER: replicates between two looks at interrupts; BLOCKS: of random numbers made at a time. */
enum { TOGETHER = 128, BLOCKS = 64 };

/* How often each of n units is drawn in replicate `round`: counts[n], sum n. */
static void draw_counts(uint64_t seed, uint64_t stream, int round, long n, uint32_t *counts)
{
    uint32_t word[4 * BLOCKS];
    const uint64_t begin = (uint64_t)round << 32; /* blocks of one replicate: n/4 < 2^32 */
    memset(counts, 0, (size_t)n * sizeof *counts);
    for (long done = 0; done < n; done += 4 * BLOCKS) {
        const long left = n - done, blocks = left < 4 * BLOCKS ? (left + 3) / 4 : BLOCKS;
        rx_random_blocks(seed, stream, begin + (uint64_t)(done / 4), (size_t)blocks, word);
        for (long k = 0; k < 4; k++)
            for (long i = 0; 4 * i + k < left && i < blocks; i++)
                counts[((uint64_t)word[k * blocks + i] * (uint64_t)n) >> 32]++;
    }
}

rx_status rx_bootstrap_interval(rx_resampling by, long n, rx_statistic statistic, const void *data,
                                double level, rx_estimate *estimate, rx_error *err)
{
    const int threads = by.nthreads < 1 ? 1 : by.nthreads;
    rx_status status = RX_OK;
    double replicate[RX_BOOTSTRAP_ROUNDS];
    uint32_t *counts;
    RX_TRY(RX_MAKE(counts, (size_t)n * (size_t)threads, err));
    for (int begin = 0; begin < RX_BOOTSTRAP_ROUNDS; begin += TOGETHER) {
        const int end = begin + TOGETHER < RX_BOOTSTRAP_ROUNDS ? begin + TOGETHER : RX_BOOTSTRAP_ROUNDS;
        RX_TRY_EXIT(rx_interrupt_check(err));
#pragma omp parallel for schedule(static) num_threads(threads)
        for (int round = begin; round < end; round++) {
            uint32_t *own = counts + (size_t)omp_get_thread_num() * (size_t)n;
            draw_counts(by.seed, by.stream, round, n, own);
            replicate[round] = statistic(data, own);
        }
    }
    rx_sort(replicate, RX_BOOTSTRAP_ROUNDS);
    /* outward to the nearest replicate: infinite ones must not be averaged */
    double tail = 0.5 * (1 - level) * RX_BOOTSTRAP_ROUNDS;
    int cut = tail < 0 ? 0 : (int)floor(tail);
    estimate->low = replicate[cut];
    estimate->high = replicate[RX_BOOTSTRAP_ROUNDS - 1 - cut];
exit:
    free(counts);
    return status;
}
