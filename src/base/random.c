/* Philox4x32-10; constants from the article named in random.h. */
#include "base/random.h"

#include <math.h>

#include "base/simd.h"

/* One block; in a loop over blocks the compiler makes vectors of them. */
static inline void philox(uint64_t seed, uint64_t stream, uint64_t counter, uint32_t *w0, uint32_t *w1,
                          uint32_t *w2, uint32_t *w3)
{
    uint32_t key0 = (uint32_t)seed, key1 = (uint32_t)(seed >> 32);
    uint32_t a = (uint32_t)counter, b = (uint32_t)(counter >> 32);
    uint32_t c = (uint32_t)stream, d = (uint32_t)(stream >> 32);
    for (int round = 0; round < 10; round++) {
        uint64_t p0 = (uint64_t)0xD2511F53u * a, p1 = (uint64_t)0xCD9E8D57u * c;
        a = (uint32_t)(p1 >> 32) ^ b ^ key0;
        b = (uint32_t)p1;
        c = (uint32_t)(p0 >> 32) ^ d ^ key1;
        d = (uint32_t)p0;
        key0 += 0x9E3779B9u;
        key1 += 0xBB67AE85u;
    }
    *w0 = a;
    *w1 = b;
    *w2 = c;
    *w3 = d;
}

void rx_random_block(uint64_t seed, uint64_t stream, uint64_t counter, uint32_t out[4])
{
    philox(seed, stream, counter, out, out + 1, out + 2, out + 3);
}

RX_SIMD static void make_blocks(uint64_t seed, uint64_t stream, uint64_t first, size_t n, uint32_t *out)
{
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        philox(seed, stream, first + i, out + i, out + n + i, out + 2 * n + i, out + 3 * n + i);
}

void rx_random_blocks(uint64_t seed, uint64_t stream, uint64_t first, size_t n, uint32_t *out)
{
    make_blocks(seed, stream, first, n, out);
}

static double uniform52(uint32_t high, uint32_t low)
{
    uint64_t bits = ((uint64_t)high << 32 | low) >> 12; /* 52 bits: with the half added, still exact */
    return ((double)bits + 0.5) * 0x1p-52;
}

void rx_random_two(uint64_t seed, uint64_t stream, uint64_t counter, double dst[2])
{
    uint32_t words[4];
    rx_random_block(seed, stream, counter, words);
    dst[0] = uniform52(words[0], words[1]);
    dst[1] = uniform52(words[2], words[3]);
}

double rx_random_uniform(uint64_t seed, uint64_t stream, uint64_t counter)
{
    double both[2];
    rx_random_two(seed, stream, counter, both);
    return both[0];
}

double rx_random_between(rx_random_stream from, uint64_t slot, double low, double high)
{
    return low + (high - low) * rx_random_uniform(from.seed, from.stream, slot);
}

double rx_random_log_between(rx_random_stream from, uint64_t slot, double low, double high)
{
    if (!(low > 0.0))
        return rx_random_between(from, slot, low, high);
    return exp(rx_random_between(from, slot, log(low), log(high)));
}

double rx_random_normal(uint64_t seed, uint64_t stream, uint64_t counter)
{
    double both[2];
    rx_random_two(seed, stream, counter, both);
    return sqrt(-2.0 * log(both[0])) * cos(2.0 * M_PI * both[1]);
}
