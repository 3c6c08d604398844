/* The smaller and the larger of two. */
#ifndef RX_BASE_MIN_MAX_H
#define RX_BASE_MIN_MAX_H

static inline int rx_min_int(int a, int b)
{
    return a < b ? a : b;
}

static inline int rx_max_int(int a, int b)
{
    return a > b ? a : b;
}

#endif
