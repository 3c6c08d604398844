/* Brightness and noise level of an image. */
#include "nn/noise_level.h"

#include <math.h>

/* The k-th smallest (from 0), by Hoare's quickselect; afterwards no value behind k is smaller. */
static float select_value(float *v, size_t n, size_t k)
{
    size_t low = 0, high = n - 1;
    while (low < high) {
        float pivot = v[low + (high - low) / 2];
        size_t i = low, j = high;
        for (;;) {
            while (v[i] < pivot)
                i++;
            while (v[j] > pivot)
                j--;
            if (i >= j)
                break;
            const float keep = v[i];
            v[i++] = v[j];
            v[j--] = keep;
        }
        if (v[j] > pivot)
            j--;
        if (k <= j)
            high = j;
        else
            low = j + 1;
    }
    return v[k];
}

float rx_upper_value(float *v, size_t n, size_t count)
{
    return select_value(v, n, count < n ? n - count : 0);
}

static double place_of(size_t n)
{
    return 0.999 * (double)(n - 1);
}

size_t rx_brightness_needs(size_t n)
{
    return n == 0 ? 0 : n - (size_t)place_of(n);
}

double rx_brightness_of_top(float *light, size_t top, size_t n, size_t few)
{
    if (n == 0)
        return NAN;
    const double place = place_of(n), part = place - floor(place);
    const size_t k = (size_t)place - (n - top);
    double q = (double)select_value(light, top, k);
    if (k + 1 < top) {
        float next = light[k + 1];
        for (size_t i = k + 2; i < top; i++)
            next = light[i] < next ? light[i] : next;
        q = (1.0 - part) * q + part * (double)next;
    }
    if (top - k > few) /* what lies before place k is none of the brightest */
        q = fmax(q, (double)select_value(light + k, top - k, top - k - 1 - few) / RX_NOISE_LEVEL_PEAK);
    return q;
}

double rx_brightness(float *light, size_t n, size_t few)
{
    return rx_brightness_of_top(light, n, n, few);
}

double rx_noise_level(double brightness)
{
    return isnan(brightness) ? NAN : brightness > 0.0 ? RX_NOISE_LEVEL_SCALE / brightness : HUGE_VAL;
}
