/* Numbers of the photometry report: one restorer at a time. */
#include "lab/photometry_numbers.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "quality/completeness.h"
#include "quality/evaluate.h"

static const double LEVEL = 0.95;

static size_t cell_slot(const rx_photometry_numbers *m, int field, int set, int run)
{
    return ((size_t)field * (size_t)m->lab->nscenes + (size_t)set) * (size_t)m->lab->nruns + (size_t)run;
}

const rx_photometry_cell *rx_photometry_cell_of(const rx_photometry_numbers *m, int field, int set, int run)
{
    return &m->cell[cell_slot(m, field, set, run)];
}

const rx_photometry_whole *rx_photometry_whole_of(const rx_photometry_numbers *m, int field, int run)
{
    return &m->whole[(size_t)field * (size_t)m->lab->nruns + (size_t)run];
}

const rx_photometry_duel *rx_photometry_duel_of(const rx_photometry_numbers *m, int field, int set, int pair)
{
    return &m->duel[((size_t)field * (size_t)m->lab->nscenes + (size_t)set) * (size_t)m->npairs +
                    (size_t)pair];
}

rx_photometry_set rx_photometry_set_of(const rx_lab *lab, int field, int set)
{
    const rx_lab_table *table = rx_lab_set_of(lab, field, set)->table;
    rx_photometry_set dst = {.mag = lab->scene[set].mag,
                             .ntiles = table[RX_PHOTOMETRY_TILE].n,
                             .nstars = table[RX_PHOTOMETRY_STAR].n,
                             .star = &table[RX_PHOTOMETRY_STAR],
                             .wrong = &table[RX_PHOTOMETRY_FALSE]};
    for (long t = 0; t < dst.ntiles; t++) {
        dst.mpixels += rx_lab_own(&table[RX_PHOTOMETRY_TILE], t)[RX_FIELD_MPIXELS];
        dst.snr += rx_lab_own(&table[RX_PHOTOMETRY_TILE], t)[RX_FIELD_SNR] / (double)dst.ntiles;
    }
    return dst;
}

static int found(const double *star)
{
    return !isnan(star[RX_STAR_SCORE]);
}

static long nfalse_of(const rx_photometry_set *set, int run)
{
    long n = 0;
    for (long i = 0; i < set->wrong->n; i++)
        n += rx_lab_own(set->wrong, i)[RX_FALSE_STAR_RUN] == run;
    return n;
}

/* Stars found with a score of at least `score`. */
static long found_above(const rx_photometry_set *set, int run, double score)
{
    long n = 0;
    for (long i = 0; i < set->nstars; i++)
        n += rx_star_of(set, run, i)[RX_STAR_SCORE] >= score; /* NAN, not found, is below every score */
    return n;
}

/* Scratch that holds every star or every detection of a field. */
typedef struct scratch {
    double *value, *zero;
    unsigned char *mark;
    uint64_t seed; /* of bootstraps */
} scratch;

/* Detections of sets first..last of one run: score and whether it is a star. */
static long detections(const rx_lab *lab, int field, int first, int last, int run, scratch *s)
{
    long n = 0;
    for (int k = first; k <= last; k++) {
        const rx_photometry_set set = rx_photometry_set_of(lab, field, k);
        for (long i = 0; i < set.nstars; i++)
            if (found(rx_star_of(&set, run, i))) {
                s->mark[n] = 1;
                s->value[n++] = rx_star_of(&set, run, i)[RX_STAR_SCORE];
            }
        for (long i = 0; i < set.wrong->n; i++)
            if (rx_lab_own(set.wrong, i)[RX_FALSE_STAR_RUN] == run) {
                s->mark[n] = 0;
                s->value[n++] = rx_lab_own(set.wrong, i)[RX_FALSE_STAR_SCORE];
            }
    }
    return n;
}

