/* Isophotal quantities. */
#include "measure/view.h"

#include <math.h>

static size_t at(const rx_view *view, int x, int y)
{
    return (size_t)y * (size_t)view->image->width + (size_t)x;
}

/* In the segment and not hidden by the mask. */
static bool in_segment(const rx_view *view, int x, int y)
{
    size_t k = at(view, x, y);
    const rx_image *image = view->image;
    return view->sources->segments[k] == view->segment && !rx_image_hides(image, k);
}

/* A pixel that CLEAN added to the segment: it counts for the flux only. */
static bool eaten(const rx_view *view, int x, int y)
{
    return view->sources->fragments != NULL && view->sources->fragments[at(view, x, y)] == RX_FRAGMENT_EATEN;
}

static bool own(const rx_view *view, int x, int y)
{
    return in_segment(view, x, y) && !eaten(view, x, y);
}

/* Variance of own pixels, their photon noise, threshold and peak. */
static void measure_flux(const rx_view *view, const rx_measure_params *par, rx_source *s)
{
    const rx_image *image = view->image;
    double flux = 0.0, variance = 0.0, photons = 0.0, lowest = HUGE_VAL, peak = -HUGE_VAL;
    bool own_threshold = par->analysis_threshold > 0.0;
    double base = own_threshold ? par->analysis_threshold : s->analysis_threshold;
    int npix = 0;
    s->isoarea = 0;
    for (int y = s->ymin; y <= s->ymax; y++)
        for (int x = s->xmin; x <= s->xmax; x++) {
            if (!in_segment(view, x, y))
                continue;
            double value = rx_view_value(image, at(view, x, y));
            double sigma = image->variable_noise ? image->noise.plane[at(view, x, y)] : image->global_noise;
            double threshold = own_threshold && !par->analysis_absolute ? base * sigma : base;
            npix++;
            flux += value;
            variance += sigma * sigma;
            if (image->variable_noise && view->weight_gain && value > 0.0 && image->gain > 0.0)
                photons += value / image->gain * sigma * sigma / (image->global_noise * image->global_noise);
            if (eaten(view, x, y))
                continue;
            s->isoarea += (float)value > (float)threshold;
            lowest = fmin(lowest, threshold);
            peak = fmax(peak, value);
        }
    if (npix == 0) { /* all of it hidden on this image */
        lowest = base;
        peak = 0.0;
    }
    double factor = rx_view_noise_factor(view, npix);
    flux -= npix * view->sky;
    if (!(image->variable_noise && view->weight_gain) && image->gain > 0.0 && flux > 0.0)
        photons = flux / image->gain;
    s->flux_iso = flux;
    s->fluxerr_iso = sqrt(variance * factor * factor + photons);
    s->peak = peak - view->sky;
    s->analysis_threshold = lowest - view->sky;
}

static void measure_isocor(rx_source *s)
{
    double share = s->flux_iso > 0.0 ? s->npix * s->threshold / s->flux_iso : 0.0;
    share = fmin(fmax(share, 0.0), 1.0);
    s->flux_isocor = s->flux_iso / (1.0 - 0.196099 * share - 0.751208 * share * share);
    s->fluxerr_isocor = s->fluxerr_iso;
    if (s->flux_iso > 0.0 && s->npix > 0) {
        double relative2 = s->fluxerr_iso * s->fluxerr_iso / (s->flux_iso * s->flux_iso);
        double dshare = share * sqrt(relative2 + 1.0 / s->npix);
        dshare = 0.196099 * dshare + 0.751208 * 2.0 * share * dshare;
        s->fluxerr_isocor = sqrt(relative2 + dshare * dshare) * s->flux_iso;
    }
}

/* Areas above thresholds spaced evenly in magnitude between the analysis threshold and the peak. */
static void measure_levels(const rx_view *view, rx_source *s)
{
    float level[RX_NISO];
    for (int i = 0; i < RX_NISO; i++) {
        bool spread = s->peak > 0.0 && s->analysis_threshold > 0.0;
        level[i] =
            spread
                ? (float)(s->analysis_threshold * pow(s->peak / s->analysis_threshold, (double)i / RX_NISO))
                : 0.0f;
        s->iso[i] = 0;
    }
    for (int y = s->ymin; y <= s->ymax; y++)
        for (int x = s->xmin; x <= s->xmax; x++)
            if (own(view, x, y))
                for (int i = 0; i < RX_NISO && rx_view_value(view->image, at(view, x, y)) > level[i]; i++)
                    s->iso[i]++;
}

