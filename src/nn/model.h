/* A trained model: the RESTORE network, optionally the PSF network, what they were trained for and how well
 * they did: one FITS file.
 *
 * Layout of the file (version 1): primary HDU without data, its header holds RXMODEL (format version), MODE,
 * target PSF, front parameters, shape, seed, provenance as the training's configuration (HISTORY), CHECKSUM
 * and DATASUM in every HDU; tables RESTORE_NODES (op, src, add, relu, channels, kernel, stride),
 * RESTORE_PARAMS (one float column, node by node), PSF_NODES and PSF_PARAMS (may be absent), DICTIONARY (one
 * row per bin). */
#ifndef RX_NN_MODEL_H
#define RX_NN_MODEL_H

#include "base/error.h"
#include "base/text.h"
#include "nn/front.h"
#include "nn/net.h"

/* One bin of the active-learning dictionary: what the model does at that seeing and noise. */
typedef struct rx_model_bin {
    double fwhm[2];  /* pixels, from .. to */
    double sigma[2]; /* noise on the scale on which the brightest 0.1 % of the noise-free blurred pixels begin
                        at 255 (nn/model.h: rx_model_noise()) */
    double loss;     /* mean test loss */
    double list;     /* the same, normalised: Eq. 4's list */
    double
        recall;  /* of test stars of S/N above 5, as the trainer's quick detection finds them; NAN unknown */
    double bias; /* median (measured - true)/true flux of test stars of S/N above 12; NAN unknown */
    double scatter; /* 1.4826 MAD of the same; NAN unknown */
    long images;    /* test images behind these */
} rx_model_bin;

enum { RX_MODEL_NAME = 80 };

typedef struct rx_model {
    rx_front front;
    rx_net *restore;          /* owned */
    rx_net *psf;              /* owned; NULL: left out */
    int nfwhm, nsigma;        /* the grid */
    rx_model_bin *bins;       /* [nsigma][nfwhm], owned; NULL: no dictionary yet */
    char name[RX_MODEL_NAME]; /* for headers and reports */
    char digest[32]; /* hex digest of all parameters and nodes (FNV-1a, 64 bits); set on read and write */
    long epochs, patches; /* training done */
    uint64_t seed;
    char *provenance; /* KEYWORD value lines of the training, owned, may be NULL */
} rx_model;

/* All zero but the default front; NULL without memory. */
rx_model *rx_model_new(void);
void rx_model_free(rx_model *model); /* NULL is fine */

/* `path` is the temporary name of rx_outputs_file(), `shown` the final one. The same model gives the same
 * bytes. Errors: RX_SYSTEM. */
rx_status rx_model_write(const rx_model *model, const char *path, const char *shown, rx_error *err);

/* CHECKSUM and DATASUM are verified. Errors: RX_INPUT (not a model, another format version, truncated,
 * checksum wrong, nodes that make no network, parameters not finite or not as many as the nodes need),
 * RX_SYSTEM. */
rx_status rx_model_read(const char *path, rx_model **dst, rx_error *err);

/* Several lines for a human: what it is, shape, cost, training, dictionary as a table (`-INFO`). */
void rx_model_describe(const rx_model *model, rx_text *dst);

/* Noise of a tile on the scale of the dictionary: 255 sigma / q, q = the value (ADU above the sky) that the
 * brightest 0.1 % of the pixels exceed; 0.1 % of pure noise exceed 3.1 sigma, so a blank tile has about 80.
 * above[n]: (pixel - sky)/sigma of the good pixels, reordered here. NAN for n = 0. */
double rx_model_noise(float *above, size_t n);

/* The bin of that seeing and noise, or NULL outside the grid (*outside, may be NULL, then says in words what
 * is out: "FWHM 9.3 pixels is above 8"). Noise below the grid (a deeper or brighter tile) is outside too. */
const rx_model_bin *rx_model_find(const rx_model *model, double fwhm, double sigma, char *outside,
                                  size_t size);

#endif
