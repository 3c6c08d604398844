/* From source lists to the QA report. */
#ifndef RX_CHECK_QUALITY_H
#define RX_CHECK_QUALITY_H

#include "base/error.h"
#include "check/params.h"
#include "data/restored.h"
#include "data/sources.h"
#include "data/tile.h"
#include "quality/qa.h"

/* The detections of one restorer as the report wants them; free with rx_qa_list_free(). */
rx_status rx_quality_list(const rx_quality_params *par, const rx_tile *tile, const rx_sources *sources,
                          rx_qa_list *dst, rx_error *err);

/* arcsec per pixel at the middle of the tile; 0 when not known. */
double rx_quality_scale(const rx_tile *tile);

/* MATCH_RADIUS in pixels. Errors: RX_USAGE when it was given in arcsec and the scale is not known. */
rx_status rx_quality_radius(const rx_quality_params *par, const rx_tile *tile, double *pixels, rx_error *err);

/* The middle 256 x 256 pixels (the whole tile when smaller) as a picture of the page:
 * pixels must be freed. The same window for every restorer of a tile. */
rx_status rx_quality_picture(const char *title, int width, int height, const float *pixels, double sigma,
                             rx_qa_picture *dst, rx_error *err);

#endif
