/* Photometry and shapes of detected sources on an image of the same pixel grid.
 *
 * Conventions of SExtractor 2.25 throughout (its manual, and facts read from its public source):
 * so that a survey's numbers stay what they were. The loops are our own rather than sep's because
 * neighbours are mirrored (MASK_TYPE CORRECT), errors follow a noise law, and flags are wanted. */
#ifndef RX_MEASURE_MEASURE_H
#define RX_MEASURE_MEASURE_H

#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/image.h"
#include "data/sources.h"
#include "measure/noise.h"

RX_BEGIN_DECLS

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
    const struct rx_starclass *star_net;   /* of STARNNW_NAME, borrowed; NULL: CLASS_STAR not requested (0) */
    int vignet_width, vignet_height;       /* 0 = not wanted */
    int local_background, local_thickness; /* BACKPHOTO_TYPE LOCAL, BACKPHOTO_THICK */
    double analysis_threshold; /* ANALYSIS_THRESH for this image in sigmas (ADU when absolute); 0 = as
                                  detection left it in rx_source.analysis_threshold */
    int analysis_absolute;
    int weight_gain;       /* WEIGHT_GAIN with a weight map: photon noise scales with the pixel's variance */
    const int *flag_types; /* [nflagmaps] FLAG_TYPE: 0 OR, 1 AND, 2 MIN, 3 MAX, 4 MOST; NULL: OR */
    unsigned skip;         /* RX_SKIP_ bits */
    int nthreads;
} rx_measure_params;

/* Fill the photometry and windowed columns of every source (detection columns given). The noise of an image with
 * variable_noise is a plane. radii, of dual-image mode: the detection image, from which SExtractor takes the radii of
 * AUTO and PETRO so that apertures are the same on all measurement images; same grid; NULL: this image. Sources are
 * independent of each other; so is the result of nthreads. What cannot be measured is flagged in
 * flags_measure and never stops the tile. Values of hidden pixels are never read.
 * Errors: RX_SYSTEM without memory, RX_INTERRUPTED. */
rx_status rx_measure_run(const rx_measure_params *par, const rx_image *image, const rx_image *radii,
                         rx_log *log, rx_sources *sources, rx_error *err);

RX_END_DECLS

#endif
