/* What the pipeline found, as cards of a header. */
#include <math.h>
#include <string.h>

#include "pipeline/pipeline.h"
#include "pipeline/preal.h"

static void describe_templates(const rx_template_fit *fit, rx_record *facts)
{
    if (fit->tphot == NULL)
        return;
    rx_record_add(facts, "RXTPFWHM", "templates: FWHM of the PSF, pixels", "%.4f", fit->fwhm);
    rx_record_add(facts, "RXTPGRP", "groups of sources fitted together", "%d", fit->tphot->ngroups);
    rx_record_add(facts, "RXTPMAX", "members of the largest", "%d", fit->tphot->largest);
    rx_record_add(facts, "RXCROWD", "share of the image that is crowded", "%.4f", fit->tphot->crowded);
    if (fit->tphot->crowded > 0)
        rx_record_add(facts, "RXCROWDG", "share of that whose extended ones are galaxies", "%.4f",
                      fit->tphot->galaxies);
    if (fit->tphot->unseen > 0)
        rx_record_add(facts, "RXUNSEEN", "flux errors by unseen neighbours over noise", "%.4f",
                      fit->tphot->unseen);
    rx_record_add(facts, "RXTPPASS", "fits of all sources", "%d", fit->tphot->passes);
    rx_record_add(facts, "RXTPADD", "sources added from the residual", "%d", fit->added);
    rx_record_add(facts, "RXTPSKY", "mean sky taken off between them, ADU", "%.6g", fit->tphot->sky);
    rx_record_add(facts, "RXTPODDS", "odds of points among clear sources", "%.4g", fit->tphot->star_odds);
    if (isfinite(fit->chi2))
        rx_record_add(facts, "RXTPCHI2", "reduced chi2 of the residual", "%.5f", fit->chi2);
    rx_record_add(facts, "RXTPOK", "F: templates leave more than twice the noise", "%s",
                  rx_template_fit_is_off(fit) ? "F" : "T");
    rx_record_add(facts, "RXPREAL", "P_REAL: by noise of this TILE, or the DEFAULT", "%s",
                  fit->preal.tile ? "TILE" : "DEFAULT");
    rx_record_add(facts, "RXPRLIM", "S/N at which P_REAL is 0.5", "%.3f", rx_preal_limit(&fit->preal));
    rx_record_add(facts, "RXINV", "sources of P_REAL below 0.5", "%d", fit->invented);
    rx_record_add(facts, "RXINVMP", "the same per Mpixel", "%.5g", fit->per_mpixel);
    rx_record_add(facts, "RXINVDR", "of these dropped", "%d", fit->dropped);
}

