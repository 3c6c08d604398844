/* Rings around bright stars, on the residual of all points: what the model misses is seen with neighbours gone. */
#include "psf/psf_rings.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"
#include "psf/psf_stretch.h"

enum { RINGS = 64, BRIGHT = 60, SATURATED = 30, SCALED_BY = 3 };
static const double RATIO = 1.12; /* of the radii of rings */
static const double SKY_RING =
    1.3; /* outer radius of the ring for the sky, in units of the outermost ring's */
static const double JOINED = 12.0; /* sigmas of the last ring to join a law at */
static const double CLEAR = 3.0;   /* sigmas of a ring that stands out of the noise */
static const double KNOWN = 8.0;   /* sigmas of a ring that saturated stars are scaled by */
static const double UNLIKE =
    0.3; /* share of pixels that no star would have, of a saturated source that is none */
/* Light of a halo that a Moffat of the core lacks, mean over PSFs: a choice, not a measurement. */
static const double HALO_LIGHT = 0.05;
static const double SPIKE = 15.0; /* times the mean of its ring that a star may have along spikes */

typedef struct ring {
    double mean, error;
    int n;
} ring;

typedef struct rings {
    int n;                  /* the sky's is number n */
    double edge[RINGS + 2]; /* ring j: edge[j] <= r < edge[j + 1] */
    double square[RINGS + 2];
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
    for (int j = 0; j < r.n + 2; j++)
        r.square[j] = r.edge[j] * r.edge[j];
    return r;
}

