/* num/fft against the sum that defines it, and its bytes against the number of threads. */
#include "../near.h"

#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "num/fft.h"

static const double PI = 3.14159265358979323846;

static void fill(const rx_fft *fft, float *plane)
{
    for (int y = 0; y < rx_fft_height(fft); y++)
        for (int x = 0; x < rx_fft_width(fft); x++)
            plane[(size_t)y * rx_fft_stride_real(fft) + x] =
                (float)rx_random_normal(1, (uint64_t)y, (uint64_t)x);
}

static void good_sizes(void **state)
{
    assert_int_equal(rx_fft_good_size(1), 2);
    assert_int_equal(rx_fft_good_size(11), 12);
    assert_int_equal(rx_fft_good_size(13), 14);
    assert_int_equal(rx_fft_good_size(1023), 1024);
    assert_int_equal(rx_fft_good_size(1025), 1050);
    assert_int_equal(rx_fft_good_size(2049), 2058);
    for (int n = 1; n < 5000; n++) {
        int size = rx_fft_good_size(n);
        assert_true(size >= n);
        assert_true(size % 2 == 0);
        assert_true(size <= n + n / 8 + 4);
    }
    assert_int_equal(rx_fft_good_size(2147483647), 0);
}

/* The defining sum in double for every u, v. */
static void check_against_sum(int width, int height)
{
    rx_fft *fft = NULL;
    assert_int_equal(rx_fft_new(width, height, 1, &fft, NULL), RX_OK);
    float *real = rx_fft_real(fft), *half = rx_fft_complex(fft), *back = rx_fft_real(fft);
    assert_non_null(real);
    assert_non_null(half);
    assert_non_null(back);
    fill(fft, real);
    rx_fft_forward(fft, real, half);
    const double tolerance = 2e-6 * sqrt((double)width * height);
    for (int v = 0; v < height; v++)
        for (int u = 0; u <= width / 2; u++) {
            double re = 0, im = 0;
            for (int y = 0; y < height; y++)
                for (int x = 0; x < width; x++) {
                    double angle = 2 * PI * ((double)u * x / width + (double)v * y / height);
                    double a = real[(size_t)y * rx_fft_stride_real(fft) + x];
                    re += a * cos(angle);
                    im -= a * sin(angle);
                }
            const float *z = half + 2 * ((size_t)u * rx_fft_stride_complex(fft) + v);
            assert_true(fabs(z[0] - re) < tolerance);
            assert_true(fabs(z[1] - im) < tolerance);
        }
    rx_fft_inverse(fft, half, back);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            size_t k = (size_t)y * rx_fft_stride_real(fft) + x;
            assert_true(fabs(back[k] / ((double)width * height) - real[k]) < 2e-6);
        }
    free(real);
    free(half);
    free(back);
    rx_fft_free(fft);
}

