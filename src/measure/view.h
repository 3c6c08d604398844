/* The image as one source sees it: neighbours and masked pixels hidden, or replaced by the pixel
 * mirrored at the centre (MASK_TYPE CORRECT); and what is measured on it, a file for each kind. */
#ifndef RX_MEASURE_VIEW_H
#define RX_MEASURE_VIEW_H

#include <stdbool.h>

#include "measure/measure.h"

typedef struct rx_view {
    const rx_image *image;
    const rx_image *radii; /* that radii are measured on */
    int weight_gain;       /* of rx_measure_params */
    const rx_sources *sources;
    rx_mask_type neighbours;
    int32_t segment; /* the source's own */
    double sky;      /* local background above the subtracted one, ADU (BACKPHOTO LOCAL) */
} rx_view;

typedef enum rx_seen { RX_SEEN_GOOD, RX_SEEN_NEIGHBOUR, RX_SEEN_MASKED } rx_seen;

/* These two are asked for every pixel of every aperture: inline. */

/* What the pixel is; inside the image only. */
static inline rx_seen rx_view_state(const rx_view *view, int x, int y)
{
    const rx_image *image = view->image;
    size_t k = (size_t)y * (size_t)image->width + (size_t)x;
    if (rx_image_hides(image, k))
        return RX_SEEN_MASKED;
    if (view->neighbours == RX_NEIGHBOURS_NONE)
        return RX_SEEN_GOOD;
    int fragment = view->sources->fragments != NULL ? view->sources->fragments[k] : 0;
    if (fragment == RX_FRAGMENT_EATEN)
        return RX_SEEN_GOOD;
    int32_t segment = view->sources->segments[k];
    bool other = segment != 0 && segment != view->segment;
    return other || fragment == RX_FRAGMENT_SMALL ? RX_SEEN_NEIGHBOUR : RX_SEEN_GOOD;
}

/* rx_view_value() of pixels with sky: 0 where one is hidden. */
float rx_view_above_sky(const rx_image *image, size_t k);

/* Pixel k, ADU above the sky. */
static inline float rx_view_value(const rx_image *image, size_t k)
{
    return image->with_sky ? rx_view_above_sky(image, k) : image->pixels[k];
}

static inline double rx_view_variance(const rx_image *image, size_t k)
{
    double sigma = image->variable_noise ? image->noise.plane[k] : image->global_noise;
    return sigma * sigma;
}

/* Value (ADU) and noise variance of a pixel for sums about (cx, cy); returns what the pixel itself is.
 * Hidden: the mirrored pixel where that is good, else value 0 (and variance 0 with a weight map,
 * where SExtractor knows the pixel says nothing). */
static inline rx_seen rx_view_pixel(const rx_view *view, int x, int y, double cx, double cy, double *value,
                                    double *variance)
{
    const rx_image *image = view->image;
    rx_seen state = rx_view_state(view, x, y);
    if (state != RX_SEEN_GOOD) {
        int mx = (int)(2.0 * cx + 0.49999 - x), my = (int)(2.0 * cy + 0.49999 - y);
        bool mirrored = view->neighbours == RX_NEIGHBOURS_CORRECT && mx >= 0 && mx < image->width &&
                        my >= 0 && my < image->height && rx_view_state(view, mx, my) == RX_SEEN_GOOD;
        if (!mirrored) {
            *value = 0.0;
            *variance = image->variable_noise ? 0.0 : image->global_noise * image->global_noise;
            return state;
        }
        x = mx;
        y = my;
    }
    size_t k = (size_t)y * (size_t)image->width + (size_t)x;
    *value = rx_view_value(image, k);
    *variance = rx_view_variance(image, k);
    return state;
}

/* Factor on the sigma of a sum over `area` pixels, against independent pixels (noise law). */
double rx_view_noise_factor(const rx_view *view, double area);

/* Inclusive-exclusive pixel box clipped to the image; true when something was cut off. */
typedef struct rx_box {
    int x0, x1, y0, y1;
} rx_box;
bool rx_view_clip(const rx_view *view, rx_box *box);

/* The same for the box around a circle, SExtractor's rounding; any radius. */
bool rx_view_circle_box(const rx_view *view, double x, double y, double radius, rx_box *box);

/* --- isophote.c: what the pixels of a source's own segment hold --- */

/* Fills isoarea, flux_iso, flux_isocor and errors, peak, iso[], fwhm, analysis_threshold, flags_weight
 * and the flags SATURATED and MASKED_CORE.
 *
 * FLUX_ISOCOR: Maddox et al. 1990 as in SExtractor's manual, 1 - 0.196099 t - 0.751208 t^2 with
 * t = area * threshold / flux. FWHM: Gaussian core, log I against r^2 weighted by I^2 over pixels
 * above a fifth of the peak. */
void rx_measure_isophote(const rx_view *view, const rx_measure_params *par, rx_source *s);

/* --- aperture.c: sums in circles and ellipses --- */

/* A sum: flux (ADU, local sky subtracted) and its error; pixels whose centre is inside. */
typedef struct rx_sum {
    double flux, error;
    double area;    /* pixels, shares counted */
    int pixels;     /* whole pixels looked at */
    int hidden;     /* of these, neighbours or masked */
    int masked;     /* of these, masked */
    bool truncated; /* the aperture leaves the image */
} rx_sum;

/* Share of pixel (dx, dy off the centre) inside a circle: `oversampling`^2 samples near the rim. */
double rx_pixel_in_circle(float dx, float dy, float radius, int oversampling);

/* MAG_APER: 5 x 5 samples in rim pixels. */
void rx_sum_circle(const rx_view *view, double x, double y, double radius, rx_sum *sum);

/* FLUX_AUTO (Kron 1980): radius factor * sum(r I) / sum(I) within 6 rms ellipses, at least
 * auto_min_radius, in units of A and B. Fills flux_auto, fluxerr_auto, kron_radius (factor included,
 * 0 where the circle of PHOT_AUTOAPERS was used or the flux is not positive), masked_fraction, flags. */
void rx_measure_auto(const rx_view *view, const rx_measure_params *par, rx_source *s);

/* FLUX_PETRO (Petrosian 1976): radius where the local surface brightness falls to 0.2 of the mean inside. */
void rx_measure_petro(const rx_view *view, const rx_measure_params *par, rx_source *s);

/* --- growth.c --- */

/* Fills flux_radius (pixels) for the shares in par; sets RX_FLAGM_RADIUS_FAILED when the flux is not
 * positive. Returns the half-light radius, at least 0.5 pixel, that windowed measurements start from. */
double rx_measure_radii(const rx_view *view, const rx_measure_params *par, rx_source *s);

/* --- window.c: a Gaussian of the half-light radius iterated onto the source --- */

/* Fills xwin .. snr_win, niter_win, flags_win (SExtractor's bits; RX_FLAGWIN_AWAY: more than a
 * pixel in x and y and an rms ellipse away). `half_light` in pixels:
 * sigma = 2 half_light / 2.35, sums within 4 sigma. Each step moves by twice the offset of the windowed
 * barycentre (exact for a Gaussian). Any of these: the isophotal position, moments and errors, and
 * RX_FLAGM_WIN_FAILED. */
void rx_measure_window(const rx_view *view, double half_light, rx_source *s);

#endif
