/* Which sources must be fitted together: templates that overlap, tied into groups. */
#ifndef RX_TEMPLATE_BLENDS_H
#define RX_TEMPLATE_BLENDS_H

#include "base/error.h"
#include "template/fit_image.h"

/* Two templates that overlap: strength = <a, b> / sqrt(<a, a> <b, b>). */
typedef struct rx_blend_link {
    int i, j; /* i < j */
    double strength;
} rx_blend_link;

typedef struct rx_blends {
    int n, ngroups, largest, ndivided;
    int *group;   /* [n] number of its group, from 0 by the first member */
    int *start;   /* [ngroups + 1] into member */
    int *member;  /* [n] by group, ascending */
    int *cut;     /* [n] 1: a link to another group was cut */
    int *divided; /* [ngroups] 1: of a member of the group */
} rx_blends;

/* Groups of the n footprints on an image of width x height pixels over links of more than par->link, strongest
 * first; a link that would make a group of more than par->group_limit members is cut (so the weakest are). Of
 * the params nthreads counts, too. Free the contents with rx_blends_clear(). Errors: RX_SYSTEM. */
rx_status rx_blends_find(const rx_tphot_params *par, const rx_footprint *const *footprints, int n, int width,
                         int height, rx_blends *blends, rx_error *err);
void rx_blends_clear(rx_blends *blends);

#endif
