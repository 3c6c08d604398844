/* Facts of a tile. */
#include "stage/tile_facts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "io/fits_read.h"
#include "io/header_numbers.h"
#include "io/wcs.h"
#include "quality/tile_quality.h"

int rx_psf_account_is_lower(const rx_psf_account *psf)
{
    return psf->how[0] != '\0' && strcmp(psf->how, "PIXELS") != 0 && strcmp(psf->how, "MOFFAT") != 0;
}

/* Stars on the sky, ellipses with north up and east left: a star of position angle p has e = |e| exp(2 i p). */
static rx_status correlate(const rx_tile *tile, const rx_psf_tested *tested, rx_rho *dst, rx_error *err)
{
    rx_rho_star *stars;
    int n = 0;
    RX_TRY(RX_MAKE(stars, (size_t)tested->nstars + 1, err));
    for (int i = 0; i < tested->nstars; i++) {
        const rx_psf_star *s = &tested->star[i];
        rx_rho_star *to = &stars[n];
        double m[4];
        rx_wcs_to_sky(tile->wcs, 1, &s->x, &s->y, &to->alpha, &to->delta);
        rx_wcs_matrix(tile->wcs, s->x, s->y, m);
        const double turn = 2.0 * atan2(m[0], m[2]), side = m[0] * m[3] - m[1] * m[2] > 0.0 ? -1.0 : 1.0;
        const double e1 = s->off[1], e2 = side * s->off[2];
        if (!isfinite(to->alpha) || !isfinite(to->delta) || !isfinite(turn))
            continue;
        to->t = rx_rho_units(s->off[0]);
        to->e1 = rx_rho_units(e1 * cos(turn) - e2 * sin(turn));
        to->e2 = rx_rho_units(e1 * sin(turn) + e2 * cos(turn));
        n++;
    }
    rx_rho_of(n, stars, dst);
    free(stars);
    return RX_OK;
}

static rx_status describe_psf(const rx_field *field, const rx_extension_facts *e, rx_psf_account *dst,
                              rx_error *err)
{
    const rx_psf *psf = field->psf;
    if (psf == NULL || psf->quality.how == RX_PSF_BY_NOTHING)
        return RX_OK;
    const rx_psf_quality *q = &psf->quality;
    snprintf(dst->how, sizeof dst->how, "%s", rx_psf_how_name(q->how));
    dst->stars = psf->nstars;
    dst->flux_error = rx_psf_flux_error_mean(psf);
    dst->growth = q->growth;
    dst->residual = q->residual;
    dst->reserved = q->reserved;
    for (int k = 0; k < 3; k++) {
        dst->off[k] = k == 0 ? q->trace[0] : q->shape[k - 1][0];
        dst->error[k] = k == 0 ? q->trace[1] : q->shape[k - 1][1];
    }
    dst->rho.alpha = e->alpha;
    dst->rho.delta = e->delta;
    return psf->tested != NULL && isfinite(e->alpha) ? correlate(field->tile, psf->tested, &dst->rho, err)
                                                     : RX_OK;
}

static rx_tile_state state_of(const rx_field *field)
{
    const rx_image image = rx_field_observed(field);
    const size_t n = (size_t)image.width * (size_t)image.height;
    size_t masked = 0, saturated = 0;
    for (size_t k = 0; k < n && image.mask != NULL; k++) {
        masked += (image.mask[k] & image.hide) != 0;
        saturated += (image.mask[k] & RX_MASK_SATURATED) != 0;
    }
    return (rx_tile_state){.ellipticity = image.psf != NULL ? image.psf->ellipticity : NAN,
                           .depth = rx_tile_depth(&image),
                           .factor = rx_noise_factor_wide(&field->noise),
                           .masked = (double)masked / (double)n,
                           .saturated = (double)saturated / (double)n,
                           .wrong = -1,
                           .look = -1};
}

void rx_tile_facts_cards(rx_extension_facts *facts, const rx_tile *tile, int n, const char *const *names)
{
    for (int i = 0; i < n && facts->ncards < RX_RECORD_CARDS; i++) {
        rx_tile_card *card = &facts->card[facts->ncards];
        snprintf(card->name, sizeof card->name, "%s", names[i]);
        int found = rx_cards_number(tile->cards, (long)tile->ncards, names[i], &card->value);
        if (!found && strcasecmp(names[i], "MJD-OBS") == 0) {
            rx_exposure exposure;
            rx_exposure_of(tile, &exposure);
            card->value = exposure.mjd;
            found = 1;
        }
        facts->ncards += found && isfinite(card->value);
    }
}

rx_status rx_tile_facts_add(rx_tile_facts *facts, const rx_field *field, rx_run *runs, int nruns,
                            int with_reference, rx_extension_facts **dst, rx_error *err)
{
    RX_TRY(RX_GROW(facts->extension, (size_t)facts->n + 1, err));
    rx_extension_facts *e = *dst = &facts->extension[facts->n++];
    *e = (rx_extension_facts){.hdu = field->tile->hdu,
                              .width = field->tile->width,
                              .height = field->tile->height,
                              .fwhm = field->psf != NULL ? field->psf->fwhm : NAN,
                              .sky = field->plain->global_level,
                              .noise = field->plain->global_sigma};
    RX_TRY(RX_MAKE(e->run, (size_t)nruns, err));
    e->nruns = nruns;
    const double x = 0.5 * (e->width - 1), y = 0.5 * (e->height - 1);
    e->alpha = e->delta = NAN;
    if (field->tile->wcs != NULL)
        rx_wcs_to_sky(field->tile->wcs, 1, &x, &y, &e->alpha, &e->delta);
    e->known = 1;
    e->state = state_of(field);
    RX_TRY(describe_psf(field, e, &e->psf, err));
    for (int i = 0; i < nruns; i++) {
        rx_run_facts *run = &e->run[i];
        const rx_blankcheck *blank = &runs[i].checks.blank;
        *run = (rx_run_facts){.sources = (long)runs[i].sources->n,
                              .flux = runs[i].flux,
                              .guard = {.known = blank->realisations > 0 || isfinite(runs[i].misfit.share),
                                        .false_per_mpixel = blank->realisations > 0 ? blank->rate.value : NAN,
                                        .raised = blank->raised,
                                        .unexplained = runs[i].misfit.share},
                              .sharp = field->psf != NULL ? runs[i].sharp : NAN};
        snprintf(run->name, sizeof run->name, "%s", runs[i].kind->name);
        snprintf(run->by, sizeof run->by, "%s", runs[i].by != NULL ? runs[i].by : "");
        snprintf(run->why, sizeof run->why, "%s", runs[i].why);
        if (runs[i].taken != NULL)
            snprintf(run->taken, sizeof run->taken, "%s", runs[i].taken->name);
        run->facts = runs[i].facts;
        runs[i].facts = (rx_record){0};
        snprintf(run->outside, sizeof run->outside, "%s", runs[i].outside);
        if (with_reference && (e->run[i].tally = RX_NEW(rx_tally, 1)) == NULL)
            return rx_error_memory(err, sizeof(rx_tally));
    }
    return RX_OK;
}

void rx_tile_facts_free(rx_tile_facts *facts)
{
    for (int k = 0; k < facts->n; k++) {
        for (int i = 0; i < facts->extension[k].nruns; i++) {
            rx_tally *tally = facts->extension[k].run[i].tally;
            if (tally != NULL)
                rx_tally_free(tally);
            free(tally);
            rx_record_free(&facts->extension[k].run[i].facts);
        }
        free(facts->extension[k].run);
    }
    free(facts->extension);
    *facts = (rx_tile_facts){0};
}
