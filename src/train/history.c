/* Epochs kept, and written as tables. */
#include "train/history.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "validate/ecsv.h"

void rx_history_free(rx_history *history)
{
    free(history->epoch);
    free(history->bin);
    *history = (rx_history){.nbins = history->nbins};
}

static rx_status grow(rx_history *history, long capacity, rx_error *err)
{
    const size_t n = (size_t)capacity, nbins = (size_t)history->nbins;
    rx_epoch *epochs = rx_regrow(history->epoch, n, sizeof *epochs);
    if (epochs == NULL)
        return rx_error_memory(err, n * sizeof *epochs);
    history->epoch = epochs;
    rx_epoch_bin *bins = rx_regrow(history->bin, n * nbins, sizeof *bins);
    if (bins == NULL)
        return rx_error_memory(err, n * nbins * sizeof *bins);
    history->bin = bins;
    history->capacity = capacity;
    return RX_OK;
}

rx_status rx_history_add(rx_history *history, const rx_epoch *epoch, const rx_epoch_bin *bins, rx_error *err)
{
    rx_status status = RX_OK;
    if (history->n == history->capacity)
        status = grow(history, history->capacity > 0 ? 2 * history->capacity : 16, err);
    if (status != RX_OK)
        return status;
    const size_t nbins = (size_t)history->nbins;
    history->epoch[history->n] = *epoch;
    memcpy(history->bin + (size_t)history->n * nbins, bins, nbins * sizeof *bins);
    history->n++;
    return RX_OK;
}

rx_status rx_history_copy(const rx_history *src, rx_history *dst, rx_error *err)
{
    rx_status status = RX_OK;
    dst->n = 0;
    dst->nbins = src->nbins;
    if (src->n > dst->capacity)
        status = grow(dst, src->n, err);
    if (status != RX_OK || src->n == 0)
        return status;
    memcpy(dst->epoch, src->epoch, (size_t)src->n * sizeof *src->epoch);
    memcpy(dst->bin, src->bin, (size_t)src->n * (size_t)src->nbins * sizeof *src->bin);
    dst->n = src->n;
    return RX_OK;
}

/* Name, unit and meaning of the numbers of a row. */
typedef struct column {
    const char *name, *unit, *meaning;
} column;

static rx_ecsv begin(rx_text *dst, const char *name, const char *title, const column *columns, size_t n)
{
    rx_ecsv table = rx_ecsv_on(dst);
    rx_ecsv_meta(&table, "title", title);
    rx_ecsv_meta(&table, "model", name);
    rx_ecsv_column(&table, "epoch", RX_ECSV_LONG, "", "from 1");
    for (size_t i = 0; i < n; i++)
        rx_ecsv_column(&table, columns[i].name, RX_ECSV_FLOAT, columns[i].unit, columns[i].meaning);
    rx_ecsv_columns_end(&table);
    return table;
}

void rx_history_log(const rx_history *history, const char *name, rx_text *dst)
{
    static const column columns[] = {
        {"steps", "", "steps of the optimiser so far"},
        {"patches", "", "training images so far"},
        {"rate", "", "learning rate of the last step"},
        {"gradient", "", "mean norm of the gradient before clipping"},
        {"loss", "", "weighted sum of the terms, mean over the training images"},
        {"idt_restore", "", "RESTORE(blurred) against sharp"},
        {"idt_psf", "", "PSF(sharp) against blurred"},
        {"rec_restore", "", "RESTORE(PSF(sharp)) against sharp"},
        {"rec_psf", "", "PSF(RESTORE(blurred)) against blurred"},
        {"ffl", "", "focal frequency loss"},
        {"test_loss", "", "RESTORE(blurred) against sharp, test images, mean over the bins"},
        {"input_loss", "", "the blurred test images themselves against sharp"},
        {"recall", "", "of test stars of S/N above 5"},
        {"bias", "", "median relative error of the flux of isolated test stars of S/N above 12"},
        {"scatter", "", "1.4826 MAD of the same"},
        {"validation", "", "RESTORE(blurred) against sharp, validation images, the same in every epoch"},
    };
    rx_ecsv table = begin(dst, name, "log of a training", columns, sizeof columns / sizeof *columns);
    for (long e = 0; e < history->n; e++) {
        const rx_epoch *x = &history->epoch[e];
        const double values[] = {x->steps,          x->patches,
                                 x->rate,           x->norm,
                                 x->losses.total,   x->losses.idt_restore,
                                 x->losses.idt_psf, x->losses.rec_restore,
                                 x->losses.rec_psf, x->losses.ffl,
                                 x->test_loss,      x->input_loss,
                                 x->recall,         x->bias,
                                 x->scatter,        x->validation};
        rx_ecsv_count(&table, e + 1);
        for (size_t i = 0; i < sizeof values / sizeof *values; i++)
            rx_ecsv_number(&table, values[i]);
        rx_ecsv_row_end(&table);
    }
}

void rx_history_dictionaries(const rx_history *history, const rx_selection *grid, const char *name,
                             rx_text *dst)
{
    static const column columns[] = {
        {"fwhm_low", "pix", "bin, from"},
        {"fwhm_high", "pix", "bin, to"},
        {"sigma_low", "", "bin, from: noise where the brightest 0.1 % of the blurred pixels begin at 255"},
        {"sigma_high", "", "bin, to"},
        {"loss", "", "mean test loss"},
        {"list", "", "the same normalised, which decides the counts of the next epoch"},
        {"train", "", "training images of this epoch"},
        {"test", "", "test images of this epoch"},
        {"recall", "", "of test stars of S/N above 5"},
        {"bias", "", "median relative error of the flux of isolated test stars of S/N above 12"},
        {"scatter", "", "1.4826 MAD of the same"},
    };
    rx_ecsv table = begin(dst, name, "dictionary of every epoch", columns, sizeof columns / sizeof *columns);
    for (long e = 0; e < history->n; e++)
        for (int b = 0; b < history->nbins; b++) {
            const rx_epoch_bin *x = &history->bin[e * history->nbins + b];
            double fwhm[2], sigma[2];
            rx_selection_bin(grid, b, fwhm, sigma);
            const double values[] = {fwhm[0],  fwhm[1], sigma[0],  sigma[1], x->loss,   x->list,
                                     x->train, x->test, x->recall, x->bias,  x->scatter};
            rx_ecsv_count(&table, e + 1);
            for (size_t i = 0; i < sizeof values / sizeof *values; i++)
                rx_ecsv_number(&table, values[i]);
            rx_ecsv_row_end(&table);
        }
}
