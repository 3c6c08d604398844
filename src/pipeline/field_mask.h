/* Which pixels of a tile are left out. */
#ifndef RX_PIPELINE_FIELD_MASK_H
#define RX_PIPELINE_FIELD_MASK_H

#include <stdbool.h>
#include <stdint.h>

#include "base/error.h"
#include "pipeline/field.h"

/* The caller's mask, and what the values themselves say: not a number, at saturation, a weight of no data. */
void rx_field_make_mask(const rx_image *image, uint8_t *dst);

/* What may be hidden of its pixels, the caller's or its own; NULL: nothing may. */
uint8_t *rx_field_mask(const rx_field *field);
bool rx_field_has_pixels(const rx_field *field); /* that RX_HIDE_PLAIN does not hide */

/* Before its sky is known: runs of one value; pixels at a level of saturation that they show where none is stated. */
rx_status rx_field_hide_no_data(const rx_pipeline_params *params, int role, rx_field *field, rx_log *log,
                                rx_error *err);
rx_status rx_field_find_saturation(rx_field *field, rx_log *log, rx_error *err);

/* On its sky: hollow cores, pixels far below it. */
rx_status rx_field_hide_hollow(rx_field *field, rx_log *log, rx_error *err);
void rx_field_hide_deep(rx_field *field, rx_log *log);

#endif
