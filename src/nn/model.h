/* A trained model: the RESTORE network, optionally the PSF network, what they were trained for and how well
 * they did: one FITS file.
 *
 * Format, version 1, and 2 where there is a second stage. Every HDU has CHECKSUM and DATASUM. Primary HDU, without data:
 *
 *   RXMODEL   the version; says that the file is a model
 *   NEXTEND   number of tables that follow
 *   RXNAME    name for headers and reports
 *   RXDIGEST  rx_model_digest() of what the networks compute, 16 hexadecimal digits
 *   RXMODE    BLIND or INFORMED: what goes in (nn/front.h)
 *   RXTFWHM   FWHM in pixels of the Gaussian that is the PSF of the output
 *   RXTIKH    epsilon of the deconvolved copy (nn/deblur.h)
 *   RXRLSTEP, RXPEDST    Richardson-Lucy steps after the network, their pedestal (nn/rl_step.h)
 *   RXNFWHM, RXNSIGMA    bins of the dictionary, 0 without one
 *   RXEPOCHS, RXPATCHS, RXSEED    training done: epochs, images seen, seed (a string of digits)
 *   RXBEST    epoch, from 1, that these parameters are of: the best one
 *   RXENDED   1 when the training has ended, 0 while it goes on
 *   RXNFMAX   largest noise factor of the training images (data/noise_correlation.h), 1 of white noise
 *   RXTDARK   share of them with structure darker than the sky
 *
 * Binary tables, in this order, those in brackets where there are any:
 *
 *   RESTORE_NODES    OP (text), SRC, ADD, RELU, CHANNELS, KERNEL, STRIDE (32-bit): one row per node, nn/net.h
 *   RESTORE_PARAMS   VALUE (float): all parameters in the order of nn/net.h
 *   [SECOND_NODES, SECOND_PARAMS]    the second stage
 *   [PSF_NODES, PSF_PARAMS]    the network from sharp to blurred
 *   [DICTIONARY]     FWHM_LOW, FWHM_HIGH, SIGMA_LOW, SIGMA_HIGH, LOSS, LIST, RECALL, BIAS, SCATTER (double),
 *                    IMAGES (64-bit): one row per bin, FWHM runs fastest
 *   [PROVENANCE]     LINE (text): the configuration of the training, KEYWORD value
 *
 * The same model makes the same bytes: no date, no name of a machine, no path. */
#ifndef RX_NN_MODEL_H
#define RX_NN_MODEL_H

#include <stddef.h>
#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"
#include "base/text.h"
#include "nn/front.h"
#include "nn/net.h"
#include "nn/noise_level.h"

RX_BEGIN_DECLS

/* One bin of the active-learning dictionary: what the model does at that seeing and noise. */
typedef struct rx_model_bin {
    double fwhm[2];  /* pixels, from .. to */
    double sigma[2]; /* noise level of the blurred fields: nn/noise_level.h */
    double loss;     /* mean test loss */
    double list;     /* the same, normalised: Eq. 4's list */
    /* of test stars of S/N above 5, as the trainer's quick detection finds them; NAN unknown */
    double recall;
    double bias;    /* median (measured - true)/true flux of test stars of S/N above 12; NAN unknown */
    double scatter; /* 1.4826 MAD of the same; NAN unknown */
    long images;    /* test images behind these */
} rx_model_bin;

enum { RX_MODEL_NAME = 80, RX_MODEL_DIGEST = 32 };

typedef struct rx_model {
    rx_front front;
    rx_net *restore;          /* owned */
    rx_net *second;           /* owned; what goes on from what `restore` made, INFORMED; NULL: one stage */
    rx_net *psf;              /* owned; NULL: left out */
    int nfwhm, nsigma;        /* the grid */
    rx_model_bin *bins;       /* [nsigma][nfwhm], owned; NULL: no dictionary yet */
    char name[RX_MODEL_NAME]; /* for headers and reports */
    char digest[RX_MODEL_DIGEST]; /* as rx_model_digest(); set by rx_model_read() */
    long epochs, patches;         /* training done */
    long best;                    /* epoch that the parameters are of */
    int ended;                    /* has the training ended? */
    double factor;                /* largest noise factor of the training, 1 = white noise */
    double dark;                  /* share of its images with structure below the sky */
    uint64_t seed;
    char *provenance; /* KEYWORD value lines of the training, owned, may be NULL; printable ASCII */
} rx_model;

/* Its networks, NULL where it has none. */
enum { RX_NET_RESTORE, RX_NET_PSF, RX_NET_SECOND, RX_MODEL_NETS };
void rx_model_nets(const rx_model *model, rx_net *dst[RX_MODEL_NETS]);
long rx_model_params(const rx_model *model); /* of all of them together */

/* All zero but the default front, `ended` and `factor`; NULL without memory. */
rx_model *rx_model_new(void);
void rx_model_free(rx_model *model); /* NULL is fine */

const char *rx_mode_name(rx_mode mode); /* "BLIND", "INFORMED" */

/* FNV-1a (64 bits, hexadecimal) of what the networks compute: front, nodes, parameters. */
void rx_model_digest(const rx_model *model, char dst[RX_MODEL_DIGEST]);

/* `path` is the temporary name of rx_outputs_file(), `shown` the final one. The same model gives the same
 * bytes. Errors: RX_SYSTEM (disk, memory, or networks that do not fit the front). */
rx_status rx_model_write(const rx_model *model, const char *path, const char *shown, rx_error *err);

/* CHECKSUM and DATASUM are verified and everything else is checked before it is used. Errors: RX_INPUT (not FITS,
 * not a model, another format version, truncated, checksum wrong, nodes that make no network or none that fits
 * the front, parameters not finite or not as many as the nodes need, a dictionary that is no grid), RX_SYSTEM. */
rx_status rx_model_read(const char *path, rx_model **dst, rx_error *err);

/* Several lines for a human: what it is, shape, cost, training, dictionary as a table (`-INFO`). */
void rx_model_describe(const rx_model *model, rx_text *dst);

/* The bin of that seeing and noise level, or NULL outside the training (*outside, may be NULL, then says in words what
 * is out: "FWHM 9.30 pixels is above 8"; else it is empty). Upper limits belong to the next bin, those of the
 * grid to the last one. A level below the grid (a brighter tile) is outside, one above it belongs to the last bin: see
 * nn/noise_level.h. */
const rx_model_bin *rx_model_find(const rx_model *model, double fwhm, double sigma, char *outside,
                                  size_t size);

/* Noise units that a pixel of its training had at most; infinite without a dictionary. */
double rx_model_peak(const rx_model *model);

/* Noise factor (data/noise_correlation.h, of the matched filter) up to which it is known to work: that of its training,
 * and for all, those of white noise too, what was tried: at 2.95 they find more than Richardson-Lucy does, with 3
 * false detections per Mpixel (validation/results/resampled). */
#define RX_MODEL_FACTOR 3.0
double rx_model_factor(const rx_model *model);

RX_END_DECLS

#endif
