/* Relative PSF, filters and widths of the PSF around the network. */
#include "restore/network_otf.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/deblur.h"
#include "restore/blur.h"
#include "restore/stamp.h"

enum {
    NODE_STEP = 512,       /* pixels between nodes at most */
    NODES_LEAST = 5,       /* in each direction, for a PSF that varies */
    FILTER_DOMAIN = 256,   /* where Tikhonov filters are made: far more than they reach */
    RELATIVE_LARGEST = 129 /* side of a relative PSF, pixels */
};

/* Side that the relative PSF needs at the centre and at the corners of the tile. */
static rx_status relative_size(const rx_psf *psf, double target_fwhm, int width, int height, float *stamp,
                               int *size, rx_error *err)
{
    const double places[][2] = {{0.5, 0.5}, {0, 0}, {1, 0}, {0, 1}, {1, 1}};
    rx_status status = RX_OK;
    *size = 1;
    for (int i = 0; i < (rx_psf_varies(psf) ? 5 : 1) && status == RX_OK; i++) {
        int here = 0;
        rx_psf_at(psf, places[i][0] * (width - 1), places[i][1] * (height - 1), stamp);
        status = rx_deblur_relative_size(stamp, psf->size, target_fwhm, RELATIVE_LARGEST, &here, err);
        if (here > *size)
            *size = here;
    }
    return status;
}

/* The first sums to 1, the others to 0: cutting the stamps has changed that. */
static rx_status normalise(float *stamps, int n, size_t area, rx_error *err)
{
    double first = 0;
    for (size_t k = 0; k < area; k++)
        first += stamps[k];
    if (!(first > 0) || !isfinite(first))
        return rx_error_set(err, RX_INPUT, "the PSF has no flux; give one with a positive sum");
    for (size_t k = 0; k < area * (size_t)n; k++)
        stamps[k] = (float)(stamps[k] / first);
    for (int i = 1; i < n; i++) {
        double sum = 0;
        for (size_t k = 0; k < area; k++)
            sum += stamps[area * (size_t)i + k];
        for (size_t k = 0; k < area; k++)
            stamps[area * (size_t)i + k] -= (float)(sum * stamps[k]);
    }
    return RX_OK;
}

rx_status rx_otf_relative(const rx_psf *psf, double target_fwhm, int width, int height, float **stamps,
                          int *size, rx_error *err)
{
    const size_t area = (size_t)psf->size * (size_t)psf->size;
    float *stamp = RX_NEW(float, area), *made = NULL;
    rx_status status = stamp == NULL ? rx_error_memory(err, area * sizeof *stamp)
                                     : relative_size(psf, target_fwhm, width, height, stamp, size, err);
    free(stamp);
    *stamps = NULL;
    if (status != RX_OK)
        return status;
    const size_t out = (size_t)*size * (size_t)*size;
    if ((made = RX_NEW(float, out *(size_t)psf->nbasis)) == NULL)
        return rx_error_memory(err, out * (size_t)psf->nbasis * sizeof *made);
    for (int b = 0; b < psf->nbasis && status == RX_OK; b++)
        status = rx_deblur_relative(psf->basis + area * (size_t)b, psf->size, target_fwhm, *size, 0,
                                    made + out * (size_t)b, err);
    if (status == RX_OK)
        status = normalise(made, psf->nbasis, out, err);
    if (status == RX_OK)
        *stamps = made;
    else
        free(made);
    return status;
}

/* Scratch of the filters. */
typedef struct maker {
    rx_fft *fft;
    float *stamp, *plane, *spectrum;
} maker;

static rx_status maker_new(const rx_psf *psf, maker *dst, rx_error *err)
{
    const int side = rx_fft_good_size(psf->size > FILTER_DOMAIN ? psf->size : FILTER_DOMAIN);
    RX_TRY(rx_fft_new(side, side, 1, &dst->fft, err));
    dst->stamp = RX_NEW(float, (size_t)psf->size *(size_t)psf->size);
    dst->plane = rx_fft_real(dst->fft);
    dst->spectrum = rx_fft_complex(dst->fft);
    return dst->stamp == NULL || dst->plane == NULL || dst->spectrum == NULL ? rx_error_memory(err, 0)
                                                                             : RX_OK;
}

/* out [side][side] from the PSF in m->stamp */
static rx_status make_filter(maker *m, int size, const rx_tikhonov *filter, float *out, rx_error *err)
{
    const int n = rx_fft_width(m->fft), r = RX_TIKHONOV_REACH;
    const size_t stride = (size_t)rx_fft_stride_real(m->fft);
    RX_TRY(rx_deblur_tikhonov(m->fft, m->stamp, size, filter, m->spectrum, err));
    rx_fft_inverse(m->fft, m->spectrum, m->plane);
    for (int v = -r; v <= r; v++)
        for (int u = -r; u <= r; u++)
            *out++ = m->plane[(size_t)((v + n) % n) * stride + (size_t)((u + n) % n)];
    return RX_OK;
}

