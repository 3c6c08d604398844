/* Rings around bright stars, on the residual of all points: what the model misses is seen with neighbours gone. */
#include "psf/psf_rings.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"
#include "psf/psf_stretch.h"

enum { RINGS = 64, BRIGHT = 60 };
static const double RATIO = 1.12; /* of the radii of rings */
static const double SKY_RING =
    1.3; /* outer radius of the ring for the sky, in units of the outermost ring's */
static const double JOINED = 12.0; /* sigmas of the last ring to join a law at */
static const double CLEAR = 3.0;   /* sigmas of a ring that stands out of the noise */
static const double SPIKE = 15.0;  /* times the mean of its ring that a star may have along spikes */

typedef struct ring {
    double mean, error;
    int n;
} ring;

typedef struct rings {
    int n;                  /* the sky's is number n */
    double edge[RINGS + 2]; /* ring j: edge[j] <= r < edge[j + 1] */
} rings;

static rings rings_of(const rx_psf_job *job)
{
    const double reach = (job->model.nwing - 2) * RX_PSF_WING_STEP, step = fmax(0.6, job->fwhm / 7.0);
    rings r = {.n = 0};
    while (r.n < RINGS && r.edge[r.n] < reach - 0.5) {
        r.edge[r.n + 1] = fmin(
            fmax(r.edge[r.n] * RATIO, r.edge[r.n] + (r.edge[r.n] < 2.0 * job->fwhm ? step : 1.0)), reach);
        r.n++;
    }
    r.edge[r.n + 1] = SKY_RING * r.edge[r.n];
    return r;
}

/* Means of the residual around a star, pixels left out that stick out by three sigmas of the sky and by fifteen times the
 * star's own light in the ring (level: the model's means), which spikes do not. values [side of the sky's ring]^2: work. */
static void look_around(const rx_psf_job *job, const rx_psf_point *p, const rings *r, const double *level,
                        double *values, ring *dst)
{
    const rx_image *image = job->image;
    const int reach = (int)ceil(r->edge[r->n + 1]), cx = (int)lround(p->x), cy = (int)lround(p->y);
    const int x0 = cx > reach ? cx - reach : 0,
              x1 = cx + reach < image->width ? cx + reach + 1 : image->width;
    const int y0 = cy > reach ? cy - reach : 0,
              y1 = cy + reach < image->height ? cy + reach + 1 : image->height;
    size_t start[RINGS + 2] = {0}, end[RINGS + 1];
    for (int fill = 0; fill < 2; fill++) { /* how many pixels a ring has, then these */
        for (int y = y0; y < y1; y++) {
            const size_t row = (size_t)y * (size_t)image->width;
            int j = 0;
            for (int x = x0; x < x1; x++) {
                const double away =
                    job->used[row + (size_t)x] != 0 ? rx_psf_job_radius(job, x - p->x, y - p->y) : HUGE_VAL;
                if (away >= r->edge[r->n + 1])
                    continue;
                while (away < r->edge[j])
                    j--;
                while (away >= r->edge[j + 1])
                    j++;
                if (fill)
                    values[end[j]++] = (double)job->rest[row + (size_t)x] - p->sky_guess;
                else
                    start[j + 1]++;
            }
        }
        for (int j = 0; j <= r->n && !fill; j++) {
            start[j + 1] += start[j];
            end[j] = start[j];
        }
    }
    double noise = image->global_noise;
    for (int j = r->n; j >= 0; j--) {
        double *own = values + start[j], sum = 0.0, square = 0.0, centre = 0.0, room = HUGE_VAL;
        const size_t all = start[j + 1] - start[j];
        const double light = j < r->n ? fmax(p->flux * level[j], 0.0) : 0.0;
        if (all > 8) {
            centre = rx_median(own, all);
            if (j == r->n) {
                for (size_t k = 0; k < all; k++)
                    square += fmin(fabs(own[k] - centre), 3.0 * image->global_noise);
                noise = fmax(1.25 * square / (double)all, 0.5 * image->global_noise);
                square = 0.0;
            }
            room = 3.0 * noise + SPIKE * light;
        }
        int n = 0;
        for (size_t k = 0; k < all; k++)
            if (fabs(own[k] - centre) <= room) {
                sum += own[k];
                square += own[k] * own[k];
                n++;
            }
        const double mean = n > 0 ? sum / n : 0.0;
        const double expected = noise * noise + (image->gain > 0.0 ? light / image->gain : 0.0);
        dst[j] = (ring){.mean = mean, .n = n, .error = HUGE_VAL};
        if (n > 0)
            dst[j].error = sqrt(fmax(expected, n > 8 ? square / n - mean * mean : 0.0) / n);
    }
}

