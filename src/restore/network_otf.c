/* Spectra, coefficients and filters of the PSF around the network. */
#include "restore/network_otf.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "nn/deblur.h"
#include "num/convolve.h"
#include "restore/network_rows.h"
#include "restore/stamp.h"

enum {
    NODE_STEP = 512,       /* pixels between nodes at most */
    NODES_LEAST = 5,       /* in each direction, for a PSF that varies */
    FILTER_DOMAIN = 256,   /* where Tikhonov filters are made: far more than they reach */
    RELATIVE_LARGEST = 129 /* side of a relative PSF, pixels */
};
static const double NEGLIGIBLE = 1e-6;

int rx_otf_varies(const rx_psf *psf)
{
    return psf->nbasis > 1 || psf->px[0] != 0 || psf->py[0] != 0;
}

static double power(double base, int exponent)
{
    double product = 1;
    for (int i = 0; i < exponent; i++)
        product *= base;
    return product;
}

static double largest(const float *values, size_t n)
{
    double most = 0;
    for (size_t i = 0; i < n; i++)
        most = fmax(most, fabs(values[i]));
    return most;
}

/* A stamp around the origin of a cyclic plane. */
typedef struct stamp_rows {
    const float *stamp;
    int size, width, height;
    double scale;
} stamp_rows;

static int read_stamp(void *user, int y, float *line)
{
    const stamp_rows *s = user;
    const int centre = s->size / 2, j = (y + centre) % s->height;
    if (j >= s->size)
        return 0;
    memset(line, 0, (size_t)s->width * sizeof *line);
    for (int i = 0; i < s->size; i++)
        line[(i - centre + s->width) % s->width] =
            (float)(s->stamp[(size_t)j * (size_t)s->size + (size_t)i] * s->scale);
    return 1;
}

void rx_otf_spectrum(const rx_fft *fft, const float *stamp, int size, float *spectrum)
{
    const int w = rx_fft_width(fft), h = rx_fft_height(fft);
    stamp_rows rows = {stamp, size, w, h, 1.0 / ((double)w * h)};
    rx_fft_forward_rows(fft, read_stamp, &rows, spectrum);
}

static rx_status add_term(const rx_fft *fft, const rx_network_optics *optics, int basis, const float *stamp,
                          int size, rx_otf *dst, rx_error *err)
{
    const rx_psf *psf = optics->psf;
    const int width = optics->width, height = optics->height;
    const int i = dst->n++;
    float *spectrum = dst->spectrum[i] = rx_fft_complex(fft);
    float *cx = dst->cx[i] = RX_NEW(float, (size_t)width), *cy = dst->cy[i] = RX_NEW(float, (size_t)height);
    if (spectrum == NULL || cx == NULL || cy == NULL)
        return rx_error_memory(err, 0);
    for (int x = 0; x < width; x++)
        cx[x] = (float)power((x - psf->x0) / psf->xs, psf->px[basis]);
    for (int y = 0; y < height; y++)
        cy[y] = (float)power((y - psf->y0) / psf->ys, psf->py[basis]);
    rx_otf_spectrum(fft, stamp, size, spectrum);
    return RX_OK;
}

rx_status rx_otf_new(const rx_fft *fft, const rx_network_optics *optics, const float *stamps, int size,
                     rx_otf *dst, rx_error *err)
{
    const rx_psf *psf = optics->psf;
    const size_t n = (size_t)size * (size_t)size;
    const double peak = largest(stamps, n);
    rx_status status = RX_OK;
    *dst = (rx_otf){.radius = size / 2, .varies = rx_otf_varies(psf)};
    if (!dst->varies) {
        dst->inside = RX_NEW(double, (size_t)(size + 1) * (size_t)(size + 1));
        if (dst->inside == NULL)
            return rx_error_memory(err, (size_t)(size + 1) * (size_t)(size + 1) * sizeof(double));
        rx_rows_inside(stamps, size / 2, dst->inside);
    }
    for (int b = 0; b < psf->nbasis && status == RX_OK; b++) {
        const float *stamp = stamps + n * (size_t)b;
        const double x = fmax(fabs(psf->x0), fabs(optics->width - 1 - psf->x0)) / psf->xs,
                     y = fmax(fabs(psf->y0), fabs(optics->height - 1 - psf->y0)) / psf->ys;
        const double most = fabs(power(x, psf->px[b]) * power(y, psf->py[b])) * largest(stamp, n);
        if (b == 0 || most > NEGLIGIBLE * peak)
            status = add_term(fft, optics, b, stamp, size, dst, err);
    }
    return status;
}

void rx_otf_free(rx_otf *otf)
{
    free(otf->inside);
    for (int i = 0; i < otf->n; i++) {
        free(otf->spectrum[i]);
        free(otf->cx[i]);
        free(otf->cy[i]);
    }
}