static int count_nodes(const rx_psf *psf, int length, double *step)
{
    int n = (length - 1 + NODE_STEP - 1) / NODE_STEP + 1;
    if (n < NODES_LEAST)
        n = NODES_LEAST;
    if (!rx_psf_varies(psf) || length < 2)
        n = 1;
    *step = n > 1 ? (length - 1.0) / (n - 1) : length;
    return n;
}

/* FWHM as psf->fwhm counts it, in the ratio of the stamps' own, here and at the centre. */
static double node_fwhm(const rx_psf *psf, double here, double centre)
{
    if (!(psf->fwhm > 0))
        return here;
    return here > 0 && centre > 0 ? psf->fwhm * here / centre : psf->fwhm;
}

rx_status rx_otf_grid_make(const rx_psf *psf, int width, int height, const rx_tikhonov *filter,
                           rx_otf_grid *dst, rx_error *err)
{
    const int side = 2 * RX_TIKHONOV_REACH + 1, filters = filter->epsilon > 0;
    maker m = {0};
    *dst = (rx_otf_grid){.width = width, .height = height};
    dst->nx = count_nodes(psf, width, &dst->step_x);
    dst->ny = count_nodes(psf, height, &dst->step_y);
    const size_t n = (size_t)dst->nx * (size_t)dst->ny, area = (size_t)side * (size_t)side;
    dst->fwhm = RX_NEW(float, n);
    dst->filters = filters ? RX_NEW(float, n *area) : NULL;
    rx_status status;
    RX_TRY_EXIT(maker_new(psf, &m, err));
    if ((dst->fwhm == NULL || (filters && dst->filters == NULL)))
        RX_TRY_EXIT(rx_error_memory(err, n * area * sizeof(float)));
    rx_psf_at(psf, 0.5 * (width - 1), 0.5 * (height - 1), m.stamp);
    double centre, here;
    status = rx_stamp_fwhm(m.stamp, psf->size, &centre, NULL, err);
    for (size_t k = 0; k < n && status == RX_OK; k++) {
        const double x = (double)(k % (size_t)dst->nx) * dst->step_x,
                     y = (double)(k / (size_t)dst->nx) * dst->step_y;
        if (rx_psf_varies(psf))
            rx_psf_at(psf, dst->nx > 1 ? x : 0.5 * (width - 1), dst->ny > 1 ? y : 0.5 * (height - 1),
                      m.stamp);
        if ((status = rx_stamp_fwhm(m.stamp, psf->size, &here, NULL, err)) != RX_OK)
            break;
        dst->fwhm[k] = (float)node_fwhm(psf, here, centre);
        if (!isfinite(dst->fwhm[k]))
            status = rx_error_set(err, RX_INPUT, "the PSF has no peak; give one with a positive centre");
        else if (filters)
            status = make_filter(&m, psf->size, filter, dst->filters + k * area, err);
    }
exit:
    free(m.stamp);
    free(m.plane);
    free(m.spectrum);
    rx_fft_free(m.fft);
    return status;
}

void rx_otf_grid_clear(rx_otf_grid *grid)
{
    free(grid->filters);
    free(grid->fwhm);
}

static int clamp(int i, int n)
{
    return i < 0 ? 0 : i < n ? i : n - 1;
}

void rx_otf_fwhm_row(const rx_otf_grid *grid, int y, int x, int n, float *dst)
{
    const double v = clamp(y, grid->height) / grid->step_y;
    const int j = clamp((int)floor(v), grid->ny > 1 ? grid->ny - 1 : 1);
    const double fy = grid->ny > 1 ? v - j : 0;
    const float *low = grid->fwhm + (size_t)j * grid->nx, *high = grid->ny > 1 ? low + grid->nx : low;
    if (grid->nx == 1) {
        const float value = (float)(low[0] + fy * ((double)high[0] - low[0]));
        for (int k = 0; k < n; k++)
            dst[k] = value;
        return;
    }
    for (int k = 0; k < n; k++) {
        const double u = clamp(x + k, grid->width) / grid->step_x;
        const int i = clamp((int)u, grid->nx - 1);
        const double fx = u - i;
        const double a = low[i] + fx * (low[i + 1] - low[i]), b = high[i] + fx * (high[i + 1] - high[i]);
        dst[k] = (float)(a + fy * (b - a));
    }
}