typedef struct bright {
    double flux;
    int i;
} bright;

static int by_flux(const void *a, const void *b)
{
    const bright *x = a, *y = b;
    return x->flux != y->flux ? (x->flux < y->flux) - (x->flux > y->flux) : (x->i > y->i) - (x->i < y->i);
}

/* The brightest stars that are fitted, at most BRIGHT, down to a hundredth of the tenth brightest. */
static int list_bright(const rx_psf_job *job, bright *list)
{
    int n = 0, m;
    for (int i = 0; i < job->n; i++)
        if (job->points[i].kept && !job->points[i].reserved)
            list[n++] = (bright){job->points[i].flux, i};
    qsort(list, (size_t)n, sizeof *list, by_flux);
    for (m = 0; m < n && m < BRIGHT; m++)
        if (m >= 10 && list[m].flux < 0.01 * list[9].flux)
            break;
    return m;
}

/* Mean of a ring over the stars [n], each on its own sky, in units of their fluxes; what sticks out by four sigmas is
 * left out. */
static ring combine(const rx_psf_job *job, const bright *stars, int n, const ring *around, int nrings, int j,
                    double level)
{
    ring result = {.error = HUGE_VAL};
    double low = -HUGE_VAL, high = HUGE_VAL;
    for (int pass = 0; pass < 3; pass++) {
        double sum = 0.0, weights = 0.0, scatter = 0.0;
        result.n = 0;
        for (int s = 0; s < n; s++) {
            const ring *own = around + (size_t)s * (size_t)(nrings + 1), *sky = own + nrings;
            const double flux = job->points[stars[s].i].flux, away = sky->n > 100 ? sky->mean : 0.0;
            const double value = (own[j].mean - away) / flux,
                         error = hypot(own[j].error, sky->n > 100 ? sky->error : 0.0) / flux;
            if (own[j].n < 1 || value < low || value > high || !isfinite(error))
                continue;
            const double w = 1.0 / (error * error + 0.0009 * level * level + 1e-30);
            sum += w * value;
            scatter += w * value * value;
            weights += w;
            result.n++;
        }
        if (result.n < 1)
            return result;
        result.mean = sum / weights;
        const double spread = sqrt(fmax(scatter / weights - result.mean * result.mean, 0.0));
        result.error = fmax(sqrt(1.0 / weights), result.n > 2 ? spread / sqrt(result.n - 1.0) : 0.0);
        if (result.n < 5)
            return result;
        const double room = 4.0 * fmax(spread, sqrt(1.0 / weights));
        low = result.mean - room;
        high = result.mean + room;
    }
    return result;
}

/* Mean of the model itself in a ring: the core's stamp (NULL: the wing) inside, the wing outside. */
static double model_mean(const rx_psf_job *job, const float *stamp, double from, double to)
{
    const rx_psf_model *model = &job->model;
    const int reach = (int)ceil(to), half = model->half;
    double sum = 0.0;
    int n = 0;
    for (int j = -reach; j <= reach; j++)
        for (int i = -reach; i <= reach; i++) {
            const double r = rx_psf_job_radius(job, i, j);
            if (r < from || r >= to)
                continue;
            n++;
            sum += stamp != NULL && abs(i) <= half && abs(j) <= half
                       ? (double)stamp[(size_t)(j + half) * (size_t)(2 * half + 1) + (size_t)(i + half)]
                       : (double)rx_psf_model_wing(model, r);
        }
    /* a narrow ring of an elongated star may hold no whole pixel */
    return n > 0 ? sum / n : (double)rx_psf_model_wing(model, 0.5 * (from + to));
}

