/* Rendering behind a PSF, by Fourier transforms on small domains. */
#include "template/template_otf.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "num/convolve.h"

/* The kernel's regularisation, see num/convolve.h. What it divides is light that has been through the
 * restored PSF, so that little is to be kept from growing: smaller than in nn/deblur.h. */
static const double DELTA = 1e-5;

enum { PLANES = 5, MARGIN = 4 };

static int same_psf(const rx_psf *a, const rx_psf *b)
{
    const size_t n = (size_t)a->nbasis * (size_t)a->size * (size_t)a->size;
    return a->size == b->size && a->nbasis == b->nbasis && a->x0 == b->x0 && a->y0 == b->y0 &&
           a->xs == b->xs && a->ys == b->ys && memcmp(a->px, b->px, sizeof a->px) == 0 &&
           memcmp(a->py, b->py, sizeof a->py) == 0 && memcmp(a->basis, b->basis, n * sizeof(float)) == 0;
}

/* Where the tile's PSF is known on m samples a pixel, a plane has m^2 spectra of it: pieces [b][a], those of the
 * frequencies (u + a n, v + b n) of m n, signed as these are. Shifted and multiplied each by itself, their sum is what
 * the pixels have, exactly, however little they sample the PSF. */
struct rx_matching {
    float *restored, *kernel; /* spectra of the restored image's PSF and of the kernel */
    int made;                 /* at the domain's place */
};

typedef struct domain {
    rx_template_domain size; /* first: rx_template_domain_matching() is handed this part */
    const rx_template_otf *otf;
    int made; /* size.optics, at (x, y) where PSFs vary */
    double x, y;
    rx_matching matching;
    rx_fft *fine; /* of side m n, with its planes; NULL for m = 1 */
    float *fine_half;
} domain;

/* Where a PSF does not vary points are put between pixels by a polynomial: the PSF at Chebyshev's nodes of a pixel in x and
 * y, of which a point anywhere is the sum with Lagrange's weights. Within 1e-7 of the peak of what the spectrum gives for
 * FWHM 4, 1e-6 for 2. */
enum { NODES = 7, LANES = 8, WIDEST = 67 }; /* pixels of the PSF's middle that are kept so, at most */

struct rx_template_otf {
    const rx_psf *tile, *image;
    int same; /* they are the same PSF: the kernel is a point */
    int varies;
    int ndomains;
    domain *domains;
    float *points; /* [reach][NODES][NODES][reach], NULL until it is made: row, nodes in y and x, column */
    int reach;
    float *stamp;
    float *
        most; /* [size / 2 + 2] of the tile's PSF in its middle: the largest value that many pixels away in x or y, or farther */
};

/* Fills otf->most. */
static void find_reach(rx_template_otf *otf)
{
    const rx_psf *psf = otf->tile;
    const int half = psf->size / 2;
    rx_psf_at(psf, psf->x0, psf->y0, otf->stamp);
    for (int v = -half; v <= half; v++)
        for (int u = -half; u <= half; u++) {
            const int away = abs(u) > abs(v) ? abs(u) : abs(v);
            otf->most[away] = fmaxf(otf->most[away], fabsf(otf->stamp[(v + half) * psf->size + u + half]));
        }
    for (int r = half - 1; r >= 0; r--)
        otf->most[r] = fmaxf(otf->most[r], otf->most[r + 1]);
}

rx_status rx_template_otf_new(const rx_psf *tile, const rx_psf *image, rx_template_otf **dst, rx_error *err)
{
    rx_template_otf *otf = RX_NEW(rx_template_otf, 1);
    *dst = otf;
    if (otf == NULL)
        return rx_error_memory(err, sizeof *otf);
    *otf = (rx_template_otf){.tile = tile, .image = image != NULL ? image : tile};
    otf->same = image == NULL || same_psf(tile, image);
    otf->varies = tile->nbasis > 1 || otf->image->nbasis > 1;
    const int tile_side = rx_psf_fine_side(tile);
    const size_t side = (size_t)(tile_side > otf->image->size ? tile_side : otf->image->size);
    otf->stamp = RX_NEW(float, side *side);
    otf->most = RX_NEW(float, tile->size / 2 + 2);
    if (otf->stamp != NULL && otf->most != NULL) {
        find_reach(otf);
        return RX_OK;
    }
    free(otf->stamp);
    free(otf->most);
    free(otf);
    *dst = NULL;
    return rx_error_memory(err, side * side * sizeof(float));
}

