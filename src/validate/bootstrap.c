/* Bootstrap intervals. */
#include "validate/bootstrap.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/random.h"
#include "num/stats.h"

void rx_bootstrap_counts(uint64_t seed, uint64_t stream, int round, long n, uint32_t *counts)
{
    uint32_t word[4];
    uint64_t begin = (uint64_t)round << 32; /* blocks of one replicate: n/4 < 2^32 */
    memset(counts, 0, (size_t)n * sizeof *counts);
    for (long i = 0; i < n; i++) {
        if (i % 4 == 0)
            rx_random_block(seed, stream, begin + (uint64_t)(i / 4), word);
        counts[((uint64_t)word[i % 4] * (uint64_t)n) >> 32]++;
    }
}

rx_status rx_bootstrap_interval(uint64_t seed, uint64_t stream, long n, rx_statistic statistic,
                                const void *data, double level, rx_estimate *estimate, rx_error *err)
{
    rx_status status = RX_OK;
    double replicate[RX_BOOTSTRAP_ROUNDS];
    uint32_t *counts = RX_NEW(uint32_t, (size_t)n);
    if (counts == NULL)
        return rx_error_memory(err, (size_t)n * sizeof *counts);
    for (int round = 0; round < RX_BOOTSTRAP_ROUNDS; round++) {
        if (round % 64 == 0 && (status = rx_interrupt_check(err)) != RX_OK)
            goto exit;
        rx_bootstrap_counts(seed, stream, round, n, counts);
        replicate[round] = statistic(data, counts);
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
