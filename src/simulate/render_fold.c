/* Spectrum of the cells times spectrum of the optics, at the pixels.
 *
 * Reading a function at every cells-th cell adds up all frequencies of its spectrum that differ by a multiple
 * of the number of pixels. So the product is folded in Fourier space, and the inverse transform is one of the
 * pixels. Optics are known up to their own Nyquist frequency; what is beyond is 0. */
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "num/convolve.h"
#include "simulate/render_parts.h"

#define KEEP_BYTES ((size_t)1 << 28)

struct rx_kernels {
    int n, width, height;
    const rx_optics *const *optics;
    rx_fft **ffts;   /* [n] */
    float ***planes; /* [n][nbasis]: kept spectra, NULL = not (yet) kept */
    float **scratch; /* [n]: the spectrum of an image that is not kept */
    size_t left;     /* bytes that may still be kept */
};

void rx_kernels_free(rx_kernels *k)
{
    if (k == NULL)
        return;
    for (int i = 0; i < k->n; i++) {
        if (k->ffts != NULL)
            rx_fft_free(k->ffts[i]);
        for (int b = 0; k->planes != NULL && k->planes[i] != NULL && b < k->optics[i]->nbasis; b++)
            free(k->planes[i][b]);
        if (k->planes != NULL)
            free(k->planes[i]);
        if (k->scratch != NULL)
            free(k->scratch[i]);
    }
    free(k->ffts);
    free(k->planes);
    free(k->scratch);
    free(k);
}

rx_status rx_kernels_new(int n, const rx_optics *const *optics, int width, int height, int keep, int nthreads,
                         rx_kernels **dst, rx_error *err)
{
    rx_kernels *k = RX_NEW(rx_kernels, 1);
    rx_status status = RX_OK;
    *dst = NULL;
    if (k == NULL)
        return rx_error_memory(err, sizeof *k);
    *k = (rx_kernels){
        .n = n, .width = width, .height = height, .optics = optics, .left = keep ? KEEP_BYTES : 0};
    k->ffts = RX_NEW(rx_fft *, (size_t)n);
    k->planes = RX_NEW(float **, (size_t)n);
    k->scratch = RX_NEW(float *, (size_t)n);
    if (k->ffts == NULL || k->planes == NULL || k->scratch == NULL)
        status = rx_error_memory(err, 0);
    for (int i = 0; i < n && status == RX_OK; i++) {
        int cells = optics[i]->oversampling;
        status = rx_fft_new(cells * width, cells * height, nthreads, &k->ffts[i], err);
        if (status != RX_OK)
            break;
        k->planes[i] = RX_NEW(float *, (size_t)optics[i]->nbasis);
        k->scratch[i] = rx_fft_complex(k->ffts[i]);
        if (k->planes[i] == NULL || k->scratch[i] == NULL)
            status = rx_error_memory(err, 0);
    }
    if (status == RX_OK)
        *dst = k;
    else
        rx_kernels_free(k);
    return status;
}

int rx_kernels_columns(const rx_kernels *k, int i)
{
    return k->optics[i]->oversampling * k->width / 2 + 1;
}

static const float *find_spectrum(rx_kernels *k, int i, int image)
{
    const rx_optics *o = k->optics[i];
    const rx_fft *fft = k->ffts[i];
    const float *stamp = o->basis + (size_t)image * (size_t)o->size * (size_t)o->size;
    if (k->planes[i][image] != NULL)
        return k->planes[i][image];
    size_t bytes = rx_fft_complex_size(fft) * sizeof(float);
    float *plane = bytes <= k->left ? rx_fft_complex(fft) : NULL;
    if (plane != NULL) {
        k->planes[i][image] = plane;
        k->left -= bytes;
    } else
        plane = k->scratch[i];
    rx_convolve_spectrum(fft, stamp, o->size, plane);
    return plane;
}

/* A column of frequencies kx, of two spectra: ky = 0 .. at the beginning, ky < 0 at the end. */
typedef struct column {
    const float *fine, *kernel;
    int fine_rows, rows;
    float weight; /* 1/2 at the Nyquist frequency of the optics, which stands for both signs */
} column;

