/* Normal deviates in bulk: every step is a loop that the compiler makes vectors of, with the same roundings
 * on any machine (no library function, no reordering). */
#include <string.h>

#include "base/random.h"
#include "simulate/noise.h"

enum { BLOCKS = 256 }; /* random blocks at a time, four deviates each */

/* -2 ln u of u = (word + 1/2) / 2^32 to 1e-7; 0 where u rounds to 1. ln m = 2 artanh(s), s = (m-1)/(m+1), of
 * the mantissa m in sqrt(1/2) .. sqrt(2). */
static inline float minus_two_log(uint32_t word)
{
    const int32_t root = 0x3F3504F3; /* bits of sqrt(1/2) */
    float u = ((float)(int32_t)(word >> 16) * 65536.0f + ((float)(int32_t)(word & 0xFFFF) + 0.5f)) * 0x1p-32f;
    int32_t bits;
    memcpy(&bits, &u, sizeof bits);
    int32_t above = bits - root, exponent = above >> 23, mantissa = (above & 0x7FFFFF) + root;
    float m;
    memcpy(&m, &mantissa, sizeof m);
    float s = (m - 1.0f) / (m + 1.0f), z = s * s;
    float log_m = s * (2.0f + z * (2.0f / 3 + z * (2.0f / 5 + z * (2.0f / 7 + z * (2.0f / 9)))));
    return -2.0f * ((float)exponent * 0.693147181f + log_m);
}

/* By Newton's rule from the well-known first guess at 1/sqrt; sqrtf() sets errno, which no vector does. */
static inline float square_root(float x)
{
    uint32_t bits; /* unsigned: x is -0 where u rounds to 1 */
    float y;
    memcpy(&bits, &x, sizeof bits);
    bits = 0x5F3759DFu - (bits >> 1);
    memcpy(&y, &bits, sizeof y);
    for (int k = 0; k < 3; k++)
        y *= 1.5f - 0.5f * x * y * y;
    return x * y;
}

/* Four deviates from each block of words [4][BLOCKS]: two pairs, radius and angle. */
static void make_normals(const uint32_t *words, float *dst)
{
    for (int pair = 0; pair < 2; pair++) {
        const uint32_t *length = words + 2 * pair * BLOCKS, *turn = length + BLOCKS;
        float first[BLOCKS], second[BLOCKS];
#pragma omp simd
        for (int i = 0; i < BLOCKS; i++) {
            float r = square_root(minus_two_log(length[i]));
            /* a quarter turn, and what is left of it: -1/8 .. 1/8 turn */
            uint32_t quarter = (turn[i] + 0x20000000u) >> 30;
            float x = (float)(int32_t)(turn[i] - (quarter << 30)) * 1.4629180792671596e-9f, z = x * x;
            float sine =
                x * (1.0f - z * (1.0f / 6 - z * (1.0f / 120 - z * (1.0f / 5040 - z * (1.0f / 362880)))));
            float cosine = 1.0f - z * (0.5f - z * (1.0f / 24 - z * (1.0f / 720 - z * (1.0f / 40320))));
            float across = quarter & 1 ? sine : cosine, along = quarter & 1 ? cosine : sine;
            float a = quarter == 1 || quarter == 2 ? -across : across;
            float b = quarter >= 2 ? -along : along;
            first[i] = r * a;
            second[i] = r * b;
        }
        for (int i = 0; i < BLOCKS; i++) {
            dst[4 * i + 2 * pair] = first[i];
            dst[4 * i + 2 * pair + 1] = second[i];
        }
    }
}

void rx_noise_normals(uint64_t seed, uint64_t stream, uint64_t first, long n, float *dst)
{
    uint32_t words[4 * BLOCKS];
    float normals[4 * BLOCKS];
    long skip = (long)(first % 4);
    uint64_t block = first / 4;
    while (n > 0) {
        long here = 4 * BLOCKS - skip < n ? 4 * BLOCKS - skip : n;
        rx_random_blocks(seed, stream, block, BLOCKS, words);
        make_normals(words, normals);
        memcpy(dst, normals + skip, sizeof(float) * (size_t)here);
        dst += here;
        n -= here;
        block += BLOCKS;
        skip = 0;
    }
}