/* Light that falls as a law from ring `from` on: exp(line[0] + line[1] x), x = r (power 0) or ln r (power 1). */
typedef struct tail {
    int from, power;
    double line[2], chi2;
    double error; /* relative, of its amplitude */
    double sky;   /* what the rings are too high by */
} tail;

/* Slope, amplitude and the error of the skies that suit the rings from .. n - 1 best, those in the noise as well: the skies
 * of all stars may be off by three errors of the outermost ring, which over the area of a wing is much light. No slope is
 * flatter than that of light that ends. */
static tail fit_tail(const double *r, const ring *w, int n, int from, int last)
{
    enum { SLOPES = 60 };
    tail best = {.from = from, .chi2 = HUGE_VAL};
    const double least = 1e-9; /* of a ring's error: images without noise */
    const double held = 1.0 / (9.0 * w[n - 1].error * w[n - 1].error + least * least);
    for (int power = 0; power < 2; power++)
        for (int k = 0; k < SLOPES; k++) {
            const double slope = power ? -3.0 - 0.1 * k : -(0.5 + 0.15 * k) / r[last];
            double ab = 0.0, aa = 0.0, bb = 0.0, a = 0.0, b = 0.0, one = held;
            for (int j = from; j < n; j++) {
                if (!(w[j].error < HUGE_VAL))
                    continue;
                const double model = exp(slope * (power ? log(r[j] / r[from]) : r[j] - r[from]));
                const double error = hypot(w[j].error + least, j <= last ? 0.015 * w[j].mean : 0.0),
                             weight = 1.0 / (error * error);
                ab += weight * model * w[j].mean;
                aa += weight * model * model;
                bb += weight * w[j].mean * w[j].mean;
                a += weight * model;
                b += weight * w[j].mean;
                one += weight;
            }
            const double amplitude = (ab - a * b / one) / (aa - a * a / one), sky = (b - a * amplitude) / one;
            const double chi2 = bb - amplitude * ab - sky * b;
            if (amplitude > 0.0 && chi2 < best.chi2) {
                best.chi2 = chi2;
                best.power = power;
                best.sky = sky;
                best.error = 1.0 / (sqrt(aa - a * a / one) * amplitude);
                best.line[1] = slope;
                best.line[0] = log(amplitude) - slope * (power ? log(r[from]) : r[from]);
            }
        }
    return best;
}

/* From the innermost ring outside `inner` from which one law suits all; at the latest from the last few clear ones. */
static tail choose_tail(const double *r, const ring *w, int n, int last, double inner)
{
    int from = 0;
    int latest = last >= 8 ? last - 5 : last >= 5 ? last - 3 : last - 2;
    while (latest > 1 && w[latest].mean < JOINED * w[latest].error)
        latest--;
    while (from < latest && r[from] < inner)
        from++;
    for (;; from++) {
        const tail t = fit_tail(r, w, n, from, last);
        const double freedom = n - from - 2;
        if (from >= latest || t.chi2 < freedom + sqrt(2.0 * freedom))
            return t;
    }
}

/* 0 where either is not light. */
static double log_ratio(double found, double model)
{
    return found > 0.0 && model > 0.0 ? log(found / model) : 0.0;
}

/* The wing's table: what it was, scaled to the rings inside the tail, and the tail. level: what it was in the rings. */
static void fill_wing(rx_psf_model *model, const double *r, const ring *w, const double *level, const tail *t)
{
    for (int i = 0; i < model->nwing; i++) {
        const double at = i * RX_PSF_WING_STEP, x = fmin(fmax(at, r[0]), r[t->from]);
        if (at > r[t->from]) {
            model->wing[i] = (float)exp(t->line[0] + t->line[1] * (t->power ? log(at) : at));
            continue;
        }
        int j = 0;
        while (j + 1 < t->from && r[j + 1] < x)
            j++;
        const double share = t->from > 0 ? (x - r[j]) / (r[j + 1] - r[j]) : 0.0;
        const double a = log_ratio(w[j].mean, level[j]), b = log_ratio(w[j + 1].mean, level[j + 1]);
        model->wing[i] *= (float)exp(a + share * (b - a));
    }
    model->wing[model->nwing - 1] = 0.0F;
}

