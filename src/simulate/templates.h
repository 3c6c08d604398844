/* Real galaxies as templates: FITS cut-outs, each with its own pixel scale, PSF and noise. */
#ifndef RX_SIMULATE_TEMPLATES_H
#define RX_SIMULATE_TEMPLATES_H

#include "base/error.h"
#include "base/log.h"

typedef struct rx_template {
    char name[80];
    int width, height;
    float *pixels;       /* [height][width], sum 1, never negative, 0 where nothing but noise is */
    double x, y;         /* centroid, pixels from 0: what lies at the position of an object */
    double pixel_scale;  /* arcsec */
    double fwhm;         /* of its own PSF, its pixel included, arcsec; 0 = unknown */
    double radius;       /* half-light radius, template pixels, circular */
    double ratio, angle; /* shape from second moments */
    double snr;          /* of the whole object, as if the noise of its pixels were independent */
} rx_template;

typedef struct rx_templates {
    int n;
    rx_template *list;
} rx_templates;

/* `name`: a folder (every .fits, .fit, .fits.gz, .fits.fz in it, by name), a list (`@file`, a name per line,
 * # comments), or one FITS file. Files with many image HDUs give one template each, whose pixel scale is that
 * of the header's world coordinates, else pixel_scale (arcsec). A table with GAL_FILENAME and GAL_HDU (from
 * 0) is a catalogue of GalSim's RealGalaxy layout: images and PSFs are in the files that it names, beside it,
 * with PIXEL_SCALE and the sky NOISE_MEAN of the catalogue; in a folder it speaks for all other files. The
 * PSF of a plain file a_b.fits is a_b_psf.fits or a_psf.fits, on the same scale; names that end so are no
 * templates. The object is cut out as below. Templates below min_snr are left out, reported
 * through log, as are PSFs that no profile fits (their template then has fwhm 0). Errors: RX_INPUT naming the
 * file, or when no template is left; RX_SYSTEM memory. */
rx_status rx_templates_read(const char *name, double pixel_scale, double min_snr, rx_log *log,
                            rx_templates **dst, rx_error *err);
/* FWHM of what blurs the template as it is drawn, in template pixels: its own PSF (taken as 2 pixels where it
 * is unknown) and the cubic B-spline that it is drawn with (8 ln 2 / 3 pixels^2), in quadrature. Times
 * rx_object.stretch it is the FWHM on the tile, which comes on top of the tile's PSF. */
double rx_template_blur(const rx_template *source);

void rx_templates_free(rx_templates *templates);

/* The object of pixels [height][width] (mask: not 0 = bad, may be NULL): what is connected to the brightest
 * pixel of the image's middle half.
 *
 * Sky: median of the border, an eighth of the shorter side and at least 3 pixels wide (or `sky`, where it is
 * not NAN); noise: 1.4826 times the median absolute deviation there. The image smoothed by a Gaussian of FWHM
 * 6 pixels, with the noise that it has itself in the border (so that correlated noise counts as what it is),
 * is cut at 2.5 sigma; 8-connected pixels are the object, with a seam of a pixel around them for its wings.
 * Inside, pixels stay as they are where the image smoothed by 3 pixels is above 5 of its sigma; above 2.5
 * they are those of that image, else those of the one smoothed by 6. Nothing is negative.
 *
 * Fills pixels (cropped to the object, sum 1), width, height, x, y, radius, ratio, angle, snr of dst;
 * dst->pixels stays NULL when there is no object of more than 9 pixels. Errors: RX_SYSTEM memory. */
rx_status rx_template_isolate(const float *pixels, const unsigned char *mask, int width, int height,
                              double sky, rx_template *dst, rx_error *err);

#endif
