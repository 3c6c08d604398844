/* Fluxes on restored pixels against the untouched ones. */
#include "pipeline/fluxcheck.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/constants.h"
#include "base/memory.h"
#include "data/psf.h"
#include "num/stats.h"

enum { FEWEST = 5 };
static const double LEAST_SNR = 30.0;
static const double SIGMAS = 5.0; /* that a ratio lies from 1 before it is off, and at least */
static const double TOLERANCE = 0.01;
static const double MOST_BROUGHT = 0.1, REACH = 10.0; /* of other sources' light; radii of the aperture */
/* Sigmas of a pixel that the sky of an aperture is known to. A sky that is off, and what Richardson-Lucy gathers around a source,
 * is no scale: on simulated crowds apertures of 314 pixels gain 0.020 sigmas a pixel around stars of S/N 100, 0.011 at 42 and 0.004
 * at 17 (validation/flux_scale.py; results/flux_scale). */
static const double SKY = 0.02;
/* FLUX_AUTO of stars ends inside the dark ring that Richardson-Lucy leaves, and has 1.1 to 1.3 % too much */
static const double RING = 0.02;

/* In errors of no less than a fifth of the tolerance, so that what is beyond 5 of them is beyond that, too. */
static double errors_off(double excess, double error, double tolerance)
{
    const double errors = excess / fmax(error, tolerance / SIGMAS);
    return errors > SIGMAS ? errors : 0.0;
}

double rx_fluxcheck_excess(const rx_fluxcheck *check)
{
    return check->n > 0 ? fmax(errors_off(fabs(check->wide - 1.0), check->wide_error, TOLERANCE),
                               errors_off(check->automatic - 1.0, check->automatic_error, RING))
                        : 0.0;
}

int rx_fluxcheck_is_off(const rx_fluxcheck *check)
{
    return rx_fluxcheck_excess(check) > 0.0;
}

static int is_clean(const rx_source *s)
{
    return s->flags == 0 && s->flux_auto > LEAST_SNR * s->fluxerr_auto && s->fluxerr_auto > 0.0;
}

typedef struct light {
    double x, y, flux;
} light;

static int by_y(const void *a, const void *b)
{
    const double p = ((const light *)a)->y, q = ((const light *)b)->y;
    return (p > q) - (p < q);
}

/* Light that the others bring into an aperture of that radius about a source, wings that fall off with the cube of the
 * distance, over its flux. all: by y. */
static double brought(const light *all, int n, const rx_source *s, double radius)
{
    const double reach = REACH * radius;
    double sum = 0;
    int low = 0, high = n;
    while (low < high) {
        const int mid = low + (high - low) / 2;
        if (all[mid].y < s->y - reach)
            low = mid + 1;
        else
            high = mid;
    }
    for (; low < n && all[low].y <= s->y + reach; low++) {
        if (fabs(all[low].x - s->x) >= reach) /* most of them */
            continue;
        const double distance = hypot(all[low].x - s->x, all[low].y - s->y);
        if (distance > 0.0 && distance < reach && all[low].flux > 0.0)
            sum += all[low].flux * fmin(1.0, pow(radius / distance, 3));
    }
    return sum / s->flux_auto;
}

/* The clean sources that stand alone: the wings of others, which the untouched pixels have more of, are no flux of theirs.
 * Under the map of all: neighbours stay masked. The map is lent. */
static rx_status pick(const rx_sources *sources, double diameter, rx_sources *dst, rx_error *err)
{
    light *all = NULL;
    *dst = *sources;
    dst->vignets = NULL;
    dst->list = NULL;
    dst->n = 0;
    RX_TRY(RX_MAKE(all, (size_t)sources->n + 1, err));
    const rx_status status = RX_MAKE(dst->list, (size_t)sources->n, err);
    for (int i = 0; i < sources->n; i++)
        all[i] = (light){sources->list[i].x, sources->list[i].y, sources->list[i].flux_auto};
    qsort(all, (size_t)sources->n, sizeof *all, by_y);
    for (int i = 0; i < sources->n && status == RX_OK; i++) {
        const rx_source *s = &sources->list[i];
        if (is_clean(s) && brought(all, sources->n, s, 0.5 * diameter) < MOST_BROUGHT)
            dst->list[dst->n++] = *s;
    }
    free(all);
    return status;
}

