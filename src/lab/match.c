/* Right, false, and neither. */
#include "lab/sources.h"

#include <math.h>
#include <stdlib.h>

#include "base/arena.h"
#include "base/memory.h"

void rx_matches_free(rx_matches *m)
{
    free(m->found);
    free(m->outcome);
    *m = (rx_matches){0};
}

/* Does what was there before explain a detection. */
static int explained(const rx_lab_objects *o, double x, double y)
{
    const double px = floor(x + 0.5), py = floor(y + 0.5);
    if (o->covered != NULL && px >= 0 && py >= 0 && px < o->width && py < o->height &&
        o->covered[(size_t)py * (size_t)o->width + (size_t)px])
        return 1;
    for (long i = 0; i < o->n; i++)
        if (o->list[i].reach > 0 && hypot(x - o->list[i].x, y - o->list[i].y) <= o->list[i].reach)
            return 1;
    return 0;
}

rx_status rx_lab_match(const rx_lab_objects *o, const rx_match_list *d, double radius, rx_matches *dst,
                       rx_error *err)
{
    const size_t n = (size_t)o->n, m = (size_t)d->n;
    rx_arena memory = {0};
    double *x = RX_TAKE(&memory, double, 2 * n), *y = x + n;
    unsigned char *use = RX_TAKE(&memory, unsigned char, n + m), *left = use + n;
    long *partner = RX_TAKE(&memory, long, n + 2 * m), *excuse = partner + n, *taken = excuse + m;
    rx_status status;
    *dst = (rx_matches){RX_NEW(long, n), RX_NEW(unsigned char, m)};
    if (!x || !use || !partner || !dst->found || !dst->outcome)
        RX_TRY_EXIT(rx_error_memory(err, (4 * n + 2 * m) * sizeof(double)));
    for (size_t i = 0; i < n; i++) {
        x[i] = o->list[i].x;
        y[i] = o->list[i].y;
        use[i] = o->list[i].role != RX_OTHER;
    }
    RX_TRY_EXIT(rx_match(&(rx_match_list){o->n, x, y, use}, d, radius, dst->found, taken, err));
    for (size_t k = 0; k < m; k++)
        left[k] = (d->use == NULL || d->use[k]) && taken[k] < 0;
    for (size_t i = 0; i < n; i++)
        use[i] = o->list[i].role == RX_OTHER && !(o->list[i].reach > 0);
    RX_TRY_EXIT(rx_match(&(rx_match_list){o->n, x, y, use}, &(rx_match_list){d->n, d->x, d->y, left}, radius,
                         partner, excuse, err));
    for (size_t k = 0; k < m; k++) {
        const long i = taken[k];
        if (left[k])
            dst->outcome[k] = excuse[k] >= 0 || explained(o, d->x[k], d->y[k]) ? RX_IS_NEITHER : RX_IS_FALSE;
        else
            dst->outcome[k] = i >= 0 && o->list[i].role == RX_LISTED ? RX_IS_RIGHT : RX_IS_NEITHER;
    }
    for (size_t i = 0; i < n; i++)
        if (o->list[i].role != RX_LISTED)
            dst->found[i] = -1;
exit:
    rx_arena_free(&memory);
    if (status != RX_OK)
        rx_matches_free(dst);
    return status;
}
