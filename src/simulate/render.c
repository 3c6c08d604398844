/* From objects to pixels, block by block.
 *
 * Cells within `margin` of the tile are cut into equal blocks. A block's cells are drawn, transformed,
 * multiplied by each optics' spectrum and folded onto pixels; its light falls on the block's own pixels and
 * `margin` around them and is added to the images. An object may reach over any number of blocks: each
 * draws its part. Nothing of a block depends on the others, and they are added in their order. */
#include "simulate/render.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "num/convolve.h"
#include "num/fft.h"

/* --- stars: points between the cells of a grid --- */

/* A sinc in a Kaiser window: a point at any place between the cells becomes STAR_TAPS^2 of them. Its spectrum
 * is flat to 2e-5 up to RX_STAR_BAND cycles per cell, and as low beyond 1 - RX_STAR_BAND; the sum over the
 * cells is 1. */
enum { STAR_TAPS = 20 };

/* Kaiser's window (Kaiser 1974): shape for a ripple of 1e-5, half width in cells; the band that is left flat
 * ends at 1/2 - sqrt(shape^2 + pi^2) / (4 pi HALF) or a little beyond. */
#define SHAPE 10.06
enum { HALF = STAR_TAPS / 2, STEPS = 1024 }; /* linear between 1024 points per cell: 4e-7 */

typedef struct star_kernel {
    double value[HALF * STEPS + 2]; /* at distance i / STEPS cells */
} star_kernel;

/* Modified Bessel function of order 0 by its power series. */
static double bessel_i0(double x)
{
    double term = 1.0, sum = 1.0, quarter = 0.25 * x * x;
    for (int k = 1; term > 1e-17 * sum; k++) {
        term *= quarter / ((double)k * k);
        sum += term;
    }
    return sum;
}

static star_kernel *make_star_kernel(void)
{
    star_kernel *kernel = RX_NEW(star_kernel, 1);
    if (kernel == NULL)
        return NULL;
    kernel->value[0] = 1.0;
    for (int i = 1; i < HALF * STEPS; i++) {
        double t = (double)i / STEPS, s = t / HALF;
        kernel->value[i] =
            sin(M_PI * t) / (M_PI * t) * bessel_i0(SHAPE * sqrt(1.0 - s * s)) / bessel_i0(SHAPE);
    }
    return kernel;
}

/* Weights of the cells from the first one on, which is returned; their sum is 1. */
static double weights(const star_kernel *kernel, double u, double weight[STAR_TAPS])
{
    double first = floor(u) - (HALF - 1), sum = 0.0;
    for (int k = 0; k < STAR_TAPS; k++) {
        double at = fabs(u - (first + k)) * STEPS;
        int i = at < HALF * STEPS ? (int)at : HALF * STEPS;
        weight[k] = kernel->value[i] + (at - i) * (kernel->value[i + 1] - kernel->value[i]);
        sum += weight[k];
    }
    for (int k = 0; k < STAR_TAPS; k++)
        weight[k] /= sum;
    return first;
}

static void draw_star(const star_kernel *kernel, double u, double v, double flux, long column, long row,
                      rx_fine_grid *grid)
{
    if (!(u > column - HALF - 1.0 && u < column + grid->width + HALF + 1.0 && v > row - HALF - 1.0 &&
          v < row + grid->height + HALF + 1.0))
        return;
    double wx[STAR_TAPS], wy[STAR_TAPS];
    long i0 = (long)weights(kernel, u, wx) - column, j0 = (long)weights(kernel, v, wy) - row;
    int from = i0 < 0 ? (int)-i0 : 0;
    int to = i0 + STAR_TAPS > grid->width ? (int)(grid->width - i0) : STAR_TAPS;
    for (int l = 0; l < STAR_TAPS; l++) {
        long j = j0 + l;
        if (j < 0 || j >= grid->height)
            continue;
        float *cells = grid->cells + (size_t)j * grid->stride;
        for (int k = from; k < to; k++)
            cells[i0 + k] += (float)(flux * wy[l] * wx[k]);
    }
}

/* --- objects on a grid of cells --- */

/* Boxes are drawn and added in batches of so many cells, or of one box per thread where these are larger. */
enum { BATCH_CELLS = 1 << 22, STRIP = 64 };

/* Cells of a grid around an extended object. */
struct box {
    long object;
    int i0, j0, width, height;
    size_t offset; /* of its cells among those of its batch */
};

