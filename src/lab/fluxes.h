/* The campaign of fluxes: what template photometry is worth beside AUTO and apertures, on every restorer's
 * sources, and what its verdict on invented sources costs.
 *
 * Scenes, one after the other for each of the conditions of conditions.h, with the population of the SIM.
 * keywords where nothing else is said:
 *   FIELD     its stars and galaxies
 *   PAIRS     pairs, the brighter member of PAIR_SNR, the other one 0 to 2 mag fainter at a separation
 *             uniform in SIM.PAIR_DISTANCE (FWHM); the pairs are 8 FWHM, and 32 pixels, apart. Members are
 *             stars in the proportion of SIM.STAR_COUNT to SIM.GALAXY_COUNT; galaxies have the shapes and
 *             sizes of the population
 *   BLANK     nothing but noise
 *   RINGS     bright stars of RING_SNR, 20 FWHM apart
 *   SHREDS    galaxies of SHRED_SNR, twice as large as the population's, 60 % of those with disks with arms
 *             and a third of these with bars, 20 FWHM apart
 *   INJECTED  the population added to the real tile TILE_NAME, with the tile's PSF (STAGE. keywords) and the
 *             photon noise of its gain. A detection that was there before the injection by the rule of
 *             check/selfcheck.h is neither right nor wrong.
 *
 * S/N: lab/detection.h. Detections are matched as in DETECTION: objects of TRUTH_SNR and more one to
 * one, nearest first, then the fainter ones, whose detections do not count; what is left is invented.
 *
 * An object is
 *   isolated  when no other object of more than 1 % of its flux is nearer than
 *               (3 + log10(f)) FWHM + 2 (r + r')
 *             f: flux of the other over its own, at least 1; r, r': half-light radii. INJECTED: nor a source
 *             of the untouched tile, of FLUX_AUTO and r = 0
 *   blended   when one of within 2 mag (brighter or fainter) is nearer than 1.5 FWHM
 * and neither or, where objects are extended, both: then it counts as blended. */
#ifndef RX_LAB_FLUXES_H
#define RX_LAB_FLUXES_H

#include <stdint.h>

#include "lab/conditions.h"
#include "lab/detection.h"
#include "lab/kind.h"
#include "pipeline/field.h"
#include "restore/restore.h"
#include "stage/options.h"
#include "stage/simulation.h"

typedef enum rx_fluxes_scene {
    RX_FLUXES_FIELD,
    RX_FLUXES_PAIRS,
    RX_FLUXES_BLANK,
    RX_FLUXES_RINGS,
    RX_FLUXES_SHREDS,
    RX_FLUXES_INJECTED,
    RX_FLUXES_SCENES
} rx_fluxes_scene;

const char *rx_fluxes_scene_name(rx_fluxes_scene scene);

/* AUTO; the first of STAGE.PHOT_APERTURES; an aperture of 2 FWHM radius; template photometry. */
typedef enum rx_flux_kind {
    RX_FLUX_AUTO,
    RX_FLUX_APER,
    RX_FLUX_WIDE,
    RX_FLUX_TEMPLATE,
    RX_FLUX_KINDS
} rx_flux_kind;

const char *rx_flux_name(rx_flux_kind kind);

typedef enum rx_blend_state { RX_ISOLATED, RX_BLENDED, RX_NEITHER } rx_blend_state;

enum { RX_FLUXES_RUNS = 8 };

/* One object that is really there. */
typedef struct rx_fluxes_object {
    double x, y, flux;
    double radius; /* half-light, round, before the PSF, pixels; 0 of a star */
    double snr;
    double
        bound; /* error of the flux of a star in a matched filter, noise of sky and photons, over the flux */
    int galaxy;
    rx_blend_state company;
    long partner; /* BLENDED: the nearest object it is blended with, PAIRS: the other member; else -1 */
} rx_fluxes_object;

/* INJECTED: the tile as it was. */
typedef struct rx_fluxes_ground {
    rx_field *field;                    /* owned */
    double model_noise;                 /* rx_domain_noise(): copies are restored as it was */
    rx_detection_sky sky;               /* simulation, area, noise and FWHM of the tile; owned */
    rx_sources *before[RX_FLUXES_RUNS]; /* what each restorer finds on it, once prepared; owned */
} rx_fluxes_ground;

