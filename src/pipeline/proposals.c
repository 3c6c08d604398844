/* Proposals, and what the likelihood leaves of them. */
#include "pipeline/proposals.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "detect/filter.h"
#include "fit/significance.h"

/* FWHM of the filter over the PSF's: narrower, it separates blends that the matched filter (1) joins; too narrow, it
 * loses faint galaxies. 0.5 and 0.6 beside each other: validation/results/proposals. */
static const double FILTER_WIDTH = 0.6;
static const double LEAST_WIDTH =
    2.0; /* pixels: of default.conv, by which faint galaxies are found where seeing is sharp */

/* How far below its mean signal to noise behind the filter a source at the threshold is still proposed, in units of what
 * scatters around that mean, 0.47 sigma: at 1, 84 % of those at the threshold and 97 % of those half a sigma above, and
 * deeper ones join blends. A restored image has noise of its own, and its sources are separate. Measured: validation/results/proposals. */
static const double MARGIN_PLAIN = 1.0, MARGIN_RESTORED = 2.5;

/* A source of significance T has a mean of 2 r / (1 + r^2) T behind a filter r times as wide as the PSF, 0.88 T of 0.6, and
 * scatters by sqrt(1 - 0.88^2) around it. */
static double proposed_from(double significance, double r, double margin)
{
    const double share = 2.0 * r / (1.0 + r * r);
    const double sigmas = share * significance - margin * sqrt(1.0 - share * share);
    return fmax(sigmas, 1.0); /* below, a sixth of the sky is above, and joined */
}

/* Sigmas of a pixel, of each of significance, where no PSF or no filter says that: 1.5 for the 5 of the default, SExtractor's. */
static const double SIGMAS_WITHOUT_PSF = 0.3;

int rx_proposals_wanted(const rx_pipeline_params *params, const rx_field *field)
{
    return params->detect.filter_auto && field->psf != NULL;
}

void rx_proposals_without_psf(rx_detect_params *par)
{
    par->threshold = SIGMAS_WITHOUT_PSF * par->significance;
    par->filter_auto = 0;
}

rx_status rx_proposals_params(const rx_field *field, int plain, rx_detect_params *par, float **kernel,
                              rx_error *err)
{
    *kernel = NULL;
    if (!(par->significance > 0.0))
        return rx_error_set(err, RX_USAGE, "DETECT_THRESH must be positive");
    if (field->psf == NULL) {
        rx_proposals_without_psf(par);
        return RX_OK;
    }
    if (plain)
        par->min_area = 1;              /* the likelihood decides, not the area */
    if (plain && par->filter == NULL) { /* FILTER N */
        par->threshold = SIGMAS_WITHOUT_PSF * par->significance;
        return RX_OK;
    }
    const double r = plain ? fmax(FILTER_WIDTH, LEAST_WIDTH / field->psf->fwhm) : FILTER_WIDTH;
    if (plain) {
        const double sigma = r * field->psf->fwhm / (2.0 * sqrt(2.0 * M_LN2));
        const int half = (int)ceil(3.0 * sigma), side = 2 * half + 1;
        RX_TRY(RX_MAKE(*kernel, (size_t)(side * side), err));
        for (int i = 0; i < side * side; i++) {
            const double x = i % side - half, y = i / side - half;
            (*kernel)[i] = (float)exp(-0.5 * (x * x + y * y) / (sigma * sigma));
        }
        par->filter = *kernel;
        par->filter_width = par->filter_height = side;
        par->filter_normalise = 1;
    }
    par->threshold = proposed_from(par->significance, r, plain ? MARGIN_PLAIN : MARGIN_RESTORED) *
                     rx_filter_norm(par->filter, par->filter_width * par->filter_height);
    return RX_OK;
}

rx_status rx_proposals_decide(const rx_pipeline_params *params, const rx_field *field, rx_sources *sources,
                              rx_log *log, rx_error *err)
{
    rx_image image = rx_field_effective(field);
    rx_scaled_map short_lags;
    if (rx_noise_is_structure(&field->noise)) {
        /* light of more sources than can be distinguished from noise: as correlated as FILTER_NAME sees it */
        static const float one = 1.0f;
        const rx_detect_params *par = &params->detect;
        const double factor = par->filter != NULL ? rx_noise_factor(&field->noise, par->filter,
                                                                    par->filter_width, par->filter_height)
                                                  : rx_noise_factor(&field->noise, &one, 1, 1);
        image = rx_field_restorable(field);
        image.noise = rx_map_scaled(&short_lags, image.noise, (float)factor);
    }
    const int n = sources->n;
    rx_image_scaled scaled = {0};
    rx_proposal *list = RX_NEW(rx_proposal, (size_t)n + 1);
    unsigned char *keep = RX_NEW(unsigned char, (size_t)n + 1);
    int kept = 0;
    rx_status status = RX_OK;
    if (list == NULL || keep == NULL || !rx_image_in_unit(&image, &scaled))
        RX_TRY_EXIT(rx_error_memory(err, (size_t)n * sizeof *list));
    for (int i = 0; i < n; i++)
        list[i] = (rx_proposal){
            .x = sources->list[i].x, .y = sources->list[i].y, .sure = sources->list[i].untouched > 0};
    RX_TRY_EXIT(rx_significance(&scaled.image, params->detect.significance, params->nthreads, n, list, err));
    for (int i = 0; i < n; i++) {
        if (isfinite(list[i].lambda) && !list[i].sure)
            sources->list[i].detection_snr = list[i].lambda;
        keep[i] = (unsigned char)list[i].kept;
        kept += list[i].kept;
    }
    rx_log_detail(log, "%s[%d]: %d of %d proposed sources have a significance of %g or more", image.name,
                  image.hdu, kept, n, params->detect.significance);
    status = rx_sources_select(sources, keep, err);
exit:
    rx_image_scaled_clear(&scaled);
    free(list);
    free(keep);
    return status;
}
