/* Fields from images and tiles, among them those of crowds. */
#include <math.h>

#include "base/memory.h"
#include "pipeline/crowd_psf.h"
#include "pipeline/field_noise.h"
#include "pipeline/prepare.h"

/* A crowd's PSF is measured again while fluxes change by three times that, relative: all rounds to come change them by a third of what
 * the last one did (validation/crowded.py cells of 8000 and 20000 per Mpixel, 17 pairs of rounds: each 0.24 of the one before, mean). */
static const double PSF_STAYS = 0.005;
enum { PSF_ROUNDS = 3 };
/* Of what taking off the seen neighbours changed, the error for the unseen ones: a choice. */
static const double PSF_UNSEEN = 0.5;

/* The PSF of a crowd, until it stays. */
static rx_status measure_between(const rx_pipeline_params *params, int what,
                                 const rx_noise_correlation *noise, rx_field *field, rx_log *log,
                                 rx_error *err)
{
    double by = HUGE_VAL, all = 0;
    for (int round = 0; round < PSF_ROUNDS && fabs(by) > 3 * PSF_STAYS; round++) {
        rx_psf *psf = NULL;
        const rx_status status = rx_psf_between(params, what & RX_FIELD_MEASURED, field, log, &psf, &by, err);
        if (psf == NULL)
            return status;
        if (by < -PSF_STAYS) {
            /* With less light around its stars a PSF gets no wider: its wings follow noise. */
            field->psf->quality.flux_error = hypot(field->psf->quality.flux_error, by);
            rx_psf_free(psf);
            return status;
        }
        all += by;
        psf->quality.flux_error = hypot(psf->quality.flux_error, PSF_UNSEEN * all);
        rx_psf_free(field->psf);
        field->image.psf = field->psf = psf;
        field->noise = *noise;
        RX_TRY(status);
        RX_TRY(rx_field_noise_effective(params, field, NULL, log, err));
    }
    return RX_OK;
}

/* Fills the field, or frees it. */
static rx_status prepare(const rx_pipeline_params *params, int what, rx_field *field, rx_log *log,
                         rx_field **dst, rx_error *err)
{
    rx_noise_correlation noise;
    rx_status status;
    RX_TRY_EXIT(rx_field_begin(params, what, field, &noise, log, err));
    if (field->psf != NULL && params->psf.type == RX_PSF_AUTO && field->nstars > 0) {
        rx_lap last = rx_lap_now();
        RX_TRY_EXIT(measure_between(params, what, &noise, field, log, err));
        rx_lap_add(&last, &field->psf_lap);
    }
    rx_field_end(field, log);
    *dst = field;
    field = NULL;
exit:
    rx_field_free(field);
    return status;
}

rx_status rx_field_prepare(const rx_pipeline_params *params, int what, rx_tile *tile, const rx_psf *known,
                           rx_log *log, rx_field **dst, rx_error *err)
{
    *dst = NULL;
    rx_field *field = RX_NEW(rx_field, 1);
    if (field == NULL) {
        rx_tile_free(tile);
        return rx_error_memory(err, sizeof *field);
    }
    field->tile = tile;
    field->image = rx_tile_image(tile);
    field->image.psf = known;
    return prepare(params, what, field, log, dst, err);
}

rx_status rx_field_new(const rx_pipeline_params *params, int what, const rx_image *image, rx_log *log,
                       rx_field **dst, rx_error *err)
{
    rx_field *field = NULL;
    *dst = NULL;
    RX_TRY(rx_field_of_image(image, &field, err));
    return prepare(params, what, field, log, dst, err);
}
