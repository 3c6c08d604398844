/* Where objects may lie: border, map, clumps, distance to the ones that are there already. */
#ifndef RX_SIMULATE_PLACES_H
#define RX_SIMULATE_PLACES_H

#include "simulate/scene.h"

typedef struct rx_places {
    const rx_scene_params *par;
    double low_x, low_y, range_x, range_y; /* the area, pixels */
    long nclumps;
    /* taken positions by squares of least_distance: first of each square, then along next[] */
    int columns, rows;
    long *first; /* [rows][columns], -1 none */
    long *next;  /* [room] */
    const rx_object *objects;
} rx_places;

/* For at most `room` objects. Errors: RX_USAGE when the margin leaves no area; RX_SYSTEM memory. */
rx_status rx_places_set(const rx_scene_params *par, const rx_object *objects, long room, rx_places *dst,
                        rx_error *err);
void rx_places_clear(rx_places *places);

/* A place for object `number` of the population `set`; 0 when none was found in many trials. */
int rx_places_find(const rx_places *places, int set, long number, double *x, double *y);

/* A place for the companion of star `number`, which is objects[primary]. */
int rx_places_beside(const rx_places *places, long number, long primary, double *x, double *y);

/* objects[index] has its position now. */
void rx_places_take(rx_places *places, long index);

#endif
