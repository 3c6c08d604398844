/* Numbers of the report on fluxes. */
#include "lab/fluxes_numbers.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/stats.h"
#include "quality/hypothesis.h"

static const double LEVEL = 0.95, SIGMAS = 1.96;
static const double MEDIAN_ERROR = 1.2533, MAD_ERROR = 1.1664;
static const double MAG = 1.0857362047581296; /* 2.5 / ln 10 */
static const double LEAST_RATIO = 1e-3;       /* of a flux of a pair */

const double RX_PAIR_EDGE[RX_PAIR_BINS + 1] = {0.5, 0.75, 1, 1.5, 2, 3};

const rx_snr_bin *rx_snr_bin_get(int bin)
{
    static const rx_snr_bin bins[RX_SNR_BINS] = {
        {"5-10", 5, 10},         {"10-20", 10, 20},         {"20-50", 20, 50}, {"50-100", 50, 100},
        {"100-1000", 100, 1000}, {"1000+", 1000, HUGE_VAL}, {"5-100", 5, 100}, {"10+", 10, HUGE_VAL}};
    return &bins[bin];
}

const char *rx_crowd_name(rx_crowd crowd)
{
    static const char *const names[RX_CROWDS] = {"isolated", "blended", "told apart", "neither"};
    return names[crowd];
}

const char *rx_fluxes_sample_name(int sample)
{
    static const char *const names[RX_SAMPLES] = {"all", "detected", "common"};
    return names[sample];
}

/* --- where things are --- */

static size_t cell_count(const rx_lab *r)
{
    return (size_t)r->nconditions * (size_t)r->nscenes * RX_SAMPLES * 2 * RX_CROWDS * RX_SNR_BINS *
           (size_t)r->nruns * RX_FLUX_KINDS;
}

static rx_fluxes_cell *cell_at(const rx_fluxes_numbers *m, const rx_fluxes_place *p)
{
    const rx_lab *r = m->lab;
    size_t i = (size_t)p->condition * (size_t)r->nscenes + (size_t)p->scene;
    i = (i * RX_SAMPLES + (size_t)p->sample) * 2 + (size_t)p->galaxy;
    i = (i * RX_CROWDS + (size_t)p->crowd) * RX_SNR_BINS + (size_t)p->bin;
    return &m->cell[(i * (size_t)r->nruns + (size_t)p->run) * RX_FLUX_KINDS + (size_t)p->flux];
}

const rx_fluxes_cell *rx_fluxes_cell_of(const rx_fluxes_numbers *m, const rx_fluxes_place *place)
{
    return cell_at(m, place);
}

static size_t pair_index(const rx_lab *r, const rx_pair_place *p)
{
    size_t i = (size_t)p->condition * (size_t)r->nscenes + (size_t)p->scene;
    i = (i * RX_PAIR_SAMPLES + (size_t)p->sample) * RX_PAIR_BINS + (size_t)p->bin;
    return i * (size_t)r->nruns + (size_t)p->run;
}

const rx_pair_cell *rx_pair_cell_of(const rx_fluxes_numbers *m, const rx_pair_place *p, rx_flux_kind flux)
{
    return &m->pair[pair_index(m->lab, p) * RX_FLUX_KINDS + (size_t)flux];
}

const rx_estimate *rx_pair_share(const rx_fluxes_numbers *m, const rx_pair_place *p)
{
    return &m->both[pair_index(m->lab, p)];
}

const rx_invented_cell *rx_invented_of(const rx_fluxes_numbers *m, int condition, int scene, int run)
{
    return &m->invented[((size_t)condition * (size_t)m->lab->nscenes + (size_t)scene) *
                            (size_t)m->lab->nruns +
                        (size_t)run];
}

/* --- statistics --- */

static rx_estimate around(double value, double error, long n)
{
    return (rx_estimate){value, value - SIGMAS * error, value + SIGMAS * error, n};
}

static rx_estimate nothing(void)
{
    return (rx_estimate){NAN, NAN, NAN, 0};
}

/* Median and sigma_MAD of n values, which are lost. */
static void robust(double *v, long n, rx_estimate *median, rx_estimate *width)
{
    double middle = NAN;
    if (n < 2) {
        *median = *width = nothing();
        median->value = n == 1 ? v[0] : NAN;
        median->n = n;
        return;
    }
    const double sigma = rx_sigma_mad(v, (size_t)n, &middle), root = sqrt((double)n);
    *median = around(middle, MEDIAN_ERROR * sigma / root, n);
    *width = around(sigma, MAD_ERROR * sigma / root, n);
}