static void clear_domain(domain *d)
{
    rx_fft_free(d->size.fft);
    rx_fft_free(d->fine);
    free(d->fine_half);
    free(d->size.optics);
    free(d->matching.restored);
    free(d->matching.kernel);
    free(d->size.phase);
    free(d->size.column);
    for (int i = 0; i < PLANES; i++) {
        free(d->size.half[i]);
        free(d->size.plane[i]);
    }
}

void rx_template_otf_free(rx_template_otf *otf)
{
    if (otf == NULL)
        return;
    for (int i = 0; i < otf->ndomains; i++)
        clear_domain(&otf->domains[i]);
    free(otf->domains);
    free(otf->points);
    free(otf->stamp);
    free(otf->most);
    free(otf);
}

static const double FAINTEST = 1e-3; /* of the peak: nothing above that is left out */

/* Side of the PSF's part that is above `level`, at least what the pixels around a point are fitted with. */
static int part_above(const rx_template_otf *otf, double level)
{
    const rx_psf *psf = otf->tile;
    int half = (int)ceil(2.0 * fmax(psf->fwhm, 1.0)) + 4;
    while (half < psf->size / 2 && (double)otf->most[half + 1] > fmin(level, FAINTEST * (double)otf->most[0]))
        half++;
    return half < psf->size / 2 ? 2 * half + 1 : psf->size;
}

int rx_template_otf_side(const rx_template_otf *otf, double reach, double level, int half)
{
    /* those whose transforms take least time: of small prime factors, 2 above all, and n/2 + 1 not far below a multiple of the
     * columns that num/fft.c takes at once */
    static const int sides[] = {32,  40,  44,  48,  56,  64,  72,  80,  96,
                                120, 144, 160, 192, 240, 256, 320, 400, 512};
    const int whole = otf->tile->size > otf->image->size ? otf->tile->size : otf->image->size;
    const int part = level > 0 ? part_above(otf, level) : whole, far = (int)ceil(fmin(reach, 200.0));
    int need = part + MARGIN + 2 * far;
    if (half >
        0) /* light that is as far away as it reaches may come back at the other end, beyond the pixels that are read */
        need = rx_min_int(need, rx_max_int(half + far + MARGIN + rx_min_int(half + far, part / 2 + 1),
                                           2 * (half + MARGIN)));
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++)
        if (sides[i] >= need)
            return sides[i];
    return rx_fft_good_size(need);
}

static rx_status open_domain(const rx_template_otf *otf, int n, domain *d, rx_error *err)
{
    rx_template_domain *size = &d->size;
    const int m = rx_psf_fine(otf->tile);
    *d = (domain){.size = {.n = n}, .otf = otf};
    rx_status status = rx_fft_new(n, n, 1, &size->fft, err);
    if (status == RX_OK && m > 1)
        status = rx_fft_new(m * n, m * n, 1, &d->fine, err);
    if (status != RX_OK) {
        rx_fft_free(size->fft);
        return status;
    }
    size->optics =
        m > 1 ? RX_NEW(float, (size_t)(m * m) * rx_fft_complex_size(size->fft)) : rx_fft_complex(size->fft);
    if (m > 1) {
        d->fine_half = rx_fft_complex(d->fine);
    }
    d->matching.restored = rx_fft_complex(size->fft);
    d->matching.kernel = rx_fft_complex(size->fft);
    size->phase = RX_NEW(double, 2 * m * n + 2);
    size->column = RX_NEW(float, (PLANES + 2 + 2 * m) * n);
    int missing = size->optics == NULL || d->matching.restored == NULL || d->matching.kernel == NULL ||
                  size->phase == NULL || size->column == NULL || (m > 1 && d->fine_half == NULL);
    for (int i = 0; i < PLANES; i++) {
        size->half[i] = rx_fft_complex(size->fft);
        size->plane[i] = rx_fft_real(size->fft);
        missing = missing || size->half[i] == NULL || size->plane[i] == NULL;
    }
    if (missing) {
        clear_domain(d);
        return rx_error_memory(err, (size_t)n * (size_t)n * 13 * sizeof(float));
    }
    return RX_OK;
}

static rx_status find_domain(rx_template_otf *otf, int n, domain **dst, rx_error *err)
{
    for (int i = 0; i < otf->ndomains; i++)
        if (otf->domains[i].size.n == n) {
            *dst = &otf->domains[i];
            return RX_OK;
        }
    domain *more = rx_regrow(otf->domains, (size_t)otf->ndomains + 1, sizeof *more);
    if (more == NULL)
        return rx_error_memory(err, sizeof *more);
    otf->domains = more;
    rx_status status = open_domain(otf, n, &more[otf->ndomains], err);
    if (status == RX_OK)
        *dst = &more[otf->ndomains++];
    return status;
}