/* A scene ready to be drawn in parts: the first four are given. */
typedef struct drawing {
    const rx_scene *scene;
    const star_kernel *kernel;
    int cells; /* per pixel; cell (0, 0) is centred on pixel (0, 0) */
    int nthreads;
    double *reach;   /* [scene->n] rx_object_reach(), cells */
    struct box *box; /* [scene->n] room for what is inside a part */
} drawing;

static size_t box_cells(const struct box *b)
{
    return (size_t)b->width * (size_t)b->height;
}

static rx_status open_drawing(drawing *d, rx_error *err)
{
    const rx_scene *scene = d->scene;
    d->reach = RX_NEW(double, (size_t)scene->n);
    d->box = rx_alloc((size_t)scene->n, sizeof *d->box);
    if (d->reach == NULL || d->box == NULL)
        return rx_error_memory(err, (size_t)scene->n * sizeof *d->box);
#pragma omp parallel for schedule(static) num_threads(d->nthreads)
    for (long k = 0; k < scene->n; k++)
        d->reach[k] = rx_object_reach(&scene->objects[k], scene->templates) * d->cells;
    return RX_OK;
}

/* 0 when nothing of it is inside. */
static int find_box(const drawing *d, long k, long column, long row, const rx_fine_grid *grid,
                    struct box *dst)
{
    const rx_object *o = &d->scene->objects[k];
    double reach = d->reach[k] + 2.0, u = o->x * d->cells - column, v = o->y * d->cells - row;
    double left = fmax(floor(u - reach), 0.0), right = fmin(ceil(u + reach), grid->width - 1.0);
    double bottom = fmax(floor(v - reach), 0.0), top = fmin(ceil(v + reach), grid->height - 1.0);
    if (!(left <= right && bottom <= top))
        return 0;
    *dst = (struct box){k, (int)left, (int)bottom, (int)(right - left) + 1, (int)(top - bottom) + 1, 0};
    return 1;
}

/* Drawn by itself first, so that objects can be drawn at the same time and yet be added in their order.
 * Returns whether memory was missing. */
static int draw_alone(const drawing *d, const struct box *b, const rx_fine_grid *grid, float *cells)
{
    rx_fine_grid part = {.width = b->width,
                         .height = b->height,
                         .x0 = grid->x0 + b->i0 * grid->step,
                         .y0 = grid->y0 + b->j0 * grid->step,
                         .step = grid->step,
                         .cells = cells,
                         .stride = (size_t)b->width};
    memset(cells, 0, box_cells(b) * sizeof *cells);
    const rx_object *o = &d->scene->objects[b->object];
    if (o->type == RX_OBJECT_GALAXY)
        return rx_galaxy_draw(o, &part, NULL) != RX_OK;
    rx_template_draw(o, &d->scene->templates->list[o->template_index], &part);
    return 0;
}

/* Of a box what lies in the rows first .. first + STRIP - 1 of the grid. */
static void add_box(const float *cells, const struct box *b, int first, rx_fine_grid *grid)
{
    int from = first > b->j0 ? first - b->j0 : 0;
    int end = first + STRIP - b->j0 < b->height ? first + STRIP - b->j0 : b->height;
    for (int j = from; j < end; j++) {
        float *row = grid->cells + (size_t)(b->j0 + j) * grid->stride + b->i0;
        const float *add = cells + (size_t)j * (size_t)b->width;
        for (int i = 0; i < b->width; i++)
            row[i] += add[i];
    }
}

/* Where the batch that begins with that box ends; the cells of its boxes. */
static long cut_batch(const drawing *d, long first, long n, size_t *cells)
{
    long k = first;
    *cells = 0;
    while (k < n && (k - first < d->nthreads || *cells + box_cells(&d->box[k]) <= BATCH_CELLS)) {
        d->box[k].offset = *cells;
        *cells += box_cells(&d->box[k++]);
    }
    return k;
}

static rx_status draw_boxes(const drawing *d, long n, rx_fine_grid *grid, rx_error *err)
{
    float *work = NULL;
    size_t room = 0, cells;
    for (long first = 0, end; first < n; first = end) {
        end = cut_batch(d, first, n, &cells);
        if (cells > room) {
            free(work);
            work = RX_NEW(float, cells);
            room = cells;
        }
        if (work == NULL)
            return rx_error_memory(err, cells * sizeof *work);
        int missing = 0;
#pragma omp parallel num_threads(d->nthreads)
        {
#pragma omp for schedule(dynamic) reduction(| : missing)
            for (long k = first; k < end; k++)
                missing |= draw_alone(d, &d->box[k], grid, work + d->box[k].offset);
#pragma omp for schedule(static)
            for (int row = 0; row < grid->height; row += STRIP)
                for (long k = first; k < end; k++)
                    add_box(work + d->box[k].offset, &d->box[k], row, grid);
        }
        if (missing) {
            free(work);
            return rx_error_memory(err, 0);
        }
    }
    free(work);
    return RX_OK;
}

