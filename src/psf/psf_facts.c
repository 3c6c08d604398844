/* What is known of a PSF, as cards of a header. */
#include <math.h>
#include <string.h>

#include "psf/psf.h"

void rx_psf_facts(const rx_psf *psf, rx_record *facts)
{
    const rx_psf_quality *q = &psf->quality;
    const double error = rx_psf_flux_error_mean(psf);
    double largest = 0.0;
    int at = 0;
    for (int i = 0; i < RX_PSF_CELLS * RX_PSF_CELLS; i++)
        if (q->flux_errors[i / RX_PSF_CELLS][i % RX_PSF_CELLS] > largest) {
            largest = q->flux_errors[i / RX_PSF_CELLS][i % RX_PSF_CELLS];
            at = i;
        }
    if (error > 0.0 || q->radius > 0.0) {
        rx_record_add(facts, "RXPSFERR", "relative error of fluxes from the PSF", "%.5f", error);
        rx_record_add(facts, "RXPSFERX", "the largest of it over the tile", "%.5f",
                      hypot(q->flux_error, largest));
    }
    if (largest > 0.0) {
        const double middle = 0.5 * (RX_PSF_CELLS - 1);
        rx_record_add(facts, "RXPSFEPX", "place of RXPSFERX, x, pixels from 1", "%.0f",
                      psf->x0 + (at % RX_PSF_CELLS / middle - 1.0) * psf->xs + 1.0);
        rx_record_add(facts, "RXPSFEPY", "place of RXPSFERX, y, pixels from 1", "%.0f",
                      psf->y0 + (at / RX_PSF_CELLS / middle - 1.0) * psf->ys + 1.0);
    }
    if (q->how[0] == '\0')
        return;
    rx_record_add(facts, "RXPSFHOW", "how the PSF came about", "%s", q->how);
    if (psf->nstars > 0)
        rx_record_add(facts, "RXPSFNST", "stars that it was fitted to", "%d", psf->nstars);
    if (strcmp(q->how, "LIBRARY") == 0) {
        rx_record_add(facts, "RXPSFLIB", "file of PSF_LIBRARY", "%s", q->library);
        if (isfinite(q->library_days))
            rx_record_add(facts, "RXPSFLDT", "its exposure after this one, days", "%.5f", q->library_days);
        if (isfinite(q->library_degrees))
            rx_record_add(facts, "RXPSFLDS", "its centre from this one, deg", "%.5f", q->library_degrees);
        rx_record_add(facts, "RXPSFLN", "models compared for RXPSFERR; 0: 10 % assumed", "%d",
                      q->library_compared);
    }
    if (q->neighbours > 0)
        rx_record_add(facts, "RXPSFNBR", "neighbours taken off its stars, a crowd's fit", "%d",
                      q->neighbours);
    if (q->sharper > 0) {
        rx_record_add(facts, "RXPSFSHN", "sources of a second, smaller size: the stars?", "%d", q->sharper);
        rx_record_add(facts, "RXPSFSHR", "their radius over that of the stars taken", "%.3f", q->sharpness);
    }
    if (q->limit > 0.0)
        rx_record_add(facts, "RXPSFLIM", "stars that reach this are flattened, ADU", "%.6g", q->limit);
    if (!(q->radius > 0.0))
        return;
    rx_record_add(facts, "RXPSFDEG", "degree of its polynomial over the tile", "%d", q->degree);
    rx_record_add(facts, "RXPSFRAD", "radius within which its sum is 1, pixels", "%.1f", q->radius);
    rx_record_add(facts, "RXPSFOUT", "share of a star's light beyond, estimated", "%.5f", q->beyond);
    if (q->hidden > 0.0)
        rx_record_add(facts, "RXPSFHID", "of RXPSFERR: wings that noise may hide", "%.5f", q->hidden);
    if (strcmp(q->how, "LIBRARY") == 0) /* its stars are not this tile's */
        return;
    rx_record_add(facts, "RXPSFCOG", "curve of growth, largest stars - PSF", "%.5f", q->growth);
    rx_record_add(facts, "RXPSFCGR", "at this radius, pixels", "%.1f", q->growth_radius);
    rx_record_add(facts, "RXPSFRES", "stacked stars - PSF, largest, share of peak", "%.5f", q->residual);
    rx_record_add(facts, "RXPSFNRS", "stars reserved to judge it, not fitted", "%d", q->reserved);
    if (q->reserved == 0)
        return;
    rx_record_add(facts, "RXPSFDT", "their mean (T - T of PSF) / T, T = xx + yy", "%.6f", q->trace[0]);
    rx_record_add(facts, "RXPSFDTE", "its error", "%.6f", q->trace[1]);
    rx_record_add(facts, "RXPSFE1", "their mean e1 - e1 of PSF, e1 = (xx-yy)/T", "%.6f", q->shape[0][0]);
    rx_record_add(facts, "RXPSFE1E", "its error", "%.6f", q->shape[0][1]);
    rx_record_add(facts, "RXPSFE2", "their mean e2 - e2 of PSF, e2 = 2 xy/T", "%.6f", q->shape[1][0]);
    rx_record_add(facts, "RXPSFE2E", "its error", "%.6f", q->shape[1][1]);
}
