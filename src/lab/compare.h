/* Two runs on the same things. */
#ifndef RX_LAB_COMPARE_H
#define RX_LAB_COMPARE_H

#include <math.h>
#include <stddef.h>

#include "quality/hypothesis.h"

/* Student's t needs two differences that are not the same. */
int rx_has_spread(long n, const double *a, const double *b);

/* Student's and Wilcoxon's test of the differences a - b; without spread their numbers are all NAN. */
rx_status rx_compare_paired(long n, const double *a, const double *b, rx_test *paired, rx_test *wilcoxon,
                            rx_error *err);

/* p adjusted by Holm for n conditions. p and adjusted lie in structs, `stride` bytes from one to the next; those that
 * are NAN do not count, and stay so. */
rx_status rx_compare_holm(long n, size_t stride, const double *p, double *adjusted, rx_error *err);

static inline rx_test rx_no_test(void)
{
    return (rx_test){NAN, NAN, NAN, NAN, NAN, {NAN, NAN, NAN, 0}};
}

#endif
