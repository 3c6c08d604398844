/* What is injected, where, and how bright. */
#include "check/selfcheck_plan.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "check/quality.h"
#include "measure/view.h"
#include "simulate/inject.h"
#include "simulate/scene.h"

/* 3 mag brighter to 1.5 mag fainter than the limit: from certain to hopeless. */
static const double BRIGHTER = 3.0, FAINTER = 1.5;
enum { PER_BIN = 50, FEWEST_BINS = 3, MOST_BINS = 18 };

/* Options of the rounds: what the numbers need is measured, what no one reads is not. The wide aperture is
 * the last one. */
static void own_params(const rx_pipeline_params *params, const rx_check_params *check, double diameter,
                       rx_pipeline_params *dst)
{
    static const unsigned needed[] = {[RX_QUALITY_AUTO] = RX_SKIP_AUTO,
                                      [RX_QUALITY_APER] = RX_SKIP_APER,
                                      [RX_QUALITY_PETRO] = RX_SKIP_PETRO,
                                      [RX_QUALITY_WIN] = RX_SKIP_WIN};
    rx_measure_params *par = &dst->measure;
    *dst = *params;
    if ((size_t)check->quality.flux < sizeof needed / sizeof needed[0])
        par->skip &= ~needed[check->quality.flux];
    par->skip &= ~(unsigned)RX_SKIP_APER;
    if (par->naper == RX_MAX_APERTURES)
        par->naper--;
    par->aperture_diameter[par->naper++] = diameter;
    par->star_net = NULL;
    par->vignet_width = par->vignet_height = 0;
    dst->restore.keep_reblurred = 0;
    dst->examine_residual = 0;
    dst->restore.keep_support = 0;
    dst->templates.wanted = check->templates;
}

static void choose_magnitudes(rx_selfcheck_plan *plan)
{
    const rx_tile *tile = plan->field->tile;
    const double area =
        rx_psf_noise_area(plan->field->psf, 0.5 * (tile->width - 1), 0.5 * (tile->height - 1));
    double flux = 5.0 * plan->field->restored->global_sigma * plan->field->noise_factor * sqrt(area);
    plan->limit = tile->zeropoint - 2.5 * log10(flux);
    plan->mag_low = plan->par->mag[0];
    plan->mag_high = plan->par->mag[1];
    if (!(plan->mag_low < plan->mag_high)) {
        plan->mag_low = plan->limit - BRIGHTER;
        plan->mag_high = plan->limit + FAINTER;
    }
    double bins = floor((double)plan->count / PER_BIN);
    bins = bins < FEWEST_BINS ? FEWEST_BINS : bins > MOST_BINS ? MOST_BINS : bins;
    plan->mag_step = (plan->mag_high - plan->mag_low) / bins;
}

static rx_status choose_places(rx_selfcheck_plan *plan, rx_error *err)
{
    const rx_tile *tile = plan->field->tile;
    size_t n = (size_t)tile->width * (size_t)tile->height, good = 0;
    RX_TRY(RX_MAKE(plan->allowed, n, err));
    RX_TRY(rx_inject_allowed(tile->width, tile->height, NULL, tile->mask, 0.0, plan->allowed, err));
    for (size_t i = 0; i < n; i++)
        good += plan->allowed[i] != 0;
    plan->per_round = (long)ceil(plan->par->density * (double)n / 1e6);
    return good > 0 ? RX_OK
                    : rx_error_at(err, RX_INPUT, tile->name, tile->hdu, 0,
                                  "self check: no pixel is left to put an object on; leave out SELF_CHECK");
}

double rx_selfcheck_enclosed(const rx_psf *psf, double x, double y, double diameter, float *stamp)
{
    double inside = 0.0, all = 0.0;
    const int half = psf->size / 2;
    rx_psf_at(psf, x, y, stamp);
    for (int j = 0; j < psf->size; j++) {
        for (int i = 0; i < psf->size; i++) {
            double value = stamp[(size_t)j * (size_t)psf->size + (size_t)i];
            all += value;
            inside += value * rx_pixel_in_circle((float)(i - half), (float)(j - half), 0.5 * diameter, 5);
        }
    }
    return all != 0.0 ? inside / all : 1.0;
}

/* Half-light radius of the PSF at the middle of the tile, pixels. */
static rx_status psf_radius(const rx_field *field, double *radius, rx_error *err)
{
    const rx_psf *psf = field->psf;
    const double x = 0.5 * (field->tile->width - 1), y = 0.5 * (field->tile->height - 1);
    float *stamp;
    RX_TRY(RX_MAKE(stamp, (size_t)psf->size * (size_t)psf->size, err));
    double low = 0.0, high = 0.5 * psf->size;
    for (int i = 0; i < 30; i++) {
        *radius = 0.5 * (low + high);
        if (rx_selfcheck_enclosed(psf, x, y, 2.0 * *radius, stamp) < 0.5)
            low = *radius;
        else
            high = *radius;
    }
    free(stamp);
    return RX_OK;
}

/* P(X > t) of a standard normal X. */
static double beyond(double t)
{
    return 0.5 * erfc(t / sqrt(2.0));
}

