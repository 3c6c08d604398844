/* Sources against their brighter neighbours. */
#include "template/evidence.h"

#include <math.h>

#include "base/min_max.h"
#include "template/patch.h"

static const double OVERLAP = 0.3, BLEND = 0.2;
static const double LUMPS = 0.3; /* of a large galaxy's light, on the scale of a source */

/* The brighter member with most light under the template of i; -1: none. *light: in units of i's flux. */
static int brightest_over(const rx_fit_source *sources, const int *member, int n, int i, double *light)
{
    const rx_fit_source *one = &sources[member[i]];
    const double power = rx_footprint_product(&one->footprint, &one->footprint, NULL);
    int found = -1;
    *light = 0;
    for (int j = 0; j < n && power > 0; j++) {
        const rx_fit_source *other = &sources[member[j]];
        if (j == i || !(other->flux > one->flux))
            continue;
        const double under =
            other->flux / one->flux * rx_footprint_product(&one->footprint, &other->footprint, NULL) / power;
        if (under > *light) {
            *light = under;
            found = j;
        }
    }
    return found;
}

rx_fit_neighbour rx_evidence_neighbour(const rx_fit_source *sources, const rx_joint_member *members,
                                       const int *member, int n, int i)
{
    const double flux = sources[member[i]].flux, variance = members[member[i]].variance;
    rx_fit_neighbour rival = {.one = member[i], .other = -1};
    rival.alone = flux > 0 && variance > 0 ? flux * flux / variance : 0;
    if (!(rival.alone > 0))
        return rival;
    const int j = brightest_over(sources, member, n, i, &rival.light);
    if (j >= 0 && (rival.light >= OVERLAP || members[member[i]].blend >= BLEND))
        rival.other = member[j];
    return rival;
}

/* By what flux^2 / variance rises where the variance is that of a flux of 0: photons that a source itself claims do not hide it.
 * What they take of the weights under its template. */
static double without_own_photons(const rx_fit_image *c, const rx_fit_source *s)
{
    const rx_footprint *f = &s->footprint;
    double with = 0, without = 0;
    for (int v = 0; v < f->height; v++)
        for (int u = 0; u < f->width; u++) {
            const size_t k = rx_fit_image_row(c, f->y0 + v) + (size_t)(f->x0 + u);
            const double t = (double)f->values[(size_t)v * (size_t)f->width + (size_t)u],
                         power = t * t * (double)c->weight[k];
            with += power;
            without += power > 0 ? power * rx_fit_image_quiet(c, k, s->flux * t) : 0;
        }
    return with > 0 ? without / with : 1;
}

/* The share of photons in the noise of the sky there. A sky that was taken off before the tile was written says nothing of that: all. */
static double sky_photons(const rx_fit_image *c, const rx_fit_source *s)
{
    const rx_image *image = &c->input->image;
    const int x = rx_min_int(rx_max_int((int)lround(s->x), 0), image->width - 1),
              y = rx_min_int(rx_max_int((int)lround(s->y), 0), image->height - 1);
    const double level = rx_map_given(&image->level) ? (double)rx_map_at(&image->level, x, y) : 0,
                 variance = (double)rx_fit_image_variance(c, x, y) * s->grain * s->grain;
    return level > 0 && variance > 0 ? fmin(level / (c->gain * variance), 1) : 1;
}

/* Few photons come together by chance more often than a normal distribution says, so a peak of them is less evidence: of
 * its footprint 2 sum (b + f) ln (1 + f / b) - f for sum f^2 / b, with f photons of the source on b. */
static double of_few_photons(const rx_fit_image *c, const rx_fit_source *s)
{
    const rx_footprint *f = &s->footprint;
    double rise = 0, normal = 0;
    for (int v = 0; v < f->height && c->gain > 0; v++)
        for (int u = 0; u < f->width; u++) {
            const size_t k = rx_fit_image_row(c, f->y0 + v) + (size_t)(f->x0 + u);
            const double light = s->flux * (double)f->values[(size_t)v * (size_t)f->width + (size_t)u],
                         photons = light * c->gain;
            if (!(c->weight[k] > 0) || !(light > 0))
                continue;
            const double variance =
                             s->grain * s->grain / ((double)c->weight[k] * rx_fit_image_quiet(c, k, light)),
                         below = variance * c->gain * c->gain;
            rise += 2 * ((below + photons) * log1p(photons / below) - photons);
            normal += photons * photons / below;
        }
    return normal > 0 ? 1 - sky_photons(c, s) * (1 - rise / normal) : 1;
}

double rx_evidence_lumps(const rx_fit_source *source, double fwhm)
{
    const double r2 = source->profile.radius * source->profile.radius;
    return source->kind == RX_TPHOT_POINT ? 0 : LUMPS * r2 / (r2 + fwhm * fwhm);
}

/* What the rival leaves of it. */
static rx_status beside_rival(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *otf,
                              const rx_fit_source *sources, const rx_fit_neighbour *rival, double *evidence,
                              rx_error *err)
{
    double rise = 0;
    const rx_fit_source *other = &sources[rival->other];
    RX_TRY(rx_refine_alone(par, view, otf, other, &sources[rival->one], &rise, err));
    if (!isfinite(rise))
        return RX_OK;
    const double lumps = (1 - other->point) * rx_evidence_lumps(other, view->fwhm) * rival->light;
    *evidence = 1 / (1 / fmin(*evidence, fmax(rise, 1e-3)) + lumps * lumps);
    return RX_OK;
}

rx_status rx_evidence_of(const rx_refine_params *par, const rx_refine_view *view, rx_template_otf *otf,
                         const rx_fit_source *sources, const rx_fit_neighbour *rival, double *evidence,
                         rx_error *err)
{
    const double flux = sources[rival->one].flux;
    const rx_fit_source *one = &sources[rival->one];
    *evidence = rival->alone * without_own_photons(view->image, one) * of_few_photons(view->image, one);
    if (rival->other >= 0)
        RX_TRY(beside_rival(par, view, otf, sources, rival, evidence, err));
    if (!(*evidence > 0))
        return RX_OK;
    *evidence = 1 / (1 / *evidence + sources[rival->one].structure / (flux * flux));
    return RX_OK;
}