typedef enum star_value { ERROR_PERCENT, ERROR_CLEAN, SIGNED_PERCENT, SIGNED_MAG, PULL } star_value;

static double value_of(const double *star, star_value kind)
{
    switch (kind) {
    case ERROR_PERCENT:
        return 100 * fabs(star[RX_STAR_RATIO] - 1);
    case ERROR_CLEAN:
        return star[RX_STAR_CROWDED] > 0 ? NAN : 100 * fabs(star[RX_STAR_RATIO] - 1);
    case SIGNED_PERCENT:
        return 100 * (star[RX_STAR_RATIO] - 1);
    case SIGNED_MAG:
        return star[RX_STAR_RATIO] > 0 ? -2.5 * log10(star[RX_STAR_RATIO]) : NAN;
    case PULL:
        return star[RX_STAR_PULL];
    }
    return NAN;
}

static long gather(const rx_photometry_set *set, int run, star_value kind, double *dst)
{
    long n = 0;
    for (long i = 0; i < set->nstars; i++) {
        const double *star = rx_star_of(set, run, i);
        double v = found(star) ? value_of(star, kind) : NAN;
        if (isfinite(v))
            dst[n++] = v;
    }
    return n;
}

static rx_status mean_of(const rx_photometry_set *set, int run, star_value kind, scratch *s, rx_estimate *dst,
                         rx_error *err)
{
    long n = gather(set, run, kind, s->value);
    *dst = (rx_estimate){NAN, NAN, NAN, 0};
    return n > 0 ? rx_paired_bootstrap(n, s->value, s->zero, LEVEL, s->seed, dst, err) : RX_OK;
}

static void robust_of(const rx_photometry_set *set, int run, star_value kind, scratch *s, rx_estimate *median,
                      rx_estimate *sigma)
{
    long n = gather(set, run, kind, s->value);
    rx_robust_estimates(s->value, n, LEVEL, median, sigma);
}

static rx_status measure_cell(rx_photometry_numbers *m, int f, int k, int run, scratch *s, rx_error *err)
{
    const rx_photometry_set own = rx_photometry_set_of(m->lab, f, k), *set = &own;
    rx_photometry_cell *dst = &m->cell[cell_slot(m, f, k, run)];
    long nfound = 0, crowded = 0;
    for (long i = 0; i < set->nstars; i++) {
        nfound += found(rx_star_of(set, run, i));
        crowded += found(rx_star_of(set, run, i)) && rx_star_of(set, run, i)[RX_STAR_CROWDED] > 0;
    }
    dst->recall = rx_binomial_interval(nfound, set->nstars, LEVEL);
    dst->precision = rx_binomial_interval(nfound, nfound + nfalse_of(set, run), LEVEL);
    dst->crowded = rx_binomial_interval(crowded, nfound, LEVEL);
    robust_of(set, run, SIGNED_PERCENT, s, &dst->bias_percent, &dst->scatter_percent);
    robust_of(set, run, SIGNED_MAG, s, &dst->bias_mag, &dst->scatter_mag);
    robust_of(set, run, PULL, s, &dst->pull_median, &dst->pull_width);
    rx_status status = mean_of(set, run, ERROR_PERCENT, s, &dst->magerr, err);
    if (status == RX_OK)
        status = mean_of(set, run, ERROR_CLEAN, s, &dst->magerr_clean, err);
    if (status == RX_OK)
        status =
            rx_pr_make(detections(m->lab, f, k, k, run, s), s->value, s->mark, set->nstars, &dst->pr, err);
    if (status == RX_OK)
        status = rx_pr_interval(&dst->pr, set->nstars, LEVEL, (rx_resampling){s->seed, 1}, &dst->ap, err);
    return status;
}

/* One bin from half a step above the brightest set to half a step below the faintest: completeness only asks
 * for the range. Sets go from bright to faint in equal steps. */