/* A frequency u of `whole`, as it is signed. */
static int signed_frequency(int u, int whole)
{
    return u <= whole / 2 ? u : u - whole;
}

/* The pieces of the spectrum of the tile's PSF from that of its samples. */
static void cut_pieces(domain *d, int m)
{
    const int n = d->size.n, whole = m * n;
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(d->size.fft),
                 from = 2 * (size_t)rx_fft_stride_complex(d->fine);
    for (int piece = 0; piece < m * m; piece++)
        for (int u = 0; u <= n / 2; u++) {
            const int x = signed_frequency(u + piece % m * n, whole);
            const float *src = d->fine_half + (size_t)abs(x) * from;
            float *dst =
                d->size.optics + (size_t)piece * rx_fft_complex_size(d->size.fft) + (size_t)u * stride;
            for (int v = 0; v < n; v++) {
                const int y = v + piece / m * n, at = x < 0 && y > 0 ? whole - y : y;
                dst[2 * v] = src[2 * at];
                dst[2 * v + 1] = x < 0 ? -src[2 * at + 1] : src[2 * at + 1];
            }
        }
}

/* As much of the middle of a stamp as fits into a domain of side n, m samples a pixel: its side. */
static int cut_stamp(float *stamp, int side, int n, int m)
{
    const int most = m * ((n - MARGIN - 1) / 2 * 2) + 1, to = side < most ? side : most,
              from = (side - to) / 2;
    for (int y = 0; y < to && to < side; y++)
        memmove(stamp + (size_t)y * (size_t)to, stamp + (size_t)(y + from) * (size_t)side + from,
                (size_t)to * sizeof *stamp);
    return to;
}

/* cos(pi (i + 1/2) / NODES) / 2 */
static const double nodes[NODES] = {0.48746395609091181,  0.39091574123401496,  0.21694186955877906, 0,
                                    -0.21694186955877906, -0.39091574123401496, -0.48746395609091181};

/* Lagrange's weights of the nodes at x. */
static void weigh_nodes(double x, double *weight)
{
    for (int i = 0; i < NODES; i++) {
        weight[i] = 1;
        for (int k = 0; k < NODES; k++)
            weight[i] *= k != i ? (x - nodes[k]) / (nodes[i] - nodes[k]) : 1;
    }
}

static rx_status make_points(rx_template_otf *otf, rx_error *err)
{
    const int whole = otf->tile->size <= WIDEST;
    const int side = (whole ? otf->tile->size : WIDEST) + 2; /* so far a shift of half a pixel reaches */
    const int n = whole ? rx_template_otf_side(otf, 0, 0, 0) : rx_fft_good_size(2 * side);
    const size_t room = (size_t)NODES * NODES * (size_t)side * (size_t)side;
    rx_template_domain *size;
    RX_TRY(rx_template_otf_at(otf, n, 0, 0, &size, err));
    float *points = rx_alloc(room + LANES, sizeof *points); /* rows are added up to whole vectors */
    if (points == NULL)
        return rx_error_memory(err, room * sizeof *points);
    for (int j = 0; j < NODES; j++)
        for (int i = 0; i < NODES; i++) {
            rx_template_domain_render(size, NULL, nodes[i], nodes[j], NULL, 1);
            for (int v = 0; v < side; v++)
                memcpy(points + ((v * NODES + j) * NODES + i) * side,
                       size->plane[0] + (size->n / 2 - side / 2 + v) * rx_fft_stride_real(size->fft) +
                           size->n / 2 - side / 2,
                       (size_t)side * sizeof *points);
        }
    otf->points = points;
    otf->reach = side;
    return RX_OK;
}

/* line [count, rounded up to LANES] = sum of weight[i] rows[i], NODES^2 rows of `stride`. */
RX_SIMD static void add_rows(const float *rows, size_t stride, const float *weight, int count, float *line)
{
    memset(line, 0, (size_t)(count + LANES) * sizeof *line);
    for (int j = 0; j < NODES; j++) {
        const float *r = rows + (size_t)(j * NODES) * stride, *w = weight + j * NODES;
        for (int x = 0; x < count; x += LANES)
#pragma omp simd
            for (int l = x; l < x + LANES; l++)
                line[l] += w[0] * r[l] + w[1] * r[l + stride] + w[2] * r[l + 2 * stride] +
                           w[3] * r[l + 3 * stride] + w[4] * r[l + 4 * stride] + w[5] * r[l + 5 * stride] +
                           w[6] * r[l + 6 * stride];
    }
}

