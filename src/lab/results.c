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