static rx_bins range_of(const rx_lab *lab)
{
    if (lab->nscenes == 0)
        return (rx_bins){.n = 1, .edge = {0, 1}};
    const double step = lab->nscenes > 1 ? lab->scene[1].mag - lab->scene[0].mag : 1;
    return (rx_bins){
        .n = 1, .edge = {lab->scene[0].mag - 0.5 * step, lab->scene[0].mag + (lab->nscenes - 0.5) * step}};
}

/* Magnitudes of 50 and 90 % completeness for stars found above `score`. */
typedef struct depths {
    rx_estimate *mag50, *mag90;
} depths;

static rx_status depth(const rx_lab *lab, int f, int run, double score, scratch *s, depths dst, rx_error *err)
{
    const rx_bins bins = range_of(lab);
    long n = 0;
    for (int k = 0; k < lab->nscenes; k++) {
        const rx_photometry_set set = rx_photometry_set_of(lab, f, k);
        for (long i = 0; i < set.nstars; i++) {
            s->mark[n] = rx_star_of(&set, run, i)[RX_STAR_SCORE] >= score; /* NAN, not found, is below all */
            s->value[n++] = set.mag;
        }
    }
    rx_status status =
        rx_completeness(&bins, n, s->value, s->mark, 0.5, LEVEL, (rx_resampling){s->seed, 1}, dst.mag50, err);
    if (status == RX_OK)
        status = rx_completeness(&bins, n, s->value, s->mark, 0.9, LEVEL, (rx_resampling){s->seed, 1},
                                 dst.mag90, err);
    return status;
}

/* The lowest score at which the whole field's precision is at least the wanted one. */
static void choose_cut(const rx_pr *pr, long nstars, double wanted, rx_photometry_cut *dst)
{
    *dst = (rx_photometry_cut){.score = INFINITY};
    dst->precision = (rx_estimate){NAN, NAN, NAN, 0};
    dst->recall = rx_binomial_interval(0, nstars, LEVEL);
    for (long k = pr->n - 1; k >= 0; k--)
        if (pr->point[k].precision >= wanted) {
            dst->score = pr->point[k].score;
            dst->precision = rx_binomial_interval(pr->point[k].matched, pr->point[k].detections, LEVEL);
            dst->recall = rx_binomial_interval(pr->point[k].matched, nstars, LEVEL);
            dst->whole_list = k == pr->n - 1;
            return;
        }
}

static rx_status measure_whole(rx_photometry_numbers *m, int f, int run, scratch *s, rx_error *err)
{
    rx_photometry_whole *dst = &m->whole[(size_t)f * (size_t)m->lab->nruns + (size_t)run];
    long nstars = 0, nfound = 0, nfalse = 0;
    double mpixels = 0;
    rx_pr pr = {0};
    for (int k = 0; k < m->lab->nscenes; k++) {
        const rx_photometry_set set = rx_photometry_set_of(m->lab, f, k);
        nstars += set.nstars;
        nfound += found_above(&set, run, -INFINITY);
        nfalse += nfalse_of(&set, run);
        mpixels += set.mpixels;
    }
    dst->recall = rx_binomial_interval(nfound, nstars, LEVEL);
    dst->precision = rx_binomial_interval(nfound, nfound + nfalse, LEVEL);
    dst->false_per_mpixel = rx_poisson_rate(nfalse, mpixels, LEVEL);
    rx_status status = depth(m->lab, f, run, -INFINITY, s, (depths){&dst->mag50, &dst->mag90}, err);
    if (status == RX_OK)
        status = rx_pr_make(detections(m->lab, f, 0, m->lab->nscenes - 1, run, s), s->value, s->mark, nstars,
                            &pr, err);
    for (int p = 0; p < m->nprecisions && status == RX_OK; p++) {
        rx_photometry_cut *cut = &dst->cut[p];
        choose_cut(&pr, nstars, m->precision[p], cut);
        status = depth(m->lab, f, run, cut->score, s, (depths){&cut->mag50, &cut->mag90}, err);
        for (int k = 0; k < m->lab->nscenes; k++) {
            const rx_photometry_set set = rx_photometry_set_of(m->lab, f, k);
            m->cell[cell_slot(m, f, k, run)].complete[p] =
                rx_binomial_interval(found_above(&set, run, cut->score), set.nstars, LEVEL);
        }
    }
    rx_pr_free(&pr);
    return status;
}

