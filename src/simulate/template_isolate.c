/* From a cut-out to its object. */
#include "simulate/templates.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/convolve.h"
#include "num/stats.h"

#define FINE 3.0 /* FWHM of the two smoothed images, pixels */
#define WIDE 6.0
#define EDGE 2.5 /* sigma of the wide one: where the object ends */
#define KEPT 5.0 /* sigma of the fine one: pixels as they are */
#define LEAST_PIXELS 9

enum { BORDER_SHARE = 8, LEAST_BORDER = 3 };

typedef struct workshop {
    int width, height;
    size_t n;
    float *raw, *fine, *wide; /* sky subtracted; smoothed */
    unsigned char *bad;       /* masked */
    unsigned char *inside;    /* 1: the object */
    long *stack;              /* pixels still to look at */
    double *scratch;
    double sigma, fine_sigma, wide_sigma;
} workshop;

static rx_status open_workshop(const float *pixels, const unsigned char *mask, int width, int height,
                               workshop *w, rx_error *err)
{
    size_t n = (size_t)width * (size_t)height;
    *w = (workshop){.width = width, .height = height, .n = n};
    RX_TRY(RX_MAKE(w->raw, 3 * n, err));
    RX_TRY(RX_MAKE(w->bad, 2 * n, err));
    RX_TRY(RX_MAKE(w->stack, n, err));
    RX_TRY(RX_MAKE(w->scratch, n, err));
    w->fine = w->raw + n;
    w->wide = w->fine + n;
    w->inside = w->bad + n;
    for (size_t i = 0; i < n; i++) {
        w->bad[i] = !isfinite(pixels[i]) || (mask != NULL && mask[i] != 0);
        w->raw[i] = w->bad[i] ? 0.0f : pixels[i];
    }
    return RX_OK;
}

/* --- sky and noise --- */

/* Noise of the border; its median too. */
static double border_sigma(workshop *w, const float *image, double *median)
{
    int least = w->width < w->height ? w->width : w->height;
    int wide = least / BORDER_SHARE > LEAST_BORDER ? least / BORDER_SHARE : LEAST_BORDER;
    size_t n = 0;
    for (int y = 0; y < w->height; y++)
        for (int x = 0; x < w->width; x++) {
            int inner = x >= wide && x < w->width - wide && y >= wide && y < w->height - wide;
            size_t i = (size_t)y * (size_t)w->width + (size_t)x;
            if (!inner && !w->bad[i])
                w->scratch[n++] = (double)image[i];
        }
    *median = 0.0;
    return n > 0 ? rx_sigma_mad(w->scratch, n, median) : 0.0;
}

static rx_status measure_noise(workshop *w, double sky, rx_error *err)
{
    double median;
    w->sigma = border_sigma(w, w->raw, &median);
    if (!isfinite(sky))
        sky = median;
    for (size_t i = 0; i < w->n; i++)
        w->raw[i] = w->bad[i] ? 0.0f : (float)((double)w->raw[i] - sky);
    memcpy(w->fine, w->raw, w->n * sizeof(float));
    memcpy(w->wide, w->raw, w->n * sizeof(float));
    RX_TRY(rx_gauss_masked(w->width, w->height, FINE, w->bad, 1, w->fine, err));
    RX_TRY(rx_gauss_masked(w->width, w->height, WIDE, w->bad, 1, w->wide, err));
    w->fine_sigma = border_sigma(w, w->fine, &median);
    w->wide_sigma = border_sigma(w, w->wide, &median);
    return RX_OK;
}

/* --- the object's pixels --- */

static long brightest(const workshop *w)
{
    long best = -1;
    for (int y = w->height / 4; y < w->height - w->height / 4; y++)
        for (int x = w->width / 4; x < w->width - w->width / 4; x++) {
            long i = (long)y * w->width + x;
            if (!w->bad[i] && (best < 0 || w->wide[i] > w->wide[best]))
                best = i;
        }
    return best;
}

/* Everything above the edge that is connected with pixel `seed`; the number of pixels. */
static long flood(workshop *w, long seed)
{
    float edge = (float)(EDGE * w->wide_sigma);
    long waiting = 0, n = 0;
    if (seed < 0 || !(w->wide[seed] > edge))
        return 0;
    w->inside[seed] = 1;
    w->stack[waiting++] = seed;
    while (waiting > 0) {
        long i = w->stack[--waiting];
        int x = (int)(i % w->width), y = (int)(i / w->width);
        n++;
        for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < w->height; v++)
            for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < w->width; u++) {
                long k = (long)v * w->width + u;
                if (!w->inside[k] && !w->bad[k] && w->wide[k] > edge) {
                    w->inside[k] = 1;
                    w->stack[waiting++] = k;
                }
            }
    }
    return n;
}

/* A seam of one pixel: what touches the object, marked in a second pass as 2 becomes 1. */
static void add_seam(workshop *w)
{
    for (int y = 0; y < w->height; y++)
        for (int x = 0; x < w->width; x++) {
            long i = (long)y * w->width + x;
            for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < w->height && !w->inside[i]; v++)
                for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < w->width; u++)
                    if (w->inside[(long)v * w->width + u] == 1 && !w->bad[i]) {
                        w->inside[i] = 2;
                        break;
                    }
        }
    for (size_t i = 0; i < w->n; i++)
        w->inside[i] = w->inside[i] != 0;
}

