/* Figures of the restoration report. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "lab/restoration_numbers.h"
#include "report/figure.h"

enum { SHOWN_SIDE = 128, PICTURE_WIDTH = 200 };

static const char *axis_of(int by_sigma)
{
    return by_sigma ? "noise sigma (peak 255)" : "FWHM (pixels)";
}

static const char *const kind_name[] = {"fwhm", "sigma"};

/* One box per method and bin, as the paper's figure. */
static void boxes(rx_figures *dst, const rx_restoration_numbers *m, int by_sigma, rx_quality quality)
{
    const rx_restoration_results *r = m->results;
    size_t nmethods = (size_t)r->nmethods;
    int ngroups = 0, colors[RX_METHODS_MAX];
    const char *methods[RX_METHODS_MAX];
    char id[RX_FIGURE_ID], title[80];
    rx_five_numbers *box = RX_NEW(rx_five_numbers, (size_t)r->nbins * nmethods);
    char(*label)[16] = rx_alloc((size_t)r->nbins, sizeof *label);
    const char **groups = RX_NEW(const char *, (size_t)r->nbins);
    if (box == NULL || label == NULL || groups == NULL) {
        dst->script.failed = true;
        goto exit;
    }
    for (int b = 0; b < r->nbins; b++) {
        if (r->bins[b].by_sigma != by_sigma)
            continue;
        for (int k = 0; k < r->nmethods; k++)
            box[(size_t)ngroups * nmethods + (size_t)k] = *rx_quality_box(m, b, quality, k);
        snprintf(label[ngroups], sizeof *label, "%g%s", rx_bin_centre(&r->bins[b]),
                 rx_bin_is_beyond(m, b) ? "+" : "");
        groups[ngroups] = label[ngroups];
        ngroups++;
    }
    if (ngroups == 0)
        goto exit;
    for (int k = 0; k < r->nmethods; k++) {
        colors[k] = rx_method_color(r->method[k]);
        methods[k] = r->method[k];
    }
    snprintf(id, sizeof id, "%s-box-%s", kind_name[by_sigma], quality == RX_PSNR ? "psnr" : "ssim");
    snprintf(title, sizeof title, "%s by %s", rx_quality_name(quality), by_sigma ? "noise" : "FWHM");
    rx_figure_add(
        dst, id, title,
        "Box: quartiles, bar: median, ring: mean, whiskers: last value within 1.5 box lengths; a plus: "
        "beyond the training range. As the paper's Figure 5: blurred blue, RL red, the network green.",
        false);
    rx_axes axes = {.xlabel = axis_of(by_sigma), .ylabel = quality == RX_PSNR ? "PSNR (dB)" : "SSIM"};
    rx_plot_boxes(dst, &axes, ngroups, groups, r->nmethods, methods, colors, box);
exit:
    free(box);
    free(label);
    free(groups);
}

/* Mean differences of every pair of the page with their t intervals. */
typedef struct lines {
    rx_curve curve[RX_PAIRS_MAX + 2];
    char name[RX_PAIRS_MAX][2 * RX_METHOD_NAME + 4];
    double *data;               /* x, y, low, high per pair */
    double zero[2], ends[2];    /* the line of no difference */
    double limit[2], height[2]; /* where the training range ends */
} lines;

static void one_line(lines *l, const rx_restoration_numbers *m, int by_sigma, rx_quality quality, int pair,
                     rx_axes *axes)
{
    const rx_restoration_results *r = m->results;
    size_t nbins = (size_t)r->nbins;
    double *x = l->data + 4 * nbins * (size_t)pair, *y = x + nbins, *low = y + nbins, *high = low + nbins;
    long n = 0;
    for (int b = 0; b < r->nbins; b++) {
        if (r->bins[b].by_sigma != by_sigma)
            continue;
        const rx_estimate *d = &rx_quality_duel_of(m, b, quality, pair)->paired.difference;
        x[n] = rx_bin_centre(&r->bins[b]) + 0.08 * (pair - 0.5 * (m->npairs - 1));
        y[n] = d->value;
        low[n] = d->low;
        high[n++] = d->high;
        axes->x0 = fmin(axes->x0, rx_bin_centre(&r->bins[b]) - 0.7);
        axes->x1 = fmax(axes->x1, rx_bin_centre(&r->bins[b]) + 0.7);
        if (isfinite(d->value) && isfinite(d->low) && isfinite(d->high)) {
            axes->y0 = fmin(axes->y0, d->low);
            axes->y1 = fmax(axes->y1, d->high);
        }
    }
    const char *first = r->method[m->pair[pair].first], *second = r->method[m->pair[pair].second];
    snprintf(l->name[pair], sizeof *l->name, "%s - %s", first, second);
    l->curve[pair] = (rx_curve){.name = l->name[pair], .kind = RX_CURVE_BARS, .n = n, .x = x, .y = y};
    l->curve[pair].color = rx_method_color(first);
    for (int p = 0; p < pair; p++) /* the first duel of a method is drawn through */
        l->curve[pair].dashed |= m->pair[p].first == m->pair[pair].first;
    l->curve[pair].low = low;
    l->curve[pair].high = high;
}