static rx_status draw_part(const drawing *d, long column, long row, rx_fine_grid *grid, rx_error *err)
{
    const rx_scene *scene = d->scene;
    long n = 0;
    for (long k = 0; k < scene->n; k++) {
        const rx_object *o = &scene->objects[k];
        if (o->type == RX_OBJECT_STAR)
            draw_star(d->kernel, o->x * d->cells, o->y * d->cells, o->flux, column, row, grid);
        else
            n += find_box(d, k, column, row, grid, &d->box[n]);
    }
    return draw_boxes(d, n, grid, err);
}

/* --- through the optics, from cells to pixels --- */

#define KEEP_BYTES ((size_t)1 << 28)

/* Reading a function at every cells-th cell adds up all frequencies of its spectrum that differ by a multiple
 * of the number of pixels. So the product is folded in Fourier space, and the inverse transform is one of the
 * pixels. Optics are known up to their own Nyquist frequency; what is beyond is 0.
 * Spectra of all images of the optics on a cyclic domain of width x height pixels (even numbers): */
typedef struct kernels {
    int n, width, height;
    const rx_optics *const *optics;
    rx_fft **ffts;   /* [n] */
    float ***planes; /* [n][nbasis]: kept spectra, NULL = not (yet) kept */
    float **scratch; /* [n]: the spectrum of an image that is not kept */
    size_t left;     /* bytes that may still be kept */
} kernels;

static void close_kernels(kernels *k)
{
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
}

/* n, width, height, optics and left are given; close_kernels() in any case. */
static rx_status open_kernels(kernels *k, int nthreads, rx_error *err)
{
    const size_t n = (size_t)k->n;
    k->ffts = RX_NEW(rx_fft *, n);
    k->planes = RX_NEW(float **, n);
    k->scratch = RX_NEW(float *, n);
    if (k->ffts == NULL || k->planes == NULL || k->scratch == NULL)
        return rx_error_memory(err, 0);
    for (size_t i = 0; i < n; i++) {
        const int cells = k->optics[i]->oversampling;
        RX_TRY(rx_fft_new(cells * k->width, cells * k->height, nthreads, &k->ffts[i], err));
        k->planes[i] = RX_NEW(float *, (size_t)k->optics[i]->nbasis);
        k->scratch[i] = rx_fft_complex(k->ffts[i]);
        if (k->planes[i] == NULL || k->scratch[i] == NULL)
            return rx_error_memory(err, 0);
    }
    return RX_OK;
}

static int kernel_columns(const kernels *k, int i)
{
    return k->optics[i]->oversampling * k->width / 2 + 1;
}

static const float *find_spectrum(kernels *k, int i, int image)
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