/* The core's profile: departures of the rings in the core, the wing from half of its radius on. */
static void fill_core(rx_psf_job *job, const double *r, const ring *departure, int n)
{
    const rx_psf_model *model = &job->model;
    for (int k = 0; k < model->side * model->side; k++) {
        const double x = (k % model->side - model->middle) / (double)model->m,
                     y = (k / model->side - model->middle) / (double)model->m,
                     at = rx_psf_job_radius(job, x, y);
        const double t = fmin(fmax((at / model->half - 0.4) / 0.15, 0.0), 1.0),
                     outside = t * t * (3.0 - 2.0 * t);
        int j = 0;
        while (j + 2 < n && r[j + 1] < at)
            j++;
        const double share = fmin(fmax((at - r[j]) / (r[j + 1] - r[j]), 0.0), 1.0);
        const double more = departure[j].mean + share * (departure[j + 1].mean - departure[j].mean);
        job->values[k] =
            (1.0 - outside) * (job->values[k] + more) + outside * (double)rx_psf_model_wing(model, at);
    }
}

/* Light outside r: the table's, and what a power law holds beyond it. */
static double light_beyond(const rx_psf_model *model, double radius, double slope)
{
    const double end = (model->nwing - 2) * RX_PSF_WING_STEP;
    double sum = 0.0;
    for (double r = radius + 0.5 * RX_PSF_WING_STEP; r < end; r += RX_PSF_WING_STEP)
        sum += 2.0 * M_PI * r * RX_PSF_WING_STEP * (double)rx_psf_model_wing(model, r);
    return sum + 2.0 * M_PI * end * end * (double)rx_psf_model_wing(model, end - RX_PSF_WING_STEP) /
                     fmax(-slope - 2.0, 0.5);
}

/* The smallest radius beyond which no more than `least` of all the light lies. */
static void choose_radius(const rx_psf_job *job, const float *stamp, double least, double slope,
                          double *radius, double *beyond)
{
    const rx_psf_model *model = &job->model;
    const double end = fmin(floor((model->nwing - 2) * RX_PSF_WING_STEP), job->most);
    const int half = model->half;
    double core = 0.0;
    for (int j = -half; j <= half; j++)
        for (int i = -half; i <= half; i++)
            if (i * i + j * j <= half * half)
                core += (double)stamp[(size_t)(j + half) * (size_t)(2 * half + 1) + (size_t)(i + half)];
    const double all = core + light_beyond(model, half, slope);
    for (*radius = fmin(half, end); *radius < end && light_beyond(model, *radius, slope) > least * all;)
        *radius += 1.0;
    *beyond = fmax(light_beyond(model, *radius, slope) / all, 0.0); /* measured wings may be below 0 */
}

