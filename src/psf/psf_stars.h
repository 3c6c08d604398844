/* PSF_TYPE AUTO, first half: which sources of a list are stars that a PSF can be measured from. */
#ifndef RX_PSF_PSF_STARS_H
#define RX_PSF_PSF_STARS_H

#include "base/error.h"
#include "data/sources.h"
#include "data/tile.h"
#include "psf/psf.h"

typedef struct rx_star {
    int source; /* index in the source list */
    double snr;
    double radius; /* half-light radius, pixels */
} rx_star;

typedef struct rx_star_list {
    int n;
    rx_star *list;  /* by falling S/N, at most RX_STARS_MAX */
    int candidates; /* sources that were bright, unsaturated and clean enough to be asked */
    double radius;  /* of the stellar locus, pixels; 0 when none was found */
} rx_star_list;

enum { RX_STARS_MAX = 120 };

/* Bright, clean, isolated sources on the stellar locus (the narrowest well-populated half-light radius).
 * In crowded fields, where fewer than `enough` are isolated, close neighbours and blends are let in
 * too. Frees with rx_stars_free(). Errors: RX_SYSTEM memory; few or no stars are not one. */
rx_status rx_stars_select(const rx_psf_params *par, const rx_tile *tile, const rx_background *background,
                          const rx_sources *sources, int enough, rx_star_list *dst, rx_error *err);
void rx_stars_free(rx_star_list *stars);

#endif
