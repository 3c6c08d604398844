/* Philox4x32-10; constants from the article named in random.h. */
#include "base/random.h"

#include <math.h>

void rx_random_block(uint64_t seed, uint64_t stream, uint64_t counter, uint32_t out[4])
{
    uint32_t key[2] = {(uint32_t)seed, (uint32_t)(seed >> 32)};
    uint32_t c[4] = {(uint32_t)counter, (uint32_t)(counter >> 32), (uint32_t)stream,
                     (uint32_t)(stream >> 32)};
    for (int round = 0; round < 10; round++) {
        uint64_t p0 = (uint64_t)0xD2511F53u * c[0];
        uint64_t p1 = (uint64_t)0xCD9E8D57u * c[2];
        uint32_t next[4] = {(uint32_t)(p1 >> 32) ^ c[1] ^ key[0], (uint32_t)p1,
                            (uint32_t)(p0 >> 32) ^ c[3] ^ key[1], (uint32_t)p0};
        for (int i = 0; i < 4; i++)
            c[i] = next[i];
        key[0] += 0x9E3779B9u;
        key[1] += 0xBB67AE85u;
    }
    for (int i = 0; i < 4; i++)
        out[i] = c[i];
}

/* As above, written such that the compiler makes vectors of blocks. */
void rx_random_blocks(uint64_t seed, uint64_t stream, uint64_t first, size_t n, uint32_t *out)
{
    uint32_t *c0 = out, *c1 = out + n, *c2 = out + 2 * n, *c3 = out + 3 * n;
    const uint32_t low = (uint32_t)stream, high = (uint32_t)(stream >> 32);
#pragma omp simd
    for (size_t i = 0; i < n; i++) {
        uint64_t counter = first + i;
        uint32_t key0 = (uint32_t)seed, key1 = (uint32_t)(seed >> 32);
        uint32_t a = (uint32_t)counter, b = (uint32_t)(counter >> 32), c = low, d = high;
        for (int round = 0; round < 10; round++) {
            uint64_t p0 = (uint64_t)0xD2511F53u * a, p1 = (uint64_t)0xCD9E8D57u * c;
            a = (uint32_t)(p1 >> 32) ^ b ^ key0;
            b = (uint32_t)p1;
            c = (uint32_t)(p0 >> 32) ^ d ^ key1;
            d = (uint32_t)p0;
            key0 += 0x9E3779B9u;
            key1 += 0xBB67AE85u;
        }
        c0[i] = a;
        c1[i] = b;
        c2[i] = c;
        c3[i] = d;
    }
}

static double uniform52(uint32_t high, uint32_t low)
{
    uint64_t bits = ((uint64_t)high << 32 | low) >> 12; /* 52 bits: with the half added, still exact */
    return ((double)bits + 0.5) * 0x1p-52;
}

double rx_random_uniform(uint64_t seed, uint64_t stream, uint64_t counter)
{
    uint32_t words[4];
    rx_random_block(seed, stream, counter, words);
    return uniform52(words[0], words[1]);
}

double rx_random_normal(uint64_t seed, uint64_t stream, uint64_t counter)
{
    uint32_t words[4];
    rx_random_block(seed, stream, counter, words);
    double radius = sqrt(-2.0 * log(uniform52(words[0], words[1])));
    return radius * cos(2.0 * 3.14159265358979323846 * uniform52(words[2], words[3]));
}
