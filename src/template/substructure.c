/* Pixels of the restored image in a template. */
#include "template/substructure.h"
#include "base/constants.h"

#include <math.h>
#include <string.h>

/* Pixels outside the segment count from so many sigmas on. */
static const double CLEAR = 3.0;
enum { KEPT = 4 }; /* plane */

/* Of the model of all at that pixel, what is the source's; on its own segment all. */
static double share_of(const rx_refine_view *view, const rx_fit_source *s, size_t k, double own)
{
    const int32_t segment = view->segments[k];
    if (segment == s->segment)
        return 1;
    if (segment != 0 || !(own > 0))
        return 0;
    const size_t above = (size_t)view->image->top * (size_t)view->image->width;
    const double all = view->image->model[k - above];
    return all > own ? own / all : 1;
}

/* The value that `below` of n are not larger than, by Hoare's partitions; the order of v is lost. */
static float select_value(float *v, int n, int below)
{
    int first = 0, last = n - 1;
    while (first < last) {
        const float pivot = v[(first + last) / 2];
        int i = first, j = last;
        while (i <= j) {
            while (v[i] < pivot)
                i++;
            while (v[j] > pivot)
                j--;
            if (i <= j) {
                const float swap = v[i];
                v[i++] = v[j];
                v[j--] = swap;
            }
        }
        if (below <= j)
            last = j;
        else if (below >= i)
            first = i;
        else
            break;
    }
    return v[below];
}

/* Noise of the restored pixels between the sources around (cx, cy), from their values below 0: what a
 * restorer makes of the noise of the tile is larger than that, and correlated with it. 0 where there are too
 * few. work [n][n]. */
static double restored_noise(const rx_refine_view *view, int cx, int cy, int n, float *work)
{
    const rx_fit_image *image = view->image;
    const int x0 = cx - n / 2 > 0 ? cx - n / 2 : 0, y0 = cy - n / 2 > 0 ? cy - n / 2 : 0;
    const int x1 = cx - n / 2 + n < image->width ? cx - n / 2 + n : image->width;
    const int y1 = cy - n / 2 + n < image->height ? cy - n / 2 + n : image->height;
    const int bits = view->shape_mask != NULL ? view->shape_bits : 0;
    int count = 0;
    for (int y = y0; y < y1; y++) {
        const size_t row = (size_t)y * (size_t)image->width;
        const int32_t *segments = view->segments + row;
        const uint8_t *mask = view->restored->mask + row;
        const uint8_t *more = view->shape_mask != NULL ? view->shape_mask + row : mask;
        const float *pixels = view->restored->pixels + row;
        for (int x = x0; x < x1; x++) { /* signs of noise cannot be foreseen: no branches */
            work[count] = -pixels[x];
            count += (segments[x] == 0) & (mask[x] == 0) & ((more[x] & bits) == 0) & (pixels[x] < 0);
        }
    }
    if (count < 30)
        return 0;
    return RX_MAD_SIGMA * (double)select_value(work, count, count - 1 - count / 2);
}

/* Of the restored pixels from (x0, y0) to (x1, y1), in rows: read at once, as a restorer that makes them has
 * to look around each piece. NULL: it is the tile's. */
static const float *read_noise(const rx_refine_view *view, int x0, int y0, int x1, int y1, float *room)
{
    const rx_restored *restored = view->restored;
    const int n = x1 - x0 + 1, rows = y1 - y0 + 1;
    const rx_map *noise = &restored->noise;
    if (!rx_map_given(noise) || n <= 0 || rows <= 0)
        return NULL;
    if (noise->maker != NULL) {
        noise->maker->make(noise->maker, x0, y0, n, rows, room);
        return room;
    }
    for (int j = 0; j < rows; j++) {
        float *own = room + (size_t)j * (size_t)n;
        const float *values = rx_map_row(noise, y0 + j, x0, n, own);
        if (values != own)
            memcpy(own, values, (size_t)n * sizeof *own);
    }
    return room;
}

/* What of the pixel k is free in D, *d; own: the profile's light there; at: its noise, NULL: the tile's.
 * Outside the segment only what neighbours' models leave. */
static double free_pixel(const rx_refine_view *view, const rx_fit_source *s, size_t k, double own,
                         const float *at, double least_noise, float *d)
{
    const rx_restored *restored = view->restored;
    const int hidden =
        restored->mask[k] != 0 || (view->shape_mask != NULL && (view->shape_mask[k] & view->shape_bits) != 0);
    const double share = hidden ? 0 : share_of(view, s, k, own);
    if (!(share > 0))
        return 0;
    const double v = restored->pixels[k] - own / share;
    const size_t width = (size_t)restored->width;
    const double known = at != NULL
                             ? (double)*at
                             : sqrt(rx_fit_image_variance(view->image, (int)(k % width), (int)(k / width)));
    const double noise = known > least_noise ? known : least_noise;
    if (view->segments[k] != s->segment && !(fabs(v) > CLEAR * noise))
        return 0;
    const double sure = v * v / (v * v + noise * noise);
    if (!isfinite(sure))
        return 0;
    *d = (float)(share * sure * v);
    return share * sure;
}

