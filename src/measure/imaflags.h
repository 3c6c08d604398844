/* IMAFLAGS_ISO: the user's flag maps under a source. */
#ifndef RX_MEASURE_IMAFLAGS_H
#define RX_MEASURE_IMAFLAGS_H

#include "measure/view.h"

/* types: as rx_measure_params.flag_types. Fills imaflags and nimaflags. Only non-zero values count, except for AND;
 * nimaflags is the number of pixels that had a say (OR, AND) or that hold the value given (MIN, MAX, MOST; the
 * smallest of equally frequent ones). SExtractor's AND is always 0 (it starts from 0); this one is what its name
 * says. */
rx_status rx_measure_imaflags(const rx_view *view, const int *types, rx_source *s, rx_error *err);

#endif
