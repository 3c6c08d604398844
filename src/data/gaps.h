/* Hidden pixels that lie between good ones: dead rows and columns, trails, cosmic rays, the middle of a star.
 *
 * A gap is a run of hidden pixels of a row, a column or a diagonal with good ones at both ends; a pixel takes the
 * shortest of its runs. A star in the middle of a masked row or column that is w FWHM wide keeps 1 - erf(sqrt(2
 * ln 2) w) of the squared S/N of a matched filter (Gaussian PSF), one in a square hole 1 - erf()^2: 0.10 in a row of w
 * = 1, 0.025 in a hole of w = 1.5. These are the widest gaps; beyond them next to nothing is known, and wide masks, of
 * bright stars or borders, stay empty.
 * Masked pixels that are saturated hold light for sure, but not known how much: for detection they are gaps however
 * wide they are, for restorers none. So are those of a wider hole from which the light falls to all four sides: the
 * core of a star that a pipeline has masked. A hole in a nebula, or beside the middle of a galaxy, has a side to which
 * it rises or stays. Of a masked bleed only the sides across it are lit and the others are sky; such a hole is at most
 * 3.4 FWHM across, which is as far as a star of S/N 10^4 (Gaussian) is seen at 4 sigma: light on both sides of a
 * wider one is that of two.
 */
#ifndef RX_DATA_GAPS_H
#define RX_DATA_GAPS_H

#include "base/error.h"
#include "data/map.h"

struct rx_image;

#define RX_UNKNOWN_FWHM 5.0 /* pixels, of a PSF that is not known: the middle of common seeing */

typedef struct rx_gap {
    int at;                /* the pixel */
    uint8_t axis;          /* along which it is filled */
    uint8_t before, after; /* steps to the good pixels */
    uint8_t mask;          /* RX_MASK_ bits */
} rx_gap;

typedef struct rx_gaps {
    int width;
    double fwhm;
    size_t n;
    rx_gap *list; /* by their places */
} rx_gaps;

/* Those of mask[height][width], 0 being good, for a PSF of that FWHM, pixels; 0: not known. cut: pixels of RX_MASK_CUT are in gaps of any width, 0: in none. NULL: there are none. Free with
 * rx_gaps_free(). Errors: RX_SYSTEM. */
rx_status rx_gaps_find(const uint8_t *mask, int width, int height, double fwhm, int cut, rx_gaps **dst,
                       rx_error *err);
void rx_gaps_free(rx_gaps *gaps);

/* RX_MASK_CORE at hidden pixels from which the light of the image, on its sky, falls over a FWHM by 3 sigma of the
 * difference; not in gaps. mask: that of the image. How many. */
size_t rx_gaps_mark_cores(const struct rx_image *image, double fwhm, uint8_t *mask);

/* The plane[height][width] at its gaps: on the straight line between the good pixels, so that a source across a gap
 * is not cut, and none grows by it. gaps may be NULL. */
void rx_gaps_fill(const rx_gaps *gaps, float *plane);

/* How many times the noise of a whole neighbourhood that of an estimate of the light in the gap is: that of a star in
 * the middle of a row as wide. */
double rx_gap_noise(const rx_gaps *gaps, const rx_gap *gap);

/* The mask at the gaps: those bits, 0 to open them, or what it was. gaps may be NULL. */
void rx_gaps_mark(const rx_gaps *gaps, uint8_t bits, uint8_t *mask);
void rx_gaps_close(const rx_gaps *gaps, uint8_t *mask);

/* A noise map that has none at hidden pixels, filled; `room` keeps it, `of` and the gaps must live as long. */
typedef struct rx_gaps_map {
    rx_map_maker maker;
    rx_map of;
    const rx_gaps *gaps;
} rx_gaps_map;
rx_map rx_gaps_filled(rx_gaps_map *room, rx_map of, const rx_gaps *gaps);

#endif
