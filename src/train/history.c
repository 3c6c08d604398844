/* Epochs kept: means and medians over their test images. */
#include "train/history.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"

void rx_history_free(rx_history *history)
{
    free(history->epoch);
    free(history->bin);
    *history = (rx_history){.nbins = history->nbins};
}

rx_status rx_history_resize(rx_history *history, long n, rx_error *err)
{
    RX_TRY(RX_GROW(history->epoch, (size_t)n, err));
    RX_TRY(RX_GROW(history->bin, (size_t)n * (size_t)history->nbins, err));
    history->n = n;
    return RX_OK;
}

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

rx_status rx_history_add(rx_history *history, const rx_test_image *images, rx_selection *selection,
                         rx_epoch epoch, rx_error *err)
{
    double sum[RX_BINS_MAX] = {0}, loss = 0, input = 0, *errors = NULL;
    long count[RX_BINS_MAX] = {0}, all = 0, at = 0;
    for (int b = 0; b < selection->nbins; b++)
        all += selection->test[b];
    const size_t most = (size_t)all * RX_SAMPLE_STARS;
    RX_TRY(rx_history_resize(history, history->n + 1, err));
    rx_epoch_bin *bins = history->bin + (history->n - 1) * history->nbins;
    rx_status status = RX_MAKE(errors, 2 * most, err);
    if (status != RX_OK) {
        history->n--;
        return status;
    }
    tally total = {.errors = errors};
    for (int b = 0; b < selection->nbins; b++) {
        rx_epoch_bin *bin = &bins[b];
        tally one = {.errors = errors + most};
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
    epoch.test_loss = loss / selection->nbins;
    epoch.input_loss = input / selection->nbins;
    conclude(&total, &epoch.recall, &epoch.bias, &epoch.scatter);
    history->epoch[history->n - 1] = epoch;
    free(errors);
    return RX_OK;
}

rx_status rx_history_dictionary(const rx_history *history, const rx_selection *grid, long epoch,
                                rx_model *model, rx_error *err)
{
    const rx_epoch_bin *bins = history->bin + (epoch - 1) * history->nbins;
    if (model->bins == NULL)
        RX_TRY(RX_MAKE(model->bins, (size_t)grid->nbins, err));
    model->nfwhm = grid->nfwhm;
    model->nsigma = grid->nsigma;
    for (int b = 0; b < grid->nbins; b++) {
        rx_model_bin *dst = &model->bins[b];
        *dst = (rx_model_bin){.loss = bins[b].loss,
                              .list = bins[b].list,
                              .recall = bins[b].recall,
                              .bias = bins[b].bias,
                              .scatter = bins[b].scatter,
                              .images = (long)bins[b].test};
        rx_selection_bin(grid, b, dst->fwhm, dst->sigma);
    }
    return RX_OK;
}
