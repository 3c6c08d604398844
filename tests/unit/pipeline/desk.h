/* One tile through one restorer and its template fit, for the tests of template photometry in the stage. */
#ifndef RX_TESTS_DESK_H
#define RX_TESTS_DESK_H

#include "bench.h"
#include "pipeline/pipeline.h"
#include "scene.h"

/* One tile through one restorer, up to the list of sources. */
typedef struct desk {
    bench bench;
    rx_field *field;
    rx_result result;
    rx_template_fit fit; /* of the last run */
} desk;

/* A tile up to its list of sources, templates not yet fitted whatever the settings ask for. mask
 * [height][width] of RX_MASK_ bits, NULL: nothing masked; gain in e-/ADU. */
void desk_open(desk *d, const char *kind, const scene *s, const uint8_t *mask, double gain,
               const setting *settings);
void desk_close(desk *d);

/* The fit; `measure` NULL without dual-image mode. */
void desk_fit(desk *d, const rx_field *measure);

/* The source whose fit, or whose detection, lies within a pixel of there; NULL and -1 without. */
rx_source *desk_fitted(const rx_sources *sources, double x, double y);
int desk_detected(const rx_sources *sources, double x, double y);

/* Take a source out of the list. */
void desk_forget(rx_sources *sources, int which);

#endif
