/* Photometry and shapes of detected sources on an image of the same pixel grid. */
#ifndef RX_MEASURE_MEASURE_H
#define RX_MEASURE_MEASURE_H

#include "base/error.h"
#include "base/log.h"
#include "data/sources.h"
#include "data/tile.h"

typedef enum rx_mask_type { RX_NEIGHBOURS_NONE, RX_NEIGHBOURS_BLANK, RX_NEIGHBOURS_CORRECT } rx_mask_type;

typedef struct rx_measure_params {
    int naper;
    double aperture_diameter[RX_MAX_APERTURES]; /* PHOT_APERTURES, pixels */
    double auto_factor, auto_min_radius;        /* PHOT_AUTOPARAMS */
    double auto_aper_min, auto_aper_max;        /* PHOT_AUTOAPERS */
    double petro_factor, petro_min_radius;      /* PHOT_PETROPARAMS */
    int nradii;
    double flux_fraction[RX_MAX_RADII];         /* PHOT_FLUXFRAC */
    rx_mask_type neighbours;                    /* MASK_TYPE */
    double seeing_fwhm;                         /* pixels, for CLASS_STAR */
    const char *nnw_file;                       /* STARNNW_NAME, NULL = CLASS_STAR not wanted */
    int vignet_width, vignet_height;            /* 0 = not wanted */
    int local_background, local_thickness;      /* BACKPHOTO_TYPE LOCAL, BACKPHOTO_THICK */
    int nthreads;
} rx_measure_params;

typedef struct rx_measure_image {
    int width, height;
    const float *pixels;      /* background subtracted */
    const float *sigma;       /* noise of a pixel */
    const float *level;       /* background, for BACKGROUND; may be NULL */
    const uint8_t *mask;
    int mask_bits;            /* bits that hide a pixel */
    const uint8_t *saturated_mask; /* same plane or the tile's, tested for RX_MASK_SATURATED */
    double gain;
    double global_sigma;
    int variable_noise;
    int nflagmaps;
    uint32_t *const *flagmaps;
    int flag_type;            /* FLAG_TYPE: 0 OR, 1 AND, 2 MIN, 3 MAX, 4 MOST */
    double law_scale, law_power; /* 1, 0.5: independent pixels; else from rx_noise_law_fit() */
} rx_measure_image;

/* Fill the photometry and windowed columns of every source (detection columns given). */
rx_status rx_measure_run(const rx_measure_params *par, const rx_measure_image *image, rx_log *log,
                         rx_sources *sources, rx_error *err);

/* Noise against aperture area on source-free sky: sigma(A) = scale * sigma_pixel * A^power. */
typedef struct rx_noise_law {
    double scale, power;
    int apertures;   /* used, 0 = could not be fitted (scale 1, power 0.5) */
    int nradii;
    double area[16], ratio[16]; /* the points: sigma(A)/sigma_pixel */
    double scatter;  /* rms of the fit, dex */
} rx_noise_law;

rx_status rx_noise_law_fit(const rx_measure_image *image, const rx_sources *sources, int count, uint64_t seed,
                           rx_noise_law *law, rx_log *log, rx_error *err);

#endif
