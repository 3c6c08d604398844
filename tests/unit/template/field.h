/* Small images with known sources, restored as they are (RESTORE_TYPE NONE) or perfectly, for the tests of
 * template photometry. */
#ifndef RX_TESTS_TEMPLATE_FIELD_H
#define RX_TESTS_TEMPLATE_FIELD_H

#include <stdint.h>

#include "data/psf.h"
#include "data/restored.h"
#include "data/sources.h"
#include "template/fit_image.h"
#include "template/template.h"

typedef struct field {
    int width, height;
    double fwhm;
    float *pixels, *sigma;
    uint8_t *mask;
    rx_psf *psf;
    rx_restored *restored;
    rx_sources *sources;
} field;

/* Empty, sky 0, noise sigma, room for n sources; Moffat PSF of beta 4.765 and that FWHM, stamp 20 FWHM. */
void field_open(field *f, int width, int height, double fwhm, double sigma, int n);
void field_close(field *f);

/* A star (x, y) of that flux into the pixels; not into the list. */
void field_star(field *f, double x, double y, double flux);

/* A round or elliptical exponential disk, 9 x 9 cells a pixel, blurred by the Moffat, pixel integrated. */
void field_disk(field *f, double x, double y, double flux, double radius, double ratio, double angle);

/* Lists a source at (x, y): its segment is a disk of that radius where nobody was before; rms ellipse as
 * given. */
void field_list(field *f, double x, double y, double reach, double a, double b, double theta);

/* Gaussian noise of sigma in every pixel. */
void field_noise(field *f, uint64_t seed);

/* The restored image becomes a copy of the pixels with the tile's own PSF. */
void field_restore_none(field *f);

rx_tphot_input field_input(const field *f);

/* A footprint with random values, to be freed. */
rx_footprint boxed(int x0, int y0, int w, int h, uint64_t seed);

#endif