static int clip(int v, int least, int most)
{
    return v < least ? least : v > most ? most : v;
}

/* Plane 0 = D, the profile behind the restored PSF in it before. Returns what is free in it: near the
 * segment's box only. room [n][n]. */
static double difference(const rx_refine_view *view, const rx_fit_source *s, int cx, int cy,
                         double least_noise, float *room, rx_template_domain *size)
{
    const rx_fit_image *image = view->image;
    const size_t stride = (size_t)rx_fft_stride_real(size->fft);
    const int reach = (int)ceil(view->fwhm), left = cx - size->n / 2, low = cy - size->n / 2;
    const int right = left + size->n - 1, high = low + size->n - 1;
    /* the box lies in the plane and in the tile; it may be empty */
    const int x0 = clip(s->xmin - reach, left > 0 ? left : 0, right + 1);
    const int y0 = clip(s->ymin - reach, low > 0 ? low : 0, high + 1);
    const int x1 = clip(s->xmax + reach, left - 1, right < image->width ? right : image->width - 1);
    const int y1 = clip(s->ymax + reach, low - 1, high < image->height ? high : image->height - 1);
    const float *noise = read_noise(view, x0, y0, x1, y1, room);
    double used = 0;
    for (int y = low; y <= high; y++) {
        float *row = size->plane[0] + (size_t)(y - low) * stride;
        for (int x = left; x <= right; x++) {
            float *p = row + (x - left);
            const double own = s->flux * *p;
            *p = 0;
            if (x < x0 || x > x1 || y < y0 || y > y1)
                continue;
            const float *at =
                noise != NULL ? noise + (size_t)(y - y0) * (size_t)(x1 - x0 + 1) + (x - x0) : NULL;
            used +=
                free_pixel(view, s, (size_t)y * (size_t)image->width + (size_t)x, own, at, least_noise, p);
        }
    }
    return used;
}

/* F', A of the linear fit of T and K*D to the patch; returns the gain in chi2 over F T at its best F. */
static double fit_both(const rx_patch *patch, const float *t, const float *d, size_t stride, double *flux,
                       double *amount)
{
    double tt = 0, td = 0, dd = 0, tc = 0, dc = 0;
    for (size_t j = 0; j < (size_t)patch->side; j++) {
        const double *weight = patch->weight + j * (size_t)patch->side;
        const double *data = patch->data + j * (size_t)patch->side;
        const size_t k = (j + (size_t)patch->corner) * stride + (size_t)patch->corner;
#pragma omp simd reduction(+ : tt, td, dd, tc, dc)
        for (int i = 0; i < patch->side; i++) {
            const double wt = weight[i] * t[k + (size_t)i], wd = weight[i] * d[k + (size_t)i];
            tt += wt * t[k + (size_t)i];
            td += wt * d[k + (size_t)i];
            dd += wd * d[k + (size_t)i];
            tc += wt * data[i];
            dc += wd * data[i];
        }
    }
    const double det = tt * dd - td * td;
    if (!(tt > 0) || !(det > 1e-9 * tt * dd))
        return 0;
    *amount = fmin(fmax((tt * dc - td * tc) / det, 0), 1);
    *flux = (tc - *amount * td) / tt;
    const double alone = tc * tc / tt;
    const double both = 2 * (*flux * tc + *amount * dc) -
                        (*flux * *flux * tt + 2 * *flux * *amount * td + *amount * *amount * dd);
    return both - alone;
}

int rx_substructure_add(const rx_refine_view *view, const rx_fit_source *source, int cx, int cy,
                        rx_template_domain *size, const rx_patch *patch, double *flux)
{
    const size_t stride = (size_t)rx_fft_stride_real(size->fft), rows = (size_t)size->n;
    if (source->segment == 0 || source->untouched || !(source->flux > 0))
        return 0;
    const rx_matching *matching = rx_template_domain_matching(size);
    /* a spectrum is larger than its plane, and is free now */
    const double noise = restored_noise(view, cx, cy, size->n, size->half[0]);
    float *own = size->plane[0]; /* kept as a plane that only derivatives need */
    size->plane[0] = size->plane[KEPT];
    size->plane[KEPT] = own;
    rx_template_domain_render(size, &source->profile, source->x - cx, source->y - cy, matching, 1);
    const double cost = 2 * difference(view, source, cx, cy, noise, size->half[0], size) + 4;
    rx_template_domain_blur(size, matching);
    double both = 0, amount = 0, sum = 0;
    const double gain = fit_both(patch, own, size->plane[0], stride, &both, &amount);
    for (size_t j = 0; j < rows; j++)
        for (size_t i = 0; i < rows; i++)
            sum += size->plane[0][j * stride + i];
    const double total = both + amount * sum;
    if (gain > cost && both > 0 && total > 0.5 * source->flux) {
        *flux = total;
        for (size_t k = 0; k < rows * stride; k++)
            size->plane[0][k] = (float)((both * own[k] + amount * size->plane[0][k]) / total);
        return 1;
    }
    size->plane[KEPT] = size->plane[0];
    size->plane[0] = own;
    return 0;
}