static rx_estimate mean_of(const double *v, long n)
{
    double sum = 0, square = 0;
    for (long i = 0; i < n; i++)
        sum += v[i];
    if (n < 2)
        return (rx_estimate){n == 1 ? sum : NAN, NAN, NAN, n};
    for (long i = 0; i < n; i++)
        square += (v[i] - sum / (double)n) * (v[i] - sum / (double)n);
    return around(sum / (double)n, sqrt(square / (double)(n - 1) / (double)n), n);
}

static double to_mag(double ratio)
{
    return ratio > 0 ? -2.5 * log10(ratio) : NAN;
}

/* --- cells --- */

/* Lists of one cell. */
typedef struct lists {
    double *ratio, *bound, *pull, *magerr; /* room for all objects of a set each */
    long n, npulls;
} lists;

static rx_status lists_new(size_t n, lists *dst, rx_error *err)
{
    double *all = RX_NEW(double, 4 * n + 4);
    if (all == NULL)
        return rx_error_memory(err, 4 * n * sizeof *all);
    *dst = (lists){.ratio = all, .bound = all + n + 1, .pull = all + 2 * n + 2, .magerr = all + 3 * n + 3};
    return RX_OK;
}

static void finish_cell(lists *l, int with_bound, rx_fluxes_cell *dst)
{
    rx_estimate middle, unused;
    dst->magerr = mean_of(l->magerr, l->n);
    robust(l->bound, with_bound ? l->n : 0, &unused, &dst->bound);
    robust(l->pull, l->npulls, &dst->pull, &dst->width);
    robust(l->ratio, l->n, &middle, &dst->scatter);
    dst->bias = (rx_estimate){to_mag(middle.value), to_mag(middle.high), to_mag(middle.low), middle.n};
    dst->scatter.value *= MAG;
    dst->scatter.low *= MAG;
    dst->scatter.high *= MAG;
}

static const double *column(const rx_lab_table *object, int run, long i)
{
    return rx_lab_each(object, i, run);
}

static const rx_lab_table *objects_of(const rx_lab *r, int condition, int scene)
{
    return &rx_lab_set_of(r, condition, scene)->table[RX_FLUXES_OBJECT];
}

/* Found by that run, with all its fluxes. */
static int measured(const rx_lab_table *set, int run, long i, rx_fluxes_sample sample)
{
    const double *v = column(set, run, i);
    const double state = v[RX_FOUND]; /* NAN, not found, fails both */
    int finite = sample == RX_SAMPLE_ALL ? state >= 0 : state < 2;
    for (int k = 0; k < RX_FLUX_KINDS; k++)
        finite = finite && isfinite(v[RX_RATIO + k]);
    return finite;
}

/* Is object i in the sample. */
static int takes_part(const rx_lab *r, const rx_lab_table *set, const rx_fluxes_place *p, long i)
{
    const double *prop = rx_lab_own(set, i);
    const rx_snr_bin *bin = rx_snr_bin_get(p->bin);
    const rx_blend_state company = (rx_blend_state)prop[RX_PROP_BLEND_STATE];
    const rx_blend_state asked = p->crowd == RX_CROWD_ISOLATED  ? RX_ISOLATED
                                 : p->crowd == RX_CROWD_NEITHER ? RX_NEITHER
                                                                : RX_BLENDED;
    if ((int)prop[RX_PROP_GALAXY] != p->galaxy || company != asked || !(prop[RX_PROP_SNR] >= bin->low) ||
        !(prop[RX_PROP_SNR] < bin->high))
        return 0;
    for (int run = 0; run < r->nruns; run++) {
        if (p->sample != RX_SAMPLE_COMMON && run != p->run)
            continue;
        if (!measured(set, run, i, p->sample) ||
            (p->crowd == RX_CROWD_APART && !(column(set, run, i)[RX_BOTH] > 0.5)))
            return 0;
    }
    return 1;
}

