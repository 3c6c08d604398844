/* One object's magnitude, size and shape from the distributions of scene.h. */
#ifndef RX_SIMULATE_POPULATION_H
#define RX_SIMULATE_POPULATION_H

#include "simulate/scene.h"

/* Independent sets of numbers of one (seed, stream). */
typedef enum rx_draw_set {
    RX_DRAW_STARS,
    RX_DRAW_GALAXIES,
    RX_DRAW_TEMPLATES,
    RX_DRAW_CLUMPS,
    RX_DRAW_PLACES /* + the set of the population: its positions */
} rx_draw_set;

/* Uniform in (0, 1), draw number `slot` < 64 of that object; two at once. */
double rx_draw(const rx_scene_params *par, int set, long number, int slot);
void rx_draw_two(const rx_scene_params *par, int set, long number, int slot, double dst[2]);

/* Half-light radius (arcsec) at that magnitude; deviate: standard normal. */
double rx_population_radius(double mag, double deviate);
#define RX_POPULATION_SCATTER 0.45 /* of its natural logarithm */

/* Everything of the object but its position. Templates: of `templates` (not empty); *shrunk counts those
 * that template_blur made smaller. */
void rx_population_star(const rx_scene_params *par, long number, rx_object *dst);
void rx_population_galaxy(const rx_scene_params *par, long number, rx_object *dst);
void rx_population_template(const rx_scene_params *par, const rx_templates *templates, long number,
                            rx_object *dst, long *shrunk);

#endif
