/* What is in the sky: a list of objects with known positions, fluxes and shapes (Obj of the paper's eq. 1),
 * drawn from stated distributions. Every draw comes from (seed, stream, population, object number), so that a
 * scene does not depend on the number of threads, nor an object on how many others there are (with
 * least_distance the later ones make room for the earlier ones: stars, galaxies, templates, in this order).
 *
 * Positions: uniform over the tile and its margin. Of all objects the share `clustering` sits in clumps
 * instead, a Thomas (1949, Biometrika 36, 18) process: one clump per 65536 pixels of that area (at least
 * one), centres uniform, shared by the three populations; members scatter around them as a round Gaussian of
 * sigma 20 pixels. A star with a companion (extra: it does not count as one of `count`) has it at a
 * separation uniform in pair_low..pair_high, in a random direction, at most 0.5 mag brighter or fainter
 * (uniform).
 *
 * Sizes of galaxies, and of templates: half-light radius along the major axis
 *   log10(r_e / arcsec) = -0.11 (mag - 20), scatter 0.45 in ln r_e (normal, cut at 2.5 sigma)
 * for r magnitudes. A straight line weighted by the number of galaxies through medians in half magnitudes:
 * r 17-21.5 from the model radii of 221 galaxies of the Stripe 82 coadd (sdss/94-1-12,
 * stripe82_coadd_catalog.fit), r 22.5-26.5 from flux_radius / sqrt(0.57) of 100 COSMOS galaxies
 * (templates/cosmos, HSC_r): -0.006 - 0.1105 (r - 20), medians within 0.11 dex of it everywhere (rms
 * 0.06). Scatter about it: 0.48 (SDSS) and 0.34 (COSMOS, selected small) from the median absolute deviation.
 * tests/unit/simulate/test_scene.c holds both sets of galaxies against it.
 *
 * Shapes: Sersic index n and ratio b/a by the deciles of the 276 COSMOS galaxies of
 * templates/cosmos_sersics_sample_N300_cleaned.asc (b/a = (1 - |g|) / (1 + |g|)), linear in between; neither
 * goes with the size there (correlation of ln n and ln r_e: -0.1), so they are drawn by themselves.
 *   n >= 2.5 (20 %): a spheroid, one Sersic profile;
 *   n < 1 (33 %): when smooth one Sersic profile, else an exponential disk;
 *   between: exponential disk and bulge, n = 2.5, its half-light radius 0.2 of the disk's, rounder by half
 *   than the disk, of the share B = 0.31 (n - 1) / (1 + 0.34 (n - 1)): there r80 / r20 of both (as if of one
 *   ratio) is that of a Sersic profile of index n (to 0.03 in n).
 *
 * The share of spheroids does not depend on the magnitude, though brighter galaxies are more often early.
 * RX_GALAXY_SPIRAL: all have disks (n cut at 2.5) and arms; MIXED: 60 % of those with disks have arms. A
 * third of galaxies with arms have a bar (29 % of disks: Masters et al. 2011, MNRAS 411, 2026). Free choices,
 * for their looks: 2 arms (60 %), 3 (20 %) or 4, of pitch 10..35 degrees, either way around, contrast
 * 0.3..0.8; bars of 5..15 % of the flux, their half length 0.4..0.8 half-light radii of the disk. */
#ifndef RX_SIMULATE_SCENE_H
#define RX_SIMULATE_SCENE_H

#include <stdint.h>

#include "base/error.h"
#include "simulate/templates.h"

typedef enum rx_object_type { RX_OBJECT_STAR, RX_OBJECT_GALAXY, RX_OBJECT_TEMPLATE } rx_object_type;

/* Lengths in pixels of the tile, angles in radians counter-clockwise from x. */
typedef struct rx_object {
    rx_object_type type;
    double x, y; /* 0-based */
    double flux; /* ADU */
    double mag;
    /* half-light radius along the major axis; 0 for stars. A galaxy's: of the ellipse of the disk's ratio that
     * holds half of the light (as if without a bar); a template's: of a round aperture, over sqrt(ratio) */
    double radius;
    double ratio, angle; /* b/a of the disk (of a template: as turned), position of its major axis */
    /* galaxies: Sersic bulge + exponential disk, arms and bar as modulations of the disk */
    double bulge_share, bulge_n, bulge_radius; /* share of the flux, Sersic index, half-light radius */
    double bulge_ratio;
    double disk_radius;          /* half-light radius of the disk */
    int arms;                    /* spiral arms, 0 = none */
    double arm_contrast;         /* 0..1 */
    double arm_pitch, arm_phase; /* of a logarithmic spiral */
    double bar_share, bar_radius;
    /* templates */
    int template_index; /* in rx_templates */
    int flip;
    double stretch; /* tile pixels per template pixel */
} rx_object;

typedef struct rx_scene {
    int width, height;
    long n;
    rx_object *objects;
    const rx_templates *templates; /* not owned; NULL when no object needs them */
    long left_out;                 /* found no place */
    long shrunk;                   /* templates drawn smaller for template_blur */
} rx_scene;

/* One population: how many, how bright. N(m) dm ~ 10^(slope m) between mag_low and mag_high. */
typedef struct rx_population {
    double count; /* objects on the tile and its margin; a fraction is decided by chance */
    double mag_low, mag_high, slope;
} rx_population;

typedef enum rx_galaxy_kind { RX_GALAXY_SMOOTH, RX_GALAXY_SPIRAL, RX_GALAXY_MIXED } rx_galaxy_kind;

typedef struct rx_scene_params {
    int width, height;
    double zeropoint;   /* magnitude of 1 ADU */
    double pixel_scale; /* arcsec */
    rx_population stars, galaxies, templates;
    rx_galaxy_kind galaxy_kind;
    double galaxy_scale;  /* multiplies the sizes of the population, [1] */
    double template_blur; /* the own PSF of a template may have this FWHM on the tile, pixels; 0 = any */
    double pair_share;    /* share of stars that get a companion of similar flux (crowding) */
    double pair_low, pair_high; /* separation of the pair, pixels */
    double clustering;          /* share of objects (0..1) gathered in clumps */
    double margin;         /* objects may lie so far beyond the border (negative: so far inside), pixels */
    double least_distance; /* between any two objects, pixels; 0 = none asked */
    /* where an object may lie: NULL = anywhere, else [height][width], 0 = forbidden, as is all outside */
    const unsigned char *allowed;
    const rx_object
        *listed; /* [nlisted] these are the scene, whatever the populations say; NULL: drawn from them */
    long nlisted;
    uint64_t seed, stream; /* stream: number of the scene in a series */
} rx_scene_params;

/* *dst is freed by rx_scene_free(). Errors: RX_USAGE (too many objects, or too much light), RX_SYSTEM memory,
 * RX_INTERRUPTED. With least_distance or `allowed`, what finds no place after many trials is left out: n may
 * be smaller. */
rx_status rx_scene_make(const rx_scene_params *par, const rx_templates *templates, rx_scene **dst,
                        rx_error *err);
void rx_scene_free(rx_scene *scene); /* NULL is fine; the templates stay */

/* Half-light radius (arcsec) of galaxies of that magnitude; deviate: standard normal. */
double rx_population_radius(double mag, double deviate);
#define RX_POPULATION_SCATTER 0.45 /* of its natural logarithm */

/* Room for n objects, all zero. */
rx_status rx_scene_new(int width, int height, long n, rx_scene **dst, rx_error *err);

#endif
