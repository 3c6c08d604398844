/* Photometry and shapes of detected sources on an image of the same pixel grid.
 *
 * Conventions of SExtractor 2.25 throughout (its manual, and facts read from its public source):
 * so that a survey's numbers stay what they were. The loops are our own rather than sep's because
 * neighbours are mirrored (MASK_TYPE CORRECT), errors follow a noise law, and flags are wanted. */
#ifndef RX_MEASURE_MEASURE_H
#define RX_MEASURE_MEASURE_H

#include <stdint.h>

#include "base/error.h"
#include "base/log.h"
#include "data/map.h"
#include "data/sources.h"
#include "data/tile.h"
#include "measure/noise.h"

typedef enum rx_mask_type { RX_NEIGHBOURS_NONE, RX_NEIGHBOURS_BLANK, RX_NEIGHBOURS_CORRECT } rx_mask_type;

/* What need not be measured. It matters for FLAGS too: SExtractor sets RX_FLAG_APERTURE and
 * RX_FLAG_CROWDED only for what the .param file asks for. */
enum { RX_SKIP_APER = 1, RX_SKIP_AUTO = 2, RX_SKIP_PETRO = 4, RX_SKIP_RADIUS = 8, RX_SKIP_WIN = 16 };

typedef struct rx_measure_params {
    int naper;
    double aperture_diameter[RX_MAX_APERTURES]; /* PHOT_APERTURES, pixels */
    double auto_factor, auto_min_radius;        /* PHOT_AUTOPARAMS */
    double auto_aper_min, auto_aper_max;        /* PHOT_AUTOAPERS */
    double petro_factor, petro_min_radius;      /* PHOT_PETROPARAMS */
    int nradii;
    double flux_fraction[RX_MAX_RADII];    /* PHOT_FLUXFRAC */
    rx_mask_type neighbours;               /* MASK_TYPE */
    double seeing_fwhm;                    /* pixels, for CLASS_STAR */
    double pixel_scale;                    /* arcsec per pixel, for CLASS_STAR; 0 = 1 */
    const char *nnw_file;                  /* STARNNW_NAME, NULL = CLASS_STAR not wanted (0) */
    int vignet_width, vignet_height;       /* 0 = not wanted */
    int local_background, local_thickness; /* BACKPHOTO_TYPE LOCAL, BACKPHOTO_THICK */
    double analysis_threshold; /* ANALYSIS_THRESH for this image in sigmas (ADU when absolute); 0 = as
                                  detection left it in rx_source.analysis_threshold */
    int analysis_absolute;
    unsigned skip; /* RX_SKIP_ bits */
    int nthreads;
} rx_measure_params;

typedef struct rx_measure_image {
    int width, height;
    const float *pixels;           /* background subtracted, unless with_sky */
    int with_sky;                  /* pixels are as in the tile: `level` is taken off when one is read */
    const float *sigma;            /* noise of a pixel; read with variable_noise only */
    rx_map level;                  /* background, for BACKGROUND; may be none */
    const uint8_t *mask;           /* may be NULL */
    int mask_bits;                 /* bits that hide a pixel */
    const uint8_t *saturated_mask; /* same plane or the tile's, tested for RX_MASK_SATURATED; may be NULL */
    double gain;                   /* e-/ADU, 0 = infinite */
    double global_sigma;
    int variable_noise; /* 1: sigma says the noise (weight map), 0: global_sigma everywhere */
    int weight_gain;    /* WEIGHT_GAIN with a weight map: photon noise scales with the pixel's variance */
    int nflagmaps;
    uint32_t *const *flagmaps;
    int flag_type;               /* FLAG_TYPE: 0 OR, 1 AND, 2 MIN, 3 MAX, 4 MOST */
    const int *flag_types;       /* [nflagmaps] one for each map; NULL: flag_type for all */
    const rx_noise_law *law;     /* errors of sums on correlated noise; NULL: the power law below */
    double law_scale, law_power; /* 1, 0.5: independent pixels */
    /* Dual-image mode: the detection image, from which SExtractor takes the radii of AUTO and PETRO so that
     * apertures are the same on all measurement images. Same grid; NULL: this image. */
    const struct rx_measure_image *radii;
} rx_measure_image;

/* Fill the photometry and windowed columns of every source (detection columns given). Sources are
 * independent of each other; so is the result of nthreads. What cannot be measured is flagged in
 * flags_measure and never stops the tile. Values of hidden pixels are never read.
 * Errors: RX_USAGE for the .nnw file, RX_SYSTEM without memory, RX_INTERRUPTED. */
rx_status rx_measure_run(const rx_measure_params *par, const rx_measure_image *image, rx_log *log,
                         rx_sources *sources, rx_error *err);

#endif