/* Mean excess of a standard normal X beyond t, where X > t: its density over beyond(). */
static double hazard(double t)
{
    return t < 30.0 ? exp(-0.5 * t * t) / sqrt(2.0 * acos(-1.0)) / beyond(t) : t;
}

/* Share and sizes of galaxies as the tile's resolved sources have them (selfcheck.h). */
static rx_status choose_galaxies(const rx_sources *sources, rx_selfcheck_plan *plan, rx_error *err)
{
    enum { FEWEST = 10 };
    static const double RESOLVED = 1.2, LEAST_SNR = 10.0;
    const double faintest = plan->limit - 2.5; /* where large galaxies are measured as well as points */
    /* half-light radius along the major axis over that of a circle, for the ratios b/a of simulate/ */
    static const double MAJOR = 1.39;
    const double zeropoint = plan->field->tile->zeropoint;
    double point = 0.0, all = 0.0, galaxies = 0.0;
    double *size, *limit;
    RX_TRY(psf_radius(plan->field, &point, err));
    RX_TRY(RX_MAKE(size, 2 * (size_t)sources->n, err));
    limit = size + sources->n;
    for (int i = 0; i < sources->n && sources->nradii > 0; i++) {
        const rx_source *s = &sources->list[i];
        const double radius = s->flux_radius[0], mag = zeropoint - 2.5 * log10(s->flux_auto);
        if ((s->flags & ~1) != 0 || !(radius > 0.0) || !(mag < faintest) ||
            !(s->flux_auto > LEAST_SNR * s->fluxerr_auto))
            continue;
        all++;
        if (radius < RESOLVED * point)
            continue;
        const double law = log(rx_population_radius(mag, 0.0) / plan->pixel_scale);
        size[plan->resolved] = 0.5 * log(radius * radius - point * point) - law;
        limit[plan->resolved++] = log(point * sqrt(RESOLVED * RESOLVED - 1.0)) - law;
    }
    plan->galaxy_scale = 1.0;
    plan->galaxies = fmax(0.0, plan->par->galaxies);
    if (plan->resolved < FEWEST) {
        plan->resolved = 0;
        free(size);
        return RX_OK;
    }
    double low = size[0], high = size[0], median = 0.0;
    for (long i = 0; i < plan->resolved; i++) {
        low = fmin(low, size[i] - 5.0);
        high = fmax(high, size[i]);
    }
    for (int step = 0; step < 50; step++) {
        double slope = 0.0;
        median = 0.5 * (low + high);
        for (long i = 0; i < plan->resolved; i++)
            slope += (size[i] - median) / RX_POPULATION_SCATTER -
                     hazard((limit[i] - median) / RX_POPULATION_SCATTER);
        if (slope > 0.0)
            low = median;
        else
            high = median;
    }
    for (long i = 0; i < plan->resolved; i++)
        galaxies += 1.0 / fmax(beyond((limit[i] - median) / RX_POPULATION_SCATTER), 0.1);
    plan->galaxy_scale = MAJOR * exp(median);
    if (plan->par->galaxies < 0.0)
        plan->galaxies = fmin(galaxies / all, 1.0);
    free(size);
    return RX_OK;
}

rx_status rx_selfcheck_plan_new(const rx_pipeline_params *params, const rx_check_params *par,
                                const rx_field *field, const rx_sources *sources, rx_selfcheck_plan **dst,
                                rx_error *err)
{
    rx_selfcheck_plan *plan;
    RX_TRY(RX_MAKE(plan, 1, err));
    plan->field = field;
    plan->par = par;
    plan->segments = sources->segments;
    plan->diameter = fmax(10.0, 5.0 * field->psf->fwhm);
    plan->distance = 1.5 * plan->diameter;
    plan->count = par->count;
    plan->pixel_scale = field->tile->wcs != NULL ? rx_quality_scale(field->tile) : params->stated_scale;
    if (!(plan->pixel_scale > 0.0))
        plan->pixel_scale = 1.0;
    own_params(params, par, plan->diameter, &plan->params);
    plan->apertures = plan->params;
    plan->apertures.templates.wanted = 0;
    plan->apertures.measure.skip = RX_SKIP_AUTO | RX_SKIP_PETRO | RX_SKIP_RADIUS | RX_SKIP_WIN;
    plan->apertures.measure.naper = 1;
    plan->apertures.measure.aperture_diameter[0] = plan->diameter;
    plan->apertures.calibrate_none = plan->apertures.calibrate_restored = 0;
    rx_status status;
    RX_TRY_EXIT(rx_quality_radius(&par->quality, field->tile, &plan->match_radius, err));
    choose_magnitudes(plan);
    RX_TRY_EXIT(choose_places(plan, err));
    RX_TRY_EXIT(choose_galaxies(sources, plan, err));
    RX_TRY_EXIT(rx_optics_psf(field->psf, &plan->optics, err));
    status = rx_domain_noise(field, plan->params.nthreads, &plan->model_noise, err);
exit:
    if (status == RX_OK)
        *dst = plan;
    else
        rx_selfcheck_plan_free(plan);
    return status;
}

void rx_selfcheck_plan_free(rx_selfcheck_plan *plan)
{
    if (plan == NULL)
        return;
    rx_optics_free(plan->optics);
    free(plan->allowed);
    free(plan);
}
