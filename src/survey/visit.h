/* A visit of a field: its catalogue, and what of the sky its image sees. */
#ifndef RX_SURVEY_VISIT_H
#define RX_SURVEY_VISIT_H

#include "base/error.h"
#include "config/config_fields.h"
#include "io/wcs.h"

/* The columns that all visits are read by, those of the first one that it has; "" none. */
typedef struct rx_visit_columns {
    char alpha[72], delta[72], mag[72], error[72], star[72], flags[72];
} rx_visit_columns;

/* One image. Without its world coordinates what it sees is the convex hull of its sources. */
typedef struct rx_visit_frame {
    rx_wcs *wcs; /* NULL: none */
    int width, height;
    long first, last; /* its sources: from first on, before last */
    float *weight;    /* [height][width], NULL: none */
    int n;
    double *x, *y; /* [n] corners of the hull, counter-clockwise, arcsec */
} rx_visit_frame;

typedef struct rx_visit {
    const char *name; /* lent */
    long n;
    double *alpha, *delta; /* J2000, deg */
    double *x, *y;         /* on the tangent plane, arcsec */
    double *mag, *error;   /* NAN where unknown */
    double *star;          /* NAN where there is no such column */
    long *flags;           /* 0 where there is no such column */
    int nframes;
    rx_visit_frame *frame;
} rx_visit;

/* names of columns from the catalogue of the first visit. Errors: RX_USAGE, RX_INPUT. */
rx_status rx_visit_columns_find(const rx_survey_config *config, const char *path, rx_visit_columns *dst,
                                rx_error *err);

/* All tables of the catalogue; `weight` NULL: none. Free in any case. Errors: RX_INPUT, RX_SYSTEM. */
rx_status rx_visit_read(const char *path, const char *weight, const rx_visit_columns *columns, rx_visit *dst,
                        rx_error *err);
void rx_visit_free(rx_visit *visit); /* content only */

/* Tangent plane (gnomonic) about the mean position of `first`: x, y of the visit, and hulls of frames that have no world
 * coordinates. What lies 90 degrees away or more is NAN. Errors: RX_SYSTEM. */
rx_status rx_visit_project(const rx_visit *first, rx_visit *visit, rx_error *err);

/* dst[of->n]: whether the visit sees each source of another one: inside an image of it by `margin` (arcsec) or more, and
 * where there is a weight map at a pixel with weight. Errors: RX_SYSTEM. */
rx_status rx_visit_sees(const rx_visit *visit, const rx_visit *of, double margin, unsigned char *dst,
                        rx_error *err);

#endif
