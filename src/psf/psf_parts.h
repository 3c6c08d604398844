/* What the files of this folder share and nobody else needs. */
#ifndef RX_PSF_PSF_PARTS_H
#define RX_PSF_PSF_PARTS_H

#include "base/error.h"
#include "base/log.h"
#include "data/psf.h"
#include "data/sources.h"
#include "data/tile.h"
#include "psf/psf.h"

enum { RX_LANCZOS_MAX = 12 };

/* An image on its own grid; (centre_x, centre_y) is the point that shall come to lie on the middle
 * of a pixel. */
typedef struct rx_psf_raster {
    const float *pixels; /* [height][width] */
    int width, height;
    double centre_x, centre_y;
} rx_psf_raster;

/* dst [size][size], size odd: src by Lanczos interpolation of that order (<= RX_LANCZOS_MAX) at centre + (i -
 * size / 2, j - size / 2) * step source pixels, 0 outside. Values are interpolated, not integrated. Errors:
 * memory. */
rx_status rx_psf_resample(const rx_psf_raster *src, double step, int order, double *dst, int size,
                          rx_error *err);

/* The file's name without its folder: outputs hold no paths. */
const char *rx_psf_base_name(const char *file);

/* fwhm, ellipticity at the tile's centre from the stamp there; error names the file. */
rx_status rx_psf_describe(rx_psf *psf, const char *file, int width, int height, rx_error *err);

/* Side of a PSF at most, pixels: stamps are counted by int, and no PSF needs more. */
enum { RX_PSF_LARGEST = 4095 };

/* RX_INPUT unless a stamp of this size fits into the tile and is no larger than RX_PSF_LARGEST. */
rx_status rx_psf_check_size(const char *file, int psf_width, int psf_height, int width, int height,
                            rx_error *err);

/* Side that is left of a square stamp of odd side `from` when `size` (0 = all) is asked for. */
int rx_psf_cut_size(int from, int size);

/* PSF_TYPE AUTO: from the stars of the tile. */
rx_status rx_psf_estimate(const rx_psf_params *par, const rx_tile *tile, const rx_background *background,
                          const rx_sources *sources, rx_log *log, rx_psf **dst, rx_error *err);

#endif
