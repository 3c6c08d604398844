/* Is a tile what the network was trained for? Its seeing and noise are looked up in the model's dictionary,
 * what the model promises there goes into headers and reports, and beyond the grid OUT_OF_DOMAIN is obeyed.
 */
#ifndef RX_STAGE_DOMAIN_H
#define RX_STAGE_DOMAIN_H

#include "base/error.h"
#include "base/log.h"
#include "base/text.h"
#include "nn/model.h"
#include "restore/restore.h"
#include "stage/field.h"
#include "stage/record.h"
#include "validate/qa.h"

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

/* rx_model_noise() over the pixels that a restored image may use; that of the tile a copy was made from where
 * the field says so (field->model_noise). Errors: RX_SYSTEM. */
rx_status rx_domain_noise(const rx_field *field, double *noise, rx_error *err);

/* Before `*kind` restores the field: nothing unless it is the network. A tile beyond the grid of
 * par->model goes on with a warning (par->out_of_domain WARN), makes *kind RL (RL, and WARN where its PSF is
 * narrower than 0.9 of the network's output), or ends in RX_NOT_RESTORED that says file, value, grid and what
 * to do (FAIL). A tile without a PSF is left alone. Errors: RX_SYSTEM too. */
rx_status rx_domain_obey(const rx_restore_params *par, const rx_field *field, rx_log *log,
                         const rx_restorer **kind, rx_domain *dst, rx_error *err);

/* Header facts RXNET*; nothing for RX_DOMAIN_NONE, and what is not known is left out. */
void rx_domain_facts(const rx_domain *domain, rx_record *facts);

/* One line for log and report; "" for RX_DOMAIN_NONE. */
void rx_domain_text(const rx_domain *domain, rx_text *dst);

/* The same for the table of the report, pointing into domain; NULL for RX_DOMAIN_NONE. */
const rx_qa_promise *rx_domain_promise(const rx_domain *domain, rx_qa_promise *dst);

#endif
