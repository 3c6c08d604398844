/* What is in the sky: a list of objects with known positions, fluxes and shapes (Obj of the paper's eq. 1),
 * drawn from stated distributions. Every draw comes from (seed, stream, object number), so that a scene does
 * not depend on the number of threads, nor an object on how many others there are. */
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
    double radius;       /* half-light radius along the major axis; 0 for stars */
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
} rx_scene;

/* One population: how many, how bright. N(m) dm ~ 10^(slope m) between mag_low and mag_high. */
typedef struct rx_population {
    double count; /* objects on the whole tile; a fraction is decided by chance */
    double mag_low, mag_high, slope;
} rx_population;

typedef enum rx_galaxy_kind { RX_GALAXY_SMOOTH, RX_GALAXY_SPIRAL, RX_GALAXY_MIXED } rx_galaxy_kind;

typedef struct rx_scene_params {
    int width, height;
    double zeropoint;   /* magnitude of 1 ADU */
    double pixel_scale; /* arcsec */
    rx_population stars, galaxies, templates;
    rx_galaxy_kind galaxy_kind;
    double galaxy_scale;        /* multiplies the sizes of the population, [1] */
    double pair_share;          /* share of stars that get a companion of similar flux (crowding) */
    double pair_low, pair_high; /* separation of the pair, pixels */
    double clustering;          /* share of objects (0..1) gathered in clumps */
    double margin;         /* objects may lie so far beyond the border (negative: so far inside), pixels */
    double least_distance; /* between any two objects, pixels; 0 = none asked */
    /* where an object may lie: NULL = anywhere, else [height][width], 0 = forbidden */
    const unsigned char *allowed;
    uint64_t seed, stream; /* stream: number of the scene in a series */
} rx_scene_params;

/* *dst is freed by rx_scene_drop() (rx_scene_free() is the restorers' scene). Errors: RX_USAGE (impossible parameters), RX_SYSTEM memory. With
 * least_distance or `allowed`, what finds no place after many trials is left out: n may be smaller. */
rx_status rx_scene_make(const rx_scene_params *par, const rx_templates *templates, rx_scene **dst,
                        rx_error *err);
void rx_scene_drop(rx_scene *scene); /* NULL is fine; the templates stay */

/* Room for n objects, all zero. */
rx_status rx_scene_blank(int width, int height, long n, rx_scene **dst, rx_error *err);

#endif
