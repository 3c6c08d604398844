/* Which detections are right and which are false. */
#include "lab/photometry_match.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "quality/match.h"

rx_status rx_known_new(long n, rx_known *dst, rx_error *err)
{
    const size_t size = (size_t)n;
    *dst = (rx_known){.n = n,
                      .x = RX_NEW(double, size),
                      .y = RX_NEW(double, size),
                      .flux = RX_NEW(double, size),
                      .radius = RX_NEW(double, size)};
    if (dst->x != NULL && dst->y != NULL && dst->flux != NULL && dst->radius != NULL)
        return RX_OK;
    rx_known_free(dst);
    return rx_error_memory(err, 4 * size * sizeof(double));
}

void rx_known_free(rx_known *known)
{
    free(known->x);
    free(known->y);
    free(known->flux);
    free(known->radius);
    free(known->covered);
    *known = (rx_known){0};
}

static int belongs(const rx_known *known, double x, double y)
{
    const double px = floor(x + 0.5), py = floor(y + 0.5);
    if (known->covered != NULL && px >= 0 && py >= 0 && px < known->width && py < known->height &&
        known->covered[(size_t)py * (size_t)known->width + (size_t)px])
        return 1;
    for (long i = 0; i < known->n; i++)
        if (hypot(x - known->x[i], y - known->y[i]) <= known->radius[i])
            return 1;
    return 0;
}

rx_status rx_photometry_match(const rx_photometry_stars *stars, const rx_known *known, long n,
                              const double *x, const double *y, double radius, long *found,
                              unsigned char *is_false, rx_error *err)
{
    const size_t all = (size_t)stars->n + (size_t)known->n;
    long used = stars->n;
    rx_status status = RX_OK;
    double *px = RX_NEW(double, all), *py = RX_NEW(double, all);
    long *partner = RX_NEW(long, all), *taken = RX_NEW(long, (size_t)n);
    if (px == NULL || py == NULL || partner == NULL || taken == NULL) {
        status = rx_error_memory(err, 4 * all * sizeof(double));
        goto exit;
    }
    for (long i = 0; i < stars->n; i++) {
        px[i] = stars->x[i];
        py[i] = stars->y[i];
    }
    for (long i = 0; i < known->n; i++) {
        if (known->flux[i] < stars->flux)
            continue;
        px[used] = known->x[i];
        py[used++] = known->y[i];
    }
    status = rx_match(&(rx_match_list){used, px, py, NULL}, &(rx_match_list){n, x, y, NULL}, radius, partner,
                      taken, err);
    for (long i = 0; status == RX_OK && i < stars->n; i++)
        found[i] = partner[i];
    for (long i = 0; status == RX_OK && i < n; i++)
        is_false[i] = taken[i] < 0 && !belongs(known, x[i], y[i]);
exit:
    free(px);
    free(py);
    free(partner);
    free(taken);
    return status;
}
