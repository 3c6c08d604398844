/* An image as every stage takes it: pixels, and what is known of them.
 *
 * A view: it owns nothing and lives as long as what it points to. Copy it and change a member to see the same
 * pixels otherwise (another mask, another sky). Owners are rx_tile (what was read, data/tile.h), rx_background
 * (sky and noise), rx_psf and rx_restored, or the caller. Row-major, x fastest; pixel (0, 0) is the
 * first one. What is 0 or NULL is not known or not there.
 */
#ifndef RX_DATA_IMAGE_H
#define RX_DATA_IMAGE_H

#include "base/extern.h"
#include "data/map.h"
#include "data/noise_correlation.h"
#include "data/psf.h"
#include "data/tile.h"

RX_BEGIN_DECLS

struct rx_noise_law; /* measure/noise.h */

/* Pixels that hide in a plain extraction (as in SExtractor, saturated ones are used and flagged) and in
 * a restored image (a saturated value is a lower limit and would ring). */
enum {
    RX_HIDE_PLAIN = RX_MASK_BAD | RX_MASK_WEIGHT | RX_MASK_CORE,
    RX_HIDE_RESTORED = RX_HIDE_PLAIN | RX_MASK_SATURATED | RX_MASK_UNTOUCHED | RX_MASK_DEEP
};

typedef struct rx_image {
    const char *name; /* of log lines and errors, with the HDU */
    int hdu;
    int extension; /* 1, 2, ... among the images of a file (EXT_NUMBER) */
    int width, height;
    const float *pixels;      /* [height][width] ADU */
    const uint8_t *mask;      /* [height][width] RX_MASK_ bits; NULL: nothing is hidden */
    int hide;                 /* a pixel with mask & hide is not used */
    const uint8_t *saturated; /* [height][width] tested for RX_MASK_SATURATED; NULL: none is */
    rx_map level;             /* sky, ADU; none: 0 */
    int with_sky;             /* pixels hold the sky, too: the level is still to be taken off */
    rx_map noise;             /* sigma of a pixel without sources, ADU */
    int variable_noise;  /* thresholds and errors ask each pixel for its noise; 0: global_noise, as SExtractor
                                 without a weight map */
    double global_noise; /* ADU */
    const struct rx_noise_law *law;          /* noise of apertures; NULL: that of independent pixels */
    const rx_noise_correlation *correlation; /* of the noise; NULL: independent pixels */
    const float *weight;                     /* [height][width] as WEIGHT_IMAGE has it; NULL: none */
    rx_weight_type weight_type;
    const float *restored, *restored_noise; /* [height][width] RESTORE_TYPE FILE (data/tile.h); NULL: none */
    int nflagmaps;
    uint32_t *const *flagmaps; /* [nflagmaps] planes [height][width] */
    double gain;               /* e-/ADU; 0: no photon noise */
    double saturation;         /* ADU; HUGE_VAL when unknown */
    double zeropoint;          /* mag of 1 ADU */
    double pixel_scale;        /* arcsec per pixel at the centre; 0 when unknown */
    const rx_psf *psf;
    struct rx_wcs *wcs;   /* NULL: no celestial coordinates */
    const double *linear; /* [6] of rx_tile.linear; NULL: none */
} rx_image;

/* What a tile says of itself; hide 0, sky, noise and PSF not known. */
rx_image rx_tile_image(const rx_tile *tile);

/* The same image with that sky and noise, and hidden what was hidden when these were measured. */
rx_image rx_image_on_sky(const rx_image *image, const rx_background *sky);

/* That image after a restorer: its pixels above the sky, its mask, its PSF. hide, sky and noise are the input's. */
struct rx_restored;
rx_image rx_restored_image(const struct rx_restored *restored, const rx_image *input);

/* An image in the unit that is its own (data/unit.h). With a unit of 1 it is the image itself. */
typedef struct rx_image_scaled {
    rx_image image; /* lives as long as what it was made of */
    double unit;    /* ADU */
    float *pixels;  /* owned; NULL with a unit of 1 */
    rx_scaled_map level, noise;
} rx_image_scaled;

/* 1; 0: no memory. The struct may not be copied afterwards. Free its contents with rx_image_scaled_clear(). */
int rx_image_in_unit(const rx_image *image, rx_image_scaled *dst);
void rx_image_scaled_clear(rx_image_scaled *scaled);

/* dst[height][width]: the pixels above the sky's level; 0 where hidden. */
void rx_image_above_sky(const rx_image *image, int nthreads, float *dst);

/* z[n] = (pixel - sky) / sigma from (x, y) on, n at most RX_MAP_PIECE; NAN where hidden or not known. */
void rx_image_sigmas(const rx_image *image, int x, int y, int n, float *z);

/* What is still to be taken off the pixels: the level, or nothing where that is done. */
static inline rx_map rx_image_sky(const rx_image *image)
{
    return image->with_sky ? image->level : rx_map_plane(NULL, 0);
}

static inline int rx_image_hides(const rx_image *image, size_t k)
{
    return image->mask != NULL && (image->mask[k] & image->hide) != 0;
}

RX_END_DECLS

#endif
