/* Template photometry: what it is given, and what comes of it. */
#ifndef RX_TEMPLATE_TPHOT_H
#define RX_TEMPLATE_TPHOT_H

#include <stddef.h>
#include <stdint.h>

#include "base/error.h"
#include "base/extern.h"
#include "data/image.h"
#include "data/restored.h"
#include "data/sources.h"

RX_BEGIN_DECLS

/* Whether a tile, or which of its cells, is a crowd (crowd.h). */
enum { RX_CROWDING_AUTO, RX_CROWDING_YES, RX_CROWDING_NO };

typedef enum rx_tphot_kind { RX_TPHOT_POINT, RX_TPHOT_PROFILE, RX_TPHOT_PIXELS } rx_tphot_kind;

typedef struct rx_tphot_params {
    double link;             /* normalised inner product of two templates that ties them into one group */
    int group_limit;         /* members of a group at most; the weakest links are cut */
    double background_sigma; /* width of the prior of a group's background, in sigmas of a pixel; 0: none
                                fitted */
    int sky_cell; /* pixels: in cells of that size the sky is measured again between the models and taken off;
                     0: the level is right */
    double psf_error; /* relative error of a pixel of a template, that of the PSF: bright stars are not tested
                         by more than the PSF is known to (Stetson 1987, PASP 99, 191: "profile error") */
    int passes; /* fits of everything at most, each but the first after a look at the residual; 2 where it is not crowded */
    int crowding; /* RX_CROWDING_ */
    double
        least; /* S/N below which what was added in a crowd is dropped; a source of a group that is as far below 0 stays at 0 */
    int rounds;       /* how often positions and shapes are refined, neighbours taken out; 0 = never */
    int extended;     /* 0: every source is a point */
    int substructure; /* 0: never PIXELS */
    int covariance;   /* fill rx_tphot.pairs */
    int keep_model;   /* fill rx_tphot.model and .residual */
    int point_fits, sersic_fits; /* fill those of rx_tphot_source; the latter with the former */
    double
        isolate; /* pixels: the model kept is without points of S/N above 20 that have none brighter within that radius, so that
                       pixels - model shows these as if they were alone, and evidence, which is not asked for, is not weighed; 0: of all */
    size_t shown; /* pixels of the image that are worked on at a time, more where a group reaches farther:
                       32 bytes each; the result does not depend on it */
    int nthreads; /* < 1 counts as 1; the result does not depend on it */
} rx_tphot_params;

typedef struct rx_tphot_source {
    rx_tphot_kind kind;
    double x, y;          /* 0-based pixels, of the fit */
    double flux, fluxerr; /* ADU, of the whole template, beyond border and masks too */
    double snr;           /* flux / fluxerr without the PSF's error */
    double chi2;          /* reduced, of the source's own pixels; NAN when there are none */
    int npixels;          /* behind chi2 */
    double blend;         /* largest |coefficient| of covariance with a neighbour, 0 when alone */
    double star;          /* probability, 0 extended .. 1 point */
    double two;           /* probability that it is two sources (two.h); NAN: not known */
    double point;         /* share of the light that is fitted as a point; 1 for POINT */
    double chi2_gain;     /* chi2 of the point minus that of the best profile; 0 where no profile was tried */
    double radius, ratio, angle, index; /* profile: half-light radius (geometric mean of both axes, pixels),
                                           b/a, radians from x, Spergel's nu (0.5 = exponential); 0, 1, 0, 0.5
                                           of a point */
    double shape_error;                 /* fluxerr is that many times the error at fixed shape, >= 1 */
    double inside, masked;              /* share of the template inside the image, on masked pixels */
    double background;                  /* of its group, ADU */
    int group;                          /* number of its group, from 0 */
    int flags;                          /* RX_TPHOT_ */
    double evidence; /* that the source is there and no piece of a neighbour that the restored image split
                        off, 1 / (1 / rise + lumps^2): rise of chi2 without it, its neighbours' fluxes fitted
                        anew and, where a brighter one reaches over it, that one's position and profile, too;
                        lumps: what a resolved galaxy may differ from its smooth profile there, in fluxes of
                        the source */
    double lift;   /* flux is that many times the one of its template: the mean over what its shape may be */
    int crowded;   /* in a cell that is */
    double unseen; /* light of unseen neighbours that was taken off flux, ADU (unseen.h) */
    int movable; /* of shapes that are given: position and shape are fitted again from there; 0: they stay */
    int added;   /* of an extra one: which of those that `more` gave, counted through; -1 of others */
    rx_source_point point_fit; /* models.h */
    rx_source_sersic sersic_fit;
} rx_tphot_source;