static void fold_kernel(kernels *kernels, int i, int image, const rx_fft *fine, const float *spectrum,
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

/* --- blocks --- */

typedef struct renderer {
    const rx_scene *scene;
    int n, nthreads;
    const rx_optics *const *optics;
    float *const *images;
    int cells;          /* per pixel */
    int margin;         /* pixels from which light reaches the tile */
    int nx, ny;         /* blocks */
    int step_x, step_y; /* pixels of a block */
    int width, height;  /* pixels of its cyclic domain */
    int columns;        /* of the spectrum that the optics need */
    rx_fft *fine, *native;
    float *grid, *weighted, *spectrum, *pixels; /* weighted: NULL when no optics vary */
    float **half;                               /* [n] spectra on pixels */
    star_kernel *kernel;
    drawing drawing;
    kernels kernels;
} renderer;

/* The image's weight is 1 everywhere. */
static int is_constant(const rx_optics *o, int image)
{
    int terms = 0, constant = 0;
    for (int t = 0; t < o->nterms; t++)
        if (o->terms[t].image == image) {
            terms++;
            constant = o->terms[t].px == 0 && o->terms[t].py == 0 && o->terms[t].factor == 1.0;
        }
    return terms == 1 && constant;
}

/* --- geometry --- */

static void cut_axis(int size, int margin, int block, int *n, int *step, int *domain)
{
    int all = size + 2 * margin;
    *n = size <= block ? 1 : (all + block - 1) / block;
    *step = (all + *n - 1) / *n;
    /* of a single block, what falls off one side comes back on the other, outside the tile */
    *domain = rx_fft_good_size(*n == 1 ? all : *step + 2 * margin);
}

static void set_geometry(renderer *r, int block)
{
    r->cells = 1;
    for (int i = 0; i < r->n; i++) {
        const rx_optics *o = r->optics[i];
        int cells = o->oversampling > o->grid ? o->oversampling : o->grid;
        int reach = (o->size / 2 + o->oversampling - 1) / o->oversampling;
        r->cells = cells > r->cells ? cells : r->cells;
        r->margin = reach > r->margin ? reach : r->margin;
    }
    r->margin += STAR_TAPS / 2 / r->cells + 1;
    cut_axis(r->scene->width, r->margin, block, &r->nx, &r->step_x, &r->width);
    cut_axis(r->scene->height, r->margin, block, &r->ny, &r->step_y, &r->height);
}

/* --- making and freeing --- */

static void close_renderer(renderer *r)
{
    for (int i = 0; i < r->n && r->half != NULL; i++)
        free(r->half[i]);
    free(r->half);
    free(r->grid);
    free(r->weighted);
    free(r->spectrum);
    free(r->pixels);
    free(r->kernel);
    free(r->drawing.reach);
    free(r->drawing.box);
    close_kernels(&r->kernels);
    rx_fft_free(r->fine);
    rx_fft_free(r->native);
}

static rx_status open_renderer(renderer *r, rx_error *err)
{
    int varying = 0, missing = 0;
    rx_status status = rx_fft_new(r->cells * r->width, r->cells * r->height, r->nthreads, &r->fine, err);
    if (status == RX_OK)
        status = rx_fft_new(r->width, r->height, r->nthreads, &r->native, err);
    r->kernels = (kernels){.n = r->n,
                           .width = r->width,
                           .height = r->height,
                           .optics = r->optics,
                           /* they are asked for again and again */
                           .left = r->nx * r->ny > 1 ? KEEP_BYTES : 0};
    if (status == RX_OK)
        status = open_kernels(&r->kernels, r->nthreads, err);
    if (status != RX_OK)
        return status;
    r->half = RX_NEW(float *, (size_t)r->n);
    r->kernel = make_star_kernel();
    r->grid = rx_fft_real(r->fine);
    r->spectrum = rx_fft_complex(r->fine);
    r->pixels = rx_fft_real(r->native);
    for (int i = 0; i < r->n && r->half != NULL; i++) {
        int columns = kernel_columns(&r->kernels, i);
        r->columns = columns > r->columns ? columns : r->columns;
        r->half[i] = rx_fft_complex(r->native);
        missing |= r->half[i] == NULL;
        for (int b = 0; b < r->optics[i]->nbasis; b++)
            varying |= !is_constant(r->optics[i], b);
    }
    if (varying)
        r->weighted = rx_fft_real(r->fine);
    if (missing || r->half == NULL || r->kernel == NULL || r->grid == NULL || r->spectrum == NULL ||
        r->pixels == NULL || (varying && r->weighted == NULL))
        return rx_error_memory(err, 0);
    r->drawing =
        (drawing){.scene = r->scene, .kernel = r->kernel, .cells = r->cells, .nthreads = r->nthreads};
    return open_drawing(&r->drawing, err);
}

/* --- one block --- */

static double clamp(double x, int size)
{
    return fmin(fmax(x, 0.0), size - 1.0);
}

/* weighted = grid * weight of that image at the cells' places on the tile. */
static void weigh(const renderer *r, const rx_optics *o, int image, const rx_fine_grid *grid)
{
#pragma omp parallel for schedule(static) num_threads(r->nthreads)
    for (int j = 0; j < grid->height; j++) {
        const float *row = grid->cells + (size_t)j * grid->stride;
        float *dst = r->weighted + (size_t)j * grid->stride;
        double y = (clamp(grid->y0 + j * grid->step, r->scene->height) - o->y0) / o->ys;
        double power[2 * RX_PSF_MAX_BASIS] = {0.0}; /* coefficient of X^k in this row */
        int highest = 0;
        for (int t = 0; t < o->nterms; t++)
            if (o->terms[t].image == image) {
                int px = o->terms[t].px;
                power[px] += o->terms[t].factor * pow(y, o->terms[t].py);
                highest = px > highest ? px : highest;
            }
        for (int i = 0; i < grid->width; i++) {
            dst[i] = 0.0f;
            if (row[i] == 0.0f)
                continue;
            double x = (clamp(grid->x0 + i * grid->step, r->scene->width) - o->x0) / o->xs, sum = 0.0;
            for (int k = highest; k >= 0; k--)
                sum = sum * x + power[k];
            dst[i] = (float)(sum * (double)row[i]);
        }
    }
}

/* half[i] = spectrum on pixels of the grid through optics i. */
static void convolve(renderer *r, const rx_fine_grid *grid)
{
    int shared = 0;
    for (int i = 0; i < r->n; i++) {
        memset(r->half[i], 0, rx_fft_complex_size(r->native) * sizeof(float));
        for (int b = 0; b < r->optics[i]->nbasis; b++) {
            if (!is_constant(r->optics[i], b))
                continue;
            if (!shared)
                rx_fft_forward_low(r->fine, r->grid, r->columns, r->spectrum);
            shared = 1;
            fold_kernel(&r->kernels, i, b, r->fine, r->spectrum, r->native, r->half[i]);
        }
    }
    for (int i = 0; i < r->n; i++)
        for (int b = 0; b < r->optics[i]->nbasis; b++) {
            if (is_constant(r->optics[i], b))
                continue;
            weigh(r, r->optics[i], b, grid);
            rx_fft_forward_low(r->fine, r->weighted, kernel_columns(&r->kernels, i), r->spectrum);
            fold_kernel(&r->kernels, i, b, r->fine, r->spectrum, r->native, r->half[i]);
        }
}

/* What is inside the tile of the block that begins at pixel (x0, y0). */
static void add_pixels(const renderer *r, int x0, int y0, float *image)
{
    const int width = r->scene->width, height = r->scene->height;
    const int left = x0 - r->margin, bottom = y0 - r->margin;
    const int from = left > 0 ? left : 0, low = bottom > 0 ? bottom : 0;
    const int right = x0 + r->step_x + r->margin, top = y0 + r->step_y + r->margin;
    const int to = right < width ? right : width, high = top < height ? top : height;
    const size_t stride = (size_t)rx_fft_stride_real(r->native);
#pragma omp parallel for schedule(static) num_threads(r->nthreads)
    for (int y = low; y < high; y++) {
        const float *row = r->pixels + stride * (size_t)((y - y0 + r->height) % r->height);
        float *dst = image + (size_t)y * (size_t)width;
        for (int x = from; x < to; x++)
            dst[x] += row[x < x0 ? x - x0 + r->width : x - x0];
    }
}

static rx_status render_block(renderer *r, int block, rx_error *err)
{
    const int x0 = block % r->nx * r->step_x - r->margin, y0 = block / r->nx * r->step_y - r->margin;
    rx_fine_grid grid = {.width = r->cells * r->step_x,
                         .height = r->cells * r->step_y,
                         .x0 = x0,
                         .y0 = y0,
                         .step = 1.0 / r->cells,
                         .cells = r->grid,
                         .stride = (size_t)rx_fft_stride_real(r->fine)};
    if (block > 0) /* it was made empty */
        memset(r->grid, 0, sizeof(float) * grid.stride * (size_t)rx_fft_height(r->fine));
    RX_TRY(draw_part(&r->drawing, (long)x0 * r->cells, (long)y0 * r->cells, &grid, err));
    convolve(r, &grid);
    for (int i = 0; i < r->n; i++) {
        rx_fft_inverse(r->native, r->half[i], r->pixels);
        add_pixels(r, x0, y0, r->images[i]);
    }
    return RX_OK;
}

rx_status rx_render_blocks(const rx_scene *scene, int n, const rx_optics *const *optics, float *const *images,
                           int block, int nthreads, rx_error *err)
{
    renderer r = {
        .scene = scene, .n = n, .nthreads = nthreads < 1 ? 1 : nthreads, .optics = optics, .images = images};
    if (n < 1 || scene->n < 1)
        return RX_OK;
    set_geometry(&r, block);
    rx_status status = open_renderer(&r, err);
    for (int block_index = 0; block_index < r.nx * r.ny && status == RX_OK; block_index++) {
        status = rx_interrupt_check(err);
        if (status == RX_OK)
            status = render_block(&r, block_index, err);
    }
    close_renderer(&r);
    return status;
}

rx_status rx_render(const rx_scene *scene, int n, const rx_optics *const *optics, float *const *images,
                    int nthreads, rx_error *err)
{
    return rx_render_blocks(scene, n, optics, images, RX_RENDER_BLOCK, nthreads, err);
}
