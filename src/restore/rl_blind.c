/* Blind Richardson-Lucy: the PSF by alternating updates, then the image with it. */
#include "restore/rl_blind.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "num/convolve.h"
#include "num/stats.h"
#include "restore/richardson_lucy.h"
#include "restore/stamp.h"

static const double RANGE = 3;          /* the FWHM may differ from that of the start by this factor */
static const double NARROWEST = 1;      /* pixels */
static const float SHARE_FLOOR = 1e-6f; /* of the largest: fewer data behind a PSF pixel, and it stays */

enum { FEWEST_POINTS = 3 };
enum { CYCLES = 5, NITER = 10 }; /* of PSF and image updates; iterations of each update */

/* --- point-like sources of the present image: what separates image and PSF ---
 *
 * A peak is the highest f within 2 pixels, stands 10 sigma above the sky in the data, has no masked
 * pixel within the radius R = max(2, FWHM) and none of a tenth of its height as neighbour within 2 R. Its
 * flux, centroid and mean square radius are those of f - 1 in the disk of radius R. Point-like are the peaks
 * no larger than 1.3 times the 20 % quantile of radius^2 (galaxies are larger, and a tile in which four
 * fifths of the isolated bright sources are resolved still gives its stars). */

typedef struct point_like {
    int x, y;      /* peak, tile pixels */
    double cx, cy; /* centroid, tile pixels */
    double flux;   /* units of the pedestal */
    double square; /* mean square radius, pixels^2 */
} point_like;

static const double PEAK_SIGMA = 10;
static const double NEIGHBOUR = 0.1;
static const double SIZE_QUANTILE = 0.2, SIZE_RATIO = 1.3;
static const double SHARPEST = 0.6;
enum { PEAK_RADIUS = 2, POINTS_MAX = 300 };

static float object_at(const rx_rl *rl, int x, int y)
{
    return rl->object[rx_blur_row(rl->blur, y) + (size_t)x];
}

/* Highest within the square of PEAK_RADIUS; of equals the first one. */
static int is_peak(const rx_rl *rl, int x, int y)
{
    const float f = object_at(rl, x, y);
    for (int j = -PEAK_RADIUS; j <= PEAK_RADIUS; j++)
        for (int i = -PEAK_RADIUS; i <= PEAK_RADIUS; i++) {
            const float other = object_at(rl, x + i, y + j);
            const int before = j < 0 || (j == 0 && i < 0);
            if (before ? other >= f : other > f)
                return 0;
        }
    return 1;
}

/* No masked pixel within r, nothing comparable between the peak's own square and 2 r. */
static int is_isolated(const rx_rl *rl, int x, int y, int r)
{
    const double height = object_at(rl, x, y) - 1;
    for (int j = -2 * r; j <= 2 * r; j++)
        for (int i = -2 * r; i <= 2 * r; i++) {
            const int d2 = i * i + j * j;
            if (d2 <= r * r && rl->prepared->mask[(size_t)(y + j) * rl->prepared->width + (x + i)] != 0)
                return 0;
            if (d2 <= r * r || d2 > 4 * r * r)
                continue;
            if (object_at(rl, x + i, y + j) - 1 > NEIGHBOUR * height)
                return 0;
        }
    return 1;
}

/* Mean of the eight neighbours above the sky in the data, in units of the peak. */
static double data_bluntness(const rx_prepared *prepared, int x, int y)
{
    double sum = 0, peak = 0;
    for (int j = -1; j <= 1; j++) {
        float room[3];
        const float *data = rx_prepared_data(prepared, y + j, x - 1, 3, room);
        for (int i = 0; i < 3; i++) {
            const double v = data[i] - 1.0;
            if (i == 1 && j == 0)
                peak = v;
            else
                sum += v;
        }
    }
    return sum / 8 / peak;
}

/* Mean of the eight neighbours of a stamp's centre over the centre. */
static double bluntness_of(const float *stamp, int size)
{
    double sum = 0;
    for (int j = -1; j <= 1 && size > 1; j++)
        for (int i = -1; i <= 1; i++)
            if (i != 0 || j != 0)
                sum += stamp[(size / 2 + j) * size + size / 2 + i];
    return sum / 8 / stamp[size / 2 * size + size / 2];
}

static point_like measure_point(const rx_rl *rl, int x, int y, int r)
{
    double sum = 0, sx = 0, sy = 0, ss = 0;
    for (int j = -r; j <= r; j++)
        for (int i = -r; i <= r; i++) {
            if (i * i + j * j > r * r)
                continue;
            const double v = object_at(rl, x + i, y + j) - 1.0;
            sum += v;
            sx += v * i;
            sy += v * j;
            ss += v * (i * i + j * j);
        }
    const double dx = sx / sum, dy = sy / sum;
    return (point_like){x, y, x + dx, y + dy, sum, ss / sum - dx * dx - dy * dy};
}

