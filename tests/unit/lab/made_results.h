/* Results of campaigns that never ran, made from random numbers: what the report's tests read. */
#ifndef TESTS_MADE_RESULTS_H
#define TESTS_MADE_RESULTS_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "lab/lab.h"
#include "lab/photometry.h"
#include "lab/restoration.h"

static void *made(size_t n, size_t size)
{
    void *p = calloc(n > 0 ? n : 1, size);
    if (p == NULL)
        abort();
    return p;
}

static double *made_rows(rx_lab_table *table, long n)
{
    double *first;
    if (rx_lab_rows_add(table, n, &first, NULL) != RX_OK)
        abort();
    return first;
}

typedef struct made_restoration {
    int with_net;     /* a method NET */
    double net_gain;  /* dB above RL */
    double net_worst; /* and in the last FWHM bin */
    long nscenes;
    int nfwhm, nsigma; /* bins from 2 up */
} made_restoration;

/* The first scene of a bin: its columns, and those of a run. */
static double *made_scene(const rx_lab *r, int b, long i)
{
    return rx_lab_own(&rx_lab_set_of(r, b, 1)->table[RX_RESTORATION_SCENE], i);
}

static double *made_score(const rx_lab *r, int b, long i, int run)
{
    return rx_lab_each(&rx_lab_set_of(r, b, 1)->table[RX_RESTORATION_SCENE], i, run);
}

/* Scores in which RL gains little at small FWHM, much at large ones, and loses to noise. */
static void made_bin(rx_lab *r, const made_restoration *how, int b, int last)
{
    const rx_lab_bin *bin = &r->bin[b];
    rx_lab_tuned(*tuned)[2] = r->tuned + b * r->nruns;
    strcpy(tuned[1][0].setting, "filter 0.7 FWHM");
    strcpy(tuned[1][1].setting, "filter 2 FWHM");
    for (int k = 2; k < 4; k++) {
        tuned[k][1].at_end = b == 0 && k == 2;
        snprintf(tuned[k][0].setting, sizeof tuned[k][0].setting, "RL_NITER %d, filter 0.5 FWHM",
                 5 * (b + 1));
        snprintf(tuned[k][1].setting, sizeof tuned[k][1].setting, "RL_NITER %d, filter 0.9 FWHM%s",
                 3 * (b + 1), tuned[k][1].at_end ? " (at an end of what was tried)" : "");
    }
    made_rows(&rx_lab_set_of(r, b, 1)->table[RX_RESTORATION_SCENE], how->nscenes);
    for (long i = 0; i < how->nscenes; i++) {
        uint64_t key = (uint64_t)b * 100000 + (uint64_t)i;
        double u = rx_random_uniform(1, 0, key), v = rx_random_uniform(1, 1, key);
        const double fwhm = bin->by_sigma ? 2 + 6 * v : bin->low + (bin->high - bin->low) * u,
                     sigma = bin->by_sigma ? bin->low + (bin->high - bin->low) * u : 1 + 14 * v;
        double blurred = 34 - 0.9 * fwhm - 0.2 * sigma + 2 * rx_random_normal(2, 0, key);
        double gain = 0.35 * (fwhm - 3) - 0.02 * sigma;
        double net = gain + (b == last ? how->net_worst : how->net_gain);
        double smooth = 0.1 * (fwhm - 3);
        double psnr[] = {blurred, blurred + smooth, blurred + gain, blurred + gain + 0.4, blurred + net};
        made_scene(r, b, i)[RX_SCENE_FWHM] = fwhm;
        made_scene(r, b, i)[RX_SCENE_SIGMA] = sigma;
        made_scene(r, b, i)[RX_SCENE_LEVEL] = 2 * sigma;
        for (int k = 0; k < r->nruns; k++) {
            double *score = made_score(r, b, i, k);
            score[RX_SCORE_PSNR] = psnr[k] + (k > 0 ? 0.3 * rx_random_normal(3, (uint64_t)k, key) : 0);
            score[RX_SCORE_SSIM] = 1 / (1 + exp(-0.15 * (score[RX_SCORE_PSNR] - 24)));
        }
    }
}

/* Settings of a report without pictures. */
static const rx_campaign_config *made_config(void)
{
    static rx_campaign_config config;
    config.scene_side = 32;
    config.scene_peak = 255;
    config.tune_scenes = 5;
    return &config;
}

static rx_lab *make_restoration(const made_restoration *how)
{
    static const char *const names[] = {"BLURRED", "SMOOTHED", "RL", "RL_FLAT", "NET"};
    rx_lab *r = made(1, sizeof *r);
    r->kind = &rx_kind_restoration;
    r->config = made_config();
    r->nruns = 4 + how->with_net;
    r->tunes = 1;
    for (int k = 0; k < r->nruns; k++)
        strcpy(r->run[k].name, names[k]);
    r->nconditions = how->nfwhm + how->nsigma;
    r->nskies = 1;
    r->sky = made(1, sizeof *r->sky);
    r->sky->simulation = made(1, sizeof *r->sky->simulation);
    r->sky->simulation->sharp_fwhm = 2;
    r->bin = made((size_t)r->nconditions, sizeof *r->bin);
    r->tuned = made((size_t)(r->nconditions * r->nruns), sizeof *r->tuned);
    r->set = made((size_t)(2 * r->nconditions), sizeof *r->set);
    r->fwhm_trained[0] = 2;
    r->fwhm_trained[1] = 8;
    r->level_trained[0] = 1;
    r->level_trained[1] = 15;
    strcpy(r->about, "Galaxies, 300 per Mpixel & <more>.");
    if (rx_lab_add_scene(r, RX_SCENE_TUNING, 0, 0, NULL) != RX_OK ||
        rx_lab_add_scene(r, RX_SCENE_TEST, 1, 0, NULL) != RX_OK)
        abort();
    for (int b = 0; b < r->nconditions; b++) {
        const int by_sigma = b >= how->nfwhm;
        const double centre = by_sigma ? 2 + b - how->nfwhm : 2 + b;
        r->bin[b] = (rx_lab_bin){by_sigma,         centre - 0.5,      centre + 0.5,
                                 by_sigma ? 2 : 1, by_sigma ? 8 : 15, how->nscenes};
        for (int s = 0; s < 2; s++)
            for (int t = 0; t < RX_RESTORATION_TABLES; t++)
                rx_lab_table_begin(&rx_restoration_tables[t], r->nruns, &rx_lab_set_of(r, b, s)->table[t]);
        made_bin(r, how, b, how->nfwhm - 1);
    }
    return r;
}

