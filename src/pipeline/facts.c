/* What the pipeline found. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "data/facts.h"
#include "fit/preal.h"
#include "pipeline/pipeline.h"

static void describe_templates(const rx_template_fit *fit, rx_record *facts)
{
    if (fit->tphot == NULL)
        return;
    rx_fact_number(facts, RX_FACT_TPFWHM, fit->fwhm);
    rx_fact_number(facts, RX_FACT_TPGRP, fit->tphot->ngroups);
    rx_fact_number(facts, RX_FACT_TPMAX, fit->tphot->largest);
    rx_fact_number(facts, RX_FACT_CROWD, fit->tphot->crowded);
    if (fit->tphot->crowded > 0)
        rx_fact_number(facts, RX_FACT_CROWDG, fit->tphot->galaxies);
    if (fit->tphot->unseen > 0)
        rx_fact_number(facts, RX_FACT_UNSEEN, fit->tphot->unseen);
    rx_fact_number(facts, RX_FACT_TPPASS, fit->tphot->passes);
    rx_fact_number(facts, RX_FACT_TPADD, fit->added);
    rx_fact_number(facts, RX_FACT_TPSKY, fit->tphot->sky);
    rx_fact_number(facts, RX_FACT_TPODDS, fit->tphot->star_odds);
    rx_fact_number(facts, RX_FACT_TPCHI2, fit->chi2);
    rx_fact_number(facts, RX_FACT_PRLIM, rx_preal_limit(&fit->preal[fit->tphot->crowded > 0.5]));
    rx_fact_number(facts, RX_FACT_INV, fit->invented);
    rx_fact_number(facts, RX_FACT_INVMP, fit->per_mpixel);
    rx_fact_number(facts, RX_FACT_INVDR, fit->dropped);
}

void rx_result_facts(const rx_result *result, rx_record *facts)
{
    const rx_restored *restored = result->restored;
    const rx_field *field = result->detect;
    const rx_background *background = result->plain ? field->plain : field->restored;
    rx_fact_text(facts, RX_FACT_REST, restored->name);
    rx_fact_text(facts, RX_FACT_ASKED, result->kind->name);
    if (result->why[0] != '\0')
        rx_fact_text(facts, RX_FACT_WHY, result->why);
    rx_fact_text(facts, RX_FACT_SETT, restored->settings);
    if (restored->iterations > 0)
        rx_fact_number(facts, RX_FACT_ITER, restored->iterations);
    rx_fact_number(facts, RX_FACT_CHI2, restored->chi2);
    rx_fact_number(facts, RX_FACT_MODEL, result->residual.share);
    if (result->residual.cause != RX_MISFIT_NONE)
        rx_fact_text(facts, RX_FACT_MISFIT, rx_misfit_name(result->residual.cause));
    rx_fact_warned(facts, RX_FACT_MISFIT, result->residual.cause != RX_MISFIT_NONE);
    rx_fact_number(facts, RX_FACT_DARK, result->residual.dark);
    rx_fact_warned(facts, RX_FACT_DARK, rx_result_is_dark(result));
    if (field->no_data > 0)
        rx_fact_number(facts, RX_FACT_NODATA,
                       (double)field->no_data / ((double)field->image.width * (double)field->image.height));
    rx_fact_warned(facts, RX_FACT_NODATA, field->no_data > 0);
    if (field->deep > 0)
        rx_fact_number(facts, RX_FACT_DEEP, (double)field->deep);
    rx_fact_warned(facts, RX_FACT_DEEP, field->deep > 0);
    if ((rx_restorer_find(restored->name)->traits & RX_TRAIT_TRAINED) != 0)
        rx_fact_number(facts, RX_FACT_NETOUT, result->outside);
    rx_fact_number(facts, RX_FACT_SEAM, restored->seam);
    if (restored->blur != NULL) {
        rx_fact_text(facts, RX_FACT_PSF, restored->blur->description);
        rx_fact_number(facts, RX_FACT_FWHM, restored->blur->fwhm);
    }
    if (field->psf != NULL)
        rx_psf_facts(field->psf, facts);
    else if (field->unrestorable)
        rx_fact_text(facts, RX_FACT_PSFHOW, "UNKNOWN");
    if (field->psf_bound > 0.0)
        rx_fact_number(facts, RX_FACT_PSFMAX, field->psf_bound);
    rx_fact_warned(facts, RX_FACT_PSFMAX, field->psf_bound > 0.0);
    rx_fact_text(facts, RX_FACT_MEAS, result->original ? "ORIGINAL" : "RESTORED");
    rx_fact_number(facts, RX_FACT_BACK, background->global_level);
    rx_fact_number(facts, RX_FACT_BACKN, background->passes);
    rx_fact_number(facts, RX_FACT_SIGMA, background->global_sigma);
    rx_fact_number(facts, RX_FACT_DSIG, result->global_noise);
    const rx_noise_correlation *noise = &field->noise;
    rx_fact_text(facts, RX_FACT_NCOR, rx_field_noise_origin(field));
    rx_fact_number(facts, RX_FACT_NCORX, noise->at[RX_NOISE_REACH][RX_NOISE_REACH + 1]);
    rx_fact_number(facts, RX_FACT_NCORY, noise->at[RX_NOISE_REACH + 1][RX_NOISE_REACH]);
    rx_fact_number(facts, RX_FACT_NFACT, field->noise_factor);
    rx_fact_number(facts, RX_FACT_NWIDE, rx_noise_factor_wide(noise));
    for (int axis = 0; axis < 2; axis++) {
        double power[5];
        char text[80];
        for (int i = 0; i < 5; i++)
            power[i] = rx_noise_power(noise, axis == 0 ? i / 8.0 : 0.0, axis == 1 ? i / 8.0 : 0.0);
        snprintf(text, sizeof text, "%.3f %.3f %.3f %.3f %.3f", power[0], power[1], power[2], power[3],
                 power[4]);
        rx_fact_text(facts, axis == 0 ? RX_FACT_NPOWX : RX_FACT_NPOWY, text);
    }
    for (int q = 0; q < RX_NOISE_QUADRANTS; q++)
        if (isfinite(noise->quadrant[q]))
            rx_fact_number(facts, RX_FACT_NQLL + q, rx_noise_quadrant_factor(noise, q));
    rx_fact_flag(facts, RX_FACT_NEVEN, !rx_noise_uneven(noise));
    rx_fact_warned(facts, RX_FACT_NEVEN, rx_noise_uneven(noise));
    rx_fact_warned(facts, RX_FACT_NWIDE, rx_noise_is_structure(noise));
    if (noise->origin == RX_NOISE_MEASURED)
        rx_fact_flag(facts, RX_FACT_NOISOK, !rx_noise_is_structure(noise));
    if (field->psf != NULL)
        rx_fact_number(facts, RX_FACT_SHARP, rx_result_sharp(result));
    rx_fact_number(facts, RX_FACT_LAWS, result->photometry.law.scale);
    rx_fact_number(facts, RX_FACT_LAWP, result->photometry.law.power);
    rx_fact_number(facts, RX_FACT_LAWN, result->photometry.law.apertures);
    if (result->photometry.law.apertures > 0)
        rx_fact_number(facts, RX_FACT_LAWE, result->photometry.law.scatter);
    const rx_fluxcheck *check = &result->photometry.check;
    if (check->n > 0) {
        rx_fact_number(facts, RX_FACT_FLXN, check->n);
        rx_fact_number(facts, RX_FACT_FLXD, check->diameter);
        rx_fact_number(facts, RX_FACT_FLXW, check->wide);
        rx_fact_number(facts, RX_FACT_FLXWE, check->wide_error);
        rx_fact_number(facts, RX_FACT_FLXA, check->automatic);
        rx_fact_number(facts, RX_FACT_FLXAE, check->automatic_error);
        rx_fact_flag(facts, RX_FACT_FLXOK, !rx_fluxcheck_is_off(check));
    }
    describe_templates(&result->templates, facts);
    rx_fact_number(facts, RX_FACT_ZP, result->measure->image.zeropoint);
    rx_fact_number(facts, RX_FACT_GAIN, result->measure->image.gain);
    rx_fact_number(facts, RX_FACT_SATUR, result->detect->image.saturation);
}
