/* Facts of a tile. */
#include "stage/tile_facts.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "io/wcs.h"

static void locate(const rx_tile *tile, rx_extension_facts *dst)
{
    const double x = 0.5 * (tile->width - 1), y = 0.5 * (tile->height - 1);
    dst->alpha = dst->delta = NAN;
    if (tile->wcs != NULL)
        rx_wcs_to_sky(tile->wcs, 1, &x, &y, NULL, NULL, &dst->alpha, &dst->delta);
}

rx_status rx_tile_facts_add(rx_tile_facts *facts, const rx_field *field, const rx_run *runs, int nruns,
                            int with_reference, rx_extension_facts **dst, rx_error *err)
{
    rx_extension_facts *grown = rx_regrow(facts->extension, (size_t)facts->n + 1, sizeof *grown);
    if (grown == NULL)
        return rx_error_memory(err, ((size_t)facts->n + 1) * sizeof *grown);
    facts->extension = grown;
    rx_extension_facts *e = *dst = &grown[facts->n++];
    *e = (rx_extension_facts){.hdu = field->tile->hdu,
                              .width = field->tile->width,
                              .height = field->tile->height,
                              .fwhm = field->psf != NULL ? field->psf->fwhm : NAN,
                              .sky = field->plain->global_level,
                              .noise = field->plain->global_sigma,
                              .nruns = nruns};
    locate(field->tile, e);
    for (int i = 0; i < nruns; i++) {
        rx_run_facts *run = &e->run[i];
        const rx_blankcheck *blank = &runs[i].checks.blank;
        *run = (rx_run_facts){.sources = (long)runs[i].sources->n,
                              .flux = runs[i].flux,
                              .guard = {.known = blank->realisations > 0 || isfinite(runs[i].unexplained),
                                        .false_per_mpixel = blank->realisations > 0 ? blank->rate.value : NAN,
                                        .raised = blank->raised,
                                        .unexplained = runs[i].unexplained}};
        snprintf(run->name, sizeof run->name, "%s", runs[i].kind->name);
        snprintf(run->by, sizeof run->by, "%s", runs[i].by != NULL ? runs[i].by : "");
        snprintf(run->why, sizeof run->why, "%s", runs[i].why);
        snprintf(run->outside, sizeof run->outside, "%s", runs[i].outside);
        if (with_reference && (e->run[i].tally = RX_NEW(rx_tally, 1)) == NULL)
            return rx_error_memory(err, sizeof(rx_tally));
    }
    return RX_OK;
}

void rx_tile_facts_free(rx_tile_facts *facts)
{
    for (int k = 0; k < facts->n; k++)
        for (int i = 0; i < facts->extension[k].nruns; i++) {
            rx_tally *tally = facts->extension[k].run[i].tally;
            if (tally != NULL)
                rx_tally_free(tally);
            free(tally);
        }
    free(facts->extension);
    *facts = (rx_tile_facts){0};
}