static rx_status measure_field(rx_photometry_numbers *m, int f, uint64_t seed, rx_error *err)
{
    size_t most = 1;
    rx_status status = RX_OK;
    for (int k = 0; k < m->lab->nscenes; k++) {
        const rx_photometry_set set = rx_photometry_set_of(m->lab, f, k);
        most += (size_t)(set.nstars + set.wrong->n);
    }
    scratch s = {RX_NEW(double, most), RX_NEW(double, most), RX_NEW(unsigned char, most), seed};
    if (!s.value || !s.zero || !s.mark)
        status = rx_error_memory(err, most * sizeof *s.value);
    for (int run = 0; run < m->lab->nruns && status == RX_OK; run++) {
        for (int k = 0; k < m->lab->nscenes && status == RX_OK; k++) {
            status = rx_interrupt_check(err);
            if (status == RX_OK)
                status = measure_cell(m, f, k, run, &s, err);
        }
        if (status == RX_OK)
            status = measure_whole(m, f, run, &s, err);
    }
    free(s.value);
    free(s.zero);
    free(s.mark);
    return status != RX_OK ? status : rx_photometry_duels_make(m, f, err);
}

static void choose(rx_photometry_numbers *m)
{
    const rx_lab *r = m->lab;
    m->none = m->net = -1;
    for (int i = 0; i < r->nruns; i++) {
        m->none = strcmp(r->run[i].name, "NONE") == 0 ? i : m->none;
        m->net = strcmp(r->run[i].name, "NET") == 0 ? i : m->net;
        for (int j = 0; j < i; j++)
            m->pair[m->npairs++] = (rx_run_pair){i, j};
    }
    m->nprecisions = r->nprecisions > 0 ? r->nprecisions : 2;
    for (int p = 0; p < m->nprecisions; p++)
        m->precision[p] = r->nprecisions > 0 ? r->precision[p] : p == 0 ? 0.95 : 0.99;
}

rx_status rx_photometry_numbers_make(const rx_lab *lab, uint64_t seed, rx_photometry_numbers *dst,
                                     rx_error *err)
{
    rx_status status = RX_OK;
    *dst = (rx_photometry_numbers){.lab = lab};
    choose(dst);
    size_t sets = (size_t)lab->nconditions * (size_t)lab->nscenes;
    dst->cell = RX_NEW(rx_photometry_cell, sets * (size_t)lab->nruns);
    dst->whole = RX_NEW(rx_photometry_whole, (size_t)lab->nconditions * (size_t)lab->nruns);
    dst->duel = RX_NEW(rx_photometry_duel, sets * (size_t)dst->npairs);
    if (!dst->cell || !dst->whole || !dst->duel)
        status = rx_error_memory(err, sets * sizeof *dst->cell);
    for (int f = 0; f < lab->nconditions && status == RX_OK; f++)
        status = measure_field(dst, f, seed, err);
    if (status != RX_OK)
        rx_photometry_numbers_free(dst);
    return status;
}

void rx_photometry_numbers_free(rx_photometry_numbers *m)
{
    for (int f = 0; m->cell != NULL && f < m->lab->nconditions; f++)
        for (int k = 0; k < m->lab->nscenes; k++)
            for (int run = 0; run < m->lab->nruns; run++)
                rx_pr_free(&m->cell[cell_slot(m, f, k, run)].pr);
    free(m->cell);
    free(m->whole);
    free(m->duel);
    *m = (rx_photometry_numbers){0};
}
