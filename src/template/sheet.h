/* A sky on a coarse mesh, taken off pixels. */
#ifndef RX_TEMPLATE_SHEET_H
#define RX_TEMPLATE_SHEET_H

#include "base/error.h"

/* An image of width x height pixels in nx x ny cells: bilinear between their centres, constant beyond the
 * outermost. */
typedef struct rx_sheet {
    int width, height, nx, ny;
    double *value; /* [ny][nx] ADU */
    int *first;    /* [width] the cell whose centre is left of a pixel */
    double *off;   /* [width] how far from there, in cells */
} rx_sheet;

/* Cells about `cell` pixels wide and high, at least one; value 0. Free the contents with rx_sheet_clear().
 * Errors: RX_SYSTEM. */
rx_status rx_sheet_open(int width, int height, int cell, rx_sheet *sheet, rx_error *err);
void rx_sheet_clear(rx_sheet *sheet);

/* data -= sheet in the n pixels from (x, y) on, where weight (NULL: anything) is above 0. */
void rx_sheet_take_off(const rx_sheet *sheet, int y, int x, int n, const float *weight, float *data);

/* values *= sheet in the n pixels from (x, y) on. */
void rx_sheet_scale(const rx_sheet *sheet, int y, int x, int n, float *values);

#endif