rx_status rx_psf_wings(rx_psf_job *job, double least, double *radius, double *beyond, double *error,
                       rx_log *log, rx_error *err)
{
    rx_psf_model *model = &job->model;
    const rings r = rings_of(job);
    const size_t core = (size_t)(2 * model->half + 1) * (size_t)(2 * model->half + 1);
    bright *stars = RX_NEW(bright, (size_t)job->n + 1);
    ring *around = RX_NEW(ring, (size_t)BRIGHT * (size_t)(r.n + 1));
    float *stamp = RX_NEW(float, core);
    const size_t box = (size_t)(2 * (int)ceil(r.edge[r.n + 1]) + 1), area = box * box;
    double *values = RX_NEW(double, (size_t)job->nthreads *area);
    double centre[RINGS + 1], level[RINGS + 1], table[RINGS + 1];
    ring w[RINGS + 1], departure[RINGS + 1];
    if (stars == NULL || around == NULL || stamp == NULL || values == NULL) {
        free(stars);
        free(values);
        free(around);
        free(stamp);
        return rx_error_memory(err, 0);
    }
    rx_psf_model_stamp(model, model->c, 0.0, 0.0, model->half,
                       &(rx_psf_stamp){stamp, NULL, NULL, job->stamps});
    for (int j = 0; j < r.n; j++) {
        centre[j] = sqrt(0.5 * (r.edge[j] * r.edge[j] + r.edge[j + 1] * r.edge[j + 1]));
        level[j] = model_mean(job, stamp, r.edge[j], r.edge[j + 1]);
        table[j] = model_mean(job, NULL, r.edge[j], r.edge[j + 1]);
    }
    const int n = list_bright(job, stars);
#pragma omp parallel for schedule(dynamic, 1) num_threads(job->nthreads)
    for (int s = 0; s < n; s++)
        look_around(job, &job->points[stars[s].i], &r, level, values + (size_t)omp_get_thread_num() * area,
                    around + (size_t)s * (size_t)(r.n + 1));
    for (int s = 0; s < n; s++) {
        const ring *sky = around + (size_t)s * (size_t)(r.n + 1) + r.n;
        rx_psf_point *p = &job->points[stars[s].i];
        if (sky->n <= 100)
            continue;
        p->sky_guess += sky->mean;
        p->sky_error = fmax(sky->error, 0.01 * job->image->global_noise);
    }
    /* the rings' own skies have just moved into sky_guess: combine() takes off what was found */
    int last = -1;
    double uncertain = 0.0;
    for (int j = 0; j < r.n; j++) {
        departure[j] = w[j] = combine(job, stars, n, around, r.n, j, level[j]);
        w[j].mean += level[j];
        if (last == j - 1 && w[j].mean > CLEAR * w[j].error) {
            last = j;
            if (j > 0 && centre[j] > 0.5 * model->half)
                w[j].mean = fmin(w[j].mean, w[j - 1].mean);
        }
        rx_log_detail(log, "PSF ring %.2f px: %.4g +- %.2g, %d stars (was %.4g)", centre[j], w[j].mean,
                      w[j].error, w[j].n, level[j]);
        const double d2 = departure[j].mean * departure[j].mean; /* what is noise is left */
        departure[j].mean *=
            isfinite(departure[j].error) ? d2 / (d2 + departure[j].error * departure[j].error + 1e-60) : 0.0;
    }
    double slope = -3.0;
    tail t = {.chi2 = HUGE_VAL};
    if (last >= 3 && centre[last] > 0.6 * model->half)
        t = choose_tail(centre, w, r.n, last, 0.55 * model->half);
    if (!(t.chi2 < HUGE_VAL)) {
        t.from = 0; /* no law suits */
    } else {
        slope = t.power ? t.line[1] : t.line[1] * (model->nwing - 2) * RX_PSF_WING_STEP;
        for (int j = 0; j < r.n; j++) {
            w[j].mean -= t.sky;
            departure[j].mean -= t.sky;
        }
        fill_wing(model, centre, w, table, &t);
        for (int j = 0; j < t.from; j++)
            if (centre[j] > model->half)
                uncertain +=
                    pow(M_PI * (r.edge[j + 1] * r.edge[j + 1] - r.edge[j] * r.edge[j]) * w[j].error, 2.0);
    }
    fill_core(job, centre, departure, r.n);
    choose_radius(job, stamp, least, slope, radius, beyond);
    /* amplitude and slope of the tail; where there is none, half of what the profile has */
    const double light = light_beyond(model, fmax(t.from > 0 ? centre[t.from] : 0.0, model->half), slope);
    *error = sqrt(uncertain + pow(light * (t.from > 0 ? 1.5 * t.error : 0.5), 2.0));
    rx_log_detail(log,
                  "PSF wings: %d bright stars, rings clear to %.1f px, %s %.3g from %.1f px on; all but %.2g "
                  "of the light within %.0f px, +- %.2g",
                  n, last >= 0 ? centre[last] : 0.0, t.power ? "power" : "exponential", t.line[1],
                  t.from > 0 ? centre[t.from] : 0.0, *beyond, *radius, *error);
    free(stars);
    free(around);
    free(stamp);
    free(values);
    return RX_OK;
}

