/* Which sources of a list are stars. */
#ifndef RX_PSF_STARS_H
#define RX_PSF_STARS_H

#include "base/error.h"
#include "base/log.h"
#include "data/image.h"
#include "data/sources.h"
#include "psf/moffat.h"
#include "psf/params.h"

typedef struct rx_candidate {
    int source; /* index in the source list */
    double snr;
    double radius; /* half-light radius, pixels */
    double level;  /* of its peak with the sky there, ADU */
} rx_candidate;

typedef struct rx_star_list {
    int n;
    rx_candidate *list;
    double limit; /* ADU of the pixels from which on sources are flattened: soft saturation; HUGE_VAL: none */
    int flattened; /* sources that were left out for it */
} rx_star_list;
void rx_candidates_sort(rx_candidate *list, int n); /* by falling S/N */

void rx_star_list_free(rx_star_list *stars);

enum { RX_STARS_MAX = 80, RX_LOCI_MAX = 9 };

/* Half-light radius, pixels, as pixels show it, of a point source of FWHM 1.2 that falls between four: a Gaussian of variance
 * (1.2 / 2.35)^2 + 2 / 12. Hits of particles are that narrow, too. */
#define RX_STARS_NARROW 0.77

/* What selection looks at; level 0 takes sources with FLAGS 0 and no neighbour of weight, level 1 (crowded
 * fields) lets in close neighbours and blends. Above `share` of the way from the sky to `limit` (ADU; 0: none) it takes none. */
typedef struct rx_star_search {
    const rx_psf_params *par;
    const rx_image *image;
    const rx_sources *sources;
    int level;
    double limit, share;
} rx_star_search;

/* Sources that are bright, unsaturated, unmasked, roundish and wider than a hot pixel; rx_star_list_free(). Errors,
 * here and below: RX_SYSTEM memory; none found is not one. */
rx_status rx_stars_candidates(const rx_star_search *search, rx_star_list *dst, rx_error *err);

/* Leaves out candidates whose peaks are flattened by soft saturation, where they show it by being wider than the stars,
 * of that half-light radius; lowers list->limit. */
rx_status rx_stars_flattened(const rx_star_search *search, double radius, rx_star_list *list, rx_error *err);

/* Half-light radii (pixels) where candidates crowd: the stellar locus is one of them, usually the narrowest. Returns
 * how many in *n. */
rx_status rx_stars_loci(const rx_star_search *search, const rx_star_list *candidates,
                        double radii[RX_LOCI_MAX], int *n, rx_error *err);

/* Isolated candidates of that half-light radius, by falling S/N, at most RX_STARS_MAX. *radius becomes their
 * median. */
rx_status rx_stars_near(const rx_star_search *search, const rx_star_list *candidates, double *radius,
                        rx_star_list *dst, rx_error *err);

/* What the Moffat of a tile was fitted to. */
typedef struct rx_moffat_tile {
    double shape[RX_MOFFAT_SHAPE];
    double radius; /* half-light radius of the stars, pixels */
} rx_moffat_tile;

/* What AUTO begins with, and has of few stars: one elliptical Moffat for the tile; found may be NULL. RX_INPUT: too few stars. */
rx_status rx_psf_fit_moffat(const rx_psf_params *par, const rx_image *image, const rx_sources *sources,
                            rx_log *log, rx_moffat_tile *found, rx_psf **dst, rx_error *err);

/* PSF_TYPE AUTO. */
rx_status rx_psf_measure(const rx_psf_params *par, const rx_image *image, const rx_sources *sources,
                         rx_log *log, rx_psf **dst, rx_error *err);

#endif
