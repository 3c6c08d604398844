/* First guesses and last words. */
#include "template/fit_sources.h"

#include <math.h>

#include "base/constants.h"
#include "template/patch.h"

static const double CUT = 1.3; /* what a segment's threshold cuts off an exponential's rms radius, roughly */
static const double RESOLVED = 0.5; /* pixels: smaller guesses start as points */

/* Second moments of the segment less those of the PSF that it was found behind. */
static void guess_shape(const rx_source *s, double fwhm, rx_fit_source *source)
{
    const double blur = fwhm / RX_FWHM_SIGMA;
    const double a2 = fmax(s->a * s->a - blur * blur, 0), b2 = fmax(s->b * s->b - blur * blur, 0);
    source->guess = CUT * (RX_FWHM_SIGMA / 2) * pow(a2 * b2, 0.25);
    if (!isfinite(source->guess) || !(source->guess > RESOLVED))
        return;
    const double q = fmax(sqrt(b2 / a2), 0.3), g = (1 - q) / (1 + q);
    source->profile = (rx_spergel){source->guess, g * cos(2 * s->theta), g * sin(2 * s->theta), 0.5, NULL};
    source->kind = RX_TPHOT_PROFILE;
    source->point = 0;
}

static double segment_flux(const rx_tphot_input *input, const rx_source *s)
{
    const uint8_t *hidden = input->shape_mask;
    double sum = 0;
    for (int y = s->ymin; y <= s->ymax; y++)
        for (int x = s->xmin; x <= s->xmax; x++) {
            const size_t k = (size_t)y * (size_t)input->image.width + (size_t)x;
            if (input->sources->segments[k] == s->segment && input->restored->mask[k] == 0 &&
                (hidden == NULL || (hidden[k] & input->shape_bits) == 0))
                sum += input->restored->pixels[k];
        }
    return isfinite(sum) && sum > 0 ? sum : 0;
}

static void keep_shape(const rx_tphot_source *from, rx_fit_source *source)
{
    const double g = (1 - from->ratio) / (1 + from->ratio);
    source->x = from->x;
    source->y = from->y;
    source->kind = from->kind;
    source->profile = (rx_spergel){.nu = from->index};
    if (from->kind != RX_TPHOT_POINT)
        source->profile =
            (rx_spergel){from->radius, g * cos(2 * from->angle), g * sin(2 * from->angle), from->index, NULL};
    source->star = from->star;
    source->two = from->two;
    source->point = from->point;
    source->shape_error = from->shape_error;
    source->lift = from->lift;
    source->chi2_gain = from->chi2_gain;
    source->movable = from->movable;
}

void rx_fit_sources_start(const rx_tphot_params *par, const rx_tphot_input *input, rx_fit_source *sources)
{
    const rx_psf *psf = input->restored->psf != NULL ? input->restored->psf : input->image.psf;
    for (int i = 0; i < input->sources->n; i++) {
        const rx_source *s = &input->sources->list[i];
        rx_fit_source *source = &sources[i];
        *source = rx_fit_source_added(s->x, s->y, -1);
        source->flags = 0;
        source->movable = 1;
        source->segment = s->segment;
        source->untouched = s->untouched;
        source->xmin = s->xmin;
        source->xmax = s->xmax;
        source->ymin = s->ymin;
        source->ymax = s->ymax;
        if (par->extended)
            guess_shape(s, s->untouched ? input->image.psf->fwhm : psf->fwhm, source);
        if (input->shapes != NULL)
            keep_shape(&input->shapes->list[i], source);
        if (!isfinite(source->guess))
            source->guess = 0;
        source->x0 = source->x;
        source->y0 = source->y;
        source->flux = segment_flux(input, s);
    }
}

rx_fit_source rx_fit_source_added(double x, double y, int added)
{
    return (rx_fit_source){.kind = RX_TPHOT_POINT,
                           .x = x,
                           .y = y,
                           .x0 = x,
                           .y0 = y,
                           .profile = {.nu = 0.5},
                           .star = 1,
                           .two = NAN,
                           .point = 1,
                           .shape_error = 1,
                           .lift = 1,
                           .grain = 1,
                           .added = added,
                           .flags = RX_TPHOT_EXTRA};
}

/* Reduced chi2 of the pixels of the segment and of the free ones where the template is bright; the share of
 * the template under the mask. */
static void judge_pixels(const rx_fit_image *image, const int32_t *segments, const rx_fit_source *s,
                         double background, rx_tphot_source *dst)
{
    static const double bright = 0.1;
    const rx_footprint *f = &s->footprint;
    const double peak = rx_footprint_peak(f);
    double chi2 = 0;
    for (int j = 0; j < f->height; j++)
        for (int i = 0; i < f->width; i++) {
            const size_t k = rx_fit_image_row(image, f->y0 + j) + (size_t)(f->x0 + i);
            const int32_t owner = segments[(size_t)(f->y0 + j) * (size_t)image->width + (size_t)(f->x0 + i)];
            const double t = f->values[(size_t)j * (size_t)f->width + (size_t)i], w = image->weight[k];
            if (!(w > 0)) {
                dst->masked += t;
                continue;
            }
            if ((owner != 0 || t < bright * peak) && (s->segment == 0 || owner != s->segment))
                continue;
            const double r = (double)image->data[k] - image->model[k] - background;
            chi2 += w * r * r;
            dst->npixels++;
        }
    const int fitted = 3 + (s->kind != RX_TPHOT_POINT ? 4 : 0), left = dst->npixels - fitted;
    dst->chi2 = left > 0 ? chi2 / left : NAN;
}

/* Where the position is free, the flux is that of the highest point of a noisy hill: too high by half of
 * error^2 / flux for each of the positions that the data decide (second order of the likelihood). */
static double climb(double flux, double error, double gain)
{
    if (!(flux > 0))
        return 0;
    return fmin(0.5 * gain * error * error / flux, 0.5 * error);
}

void rx_fit_source_result(const rx_fit_image *image, const int32_t *segments, const rx_fit_source *s,
                          const rx_joint_member *member, double background, rx_tphot_source *dst)
{
    const double error = sqrt(member->variance), g = hypot(s->profile.g1, s->profile.g2);
    dst->kind = s->kind;
    dst->x = s->x;
    dst->y = s->y;
    dst->flux = s->lift * (s->flux - climb(s->flux, sqrt(member->alone), s->position_gain));
    dst->fluxerr = hypot(error * s->shape_error, sqrt(s->structure));
    dst->snr = dst->flux / dst->fluxerr;
    dst->star = s->star;
    dst->two = s->two;
    dst->point = s->point;
    dst->chi2_gain = s->chi2_gain;
    dst->radius = s->kind != RX_TPHOT_POINT ? s->profile.radius : 0;
    dst->ratio = (1 - g) / (1 + g);
    dst->angle = g > 0 ? 0.5 * atan2(s->profile.g2, s->profile.g1) : 0;
    dst->index = s->profile.nu;
    dst->shape_error = s->shape_error;
    dst->lift = s->lift;
    dst->evidence = s->presence;
    dst->inside = s->footprint.inside;
    dst->background = background;
    judge_pixels(image, segments, s, background, dst);
    dst->flags |= s->flags;
    if (dst->inside < 0.99)
        dst->flags |= RX_TPHOT_BORDER;
    if (dst->masked > 0.1)
        dst->flags |= RX_TPHOT_MASKED;
}