/* Brighter first; then by position, so that the order is one. */
static int brighter(const void *a, const void *b)
{
    const point_like *p = a, *q = b;
    if (p->flux != q->flux)
        return p->flux < q->flux ? 1 : -1;
    return p->y != q->y ? (p->y > q->y) - (p->y < q->y) : (p->x > q->x) - (p->x < q->x);
}

/* Those no larger than the smallest fifth of them, nearly; returns how many. */
static rx_status keep_points(point_like *list, size_t count, point_like *points, int *n, rx_error *err)
{
    *n = 0;
    if (count == 0)
        return RX_OK;
    double *squares;
    RX_TRY(RX_MAKE(squares, count, err));
    for (size_t i = 0; i < count; i++)
        squares[i] = list[i].square;
    const double limit = SIZE_RATIO * rx_quantile(squares, count, SIZE_QUANTILE);
    free(squares);
    qsort(list, count, sizeof *list, brighter);
    for (size_t i = 0; i < count && *n < POINTS_MAX; i++)
        if (list[i].square <= limit)
            points[(*n)++] = list[i];
    return RX_OK;
}

typedef struct finder {
    const rx_rl *rl;
    int radius; /* of the disk */
    double bluntness;
    point_like *list;
    size_t count, room;
} finder;

static rx_status add_point(finder *f, const point_like *point, rx_error *err)
{
    if (f->count == f->room) {
        f->room = f->room > 0 ? 2 * f->room : 256;
        RX_TRY(RX_GROW(f->list, f->room, err));
    }
    f->list[f->count++] = *point;
    return RX_OK;
}

/* Those of n pixels from (x, y) on. */
static rx_status find_in_piece(finder *f, int y, int x, int n, rx_error *err)
{
    const rx_rl *rl = f->rl;
    const int r = f->radius;
    const rx_prepared *prepared = rl->prepared;
    const float level = (float)(1 + PEAK_SIGMA * prepared->sigma);
    float room[RX_MAP_PIECE];
    const float *data = rx_prepared_data(prepared, y, x, n, room);
    rx_status status = RX_OK;
    for (int i = 0; i < n && status == RX_OK; i++) {
        const int at = x + i;
        if (!(data[i] > level) || !(object_at(rl, at, y) > level) || !is_peak(rl, at, y) ||
            !is_isolated(rl, at, y, r) || !(data_bluntness(prepared, at, y) > SHARPEST * f->bluntness))
            continue;
        const point_like point = measure_point(rl, at, y, r);
        if (point.flux > 0 && fabs(point.cx - at) <= 1 && fabs(point.cy - y) <= 1)
            status = add_point(f, &point, err);
    }
    return status;
}

/* At most POINTS_MAX, the brightest, into points[]; *n of them, and the disk's radius.
 * fwhm and bluntness: of the PSF as it is known. */
static rx_status find_points(const rx_rl *rl, double fwhm, double bluntness, point_like *points, int *n,
                             int *radius, rx_error *err)
{
    const rx_prepared *prepared = rl->prepared;
    const int r = *radius = (int)fmax(PEAK_RADIUS, ceil(fwhm)), end = prepared->width - 2 * r;
    finder f = {.rl = rl, .radius = r, .bluntness = bluntness};
    rx_status status = RX_OK;
    for (int y = 2 * r; y < prepared->height - 2 * r && status == RX_OK; y++)
        for (int x = 2 * r; x < end && status == RX_OK; x += RX_MAP_PIECE)
            status = find_in_piece(&f, y, x, rx_map_piece(x, end), err);
    if (status == RX_OK)
        status = keep_points(f.list, f.count, points, n, err);
    free(f.list);
    return status;
}

/* --- the PSF --- */

typedef struct rx_seeker {
    const rx_prepared *prepared;
    rx_psf *psf; /* constant; basis is the last good PSF */
    rx_blur *blur;
    rx_rl *rl;
    int size;
    float *stamp;                       /* [size][size] the PSF that is being improved */
    float *share;                       /* [size][size] sum_x s(x - u) W(x) */
    float *work;                        /* [size][size] */
    float *rest;                        /* [height][width] b */
    float *points;                      /* s on the sky */
    rx_fft *fft;                        /* of the whole sky */
    float *plane, *half, *spectrum;     /* its planes: scratch, scratch, spectrum of s */
    double start_fwhm, bluntness, x, y; /* of the start: width and centroid */
} rx_seeker;

