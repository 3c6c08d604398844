/* The source list: what detection fills, what measurement fills, what the catalogue writes.
 *
 * Positions are 0-based pixels (catalog/ adds 1). Angles: radians, counter-clockwise from
 * the x axis, in (-pi/2, pi/2]. Fluxes in ADU, background subtracted. Magnitudes are made
 * by catalog/ from flux, error and zero point. Names follow SExtractor's columns.
 */
#ifndef RX_DATA_SOURCES_H
#define RX_DATA_SOURCES_H

#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"

/* The bits of all flag columns: RX_FLAG_ (FLAGS), RX_FLAGW_ (FLAGS_WEIGHT), RX_FLAGWIN_ (FLAGS_WIN), RX_FLAGM_
 * (FLAGS_MEASURE), RX_TPHOT_ (FLAGS_TEMPLATE), RX_RESTORE_ (FLAGS_RESTORE). */
enum {
#define FLAG(column, prefix, name, bit, meaning) prefix##name = (bit),
#include "data/flags.def"
#undef FLAG
};

RX_BEGIN_DECLS

/* What became of pixels above the detection threshold that are no source's own. */
enum {
    RX_FRAGMENT_SMALL =
        1, /* in a group of fewer than DETECT_MINAREA pixels; segment 0, hidden like a neighbour */
    RX_FRAGMENT_EATEN = 2 /* of a detection that CLEAN merged into the source of the segment: counts for its
                             FLUX_ISO, not for its shape, and is not hidden from others */
};

/* Template photometry (template/template.h) of a source. */
typedef struct rx_source_template {
    double flux, fluxerr; /* ADU, of the whole template */
    double snr;           /* of the flux in the noise of its pixels alone, as sources are selected by */
    double chi2;          /* reduced, of the source's own pixels */
    double evidence;      /* that it is no piece of a neighbour: rise of chi2 without it */
    double preal;         /* probability that it is there (fit/preal.h), and no artefact */
    double artefact;      /* probability of that: a hit (fit/hits.h), a place on a line (fit/lines.h) */
    double injected[2];   /* error of flux from injected objects, 68 and 95 % (check/conformal.h); NAN */
    double blend;         /* largest |coefficient of covariance| with a neighbour, 0 alone */
    double x, y;          /* 0-based pixels, of the fit */
    double alpha, delta;  /* deg, J2000 */
    double star;          /* probability of a point, 0..1 */
    double two;           /* probability that it is two sources, 0..1 */
    double radius;        /* half-light radius before the PSF, pixels; 0 of a point */
    double ratio, theta;  /* axis ratio b/a, radians */
    int group;            /* from 1; 0: no fit */
    int entry;            /* of rx_tphot.list, from 0 */
    int flags;            /* FLAGS_TEMPLATE, RX_TPHOT_ */
    int restore;          /* FLAGS_RESTORE */
} rx_source_template;

/* The same source as a point and as Sersic's profile (template/models.h): NAN where not asked for or not fitted. */
typedef struct rx_source_point {
    double flux, fluxerr; /* ADU */
    double x, y;          /* 0-based pixels */
    double alpha, delta;  /* deg, J2000 */
    double chi2;          /* reduced */
    double spread, spread_error;
} rx_source_point;

typedef struct rx_source_sersic {
    double flux, fluxerr; /* ADU, to infinity */
    double radius[2], index[2], ratio[2],
        theta[2]; /* half-light radius along the major axis, pixels; n; b/a; radians; errors of them */
} rx_source_sersic;

enum { RX_MAX_APERTURES = 32, RX_MAX_RADII = 16, RX_MAX_FLAGMAPS = 8, RX_NISO = 8 };