/* A point (dx, dy) off the middle; 0: the part of the PSF that is kept does not hold all of it. */
static int put_point(rx_template_domain *size, double dx, double dy)
{
    const rx_template_otf *otf = ((const domain *)size)->otf;
    const int reach = otf->reach, stride = rx_fft_stride_real(size->fft);
    const int x0 = size->n / 2 + (int)lround(dx) - reach / 2, y0 = size->n / 2 + (int)lround(dy) - reach / 2;
    const int first = rx_max_int(size->first, x0), last = rx_min_int(size->last, x0 + reach);
    double along[NODES], across[NODES];
    float weight[NODES * NODES];
    if (reach < otf->tile->size &&
        (x0 > size->first || x0 + reach < size->last || y0 > size->first || y0 + reach < size->last))
        return 0;
    weigh_nodes(dx - (double)lround(dx), along);
    weigh_nodes(dy - (double)lround(dy), across);
    for (int j = 0; j < NODES; j++)
        for (int i = 0; i < NODES; i++)
            weight[j * NODES + i] = (float)(across[j] * along[i]);
    for (int y = size->first; y < size->last; y++) {
        float *row = size->plane[0] + (ptrdiff_t)y * stride;
        memset(row + size->first, 0, (size_t)(size->last - size->first) * sizeof *row);
        if (y < y0 || y >= y0 + reach || first >= last)
            continue;
        add_rows(otf->points + (ptrdiff_t)(y - y0) * NODES * NODES * reach + (first - x0), (size_t)reach,
                 weight, last - first, size->column);
        memcpy(row + first, size->column, (size_t)(last - first) * sizeof *row);
    }
    return 1;
}

rx_status rx_template_otf_at(rx_template_otf *otf, int n, double x, double y, rx_template_domain **dst,
                             rx_error *err)
{
    domain *d = NULL;
    if (!otf->varies && rx_psf_fine(otf->tile) == 1 && otf->reach == 0) {
        otf->reach = -1; /* it is on its way */
        RX_TRY(make_points(otf, err));
    }
    rx_status status = find_domain(otf, n, &d, err);
    if (status != RX_OK)
        return status;
    if (otf->varies && (x != d->x || y != d->y))
        d->made = d->matching.made = 0;
    d->x = x;
    d->y = y;
    if (!d->made) {
        const int m = rx_psf_fine(otf->tile);
        rx_psf_fine_at(otf->tile, x, y, otf->stamp);
        const int side = cut_stamp(otf->stamp, rx_psf_fine_side(otf->tile), n, m);
        rx_convolve_spectrum(m > 1 ? d->fine : d->size.fft, otf->stamp, side,
                             m > 1 ? d->fine_half : d->size.optics);
        if (m > 1)
            cut_pieces(d, m);
        d->made = 1;
    }
    d->size.first = 0;
    d->size.last = n;
    *dst = &d->size;
    return RX_OK;
}

const rx_matching *rx_template_domain_matching(rx_template_domain *size)
{
    domain *d = (domain *)size;
    const rx_template_otf *otf = d->otf;
    rx_matching *m = &d->matching;
    if (!m->made && !otf->same) {
        rx_psf_at(otf->image, d->x, d->y, otf->stamp);
        rx_convolve_spectrum(size->fft, otf->stamp, otf->image->size, m->restored);
        if (rx_psf_fine(otf->tile) > 1) { /* of whole pixels, as the restored ones are */
            rx_psf_at(otf->tile, d->x, d->y, otf->stamp);
            rx_convolve_spectrum(size->fft, otf->stamp, otf->tile->size, m->kernel);
        }
        rx_convolve_divide(size->fft, rx_psf_fine(otf->tile) > 1 ? m->kernel : size->optics, m->restored,
                           DELTA, m->kernel);
        m->made = 1;
    }
    return m;
}

/* exp(-2 pi i u shift / n) for the first `count` of `whole`, u signed as the frequency is. */
static void fill_phase(int n, int whole, int count, double shift, double *phase)
{
    const double angle = -6.283185307179586 * shift / n, c = cos(angle), s = sin(angle);
    phase[0] = 1;
    phase[1] = 0;
    for (int u = 1; u < count && u <= whole / 2; u++) { /* each turned on from the one before */
        phase[2 * u] = c * phase[2 * u - 2] - s * phase[2 * u - 1];
        phase[2 * u + 1] = s * phase[2 * u - 2] + c * phase[2 * u - 1];
    }
    for (int u = whole / 2 + 1; u < count; u++) {
        phase[2 * u] = phase[2 * (whole - u)];
        phase[2 * u + 1] = -phase[2 * (whole - u) + 1];
    }
}

