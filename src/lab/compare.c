/* Two runs on the same things. */
#include "lab/compare.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

int rx_has_spread(long n, const double *a, const double *b)
{
    for (long i = 1; i < n; i++)
        if (a[i] - b[i] != a[0] - b[0])
            return 1;
    return 0;
}

rx_status rx_compare_paired(long n, const double *a, const double *b, rx_test *paired, rx_test *wilcoxon,
                            rx_error *err)
{
    *paired = *wilcoxon = rx_no_test();
    if (!rx_has_spread(n, a, b))
        return RX_OK;
    const rx_status status = rx_test_paired(n, a, b, paired, err);
    return status != RX_OK ? status : rx_test_wilcoxon(n, a, b, wilcoxon, err);
}

static double *at(double *first, size_t stride, long i)
{
    return (double *)(void *)((char *)first + (size_t)i * stride);
}

rx_status rx_compare_holm(long n, size_t stride, const double *p, double *adjusted, rx_error *err)
{
    double *all = RX_NEW(double, 2 * (size_t)n + 1);
    long used = 0;
    if (all == NULL)
        return rx_error_memory(err, 2 * (size_t)n * sizeof *all);
    double *out = all + n;
    for (long i = 0; i < n; i++) {
        const double one = *(const double *)(const void *)((const char *)p + (size_t)i * stride);
        *at(adjusted, stride, i) = one;
        if (!isnan(one))
            all[used++] = one;
    }
    const rx_status status = used > 0 ? rx_holm(used, all, out, err) : RX_OK;
    used = 0;
    for (long i = 0; i < n && status == RX_OK; i++)
        if (!isnan(*at(adjusted, stride, i)))
            *at(adjusted, stride, i) = out[used++];
    free(all);
    return status;
}
