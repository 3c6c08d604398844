/* What template photometry is given, and what it gives. */
#include "template/tphot.h"

#include <math.h>
#include <stdlib.h>

#include "data/unit.h"

enum { SHOWN = 1 << 24 }; /* pixels */

rx_tphot_params rx_tphot_defaults(void)
{
    return (rx_tphot_params){.link = 0.01,
                             .group_limit = 40,
                             .background_sigma = 0.02,
                             .sky_cell = 128,
                             .psf_error = 0.01,
                             .passes = 2,
                             .crowding = RX_CROWDING_AUTO,
                             .least = 4.0,
                             .rounds = 2,
                             .extended = 1,
                             .substructure = 1,
                             .shown = SHOWN,
                             .nthreads = 1};
}

rx_status rx_tphot_check(const rx_tphot_input *input, rx_error *err)
{
    const rx_restored *restored = input->restored;
    const rx_sources *sources = input->sources;
    if (restored->width != input->image.width || restored->height != input->image.height ||
        sources->width != input->image.width || sources->height != input->image.height ||
        sources->segments == NULL)
        return rx_error_set(err, RX_INPUT,
                            "the fitted image has %d x %d pixels and the restored one %d x %d; "
                            "templates need the same grid",
                            input->image.width, input->image.height, restored->width, restored->height);
    if (input->image.psf == NULL)
        return rx_error_set(err, RX_INPUT, "templates need the PSF of the image; give PSF_TYPE");
    if (input->shapes != NULL && input->shapes->nlisted != sources->n)
        return rx_error_set(err, RX_INPUT, "shapes of %d sources were given for a list of %d",
                            input->shapes->nlisted, sources->n);
    const rx_psf *psfs[2] = {input->image.psf, restored->psf};
    for (int i = 0; i < 2; i++)
        for (size_t k = 0;
             psfs[i] != NULL && k < (size_t)psfs[i]->nbasis * (size_t)psfs[i]->size * (size_t)psfs[i]->size;
             k++)
            if (!isfinite(psfs[i]->basis[k]))
                return rx_error_set(err, RX_INPUT,
                                    "the PSF has a pixel that is not a number; give another one");
    return RX_OK;
}

void rx_tphot_multiply(rx_tphot *tphot, double unit)
{
    const size_t n = (size_t)tphot->width * (size_t)tphot->height;
    for (int i = 0; i < tphot->n; i++) {
        rx_tphot_source *s = &tphot->list[i];
        s->flux *= unit;
        s->fluxerr *= unit;
        s->background *= unit;
        s->unseen *= unit;
        s->point_fit.flux *= unit;
        s->point_fit.fluxerr *= unit;
        s->sersic_fit.flux *= unit;
        s->sersic_fit.fluxerr *= unit;
    }
    for (int i = 0; i < tphot->npairs && tphot->pairs != NULL; i++)
        tphot->pairs[i].covariance *= unit * unit;
    tphot->sky *= unit;
    tphot->least *= unit;
    rx_unit_divide(tphot->model, n, 1.0 / unit);
    rx_unit_divide(tphot->residual, n, 1.0 / unit);
}

void rx_tphot_free(rx_tphot *tphot)
{
    if (tphot == NULL)
        return;
    free(tphot->list);
    free(tphot->pairs);
    free(tphot->model);
    free(tphot->residual);
    free(tphot);
}