static void direct_sum(void **state)
{
    static const int sizes[][2] = {{1, 1},   {2, 2},   {1, 9},   {9, 1},   {5, 7},  {13, 11},
                                   {16, 16}, {18, 35}, {21, 30}, {42, 24}, {17, 8}, {50, 31}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        check_against_sum(sizes[i][0], sizes[i][1]);
}

/* The low columns of a transform are those of the whole. */
static void low_columns(void **state)
{
    static const int columns[] = {1, 8, 9, 40, 76, 1000};
    rx_fft *fft = NULL;
    assert_int_equal(rx_fft_new(150, 42, 2, &fft, NULL), RX_OK);
    float *real = rx_fft_real(fft), *whole = rx_fft_complex(fft), *low = rx_fft_complex(fft);
    fill(fft, real);
    rx_fft_forward(fft, real, whole);
    for (int i = 0; i < 6; i++) {
        rx_fft_forward_low(fft, real, columns[i], low);
        size_t stride = 2 * (size_t)rx_fft_stride_complex(fft), n = columns[i] < 76 ? (size_t)columns[i] : 76;
        for (size_t u = 0; u < n; u++)
            assert_memory_equal(low + u * stride, whole + u * stride, 2 * 42 * sizeof(float));
    }
    free(real);
    free(whole);
    free(low);
    rx_fft_free(fft);
}

/* Same bytes for 1, 2, 3 and 5 threads, there and back. */
static void threads(void **state)
{
    float *first_half = NULL, *first_back = NULL;
    static const int counts[] = {1, 2, 3, 5};
    for (int i = 0; i < 4; i++) {
        rx_fft *fft = NULL;
        assert_int_equal(rx_fft_new(150, 126, counts[i], &fft, NULL), RX_OK);
        float *real = rx_fft_real(fft), *half = rx_fft_complex(fft), *copy = rx_fft_complex(fft);
        size_t n_half = rx_fft_complex_size(fft) * sizeof(float);
        size_t n_real = (size_t)rx_fft_stride_real(fft) * 126 * sizeof(float);
        fill(fft, real);
        rx_fft_forward(fft, real, half);
        memcpy(copy, half, n_half);
        rx_fft_inverse(fft, copy, real);
        free(copy);
        if (i == 0) {
            first_half = half;
            first_back = real;
        } else {
            assert_memory_equal(half, first_half, n_half);
            assert_memory_equal(real, first_back, n_real);
            free(half);
            free(real);
        }
        rx_fft_free(fft);
    }
    free(first_half);
    free(first_back);
}

enum { ROWS_WIDTH = 60, ROWS_HEIGHT = 45, DARK = 17, FIRST = 5, LAST = 38 };

typedef struct planes {
    const float *from;
    float *to;
    size_t stride;
} planes;

static int read_row(void *user, int y, float *line)
{
    const planes *p = user;
    if (y < DARK) /* zeros in the plane as well */
        return 0;
    memcpy(line, p->from + (size_t)y * p->stride, ROWS_WIDTH * sizeof *line);
    return 1;
}

static void write_row(void *user, int y, float *line)
{
    const planes *p = user;
    assert_true(y >= FIRST);
    assert_true(y < LAST);
    memcpy(p->to + (size_t)y * p->stride, line, ROWS_WIDTH * sizeof *line);
}

/* Row by row the same bytes as plane by plane. */
static void by_rows(void **state)
{
    rx_fft *fft = NULL;
    assert_int_equal(rx_fft_new(ROWS_WIDTH, ROWS_HEIGHT, 2, &fft, NULL), RX_OK);
    const size_t stride = (size_t)rx_fft_stride_real(fft), size = rx_fft_complex_size(fft) * sizeof(float);
    float *src = rx_fft_real(fft), *whole = rx_fft_real(fft), *part = rx_fft_real(fft);
    float *kernel = rx_fft_complex(fft), *half = rx_fft_complex(fft), *other = rx_fft_complex(fft);
    planes p = {src, part, stride};
    fill(fft, src);
    rx_fft_forward(fft, src, kernel);
    memset(src, 0, DARK * stride * sizeof *src);
    rx_fft_forward(fft, src, half);
    rx_fft_forward_rows(fft, read_row, &p, other);
    assert_memory_equal(half, other, size);
    rx_fft_inverse(fft, half, whole);
    rx_fft_inverse_rows(fft, other, FIRST, LAST, write_row, &p);
    for (size_t y = FIRST; y < LAST; y++)
        assert_memory_equal(whole + y * stride, part + y * stride, ROWS_WIDTH * sizeof(float));
    rx_fft_filter(fft, src, kernel, true, half, whole);
    rx_fft_filter_rows(fft, &(rx_fft_rows){read_row, write_row, &p, FIRST, LAST}, kernel, true, other);
    for (size_t y = FIRST; y < LAST; y++)
        assert_memory_equal(whole + y * stride, part + y * stride, ROWS_WIDTH * sizeof(float));
    assert_true(part[FIRST * stride] != 0);
    assert_true(part[(FIRST - 1) * stride] == 0);
    assert_true(part[LAST * stride] == 0);
    free(src);
    free(whole);
    free(part);
    free(kernel);
    free(half);
    free(other);
    rx_fft_free(fft);
}

static void refuses(void **state)
{
    rx_fft *fft = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_fft_new(0, 5, 1, &fft, &err), RX_INPUT);
    assert_null(fft);
    assert_true(err.text[0] != '\0');
    rx_fft_free(NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(good_sizes),  cmocka_unit_test(direct_sum),
                                       cmocka_unit_test(low_columns), cmocka_unit_test(threads),
                                       cmocka_unit_test(by_rows),     cmocka_unit_test(refuses)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