/* --- the template --- */

/* No pixels: their light has no sum that they could be parts of, be it too much for a float or none. */
static rx_status crop(const workshop *w, rx_template *dst, rx_error *err)
{
    int left = w->width, right = -1, bottom = w->height, top = -1;
    double sum = 0.0, light = 0.0, count = 0.0;
    for (int y = 0; y < w->height; y++)
        for (int x = 0; x < w->width; x++)
            if (w->inside[(long)y * w->width + x]) {
                left = x < left ? x : left;
                right = x > right ? x : right;
                bottom = y < bottom ? y : bottom;
                top = y > top ? y : top;
            }
    dst->width = right - left + 1;
    dst->height = top - bottom + 1;
    size_t n = (size_t)dst->width * (size_t)dst->height;
    RX_TRY(RX_MAKE(dst->pixels, n, err));
    float kept = (float)(KEPT * w->fine_sigma), faint = 0.5f * kept;
    for (int y = 0; y < dst->height; y++)
        for (int x = 0; x < dst->width; x++) {
            long i = (long)(bottom + y) * w->width + left + x;
            if (!w->inside[i])
                continue;
            float fine = w->fine[i], value = fine > kept ? w->raw[i] : fine > faint ? fine : w->wide[i];
            value = fmaxf(value, 0.0f);
            dst->pixels[(long)y * dst->width + x] = value;
            sum += (double)value;
            light += (double)w->raw[i];
            count += 1.0;
        }
    if (!(sum > 0.0 && isfinite(sum))) {
        free(dst->pixels);
        dst->pixels = NULL;
        return RX_OK;
    }
    for (size_t i = 0; i < n; i++)
        dst->pixels[i] = (float)((double)dst->pixels[i] / sum);
    dst->snr = w->sigma > 0.0 ? light / (w->sigma * sqrt(count)) : HUGE_VAL;
    return RX_OK;
}

/* Centroid, ratio and angle by moments of the light. */
static void measure_shape(rx_template *dst)
{
    double sx = 0.0, sy = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
    for (int y = 0; y < dst->height; y++)
        for (int x = 0; x < dst->width; x++) {
            double value = (double)dst->pixels[(long)y * dst->width + x];
            sx += value * x;
            sy += value * y;
            xx += value * x * x;
            yy += value * y * y;
            xy += value * x * y;
        }
    dst->x = sx;
    dst->y = sy;
    xx -= sx * sx;
    yy -= sy * sy;
    xy -= sx * sy;
    double half = 0.5 * (xx + yy), root = hypot(0.5 * (xx - yy), xy);
    dst->ratio = half > root && half > 0.0 ? sqrt((half - root) / (half + root)) : 1.0;
    dst->ratio = fmax(dst->ratio, 0.05); /* a line of pixels */
    dst->angle = 0.5 * atan2(2.0 * xy, xx - yy);
}

/* Radius of half the light around the centroid: growth in steps of 1/20 pixel, pixels in 5 x 5 equal parts. */
static rx_status measure_radius(rx_template *dst, rx_error *err)
{
    enum { PARTS = 5, STEPS = 20 };
    long n = (long)(STEPS * (hypot(dst->width, dst->height) + 1.0)), k = 0;
    double *light;
    RX_TRY(RX_MAKE(light, (size_t)n, err));
    for (long i = 0; i < PARTS * PARTS * (long)dst->width * dst->height; i++) {
        long pixel = i / (PARTS * PARTS), part = i % (PARTS * PARTS);
        double x = (double)(pixel % dst->width) + (part % PARTS + 0.5) / PARTS - 0.5 - dst->x;
        double y = (double)(pixel / dst->width) + (double)(part / PARTS) / PARTS + 0.5 / PARTS - 0.5 - dst->y;
        light[(long)(STEPS * hypot(x, y))] += (double)dst->pixels[pixel] / (PARTS * PARTS);
    }
    double sum = 0.0;
    while (k < n - 1 && sum + light[k] < 0.5)
        sum += light[k++];
    dst->radius = ((double)k + (light[k] > 0.0 ? (0.5 - sum) / light[k] : 0.5)) / STEPS;
    free(light);
    return RX_OK;
}

rx_status rx_template_isolate(const float *pixels, const unsigned char *mask, int width, int height,
                              double sky, rx_template *dst, rx_error *err)
{
    workshop w;
    rx_status status;
    RX_TRY_EXIT(open_workshop(pixels, mask, width, height, &w, err));
    RX_TRY_EXIT(measure_noise(&w, sky, err));
    if (flood(&w, brightest(&w)) <= LEAST_PIXELS)
        goto exit;
    add_seam(&w);
    RX_TRY_EXIT(crop(&w, dst, err));
    if (dst->pixels != NULL) {
        measure_shape(dst);
        status = measure_radius(dst, err);
    }
exit:
    if (status != RX_OK) {
        free(dst->pixels);
        dst->pixels = NULL;
    }
    free(w.raw);
    free(w.bad);
    free(w.stack);
    free(w.scratch);
    return status;
}
