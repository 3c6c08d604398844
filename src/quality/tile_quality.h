/* What a tile says of its own quality, without any reference: numbers of its page (report/tile_page.h) and of its
 * record.
 *
 * Shapes are of second moments under a round Gaussian as wide as the PSF, which a Gaussian profile takes exactly:
 *
 *   M = sum w p u u^T / sum w p,   C = (M^-1 - W^-1)^-1,   FWHM = 2.3548 det(C)^(1/4),   ellipticity = 1 - b/a of C
 *
 * the same for stars and for the PSF, so that their difference means something where the profile is none (Bernstein &
 * Jarvis 2002, AJ 123, 583). */
#ifndef RX_QUALITY_TILE_QUALITY_H
#define RX_QUALITY_TILE_QUALITY_H

#include "base/error.h"
#include "data/image.h"
#include "data/restored.h"
#include "data/sources.h"
#include "quality/qa.h"

/* Means over cells of `side` pixels; NAN where none of a cell's pixels counts. */
typedef struct rx_tile_cells {
    int nx, ny, side;
    double *value; /* [ny][nx], owned; as much room behind it */
} rx_tile_cells;

enum { RX_TILE_CELLS = 48, RX_TILE_GRID = 9, RX_TILE_STARS = 400, RX_TILE_PULLS = 61, RX_TILE_MAGS = 60 };

/* C of above, 0 where it could not be measured. */
typedef struct rx_tile_ellipse {
    double fwhm, ellipticity, theta; /* pixels, 1 - b/a, rad from x */
} rx_tile_ellipse;

typedef struct rx_tile_point {
    double x, y;
    rx_tile_ellipse shape, psf; /* of the pixels (stars alone), of the PSF there */
} rx_tile_point;

/* One restorer. */
typedef struct rx_tile_restored {
    const rx_qa_run *about; /* its list may be empty */
    const rx_sources *sources;
    const rx_restored *restored;
    rx_tile_cells pull;  /* width of what the model leaves, in errors of a point source; nx 0: not known */
    double unexplained;  /* share of cells; NAN: not known */
    const char *misfit;  /* what makes results of the tile wrong, in words, with `by` behind; NULL: nothing */
    double by;           /* a number */
    int plain;           /* nothing was restored */
    const char *outside; /* what the restorer was not made for, "" nothing */
} rx_tile_restored;

typedef struct rx_tile_about {
    const char *name;
    rx_image image; /* with sky, noise and PSF (NULL: none), and the correlation of its noise */
    int nruns;
    const rx_tile_restored *runs;
    uint64_t seed; /* of the random sources */
} rx_tile_about;

typedef struct rx_tile_remark {
    const char *key;    /* a plain word */
    int bad;            /* 1: numbers are wrong, 0: look at it */
    char sentence[320]; /* what was found, in numbers */
} rx_tile_remark;

enum { RX_TILE_REMARKS = 40 };

typedef struct rx_tile_quality {
    const rx_tile_about *about;
    rx_tile_cells sky, noise;  /* ADU */
    int ngrid, nstars, chosen; /* chosen: stars by the locus, as no list made the PSF */
    rx_tile_point grid[RX_TILE_GRID * RX_TILE_GRID], star[RX_TILE_STARS];
    double fwhm;                /* of the PSF at the centre, as in log and header, pixels; NAN without one */
    double fwhm_low, fwhm_high; /* over the grid */
    double moments_to_fwhm;     /* widths of moments, of PSF and stars, are scaled by it */
    double ellipticity;         /* mean over the grid, of the vector */
    double wider, wider_error, wider_scatter, wider_n; /* median of star / PSF - 1 */
    double half_light;                                 /* of the PSF, pixels */
    double sky_median, sky_range;                      /* ADU; range: 5 to 95 % of the cells */
    double noise_median, noise_factor;                 /* factor: of sums, wide */
    double depth;               /* mag of a point source at S/N 5 in the sky's noise; NAN without PSF */
    double masked, saturated;   /* shares of the pixels */
    double pull[RX_TILE_PULLS]; /* pixels without sources, of (pixel - sky) / noise from -6.1 by 0.2 */
    double pulls, below, above, width; /* beyond -5 and 5, and sigma from quartiles */
    int nremarks;
    rx_tile_remark remark[RX_TILE_REMARKS];
} rx_tile_quality;

/* `about` must live as long. Errors: RX_SYSTEM. */
rx_status rx_tile_quality_make(const rx_tile_about *about, rx_tile_quality **dst, rx_error *err);
void rx_tile_quality_free(rx_tile_quality *quality); /* NULL is fine */

/* Magnitude of a point source of S/N 5 at the image's global noise. */
double rx_tile_depth(const rx_image *image);

double rx_tile_mag(const rx_image *image, double flux); /* NAN of a flux that is not positive */

/* Counts of a run by magnitude: bins of 0.5 mag from `low`. slope: log10 N per mag between the brightest tenth and one
 * mag above the fullest bin, NAN with fewer than 3 bins; peak: middle of the fullest bin. */
typedef struct rx_tile_counts {
    int n;
    double low, count[RX_TILE_MAGS], slope, slope_error, peak;
} rx_tile_counts;
rx_tile_counts rx_tile_count(const rx_image *image, const rx_sources *sources);

/* The sources of cut-outs: five brightest, the five brightest blended ones that are left, five by chance. Indices;
 * kind: 0, 1, 2. Returns how many, -1 without memory. */
enum { RX_TILE_CUTS = 15, RX_TILE_CUTS_EACH = 5 };
typedef struct rx_tile_cut {
    int source, kind;
} rx_tile_cut;
int rx_tile_cuts(const rx_sources *sources, uint64_t seed, rx_tile_cut dst[RX_TILE_CUTS]);

#endif