static void fill_cell(const rx_fluxes_numbers *m, const rx_fluxes_place *p, lists *l)
{
    const rx_lab *r = m->lab;
    const rx_lab_table *set = objects_of(r, p->condition, p->scene);
    l->n = l->npulls = 0;
    for (long i = 0; i < set->n; i++) {
        if (!takes_part(r, set, p, i))
            continue;
        const double *v = column(set, p->run, i);
        const double ratio = v[RX_RATIO + p->flux], error = v[RX_ERROR + p->flux];
        l->ratio[l->n] = ratio;
        l->magerr[l->n] = 100 * fabs(ratio - 1);
        l->bound[l->n++] = (ratio - 1) / rx_lab_own(set, i)[RX_PROP_BOUND];
        if (error > 0 && isfinite(error))
            l->pull[l->npulls++] = (ratio - 1) / error;
    }
    finish_cell(l, !p->galaxy && p->crowd == RX_CROWD_ISOLATED, cell_at(m, p));
}

static void fill_set(const rx_fluxes_numbers *m, int condition, int scene, lists *l)
{
    for (int sample = 0; sample < RX_SAMPLES; sample++)
        for (int galaxy = 0; galaxy < 2; galaxy++)
            for (int crowd = 0; crowd < RX_CROWDS; crowd++)
                for (int bin = 0; bin < RX_SNR_BINS; bin++)
                    for (int run = 0; run < m->lab->nruns; run++)
                        for (int flux = 0; flux < RX_FLUX_KINDS; flux++)
                            fill_cell(m,
                                      &(rx_fluxes_place){condition, scene, (rx_fluxes_sample)sample, galaxy,
                                                         (rx_crowd)crowd, bin, run, (rx_flux_kind)flux},
                                      l);
}

/* --- pairs --- */

/* The other member when i is the first of a pair of that bin, else -1. */
static long second_of(const rx_lab_table *set, long i, int bin)
{
    const double *prop = rx_lab_own(set, i);
    const long further = (long)prop[RX_PROP_PARTNER];
    const double apart = prop[RX_PROP_APART];
    return further > 0 && apart >= RX_PAIR_EDGE[bin] && apart < RX_PAIR_EDGE[bin + 1] ? i + further : -1;
}

static double least(double ratio)
{
    return fmax(ratio, LEAST_RATIO);
}

/* Pairs of one place; *all of them, of which l holds one flux of the n that are told apart. */
static long take_pairs(const rx_lab_table *set, const rx_pair_place *p, int flux, lists *l, long *all)
{
    long n = 0;
    *all = 0;
    for (long i = 0; i < set->n; i++) {
        const long k = second_of(set, i, p->bin);
        if (k < 0)
            continue;
        const double *a = column(set, p->run, i), *b = column(set, p->run, k);
        ++*all;
        if (!(a[RX_BOTH] > 0.5) || !measured(set, p->run, i, p->sample) ||
            !measured(set, p->run, k, p->sample))
            continue;
        const double ra = a[RX_RATIO + flux], rb = b[RX_RATIO + flux];
        const double share = pow(10, 0.4 * rx_lab_own(set, i)[RX_PROP_MAGS]);
        const double off = -2.5 * log10(least(rb) / least(ra));
        l->ratio[n] = off;
        l->bound[n] = fabs(off);
        l->pull[n++] = to_mag(least((ra + share * rb) / (1 + share)));
    }
    return n;
}

static void fill_pairs(const rx_fluxes_numbers *m, const rx_pair_place *p, lists *l)
{
    const rx_lab *r = m->lab;
    const rx_lab_table *set = objects_of(r, p->condition, p->scene);
    const size_t index = pair_index(r, p);
    for (int flux = 0; flux < RX_FLUX_KINDS; flux++) {
        long all = 0;
        const int pairs = r->scene[p->scene].id == RX_SCENE_MIXED_PAIRS;
        const long n = !pairs ? 0 : take_pairs(set, p, flux, l, &all);
        rx_pair_cell *cell = &m->pair[index * RX_FLUX_KINDS + (size_t)flux];
        rx_estimate unused;
        robust(l->ratio, n, &cell->ratio, &cell->scatter);
        robust(l->bound, n, &cell->size, &unused);
        robust(l->pull, n, &cell->total, &unused);
        m->both[index] = rx_binomial_interval(n, all, LEVEL);
    }
}

/* --- invented sources --- */

/* Mean number of detections on the galaxies that were found. */
static rx_estimate pieces_of(const rx_lab_table *set, int run, int kept, lists *l)
{
    long n = 0;
    for (long i = 0; i < set->n; i++) {
        const double *v = column(set, run, i);
        if (!isnan(v[RX_FOUND]))
            l->ratio[n++] = v[RX_PIECES + kept];
    }
    return mean_of(l->ratio, n);
}

