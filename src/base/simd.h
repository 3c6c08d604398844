/* Wide vectors where the machine has them, from one build for all machines. */
#ifndef RX_BASE_SIMD_H
#define RX_BASE_SIMD_H

#include <stddef.h> /* what C library it is */

/* RX_SIMD before a function compiles it for AVX2, too, and the loader chooses. No fused multiply-add: what is
 * computed number by number is the same to the bit; sums over numbers are in another order. Compilers and
 * systems that cannot do that, and sanitizers, which do not get along with functions that are chosen before
 * they are set up, take the plain one. */
#if defined(__x86_64__) && defined(__linux__) && defined(__GLIBC__) && defined(__GNUC__) &&                  \
    !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define RX_SIMD __attribute__((target_clones("avx2", "default")))
#else
#define RX_SIMD
#endif

#endif
