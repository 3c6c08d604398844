/* Making and copying the state of a training. */
#include "train/state.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

rx_status rx_train_state_new(const rx_model *model, const rx_selection *selection, rx_train_state **dst,
                             rx_error *err)
{
    rx_net *nets[RX_MODEL_NETS];
    rx_status status = RX_OK;
    rx_model_nets(model, nets);
    rx_train_state *state = RX_NEW(rx_train_state, 1);
    if (state == NULL)
        return rx_error_memory(err, sizeof *state);
    state->selection = *selection;
    state->history.nbins = selection->nbins;
    state->best = INFINITY;
    state->slow = 1;
    for (int k = 0; k < RX_MODEL_NETS && status == RX_OK; k++) {
        if (nets[k] == NULL)
            continue;
        const size_t n = (size_t)nets[k]->nparams;
        state->params[k] = RX_NEW(float, n);
        state->best_params[k] = RX_NEW(float, n);
        status = state->params[k] != NULL && state->best_params[k] != NULL
                     ? rx_adam_new(nets[k]->nparams, &state->adam[k], err)
                     : rx_error_memory(err, n * sizeof(float));
        if (status == RX_OK)
            memcpy(state->params[k], nets[k]->params, n * sizeof(float));
    }
    if (status != RX_OK) {
        rx_train_state_free(state);
        return status;
    }
    *dst = state;
    return RX_OK;
}

void rx_train_state_free(rx_train_state *state)
{
    if (state == NULL)
        return;
    for (int k = 0; k < RX_MODEL_NETS; k++) {
        free(state->params[k]);
        free(state->best_params[k]);
        rx_adam_free(state->adam[k]);
    }
    rx_history_free(&state->history);
    free(state);
}

rx_status rx_train_state_copy(const rx_train_state *src, rx_train_state *dst, rx_error *err)
{
    rx_train_state own = *dst;
    rx_status status = rx_history_copy(&src->history, &own.history, err);
    *dst = *src;
    dst->history = own.history;
    for (int k = 0; k < RX_MODEL_NETS; k++) {
        const size_t bytes = src->adam[k] != NULL ? (size_t)src->adam[k]->n * sizeof(float) : 0;
        dst->params[k] = own.params[k];
        dst->best_params[k] = own.best_params[k];
        dst->adam[k] = own.adam[k];
        if (bytes == 0)
            continue;
        dst->adam[k]->steps = src->adam[k]->steps;
        memcpy(dst->params[k], src->params[k], bytes);
        memcpy(dst->best_params[k], src->best_params[k], bytes);
        memcpy(dst->adam[k]->mean, src->adam[k]->mean, bytes);
        memcpy(dst->adam[k]->square, src->adam[k]->square, bytes);
    }
    return status;
}

void rx_train_state_rank(rx_train_state *state, double validation)
{
    if (state->best_epoch > 0 && !(validation < state->best))
        return;
    state->best = isnan(validation) ? INFINITY : validation;
    state->best_epoch = state->epoch;
    for (int k = 0; k < RX_MODEL_NETS; k++)
        if (state->adam[k] != NULL)
            memcpy(state->best_params[k], state->params[k], (size_t)state->adam[k]->n * sizeof(float));
}

static void load(const rx_train_state *state, float *const *params, rx_model *model)
{
    rx_net *nets[RX_MODEL_NETS];
    rx_model_nets(model, nets);
    for (int k = 0; k < RX_MODEL_NETS; k++)
        if (state->adam[k] != NULL)
            memcpy(nets[k]->params, params[k], (size_t)state->adam[k]->n * sizeof(float));
}

void rx_train_state_load(const rx_train_state *state, rx_model *model)
{
    load(state, state->params, model);
}

void rx_train_state_load_best(const rx_train_state *state, rx_model *model)
{
    load(state, state->best_params, model);
}
