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

#include "lab/store.h"

/* AUTO; the first of STAGE.PHOT_APERTURES; an aperture of 2 FWHM radius; template photometry. */
typedef enum rx_flux_kind {
    RX_FLUX_AUTO,
    RX_FLUX_APER,
    RX_FLUX_WIDE,
    RX_FLUX_TEMPLATE,
    RX_FLUX_KINDS
} rx_flux_kind;

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

/* --- numbers --- */

/* What a number is of; kind: 0 stars, 1 galaxies. Indices that a grid does not have are passed over. */
enum {
    RX_OF_SAMPLE,
    RX_OF_SCENE,
    RX_OF_CROWD,
    RX_OF_KIND,
    RX_OF_CONDITION,
    RX_OF_SNR,
    RX_OF_SEPARATION,
    RX_OF_RUN
};
enum { RX_OF_FLUX = RX_OF_RUN + 1, RX_OF_ALL };
typedef union rx_fluxes_place {
    struct {
        int sample, scene, crowd, kind, condition, snr, separation, run, flux;
    };
    int at[RX_OF_ALL];
} rx_fluxes_place;

/* All fluxes of a restorer are of the same objects. DETECTED: found (APART: resolved) by this restorer, without sources
 * that only the residual of the templates showed, of which AUTO and apertures know nothing. ALL: with them. COMMON:
 * DETECTED by every restorer. */
enum { RX_SAMPLE_DETECTED, RX_SAMPLE_ALL, RX_SAMPLE_COMMON, RX_SAMPLES };

/* Company as numbers know it; APART: blended, and resolved: it and the partner were found, each nearer than half the
 * separation. */
enum { RX_CROWD_ISOLATED, RX_CROWD_BLENDED, RX_CROWD_APART, RX_CROWD_NEITHER, RX_CROWDS };

/* Bins of true S/N; those from RX_SNR_SINGLE on hold several others. */
enum { RX_SNR_SINGLE = 6, RX_SNR_5_100 = 6, RX_SNR_ABOVE_10 = 7, RX_SNR_BINS = 8 };

/* Of the objects of a sample, scene, crowd, kind, condition and bin of S/N one flux of one restorer, r = F / F0:
 *
 *   bias     -2.5 log10(median r), mag
 *   scatter  2.5 / ln 10 sigma_MAD(r), mag
 *   bound    isolated stars: sigma_MAD((r - 1) / b), b the error of a matched filter over F0
 *   pull     median of (F - F0) / error, the one that the flux gives itself
 *   width    sigma_MAD of the pulls
 *   magerr   mean of 100 |F - F0| / F0
 *
 * sigma_MAD = 1.4826 median |v - median|. Intervals are at 95 % for normal samples, 1.96 times
 *
 *   median     1.2533 sigma / sqrt(n)
 *   sigma_MAD  1.1664 sigma / sqrt(n)
 *   mean       s / sqrt(n)
 *
 * (Rousseeuw and Croux 1993, J. Am. Stat. Assoc. 88, 1273: efficiencies of 64 and 37 %). Objects of one tile
 * share its background, which they do not know. */
enum {
    RX_CELL_BIAS,
    RX_CELL_SCATTER,
    RX_CELL_BOUND,
    RX_CELL_PULL,
    RX_CELL_WIDTH,
    RX_CELL_MAGERR,
    RX_CELL_NUMBERS
};

/* Pairs by separation, of the samples DETECTED and ALL: the share of which both are found (each nearer than half the
 * separation), and of those differences of magnitudes, second member less first, measured less true: median of the
 * absolute value, median, sigma_MAD; and the median error of the magnitude of both together. A flux below a thousandth
 * of the true one counts as that. */
enum { RX_PAIR_BOTH, RX_PAIR_SIZE, RX_PAIR_RATIO, RX_PAIR_SCATTER, RX_PAIR_TOTAL, RX_PAIR_NUMBERS };

/* Invented sources of a scene, condition and run, as detected and without those marked as spurious (KEPT); counts are
 * values. MARKED: share of the true ones marked, S/N 5 to 7 and above. PIECES, of SHREDS: mean per galaxy that was found,
 * itself among them. */
enum {
    RX_INVENTED_RIGHT,
    RX_INVENTED_WRONG,
    RX_INVENTED_RIGHT_KEPT,
    RX_INVENTED_WRONG_KEPT,
    RX_INVENTED_ADDED,
    RX_INVENTED_PER_MPIXEL,
    RX_INVENTED_PER_MPIXEL_KEPT,
    RX_INVENTED_PRECISION,
    RX_INVENTED_PRECISION_KEPT,
    RX_INVENTED_MARKED_WEAK,
    RX_INVENTED_MARKED_STRONG,
    RX_INVENTED_PIECES,
    RX_INVENTED_PIECES_KEPT,
    RX_INVENTED_NUMBERS
};

enum { RX_FLUXES_CELLS, RX_FLUXES_PAIRS, RX_FLUXES_INVENTED, RX_FLUXES_GRIDS };
extern const rx_lab_results rx_fluxes_results;
rx_estimate *rx_fluxes_at(const rx_store *store, int grid, rx_fluxes_place place);

#endif
