/* Under which conditions tiles are made, and what their restorers are given of them: the seeing, and errors in
 * PSF, sky and noise. */
#ifndef RX_LAB_CONDITIONS_H
#define RX_LAB_CONDITIONS_H

#include "base/error.h"
#include "config/config_fields.h"
#include "pipeline/field.h"
#include "stage/simulation.h"

typedef struct rx_condition {
    double fwhm;        /* of the PSF, pixels; 0: SIM.PSF_FWHM */
    double psf_error;   /* the PSF given is wider by this share */
    double sky_error;   /* so much of the sky is left in the image, in sigmas of its noise */
    double noise_error; /* the noise given is higher by this share */
} rx_condition;

/* For each number of SEEING (none: one of the simulator's own FWHM) the truth first, then one condition for
 * every number but 0 of PSF_ERROR, SKY_ERROR and NOISE_ERROR. *dst [*n] is to be freed. Errors: RX_SYSTEM. */
rx_status rx_conditions_make(const rx_campaign_config *config, int *n, rx_condition **dst, rx_error *err);

/* 1: restorers are given the truth. */
int rx_condition_true(const rx_condition *condition);

/* "FWHM 4, sky +0.3 sigma"; "" for the simulator's own FWHM and no error. */
void rx_condition_name(const rx_condition *condition, char *dst, size_t size);

/* The simulation of the SIM. keywords at that seeing, on one thread. *dst belongs to the caller
 * (rx_simulation_free()). Errors: RX_USAGE (no Moffat whose FWHM could be set, or an INJECT_IMAGE). */
rx_status rx_condition_simulation(const rx_condition *condition, const rx_simulate_config *sim, rx_log *log,
                                  rx_simulation **dst, rx_error *err);

/* The PSF that restorers are given, on pixels; rx_psf_free(). */
rx_status rx_condition_psf(const rx_condition *condition, const rx_simulate_config *sim,
                           const rx_simulation *simulation, rx_psf **dst, rx_error *err);

/* Sky and noise of a prepared field become those that restorers are given. */
void rx_condition_apply(const rx_condition *condition, rx_field *field);

#endif
