/* Lists of detections: the objects of a scene under a condition with the score of the detection that found each of them,
 * and the false detections. The first column that runs have in turn of kind->objects is that score (NAN: not found),
 * the first ones of kind->wrong are those below. */
#ifndef RX_LAB_LISTS_H
#define RX_LAB_LISTS_H

#include "lab/lab.h"
#include "quality/pr.h"

#define RX_WRONG_COLUMNS(X)                                                                                  \
    X(RX_WRONG_RUN, RX_LAB_RUN, "", "number of the run")                                                     \
    X(RX_WRONG_SCORE, "score", "", "of the false detection")
enum { RX_WRONG_COLUMNS(RX_LAB_ID) RX_WRONG_WIDTH };
enum { RX_LIST_SCORE };

/* Scenes first to last of a condition, those that are lists: rx_scene_is_list(). */
typedef struct rx_list {
    const rx_lab *lab;
    int condition, first, last;
} rx_list;
rx_list rx_list_of(const rx_lab *lab, int condition, int scene);
rx_list rx_list_of_all(const rx_lab *lab, int condition);

/* Of the first scene. Objects with low <= own column `column` < high (below 0: all) found with that score or a higher one. */
long rx_list_found(const rx_list *list, int run, double score);
rx_estimate rx_list_share(const rx_list *list, int run, double score, int column, double low, double high);
/* False detections with that score; column as above, of the false ones. */
long rx_list_wrong(const rx_list *list, int run, double score, int column, double low, double high);
/* Objects that only the one of two runs has found with its score. */
void rx_list_compare(const rx_list *list, const int run[2], const double score[2], long only[2]);

/* Of all scenes; *objects of them. rx_pr_free(). */
rx_status rx_list_curve(const rx_list *list, int run, long *objects, rx_pr *dst, rx_error *err);
/* The point of the lowest score at which precision is at least the one named; NULL: nowhere. */
const rx_pr_point *rx_pr_cut(const rx_pr *pr, double precision);

#endif
