/* The detection campaign: whole scenes through every restorer, and what its list of detections is worth;
 * close pairs, invented sources, and what restored pixels do to plateaus and to the outskirts of galaxies. Scenes:
 * tile.c, one after the other for each of the conditions of conditions.h.
 *
 * Runs: every restorer of RESTORE_TYPE; beside NONE also MATCHED, the unrestored image with a Gaussian of
 * the PSF's FWHM for a detection filter, at the threshold of the same S/N as that of NONE; RL once for each
 * number of TUNE_NITER and of TUNE_FILTER. */
#ifndef RX_LAB_DETECTION_H
#define RX_LAB_DETECTION_H

#include "lab/lists.h"

enum {
    RX_DETECTION_TILE,
    RX_DETECTION_OBJECT,
    RX_DETECTION_PLATEAU,
    RX_DETECTION_GROWTH,
    RX_DETECTION_FALSE,
    RX_DETECTION_TABLES
};

#define RX_DETECTION_TILE_COLUMNS(X) X(RX_TILE_MPIXELS, "mpixels", "", "searched")

/* An object, or a pair. STARS and GALAXIES list objects of TRUTH_SNR and more inside the tile; detections of fainter
 * ones do not count. */
#define RX_DETECTION_OBJECT_COLUMNS(X)                                                                       \
    X(RX_OBJECT_SNR, "snr", "", "in a matched filter on the bare sky; PAIRS: the lower of both")             \
    X(RX_OBJECT_APART, "apart", "FWHM", "PAIRS: separation")
/* The middle of a plateau: means of the phases in sigmas of the noise. */
#define RX_DETECTION_PHASES_COLUMNS(X)                                                                       \
    X(RX_PHASES_2, "phases2", "sigma", "rms of the means of the 2 x 2 phases about their mean")              \
    X(RX_PHASES_4, "phases4", "sigma", "the same of the 4 x 4 phases")                                       \
    X(RX_PHASES_RANGE, "range4", "sigma", "their range")

/* A galaxy of OUTSKIRTS: flux over the true one within 1, 2 and 4 r50, r50 = sqrt(r_e^2 + (FWHM / 2)^2). */
#define RX_DETECTION_GALAXY_COLUMNS(X) X(RX_GALAXY_SNR, "snr", "", "in a matched filter on the bare sky")
#define RX_DETECTION_GROWTH_COLUMNS(X)                                                                       \
    X(RX_GROWTH, "r1", "", "within r50")                                                                     \
    X(RX_GROWTH_2, "r2", "", "within 2 r50")                                                                 \
    X(RX_GROWTH_4, "r4", "", "within 4 r50")                                                                 \
    X(RX_GROWTH_TRUE, "true1", "", "of the scene without noise at the resolution of the result, within r50") \
    X(RX_GROWTH_TRUE_2, "true2", "", "within 2 r50")                                                         \
    X(RX_GROWTH_TRUE_4, "true4", "", "within 4 r50")

enum { RX_DETECTION_TILE_COLUMNS(RX_LAB_ID) RX_DETECTION_TILE_WIDTH };
enum { RX_DETECTION_OBJECT_COLUMNS(RX_LAB_ID) RX_DETECTION_OBJECT_WIDTH };
enum { RX_DETECTION_PHASES_COLUMNS(RX_LAB_ID) RX_DETECTION_PHASES_WIDTH };
enum { RX_DETECTION_GALAXY_COLUMNS(RX_LAB_ID) RX_DETECTION_GALAXY_WIDTH };
enum { RX_DETECTION_GROWTH_COLUMNS(RX_LAB_ID) RX_DETECTION_GROWTH_WIDTH };
enum { RX_WRONG_DISTANCE = RX_WRONG_WIDTH, RX_DETECTION_FALSE_WIDTH };
enum { RX_OUTSKIRT_RADII = RX_GROWTH_TRUE };

extern const rx_lab_schema rx_detection_tables[RX_DETECTION_TABLES];
int rx_detection_table(rx_scene_id id); /* in which a scene's objects are */

void rx_detection_name_set(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96]);
rx_status rx_detection_report(const rx_lab *lab, struct rx_lab_page *page, rx_error *err);
extern const char rx_detection_reading[];

#endif