/* Covariance of two fluxes of one group, ADU^2. */
typedef struct rx_tphot_pair {
    int i, j; /* i < j, entries of rx_tphot.list */
    double covariance;
} rx_tphot_pair;

typedef struct rx_tphot {
    int n;                 /* sources of the list, then extra ones */
    int nlisted;           /* those of the list */
    rx_tphot_source *list; /* [n] */
    double star_odds;      /* of points to others at the mean ln flux of clear sources; 1 when not known */
    int ngroups, largest;  /* groups, members of the largest */
    int npairs;
    rx_tphot_pair *pairs; /* group after group, by i, then j; NULL unless asked for */
    double sky;           /* ADU, mean of what was taken off the level (sky_cell) */
    double chi2;          /* of the visible pixels, their noise that of the sky and of the model's photons */
    double visible;       /* pixels */
    double least;         /* ADU: noise of a pixel was taken to be that at least */
    double crowded;       /* share of the image in crowded cells */
    double
        galaxies; /* share of these where what looks extended is taken for galaxies rather than pairs of stars */
    double unseen; /* errors by unseen neighbours over those of the noise, median of crowded points */
    int passes;    /* that were made */
    int modelled;  /* sources in `model`: without those that params.isolate leaves out */
    int width, height;
    float *model;    /* [height][width] M, ADU above the level; NULL unless asked for */
    float *residual; /* level-subtracted pixels - M, 0 where masked; NULL unless asked for */
} rx_tphot;

struct rx_fit_image;
struct rx_crowding;

/* The residual as it is looked at. */
typedef struct rx_tphot_search {
    struct rx_fit_image *image;      /* data - model (fit_image.h), which the callee shows where it looks */
    const struct rx_crowding *crowd; /* where it is crowded (crowd.h) */
    int again;                       /* looks before this one: from the second on only there */
    const double (*at)[2];           /* [n] x, y of the sources as they are fitted now */
    int n;
    const double (*seconds)
        [2]; /* [nseconds] x, y of the fainter ones of pairs that a fit has split: last in what is given */
    int nseconds;
} rx_tphot_search;

/* Sources that only show in the residual: called after the first fit and, where the tile is crowded, again until nothing is
 * found or params.passes are done. The callee gives *dst = positions [*n][2] (x, y), from malloc() or rx_alloc(), which the
 * caller frees; NULL and 0 for none. They are added as points and everything is fitted again. */
typedef rx_status (*rx_tphot_more)(void *user, const rx_tphot_search *look, double (**dst)[2], int *n,
                                   rx_error *err);

typedef struct rx_tphot_input {
    const rx_restored *restored; /* where shapes come from; its psf NULL: that of the tile */
    const uint8_t
        *shape_mask; /* [height][width]: more of its pixels that say nothing of a shape; NULL: none */
    int shape_bits;  /* that hide them there */
    const rx_sources *sources; /* detected on it, with segments */
    /* What is fitted, same grid, with its PSF; another tile than the restored one for forced photometry. A pixel whose
     * noise is not above 0 counts as hidden. */
    rx_image image;
    /* positions and profiles from an earlier run on the same list (its first nlisted entries), to be kept as
     * they are, unless they are movable: forced photometry; evidence is not weighed where any is. NULL: fitted here. */
    const rx_tphot *shapes;
    const double (*extra)[2]; /* [nextra] x, y of points that are not in the list */
    int nextra;
    rx_tphot_more more; /* NULL: no second pass */
    void *user;
} rx_tphot_input;

/* Whether its parts fit together. Errors: RX_INPUT. */
rx_status rx_tphot_check(const rx_tphot_input *input, rx_error *err);

RX_END_DECLS

#endif
