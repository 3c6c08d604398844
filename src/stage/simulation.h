/* The simulator's main job, and the same in memory for campaigns:
 *
 *   population -> scene -> render through the optics -> noise -> tile, sharp reference, truth catalogue
 *
 * or, with INJECT_IMAGE, the scene on top of a real tile with the tile's own PSF, gain and noise. */
#ifndef RX_STAGE_SIMULATION_H
#define RX_STAGE_SIMULATION_H

#include "base/error.h"
#include "base/log.h"
#include "config/simulate_config.h"
#include "data/tile.h"
#include "simulate/noise.h"
#include "simulate/optics.h"
#include "simulate/scene.h"
#include "simulate/templates.h"

/* Keywords of rextract-simulate as plain values; files they name have been read. */
typedef struct rx_simulation {
    rx_scene_params scene;
    rx_noise_params noise;
    rx_templates *templates; /* owned, NULL without */
    rx_optics *optics;       /* owned; NULL when it comes from the tile (injection with PSF_TYPE AUTO) */
    double sharp_fwhm;       /* pixels, target PSF of the sharp reference */
    double alpha, delta;     /* deg, centre of the simulated tile */
    int nthreads;
} rx_simulation;

rx_status rx_simulation_from_config(const rx_simulate_config *config, rx_log *log, rx_simulation **dst,
                                    rx_error *err);
void rx_simulation_free(rx_simulation *simulation);

/* One simulated field in memory. */
typedef struct rx_simulated {
    int width, height;
    float *image;     /* exposed: sky, noise and defects included */
    float *clean;     /* blurred, before sky and noise */
    float *sharp;     /* through the target PSF, before sky and noise */
    uint8_t *defects; /* RX_DEFECT_ */
    rx_scene *scene;
} rx_simulated;

/* Scene number `stream` of the series. The content of *dst is freed by rx_simulated_free(). */
rx_status rx_simulation_make(const rx_simulation *simulation, uint64_t stream, rx_simulated *dst,
                             rx_error *err);
void rx_simulated_free(rx_simulated *simulated);

/* The exposed image as a tile that the stage can take, as if it had been read from a file (defects masked as
 * a flag map would, gain, saturation, zero point, WCS). Free with rx_tile_free(). */
rx_status rx_simulation_tile(const rx_simulation *simulation, const rx_simulated *simulated, const char *name,
                             rx_tile **dst, rx_error *err);

/* Everything the configuration asks for, written to files: the job of rextract-simulate. */
rx_status rx_simulation_run(const rx_simulate_config *config, rx_log *log, rx_error *err);

#endif
