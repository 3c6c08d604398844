/* Epochs kept. */
#include "train/history.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

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