/* re, im [count] = base (as pairs) * py * (one of x's phases): the shifted PSF's spectrum in a column. */
RX_SIMD static void shift_column(const float *base, const float *py, double xr, double xi, int count,
                                 float *re, float *im)
{
    const float c = (float)xr, s = (float)xi;
#pragma omp simd
    for (int v = 0; v < count; v++) {
        const float pr = py[2 * v] * c - py[2 * v + 1] * s, pi = py[2 * v] * s + py[2 * v + 1] * c;
        re[v] = base[2 * v] * pr - base[2 * v + 1] * pi;
        im[v] = base[2 * v] * pi + base[2 * v + 1] * pr;
    }
}

/* dst (pairs) (+)= (re, im) * factor. */
RX_SIMD static void put_column(const float *re, const float *im, const float *factor, int count, int add,
                               float *dst)
{
    if (add) {
#pragma omp simd
        for (int u = 0; u < count; u++) {
            dst[2 * u] += re[u] * factor[u];
            dst[2 * u + 1] += im[u] * factor[u];
        }
        return;
    }
#pragma omp simd
    for (int u = 0; u < count; u++) {
        dst[2 * u] = re[u] * factor[u];
        dst[2 * u + 1] = im[u] * factor[u];
    }
}

void rx_template_domain_render(rx_template_domain *size, const rx_spergel *profile, double dx, double dy,
                               const rx_matching *restored, int count)
{
    const rx_template_otf *otf = ((const domain *)size)->otf;
    const int through = restored != NULL && !otf->same; /* the restored image's */
    const int n = size->n, used = n / 2 + 1, m = through ? 1 : rx_psf_fine(otf->tile), whole = m * n;
    const size_t stride = 2 * (size_t)rx_fft_stride_complex(size->fft),
                 plane = rx_fft_complex_size(size->fft);
    const float *base = through ? restored->restored : size->optics;
    float *py = size->column + (size_t)(PLANES + 2) * (size_t)n, *columns[PLANES + 2], *negative[PLANES];
    double *px = size->phase;
    rx_spergel_form form;
    if (profile == NULL && !through && otf->points != NULL && put_point(size, dx, dy))
        return;
    for (int i = 0; i < PLANES + 2; i++)
        columns[i] = size->column + (size_t)i * (size_t)n;
    if (profile != NULL)
        rx_spergel_set(profile, &form);
    fill_phase(n, whole, whole, n / 2 + dy, px);
    for (int v = 0; v < 2 * whole; v++)
        py[v] = (float)px[v];
    fill_phase(n, whole, m > 1 ? whole : used, n / 2 + dx, px);
    for (int v = 0; v < n; v++)
        columns[0][v] = 1;
    for (int piece = 0; piece < m * m; piece++) {
        const int a = piece % m * n, b = piece / m * n, room = whole / 2 + 1 - b;
        const int positive = room < 0 ? 0 : room < n ? room : n; /* frequencies of a column */
        for (int i = 0; i < PLANES; i++)
            negative[i] = columns[i] + positive;
        for (int u = 0; u < used; u++) {
            const size_t k = (size_t)u * stride;
            shift_column(base + (size_t)piece * plane + k, py + 2 * b, px[2 * (u + a)], px[2 * (u + a) + 1],
                         n, columns[PLANES], columns[PLANES + 1]);
            if (profile != NULL) {
                const double fx = (double)signed_frequency(u + a, whole) / n;
                if (positive > 0)
                    rx_spergel_column(&form, fx, 1.0 / n, b, positive, count, columns);
                if (positive < n)
                    rx_spergel_column(&form, fx, 1.0 / n, b + positive - whole, n - positive, count,
                                      negative);
            }
            for (int i = 0; i < count; i++)
                put_column(columns[PLANES], columns[PLANES + 1], columns[i], n, piece > 0, size->half[i] + k);
        }
    }
    for (int i = 0; i < count; i++)
        rx_fft_inverse_part(size->fft, size->half[i], size->first, size->last, size->plane[i]);
}

void rx_template_domain_blur(rx_template_domain *size, const rx_matching *matching)
{
    if (!((const domain *)size)->otf->same)
        rx_convolve(size->fft, matching->kernel, size->plane[0], size->half[0], size->plane[0]);
}
