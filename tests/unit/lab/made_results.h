/* Results of campaigns that never ran, made from random numbers: what the report's tests read. */
#ifndef TESTS_MADE_RESULTS_H
#define TESTS_MADE_RESULTS_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/random.h"
#include "lab/kinds.h"
#include "lab/photometry.h"
#include "lab/results.h"

typedef struct made_restoration {
    int with_net;     /* a method NET */
    double net_gain;  /* dB above RL */
    double net_worst; /* and in the last FWHM bin */
    long nscenes;
    int nfwhm, nsigma; /* bins from 2 up */
    int side, nexamples;
} made_restoration;

static void *made(size_t n, size_t size)
{
    void *p = calloc(n > 0 ? n : 1, size);
    if (p == NULL)
        abort();
    return p;
}

/* Scores in which RL gains little at small FWHM, much at large ones, and loses to noise. */
static void made_bin(rx_restoration_bin *bin, const made_restoration *how, int b, int last)
{
    int nmethods = 4 + how->with_net;
    bin->nscenes = how->nscenes;
    bin->fwhm = made((size_t)how->nscenes, sizeof *bin->fwhm);
    bin->sigma = made((size_t)how->nscenes, sizeof *bin->sigma);
    bin->level = made((size_t)how->nscenes, sizeof *bin->level);
    for (int k = 0; k < nmethods; k++) {
        bin->method[k].psnr = made((size_t)how->nscenes, sizeof(double));
        bin->method[k].ssim = made((size_t)how->nscenes, sizeof(double));
        if (k == 1) {
            strcpy(bin->method[k].settings_psnr, "filter 0.7 FWHM");
            strcpy(bin->method[k].settings_ssim, "filter 2 FWHM");
        }
        if (k == 2 || k == 3) {
            snprintf(bin->method[k].settings_psnr, 120, "RL_NITER %d, filter 0.5 FWHM", 5 * (b + 1));
            snprintf(bin->method[k].settings_ssim, 120, "RL_NITER %d, filter 0.9 FWHM", 3 * (b + 1));
            bin->method[k].end_ssim = b == 0 && k == 2;
        }
    }
    for (long i = 0; i < how->nscenes; i++) {
        uint64_t key = (uint64_t)b * 100000 + (uint64_t)i;
        double u = rx_random_uniform(1, 0, key), v = rx_random_uniform(1, 1, key);
        bin->fwhm[i] = bin->by_sigma ? 2 + 6 * v : bin->low + (bin->high - bin->low) * u;
        bin->sigma[i] = bin->by_sigma ? bin->low + (bin->high - bin->low) * u : 1 + 14 * v;
        bin->level[i] = 2 * bin->sigma[i];
        double blurred = 34 - 0.9 * bin->fwhm[i] - 0.2 * bin->sigma[i] + 2 * rx_random_normal(2, 0, key);
        double gain = 0.35 * (bin->fwhm[i] - 3) - 0.02 * bin->sigma[i];
        double net = gain + (b == last ? how->net_worst : how->net_gain);
        double smooth = 0.1 * (bin->fwhm[i] - 3);
        double psnr[] = {blurred, blurred + smooth, blurred + gain, blurred + gain + 0.4, blurred + net};
        for (int k = 0; k < nmethods; k++) {
            bin->method[k].psnr[i] = psnr[k] + (k > 0 ? 0.3 * rx_random_normal(3, (uint64_t)k, key) : 0);
            bin->method[k].ssim[i] = 1 / (1 + exp(-0.15 * (bin->method[k].psnr[i] - 24)));
        }
    }
}

static void made_examples(rx_restoration_results *r, int n)
{
    static const double soft[] = {5, 5.5, 3.5, 3, 2.5, 2};
    r->nexamples = n;
    r->examples = made((size_t)n, sizeof *r->examples);
    for (int e = 0; e < n; e++) {
        rx_restoration_example *x = &r->examples[e];
        x->fwhm = 3 + e;
        x->sigma = 4 + 3 * e;
        x->nplanes = r->nmethods + 1;
        for (int k = 0; k < x->nplanes; k++) {
            strcpy(x->title[k], k < r->nmethods ? r->method[k] : "SHARP");
            x->planes[k] = made((size_t)r->side * (size_t)r->side, sizeof(float));
            double s = k < r->nmethods ? soft[k] : 1.5;
            for (int y = 0; y < r->side; y++)
                for (int z = 0; z < r->side; z++) {
                    double d = hypot(z - 0.5 * r->side, y - 0.5 * r->side) / (4 * s);
                    x->planes[k][y * r->side + z] =
                        (float)(r->peak * exp(-d) +
                                (k < r->nmethods ? x->sigma / (k + 1) : 0) *
                                    rx_random_normal(7, (uint64_t)(e * 16 + k), (uint64_t)(y * r->side + z)));
                }
        }
    }
}

static rx_restoration_results *make_restoration(const made_restoration *how)
{
    static const char *const names[] = {"BLURRED", "SMOOTHED", "RL", "RL_FLAT", "NET"};
    rx_restoration_results *r = made(1, sizeof *r);
    r->nmethods = 4 + how->with_net;
    for (int k = 0; k < r->nmethods; k++)
        strcpy(r->method[k], names[k]);
    r->nbins = how->nfwhm + how->nsigma;
    r->bins = made((size_t)r->nbins, sizeof *r->bins);
    r->side = how->side;
    r->peak = 255;
    r->sharp_fwhm = 2;
    r->fwhm_trained[0] = 2;
    r->fwhm_trained[1] = 8;
    r->level_trained[0] = 1;
    r->level_trained[1] = 15;
    r->tune_scenes = 5;
    strcpy(r->about, "Galaxies, 300 per Mpixel & <more>.");
    for (int b = 0; b < r->nbins; b++) {
        rx_restoration_bin *bin = &r->bins[b];
        bin->by_sigma = b >= how->nfwhm;
        double centre = bin->by_sigma ? 2 + b - how->nfwhm : 2 + b;
        bin->low = centre - 0.5;
        bin->high = centre + 0.5;
        bin->other_low = bin->by_sigma ? 2 : 1;
        bin->other_high = bin->by_sigma ? 8 : 15;
        made_bin(bin, how, b, how->nfwhm - 1);
    }
    made_examples(r, how->nexamples);
    return r;
}

typedef struct made_photometry {
    int nruns, nfields, nsets;
    long ntiles, stars_per_tile;
    double rl_depth; /* mag that RL goes deeper than NONE */
} made_photometry;

static double *made_rows(rx_lab_table *table, long n)
{
    double *first;
    if (rx_lab_rows_add(table, n, &first, NULL) != RX_OK)
        abort();
    return first;
}

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
        v[RX_FALSE_STAR_RUN] = run;
        v[RX_FALSE_STAR_SCORE] =
            (double)(float)(3 - 0.8 * log(1 - rx_random_uniform(15, stream, (uint64_t)i)));
        v[RX_FALSE_STAR_MAG] = 23;
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
