/* Samples shared among threads. */
#include "train/learner.h"

#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

struct rx_learner {
    const rx_model *model;
    rx_step_params par;
    int side, most, nthreads;
    long n[RX_MODEL_NETS];       /* parameters; 0: no such network */
    rx_step **step, **test;      /* [nthreads] */
    float **each[RX_MODEL_NETS]; /* [most][n] */
    float **planes;              /* [nthreads][3][side][side]: scratch of tests */
};

static void *make_list(int n)
{
    return rx_alloc((size_t)n, sizeof(void *));
}

/* Steps are made one by one: FFTW's planner is not for several threads. */
static rx_status make_steps(rx_learner *l, rx_error *err)
{
    const rx_step_params test = {
        .kind = l->par.kind, .idt_restore = 1, .floor = l->par.floor, .margin = l->par.margin};
    const size_t pixels = 3 * (size_t)l->side * (size_t)l->side;
    rx_status status = RX_OK;
    for (int t = 0; t < l->nthreads && status == RX_OK; t++) {
        status = rx_step_new(l->model, &l->par, l->side, &l->step[t], err);
        if (status == RX_OK)
            status = rx_step_new(l->model, &test, l->side, &l->test[t], err);
        l->planes[t] = RX_NEW(float, pixels);
        if (status == RX_OK && l->planes[t] == NULL)
            status = rx_error_memory(err, pixels * sizeof(float));
    }
    return status;
}

static rx_status make_gradients(rx_learner *l, rx_error *err)
{
    for (int k = 0; k < RX_MODEL_NETS; k++)
        for (int i = 0; i < l->most && l->n[k] > 0; i++) {
            l->each[k][i] = RX_NEW(float, (size_t)l->n[k]);
            if (l->each[k][i] == NULL)
                return rx_error_memory(err, (size_t)l->n[k] * sizeof(float));
        }
    return RX_OK;
}

rx_status rx_learner_new(const rx_model *model, const rx_step_params *par, int side, int most, int nthreads,
                         rx_learner **dst, rx_error *err)
{
    rx_status status = RX_OK;
    rx_net *nets[RX_MODEL_NETS];
    int bad = 0;
    rx_learner *l = RX_NEW(rx_learner, 1);
    if (l == NULL)
        return rx_error_memory(err, sizeof *l);
    *l = (rx_learner){.model = model, .par = *par, .side = side, .most = most, .nthreads = nthreads};
    rx_model_nets(model, nets);
    for (int k = 0; k < RX_MODEL_NETS; k++)
        l->n[k] = nets[k] != NULL ? nets[k]->nparams : 0;
    l->step = make_list(nthreads);
    l->test = make_list(nthreads);
    l->planes = make_list(nthreads);
    for (int k = 0; k < RX_MODEL_NETS; k++) {
        l->each[k] = make_list(most);
        bad |= l->each[k] == NULL;
    }
    if (l->step == NULL || l->test == NULL || l->planes == NULL || bad)
        status = rx_error_memory(err, 0);
    if (status == RX_OK)
        status = make_steps(l, err);
    if (status == RX_OK)
        status = make_gradients(l, err);
    if (status != RX_OK) {
        rx_learner_free(l);
        return status;
    }
    *dst = l;
    return RX_OK;
}

void rx_learner_free(rx_learner *l)
{
    if (l == NULL)
        return;
    for (int t = 0; t < l->nthreads; t++) {
        if (l->step != NULL)
            rx_step_free(l->step[t]);
        if (l->test != NULL)
            rx_step_free(l->test[t]);
        if (l->planes != NULL)
            free(l->planes[t]);
    }
    for (int k = 0; k < RX_MODEL_NETS; k++) {
        for (int i = 0; i < l->most && l->each[k] != NULL; i++)
            free(l->each[k][i]);
        free(l->each[k]);
    }
    free(l->step);
    free(l->test);
    free(l->planes);
    free(l);
}

void rx_learner_load(rx_learner *l)
{
    for (int t = 0; t < l->nthreads; t++) {
        rx_step_load(l->step[t]);
        rx_step_load(l->test[t]);
    }
}

/* One sample on one thread. */
typedef rx_status work(rx_learner *l, int thread, const rx_sample *sample, int i, void *dst, rx_error *err);

static rx_status learn(rx_learner *l, int thread, const rx_sample *sample, int i, void *dst, rx_error *err)
{
    rx_step_values *values = dst;
    float *mine[RX_MODEL_NETS];
    for (int k = 0; k < RX_MODEL_NETS; k++) {
        mine[k] = l->each[k][i];
        if (mine[k] != NULL)
            memset(mine[k], 0, (size_t)l->n[k] * sizeof(float));
    }
    RX_TRY(rx_step_run(l->step[thread], sample, mine, &values[i], err));
    rx_gradient_clip(mine, l->n, RX_MODEL_NETS, l->par.clip);
    return RX_OK;
}

static rx_status test(rx_learner *l, int thread, const rx_sample *sample, int i, void *dst, rx_error *err)
{
    rx_test_image *images = dst;
    rx_step_values values = {0};
    const size_t pixels = (size_t)l->side * (size_t)l->side;
    float *weight = l->planes[thread], *shown = weight + pixels;
    images[i] = (rx_test_image){0};
    RX_TRY(rx_step_run(l->test[thread], sample, NULL, &values, err));
    images[i].loss = values.idt_restore;
    rx_loss_weights(sample->x, l->side, l->par.floor, weight + pixels, weight);
    rx_loss_pixels(&(rx_loss){l->par.kind, l->side, l->par.margin, weight}, sample->x, sample->y, 1,
                   &images[i].input, NULL);
    memcpy(shown, rx_step_restored(l->test[thread]), pixels * sizeof *shown);
    for (size_t k = 0; k < pixels; k++)
        shown[k] = rx_front_shown(shown[k]);
    return rx_star_check_run(sample, shown, l->par.margin, l->model->front.target_fwhm, &images[i].check,
                             err);
}

/* All samples; of several errors that of the first sample is reported. */
static rx_status share(rx_learner *l, work *function, rx_sample *const *samples, int n, void *dst,
                       rx_error *err)
{
    rx_status status = RX_OK;
    int first = n;
#pragma omp parallel num_threads(l->nthreads)
    {
        /* what is called from here, and has threads of its own, keeps to this one */
        omp_set_num_threads(1);
#pragma omp for schedule(dynamic, 1)
        for (int i = 0; i < n; i++) {
            rx_error mine = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
            const rx_status done = function(l, omp_get_thread_num(), samples[i], i, dst, &mine);
            if (done == RX_OK)
                continue;
#pragma omp critical(rx_learner_failed)
            if (i < first) {
                first = i;
                status = done;
                rx_error_take(err, &mine);
            }
        }
    }
    return status;
}

rx_status rx_learner_gradients(rx_learner *l, rx_sample *const *samples, int n, rx_step_values *values,
                               rx_error *err)
{
    return share(l, learn, samples, n, values, err);
}

void rx_learner_add(const rx_learner *l, int net, int n, float *sum)
{
#pragma omp parallel for num_threads(l->nthreads) schedule(static)
    for (long p = 0; p < l->n[net]; p++)
        for (int i = 0; i < n; i++)
            sum[p] += l->each[net][i][p];
}

rx_status rx_learner_test(rx_learner *l, rx_sample *const *samples, int n, rx_test_image *dst, rx_error *err)
{
    return share(l, test, samples, n, dst, err);
}
