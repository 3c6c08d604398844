/* Means and medians over the test images. */
#include "train/epoch_test.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"

/* Sums over some test images. */
typedef struct tally {
    double loss, input, stars, found;
    long images;
    double *errors; /* of fluxes */
    size_t nerrors;
} tally;

static void add(tally *t, const rx_test_image *image)
{
    t->loss += image->loss;
    t->input += image->input;
    t->stars += image->check.stars;
    t->found += image->check.found;
    t->images++;
    for (int i = 0; i < (int)image->check.ratios; i++)
        t->errors[t->nerrors++] = image->check.error[i];
}

/* Recall, bias and scatter; reorders errors. */
static void conclude(tally *t, double *recall, double *bias, double *scatter)
{
    *recall = t->stars > 0 ? t->found / t->stars : NAN;
    *bias = NAN;
    *scatter = rx_sigma_mad(t->errors, t->nerrors, bias);
    if (t->nerrors == 0)
        *bias = NAN;
}

rx_status rx_epoch_test(const rx_test_image *images, rx_selection *selection, rx_epoch *epoch,
                        rx_epoch_bin *bins, rx_error *err)
{
    double sum[RX_BINS_MAX] = {0}, loss = 0, input = 0;
    long count[RX_BINS_MAX] = {0}, all = 0, at = 0;
    for (int b = 0; b < selection->nbins; b++)
        all += selection->test[b];
    const size_t most = (size_t)all * RX_SAMPLE_STARS;
    tally total = {.errors = RX_NEW(double, most)}, one = {.errors = RX_NEW(double, most)};
    if (total.errors == NULL || one.errors == NULL) {
        free(total.errors);
        free(one.errors);
        return rx_error_memory(err, 2 * most * sizeof(double));
    }
    for (int b = 0; b < selection->nbins; b++) {
        rx_epoch_bin *bin = &bins[b];
        one = (tally){.errors = one.errors};
        for (int i = 0; i < selection->test[b]; i++, at++) {
            add(&one, &images[at]);
            add(&total, &images[at]);
        }
        sum[b] = one.loss;
        count[b] = one.images;
        *bin = (rx_epoch_bin){
            .loss = one.loss / (double)one.images, .train = selection->train[b], .test = selection->test[b]};
        conclude(&one, &bin->recall, &bin->bias, &bin->scatter);
        loss += bin->loss;
        input += one.input / (double)one.images;
    }
    rx_selection_update(selection, sum, count);
    for (int b = 0; b < selection->nbins; b++)
        bins[b].list = selection->list[b];
    epoch->test_loss = loss / selection->nbins;
    epoch->input_loss = input / selection->nbins;
    conclude(&total, &epoch->recall, &epoch->bias, &epoch->scatter);
    free(total.errors);
    free(one.errors);
    return RX_OK;
}

rx_status rx_epoch_dictionary(const rx_selection *selection, const rx_epoch_bin *bins, rx_model *model,
                              rx_error *err)
{
    const size_t n = (size_t)selection->nbins;
    if (model->bins == NULL)
        model->bins = RX_NEW(rx_model_bin, n);
    if (model->bins == NULL)
        return rx_error_memory(err, n * sizeof *model->bins);
    model->nfwhm = selection->nfwhm;
    model->nsigma = selection->nsigma;
    for (int b = 0; b < selection->nbins; b++) {
        rx_model_bin *dst = &model->bins[b];
        *dst = (rx_model_bin){.loss = bins[b].loss,
                              .list = bins[b].list,
                              .recall = bins[b].recall,
                              .bias = bins[b].bias,
                              .scatter = bins[b].scatter,
                              .images = (long)bins[b].test};
        rx_selection_bin(selection, b, dst->fwhm, dst->sigma);
    }
    return RX_OK;
}