/* Side that the relative PSF needs at the centre and at the corners of the tile. */
static rx_status relative_size(const rx_psf *psf, double target_fwhm, int width, int height, float *stamp,
                               int *size, rx_error *err)
{
    const double places[][2] = {{0.5, 0.5}, {0, 0}, {1, 0}, {0, 1}, {1, 1}};
    rx_status status = RX_OK;
    *size = 1;
    for (int i = 0; i < (rx_otf_varies(psf) ? 5 : 1) && status == RX_OK; i++) {
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
    rx_status status = rx_fft_new(side, side, 1, &dst->fft, err);
    if (status != RX_OK)
        return status;
    dst->stamp = RX_NEW(float, (size_t)psf->size *(size_t)psf->size);
    dst->plane = rx_fft_real(dst->fft);
    dst->spectrum = rx_fft_complex(dst->fft);
    return dst->stamp == NULL || dst->plane == NULL || dst->spectrum == NULL ? rx_error_memory(err, 0)
                                                                             : RX_OK;
}

static void maker_free(maker *m)
{
    free(m->stamp);
    free(m->plane);
    free(m->spectrum);
    rx_fft_free(m->fft);
}

/* filter [side][side] from the PSF in m->stamp */
static rx_status make_filter(maker *m, int size, double target_fwhm, double epsilon, float *filter,
                             rx_error *err)
{
    const int n = rx_fft_width(m->fft), r = RX_TIKHONOV_REACH;
    const size_t stride = (size_t)rx_fft_stride_real(m->fft);
    rx_status status =
        rx_deblur_tikhonov(m->fft, m->stamp, size, target_fwhm, epsilon, m->plane, m->spectrum, err);
    if (status != RX_OK)
        return status;
    rx_fft_inverse(m->fft, m->spectrum, m->plane);
    for (int v = -r; v <= r; v++)
        for (int u = -r; u <= r; u++)
            *filter++ = m->plane[(size_t)((v + n) % n) * stride + (size_t)((u + n) % n)];
    return RX_OK;
}

static int count_nodes(const rx_psf *psf, int length, double *step)
{
    int n = (length - 1 + NODE_STEP - 1) / NODE_STEP + 1;
    if (n < NODES_LEAST)
        n = NODES_LEAST;
    if (!rx_otf_varies(psf) || length < 2)
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

rx_status rx_network_optics_nodes(rx_network_optics *optics, double epsilon, rx_error *err)
{
    const rx_psf *psf = optics->psf;
    const int side = 2 * RX_TIKHONOV_REACH + 1;
    maker m = {0};
    optics->nx = count_nodes(psf, optics->width, &optics->step_x);
    optics->ny = count_nodes(psf, optics->height, &optics->step_y);
    const size_t n = (size_t)optics->nx * (size_t)optics->ny, area = (size_t)side * (size_t)side;
    optics->fwhm = RX_NEW(float, n);
    optics->filters = epsilon > 0 ? RX_NEW(float, n *area) : NULL;
    rx_status status = maker_new(psf, &m, err);
    if (status == RX_OK && (optics->fwhm == NULL || (epsilon > 0 && optics->filters == NULL)))
        status = rx_error_memory(err, n * area * sizeof(float));
    if (status != RX_OK)
        goto exit;
    rx_psf_at(psf, 0.5 * (optics->width - 1), 0.5 * (optics->height - 1), m.stamp);
    double centre, here;
    status = rx_stamp_fwhm(m.stamp, psf->size, &centre, NULL, err);
    for (size_t k = 0; k < n && status == RX_OK; k++) {
        const double x = (double)(k % (size_t)optics->nx) * optics->step_x,
                     y = (double)(k / (size_t)optics->nx) * optics->step_y;
        if (rx_otf_varies(psf))
            rx_psf_at(psf, optics->nx > 1 ? x : 0.5 * (optics->width - 1),
                      optics->ny > 1 ? y : 0.5 * (optics->height - 1), m.stamp);
        if ((status = rx_stamp_fwhm(m.stamp, psf->size, &here, NULL, err)) != RX_OK)
            break;
        optics->fwhm[k] = (float)node_fwhm(psf, here, centre);
        if (!isfinite(optics->fwhm[k]))
            status = rx_error_set(err, RX_INPUT, "the PSF has no peak; give one with a positive centre");
        else if (optics->filters != NULL)
            status =
                make_filter(&m, psf->size, optics->target_fwhm, epsilon, optics->filters + k * area, err);
    }
exit:
    maker_free(&m);
    return status;
}

void rx_network_optics_fwhm_row(const rx_network_optics *optics, int y, int x, int n, float *dst)
{
    const double v = rx_otf_clamp(y, optics->height) / optics->step_y;
    const int j = rx_otf_clamp((int)floor(v), optics->ny > 1 ? optics->ny - 1 : 1);
    const double fy = optics->ny > 1 ? v - j : 0;
    const float *low = optics->fwhm + (size_t)j * optics->nx, *high = optics->ny > 1 ? low + optics->nx : low;
    if (optics->nx == 1) {
        const float value = (float)(low[0] + fy * ((double)high[0] - low[0]));
        for (int k = 0; k < n; k++)
            dst[k] = value;
        return;
    }
    for (int k = 0; k < n; k++) {
        const double u = rx_otf_clamp(x + k, optics->width) / optics->step_x;
        const int i = rx_otf_clamp((int)u, optics->nx - 1);
        const double fx = u - i;
        const double a = low[i] + fx * (low[i + 1] - low[i]), b = high[i] + fx * (high[i + 1] - high[i]);
        dst[k] = (float)(a + fy * (b - a));
    }
}
