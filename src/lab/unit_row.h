/* The values of a unit as they are collected: floats, so that the journal's nine digits hold them. */
#ifndef RX_LAB_UNIT_ROW_H
#define RX_LAB_UNIT_ROW_H

#include "lab/journal.h"

typedef struct rx_unit_row {
    rx_unit_values *values; /* the caller's; grows */
    long capacity;
    int failed; /* memory ran out: check once at the end, with rx_unit_row_status() */
} rx_unit_row;

void rx_unit_row_add(rx_unit_row *row, double value);

/* RX_OK, or RX_SYSTEM after a failure. */
rx_status rx_unit_row_status(const rx_unit_row *row, rx_error *err);

#endif
