/* The largest value in a square neighbourhood of every pixel, 2 reach + 1 on a side and cut at the borders,
 * in two steps: first along rows, then over rows. Plain comparisons of values that are no NAN: the same bytes
 * for any number of threads. */
#ifndef RX_NUM_MAXIMUM_FILTER_H
#define RX_NUM_MAXIMUM_FILTER_H

/* dst[y][x] = the largest of src[y][x - reach .. x + reach]; dst is not src. */
void rx_maximum_filter_in_rows(const float *src, int width, int height, int reach, int nthreads, float *dst);

/* dst[width] = the largest over the rows y - reach .. y + reach of rows[height][width]. */
void rx_maximum_filter_over_rows(const float *rows, int width, int height, int reach, int y, float *dst);

/* Both: dst = the largest of the neighbourhood in src; dst may be src, scratch is another plane. */
void rx_maximum_filter(const float *src, int width, int height, int reach, int nthreads, float *scratch,
                       float *dst);

#endif
