/* One tile with what is known of it before restoration: sky, noise and PSF. */
#ifndef RX_PIPELINE_FIELD_H
#define RX_PIPELINE_FIELD_H

#include "base/error.h"
#include "base/extern.h"
#include "base/log.h"
#include "data/image.h"
#include "data/record.h"
#include "data/sources.h"
#include "pipeline/params.h"

RX_BEGIN_DECLS

typedef struct rx_field {
    rx_image image;          /* as it was given; its sky, noise and PSF are those below */
    rx_tile *tile;           /* its owner, owned; NULL: the caller of rx_field_new() is */
    uint8_t *mask;           /* owned; NULL: that of the tile */
    rx_background *plain;    /* with RX_HIDE_PLAIN */
    rx_background *restored; /* with RX_HIDE_RESTORED; the same object when nothing is saturated */
    rx_psf *psf;             /* NULL when no restorer needs it, or none could be found */
    /* rx_domain_noise() and noise factor of the tile that this one is a copy of, and restored as; 0 = it is none */
    double model_noise, model_factor;
    rx_noise_correlation noise; /* of its pixels */
    double
        widened; /* factor that rx_field_noise_effective() has put on the noise of the skies; 0: none yet */
    double noise_factor;     /* of the PSF's matched filter, rx_noise_factor(); without a PSF of wide sums */
    rx_scaled_map effective; /* room for noise_factor times the noise of `restored` */
    /* pixels: the FWHM is below, as the narrowest sources say where no star does; 0: not known */
    double psf_bound;
    rx_record inputs; /* files that were read for the PSF of stars that say nothing: keyword, name */
    size_t deep;      /* pixels with RX_MASK_DEEP */
    size_t cores;     /* pixels with RX_MASK_CORE */
    size_t no_data;   /* pixels that are hidden by detect/no_data.h */
    int nstars;       /* sources that the PSF's stars were chosen among */
    int unrestorable; /* neither stars nor what was stated give a PSF */
    rx_lap background_lap, psf_lap; /* of preparing it */
} rx_field;

/* What is worked on: sources are detected on the one and measured on the other; the same one twice without dual-image
 * mode. */
typedef struct rx_fields {
    const rx_field *detect, *measure;
} rx_fields;

/* Bits of `what`: which of two images it is in dual-image mode, and whether its PSF is needed, or would serve the detection
 * filter, and nothing is said where there is none. */
enum { RX_FIELD_DETECTED = 0, RX_FIELD_MEASURED = 1, RX_FIELD_PSF = 2, RX_FIELD_FILTER = 4 };

/* The caller's arrays, which must live as long as the field. Where the PSF of the image is not given and is needed,
 * params say where it comes from. Hidden is what the caller's mask hides, what is not rx_pixel_usable(), and what has
 * a weight of MAP_WEIGHT that is not above 0, and no data (detect/no_data.h); saturated what is at image->saturation or above. Errors: RX_USAGE,
 * RX_INPUT, RX_SYSTEM. */
rx_status rx_field_new(const rx_pipeline_params *params, int what, const rx_image *image, rx_log *log,
                       rx_field **dst, rx_error *err);

/* A tile in memory, which belongs to the field from then on, and is freed when this fails; `known`: its PSF, of which
 * a copy is taken, or NULL. */
rx_status rx_field_prepare(const rx_pipeline_params *params, int what, rx_tile *tile, const rx_psf *known,
                           rx_log *log, rx_field **dst, rx_error *err);

/* The tile on the sky `plain`, as RESTORE_TYPE NONE takes it, and on the sky `restored` with saturated pixels hidden,
 * as other restorers do; views with the field's PSF. */
rx_image rx_field_observed(const rx_field *field);
rx_image rx_field_restorable(const rx_field *field);

/* rx_field_restorable() in effective noise: sigma is that of independent pixels whose matched filter is as noisy. */
rx_image rx_field_effective(const rx_field *field);

/* MEASURED, WHITE, FILE or UNKNOWN: where the correlation of its noise comes from. */
const char *rx_field_noise_origin(const rx_field *field);

void rx_field_free(rx_field *field);

RX_END_DECLS

#endif
