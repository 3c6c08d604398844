/* Samples shared among threads, and stars of restored patches. */
#include "train/learner.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/stats.h"

/* --- stars --- */

static const double FOUND_SNR = 5, FLUX_SNR = 12, THRESHOLD = 1.7, RADIUS = 1.5, APERTURE = 2;
static const double MOST_EXTRA = 1.05, LEAST = 0.9;

static int is_peak(const float *image, int side, int x, int y)
{
    const float v = image[y * side + x];
    if (!(v > THRESHOLD))
        return 0;
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            const float w = image[(y + dy) * side + x + dx];
            /* of equal neighbours the first one counts */
            if (w > v || (w == v && (dy < 0 || (dy == 0 && dx < 0))))
                return 0;
        }
    return 1;
}

/* The nearest detection that is not taken; takes it. */
static int find(const float *image, int side, const float *star, char *taken)
{
    double nearest = RADIUS * RADIUS;
    long best = -1;
    const int x0 = (int)floor(star[0] - RADIUS), y0 = (int)floor(star[1] - RADIUS), n = (int)(2 * RADIUS) + 3;
    for (int y = y0; y < y0 + n; y++)
        for (int x = x0; x < x0 + n; x++) {
            if (x < 1 || y < 1 || x >= side - 1 || y >= side - 1 || taken[y * side + x])
                continue;
            const double dx = x - star[0], dy = y - star[1], distance = dx * dx + dy * dy;
            if (distance <= nearest && is_peak(image, side, x, y)) {
                best = y * side + x;
                nearest = distance;
            }
        }
    if (best >= 0)
        taken[best] = 1;
    return best >= 0;
}

static double aperture(const float *image, int side, const float *star, double radius)
{
    double sum = 0;
    const int x0 = (int)floor(star[0] - radius), y0 = (int)floor(star[1] - radius);
    const int n = (int)(2 * radius) + 3;
    for (int y = y0 < 0 ? 0 : y0; y < y0 + n && y < side; y++)
        for (int x = x0 < 0 ? 0 : x0; x < x0 + n && x < side; x++) {
            const double dx = x - star[0], dy = y - star[1];
            if (dx * dx + dy * dy <= radius * radius)
                sum += image[y * side + x];
        }
    return sum;
}

/* Are all pixels within `reach` of the star at least `margin` from the border? */
static int inside(const float *star, int side, double margin)
{
    return star[0] >= margin && star[1] >= margin && star[0] <= side - 1 - margin &&
           star[1] <= side - 1 - margin;
}

rx_status rx_star_check_run(const rx_sample *sample, const float *restored, int margin, double target_fwhm,
                            rx_star_check *dst, rx_error *err)
{
    const int side = sample->side;
    const double radius = APERTURE * target_fwhm;
    rx_ranked order[RX_SAMPLE_STARS]; /* by S/N */
    char *taken;
    *dst = (rx_star_check){0};
    RX_TRY(RX_MAKE(taken, (size_t)side * (size_t)side, err));
    for (int i = 0; i < sample->nstars; i++)
        order[i] = (rx_ranked){(double)sample->star[i][3], i};
    rx_rank_falling(order, (size_t)sample->nstars);
    for (int i = 0; i < sample->nstars; i++) {
        const float *star = sample->star[order[i].index];
        if (star[3] > FOUND_SNR && inside(star, side, margin)) {
            dst->stars += 1;
            dst->found += find(restored, side, star, taken);
        }
        if (star[3] > FLUX_SNR && inside(star, side, margin + radius)) {
            const double truth = aperture(sample->y, side, star, radius);
            if (truth < MOST_EXTRA * star[2] && truth > LEAST * star[2])
                dst->error[(int)dst->ratios++] = aperture(restored, side, star, radius) / truth - 1;
        }
    }
    free(taken);
    return RX_OK;
}

/* --- gradients and tests --- */

/* What one thread works with. */
typedef struct bench {
    rx_step *step, *test;
    float *planes; /* [3][side][side]: weights, their scratch or the image that is shown */
} bench;

struct rx_learner {
    const rx_model *model;
    rx_step_params par;
    int side, nthreads;
    long n;       /* parameters */
    float *each;  /* [most][n] */
    bench *bench; /* [nthreads] */
};

