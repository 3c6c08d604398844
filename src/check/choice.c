/* Whether the tile's model accepts a restorer. */
#include "check/choice.h"

#include <stdio.h>

#include "pipeline/domain.h"
#include "pipeline/residual.h"

/* FWHM of the PSF, pixels: 0.9 of the network's output (pipeline/domain.c). Where it is 1.5 Richardson-Lucy finds 409 stars and galaxies,
 * the pixels as they are 416 (validation/auto.py, seed 81). */
static const double SAMPLED = 1.8;

rx_status rx_choice_before(const rx_pipeline_params *params, const rx_field *field, int i,
                           const rx_restorer **kind, char why[200], rx_error *err)
{
    static const char *const names[RX_CHOICE_CANDIDATES] = {"NET", "RL", "NONE"};
    const char *unknown = field->psf == NULL ? "PSF" : field->plain->constant ? "noise" : NULL;
    rx_restore_params par = params->restore;
    rx_domain domain;
    why[0] = '\0';
    *kind = rx_restorer_find(names[i]);
    if (((*kind)->traits & RX_TRAIT_PLAIN) != 0)
        return RX_OK;
    if (unknown != NULL) {
        snprintf(why, 200, "the %s is not known", unknown);
        return RX_OK;
    }
    if (field->psf->fwhm < SAMPLED) {
        snprintf(why, 200, "FWHM %.4g pixels is below %g", field->psf->fwhm, SAMPLED);
        return RX_OK;
    }
    if (((*kind)->traits & RX_TRAIT_TRAINED) == 0)
        return RX_OK;
    if (par.model == NULL) {
        snprintf(why, 200, "there is no model");
        return RX_OK;
    }
    const rx_restorer *done = *kind;
    par.out_of_domain = RX_DOMAIN_RL;
    RX_TRY(rx_domain_obey(&par, field, NULL, &done, &domain, err));
    if (done != *kind)
        snprintf(why, 200, "%s", domain.why);
    return RX_OK;
}

void rx_choice_after(const rx_result *result, char why[200])
{
    const rx_fluxcheck *flux = &result->photometry.check;
    const rx_residual *residual = &result->residual;
    why[0] = '\0';
    if (result->plain)
        return;
    if (rx_fluxcheck_is_off(flux))
        snprintf(why, 200, "its flux scale is off: restored/untouched %.4f +- %.4f, FLUX_AUTO %.3f +- %.3f",
                 flux->wide, flux->wide_error, flux->automatic, flux->automatic_error);
    else if (rx_residual_is_large(residual->share))
        snprintf(why, 200, "the restored image does not explain %.0f %% of the pixels",
                 100.0 * residual->share);
    else if (rx_result_is_dark(result))
        snprintf(why, 200, "%.0f %% of the tile lies below the sky, which it was not trained for",
                 100.0 * residual->dark);
}