static void seeker_free(rx_seeker *seeker)
{
    rx_rl_free(seeker->rl);
    rx_blur_free(seeker->blur);
    rx_psf_free(seeker->psf);
    free(seeker->stamp);
    free(seeker->share);
    free(seeker->work);
    free(seeker->rest);
    free(seeker->points);
    free(seeker->plane);
    free(seeker->half);
    free(seeker->spectrum);
    rx_fft_free(seeker->fft);
}

/* Positive with sum 1; 0 when that is impossible. */
static int make_positive(float *stamp, int size)
{
    double sum = 0;
    for (int k = 0; k < size * size; k++) {
        if (!isfinite(stamp[k]))
            return 0;
        stamp[k] = fmaxf(stamp[k], 0);
        sum += stamp[k];
    }
    for (int k = 0; k < size * size && sum > 0; k++)
        stamp[k] = (float)(stamp[k] / sum);
    return sum > 0;
}

/* The transform is of the whole sky: a point's light counts for the PSF wherever it is. */
static rx_status open_planes(rx_seeker *seeker, rx_error *err)
{
    const rx_prepared *prepared = seeker->prepared;
    const int around = 2 * seeker->blur->margin;
    RX_TRY(rx_fft_new(rx_fft_good_size(prepared->width + around), rx_fft_good_size(prepared->height + around),
                      prepared->nthreads, &seeker->fft, err));
    seeker->rest = RX_NEW(float, (size_t)prepared->width *(size_t)prepared->height);
    seeker->points = rx_blur_sky(seeker->blur);
    seeker->plane = rx_fft_real(seeker->fft);
    seeker->half = rx_fft_complex(seeker->fft);
    seeker->spectrum = rx_fft_complex(seeker->fft);
    if (seeker->rest == NULL || seeker->points == NULL || seeker->plane == NULL || seeker->half == NULL ||
        seeker->spectrum == NULL)
        return rx_error_memory(err, 3 * rx_fft_complex_size(seeker->fft) * sizeof(float));
    return RX_OK;
}

static rx_status seeker_start(rx_seeker *seeker, const rx_restore_params *par, const rx_prepared *prepared,
                              rx_error *err)
{
    const rx_psf *psf = prepared->image.psf;
    const size_t n = (size_t)psf->size * (size_t)psf->size;
    seeker->prepared = prepared;
    seeker->size = psf->size;
    RX_TRY(RX_MAKE(seeker->stamp, n, err));
    RX_TRY(RX_MAKE(seeker->share, n, err));
    RX_TRY(RX_MAKE(seeker->work, n, err));
    rx_psf_at(psf, (prepared->width - 1) / 2.0, (prepared->height - 1) / 2.0, seeker->stamp);
    if (!make_positive(seeker->stamp, psf->size))
        return rx_error_set(err, RX_INPUT, "the PSF at the tile's centre is not positive; give another one");
    RX_TRY(rx_stamp_psf(psf->type, seeker->stamp, psf->size, &seeker->psf, err));
    seeker->start_fwhm = seeker->psf->fwhm;
    seeker->bluntness = bluntness_of(seeker->stamp, psf->size);
    rx_stamp_centroid(seeker->stamp, psf->size, seeker->start_fwhm, &seeker->x, &seeker->y);
    RX_TRY(
        rx_blur_new(seeker->psf, prepared->width, prepared->height, prepared->nthreads, &seeker->blur, err));
    RX_TRY(rx_rl_new(par, prepared, seeker->blur, 1, &seeker->rl, err));
    return open_planes(seeker, err);
}

/* The stamp around the origin of a cyclic plane, divided by the number of pixels. */
static void read_stamp(const rx_fft *fft, const float *plane, int size, float *stamp)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft), centre = size / 2;
    const double scale = 1.0 / ((double)w * h);
    for (int k = 0; k < size * size; k++) {
        size_t y = (size_t)((k / size - centre + h) % h), x = (size_t)((k % size - centre + w) % w);
        stamp[k] = (float)(plane[y * (size_t)rx_fft_stride_real(fft) + x] * scale);
    }
}

/* Tile pixel (0, y) on the plane of the whole sky. */
static float *plane_row(const rx_seeker *seeker, int y)
{
    const int margin = seeker->blur->margin;
    return seeker->plane + (size_t)(y + margin) * (size_t)rx_fft_stride_real(seeker->fft) + (size_t)margin;
}

static void clear_plane(rx_seeker *seeker)
{
    const rx_fft *fft = seeker->fft;
    memset(seeker->plane, 0,
           (size_t)rx_fft_stride_real(fft) * (size_t)rx_fft_height(fft) * sizeof *seeker->plane);
}