rx_status rx_learner_new(const rx_model *model, const rx_step_params *par, int side, int most, int nthreads,
                         rx_learner **dst, rx_error *err)
{
    const rx_step_params test = {
        .kind = par->kind, .idt_restore = 1, .floor = par->floor, .margin = par->margin};
    rx_learner *l;
    rx_status status;
    RX_TRY(RX_MAKE(l, 1, err));
    *l = (rx_learner){.model = model, .par = *par, .side = side, .nthreads = nthreads};
    l->n = rx_model_params(model);
    RX_TRY_EXIT(RX_MAKE(l->bench, (size_t)nthreads, err));
    for (bench *b = l->bench; b < l->bench + nthreads; b++) {
        /* one by one: FFTW's planner is not for several threads */
        RX_TRY_EXIT(rx_step_new(model, &l->par, side, &b->step, err));
        RX_TRY_EXIT(rx_step_new(model, &test, side, &b->test, err));
        RX_TRY_EXIT(RX_MAKE(b->planes, 3 * (size_t)side * (size_t)side, err));
    }
    RX_TRY_EXIT(RX_MAKE(l->each, (size_t)most * (size_t)l->n, err));
    *dst = l;
    return RX_OK;
exit:
    rx_learner_free(l);
    return status;
}

void rx_learner_free(rx_learner *l)
{
    if (l == NULL)
        return;
    for (int t = 0; t < l->nthreads && l->bench != NULL; t++) {
        rx_step_free(l->bench[t].step);
        rx_step_free(l->bench[t].test);
        free(l->bench[t].planes);
    }
    free(l->bench);
    free(l->each);
    free(l);
}

void rx_learner_load(rx_learner *l)
{
    for (int t = 0; t < l->nthreads; t++) {
        rx_step_load(l->bench[t].step);
        rx_step_load(l->bench[t].test);
    }
}

double rx_gradient_clip(float *gradient, long n, double most)
{
    double sum = 0;
    for (long i = 0; i < n; i++)
        sum += (double)gradient[i] * gradient[i];
    const double norm = sqrt(sum);
    if (most > 0 && norm > most)
        for (long i = 0; i < n; i++)
            gradient[i] = (float)(gradient[i] * (most / norm));
    return norm;
}

/* One sample on one thread. */
typedef rx_status work(rx_learner *l, const bench *b, const rx_sample *sample, int i, void *dst,
                       rx_error *err);

static rx_status learn(rx_learner *l, const bench *b, const rx_sample *sample, int i, void *dst,
                       rx_error *err)
{
    rx_step_values *values = dst;
    float *mine = l->each + (size_t)i * (size_t)l->n;
    memset(mine, 0, (size_t)l->n * sizeof *mine);
    RX_TRY(rx_step_run(b->step, sample, mine, &values[i], err));
    rx_gradient_clip(mine, l->n, l->par.clip);
    return RX_OK;
}

static rx_status test(rx_learner *l, const bench *b, const rx_sample *sample, int i, void *dst, rx_error *err)
{
    rx_test_image *images = dst;
    rx_step_values values = {0};
    const size_t pixels = (size_t)l->side * (size_t)l->side;
    float *weight = b->planes, *shown = weight + pixels;
    images[i] = (rx_test_image){0};
    RX_TRY(rx_step_run(b->test, sample, NULL, &values, err));
    images[i].loss = values.idt_restore;
    rx_loss_weights(sample->x, l->side, l->par.floor, weight + pixels, weight);
    rx_loss_pixels(&(rx_loss){l->par.kind, l->side, l->par.margin, weight}, sample->x, sample->y, 1,
                   &images[i].input, NULL);
    memcpy(shown, rx_step_restored(b->test), pixels * sizeof *shown);
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
        const int thread = omp_get_thread_num();
        omp_set_num_threads(1); /* what is called from here, and has threads of its own, keeps to this one */
#pragma omp for schedule(dynamic, 1)
        for (int i = 0; i < n; i++) {
            rx_error mine = rx_error_part(thread == 0 ? err : NULL);
            const rx_status done = function(l, &l->bench[thread], samples[i], i, dst, &mine);
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

void rx_learner_add(const rx_learner *l, int n, float *sum)
{
#pragma omp parallel for num_threads(l->nthreads) schedule(static)
    for (long p = 0; p < l->n; p++)
        for (int i = 0; i < n; i++)
            sum[p] += l->each[(size_t)i * (size_t)l->n + (size_t)p];
}

rx_status rx_learner_test(rx_learner *l, rx_sample *const *samples, int n, rx_test_image *dst, rx_error *err)
{
    return share(l, test, samples, n, dst, err);
}
