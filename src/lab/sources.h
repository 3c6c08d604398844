/* Sources against the true ones: what the campaigns DETECTION and PHOTOMETRY have in common. A tile goes through every run;
 * rows are of the objects that are to be found, and of false detections (below).
 *
 * Above a score s (S/N of the detection) of one run and one scene
 *   recall(s)    = objects found with a score >= s / all objects
 *   precision(s) = objects found with a score >= s / (those + false detections with a score >= s)
 * where false detections are those on the set's own tiles: precision depends on how many objects a tile has, the same for
 * all. Equal precision: each run at the lowest score at which its precision is at least P; recall there is compared. */
#ifndef RX_LAB_SOURCES_H
#define RX_LAB_SOURCES_H

#include "lab/lab.h"
#include "quality/match.h"
#include "quality/pr.h"

enum { RX_SOURCES_TILE, RX_SOURCES_OBJECT, RX_SOURCES_FALSE, RX_SOURCES_TABLES };

#define RX_SOURCES_TILE_COLUMNS(X)                                                                           \
    X(RX_TILE_MPIXELS, "mpixels", "", "searched")                                                            \
    X(RX_TILE_SNR, "snr", "", "PHOTOMETRY: of one of its stars in a matched filter")

/* An object, or a pair; those of TRUTH_SNR and more inside the tile. */
#define RX_SOURCES_OBJECT_COLUMNS(X)                                                                         \
    X(RX_OBJECT_SNR, "true_snr", "", "in a matched filter on the bare sky; PAIRS: the lower of both")        \
    X(RX_OBJECT_APART, "apart", "FWHM", "PAIRS: separation")

/* And what a run has found of it. A pair is resolved when two detections lie within half the separation (and the match
 * radius) of its two stars; its score is the lower of both. */
#define RX_SOURCES_FOUND_COLUMNS(X)                                                                          \
    X(RX_FOUND_SCORE, "score", "", "detection S/N that found it; NAN: not found")                            \
    X(RX_FOUND_RATIO, "ratio", "", "F / F0; NAN: not found")                                                 \
    X(RX_FOUND_PULL, "pull", "", "(F - F0) / error")                                                         \
    X(RX_FOUND_CROWDED, "crowded", "", "1: FLAGS says that there is a neighbour or a blend")

/* A detection that is no object, known or to be found, and one on a blank tile. */
#define RX_SOURCES_FALSE_COLUMNS(X)                                                                          \
    X(RX_FALSE_RUN, RX_LAB_RUN, "", "number of the run")                                                     \
    X(RX_FALSE_SCORE, "score", "", "of the false detection")

enum { RX_SOURCES_TILE_COLUMNS(RX_LAB_ID) RX_SOURCES_TILE_WIDTH };
enum { RX_SOURCES_OBJECT_COLUMNS(RX_LAB_ID) RX_SOURCES_OBJECT_WIDTH };
enum { RX_SOURCES_FOUND_COLUMNS(RX_LAB_ID) RX_SOURCES_FOUND_WIDTH };
enum { RX_SOURCES_FALSE_COLUMNS(RX_LAB_ID) RX_SOURCES_FALSE_WIDTH };

extern const rx_lab_schema rx_sources_tables[RX_SOURCES_TABLES];

/* --- matching --- */

/* Which detections of a tile are right, which are false, and which are neither.
 *
 * Objects have roles. LISTED ones are to be found. RIVALS are other ones that are at least as bright: they compete with
 * the listed ones, one to one, nearest first, so that an object on top of a brighter one is found only when it is
 * resolved from it. OTHERS take what is then left: one to one, too, or, where objects have a reach, whatever lies
 * within that (of rivals as well) or where `covered` says so. What is left after that is false. */
typedef enum rx_match_outcome { RX_IS_NEITHER, RX_IS_RIGHT, RX_IS_FALSE } rx_match_outcome;

typedef struct rx_matches {
    long *found;            /* [objects] the detection of a listed one, else -1 */
    unsigned char *outcome; /* [detections] rx_match_outcome; those that are not in use are neither */
} rx_matches;

rx_status rx_lab_match(const rx_lab_objects *objects, const rx_match_list *detections, double radius,
                       rx_matches *dst, rx_error *err);
void rx_matches_free(rx_matches *matches); /* content only */

/* --- campaigns --- */

/* How far from an object a detection of it may lie: MATCH_RADIUS, and half a FWHM of its sky at least. */
rx_status rx_sources_radius(const rx_lab *lab, const rx_lab_sky *sky, const rx_tile *tile, double *pixels,
                            rx_error *err);

/* unit(), name_set(), report() and reading of both campaigns. */
rx_status rx_sources_unit(const rx_lab *lab, const rx_lab_unit *unit, const rx_unit_values *done,
                          rx_lab_table *dst, rx_error *err);
void rx_sources_name_set(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96]);
rx_status rx_sources_report(struct rx_lab_page *page, rx_error *err);
extern const char rx_sources_reading[];

void rx_lab_tile_free(rx_lab_tile *tile); /* content only */

/* The scene, which is freed, as an exposed tile. */
rx_status rx_lab_expose(const rx_lab_sky *sky, uint64_t seed, uint64_t stream, rx_scene *scene,
                        rx_tile **tile, rx_error *err);

#endif