/* stamp(u) = sum_x s(x - u) plane(x); plane is destroyed. */
static void correlate_points(rx_seeker *seeker, float *stamp)
{
    rx_fft_filter(seeker->fft, seeker->plane, seeker->spectrum, true, seeker->half, seeker->plane);
    read_stamp(seeker->fft, seeker->plane, seeker->size, stamp);
}

/* The spectrum of the points. */
static void transform_points(rx_seeker *seeker)
{
    const int margin = seeker->blur->margin, width = seeker->prepared->width + 2 * margin;
    clear_plane(seeker);
    for (int y = -margin; y < seeker->prepared->height + margin; y++)
        memcpy(plane_row(seeker, y) - margin, seeker->points + rx_blur_row(seeker->blur, y) - margin,
               (size_t)width * sizeof(float));
    rx_fft_forward(seeker->fft, seeker->plane, seeker->spectrum);
}

/* The flux of a point onto the pixels around its centroid, by cubic convolution: sum, centroid and width
 * are kept. */
static void put_point(const rx_seeker *seeker, const point_like *point)
{
    const int ix = (int)floor(point->cx), iy = (int)floor(point->cy);
    double wx[4], wy[4];
    rx_stamp_cubic(point->cx - ix, wx);
    rx_stamp_cubic(point->cy - iy, wy);
    for (int j = 0; j < 4; j++) {
        float *row = seeker->points + rx_blur_row(seeker->blur, iy + j - 1) + (size_t)(ix - 1);
        for (int i = 0; i < 4; i++)
            row[i] += (float)(point->flux * wx[i] * wy[j]);
    }
}

/* Its disk in the rest of the image becomes sky. */
static void take_out(const rx_seeker *seeker, const point_like *point, int radius, float *rest)
{
    for (int j = -radius; j <= radius; j++)
        for (int i = -radius; i <= radius; i++)
            if (i * i + j * j <= radius * radius)
                rest[rx_blur_row(seeker->blur, point->y + j) + (size_t)(point->x + i)] = 1;
}

/* Part the image into points and rest, and set what the PSF updates hold fixed; *n points. */
static rx_status split(rx_seeker *seeker, int *n, rx_error *err)
{
    const rx_prepared *prepared = seeker->prepared;
    const size_t size = rx_blur_sky_size(seeker->blur) * sizeof(float);
    point_like found[POINTS_MAX];
    int radius = 0;
    rx_status status = find_points(seeker->rl, seeker->psf->fwhm, seeker->bluntness, found, n, &radius, err);
    if (status != RX_OK || *n < FEWEST_POINTS)
        return status;
    memcpy(seeker->points, seeker->rl->object, size);
    for (int i = 0; i < *n; i++)
        take_out(seeker, &found[i], radius, seeker->points);
    rx_blur_plane(seeker->blur, seeker->points, seeker->rest);
    memset(seeker->points, 0, size);
    for (int i = 0; i < *n; i++)
        put_point(seeker, &found[i]);
    transform_points(seeker);
    clear_plane(seeker);
    for (int y = 0; y < prepared->height; y++) {
        float *row = plane_row(seeker, y);
        const float *weight = rx_prepared_weight(prepared, y, 0, prepared->width, row);
        if (weight != row)
            memcpy(row, weight, (size_t)prepared->width * sizeof(float));
    }
    correlate_points(seeker, seeker->share);
    return RX_OK;
}

/* One update of the stamp. */
static int improve(rx_seeker *seeker)
{
    const rx_prepared *prepared = seeker->prepared;
    const size_t n = (size_t)prepared->width * (size_t)prepared->height;
    const int pixels = seeker->size * seeker->size;
    float *model = seeker->rl->model, largest = 0;
    rx_blur_plane(seeker->blur, seeker->points, model);
    for (size_t k = 0; k < n; k++)
        model[k] += seeker->rest[k];
    clear_plane(seeker);
    for (int y = 0; y < prepared->height; y++)
        rx_rl_residual(seeker->rl, y, 0, prepared->width, plane_row(seeker, y));
    correlate_points(seeker, seeker->work);
    for (int k = 0; k < pixels; k++)
        largest = fmaxf(largest, seeker->share[k]);
    for (int k = 0; k < pixels; k++)
        if (seeker->share[k] > SHARE_FLOOR * largest)
            seeker->stamp[k] *= 1 + seeker->work[k] / seeker->share[k];
    if (!make_positive(seeker->stamp, seeker->size))
        return 0;
    rx_blur_replace(seeker->blur, seeker->stamp);
    return 1;
}