void rx_psf_shapes(const rx_psf_job *job, rx_star_shape *shapes)
{
    const rx_psf_model *model = &job->model;
    const int half = model->half, n = 2 * half + 1, reach = (int)fmin(half, ceil(2.0 * job->fwhm));
    const double narrow = 2.772588722239781 / (job->fwhm * job->fwhm);
    const size_t pixels = (size_t)n * (size_t)n, nodes = (size_t)model->side * (size_t)model->side;
    for (int s = 0; s < job->n; s++) {
        const rx_psf_point *p = &job->points[s];
        if (!p->kept)
            continue;
        const double dx = p->x - lround(p->x), dy = p->y - lround(p->y);
        float *room = job->stamps, *value = room + nodes;
        double terms[RX_PSF_TERMS], model_sum[4] = {0}, data_sum[4] = {0}, noise = 0.0;
        rx_psf_model_terms(model, p->x, p->y, terms);
        rx_psf_model_mix(model, model->c, terms, model->nterms, room);
        rx_psf_model_stamp(model, room, dx, dy, half, &(rx_psf_stamp){value, NULL, NULL, value + 3 * pixels});
        for (int j = -reach; j <= reach; j++)
            for (int i = -reach; i <= reach; i++) {
                const size_t k = (size_t)(j + half) * (size_t)n + (size_t)(i + half);
                const double x = i - dx, y = j - dy, g = exp(-narrow * (x * x + y * y)),
                             light = p->flux * (double)value[k];
                const double data = p->weight[k] > 0.0F ? (double)p->data[k] : light;
                const double part[4] = {1.0, x * x, y * y, x * y};
                for (int q = 0; q < 4; q++) {
                    model_sum[q] += g * light * part[q];
                    data_sum[q] += g * data * part[q];
                }
                const double pull = g * (x * x + y * y);
                noise += p->weight[k] > 0.0F ? pull * pull / (double)p->weight[k] : 0.0;
            }
        const double t = model_sum[1] + model_sum[2],
                     d = (data_sum[1] + data_sum[2]) / data_sum[0] * model_sum[0];
        shapes[s].off[0] = 2.0 * (d - t) / t;
        shapes[s].off[1] = 2.0 * ((data_sum[1] - data_sum[2]) / (data_sum[1] + data_sum[2]) -
                                  (model_sum[1] - model_sum[2]) / t);
        shapes[s].off[2] = 4.0 * (data_sum[3] / (data_sum[1] + data_sum[2]) - model_sum[3] / t);
        shapes[s].error = 2.0 * sqrt(noise) / fabs(t);
    }
}

/* Mean of values [n][2] with their errors, by weight, and its error: what sticks out by four robust sigmas is left out, and
 * a scatter beyond the errors counts. work [2 n]. */
static void weighted_mean(const double (*values)[2], size_t n, double *work, double dst[2])
{
    double centre, sum = 0.0, weights = 0.0, square = 0.0;
    for (size_t i = 0; i < n; i++) {
        work[i] = values[i][0];
        work[n + i] = values[i][1] * values[i][1];
    }
    const double sigma = rx_sigma_mad(work, n, &centre), noise = rx_median(work + n, n),
                 more = fmax(sigma * sigma - noise, 0.04 * sigma * sigma);
    for (size_t i = 0; i < n; i++) {
        const double variance = values[i][1] * values[i][1] + more, off = values[i][0] - centre,
                     w = off * off <= 16.0 * variance ? 1.0 / (variance + 1e-12) : 0.0;
        sum += w * off;
        weights += w;
        square += w * w * off * off;
    }
    dst[0] = weights > 0.0 ? centre + sum / weights : 0.0;
    dst[1] = weights > 0.0 ? fmax(sqrt(square) / weights, sqrt(1.0 / weights)) : 0.0;
}

/* d ln flux / ds of a star that is fitted by the profile, of one whose size is another. */
static double flux_by_size(const rx_psf_job *job)
{
    const rx_psf_model *model = &job->model;
    const double a[RX_PSF_STRETCH] = {0.01, 0.0, 0.0}, none[RX_PSF_STRETCH] = {0.0};
    double product = 0.0, square = 0.0;
    for (int j = -model->half; j <= model->half; j++)
        for (int i = -model->half; i <= model->half; i++) {
            const double x = i * model->m, y = j * model->m,
                         p = rx_psf_stretched(job->prior, model->side, x, y, none);
            product += p * (rx_psf_stretched(job->prior, model->side, x, y, a) - p) / a[0];
            square += p * p;
        }
    return product / square;
}

