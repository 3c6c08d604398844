/* Correlated noise: what smoothing and resampling make of white noise. */
#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "train/scenes_survey.h"

/* --- power --- */

static double sinc(double x)
{
    return fabs(x) < 1e-9 ? 1.0 : sin(M_PI * x) / (M_PI * x);
}

/* The interpolating function, t pixels from its centre. */
static double interpolating(rx_correlation_kind kind, double t)
{
    const double d = fabs(t);
    switch (kind) {
    case RX_CORRELATION_LINEAR:
        return fmax(1.0 - d, 0.0);
    case RX_CORRELATION_CUBIC:
        if (d >= 2.0)
            return 0.0;
        return d < 1.0 ? (1.5 * d - 2.5) * d * d + 1.0 : ((-0.5 * d + 2.5) * d - 4.0) * d + 2.0;
    default:
        return d < 3.0 ? sinc(d) * sinc(d / 3.0) : 0.0;
    }
}

/* Of the weights of the pixels around a place `shift` beyond one of them; their sum is 1. */
static double power_of_shift(rx_correlation_kind kind, double shift, double frequency)
{
    enum { REACH = 3 };
    double sum = 0.0, re = 0.0, im = 0.0;
    for (int k = 1 - REACH; k <= REACH; k++) {
        const double weight = interpolating(kind, k - shift);
        sum += weight;
        re += weight * cos(2.0 * M_PI * frequency * k);
        im += weight * sin(2.0 * M_PI * frequency * k);
    }
    return (re * re + im * im) / (sum * sum);
}

/* Drops anywhere on the pixels, as many dithers leave them: what the two boxes overlap in is sampled at the
 * pixels, which folds its power. */
static double power_of_drops(double drop, double frequency)
{
    enum { FOLDS = 8 };
    double sum = 0.0;
    for (int k = -FOLDS; k <= FOLDS; k++)
        sum += pow(sinc(drop * (frequency + k)) * sinc(frequency + k), 2);
    return sum;
}

double rx_correlation_power(const rx_correlation *c, int direction, double frequency)
{
    const double size = c->size[direction];
    switch (c->kind) {
    case RX_CORRELATION_NONE:
        return 1.0;
    case RX_CORRELATION_GAUSS:
        return exp(-pow(M_PI * size * frequency, 2) / (2.0 * M_LN2));
    case RX_CORRELATION_DRIZZLE:
        return power_of_drops(size, frequency);
    default:
        return power_of_shift(c->kind, size, frequency);
    }
}

/* --- filter --- */

static double square(const float *value)
{
    return (double)value[0] * (double)value[0] + (double)value[1] * (double)value[1];
}

rx_status rx_correlation_filter(const rx_correlation *c, const rx_fft *fft, const float *optics,
                                float *filter, rx_error *err)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft), half = w / 2 + 1;
    const size_t stride = (size_t)rx_fft_stride_complex(fft);
    double white = 0.0, matched = 0.0;
    double *across, *along;
    RX_TRY(RX_MAKE(across, (size_t)half + (size_t)h, err));
    along = across + half;
    for (int u = 0; u < half; u++)
        across[u] = rx_correlation_power(c, 0, (double)u / w);
    for (int v = 0; v < h; v++)
        along[v] = rx_correlation_power(c, 1, (double)v / h);
    for (int u = 0; u < half; u++) {
        /* the half that is not stored holds the same again, but for u = 0 and, of an even width, the last */
        const double twice = u == 0 || 2 * u == w ? 1.0 : 2.0;
        for (int v = 0; v < h; v++) {
            const double light = square(optics + 2 * ((size_t)u * stride + (size_t)v));
            white += twice * light;
            matched += light * (twice * across[u]) * along[v];
        }
    }
    const double scale = sqrt(white / matched) / ((double)w * h); /* the inverse has no factor */
    for (int u = 0; u < half; u++)
        for (int v = 0; v < h; v++) {
            float *value = filter + 2 * ((size_t)u * stride + (size_t)v);
            value[0] = (float)(scale * sqrt(across[u] * along[v]));
            value[1] = 0.0f;
        }
    free(across);
    return RX_OK;
}

/* Squared, along one direction: of all frequencies, weighed by the light of a Gaussian PSF and alike. */
static double square_factor(const rx_correlation *c, double fwhm)
{
    enum { STEPS = 512 };
    const rx_correlation psf = {RX_CORRELATION_GAUSS, {fwhm, fwhm}};
    double light = 0.0, matched = 0.0, all = 0.0;
    for (int i = 0; i < STEPS; i++) {
        const double frequency = (i + 0.5) / (2.0 * STEPS), power = rx_correlation_power(c, 0, frequency),
                     weight = rx_correlation_power(&psf, 0, frequency);
        light += weight;
        matched += weight * power;
        all += power;
    }
    return matched / light * STEPS / all;
}

double rx_scenes_factor(const rx_scenes_survey *par, double fwhm)
{
    const double wide = par->smoothed_fwhm[1];
    const rx_correlation smoothed = {RX_CORRELATION_GAUSS, {wide, wide}};
    double most = 1.0;
    if (par->smoothed > 0.0)
        most = fmax(most, square_factor(&smoothed, fwhm));
    for (int kind = RX_CORRELATION_LINEAR; par->resampled > 0.0 && kind <= RX_CORRELATION_DRIZZLE; kind++) {
        const double size = kind == RX_CORRELATION_DRIZZLE ? RX_SURVEY_DROP : 0.5; /* the worst */
        const rx_correlation c = {(rx_correlation_kind)kind, {size, size}};
        most = fmax(most, square_factor(&c, fwhm));
    }
    return most; /* the same along both: the product of the roots */
}