/* Wide aperture flux of every picked source. */
static rx_status wide_fluxes(const rx_measure_params *wanted, const rx_image *image, double diameter,
                             rx_sources *picked, double *flux, rx_log *log, rx_error *err)
{
    rx_measure_params par = *wanted;
    par.naper = 1;
    par.aperture_diameter[0] = diameter;
    par.star_net = NULL;
    par.vignet_width = par.vignet_height = 0;
    par.skip = RX_SKIP_AUTO | RX_SKIP_PETRO | RX_SKIP_RADIUS | RX_SKIP_WIN;
    rx_status status = rx_measure_run(&par, image, NULL, log, picked, err);
    for (int i = 0; i < picked->n && status == RX_OK; i++)
        flux[i] = picked->list[i].flux_aper[0];
    return status;
}

/* Median of a/b where both are positive and its 1 sigma error (that of a normal sample). */
static int median_ratio(const double *a, const double *b, int n, double *work, double *median, double *error)
{
    size_t kept = 0;
    for (int i = 0; i < n; i++)
        if (a[i] > 0.0 && b[i] > 0.0)
            work[kept++] = a[i] / b[i];
    *median = *error = NAN;
    if (kept >= FEWEST)
        *error = RX_MEDIAN_ERROR * rx_sigma_mad(work, kept, median) / sqrt((double)kept);
    return (int)kept;
}

/* Share of a PSF's light within that diameter about its middle, at the middle of the image; 1 without pixels of a PSF. */
static rx_status share_within(const rx_psf *psf, const rx_image *image, double diameter, double *share,
                              rx_error *err)
{
    enum { FINE = 5 };
    float *stamp;
    double within = 0, all = 0;
    *share = 1;
    if (psf == NULL || psf->size <= 0)
        return RX_OK;
    const double middle = 0.5 * psf->size;
    RX_TRY(RX_MAKE(stamp, (size_t)psf->size * (size_t)psf->size, err));
    rx_psf_at(psf, 0.5 * (image->width - 1), 0.5 * (image->height - 1), stamp);
    for (int k = 0; k < psf->size * psf->size; k++) {
        int inside = 0;
        for (int j = 0; j < FINE * FINE; j++)
            inside += 2 * hypot(k % psf->size + (j % FINE + 0.5) / FINE - middle,
                                (double)(k / psf->size) + ((double)(j / FINE) + 0.5) / FINE - middle) <=
                      diameter;
        within += (double)stamp[k] * inside / (FINE * FINE);
        all += stamp[k];
    }
    free(stamp);
    *share = within > 0 && all > 0 ? within / all : 1;
    return RX_OK;
}

rx_status rx_fluxcheck_run(const rx_measure_params *par, const rx_image *restored, const rx_image *original,
                           const rx_sources *sources, rx_log *log, rx_fluxcheck *dst, rx_error *err)
{
    rx_sources picked = {0};
    double *work = NULL;
    *dst = (rx_fluxcheck){.diameter = fmax(10.0, 5.0 * original->psf->fwhm), .wide = NAN, .automatic = NAN};
    if ((par->skip & RX_SKIP_AUTO) != 0)
        return RX_OK;
    rx_status status = pick(sources, dst->diameter, &picked, err);
    if (status != RX_OK || picked.n < FEWEST)
        goto exit;
    size_t n = (size_t)picked.n;
    RX_TRY_EXIT(RX_MAKE(work, 4 * n, err));
    double *automatic = work + n, *on_restored = work + 2 * n, *on_original = work + 3 * n;
    for (size_t i = 0; i < n; i++)
        automatic[i] = picked.list[i].flux_auto;
    RX_TRY_EXIT(wide_fluxes(par, restored, dst->diameter, &picked, on_restored, log, err));
    RX_TRY_EXIT(wide_fluxes(par, original, dst->diameter, &picked, on_original, log, err));
    /* a restorer brings the wings in, which the aperture on the original pixels misses */
    double before, after;
    RX_TRY_EXIT(share_within(original->psf, original, dst->diameter, &before, err));
    RX_TRY_EXIT(share_within(restored->psf, restored, dst->diameter, &after, err));
    for (size_t i = 0; i < n; i++) {
        on_original[i] /= before;
        on_restored[i] /= after;
    }
    int used = median_ratio(on_restored, on_original, picked.n, work, &dst->wide, &dst->wide_error);
    median_ratio(automatic, on_original, picked.n, work, &dst->automatic, &dst->automatic_error);
    dst->n = used >= FEWEST ? used : 0;
    memcpy(work, on_original, n * sizeof *work);
    const double typical = rx_median(work, n);
    if (dst->n > 0 && typical > 0.0) {
        const double area = 0.25 * acos(-1.0) * dst->diameter * dst->diameter,
                     sky = SKY * original->global_noise * area / typical;
        dst->wide_error += sky / SIGMAS;
        dst->automatic_error += sky / SIGMAS;
    }
exit:
    free(work);
    free(picked.list);
    return status;
}