/* Light of a star's data beyond its model within 2 FWHM, share of its flux, and the noise of that. */
static void core_excess(const rx_psf_job *job, const rx_psf_point *p, double dst[2])
{
    const int half = job->model.half, n = 2 * half + 1, reach = (int)fmin(half, ceil(2.0 * job->fwhm));
    double noise = 0.0;
    dst[0] = 0.0;
    for (int j = -reach; j <= reach; j++)
        for (int i = -reach; i <= reach; i++) {
            const float weight = p->weight[(size_t)(j + half) * (size_t)n + (size_t)(i + half)];
            const int x = (int)lround(p->x) + i, y = (int)lround(p->y) + j;
            if (i * i + j * j > reach * reach || !(weight > 0.0F) || x < 0 || y < 0 ||
                x >= job->image->width || y >= job->image->height)
                continue;
            dst[0] += (double)job->rest[(size_t)y * (size_t)job->image->width + (size_t)x] - p->sky;
            noise += 1.0 / (double)weight;
        }
    dst[0] /= p->flux;
    dst[1] = sqrt(noise) / p->flux;
}

/* Stars of the growth curve: reserved ones, or all where there are fewer than three. */
static int list_judges(const rx_psf_job *job, bright *list)
{
    int n = 0;
    for (int all = 0; all < 2 && n < 3; all++) {
        n = 0;
        for (int i = 0; i < job->n; i++)
            if (job->points[i].kept && (all || job->points[i].reserved))
                list[n++] = (bright){job->points[i].flux, i};
    }
    qsort(list, (size_t)n, sizeof *list, by_flux);
    return n < BRIGHT ? n : BRIGHT;
}

/* The residuals of stars around their nearest pixels, added, over the light of these stars and the PSF's peak. */
static void stack(const rx_psf_job *job, const bright *stars, int n, double peak, rx_psf_judged *judged)
{
    const rx_image *image = job->image;
    const int half = judged->side / 2;
    for (int j = -half; j <= half; j++)
        for (int i = -half; i <= half; i++) {
            double sum = 0.0, light = 0.0;
            for (int s = 0; s < n; s++) {
                const rx_psf_point *p = &job->points[stars[s].i];
                const long x = lround(p->x) + i, y = lround(p->y) + j;
                const size_t at = (size_t)y * (size_t)image->width + (size_t)x;
                if (x < 0 || y < 0 || x >= image->width || y >= image->height || job->used[at] == 0)
                    continue;
                sum += (double)job->rest[at] - p->sky;
                light += p->flux;
            }
            judged->residual[(j + half) * judged->side + i + half] =
                light > 0.0 ? (float)(sum / light / peak) : 0.0F;
        }
}