/* out[v] += product at frequency ky, and at the next n - 1; v is ky modulo height. */
static void add_direct(const column *c, int ky, int n, float weight, int height, float *out)
{
    const float w = weight * c->weight;
    for (int v = (ky % height + height) % height, m; n > 0; ky += m, n -= m, v = 0) {
        const float *f = c->fine + 2 * (size_t)(ky < 0 ? ky + c->fine_rows : ky);
        const float *k = c->kernel + 2 * (size_t)(ky < 0 ? ky + c->rows : ky);
        float *o = out + 2 * (size_t)v;
        m = n < height - v ? n : height - v;
#pragma omp simd
        for (int i = 0; i < m; i++) {
            o[2 * i] += w * (f[2 * i] * k[2 * i] - f[2 * i + 1] * k[2 * i + 1]);
            o[2 * i + 1] += w * (f[2 * i] * k[2 * i + 1] + f[2 * i + 1] * k[2 * i]);
        }
    }
}

/* The same of (-kx, -ky), which the half spectra do not hold: its complex conjugate at (kx, ky) does. */
static void add_mirrored(const column *c, int ky, int n, float weight, int height, float *out)
{
    const float w = weight * c->weight;
    for (int v = (height - ky % height) % height, m; n > 0; ky += m, n -= m, v = height - 1) {
        const float *f = c->fine + 2 * (size_t)(ky < 0 ? ky + c->fine_rows : ky);
        const float *k = c->kernel + 2 * (size_t)(ky < 0 ? ky + c->rows : ky);
        float *o = out + 2 * (size_t)v;
        m = n < v + 1 ? n : v + 1;
#pragma omp simd
        for (int i = 0; i < m; i++) {
            o[-2 * i] += w * (f[2 * i] * k[2 * i] - f[2 * i + 1] * k[2 * i + 1]);
            o[-2 * i + 1] -= w * (f[2 * i] * k[2 * i + 1] + f[2 * i + 1] * k[2 * i]);
        }
    }
}

/* out[0 .. height - 1] += all frequencies ky of the column that fold onto them. */
static void fold_column(const column *c, int mirrored, int height, float *out)
{
    const int top = c->rows / 2;
    void (*add)(const column *, int, int, float, int, float *) = mirrored ? add_mirrored : add_direct;
    add(c, -top, 1, 0.5f, height, out);
    add(c, -top + 1, top - 1, 1, height, out);
    add(c, 0, top, 1, height, out);
    add(c, top, 1, 0.5f, height, out);
}

void rx_kernels_fold(rx_kernels *kernels, int i, int image, const rx_fft *fine, const float *spectrum,
                     const rx_fft *native, float *half)
{
    const float *kernel = find_spectrum(kernels, i, image);
    const rx_fft *fft = kernels->ffts[i];
    const int width = kernels->width, last = rx_fft_width(fft) / 2;
    const size_t sf = 2 * (size_t)rx_fft_stride_complex(fine), sk = 2 * (size_t)rx_fft_stride_complex(fft),
                 sn = 2 * (size_t)rx_fft_stride_complex(native);
#pragma omp parallel for schedule(static) num_threads(rx_fft_threads(native))
    for (int u = 0; u <= width / 2; u++) {
        column c = {.fine_rows = rx_fft_height(fine), .rows = rx_fft_height(fft)};
        for (int first = 0; first - u <= last; first += width)
            for (int mirrored = 0; mirrored < 2; mirrored++) {
                const int kx = mirrored ? first - u : first + u;
                if (kx > last || (mirrored && first == 0))
                    continue;
                c.fine = spectrum + sf * (size_t)kx;
                c.kernel = kernel + sk * (size_t)kx;
                c.weight = kx == last ? 0.5f : 1.0f;
                fold_column(&c, mirrored, kernels->height, half + sn * (size_t)u);
            }
    }
}
