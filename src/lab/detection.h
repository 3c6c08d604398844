/* The detection campaign: whole scenes through every restorer, and what its list of detections is worth;
 * close pairs, invented sources, and what restored pixels do to plateaus and to the outskirts of galaxies.
 *
 * Scenes, one after the other for each of the conditions of conditions.h, with the population of the SIM.
 * keywords where nothing else is said:
 *   STARS      its stars alone            GALAXIES   its galaxies (and templates) alone
 *   PAIRS      stars of PAIR_SNR, each with a companion at most 0.5 mag brighter or fainter at a separation
 *              uniform in SIM.PAIR_DISTANCE (FWHM); the pairs are 8 FWHM apart
 *   BLANK      nothing but noise          RINGS      bright stars of RING_SNR, 20 FWHM apart
 *   PLATEAU    a square of half the tile's side, PLATEAU_SNR sigmas bright, its edges smoothed by a Gaussian
 *              of FWHM 8 pixels more than the PSF; no noise; shifted by a pixel from tile to tile
 *   OUTSKIRTS  galaxies of OUTSKIRT_SNR, 12 FWHM apart
 *
 * S/N of an object: in a matched filter on the bare sky, flux / (sigma sqrt(A)), A = 1 / sum PSF^2 +
 * 9.06 r_e^2 b/a (the second term as if its profile was a Gaussian of its half-light radius). PAIR_SNR,
 * RING_SNR and OUTSKIRT_SNR are drawn as that of a star of the flux, uniform in magnitude.
 *
 * Methods: every restorer of RESTORE_TYPE; beside NONE also MATCHED, the unrestored image with a Gaussian of
 * the PSF's FWHM for a detection filter, at the threshold of the same S/N as that of NONE; RL once for each
 * number of TUNE_NITER and of TUNE_FILTER. */
#ifndef RX_LAB_DETECTION_H
#define RX_LAB_DETECTION_H

#include <stdint.h>

#include "lab/conditions.h"
#include "lab/kind.h"
#include "lab/results.h"
#include "pipeline/field.h"
#include "restore/restore.h"
#include "stage/options.h"
#include "stage/simulation.h"

typedef enum rx_detection_scene {
    RX_SCENE_STARS,
    RX_SCENE_GALAXIES,
    RX_SCENE_PAIRS,
    RX_SCENE_BLANK,
    RX_SCENE_RINGS,
    RX_SCENE_PLATEAU,
    RX_SCENE_OUTSKIRTS,
    RX_SCENE_KINDS
} rx_detection_scene;

const char *rx_detection_scene_name(rx_detection_scene scene);
int rx_detection_scene_is_list(rx_detection_scene scene); /* recall and precision are of these */

enum { RX_DETECTION_METHODS = 48 };

typedef struct rx_detection_method {
    char name[RX_METHOD_NAME]; /* NONE, MATCHED, NET, "RL 20 0.5" */
    const rx_restorer *restorer;
    int matched;   /* detection filter of the PSF's width */
    int tuned;     /* RL with what follows */
    int niter;     /* iterations */
    double filter; /* FWHM of the Gaussian afterwards, units of the PSF's */
} rx_detection_method;

/* What the tiles of a condition share. */
typedef struct rx_detection_sky {
    rx_simulation *simulation; /* owned */
    rx_psf *told;              /* owned */
    double fwhm;               /* true, pixels */
    double area;               /* 1 / sum PSF^2 over pixels */
    double sigma;              /* noise of the sky, ADU */
    float *kernel;             /* of MATCHED, [side][side]; owned */
    int side;
} rx_detection_sky;

/* Also for campaigns of other kinds. Errors: RX_USAGE (a sky without noise), and those of conditions.h. */
rx_status rx_detection_sky_open(const rx_campaign_config *config, const rx_condition *condition, rx_log *log,
                                rx_detection_sky *dst, rx_error *err);
void rx_detection_sky_close(rx_detection_sky *sky); /* content only */

/* S/N of an object as above, and the magnitude of a star of that S/N. */
double rx_detection_snr(const rx_detection_sky *sky, const rx_object *object);
double rx_detection_mag(const rx_detection_sky *sky, double snr);

/* As many objects of that S/N (a star's; from, to) as find a place so far apart (FWHM). */
rx_population rx_detection_sparse(const rx_detection_sky *sky, const rx_reals *snr, double apart);

/* simulated->image, width and height: a scene's light without noise. Becomes an exposed tile. */
rx_status rx_detection_expose(const rx_detection_sky *sky, uint64_t seed, uint64_t stream,
                              rx_simulated *simulated, rx_tile **tile, rx_error *err);

/* What became of the PSF: 1 / sum of its squares over pixels at the centre of a width x height tile. */
rx_status rx_detection_area(const rx_psf *psf, int width, int height, double *dst, rx_error *err);

typedef struct rx_detection_state {
    const rx_campaign_config *config; /* not owned */
    rx_config *stage;                 /* owned, under the options */
    rx_options *options;              /* everything on one thread; owned */
    int nmethods;
    rx_detection_method method[RX_DETECTION_METHODS];
    int nconditions;
    rx_condition *condition; /* owned */
    rx_detection_sky *sky;   /* [nconditions]; owned */
    int nscenes;
    rx_detection_scene scene[RX_SCENE_KINDS];
    long ntiles; /* per scene and condition */
} rx_detection_state;

/* Units are numbered: tile + ntiles (scene + nscenes condition). Tile t of a scene is drawn alike under every
 * condition. */
long rx_detection_units(const rx_detection_state *state);

/* One tile and what is on it. */
typedef struct rx_detection_tile {
    rx_field *field;
    long n;                              /* objects; PAIRS: number 2 k and 2 k + 1 belong together */
    double *x, *y, *snr, *flux, *radius; /* [n]; radius: half-light, round, before the PSF; owned */
    float *truth[2]; /* OUTSKIRTS: the scene without noise through its own PSF and through the target PSF;
                        owned */
} rx_detection_tile;

rx_status rx_detection_tile_make(const rx_detection_state *state, int condition, rx_detection_scene scene,
                                 long number, rx_detection_tile *dst, rx_error *err);
void rx_detection_tile_free(rx_detection_tile *tile); /* content only */

/* Numbers per object in a unit's values. */
enum { RX_DETECTION_PROPS = 2, RX_OUTSKIRT_RADII = 3 };
int rx_detection_columns(rx_detection_scene scene);

/* A unit's values: number of objects n, Mpixels; n times S/N and separation (FWHM; PAIRS, else 0); then for
 * each method n times the scene's columns, the number of false detections, and of each its score and its
 * distance from the nearest object (RINGS, FWHM, else 0). Columns:
 *   STARS, GALAXIES, RINGS  score of the detection, NAN = not found; STARS and GALAXIES list objects of
 *                           TRUTH_SNR and more inside the tile; detections of fainter ones do not count
 *   PAIRS                   n counts pairs; the lower of both scores, NAN unless two detections lie within
 *                           half the separation (and MATCH_RADIUS) of the two stars
 *   PLATEAU                 one object; rms of the means of the 2 x 2 phases about their mean, of the 4 x 4
 *                           phases, and their range, in sigmas of the noise, in the middle of the plateau
 *   OUTSKIRTS               flux within 1, 2 and 4 r50 of the galaxy, r50 = sqrt(r_e^2 + (FWHM / 2)^2), then
 *                           the same of the true scene at the resolution of the result, both over the true
 *                           flux */
rx_status rx_detection_unit(const rx_detection_state *state, long unit, rx_unit_values *dst, rx_error *err);

#endif
