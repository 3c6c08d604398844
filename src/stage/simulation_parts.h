/* What the files of the simulator's job share. Private to stage/simulation*.c. */
#ifndef RX_STAGE_SIMULATION_PARTS_H
#define RX_STAGE_SIMULATION_PARTS_H

#include "base/text.h"
#include "data/psf.h"
#include "stage/record.h"
#include "stage/simulation.h"

/* What a field's settings depend on besides the keywords. */
typedef struct rx_simulation_ground {
    int width, height;
    int extension; /* from 1: which model of a PSFEx file with several */
    double zeropoint, pixel_scale;
    double margin;     /* pixels by which objects may lie beyond the border, in FWHM */
    const rx_psf *psf; /* measured on the tile, for PSF_TYPE AUTO; else NULL */
    int with_optics;
} rx_simulation_ground;

rx_status rx_simulation_build(const rx_simulate_config *config, const rx_simulation_ground *ground,
                              rx_log *log, rx_simulation **dst, rx_error *err);

/* Streams of random numbers of scene number `stream`: what is drawn for the scene, and what for its pixels.
 */
rx_scene_params rx_simulation_scene(const rx_simulation *simulation, uint64_t stream);
uint64_t rx_simulation_pixel_stream(uint64_t stream);

/* n planes of a scene: through the simulation's optics, then (n = 2) through the target PSF. */
rx_status rx_simulation_render(const rx_simulation *simulation, const rx_scene *scene, int n,
                               float *const *images, rx_error *err);

#endif