static bool saturated(const rx_view *view, int x, int y)
{
    const uint8_t *mask = view->image->saturated;
    return mask != NULL && (mask[at(view, x, y)] & RX_MASK_SATURATED) != 0;
}

static void measure_fwhm(const rx_view *view, rx_source *s)
{
    double lowest = fmax(s->peak / 5.0, s->analysis_threshold);
    double n = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, sxy = 0.0;
    s->fwhm = 0.0;
    if (!(lowest > 0.0))
        return;
    for (int y = s->ymin; y <= s->ymax; y++)
        for (int x = s->xmin; x <= s->xmax; x++) {
            if (!own(view, x, y) || saturated(view, x, y))
                continue;
            double value = rx_view_value(view->image, at(view, x, y)) - view->sky;
            if ((float)value <= (float)lowest)
                continue;
            double r2 = (x - s->x) * (x - s->x) + (y - s->y) * (y - s->y);
            double weight = value * value, log_value = log(value);
            n += weight;
            sx += weight * r2;
            sxx += weight * r2 * r2;
            sy += weight * log_value;
            sxy += weight * log_value * r2;
        }
    double det = n * sxx - sx * sx;
    if (!(fabs(det) > 0.0))
        return;
    double slope = fmax(-(n * sxy - sx * sy) / det, 1.0 / (13.0 * s->a * s->b)); /* FWHM at most 6 sigma */
    s->fwhm = 1.6651 / sqrt(slope);
    s->fwhm -= 1.0 / (4.0 * s->fwhm); /* undersampling */
}

/* What hides the pixel, or hid it on the tile, where the image has an estimate of its light. */
static int mask_bits(const rx_view *view, int x, int y)
{
    const rx_image *image = view->image;
    const size_t k = at(view, x, y);
    const int tile = image->saturated != NULL ? image->saturated[k] & image->hide & ~RX_MASK_SATURATED : 0;
    return image->mask[k] | tile;
}

static bool any_masked(const rx_view *view, const rx_source *s)
{
    rx_box box = {s->xmin - 1, s->xmax + 2, s->ymin - 1, s->ymax + 2};
    rx_view_clip(view, &box);
    int bits = 0;
    for (int y = box.y0; y < box.y1; y++)
        for (int x = box.x0; x < box.x1; x++)
            bits |= mask_bits(view, x, y);
    return bits != 0;
}

/* Weight flags, saturation and masked core from the pixels in and around the segment. */
static void measure_neighbourhood(const rx_view *view, rx_source *s)
{
    const rx_image *image = view->image;
    const bool masked = image->mask != NULL && any_masked(view, s);
    if (!masked && image->saturated == NULL)
        return;
    for (int y = s->ymin; y <= s->ymax; y++)
        for (int x = s->xmin; x <= s->xmax; x++) {
            if (view->sources->segments[at(view, x, y)] != view->segment)
                continue;
            if (saturated(view, x, y))
                s->flags |= RX_FLAG_SATURATED;
            if (!masked)
                continue;
            const int own_bits = mask_bits(view, x, y);
            if ((own_bits & RX_MASK_WEIGHT) != 0)
                s->flags_weight |= RX_FLAGW_ISO;
            if ((own_bits & image->hide) != 0)
                s->flags |= RX_FLAG_APERTURE | RX_FLAG_ISOPHOTAL;
            rx_box box = {x - 1, x + 2, y - 1, y + 2};
            rx_view_clip(view, &box);
            for (int v = box.y0; v < box.y1; v++)
                for (int u = box.x0; u < box.x1; u++) {
                    int bits = mask_bits(view, u, v);
                    if ((bits & RX_MASK_WEIGHT) != 0)
                        s->flags_weight |= RX_FLAGW_NEIGHBOUR;
                    if ((bits & image->hide) == 0)
                        continue;
                    /* a hidden saturated core is in no segment: what touches it belongs to it */
                    if (saturated(view, u, v))
                        s->flags |= RX_FLAG_SATURATED;
                    if (x == s->xpeak && y == s->ypeak)
                        s->flags_measure |= RX_FLAGM_MASKED_CORE;
                }
        }
}

void rx_measure_isophote(const rx_view *view, const rx_measure_params *par, rx_source *s)
{
    measure_flux(view, par, s);
    measure_isocor(s);
    measure_levels(view, s);
    measure_fwhm(view, s);
    measure_neighbourhood(view, s);
}
