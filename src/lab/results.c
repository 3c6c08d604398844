/* What a campaign has measured: freeing it. */
#include "lab/results.h"

#include <stdlib.h>

void rx_restoration_results_free(rx_restoration_results *results)
{
    if (results == NULL)
        return;
    for (int b = 0; results->bins != NULL && b < results->nbins; b++) {
        rx_restoration_bin *bin = &results->bins[b];
        free(bin->fwhm);
        free(bin->sigma);
        free(bin->level);
        for (int m = 0; m < RX_METHODS_MAX; m++) {
            free(bin->method[m].psnr);
            free(bin->method[m].ssim);
        }
    }
    for (int e = 0; results->examples != NULL && e < results->nexamples; e++)
        for (int p = 0; p < RX_METHODS_MAX + 2; p++)
            free(results->examples[e].planes[p]);
    free(results->bins);
    free(results->examples);
    free(results);
}

static void free_set(rx_photometry_set *set)
{
    for (int r = 0; r < RX_METHODS_MAX; r++) {
        free(set->run[r].stars);
        free(set->run[r].false_scores);
        free(set->run[r].false_mags);
    }
}

void rx_photometry_results_free(rx_photometry_results *results)
{
    if (results == NULL)
        return;
    for (int f = 0; results->fields != NULL && f < results->nfields; f++) {
        rx_photometry_field *field = &results->fields[f];
        for (int s = 0; field->sets != NULL && s < field->nsets; s++)
            free_set(&field->sets[s]);
        free(field->sets);
    }
    free(results->fields);
    free(results);
}
