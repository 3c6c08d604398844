/* Bootstrap intervals. */
#include "quality/bootstrap.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/random.h"
#include "num/stats.h"

/* TOGETHER: replicates between two looks at interrupts; BLOCKS: of random numbers made at a time. */
enum { TOGETHER = 128, BLOCKS = 64 };

void rx_bootstrap_counts(uint64_t seed, uint64_t stream, int round, long n, uint32_t *counts)
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
    uint32_t *counts = RX_NEW(uint32_t, (size_t)n * (size_t)threads);
    if (counts == NULL)
        return rx_error_memory(err, (size_t)n * (size_t)threads * sizeof *counts);
    for (int begin = 0; begin < RX_BOOTSTRAP_ROUNDS; begin += TOGETHER) {
        const int end = begin + TOGETHER < RX_BOOTSTRAP_ROUNDS ? begin + TOGETHER : RX_BOOTSTRAP_ROUNDS;
        if ((status = rx_interrupt_check(err)) != RX_OK)
            goto exit;
#pragma omp parallel for schedule(static) num_threads(threads)
        for (int round = begin; round < end; round++) {
            uint32_t *own = counts + (size_t)omp_get_thread_num() * (size_t)n;
            rx_bootstrap_counts(by.seed, by.stream, round, n, own);
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
