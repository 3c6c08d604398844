/* The smaller and the larger of two. */
#ifndef RX_BASE_LEAST_H
#define RX_BASE_LEAST_H

static inline int rx_least(int a, int b)
{
    return a < b ? a : b;
}

static inline int rx_most(int a, int b)
{
    return a > b ? a : b;
}

#endif
