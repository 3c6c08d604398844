/* Is a tile what the network was trained for? Its seeing and noise level (nn/noise_level.h) are looked up in the
 * model's dictionary, and what the model promises there goes into headers and reports. A seeing beyond the grid, a
 * tile brighter than it, and noise that is more correlated than rx_model_factor() are outside: there OUT_OF_DOMAIN is
 * obeyed. Pixels brighter than rx_model_peak() and dark sky are so by source: pipeline/pipeline.c. */
#ifndef RX_PIPELINE_DOMAIN_H
#define RX_PIPELINE_DOMAIN_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/image.h"
#include "nn/model.h"
#include "pipeline/field.h"
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
    double noise;            /* noise level of the tile: rx_domain_noise() */
    double factor;           /* noise factor of its matched filter */
    const rx_model_bin *bin; /* of the model, INSIDE only, else NULL */
    char why[200];           /* OUTSIDE: what is out, or why RL is at work; UNKNOWN: what is not known */
} rx_domain;

/* rx_noise_level() of the pixels that a restorer would be given, in effective noise; the ten brightest may be a cosmic
 * ray. Errors: RX_SYSTEM. */
rx_status rx_domain_noise(const rx_field *field, int nthreads, double *noise, rx_error *err);

/* Before `*kind` restores the field: nothing unless it is the network. A tile outside of what par->model was trained
 * for goes on with a warning (par->out_of_domain WARN), makes *kind RL (RL, and WARN where its PSF is
 * narrower than 0.9 of the network's output), or ends in RX_NOT_RESTORED that says file, value, grid and what
 * to do (FAIL). A tile without a PSF is left alone. Errors: RX_SYSTEM too. */
rx_status rx_domain_obey(const rx_restore_params *par, const rx_field *field, rx_log *log,
                         const rx_restorer **kind, rx_domain *dst, rx_error *err);

RX_END_DECLS

#endif
