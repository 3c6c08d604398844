/* The campaign of fluxes: what template photometry is worth beside AUTO and apertures, on every restorer's
 * sources, and what its verdict on invented sources costs. Scenes: tile.c, one after the other for each of the
 * conditions of conditions.h; INJECTED stands alone. Objects of TRUTH_SNR and more are to be found (match.h); a
 * detection that no object explains is invented.
 *
 * An object is
 *   isolated  when no other object of more than 1 % of its flux is nearer than
 *               (3 + log10(f)) FWHM + 2 (r + r')
 *             f: flux of the other over its own, at least 1; r, r': half-light radii. INJECTED: nor a source
 *             of the untouched tile, of FLUX_AUTO and r = 0
 *   blended   when one of within 2 mag (brighter or fainter) is nearer than 1.5 FWHM
 * and neither or, where objects are extended, both: then it counts as blended. */
#ifndef RX_LAB_FLUXES_H
#define RX_LAB_FLUXES_H

#include "lab/lab.h"

/* AUTO; the first of STAGE.PHOT_APERTURES; an aperture of 2 FWHM radius; template photometry. */
typedef enum rx_flux_kind {
    RX_FLUX_AUTO,
    RX_FLUX_APER,
    RX_FLUX_WIDE,
    RX_FLUX_TEMPLATE,
    RX_FLUX_KINDS
} rx_flux_kind;

const char *rx_flux_name(rx_flux_kind kind);

enum { RX_FLUXES_RUNS = 8 };
enum { RX_FLUXES_TILE, RX_FLUXES_OBJECT, RX_FLUXES_TABLES };

#define RX_FLUXES_TILE_COLUMNS(X) X(RX_FLUXES_MPIXELS, "mpixels", "", "searched")

/* Per restorer: */
#define RX_FLUXES_TALLY_COLUMNS(X)                                                                           \
    X(RX_TALLY_RIGHT, "right", "", "detections of objects of TRUTH_SNR and more")                            \
    X(RX_TALLY_RIGHT_KEPT, "right_unmarked", "", "those without the mark")                                   \
    X(RX_TALLY_FALSE, "wrong", "", "invented")                                                               \
    X(RX_TALLY_FALSE_KEPT, "wrong_unmarked", "", "those without the mark")                                   \
    X(RX_TALLY_WEAK, "weak", "", "S/N 5 to 7, found")                                                        \
    X(RX_TALLY_WEAK_KEPT, "weak_unmarked", "", "those without the mark")                                     \
    X(RX_TALLY_STRONG, "strong", "", "S/N above 7, found")                                                   \
    X(RX_TALLY_STRONG_KEPT, "strong_unmarked", "", "those without the mark")                                 \
    X(RX_TALLY_ADDED, "added", "", "right ones that only the residual showed")

/* An object that is listed. */
#define RX_FLUXES_OBJECT_COLUMNS(X)                                                                          \
    X(RX_PROP_SNR, "snr", "", "true, in a matched filter on the bare sky")                                   \
    X(RX_PROP_GALAXY, "galaxy", "", "1: a galaxy, 0: a star")                                                \
    X(RX_PROP_BLEND_STATE, "company", "", "0 isolated, 1 blended, 2 neither")                                \
    X(RX_PROP_BOUND, "bound", "", "error of a star's flux in a matched filter over the flux")                \
    X(RX_PROP_PARTNER, "partner", "rows", "how many rows further on the partner is, 0: none that is listed") \
    X(RX_PROP_APART, "apart", "FWHM", "distance from the partner, else 0")                                   \
    X(RX_PROP_MAGS, "mags", "mag", "how much fainter than the partner, else 0")

/* And per restorer: ratio and error of each rx_flux_kind. */
#define RX_FLUXES_FOUND_COLUMNS(X)                                                                           \
    X(RX_FOUND, "found", "",                                                                                 \
      "NAN not found, 0 found, 1 and marked as spurious; 2 more: only the residual showed it")               \
    X(RX_RATIO, "ratio_auto", "", "flux over the true one, NAN without")                                     \
    X(RX_RATIO_APER, "ratio_aper", "", "the same")                                                           \
    X(RX_RATIO_WIDE, "ratio_wide", "", "the same")                                                           \
    X(RX_RATIO_TEMPLATE, "ratio_template", "", "the same")                                                   \
    X(RX_ERROR, "error_auto", "", "error it gives itself, over the true flux")                               \
    X(RX_ERROR_APER, "error_aper", "", "the same")                                                           \
    X(RX_ERROR_WIDE, "error_wide", "", "the same")                                                           \
    X(RX_ERROR_TEMPLATE, "error_template", "", "the same")                                                   \
    X(RX_BOTH, "both", "", "1: it and its partner are found, each nearer than half the separation")          \
    X(RX_PIECES, "pieces", "", "SHREDS: detections on the galaxy")                                           \
    X(RX_PIECES_KEPT, "pieces_unmarked", "", "those without the mark")

enum { RX_FLUXES_TILE_COLUMNS(RX_LAB_ID) RX_FLUXES_TILE_WIDTH };
enum { RX_FLUXES_TALLY_COLUMNS(RX_LAB_ID) RX_FLUXES_TALLIES };
enum { RX_FLUXES_OBJECT_COLUMNS(RX_LAB_ID) RX_FLUXES_PROPS };
enum { RX_FLUXES_FOUND_COLUMNS(RX_LAB_ID) RX_FLUXES_COLUMNS };

extern const rx_lab_schema rx_fluxes_tables[RX_FLUXES_TABLES];

/* For rx_lab_kind. */
rx_status rx_fluxes_open(rx_lab *lab, rx_log *log, rx_error *err);
rx_status rx_fluxes_prepare(rx_lab *lab, rx_log *log, rx_error *err);
rx_status rx_fluxes_unit(const rx_lab *lab, const rx_lab_unit *unit, const rx_unit_values *done,
                         rx_lab_table *dst, rx_error *err);
rx_status rx_fluxes_describe(rx_lab *lab, const rx_unit_values *all, rx_error *err);

#endif
