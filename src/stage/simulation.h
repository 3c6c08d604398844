/* The simulator's main job, and the same in memory for campaigns:
 *
 *   population -> scene -> render through the optics -> noise -> tile, sharp reference, truth catalogue
 *
 * or, with INJECT_IMAGE, the scene on top of a real tile with the tile's own PSF, gain and noise. */
#ifndef RX_STAGE_SIMULATION_H
#define RX_STAGE_SIMULATION_H

#include "base/error.h"
#include "base/log.h"
#include "config/config_fields.h"
#include "data/tile.h"
#include "pipeline/field.h"
#include "simulate/coadd.h"
#include "simulate/noise.h"
#include "simulate/optics.h"
#include "simulate/scene.h"
#include "simulate/templates.h"
#include "stage/options.h"

/* Keywords of rextract-simulate as plain values; files they name have been read. */
typedef struct rx_simulation {
    rx_scene_params scene;   /* of scene number scene.stream; scene.allowed is `allowed` */
    rx_noise_params noise;   /* of the image, of a coadd's frames */
    rx_coadd_params coadd;   /* RX_COADD_NONE: one exposure */
    rx_templates *templates; /* owned, NULL without */
    rx_optics *optics;       /* owned; on pixels of the image, of a coadd's frames. NULL when it comes from
                                the tile: INJECT_IMAGE, until rx_simulation_for_tile() */
    rx_optics *target;       /* owned; of the sharp reference */
    double sharp_fwhm;       /* pixels, target PSF of the sharp reference */
    double alpha, delta;     /* deg, centre of the simulated tile */
    int nthreads;
    int without_sharp;      /* 1: rx_simulation_make() leaves the sharp reference out; from_config sets 0 */
    unsigned char *allowed; /* owned: where objects may lie on a real tile; NULL = anywhere */
} rx_simulation;

/* *dst is freed by rx_simulation_free(). Errors: RX_USAGE (parameters out of range), RX_INPUT (templates, PSF files),
 * RX_SYSTEM. */
rx_status rx_simulation_from_config(const rx_simulate_config *config, rx_log *log, rx_simulation **dst,
                                    rx_error *err);
void rx_simulation_free(rx_simulation *simulation); /* NULL is fine */

/* One simulated field in memory. */
typedef struct rx_simulated {
    int width, height;
    rx_noise_params noise; /* of the image: a coadd's is not that of its frames */
    double sigma;          /* of a pixel of sky, ADU */
    double wide;           /* noise of wide sums over that of independent pixels: 1 but for coadds */
    float *image;          /* exposed: sky, noise and defects included */
    float *clean;          /* blurred, before sky and noise; NULL for coadds */
    float *weight;    /* inverse variance of the sky, covariances left out (simulate/coadd.h), 0 = no data */
    float *sharp;     /* through the target PSF, before sky and noise; NULL without_sharp */
    uint8_t *defects; /* RX_DEFECT_ */
    rx_scene *scene;
} rx_simulated;

/* Scene number `stream` of the series. The content of *dst is freed by rx_simulated_free(), also after an
 * error. Errors: RX_USAGE, RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_simulation_make(const rx_simulation *simulation, uint64_t stream, rx_simulated *dst,
                             rx_error *err);
void rx_simulated_free(rx_simulated *simulated);

/* The exposed image as a tile that the stage can take, as if it had been read from the file that
 * rx_simulation_run() writes: dead columns are NaN there and RX_MASK_BAD here, saturated pixels
 * RX_MASK_SATURATED, cosmic rays stay in the pixels unmarked, as in a raw exposure. WCS, gain (0 = infinite),
 * saturation and zero point are set. Free with rx_tile_free(). */
rx_status rx_simulation_tile(const rx_simulation *simulation, const rx_simulated *simulated, const char *name,
                             rx_tile **dst, rx_error *err);

/* Injection. The configuration for one real tile: its size, zero point (MAG_ZEROPOINT where that was set by
 * hand, else what the tile's header or configuration states, else the default), pixel scale, gain (GAIN where
 * the tile has none; 0: the added light brings no photon noise), saturation, and the places allowed by
 * INJECT_PLACE. The PSF is PSF_TYPE's; AUTO takes field->psf, which must have been measured on the tile.
 * `options` is the stage's for this field (AWAY runs its detection on the untouched pixels). */
rx_status rx_simulation_for_tile(const rx_simulate_config *config, const rx_options *options,
                                 const rx_field *field, rx_log *log, rx_simulation **dst, rx_error *err);

/* pixels [height][width] of that tile (its own, or a copy) += scene number `stream` with the photon noise of
 * the added light. sharp [height][width] (NULL when not wanted) = the scene alone through the target PSF.
 * *scene is freed by rx_scene_free(). */
rx_status rx_simulation_inject(const rx_simulation *simulation, uint64_t stream, float *pixels, float *sharp,
                               rx_scene **scene, rx_error *err);

/* Everything the configuration asks for, written to files: the job of rextract-simulate. Nothing is left after an
 * error: RX_USAGE, RX_INPUT, RX_SYSTEM, RX_INTERRUPTED. */
rx_status rx_simulation_run(const rx_simulate_config *config, rx_log *log, rx_error *err);

#endif
