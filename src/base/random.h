/* Counter-based random numbers: Philox4x32-10 (Salmon, Moraes, Dror, Shaw, "Parallel
 * random numbers: as easy as 1, 2, 3", SC11). A number depends only on (seed, stream,
 * counter), never on what was asked before, hence not on the number of threads. */
#ifndef RX_BASE_RANDOM_H
#define RX_BASE_RANDOM_H

#include <stddef.h>
#include <stdint.h>

/* Which numbers: a stream of a seed, counted from 0. */
typedef struct rx_random_stream {
    uint64_t seed, stream;
} rx_random_stream;

/* Four 32-bit words of the block `counter` in `stream`. */
void rx_random_block(uint64_t seed, uint64_t stream, uint64_t counter, uint32_t out[4]);

/* The blocks first .. first + n - 1, with the same words, many at a time: word k of block first + i in
 * out[k * n + i]. */
void rx_random_blocks(uint64_t seed, uint64_t stream, uint64_t first, size_t n, uint32_t *out);

/* Uniform in (0,1), 52 bits; never 0 nor 1. */
double rx_random_uniform(uint64_t seed, uint64_t stream, uint64_t counter);

/* Two of them, independent; the first is rx_random_uniform(). */
void rx_random_two(uint64_t seed, uint64_t stream, uint64_t counter, double dst[2]);

/* Number `slot` of a stream: uniform in low .. high, and log-uniform (uniform where `low` is not above 0). */
double rx_random_between(rx_random_stream from, uint64_t slot, double low, double high);
double rx_random_log_between(rx_random_stream from, uint64_t slot, double low, double high);

/* Normal deviate, mean 0, width 1 (Box-Muller on one block). */
double rx_random_normal(uint64_t seed, uint64_t stream, uint64_t counter);

#endif
