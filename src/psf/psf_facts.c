/* What is known of a PSF, as facts. */
#include <math.h>

#include "data/facts.h"
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
        rx_fact_number(facts, RX_FACT_PSFERR, error);
        rx_fact_number(facts, RX_FACT_PSFERX, hypot(q->flux_error, largest));
    }
    if (largest > 0.0) {
        const double middle = 0.5 * (RX_PSF_CELLS - 1);
        rx_fact_number(facts, RX_FACT_PSFEPX, psf->x0 + (at % RX_PSF_CELLS / middle - 1.0) * psf->xs + 1.0);
        rx_fact_number(facts, RX_FACT_PSFEPY, psf->y0 + (at / RX_PSF_CELLS / middle - 1.0) * psf->ys + 1.0);
    }
    if (q->how == RX_PSF_BY_NOTHING)
        return;
    rx_fact_text(facts, RX_FACT_PSFHOW, rx_psf_how_name(q->how));
    if (psf->nstars > 0)
        rx_fact_number(facts, RX_FACT_PSFNST, psf->nstars);
    if (q->neighbours > 0)
        rx_fact_number(facts, RX_FACT_PSFNBR, q->neighbours);
    if (q->limit > 0.0)
        rx_fact_number(facts, RX_FACT_PSFLIM, q->limit);
    if (!(q->radius > 0.0))
        return;
    rx_fact_number(facts, RX_FACT_PSFDEG, q->degree);
    rx_fact_number(facts, RX_FACT_PSFRAD, q->radius);
    rx_fact_number(facts, RX_FACT_PSFOUT, q->beyond);
    if (q->hidden > 0.0)
        rx_fact_number(facts, RX_FACT_PSFHID, q->hidden);
    rx_fact_number(facts, RX_FACT_PSFCOG, q->growth);
    rx_fact_number(facts, RX_FACT_PSFCGR, q->growth_radius);
    rx_fact_number(facts, RX_FACT_PSFRES, q->residual);
    rx_fact_number(facts, RX_FACT_PSFNRS, q->reserved);
    if (q->reserved == 0)
        return;
    rx_fact_number(facts, RX_FACT_PSFDT, q->trace[0]);
    rx_fact_number(facts, RX_FACT_PSFDTE, q->trace[1]);
    rx_fact_number(facts, RX_FACT_PSFE1, q->shape[0][0]);
    rx_fact_number(facts, RX_FACT_PSFE1E, q->shape[0][1]);
    rx_fact_number(facts, RX_FACT_PSFE2, q->shape[1][0]);
    rx_fact_number(facts, RX_FACT_PSFE2E, q->shape[1][1]);
}