typedef struct rx_source {
    int number;    /* from 1 in this extension */
    int untouched; /* 1 + row of rx_saturated.list (pipeline/saturated.h): a saturated star that a restorer
                      left as it was observed; 0: as all others */
    /* --- detection (isophotal, on the detection image) --- */
    int xmin, xmax, ymin, ymax; /* 0-based, inclusive */
    int xpeak, ypeak;
    int npix;          /* ISOAREAF_IMAGE: pixels above the threshold on the filtered image */
    int isoarea;       /* ISOAREA_IMAGE */
    int iso[RX_NISO];  /* ISO0..ISO7 */
    double x, y;       /* barycentre */
    double x2, y2, xy; /* second moments, pixel^2 */
    double errx2, erry2, errxy;
    double a, b, theta; /* rms ellipse */
    double cxx, cyy, cxy;
    double threshold; /* detection threshold at the peak, ADU above background */
    double analysis_threshold;
    double detection_snr; /* peak of the filtered detection image in sigmas of its noise: ranks detections */
    double fwhm;          /* FWHM_IMAGE, pixels */
    double class_star;
    double background; /* BACKGROUND at the centroid, ADU */
    int flags, flags_weight, flags_measure;
    uint32_t imaflags[RX_MAX_FLAGMAPS]; /* IMAFLAGS_ISO */
    int nimaflags[RX_MAX_FLAGMAPS];
    double masked_fraction; /* share of masked pixels in the AUTO ellipse (MASKED_FRACTION) */
    /* --- photometry (on the measurement image) --- */
    double peak; /* FLUX_MAX */
    double flux_iso, fluxerr_iso;
    double flux_isocor, fluxerr_isocor;
    double flux_auto, fluxerr_auto, kron_radius;
    double flux_petro, fluxerr_petro, petro_radius;
    double flux_win, fluxerr_win, snr_win;
    double flux_aper[RX_MAX_APERTURES], fluxerr_aper[RX_MAX_APERTURES];
    double flux_radius[RX_MAX_RADII]; /* pixels */
    double xwin, ywin;
    double x2win, y2win, xywin;
    double errx2win, erry2win, errxywin;
    double awin, bwin, thetawin;
    double cxxwin, cyywin, cxywin;
    int niter_win, flags_win;
    rx_source_template fit; /* numbers NAN, group 0 and RX_RESTORE_UNTESTED where nothing was fitted */
    rx_source_point point_fit;
    rx_source_sersic sersic_fit;
    /* --- sky --- */
    double alpha, delta;             /* deg, native frame of the WCS (ALPHA_SKY) ; NAN without WCS */
    double alpha_j2000, delta_j2000; /* deg, ICRS/FK5 */
    double alphawin_j2000, deltawin_j2000;
    double alphapeak_j2000, deltapeak_j2000;
    double x_world, y_world;                         /* native world coordinates */
    double alphawin, deltawin, alphapeak, deltapeak; /* native, of the windowed position and the peak */
    double north_j2000; /* rad: position angle of native north in the J2000 frame (0 when native is J2000) */
    double world_matrix[4]; /* d(east, north in deg, i.e. dalpha*cos(delta), ddelta)/d(x,y): shape columns in
                               world units */
    /* --- cross-identification --- */
    int number_assoc;           /* matches in the ASSOC list */
    const double *vector_assoc; /* [nassoc] into rx_sources.assoc, or NULL */
    int32_t segment;            /* value in the segmentation map (= number unless removed by ASSOC) */
} rx_source;

typedef struct rx_sources {
    int n;
    rx_source *list; /* [n] */
    int width, height;
    int32_t *segments;  /* [height][width]; 0 = sky, else rx_source.segment */
    uint8_t *fragments; /* [height][width] RX_FRAGMENT_; NULL: not known */
    int naper;          /* used entries of flux_aper; diameters in aperture_diameter, pixels */
    double aperture_diameter[RX_MAX_APERTURES];
    int nradii; /* used entries of flux_radius; shares in flux_fraction */
    double flux_fraction[RX_MAX_RADII];
    int nflagmaps;
    int nassoc;                      /* columns copied from the ASSOC list (VECTOR_ASSOC) */
    double *assoc;                   /* owner of the vectors, [rows][nassoc] */
    int vignet_width, vignet_height; /* 0 = none */
    float *vignets;                  /* [n][vignet_height][vignet_width], masked pixels -1e30 */
    int grown;                       /* times detection limits had to be raised */
    /* error calibration, see measure/noise.h: sigma(A) = law_scale * sigma_pixel * A^law_power */
    double law_scale, law_power; /* 1 and 0.5 = independent pixels */
    int law_apertures;           /* empty apertures behind the fit, 0 = not calibrated */
    double law_scatter;          /* robust rms of the fit in dex */
} rx_sources;

/* Both are not asked for. */
void rx_source_without_fits(rx_source_point *point, rx_source_sersic *sersic);

/* Are so many of `all` sources marked as spurious that noise, PSF or gain are to be doubted, and not they: more than a fifth, by
 * more than two errors of their number? */
int rx_spurious_are_many(long marked, long all);

/* 1: a mark of FLAGS_RESTORE says that the source is spurious, not significant in the untouched pixels. */
int rx_source_is_spurious(const rx_source *source);

/* It is an artefact with that probability, or the one it had if that is higher; RX_RESTORE_SHARP above 0.5. */
void rx_source_doubt(rx_source *source, double artefact);

/* Keep the sources with keep[i] != 0: list, vignets, assoc rows and segmentation map in step; numbers and
 * segments are given anew from 1, the segments of those that go become sky. Errors: RX_SYSTEM. */
rx_status rx_sources_select(rx_sources *sources, const unsigned char *keep, rx_error *err);

void rx_sources_free(rx_sources *sources);

RX_END_DECLS

#endif