double rx_psf_rings_reach(const rx_psf_job *job)
{
    const rings r = rings_of(job);
    return r.edge[r.n + 1];
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
    const double round = job->model.half * job->model.half; /* squared radius from which rings are circles */
    size_t start[RINGS + 2] = {0}, end[RINGS + 1];
    for (int fill = 0; fill < 2; fill++) { /* how many pixels a ring has, then these */
        for (int y = y0; y < y1; y++) {
            const size_t row = (size_t)y * (size_t)image->width;
            int j = 0;
            for (int x = x0; x < x1; x++) {
                double away = (x - p->x) * (x - p->x) + (y - p->y) * (y - p->y);
                if (away < round)
                    away = pow(rx_psf_job_radius(job, x - p->x, y - p->y), 2.0);
                if (away >= r->square[r->n + 1] || !rx_psf_job_uses(job, p, row + (size_t)x))
                    continue;
                while (away < r->square[j])
                    j--;
                while (away >= r->square[j + 1])
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
        double light = j < r->n ? fmax(p->flux * level[j], 0.0) : 0.0;
        if (all > 8) {
            centre = rx_median(own, all);
            if (j < r->n && !(p->flux > 0.0)) /* a saturated one, not yet scaled */
                light = fmax(centre, 0.0);
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
        if (n > 0 && r->edge[j] >= p->saturated)
            dst[j].error = sqrt(fmax(expected, n > 8 ? square / n - mean * mean : 0.0) / n);
    }
}

/* Pixels of the square around a star that look_around() may want to sort. */
static size_t area_of(const rings *r)
{
    const size_t side = (size_t)(2 * (int)ceil(r->edge[r->n + 1]) + 1);
    return side * side;
}

/* around [n][r->n + 1]; values [threads][area_of()]: work. */
static void look_around_all(const rx_psf_job *job, const rx_ranked *stars, int n, const rings *r,
                            const double *level, double *values, ring *around)
{
    const size_t area = area_of(r);
#pragma omp parallel for schedule(dynamic, 1) num_threads(job->nthreads)
    for (int s = 0; s < n; s++)
        look_around(job, &job->points[stars[s].index], r, level, values + (size_t)omp_get_thread_num() * area,
                    around + (size_t)s * (size_t)(r->n + 1));
}

/* The brightest stars that are fitted, at most BRIGHT, down to a hundredth of the tenth brightest. */
static int list_bright(const rx_psf_job *job, rx_ranked *list)
{
    int n = 0, m;
    for (int i = 0; i < job->n; i++)
        if (job->points[i].kept && !job->points[i].reserved && job->points[i].ringed)
            list[n++] = (rx_ranked){job->points[i].flux, i};
    rx_rank_falling(list, (size_t)n);
    for (m = 0; m < n && m < BRIGHT; m++)
        if (m >= 10 && list[m].value < 0.01 * list[9].value)
            break;
    return m;
}

/* Saturated ones, the smallest core first, at most SATURATED. */
static int list_saturated(const rx_psf_job *job, rx_ranked *list)
{
    int n = 0;
    for (int i = 0; i < job->n; i++)
        if (job->points[i].saturated > 0.0 && job->points[i].ringed && job->points[i].unlike < UNLIKE)
            list[n++] = (rx_ranked){-job->points[i].saturated, i};
    rx_rank_falling(list, (size_t)n);
    return n < SATURATED ? n : SATURATED;
}

/* The flux of a saturated star is what its rings hold of the profile w where stars of smaller cores know it, up to ring
 * `known`, the first SCALED_BY outside its core; farther ones are of use, with the error of this scale, and follow the new
 * flux. 0: rings that disagree. */
static void scale(rx_psf_point *p, const rings *r, const double *level, const ring *w, int known, ring *own)
{
    const double sky = own[r->n].n > 100 ? own[r->n].mean : 0.0, old = p->flux;
    double sum = 0.0, square = 0.0, weights = 0.0;
    int n = 0;
    int last = -1;
    for (int j = 0; j <= known && n < SCALED_BY; j++) {
        const double light = own[j].mean - sky + old * level[j], floor = 0.03;
        if (own[j].n < 1 || !isfinite(own[j].error) || !(light > KNOWN * own[j].error))
            continue;
        const double ratio = light / w[j].mean, off = own[j].error / light, of = w[j].error / w[j].mean,
                     weight = 1.0 / (off * off + of * of + floor * floor);
        sum += weight * ratio;
        square += weight * ratio * ratio;
        weights += weight;
        last = j;
        n++;
    }
    const double flux = n > 0 ? sum / weights : 0.0;
    const double spread = n > 1 ? sqrt(fmax(square / weights / (flux * flux) - 1.0, 0.0)) : 0.0,
                 error = hypot(spread / sqrt(n + 1e-9), sqrt(1.0 / fmax(weights, 1.0)));
    p->flux = spread < (old > 0.0 ? 0.15 : 0.5) && error < 0.15 ? flux : 0.0;
    for (int j = 0; j < r->n; j++) {
        own[j].mean += (old - p->flux) * level[j];
        own[j].error =
            j > last && p->flux > 0.0 && spread < 0.15
                ? hypot(own[j].error,
                        error * (j <= known ? p->flux * w[j].mean : own[j].mean - sky + p->flux * level[j]))
                : HUGE_VAL;
    }
}

/* Mean of a ring over the stars [n], each on its own sky, in units of their fluxes; what sticks out by four sigmas is
 * left out. */
static ring combine(const rx_psf_job *job, const rx_ranked *stars, int n, const ring *around, int nrings,
                    int j, double level)
{
    ring result = {.error = HUGE_VAL};
    double low = -HUGE_VAL, high = HUGE_VAL;
    for (int pass = 0; pass < 3; pass++) {
        double sum = 0.0, weights = 0.0, scatter = 0.0;
        result.n = 0;
        for (int s = 0; s < n; s++) {
            const ring *own = around + (size_t)s * (size_t)(nrings + 1), *sky = own + nrings;
            const double flux = job->points[stars[s].index].flux, away = sky->n > 100 ? sky->mean : 0.0;
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
    double
        error; /* of the light from there on, relative: of amplitude, and as other laws suit the rings nearly as well */
    double sky; /* what the rings are too high by */
} tail;

/* Slope, amplitude and the error of the skies that suit the rings from .. n - 1 best, those in the noise as well: the skies
 * of all stars may be off by three errors of the outermost ring, which over the area of a wing is much light. No slope is
 * flatter than that of light that ends. */
static tail fit_tail(const double *r, const ring *w, int n, int from, int last)
{
    enum { SLOPES = 60 };
    double chi2s[2 * SLOPES], lights[2 * SLOPES], all = 0.0, square = 0.0, light = 0.0;
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
            const double chi2 = bb - amplitude * ab - sky * b, end = r[n - 1] / r[from];
            const int law = power * SLOPES + k;
            lights[law] = power
                              ? amplitude * r[from] * r[from] * (1.0 - pow(end, slope + 2.0)) / (-slope - 2.0)
                              : amplitude * (1.0 - r[from] * slope) / (slope * slope);
            chi2s[law] = amplitude > 0.0 ? chi2 : HUGE_VAL;
            if (amplitude > 0.0 && chi2 < best.chi2) {
                best.chi2 = chi2;
                best.power = power;
                best.sky = sky;
                best.error = 1.0 / (sqrt(aa - a * a / one) * amplitude);
                light = lights[law];
                best.line[1] = slope;
                best.line[0] = log(amplitude) - slope * (power ? log(r[from]) : r[from]);
            }
        }
    for (int law = 0; law < 2 * SLOPES && light > 0.0; law++) {
        const double weight = exp(-0.5 * (chi2s[law] - best.chi2));
        all += weight;
        square += weight > 0.0 ? weight * pow(lights[law] / light - 1.0, 2.0) : 0.0;
    }
    best.error = hypot(best.error, all > 0.0 ? sqrt(square / all) : 0.0);
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

typedef struct {
    double value, precision; /* 1 / variance, 0 where the rings say nothing */
} fitted;

/* Amplitude of a profile [n] in what the rings from `from` on hold beyond the wing, and its precision. The sky is free
 * as in fit_tail(); that of each ring is off by what the outer half of the rings holds beyond its errors, as among bright
 * neighbours. */
static fitted fit_profile(const rx_psf_job *job, const double *r, const ring *w, int n, int from,
                          const double *profile)
{
    const double least = 1e-9;
    double ab = 0.0, aa = 0.0, a = 0.0, b = 0.0, one = 0.0, uneven = 0.0, off[RINGS];
    for (int j = 0; j < n; j++) {
        off[j] = w[j].mean - (double)rx_psf_model_wing(&job->model, r[j]);
        if (j >= n / 2 && w[j].error < HUGE_VAL)
            uneven += (off[j] * off[j] - w[j].error * w[j].error) / (n - n / 2);
    }
    uneven = fmax(uneven, least * least);
    for (int j = from; j < n; j++) {
        if (!(w[j].error < HUGE_VAL))
            continue;
        const double error = hypot(w[j].error, 0.015 * w[j].mean), weight = 1.0 / (error * error + uneven);
        ab += weight * profile[j] * off[j];
        aa += weight * profile[j] * profile[j];
        a += weight * profile[j];
        b += weight * off[j];
        one += weight;
    }
    one += 1.0 / (9.0 * w[n - 1].error * w[n - 1].error + uneven);
    const double precision = fmax(aa - a * a / one, 0.0);
    return (fitted){precision > 0.0 ? (ab - a * b / one) / precision : 0.0, precision};
}

/* Light that the rings from `from` on may hide beyond the wing, its posterior: *light expected beyond that ring, *error
 * 1 sigma of it. Half of the tiles have no halo, else its light is exponentially
 * distributed about HALO_LIGHT, its scale is any of 1, 1.5, 2.25 and 3.4 FWHM: where rings say nothing, this prior is left; where they
 * show a halo or exclude it, they decide. With likelihood N(a; a0, s) and prior exp(-a / t) / t, a > 0, the posterior is
 * N(a0 - s^2 / t, s), cut off at 0. */
static rx_psf_halo hidden_halo(const rx_psf_job *job, const double *r, const ring *w, int n, int from,
                               double *light, double *error)
{
    enum { SCALES = RX_PSF_HALO_SCALES };
    rx_psf_halo h = {.n = 0};
    double evidence[SCALES], square[SCALES], beyond[SCALES], profile[RINGS], most = 0.0, all, second = 0.0;
    *light = 0.0;
    for (double wide = job->fwhm; h.n < SCALES && wide < 0.4 * r[n - 1]; wide *= 1.5) {
        const int k = h.n;
        for (int j = from; j < n; j++)
            profile[j] = exp(-r[j] / wide);
        const fitted found = fit_profile(job, r, w, n, from, profile);
        if (!(found.precision > 0.0))
            continue;
        h.wide[h.n++] = wide;
        beyond[k] = 2.0 * M_PI * wide * wide * (1.0 + r[from] / wide) * exp(-r[from] / wide);
        const double s = 1.0 / sqrt(found.precision), scale = HALO_LIGHT / beyond[k],
                     mean = found.value - s * s / scale, z = mean / s;
        const double below = 0.5 * erfc(-z / M_SQRT2), hazard = exp(-0.5 * z * z) / sqrt(2.0 * M_PI) / below;
        if (z > -5.0) {
            evidence[k] = log(s / scale * sqrt(2.0 * M_PI) * below) + 0.5 * z * z;
            h.amount[k] = mean + s * hazard;
            square[k] = mean * mean + s * s + mean * s * hazard;
        } else { /* far below 0 it is an exponential */
            evidence[k] = log(s / scale / -z);
            h.amount[k] = -s / z;
            square[k] = 2.0 * s * s / (z * z);
        }
        most = fmax(most, evidence[k]);
    }
    all = exp(-most);
    for (int k = 0; k < h.n; k++)
        all += exp(evidence[k] - most) / h.n;
    for (int k = 0; k < h.n; k++) {
        const double share = exp(evidence[k] - most) / h.n / all;
        h.amount[k] *= share;
        *light += h.amount[k] * beyond[k];
        second += share * square[k] * beyond[k] * beyond[k];
    }
    *error = sqrt(fmax(second - *light * *light, 0.0));
    return h;
}

/* That of the job, into the wing's table; times -1 out of it. */
static void add_halo(rx_psf_job *job, double times)
{
    for (int k = 0; k < job->halo.n; k++)
        for (int i = 0; i < job->model.nwing - 1; i++)
            job->model.wing[i] +=
                (float)(times * job->halo.amount[k] * exp(-i * RX_PSF_WING_STEP / job->halo.wide[k]));
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

/* The stars of the rings: *few bright ones, *n with saturated ones, which are scaled; each on its own sky. */
typedef struct ringed {
    rx_ranked *stars;
    int few, n, scaled;
    rings r;
    ring *around; /* [n][r.n + 1] */
    double centre[RINGS + 1], level[RINGS + 1],
        table[RINGS + 1]; /* radius; mean of the model, and of its wing */
} ringed;

static void scale_saturated(rx_psf_job *job, ringed *of, rx_log *log)
{
    ring w[RINGS + 1];
    for (int s = of->few; s < of->n; s++) { /* each knows rings farther out for the next */
        rx_psf_point *p = &job->points[of->stars[s].index];
        int known = -1;
        for (int j = 0; j < of->r.n && known == j - 1; j++) {
            w[j] = combine(job, of->stars, s, of->around, of->r.n, j, of->level[j]);
            w[j].mean += of->level[j];
            known += w[j].mean > KNOWN * w[j].error;
        }
        scale(p, &of->r, of->level, w, known, of->around + (size_t)s * (size_t)(of->r.n + 1));
        of->scaled += p->flux > 0.0;
        rx_log_detail(
            log, "PSF saturated star at %.2f, %.2f: core %.1f px, known to ring %d, flux %.4g, unlike %.2f",
            p->x + 1.0, p->y + 1.0, p->saturated, known, p->flux, p->unlike);
    }
}

/* The rings' own skies move into sky_guess: combine() takes off what was found. */
static void look_at_stars(rx_psf_job *job, ringed *of, double *values, const float *stamp, rx_log *log)
{
    const rings *r = &of->r;
    for (int j = 0; j < r->n; j++) {
        of->centre[j] = sqrt(0.5 * (r->edge[j] * r->edge[j] + r->edge[j + 1] * r->edge[j + 1]));
        of->level[j] = model_mean(job, stamp, r->edge[j], r->edge[j + 1]);
        of->table[j] = model_mean(job, NULL, r->edge[j], r->edge[j + 1]);
    }
    of->few = list_bright(job, of->stars);
    of->n = of->few + list_saturated(job, of->stars + of->few);
    look_around_all(job, of->stars, of->n, r, of->level, values, of->around);
    for (int s = 0; s < of->n; s++) {
        const ring *sky = of->around + (size_t)s * (size_t)(r->n + 1) + r->n;
        rx_psf_point *p = &job->points[of->stars[s].index];
        if (sky->n <= 100)
            continue;
        p->sky_guess += sky->mean;
        p->sky_error = fmax(sky->error, 0.01 * job->image->global_noise);
    }
    scale_saturated(job, of, log);
}

/* Profile [n] of the rings, how it departs from the model as far as that is not noise; the last ring of those that stand
 * out without a gap. */
static int read_rings(const rx_psf_job *job, const ringed *of, ring *w, ring *departure, rx_log *log)
{
    int last = -1;
    for (int j = 0; j < of->r.n; j++) {
        departure[j] = w[j] = combine(job, of->stars, of->n, of->around, of->r.n, j, of->level[j]);
        w[j].mean += of->level[j];
        if (last == j - 1 && w[j].mean > CLEAR * w[j].error) {
            last = j;
            if (j > 0 && of->centre[j] > 0.5 * job->model.half)
                w[j].mean = fmin(w[j].mean, w[j - 1].mean);
        }
        rx_log_detail(log, "PSF ring %.2f px: %.4g +- %.2g, %d stars (was %.4g)", of->centre[j], w[j].mean,
                      w[j].error, w[j].n, of->level[j]);
        const double d2 = departure[j].mean * departure[j].mean;
        departure[j].mean *=
            isfinite(departure[j].error) ? d2 / (d2 + departure[j].error * departure[j].error + 1e-60) : 0.0;
    }
    return last;
}

rx_status rx_psf_wings(rx_psf_job *job, double least, rx_psf_wing *dst, rx_log *log, rx_error *err)
{
    rx_psf_model *model = &job->model;
    ringed of = {.r = rings_of(job)};
    const rings *r = &of.r;
    const int n = r->n;
    const size_t core = (size_t)(2 * model->half + 1) * (size_t)(2 * model->half + 1);
    of.stars = RX_NEW(rx_ranked, 2 * (size_t)job->n + 1);
    of.around = RX_NEW(ring, (size_t)(BRIGHT + SATURATED) * (size_t)(n + 1));
    float *stamp = RX_NEW(float, core);
    double *values = RX_NEW(double, (size_t)job->nthreads *area_of(r));
    rx_status status = RX_OK;
    if (of.stars == NULL || of.around == NULL || stamp == NULL || values == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    rx_psf_model_stamp(model, model->c, 0.0, 0.0, model->half,
                       &(rx_psf_stamp){stamp, NULL, NULL, job->stamps});
    look_at_stars(job, &of, values, stamp, log);

    ring w[RINGS + 1], departure[RINGS + 1];
    const int last = read_rings(job, &of, w, departure, log);
    double slope = -3.0, uncertain = 0.0;
    tail t = {.chi2 = HUGE_VAL};
    if (last >= 3 && of.centre[last] > 0.6 * model->half)
        t = choose_tail(of.centre, w, n, last, 0.55 * model->half);
    const int suits = t.chi2 < HUGE_VAL && t.from > 0;
    double light, error;
    if (suits) {
        slope = t.power ? t.line[1] : t.line[1] * (model->nwing - 2) * RX_PSF_WING_STEP;
        for (int j = 0; j < n; j++) {
            w[j].mean -= t.sky;
            departure[j].mean -= t.sky;
        }
        fill_wing(model, of.centre, w, of.table, &t);
        for (int j = 0; j < t.from; j++)
            if (of.centre[j] > model->half)
                uncertain +=
                    pow(M_PI * (r->edge[j + 1] * r->edge[j + 1] - r->edge[j] * r->edge[j]) * w[j].error, 2.0);
        uncertain += pow(light_beyond(model, of.centre[t.from], slope) * t.error, 2.0);
        hidden_halo(job, of.centre, w, n, t.from, &light, &error);
        error = hypot(error, light);
        job->halo.n = 0; /* what was added is part of what the rings were scaled by */
    } else {             /* the wing of the first profile, which may be off by half, and a halo */
        int from = 0;
        double profile[RINGS];
        add_halo(job, -1.0);
        while (from < last && of.centre[from] < 0.4 * model->half)
            from++;
        for (int j = 0; j < n; j++)
            profile[j] = (double)rx_psf_model_wing(model, of.centre[j]);
        const fitted off = fit_profile(job, of.centre, w, n, from, profile);
        uncertain = pow(light_beyond(model, of.centre[from], slope), 2.0) / (4.0 + off.precision);
        job->halo = hidden_halo(job, of.centre, w, n, from, &light, &error);
        add_halo(job, 1.0);
    }
    fill_core(job, of.centre, departure, n);
    choose_radius(job, stamp, least, slope, &dst->radius, &dst->beyond);
    dst->hidden = error;
    dst->error = sqrt(uncertain + error * error);
    rx_log_detail(log,
                  "PSF wings: %d bright stars, %d of %d saturated, rings clear to %.1f px, %s %.3g from %.1f "
                  "px on, hidden %.2g +- %.2g; all but %.2g of the light within %.0f px, +- %.2g",
                  of.few, of.scaled, of.n - of.few, last >= 0 ? of.centre[last] : 0.0,
                  !suits    ? "none"
                  : t.power ? "power"
                            : "exponential",
                  t.line[1], suits ? of.centre[t.from] : 0.0, light, error, dst->beyond, dst->radius,
                  dst->error);
exit:
    free(of.stars);
    free(of.around);
    free(stamp);
    free(values);
    return status;
}

static rx_star_shape shape_of(const rx_psf_job *job, const rx_psf_point *p, float *room)
{
    const rx_psf_model *model = &job->model;
    const int half = model->half, n = 2 * half + 1, reach = (int)fmin(half, ceil(2.0 * job->fwhm));
    const double narrow = 2.772588722239781 / (job->fwhm * job->fwhm);
    const size_t pixels = (size_t)n * (size_t)n, nodes = (size_t)model->side * (size_t)model->side;
    const double dx = p->x - lround(p->x), dy = p->y - lround(p->y);
    float *value = room + nodes;
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
    return (rx_star_shape){.off = {2.0 * (d - t) / t,
                                   2.0 * ((data_sum[1] - data_sum[2]) / (data_sum[1] + data_sum[2]) -
                                          (model_sum[1] - model_sum[2]) / t),
                                   4.0 * (data_sum[3] / (data_sum[1] + data_sum[2]) - model_sum[3] / t)},
                           .error = 2.0 * sqrt(noise) / fabs(t)};
}

void rx_psf_shapes(const rx_psf_job *job, rx_star_shape *shapes)
{
#pragma omp parallel for schedule(dynamic, 8) num_threads(job->nthreads)
    for (int s = 0; s < job->n; s++)
        if (job->points[s].kept)
            shapes[s] = shape_of(job, &job->points[s], rx_psf_job_room(job));
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
    const double none[RX_PSF_STRETCH] = {0.0};
    double product = 0.0, square = 0.0;
    for (int j = -model->half; j <= model->half; j++)
        for (int i = -model->half; i <= model->half; i++) {
            double by[2 + RX_PSF_STRETCH];
            const double p = rx_psf_stretched(job->prior, model->side, i * model->m, j * model->m, none, by);
            product += p * by[2];
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
static int list_tested(const rx_psf_job *job, rx_ranked *list)
{
    int n = 0;
    for (int all = 0; all < 2 && n < 3; all++) {
        n = 0;
        for (int i = 0; i < job->n; i++)
            if (job->points[i].kept && job->points[i].ringed && (all || job->points[i].reserved))
                list[n++] = (rx_ranked){job->points[i].flux, i};
    }
    rx_rank_falling(list, (size_t)n);
    return n < BRIGHT ? n : BRIGHT;
}

/* The residuals of stars around their nearest pixels, added, over the light of these stars and the PSF's peak. */
static void stack(const rx_psf_job *job, const rx_ranked *stars, int n, double peak, rx_psf_tested *tested)
{
    const rx_image *image = job->image;
    const int half = tested->side / 2;
    for (int j = -half; j <= half; j++)
        for (int i = -half; i <= half; i++) {
            double sum = 0.0, light = 0.0;
            for (int s = 0; s < n; s++) {
                const rx_psf_point *p = &job->points[stars[s].index];
                const long x = lround(p->x) + i, y = lround(p->y) + j;
                const size_t at = (size_t)y * (size_t)image->width + (size_t)x;
                if (x < 0 || y < 0 || x >= image->width || y >= image->height || job->used[at] != 1)
                    continue;
                sum += (double)job->rest[at] - p->sky;
                light += p->flux;
            }
            tested->residual[(j + half) * tested->side + i + half] =
                light > 0.0 ? (float)(sum / light / peak) : 0.0F;
        }
}

rx_status rx_psf_test(const rx_psf_job *job, const rx_psf_wing *wing, rx_psf *dst, rx_error *err)
{
    rx_psf_quality *quality = &dst->quality;
    rx_psf_tested *tested = dst->tested = RX_NEW(rx_psf_tested, 1);
    if (tested == NULL)
        return rx_error_memory(err, sizeof *tested);
    tested->side = 2 * job->model.half + 1;
    tested->star = RX_NEW(rx_psf_star, (size_t)job->n + 1);
    tested->growth = RX_NEW(rx_psf_growth, RINGS);
    tested->residual = RX_NEW(float, (size_t)tested->side *(size_t)tested->side);
    const rings r = rings_of(job);
    const size_t area = area_of(&r), n = (size_t)job->n + 1;
    rx_star_shape *shapes = RX_NEW(rx_star_shape, n);
    rx_ranked *stars = RX_NEW(rx_ranked, n);
    ring *around = RX_NEW(ring, (size_t)BRIGHT * (size_t)(r.n + 1));
    double *values = RX_NEW(double, 4 * n + (size_t)job->nthreads * area), level[RINGS + 1];
    float *stamp = RX_NEW(float, (size_t)(2 * job->model.half + 1) * (size_t)(2 * job->model.half + 1));
    rx_status status = RX_OK;
    if (shapes == NULL || stars == NULL || around == NULL || values == NULL || stamp == NULL ||
        tested->star == NULL || tested->growth == NULL || tested->residual == NULL) {
        status = rx_error_memory(err, area * sizeof(double));
        goto exit;
    }
    rx_psf_shapes(job, shapes);
    for (int i = 0; i < job->n; i++) {
        const rx_psf_point *p = &job->points[i];
        const rx_star_shape *s = &shapes[i];
        if (p->kept && p->reserved && isfinite(s->off[0]) && isfinite(s->off[1]) && isfinite(s->off[2]))
            tested->star[tested->nstars++] = (rx_psf_star){.x = p->x,
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
    const int ntests = list_tested(job, stars);
    rx_psf_model_stamp(&job->model, job->model.c, 0.0, 0.0, job->model.half,
                       &(rx_psf_stamp){stamp, NULL, NULL, job->stamps});
    for (int j = 0; j < r.n; j++)
        level[j] = model_mean(job, stamp, r.edge[j], r.edge[j + 1]);
    look_around_all(job, stars, ntests, &r, level, values, around);
    const double peak =
        (double)stamp[(size_t)job->model.half * (size_t)tested->side + (size_t)job->model.half];
    stack(job, stars, ntests, peak, tested);
    for (int k = 0; k < tested->side * tested->side; k++) {
        const int x = k % tested->side - job->model.half, y = k / tested->side - job->model.half;
        if (x * x + y * y <= job->fwhm * job->fwhm)
            quality->residual = fmax(quality->residual, fabs((double)tested->residual[k]));
    }
    double within = 0.0, error = 0.0, light = 0.0;
    for (int j = 0; j < r.n && ntests > 0; j++) {
        const ring d = combine(job, stars, ntests, around, r.n, j, level[j]);
        const double pixels = M_PI * (r.edge[j + 1] * r.edge[j + 1] - r.edge[j] * r.edge[j]);
        within += d.mean * pixels;
        error += d.error * pixels; /* of the sky, in all rings alike */
        light += level[j] * pixels;
        if (!(error < 0.1))
            break;
        tested->growth[tested->nradii++] =
            (rx_psf_growth){.radius = r.edge[j + 1], .stars = light + within, .psf = light, .error = error};
        if (error < 0.01 && fabs(within) > 2.0 * error)
            more = fmax(more, fabs(within));
        if (error < 0.01 && fabs(within) > fabs(quality->growth)) {
            quality->growth = within;
            quality->growth_error = error;
            quality->growth_radius = r.edge[j + 1];
        }
    }
    quality->radius = wing->radius;
    quality->beyond = wing->beyond;
    quality->hidden = wing->hidden;
    quality->flux_error = hypot(wing->error, fmax(scale[0], more));
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
