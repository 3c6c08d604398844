/* Pixels of the restored image in a template. */
#include "template/substructure.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"

/* Pixels outside the segment count from so many sigmas on. */
static const double CLEAR = 3.0;

/* Of the model of all at that pixel, what is the subject's; on its own segment all. */
static double share_of(const rx_refine_view *view, const rx_subject *s, int x, int y, double own)
{
    const size_t k = (size_t)y * (size_t)view->canvas->width + (size_t)x;
    const int32_t segment = view->segments[k];
    if (segment == s->segment)
        return 1;
    if (segment != 0 || !(own > 0))
        return 0;
    /* nobody's: near the segment's box only, and what neighbours' models leave */
    const int reach = (int)ceil(view->fwhm);
    if (x < s->xmin - reach || x > s->xmax + reach || y < s->ymin - reach || y > s->ymax + reach)
        return 0;
    const double all = view->canvas->model[k];
    return all > own ? own / all : 1;
}

static int descending(const void *a, const void *b)
{
    const double p = *(const double *)a, q = *(const double *)b;
    return p < q ? 1 : p > q ? -1 : 0;
}

/* Noise of the restored pixels between the sources around (cx, cy), from their values below 0: what a
 * restorer makes of the noise of the tile is larger than that, and correlated with it. 0 where there are too
 * few. */
static double restored_noise(const rx_refine_view *view, int cx, int cy, int n, double *work)
{
    const rx_canvas *canvas = view->canvas;
    int count = 0;
    for (int y = cy - n / 2; y < cy - n / 2 + n; y++)
        for (int x = cx - n / 2; x < cx - n / 2 + n; x++) {
            if (x < 0 || y < 0 || x >= canvas->width || y >= canvas->height)
                continue;
            const size_t k = (size_t)y * (size_t)canvas->width + (size_t)x;
            if (view->segments[k] == 0 && view->restored->mask[k] == 0 && view->restored->pixels[k] < 0)
                work[count++] = -view->restored->pixels[k];
        }
    if (count < 30)
        return 0;
    qsort(work, (size_t)count, sizeof *work, descending);
    return 1.4826 * work[count / 2];
}

/* Plane 0 = D, the profile behind the restored PSF in it before. Returns what is free in it. */
static double difference(const rx_refine_view *view, const rx_subject *s, int cx, int cy, double least_noise,
                         rx_lens_size *size)
{
    const rx_canvas *canvas = view->canvas;
    const rx_restored *restored = view->restored;
    const size_t stride = (size_t)rx_fft_stride_real(size->fft);
    double used = 0;
    for (int j = 0; j < size->n; j++)
        for (int i = 0; i < size->n; i++) {
            float *p = size->plane[0] + (size_t)j * stride + (size_t)i;
            const int x = cx - size->n / 2 + i, y = cy - size->n / 2 + j;
            const double own = s->flux * *p;
            *p = 0;
            if (x < 0 || y < 0 || x >= canvas->width || y >= canvas->height)
                continue;
            const size_t k = (size_t)y * (size_t)canvas->width + (size_t)x;
            if (restored->mask[k] != 0)
                continue;
            const double share = share_of(view, s, x, y, own);
            if (!(share > 0))
                continue;
            const double v = restored->pixels[k] - own / share;
            const double noise =
                fmax(least_noise, restored->sigma != NULL ? restored->sigma[k] : sqrt(canvas->variance[k]));
            if (view->segments[k] != s->segment && !(fabs(v) > CLEAR * noise))
                continue;
            const double sure = v * v / (v * v + noise * noise);
            if (!isfinite(sure))
                continue;
            *p = (float)(share * sure * v);
            used += share * sure;
        }
    return used;
}

/* F', A of the linear fit of T and K*D to the patch; returns the gain in chi2 over F T at its best F. */
static double fit_both(const rx_patch *patch, const float *t, const float *d, size_t stride, double *flux,
                       double *amount)
{
    double tt = 0, td = 0, dd = 0, tc = 0, dc = 0;
    for (int j = 0; j < patch->side; j++)
        for (int i = 0; i < patch->side; i++) {
            const size_t p = (size_t)j * (size_t)patch->side + (size_t)i;
            const size_t k = (size_t)(j + patch->corner) * stride + (size_t)(i + patch->corner);
            const double w = patch->weight[p], c = patch->data[p];
            tt += w * t[k] * t[k];
            td += w * t[k] * d[k];
            dd += w * d[k] * d[k];
            tc += w * t[k] * c;
            dc += w * d[k] * c;
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

rx_status rx_substructure_add(const rx_refine_view *view, const rx_subject *subject, int cx, int cy,
                              rx_lens *lens, rx_lens_size *size, const rx_patch *patch, int *used,
                              double *flux, rx_error *err)
{
    const size_t stride = (size_t)rx_fft_stride_real(size->fft), rows = (size_t)size->n;
    *used = 0;
    if (subject->segment == 0 || !(subject->flux > 0))
        return RX_OK;
    float *own = RX_NEW(float, rows *stride);
    double *work = RX_NEW(double, rows *rows);
    if (own == NULL || work == NULL) {
        free(own);
        free(work);
        return rx_error_memory(err, rows * stride * sizeof *own);
    }
    const double noise = restored_noise(view, cx, cy, size->n, work);
    free(work);
    for (size_t k = 0; k < rows * stride; k++)
        own[k] = size->plane[0][k];
    rx_lens_render(size, &subject->profile, subject->x - cx, subject->y - cy, 1, 1);
    const double cost = 2 * difference(view, subject, cx, cy, noise, size) + 4;
    rx_lens_blur(size, lens->same);
    double both = 0, amount = 0, sum = 0;
    const double gain = fit_both(patch, own, size->plane[0], stride, &both, &amount);
    for (size_t j = 0; j < rows; j++)
        for (size_t i = 0; i < rows; i++)
            sum += size->plane[0][j * stride + i];
    const double total = both + amount * sum;
    if (gain > cost && both > 0 && total > 0.5 * subject->flux) {
        *used = 1;
        *flux = total;
        for (size_t k = 0; k < rows * stride; k++)
            size->plane[0][k] = (float)((both * own[k] + amount * size->plane[0][k]) / total);
    } else {
        for (size_t k = 0; k < rows * stride; k++)
            size->plane[0][k] = own[k];
    }
    free(own);
    return RX_OK;
}
