/* The photometry campaign: stars of one magnitude per set on tiles of a field, through the stage once per
 * restorer. The paper's last figure.
 *
 * SIMULATED: the sky of the SIM. keywords, another one on each tile; the restorers are given its true PSF,
 * unless STAGE.PSF_TYPE is set: then the stage finds it as on any tile. A field for each of the conditions of
 * SEEING, PSF_ERROR, SKY_ERROR and NOISE_ERROR. INJECTED: stars added to a real tile
 * with the tile's own PSF (of the STAGE. keywords, measured on the untouched tile by default), which the
 * restorers are given too, and with the photon noise of its gain. Its noise is the same on every tile, and
 * what is found on it before the injection, by any restorer, is known and neither right nor false: of that,
 * faint sources cannot be distinguished from peaks of the noise. So every tile comes with a blank one, a realisation
 * of the tile's own noise without any source, whose detections are all false.
 *
 * (This header does not include lab/results.h, which names a struct as pipeline/photometry.h a function.)
 */
#ifndef RX_LAB_PHOTOMETRY_SKY_H
#define RX_LAB_PHOTOMETRY_SKY_H

#include <stdint.h>

#include "base/error.h"
#include "base/log.h"
#include "config/campaign_config.h"
#include "data/noise_correlation.h"
#include "lab/conditions.h"
#include "lab/journal.h"
#include "lab/photometry_match.h"
#include "pipeline/field.h"
#include "stage/options.h"
#include "stage/simulation.h"

enum { RX_RUNS_MAX = 16, RX_SKIES_MAX = 64 };

/* What the tiles of a field are made from. */
typedef struct rx_photometry_sky {
    int injected;
    rx_condition condition; /* INJECTED: all zero */
    int width, height;
    double fwhm;               /* pixels */
    double power;              /* sum of PSF^2 over pixels, at the centre of the tile */
    rx_psf *psf;               /* the true one, on the tile's pixels; owned */
    rx_psf *told;              /* the one that restorers are given; owned, NULL: the stage finds it */
    rx_simulation *simulation; /* SIMULATED; owned */
    rx_field *field;           /* INJECTED: the untouched tile; owned */
    rx_optics *optics;         /* INJECTED: its PSF; owned */
    unsigned char *allowed;    /* INJECTED: where stars may lie; owned */
    rx_noise_correlation
        noise;       /* INJECTED: of its source-free pixels, once rx_photometry_prepare() was called */
    rx_known before; /* INJECTED: what is found on it, once rx_photometry_prepare() was called */
} rx_photometry_sky;

typedef struct rx_photometry_state {
    const rx_campaign_config *config; /* not owned */
    rx_config *stage;                 /* owned */
    rx_options *options;              /* of the stage; everything on one thread */
    int nthreads;                     /* before the units begin */
    int nruns;                        /* the fluxes of one restorer stand together */
    const rx_restorer *run[RX_RUNS_MAX];
    int templates[RX_RUNS_MAX]; /* 1: its flux is that of template photometry, 0: STAGE.QA_MAG */
    int nskies;
    rx_photometry_sky sky[RX_SKIES_MAX];
    int nmags;
    double *mags; /* bright to faint; owned */
    long ntiles;  /* per magnitude */
} rx_photometry_state;

/* Tiles are numbered: tile + ntiles (magnitude + nmags field). Those of one magnitude and tile are drawn
 * alike in every field. */
long rx_photometry_units(const rx_photometry_state *state);

/* Read and simulate nothing but what every tile shares. */
rx_status rx_photometry_sky_open(rx_photometry_state *state, int injected, const rx_condition *condition,
                                 rx_log *log, rx_photometry_sky *dst, rx_error *err);
void rx_photometry_sky_close(rx_photometry_sky *sky); /* content only */

/* INJECTED: what every restorer finds on the untouched tile, and its noise. Errors: RX_INPUT (too little sky
 * without sources). */
rx_status rx_photometry_prepare(rx_photometry_state *state, rx_log *log, rx_error *err);

/* One tile with its stars. */
typedef struct rx_photometry_tile {
    rx_field *field;
    rx_known known; /* what else is on it, SIMULATED; INJECTED: the sky's `before` holds for every tile */
    long n;         /* stars */
    double *x, *y;  /* [n]; owned */
    double flux;    /* of each */
} rx_photometry_tile;
/* INJECTED: the tile's noise and nothing else. Free with rx_field_free(). */
rx_status rx_photometry_blank_make(const rx_photometry_state *state, const rx_photometry_sky *sky,
                                   uint64_t number, rx_field **dst, rx_error *err);

rx_status rx_photometry_tile_make(const rx_photometry_state *state, const rx_photometry_sky *sky, double mag,
                                  uint64_t number, rx_photometry_tile *dst, rx_error *err);
void rx_photometry_tile_free(rx_photometry_tile *tile); /* content only */

/* A unit's values: number of stars n, Mpixels searched, S/N of a star in a matched filter; then for each
 * run n times score, F / F0, pull, crowded (all NAN, NAN, NAN, 0 for a star that is not found), the
 * number of false detections (INJECTED: those on the blank tile too), and the score and magnitude of each. */
rx_status rx_photometry_unit(const rx_photometry_state *state, long unit, rx_unit_values *dst, rx_error *err);

#endif
