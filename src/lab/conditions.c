/* Conditions of a campaign's tiles. */
#include "lab/conditions.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

rx_status rx_conditions_make(const rx_campaign_config *config, int *n, rx_condition **dst, rx_error *err)
{
    const rx_reals *lists[] = {&config->psf_error, &config->sky_error, &config->noise_error};
    const int nfwhm = config->seeing.n > 0 ? config->seeing.n : 1;
    const size_t most = (size_t)nfwhm * (size_t)(1 + lists[0]->n + lists[1]->n + lists[2]->n);
    *n = 0;
    RX_TRY(RX_MAKE(*dst, most, err));
    for (int f = 0; f < nfwhm; f++) {
        const rx_condition truth = {.fwhm = config->seeing.n > 0 ? config->seeing.v[f] : 0.0};
        (*dst)[(*n)++] = truth;
        for (int which = 0; which < 3; which++)
            for (int i = 0; i < lists[which]->n; i++) {
                rx_condition given = truth;
                *(double *[]){&given.psf_error, &given.sky_error, &given.noise_error}[which] =
                    lists[which]->v[i];
                if (lists[which]->v[i] != 0.0)
                    (*dst)[(*n)++] = given;
            }
    }
    return RX_OK;
}

int rx_condition_true(const rx_condition *c)
{
    return c->psf_error == 0.0 && c->sky_error == 0.0 && c->noise_error == 0.0;
}

void rx_condition_name(const rx_condition *c, char *dst, size_t size)
{
    char fwhm[32] = "", error[64] = "";
    if (c->fwhm > 0)
        snprintf(fwhm, sizeof fwhm, "FWHM %g", c->fwhm);
    if (c->psf_error != 0.0)
        snprintf(error, sizeof error, "PSF %+g %%", 100 * c->psf_error);
    else if (c->sky_error != 0.0)
        snprintf(error, sizeof error, "sky %+g sigma", c->sky_error);
    else if (c->noise_error != 0.0)
        snprintf(error, sizeof error, "noise %+g %%", 100 * c->noise_error);
    snprintf(dst, size, "%s%s%s", fwhm, fwhm[0] != '\0' && error[0] != '\0' ? ", " : "", error);
}

rx_status rx_condition_simulation(const rx_condition *c, const rx_simulate_config *sim, rx_log *log,
                                  rx_simulation **dst, rx_error *err)
{
    rx_simulate_config *own = NULL;
    char fwhm[40];
    if (sim->inject_image[0] != '\0')
        return rx_error_set(
            err, RX_USAGE, "SIM.INJECT_IMAGE has no place in a campaign; give FIELDS INJECTED and TILE_NAME");
    if ((c->fwhm > 0 || c->psf_error != 0.0) && strcmp(sim->psf_type, "MOFFAT") != 0)
        return rx_error_set(err, RX_USAGE,
                            "SIM.PSF_TYPE %s has no FWHM that SEEING or PSF_ERROR could change; give MOFFAT",
                            sim->psf_type);
    snprintf(fwhm, sizeof fwhm, "%.17g", c->fwhm);
    rx_status status = rx_simulate_config_copy(sim, &own, err);
    if (status == RX_OK && c->fwhm > 0)
        status = rx_settings_set(&own->settings, "PSF_FWHM", fwhm, log, err);
    if (status == RX_OK)
        status = rx_simulation_from_config(own, log, dst, err);
    if (status == RX_OK)
        (*dst)->nthreads = 1;
    rx_simulate_config_free(own);
    return status;
}

rx_status rx_condition_psf(const rx_condition *c, const rx_simulate_config *sim,
                           const rx_simulation *simulation, rx_psf **dst, rx_error *err)
{
    rx_optics *given = NULL;
    if (c->psf_error == 0.0)
        return rx_optics_on_pixels(simulation->optics, dst, err);
    rx_status status = rx_optics_moffat(
        &(rx_moffat_profile){(c->fwhm > 0 ? c->fwhm : sim->psf_fwhm) * (1 + c->psf_error), sim->psf_beta,
                             sim->psf_ratio, sim->psf_angle * M_PI / 180.0, sim->psf_variation},
        simulation->scene.width, simulation->scene.height, &given, err);
    if (status == RX_OK)
        status = rx_optics_on_pixels(given, dst, err);
    rx_optics_free(given);
    return status;
}

static void tell(const rx_condition *c, rx_background *sky)
{
    const size_t n = (size_t)sky->width * (size_t)sky->height;
    const double more = 1 + c->noise_error;
    sky->level_error += c->sky_error * (1 + sky->sigma_error);
    if (sky->sigma == NULL) {
        sky->sigma_error = (1 + sky->sigma_error) * more - 1;
    } else {
        sky->level_error /= more;
        for (size_t i = 0; i < n; i++)
            sky->sigma[i] = (float)((double)sky->sigma[i] * more);
    }
    sky->global_level -= c->sky_error * sky->global_sigma;
    sky->global_sigma *= 1 + c->noise_error;
}

void rx_condition_apply(const rx_condition *c, rx_field *field)
{
    if (c->sky_error == 0.0 && c->noise_error == 0.0)
        return;
    tell(c, field->plain);
    if (field->restored != field->plain)
        tell(c, field->restored);
}
