/* The photometry campaign: stars of one magnitude per set on tiles of a field, through the stage once per
 * restorer. The paper's last figure.
 *
 * SIMULATED: the sky of the SIM. keywords, another one on each tile; the restorers are given its true PSF,
 * unless STAGE.PSF_TYPE is set: then the stage finds it as on any tile. A field for each of the conditions of
 * SEEING, PSF_ERROR, SKY_ERROR and NOISE_ERROR. INJECTED: stars added to a real tile
 * with the tile's own PSF (of the STAGE. keywords, measured on the untouched tile by default), which the
 * restorers are given too, and with the photon noise of its gain. Its noise is the same on every tile, and
 * what is found on it before the injection, by any restorer, is known and neither right nor false: of that,
 * no one can distinguish faint sources from peaks of the noise. So every tile comes with a blank one, a realisation
 * of the tile's own noise without any source, whose detections are all false.
 *
 * Stars are listed, known objects at least as bright their rivals, and all known ones have a reach (match.h). */
#ifndef RX_LAB_PHOTOMETRY_H
#define RX_LAB_PHOTOMETRY_H

#include "lab/lists.h"

enum { RX_PHOTOMETRY_TILE, RX_PHOTOMETRY_STAR, RX_PHOTOMETRY_FALSE, RX_PHOTOMETRY_TABLES };

#define RX_PHOTOMETRY_TILE_COLUMNS(X)                                                                        \
    X(RX_FIELD_MPIXELS, "mpixels", "", "searched")                                                           \
    X(RX_FIELD_SNR, "snr", "", "of a star in a matched filter")

/* A star, per run. */
#define RX_PHOTOMETRY_STAR_COLUMNS(X)                                                                        \
    X(RX_STAR_SCORE, "score", "", "detection S/N that found it; NAN: not found")                             \
    X(RX_STAR_RATIO, "ratio", "", "F / F0; NAN: not found")                                                  \
    X(RX_STAR_PULL, "pull", "", "(F - F0) / error")                                                          \
    X(RX_STAR_CROWDED, "crowded", "", "1: FLAGS says that there is a neighbour or a blend")

enum { RX_PHOTOMETRY_TILE_COLUMNS(RX_LAB_ID) RX_PHOTOMETRY_TILE_WIDTH };
enum { RX_PHOTOMETRY_STAR_COLUMNS(RX_LAB_ID) RX_PHOTOMETRY_STAR_WIDTH };
/* Of detections that are no object, known or injected, and those on the blank tile. */
enum { RX_WRONG_MAG = RX_WRONG_WIDTH, RX_PHOTOMETRY_FALSE_WIDTH };

extern const rx_lab_schema rx_photometry_tables[RX_PHOTOMETRY_TABLES];

/* One tile with its stars, which come first among the objects; what else is known to be on it follows. */
rx_status rx_photometry_tile_make(const rx_lab *lab, const rx_lab_unit *unit, rx_lab_tile *dst,
                                  rx_error *err);
/* For one run and the stars of one magnitude, above a score s:
 *   recall(s)    = stars found with a score >= s / all stars
 *   precision(s) = stars found with a score >= s / (those + false detections with a score >= s)
 * where false detections are those on the set's own tiles. Precision therefore depends on how many stars a tile was
 * given, the same number for every restorer.
 *
 * Equal precision: for each run and field the lowest score at which precision over all magnitudes together is at least
 * P; completeness there is compared. A run whose whole list has precision above P is not helped by this: its list ends
 * early (whole_list). */
void rx_photometry_name_set(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96]);
rx_status rx_photometry_report(const rx_lab *lab, struct rx_lab_page *page, rx_error *err);
extern const char rx_photometry_reading[];

#endif