rx_status rx_psf_judge(const rx_psf_job *job, double wing_error, rx_psf *dst, rx_error *err)
{
    rx_psf_quality *quality = &dst->quality;
    rx_psf_judged *judged = dst->judged = RX_NEW(rx_psf_judged, 1);
    if (judged == NULL)
        return rx_error_memory(err, sizeof *judged);
    judged->side = 2 * job->model.half + 1;
    judged->star = RX_NEW(rx_psf_star, (size_t)job->n + 1);
    judged->growth = RX_NEW(rx_psf_growth, RINGS);
    judged->residual = RX_NEW(float, (size_t)judged->side *(size_t)judged->side);
    const rings r = rings_of(job);
    const size_t box = (size_t)(2 * (int)ceil(r.edge[r.n + 1]) + 1), area = box * box, n = (size_t)job->n + 1;
    rx_star_shape *shapes = RX_NEW(rx_star_shape, n);
    bright *stars = RX_NEW(bright, n);
    ring *around = RX_NEW(ring, (size_t)BRIGHT * (size_t)(r.n + 1));
    double *values = RX_NEW(double, (area > 4 * n ? area : 4 * n)), level[RINGS + 1];
    float *stamp = RX_NEW(float, (size_t)(2 * job->model.half + 1) * (size_t)(2 * job->model.half + 1));
    rx_status status = RX_OK;
    if (shapes == NULL || stars == NULL || around == NULL || values == NULL || stamp == NULL ||
        judged->star == NULL || judged->growth == NULL || judged->residual == NULL) {
        status = rx_error_memory(err, area * sizeof(double));
        goto exit;
    }
    rx_psf_shapes(job, shapes);
    for (int i = 0; i < job->n; i++) {
        const rx_psf_point *p = &job->points[i];
        const rx_star_shape *s = &shapes[i];
        if (p->kept && p->reserved && isfinite(s->off[0]) && isfinite(s->off[1]) && isfinite(s->off[2]))
            judged->star[judged->nstars++] = (rx_psf_star){.x = p->x,
                                                           .y = p->y,
                                                           .flux = p->flux,
                                                           .off = {s->off[0], s->off[1], s->off[2]},
                                                           .error = s->error};
    }
    for (int which = 0; which < 3; which++) {
        size_t m = 0;
        for (int i = 0; i < job->n; i++)
            if (job->points[i].kept && job->points[i].reserved && isfinite(shapes[i].off[which])) {
                values[2 * m] = shapes[i].off[which];
                values[2 * m++ + 1] = shapes[i].error;
            }
        quality->reserved = (int)m;
        if (m > 0)
            weighted_mean((const double(*)[2])values, m, values + 2 * n,
                          which == 0 ? quality->trace : quality->shape[which - 1]);
    }
    /* how much the fitted flux differs from the light: reserved stars, all where there are few */
    size_t m = 0;
    double(*excess)[2] = (double(*)[2])values, scale[2] = {0.0}, more = 0.0;
    for (int i = 0; i < job->n; i++)
        if (job->points[i].kept && (job->points[i].reserved || quality->reserved < 5) &&
            job->points[i].flux > 0.0)
            core_excess(job, &job->points[i], excess[m++]);
    if (m > 0)
        weighted_mean((const double(*)[2])excess, m, values + 2 * n, scale);
    scale[0] = fmax(fabs(scale[0]), scale[1]);
    const int judges = list_judges(job, stars);
    rx_psf_model_stamp(&job->model, job->model.c, 0.0, 0.0, job->model.half,
                       &(rx_psf_stamp){stamp, NULL, NULL, job->stamps});
    for (int j = 0; j < r.n; j++)
        level[j] = model_mean(job, stamp, r.edge[j], r.edge[j + 1]);
    for (int s = 0; s < judges; s++)
        look_around(job, &job->points[stars[s].i], &r, level, values, around + (size_t)s * (size_t)(r.n + 1));
    const double peak =
        (double)stamp[(size_t)job->model.half * (size_t)judged->side + (size_t)job->model.half];
    stack(job, stars, judges, peak, judged);
    for (int k = 0; k < judged->side * judged->side; k++) {
        const int x = k % judged->side - job->model.half, y = k / judged->side - job->model.half;
        if (x * x + y * y <= job->fwhm * job->fwhm)
            quality->residual = fmax(quality->residual, fabs((double)judged->residual[k]));
    }
    double within = 0.0, error = 0.0, light = 0.0;
    for (int j = 0; j < r.n && judges > 0; j++) {
        const ring d = combine(job, stars, judges, around, r.n, j, level[j]);
        const double pixels = M_PI * (r.edge[j + 1] * r.edge[j + 1] - r.edge[j] * r.edge[j]);
        within += d.mean * pixels;
        error += d.error * pixels; /* of the sky, in all rings alike */
        light += level[j] * pixels;
        if (!(error < 0.1))
            break;
        judged->growth[judged->nradii++] =
            (rx_psf_growth){.radius = r.edge[j + 1], .stars = light + within, .psf = light, .error = error};
        if (error < 0.01 && fabs(within) > 2.0 * error)
            more = fmax(more, fabs(within));
        if (error < 0.01 && fabs(within) > fabs(quality->growth)) {
            quality->growth = within;
            quality->growth_error = error;
            quality->growth_radius = r.edge[j + 1];
        }
    }
    quality->flux_error = hypot(wing_error, fmax(scale[0], more));
    const double by_size = flux_by_size(job);
    for (int i = 0; i < RX_PSF_CELLS * RX_PSF_CELLS; i++)
        quality->flux_errors[i / RX_PSF_CELLS][i % RX_PSF_CELLS] =
            fabs(by_size) * job->variation.error[i / RX_PSF_CELLS][i % RX_PSF_CELLS];
exit:
    free(shapes);
    free(stars);
    free(around);
    free(values);
    free(stamp);
    return status;
}
