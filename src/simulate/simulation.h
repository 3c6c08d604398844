/* A simulated field in memory, for rextract-simulate, campaigns and training:
 *
 *   population -> scene -> render through the optics -> noise -> image, sharp reference
 *
 * or the scene on top of a real tile. */
#ifndef RX_SIMULATE_SIMULATION_H
#define RX_SIMULATE_SIMULATION_H

#include "base/error.h"
#include "base/log.h"
#include "config/config_fields.h"
#include "data/psf.h"
#include "data/tile.h"
#include "simulate/coadd.h"
#include "simulate/noise.h"
#include "simulate/optics.h"
#include "simulate/scene.h"
#include "simulate/templates.h"

/* What a field's settings depend on besides the keywords. */
typedef struct rx_simulation_ground {
    int width, height;
    int extension; /* from 1: which model of a PSFEx file with several */
    double zeropoint, pixel_scale;
    double margin;     /* pixels by which objects may lie beyond the border, in FWHM */
    const rx_psf *psf; /* measured on the tile, for PSF_TYPE AUTO; else NULL */
    int with_optics;
} rx_simulation_ground;

/* Keywords of rextract-simulate as plain values; files they name have been read. */
typedef struct rx_simulation {
    rx_scene_params scene;   /* of scene number scene.stream; scene.allowed is `allowed` */
    rx_noise_params noise;   /* of the image, of a coadd's frames */
    rx_coadd_params coadd;   /* RX_COADD_NONE: one exposure */
    rx_templates *templates; /* owned, NULL without */
    rx_optics *optics;       /* owned; on pixels of the image, of a coadd's frames. NULL when it comes from
                                the tile: INJECT_IMAGE, until rx_simulation_build() */
    rx_optics *target;       /* owned; of the sharp reference */
    double sharp_fwhm;       /* pixels, target PSF of the sharp reference */
    double alpha, delta;     /* deg, centre of the simulated tile */
    int nthreads;
    int without_sharp;      /* 1: rx_simulation_make() leaves the sharp reference out; from_config sets 0 */
    rx_object *listed;      /* owned; of scene: read from a list, or NULL */
    unsigned char *allowed; /* owned: where objects may lie on a real tile; NULL = anywhere */
} rx_simulation;

/* *dst is freed by rx_simulation_free(). Errors: RX_USAGE (parameters out of range), RX_INPUT (templates, PSF files),
 * RX_SYSTEM. */
rx_status rx_simulation_from_config(const rx_simulate_config *config, rx_log *log, rx_simulation **dst,
                                    rx_error *err);
rx_status rx_simulation_build(const rx_simulate_config *config, const rx_simulation_ground *ground,
                              rx_log *log, rx_simulation **dst, rx_error *err); /* the same on other ground */
void rx_simulation_free(rx_simulation *simulation);                             /* NULL is fine */

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
 * rextract-simulate writes: dead columns are NaN there and RX_MASK_BAD here, saturated pixels
 * RX_MASK_SATURATED, cosmic rays stay in the pixels unmarked, as in a raw exposure. WCS, gain (0 = infinite),
 * saturation and zero point are set. Free with rx_tile_free(). */
rx_status rx_simulation_tile(const rx_simulation *simulation, const rx_simulated *simulated, const char *name,
                             rx_tile **dst, rx_error *err);

/* pixels [height][width] of a real tile (its own, or a copy) += scene number `stream` with the photon noise of
 * the added light. sharp [height][width] (NULL when not wanted) = the scene alone through the target PSF.
 * *scene is freed by rx_scene_free(). */
rx_status rx_simulation_inject(const rx_simulation *simulation, uint64_t stream, float *pixels, float *sharp,
                               rx_scene **scene, rx_error *err);

#endif