static void fill_invented(const rx_lab *r, int condition, int scene, int run, lists *l, rx_invented_cell *dst)
{
    const rx_lab_table *tile = &rx_lab_set_of(r, condition, scene)->table[RX_FLUXES_TILE];
    double t[RX_FLUXES_TALLIES] = {0}, mpixels = 0;
    for (long i = 0; i < tile->n; i++) {
        mpixels += rx_lab_own(tile, i)[RX_FLUXES_MPIXELS];
        for (int k = 0; k < RX_FLUXES_TALLIES; k++)
            t[k] += rx_lab_each(tile, i, run)[k];
    }
    const long weak = (long)t[RX_TALLY_WEAK], strong = (long)t[RX_TALLY_STRONG];
    dst->right[0] = (long)t[RX_TALLY_RIGHT];
    dst->right[1] = (long)t[RX_TALLY_RIGHT_KEPT];
    dst->wrong[0] = (long)t[RX_TALLY_FALSE];
    dst->wrong[1] = (long)t[RX_TALLY_FALSE_KEPT];
    dst->added = (long)t[RX_TALLY_ADDED];
    for (int k = 0; k < 2; k++) {
        dst->per_mpixel[k] = rx_poisson_rate(dst->wrong[k], mpixels, LEVEL);
        dst->precision[k] = rx_binomial_interval(dst->right[k], dst->right[k] + dst->wrong[k], LEVEL);
        dst->pieces[k] = r->scene[scene].id == RX_SCENE_SHREDS
                             ? pieces_of(objects_of(r, condition, scene), run, k, l)
                             : mean_of(l->ratio, 0);
    }
    dst->flagged_weak = rx_binomial_interval(weak - (long)t[RX_TALLY_WEAK_KEPT], weak, LEVEL);
    dst->flagged_strong = rx_binomial_interval(strong - (long)t[RX_TALLY_STRONG_KEPT], strong, LEVEL);
}

/* --- all --- */

rx_status rx_fluxes_numbers_make(const rx_lab *r, rx_fluxes_numbers *dst, rx_error *err)
{
    const size_t sets = (size_t)r->nconditions * (size_t)r->nscenes, runs = (size_t)r->nruns;
    size_t most = 0;
    lists l = {0};
    *dst = (rx_fluxes_numbers){.lab = r};
    for (size_t s = 0; s < sets; s++)
        most = (size_t)r->set[s].table[RX_FLUXES_OBJECT].n > most
                   ? (size_t)r->set[s].table[RX_FLUXES_OBJECT].n
                   : most;
    dst->cell = RX_NEW(rx_fluxes_cell, cell_count(r));
    dst->pair = RX_NEW(rx_pair_cell, sets * RX_PAIR_SAMPLES * RX_PAIR_BINS * runs * RX_FLUX_KINDS);
    dst->both = RX_NEW(rx_estimate, sets * RX_PAIR_SAMPLES * RX_PAIR_BINS * runs);
    dst->invented = RX_NEW(rx_invented_cell, sets * runs);
    rx_status status = dst->cell == NULL || dst->pair == NULL || dst->both == NULL || dst->invented == NULL
                           ? rx_error_memory(err, cell_count(r) * sizeof *dst->cell)
                           : lists_new(most, &l, err);
    for (int c = 0; status == RX_OK && c < r->nconditions; c++)
        for (int s = 0; s < r->nscenes; s++) {
            fill_set(dst, c, s, &l);
            for (int run = 0; run < r->nruns; run++) {
                for (int k = 0; k < RX_PAIR_SAMPLES * RX_PAIR_BINS; k++)
                    fill_pairs(
                        dst,
                        &(rx_pair_place){c, s, (rx_fluxes_sample)(k / RX_PAIR_BINS), k % RX_PAIR_BINS, run},
                        &l);
                const size_t i = ((size_t)c * (size_t)r->nscenes + (size_t)s) * runs + (size_t)run;
                fill_invented(r, c, s, run, &l, &dst->invented[i]);
            }
        }
    free(l.ratio);
    if (status != RX_OK)
        rx_fluxes_numbers_free(dst);
    return status;
}

void rx_fluxes_numbers_free(rx_fluxes_numbers *numbers)
{
    free(numbers->cell);
    free(numbers->pair);
    free(numbers->both);
    free(numbers->invented);
    *numbers = (rx_fluxes_numbers){0};
}