typedef struct rx_fluxes_state {
    const rx_campaign_config *config; /* not owned */
    rx_config *stage;                 /* owned, under the options */
    rx_options *options;              /* everything on one thread, templates wanted; owned */
    int nthreads;                     /* before the units begin */
    int nruns;
    const rx_restorer *run[RX_FLUXES_RUNS];
    int nconditions;
    rx_condition *condition; /* owned */
    rx_detection_sky *sky;   /* [nconditions], of simulated scenes; owned */
    rx_fluxes_ground ground; /* INJECTED */
    int nscenes;
    rx_fluxes_scene scene[RX_FLUXES_SCENES];
    long ntiles; /* per scene and condition */
} rx_fluxes_state;

/* Units are numbered: tile + ntiles (scene + nscenes condition). */
long rx_fluxes_units(const rx_fluxes_state *state);
const rx_detection_sky *rx_fluxes_sky(const rx_fluxes_state *state, int condition, rx_fluxes_scene scene);

/* Those of the state for one restorer, with both apertures; points into the state's. */
rx_options rx_fluxes_options(const rx_fluxes_state *state, const rx_detection_sky *sky,
                             const rx_restorer *restorer);

/* INJECTED: read the tile; then what every restorer finds on it. */
rx_status rx_fluxes_ground_open(rx_fluxes_state *state, rx_log *log, rx_error *err);
rx_status rx_fluxes_ground_search(rx_fluxes_state *state, rx_log *log, rx_error *err);
void rx_fluxes_ground_close(rx_fluxes_ground *ground); /* content only */

/* One tile and what is on it. */
typedef struct rx_fluxes_tile {
    rx_field *field;
    float *light; /* INJECTED: what was added to the pixels; owned */
    long n;
    rx_fluxes_object *object; /* [n]; PAIRS: number 2 k and 2 k + 1 belong together, the brighter one first;
                                 owned */
} rx_fluxes_tile;

rx_status rx_fluxes_tile_make(const rx_fluxes_state *state, int condition, rx_fluxes_scene scene, long number,
                              rx_fluxes_tile *dst, rx_error *err);
void rx_fluxes_tile_free(rx_fluxes_tile *tile); /* content only */

/* company and partner of every object. `others` [nothers][3]: x, y, flux of what else is there. */
void rx_fluxes_company(long n, rx_fluxes_object *object, long nothers, const double (*others)[3],
                       double fwhm);

/* What a tile's values are made of. Per object: */
enum {
    RX_PROP_SNR,
    RX_PROP_GALAXY,
    RX_PROP_BLEND_STATE,
    RX_PROP_BOUND,
    RX_PROP_PARTNER, /* number in the unit's list of objects, -1 none */
    RX_PROP_APART,   /* from the partner, FWHM; else 0 */
    RX_PROP_MAGS,    /* PAIRS: how much fainter than the partner, mag; else 0 */
    RX_FLUXES_PROPS
};
/* per restorer and object: */
enum {
    RX_FOUND, /* NAN not found, 0 found, 1 found and marked as made up; 2 more: only the residual showed it */
    RX_RATIO, /* [RX_FLUX_KINDS] flux over the true one, NAN without */
    RX_ERROR = RX_RATIO + RX_FLUX_KINDS, /* [RX_FLUX_KINDS] error it gives itself, over the true flux */
    RX_BOTH =
        RX_ERROR + RX_FLUX_KINDS, /* 1: it and its partner are found, each nearer than half the separation */
    RX_PIECES,                    /* [2] SHREDS: detections on the galaxy, before and after the flag */
    RX_FLUXES_COLUMNS = RX_PIECES + 2
};
/* and per restorer: */
enum {
    RX_TALLY_RIGHT,      /* detections of objects of TRUTH_SNR and more */
    RX_TALLY_RIGHT_KEPT, /* those without the mark */
    RX_TALLY_FALSE,      /* invented */
    RX_TALLY_FALSE_KEPT,
    RX_TALLY_WEAK, /* S/N 5 to 7, found */
    RX_TALLY_WEAK_KEPT,
    RX_TALLY_STRONG, /* above 7, found */
    RX_TALLY_STRONG_KEPT,
    RX_TALLY_ADDED, /* right ones that only the residual showed */
    RX_FLUXES_TALLIES
};

/* A unit's values: number of objects n of TRUTH_SNR and more, Mpixels; n RX_FLUXES_PROPS; then for each
 * restorer n RX_FLUXES_COLUMNS, then RX_FLUXES_TALLIES. */
rx_status rx_fluxes_unit(const rx_fluxes_state *state, long unit, rx_unit_values *dst, rx_error *err);

#endif