/* Upper end of the last bin inside the training range; NAN without one. */
static double last_inside(const rx_restoration_numbers *m, int by_sigma)
{
    double high = NAN;
    for (int b = 0; b < m->results->nbins; b++)
        if (m->results->bins[b].by_sigma == by_sigma && !rx_bin_is_beyond(m, b))
            high = m->results->bins[b].high;
    return high;
}

static void differences(rx_figures *dst, const rx_restoration_numbers *m, int by_sigma, rx_quality quality)
{
    char id[RX_FIGURE_ID], title[80];
    rx_axes axes = {.xlabel = axis_of(by_sigma),
                    .ylabel = quality == RX_PSNR ? "difference of PSNR (dB)" : "difference of SSIM",
                    .x0 = INFINITY,
                    .x1 = -INFINITY};
    lines *l = RX_NEW(lines, 1);
    if (l != NULL)
        l->data = RX_NEW(double, 4 * (size_t)m->results->nbins * (size_t)(m->npairs + 1));
    if (l == NULL || l->data == NULL) {
        dst->script.failed = true;
        free(l);
        return;
    }
    for (int p = 0; p < m->npairs; p++)
        one_line(l, m, by_sigma, quality, p, &axes);
    if (axes.x1 > axes.x0) {
        double margin = 0.05 * (axes.y1 - axes.y0) + 1e-3;
        axes.y0 -= margin;
        axes.y1 += margin;
        l->ends[0] = axes.x0;
        l->ends[1] = axes.x1;
        l->curve[m->npairs] =
            (rx_curve){.kind = RX_CURVE_LINE, .color = -1, .n = 2, .x = l->ends, .y = l->zero};
        l->limit[0] = l->limit[1] = last_inside(m, by_sigma);
        l->height[0] = axes.y0;
        l->height[1] = axes.y1;
        l->curve[m->npairs + 1] =
            (rx_curve){.kind = RX_CURVE_LINE, .color = -1, .n = 2, .x = l->limit, .y = l->height};
        int beyond = l->limit[0] > axes.x0 && l->limit[0] < axes.x1;
        snprintf(id, sizeof id, "%s-difference-%s", kind_name[by_sigma],
                 quality == RX_PSNR ? "psnr" : "ssim");
        snprintf(title, sizeof title, "Mean difference of %s by %s", rx_quality_name(quality),
                 by_sigma ? "noise" : "FWHM");
        rx_figure_add(
            dst, id, title,
            "On the same scenes, with 95 % t intervals: above zero the first of the two is better. Right of "
            "the upright line: beyond the training range.",
            false);
        rx_plot_curves(dst, &axes, m->npairs + 1 + beyond, l->curve);
    }
    free(l->data);
    free(l);
}

/* Middle of a plane, SHOWN_SIDE pixels at most. */
static int crop(const float *plane, int side, float *dst)
{
    int shown = side < SHOWN_SIDE ? side : SHOWN_SIDE, from = (side - shown) / 2;
    for (int y = 0; y < shown; y++)
        for (int x = 0; x < shown; x++)
            dst[y * shown + x] = plane[(size_t)(from + y) * (size_t)side + (size_t)(from + x)];
    return shown;
}

static void pictures(rx_figures *dst, const rx_restoration_results *r)
{
    char id[RX_FIGURE_ID];
    float *pixels = RX_NEW(float, SHOWN_SIDE *SHOWN_SIDE);
    if (pixels == NULL) {
        dst->script.failed = true;
        return;
    }
    for (int e = 0; e < r->nexamples; e++) {
        const rx_restoration_example *x = &r->examples[e];
        for (int k = 0; k < x->nplanes && dst->n < RX_FIGURES_MAX; k++) {
            int shown = crop(x->planes[k], r->side, pixels);
            snprintf(id, sizeof id, "example%d-%d", e, k);
            rx_figure_add(dst, id, x->title[k], "", true);
            /* the same for all planes of all examples: noise shows as noise, and faint parts are seen */
            rx_plot_picture(dst, shown, shown, pixels, -0.06 * r->peak, 0.7 * r->peak, 0.06 * r->peak,
                            PICTURE_WIDTH);
        }
    }
    free(pixels);
}

void rx_restoration_figures(rx_figures *dst, const rx_restoration_numbers *m)
{
    for (int kind = 0; kind < 2; kind++)
        for (int q = 0; q < RX_QUALITIES; q++)
            boxes(dst, m, kind, (rx_quality)q);
    for (int kind = 0; kind < 2; kind++)
        for (int q = 0; q < RX_QUALITIES; q++)
            differences(dst, m, kind, (rx_quality)q);
    pictures(dst, m->results);
}
