/* CLASS_STAR: the survey's STARNNW_NAME network (Bertin and Arnouts 1996, section 8). */
#ifndef RX_MEASURE_STARCLASS_H
#define RX_MEASURE_STARCLASS_H

#include "base/error.h"
#include "data/sources.h"

typedef struct rx_starclass rx_starclass;

/* Read a .nnw file: the word NNW, then numbers ('#' starts a comment line): number of layers, their
 * sizes, bias and scale of the inputs, per unit of each layer its weights and bias, bias and scale of
 * the outputs. 10 inputs and 1 output are wanted. Errors: RX_USAGE with file and what is wrong. */
rx_status rx_starclass_read(const char *path, rx_starclass **dst, rx_error *err);
void rx_starclass_free(rx_starclass *net);

/* Stellarity in 0..1 of a source with isophotal areas and peak; seeing in arcsec and arcsec per pixel,
 * analysis threshold of the image in ADU. */
double rx_starclass_evaluate(const rx_starclass *net, const rx_source *s, double seeing, double scale,
                             double threshold);

#endif