/* Back to the centroid of the start; then the PSF is taken over, *taken, if it is one. */
static rx_status accept(rx_seeker *seeker, int *taken, rx_error *err)
{
    *taken = 0;
    double x, y, fwhm, ellipticity;
    rx_stamp_centroid(seeker->stamp, seeker->size, seeker->start_fwhm, &x, &y);
    rx_stamp_shift(seeker->stamp, seeker->size, fmax(-1, fmin(1, seeker->x - x)),
                   fmax(-1, fmin(1, seeker->y - y)), seeker->work);
    if (!make_positive(seeker->stamp, seeker->size))
        return RX_OK;
    rx_status status = rx_stamp_fwhm(seeker->stamp, seeker->size, &fwhm, &ellipticity, err);
    if (status != RX_OK ||
        !(fwhm >= fmax(NARROWEST, seeker->start_fwhm / RANGE) && fwhm <= RANGE * seeker->start_fwhm))
        return status;
    seeker->psf->fwhm = fwhm;
    seeker->psf->ellipticity = ellipticity;
    memcpy(seeker->psf->basis, seeker->stamp, (size_t)seeker->size * (size_t)seeker->size * sizeof(float));
    rx_blur_replace(seeker->blur, seeker->stamp);
    rx_rl_normalise(seeker->rl);
    *taken = 1;
    return RX_OK;
}

/* The image from the start with the present PSF: what another PSF has left in it would not go away. */
static rx_status restore_image(rx_seeker *seeker, int niter, rx_error *err)
{
    rx_status status = RX_OK;
    rx_rl_reset(seeker->rl);
    for (int i = 0; i < niter && (status = rx_interrupt_check(err)) == RX_OK; i++) {
        rx_rl_model(seeker->rl);
        rx_rl_update(seeker->rl, i + 1 == niter);
    }
    return status;
}

static rx_status seek(rx_seeker *seeker, rx_log *log, rx_error *err)
{
    for (int cycle = 0; cycle < CYCLES; cycle++) {
        int n = 0;
        rx_status status = restore_image(seeker, NITER, err);
        if (status == RX_OK)
            status = split(seeker, &n, err);
        if (status != RX_OK)
            return status;
        if (n < FEWEST_POINTS) {
            rx_log_warning(log, "RL_BLIND: %d isolated point-like sources are too few to improve the PSF", n);
            return RX_OK;
        }
        int sound = 1;
        for (int i = 0; i < NITER && sound; i++) {
            if ((status = rx_interrupt_check(err)) != RX_OK)
                return status;
            sound = improve(seeker);
        }
        if (sound && (status = accept(seeker, &sound, err)) != RX_OK)
            return status;
        if (!sound) {
            rx_log_warning(log, "RL_BLIND: the PSF degenerates in cycle %d, the one before is used",
                           cycle + 1);
            return RX_OK;
        }
        rx_log_progress(log, "RL_BLIND: PSF", (cycle + 1.0) / CYCLES);
    }
    return RX_OK;
}

rx_status rx_rl_blind_run(const rx_restore_params *par, const rx_image *image, rx_log *log, rx_restored **dst,
                          rx_error *err)
{
    const double begun = rx_seconds();
    rx_prepared *prepared = NULL;
    rx_seeker seeker = {0};
    rx_psf *found = NULL;
    char settings[80];
    *dst = NULL;
    RX_TRY(rx_blur_check(image->psf, image->width, image->height, err));
    rx_status status = rx_prepared_new(par, image, &prepared, err);
    if (status == RX_OK)
        status = seeker_start(&seeker, par, prepared, err);
    if (status == RX_OK && prepared->good > 0) {
        rx_log_progress_begin(log);
        status = seek(&seeker, log, err);
        rx_log_progress_end(log);
    }
    if (status != RX_OK)
        goto exit;
    prepared->image.psf = found = seeker.psf;
    seeker.psf = NULL;
    seeker_free(&seeker);
    seeker = (rx_seeker){0};
    snprintf(found->description, sizeof found->description, "found by RL_BLIND, FWHM %.3f pixels",
             found->fwhm);
    snprintf(settings, sizeof settings, "RL_BLIND_CYCLES %d, RL_BLIND_NITER %d", CYCLES, NITER);
    status = rx_rl_restore(par, prepared, "RL_BLIND", settings, log, dst, err);
    if (status == RX_OK)
        (*dst)->seconds = rx_seconds() - begun;
exit:
    rx_psf_free(found);
    seeker_free(&seeker);
    rx_prepared_free(prepared);
    return status;
}
