/* Is a tile what the network was trained for? Its seeing and noise are looked up in the model's dictionary,
 * what the model promises there goes into headers and reports, and beyond the grid OUT_OF_DOMAIN is obeyed.
 */
#ifndef RX_PIPELINE_DOMAIN_H
#define RX_PIPELINE_DOMAIN_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/image.h"
#include "nn/model.h"
#include "restore/restore.h"

RX_BEGIN_DECLS

typedef enum rx_domain_place {
    RX_DOMAIN_NONE,    /* no network is at work */
    RX_DOMAIN_UNKNOWN, /* a network that needs no PSF, on a tile of unknown seeing */
    RX_DOMAIN_INSIDE,
    RX_DOMAIN_OUTSIDE
} rx_domain_place;

typedef struct rx_domain {
    rx_domain_place place;
    const rx_model *model;   /* the options'; NULL for RX_DOMAIN_NONE */
    double fwhm;             /* of the tile's PSF, pixels; NAN unknown */
    double noise;            /* rx_model_noise() of the tile */
    const rx_model_bin *bin; /* of the model, INSIDE only, else NULL */
    char why[200];           /* OUTSIDE: what is out, or why RL is at work; UNKNOWN: what is not known */
} rx_domain;

/* rx_model_noise() over the pixels of an image that are not hidden. Errors: RX_SYSTEM. */
rx_status rx_domain_noise(const rx_image *image, double *noise, rx_error *err);

/* Before `*kind` restores the image: nothing unless it is the network. model_noise: rx_domain_noise() of the
 * image that this one is a copy of; 0: it is none. A tile beyond the grid of
 * par->model goes on with a warning (par->out_of_domain WARN), makes *kind RL (RL, and WARN where its PSF is
 * narrower than 0.9 of the network's output), or ends in RX_NOT_RESTORED that says file, value, grid and what
 * to do (FAIL). A tile without a PSF is left alone. Errors: RX_SYSTEM too. */
rx_status rx_domain_obey(const rx_restore_params *par, const rx_image *image, double model_noise, rx_log *log,
                         const rx_restorer **kind, rx_domain *dst, rx_error *err);

RX_END_DECLS

#endif