void rx_result_facts(const rx_result *result, rx_record *facts)
{
    const rx_restored *restored = result->restored;
    const rx_field *field = result->detect;
    const rx_background *background = result->plain ? field->plain : field->restored;
    rx_record_add(facts, "RXREST", "restorer that made this", "%s", restored->name);
    rx_record_add(facts, "RXASKED", "restorer that was asked for", "%s", result->kind->name);
    if (result->why[0] != '\0')
        rx_record_add(facts, "RXWHY", "why this one", "%s", result->why);
    rx_record_add(facts, "RXSETT", "its settings", "%s", restored->settings);
    if (restored->iterations > 0)
        rx_record_add(facts, "RXITER", "iterations done", "%d", restored->iterations);
    if (isfinite(restored->chi2))
        rx_record_add(facts, "RXCHI2", "reduced chi2 of restored * PSF - input", "%.6g", restored->chi2);
    if (isfinite(result->residual.share))
        rx_record_add(facts, "RXUNEX", "share of 64-pixel cells that it does not explain", "%.4f",
                      result->residual.share);
    if (isfinite(result->residual.dark))
        rx_record_add(facts, "RXDARK", "share of 32-pixel boxes 0.3 sigma below the sky", "%.4f",
                      result->residual.dark);
    if (field->no_data > 0)
        rx_record_add(facts, "RXNODATA", "share of pixels without data, in runs of one value", "%.4f",
                      (double)field->no_data / ((double)field->image.width * (double)field->image.height));
    if (field->deep > 0)
        rx_record_add(facts, "RXDEEP", "pixels 300 sigma below the sky, not restored", "%zu", field->deep);
    if (strcmp(restored->name, "NET") == 0)
        rx_record_add(facts, "RXNETOUT", "sources that it was not trained for", "%d", result->outside);
    if (isfinite(restored->seam))
        rx_record_add(facts, "RXSEAM", "largest change in other blocks, sigmas", "%.3g", restored->seam);
    if (restored->blur != NULL) {
        rx_record_add(facts, "RXPSF", "PSF of the input", "%s", restored->blur->description);
        rx_record_add(facts, "RXFWHM", "its FWHM, pixels", "%.4f", restored->blur->fwhm);
    }
    if (field->psf != NULL)
        rx_psf_facts(field->psf, facts);
    else if (field->unrestorable)
        rx_record_add(facts, "RXPSFHOW", "how the PSF came about", "UNKNOWN");
    if (field->psf_bound > 0.0)
        rx_record_add(facts, "RXPSFMAX", "FWHM is below, say the narrowest sources, px", "%.3g",
                      field->psf_bound);
    rx_record_add(facts, "RXMEAS", "image that fluxes are measured on", "%s",
                  result->original ? "ORIGINAL" : "RESTORED");
    rx_record_add(facts, "RXBACK", "mean sky level, ADU", "%.8g", background->global_level);
    rx_record_add(facts, "RXBACKN", "passes of sky and noise; 2: without sources", "%d", background->passes);
    rx_record_add(facts, "RXSIGMA", "noise of an input pixel, ADU", "%.8g", background->global_sigma);
    rx_record_add(facts, "RXDSIG", "noise that thresholds refer to, ADU", "%.8g", result->global_noise);
    const rx_noise_correlation *noise = &field->noise;
    rx_record_add(facts, "RXNCOR", "correlation of the noise: where it is from", "%s",
                  rx_field_noise_origin(field));
    rx_record_add(facts, "RXNCORX", "of pixels side by side", "%.4f",
                  noise->at[RX_NOISE_REACH][RX_NOISE_REACH + 1]);
    rx_record_add(facts, "RXNCORY", "of pixels one above the other", "%.4f",
                  noise->at[RX_NOISE_REACH + 1][RX_NOISE_REACH]);
    rx_record_add(facts, "RXNFACT",
                  field->psf != NULL ? "noise of the matched filter / independent pixels"
                                     : "noise of wide sums / independent pixels; no PSF",
                  "%.4f", field->noise_factor);
    rx_record_add(facts, "RXNWIDE", "the same of wide sums", "%.4f", rx_noise_factor_wide(noise));
    for (int axis = 0; axis < 2; axis++) {
        double power[5];
        for (int i = 0; i < 5; i++)
            power[i] = rx_noise_power(noise, axis == 0 ? i / 8.0 : 0.0, axis == 1 ? i / 8.0 : 0.0);
        rx_record_add(facts, axis == 0 ? "RXNPOWX" : "RXNPOWY",
                      axis == 0 ? "noise power at 0 1/8 1/4 3/8 1/2 per pixel" : "the same in y",
                      "%.3f %.3f %.3f %.3f %.3f", power[0], power[1], power[2], power[3], power[4]);
    }
    for (int q = 0; q < RX_NOISE_QUADRANTS; q++) {
        const char *const names[] = {"RXNQLL", "RXNQHL", "RXNQLH", "RXNQHH"};
        if (isfinite(noise->quadrant[q]))
            rx_record_add(facts, names[q], "RXNWIDE of a quadrant: x, y low or high", "%.3f",
                          rx_noise_quadrant_factor(noise, q));
    }
    rx_record_add(facts, "RXNEVEN", "quadrants agree, to 5 errors or 0.15", "%s",
                  rx_noise_uneven(noise) ? "F" : "T");
    if (noise->origin == RX_NOISE_MEASURED)
        rx_record_add(facts, "RXNOISOK", "F: more correlated than resampling explains", "%s",
                      rx_noise_is_structure(noise) ? "F" : "T");
    const rx_anomalies *anomalies = &field->anomalies;
    rx_record_add(facts, "RXSTEP", "least step between pixel values, ADU", "%.4g", anomalies->step);
    rx_record_add(facts, "RXCUT", "share of the pixels that have the lowest value", "%.4f", anomalies->cut);
    rx_record_add(facts, "RXPIXOK", "F: noise is hidden, by steps or a cut, or none", "%s",
                  rx_fields_noise_hidden((rx_fields){field, result->measure}) ? "F" : "T");
    if (isfinite(anomalies->rows))
        rx_record_add(facts, "RXROWS", "offsets of rows, sigmas of a pixel", "%.3f", anomalies->rows);
    if (isfinite(anomalies->columns))
        rx_record_add(facts, "RXCOLS", "the same of columns", "%.3f", anomalies->columns);
    if (isfinite(anomalies->light))
        rx_record_add(facts, "RXLIGHT", "share of 16-pixel boxes with light of no source", "%.4f",
                      anomalies->light);
    if (anomalies->ratio[0] > 0.0)
        rx_record_add(facts, "RXSHARP", "share of the sources sharper than the PSF", "%.4f",
                      rx_result_sharp(result));
    rx_record_add(facts, "RXLAWS", "noise law: sigma(A) = RXLAWS * sigma * A^RXLAWP", "%.6g",
                  result->photometry.law.scale);
    rx_record_add(facts, "RXLAWP", "0.5 = independent pixels", "%.6g", result->photometry.law.power);
    rx_record_add(facts, "RXLAWN", "empty apertures behind the law, 0 = none", "%d",
                  result->photometry.law.apertures);
    if (result->photometry.law.apertures > 0)
        rx_record_add(facts, "RXLAWE", "scatter of the fit, dex", "%.4f", result->photometry.law.scatter);
    const rx_fluxcheck *check = &result->photometry.check;
    if (check->n > 0) {
        rx_record_add(facts, "RXFLXN", "isolated sources compared with untouched pixels", "%d", check->n);
        rx_record_add(facts, "RXFLXD", "aperture of the comparison, pixels", "%.2f", check->diameter);
        rx_record_add(facts, "RXFLXW", "its flux, restored / untouched", "%.5f", check->wide);
        rx_record_add(facts, "RXFLXWE", "1 sigma of RXFLXW", "%.5f", check->wide_error);
        rx_record_add(facts, "RXFLXA", "FLUX_AUTO restored / that flux untouched", "%.5f", check->automatic);
        rx_record_add(facts, "RXFLXAE", "1 sigma of RXFLXA", "%.5f", check->automatic_error);
        rx_record_add(facts, "RXFLXOK", "flux scale right, to 1 % (AUTO 2 %) or 5 sigma", "%s",
                      rx_fluxcheck_is_off(check) ? "F" : "T");
    }
    describe_templates(&result->templates, facts);
    rx_record_add(facts, "RXZP", "magnitude of 1 ADU", "%.6g", result->measure->image.zeropoint);
    rx_record_add(facts, "RXGAIN", "gain, e-/ADU, 0 = infinite", "%.6g", result->measure->image.gain);
    rx_record_add(facts, "RXSATUR", "saturation level, ADU", "%.6g", result->detect->image.saturation);
}
