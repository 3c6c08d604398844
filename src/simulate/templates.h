/* Real galaxies as templates: FITS cut-outs, each with its own pixel scale, PSF and noise. */
#ifndef RX_SIMULATE_TEMPLATES_H
#define RX_SIMULATE_TEMPLATES_H

#include "base/error.h"
#include "base/log.h"

typedef struct rx_template {
    char name[80];
    int width, height;
    float *pixels;       /* sky subtracted, sum 1 over the object, 0 where nothing but noise is */
    double x, y;         /* centroid, pixels from 0: what lies at the position of an object */
    double pixel_scale;  /* arcsec */
    double fwhm;         /* of its own PSF, arcsec; 0 = unknown */
    double radius;       /* half-light radius, template pixels, circular */
    double ratio, angle; /* shape from second moments */
    double snr;          /* of the whole object in its own noise */
} rx_template;

typedef struct rx_templates {
    int n;
    rx_template *list;
} rx_templates;

/* `name`: a folder (every .fits in it, by name), a list (`@file`, a name per line, # comments), or one FITS
 * file. Files with many image HDUs give one template each; GalSim's RealGalaxy layout (a catalogue beside
 * images and PSFs) is understood. pixel_scale (arcsec) serves where a header has none. Noise outside the
 * object is cut away and what is left inside is smoothed no more than stated in templates.c. Templates below
 * min_snr are left out, told through log. Errors: RX_INPUT naming the file. */
rx_status rx_templates_read(const char *name, double pixel_scale, double min_snr, rx_log *log,
                            rx_templates **dst, rx_error *err);
/* FWHM of what blurs the template as it is drawn, in template pixels: its own PSF (taken as 2 pixels where it
 * is unknown) and the cubic B-spline that it is drawn with (8 ln 2 / 3 pixels^2), in quadrature. Times
 * rx_object.stretch it is the FWHM on the tile, which comes on top of the tile's PSF. */
double rx_template_blur(const rx_template *source);

void rx_templates_free(rx_templates *templates);

#endif