typedef struct made_photometry {
    int nruns, nfields, nsets;
    long ntiles, stars_per_tile;
    double rl_depth; /* mag that RL goes deeper than NONE */
} made_photometry;

static void made_run(rx_lab_set *set, double snr, int field, int k, int run, double depth)
{
    const rx_lab_table *star = &set->table[RX_PHOTOMETRY_STAR];
    uint64_t stream = (uint64_t)(field * 1000 + k * 10 + run);
    for (long i = 0; i < star->n; i++) {
        /* half of the noise is the tile's, the same for every restorer */
        double common = rx_random_normal(11, (uint64_t)(field * 1000 + k), (uint64_t)i);
        double score =
            snr * pow(10, 0.4 * depth) + 0.8 * common + 0.5 * rx_random_normal(12, stream, (uint64_t)i);
        int seen = score > 3;
        double ratio =
            1 + 0.01 * run + (common + 0.3 * (run + 1) * rx_random_normal(13, stream, (uint64_t)i)) / snr;
        double *v = rx_lab_each(star, i, run);
        v[RX_STAR_SCORE] = seen ? (double)(float)score : NAN;
        v[RX_STAR_RATIO] = seen ? (double)(float)ratio : NAN;
        v[RX_STAR_PULL] = seen ? (double)(float)((ratio - 1) * snr) : NAN;
        v[RX_STAR_CROWDED] = rx_random_uniform(14, stream, (uint64_t)i) < 0.05;
    }
    const long nfalse = (long)(2.5 * (double)set->table[RX_PHOTOMETRY_TILE].n) + run;
    double *v = made_rows(&set->table[RX_PHOTOMETRY_FALSE], nfalse);
    for (long i = 0; i < nfalse; i++, v += RX_PHOTOMETRY_FALSE_WIDTH) {
        v[RX_WRONG_RUN] = run;
        v[RX_WRONG_SCORE] = (double)(float)(3 - 0.8 * log(1 - rx_random_uniform(15, stream, (uint64_t)i)));
        v[RX_WRONG_MAG] = 23;
    }
}

static rx_lab *make_photometry(const made_photometry *how)
{
    static const char *const names[] = {"NONE", "RL", "NET"};
    rx_lab *r = made(1, sizeof *r);
    r->kind = &rx_kind_photometry;
    r->nruns = how->nruns;
    r->nconditions = r->nskies = how->nfields;
    r->nprecisions = 2;
    r->precision[0] = 0.95;
    r->precision[1] = 0.99;
    r->sky = made((size_t)how->nfields, sizeof *r->sky);
    r->set = made((size_t)(how->nfields * how->nsets), sizeof *r->set);
    for (int run = 0; run < how->nruns; run++) {
        strcpy(r->run[run].name, names[run]);
        snprintf(r->run[run].settings, sizeof r->run[run].settings, "RESTORE_TYPE %s <&>", names[run]);
    }
    for (int k = 0; k < how->nsets; k++)
        if (rx_lab_add_scene(r, RX_SCENE_MAGNITUDE, k, 19 + 0.5 * k, NULL) != RX_OK)
            abort();
    for (int f = 0; f < how->nfields; f++) {
        strcpy(r->sky[f].name, f == 0 ? "simulated" : "sdss <r>");
        strcpy(r->sky[f].about, "FWHM 3.3 pixels, sigma 10 ADU.");
        for (int k = 0; k < how->nsets; k++) {
            rx_lab_set *set = rx_lab_set_of(r, f, k);
            const double snr = 60 * pow(10, -0.4 * (r->scene[k].mag - 19));
            for (int t = 0; t < RX_PHOTOMETRY_TABLES; t++)
                rx_lab_table_begin(&rx_photometry_tables[t], how->nruns, &set->table[t]);
            double *v = made_rows(&set->table[RX_PHOTOMETRY_TILE], how->ntiles);
            for (long i = 0; i < how->ntiles; i++, v += RX_PHOTOMETRY_TILE_WIDTH) {
                v[RX_FIELD_MPIXELS] = 1.048576;
                v[RX_FIELD_SNR] = snr;
            }
            made_rows(&set->table[RX_PHOTOMETRY_STAR], how->ntiles * how->stars_per_tile);
            for (int run = 0; run < how->nruns; run++)
                made_run(set, snr, f, k, run, run * how->rl_depth);
        }
    }
    return r;
}

#endif
