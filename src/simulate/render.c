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

/* A sinc in a Kaiser window: a point at any place between the cells becomes STAR_TAPS^2 of them. Its spectrum is flat
 * to 2e-5 up to RX_STAR_BAND cycles per cell, and as low beyond 1 - RX_STAR_BAND; the sum over the cells is 1. */
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

/* One of the optics on the cyclic domain of a block, and its spectra. */
typedef struct optical_path {
    const rx_optics *optics;
    float *image; /* what it adds to */
    rx_fft *fft;
    float **planes; /* [nbasis] spectra that are kept, NULL = not (yet) */
    float *scratch; /* the spectrum of an image that is not kept */
    float *half;    /* spectrum on pixels of the grid through it */
} optical_path;

typedef struct renderer {
    const rx_scene *scene;
    int n, nthreads;
    optical_path *optical_path; /* [n] */
    int cells;                  /* per pixel; cell (0, 0) is centred on pixel (0, 0) */
    int margin;                 /* pixels from which light reaches the tile */
    int nx, ny;                 /* blocks */
    int step_x, step_y;         /* pixels of a block */
    int width, height;          /* pixels of its cyclic domain, even numbers */
    int columns;                /* of the spectrum that the optics need */
    rx_fft *fine, *native;
    float *grid, *weighted, *spectrum, *pixels; /* weighted: NULL when no optics vary */
    size_t left;                                /* bytes of spectra that may still be kept */
    star_kernel *kernel;
    double *reach;   /* [scene->n] rx_object_reach(), cells */
    struct box *box; /* [scene->n] room for what is inside a block */
} renderer;

static size_t box_cells(const struct box *b)
{
    return (size_t)b->width * (size_t)b->height;
}

/* 0 when nothing of it is inside. */
static int find_box(const renderer *d, long k, long column, long row, const rx_fine_grid *grid,
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
static int draw_alone(const renderer *d, const struct box *b, const rx_fine_grid *grid, float *cells)
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
static long cut_batch(const renderer *d, long first, long n, size_t *cells)
{
    long k = first;
    *cells = 0;
    while (k < n && (k - first < d->nthreads || *cells + box_cells(&d->box[k]) <= BATCH_CELLS)) {
        d->box[k].offset = *cells;
        *cells += box_cells(&d->box[k++]);
    }
    return k;
}

static rx_status draw_boxes(const renderer *d, long n, rx_fine_grid *grid, rx_error *err)
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

static rx_status draw_objects(const renderer *d, long column, long row, rx_fine_grid *grid, rx_error *err)
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
 * pixels. Optics are known up to their own Nyquist frequency; what is beyond is 0. */
static int spectrum_columns(const renderer *r, const optical_path *l)
{
    return l->optics->oversampling * r->width / 2 + 1;
}

static const float *find_spectrum(renderer *r, optical_path *l, int image)
{
    const rx_optics *o = l->optics;
    if (l->planes[image] != NULL)
        return l->planes[image];
    const size_t bytes = rx_fft_complex_size(l->fft) * sizeof(float);
    float *plane = bytes <= r->left ? rx_fft_complex(l->fft) : NULL;
    if (plane != NULL) {
        l->planes[image] = plane;
        r->left -= bytes;
    } else
        plane = l->scratch;
    rx_convolve_spectrum(l->fft, o->basis + (size_t)image * (size_t)o->size * (size_t)o->size, o->size,
                         plane);
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

/* What is in r->spectrum, through one image of the optics. */
static void fold_image(renderer *r, optical_path *l, int image)
{
    const float *kernel = find_spectrum(r, l, image);
    const int width = r->width, last = rx_fft_width(l->fft) / 2;
    const size_t sf = 2 * (size_t)rx_fft_stride_complex(r->fine),
                 sk = 2 * (size_t)rx_fft_stride_complex(l->fft),
                 sn = 2 * (size_t)rx_fft_stride_complex(r->native);
#pragma omp parallel for schedule(static) num_threads(r->nthreads)
    for (int u = 0; u <= width / 2; u++) {
        column c = {.fine_rows = rx_fft_height(r->fine), .rows = rx_fft_height(l->fft)};
        for (int first = 0; first - u <= last; first += width)
            for (int mirrored = 0; mirrored < 2; mirrored++) {
                const int kx = mirrored ? first - u : first + u;
                if (kx > last || (mirrored && first == 0))
                    continue;
                c.fine = r->spectrum + sf * (size_t)kx;
                c.kernel = kernel + sk * (size_t)kx;
                c.weight = kx == last ? 0.5f : 1.0f;
                fold_column(&c, mirrored, r->height, l->half + sn * (size_t)u);
            }
    }
}

/* --- blocks --- */

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
        const rx_optics *o = r->optical_path[i].optics;
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
    for (int i = 0; i < r->n && r->optical_path != NULL; i++) {
        optical_path *l = &r->optical_path[i];
        for (int b = 0; l->planes != NULL && b < l->optics->nbasis; b++)
            free(l->planes[b]);
        free(l->planes);
        free(l->scratch);
        free(l->half);
        rx_fft_free(l->fft);
    }
    free(r->optical_path);
    free(r->grid);
    free(r->weighted);
    free(r->spectrum);
    free(r->pixels);
    free(r->kernel);
    free(r->reach);
    free(r->box);
    rx_fft_free(r->fine);
    rx_fft_free(r->native);
}

static rx_status open_renderer(renderer *r, rx_error *err)
{
    const rx_scene *scene = r->scene;
    int varying = 0;
    RX_TRY(rx_fft_new(r->cells * r->width, r->cells * r->height, r->nthreads, &r->fine, err));
    RX_TRY(rx_fft_new(r->width, r->height, r->nthreads, &r->native, err));
    r->left = r->nx * r->ny > 1 ? KEEP_BYTES : 0; /* they are asked for again and again */
    for (optical_path *l = r->optical_path; l < r->optical_path + r->n; l++) {
        const int cells = l->optics->oversampling, columns = spectrum_columns(r, l);
        RX_TRY(rx_fft_new(cells * r->width, cells * r->height, r->nthreads, &l->fft, err));
        RX_TRY(RX_MAKE(l->planes, (size_t)l->optics->nbasis, err));
        l->scratch = rx_fft_complex(l->fft);
        l->half = rx_fft_complex(r->native);
        if (l->scratch == NULL || l->half == NULL)
            return rx_error_memory(err, 0);
        r->columns = columns > r->columns ? columns : r->columns;
        for (int b = 0; b < l->optics->nbasis; b++)
            varying |= !is_constant(l->optics, b);
    }
    r->kernel = make_star_kernel();
    r->grid = rx_fft_real(r->fine);
    r->spectrum = rx_fft_complex(r->fine);
    r->pixels = rx_fft_real(r->native);
    if (varying)
        r->weighted = rx_fft_real(r->fine);
    if (r->kernel == NULL || r->grid == NULL || r->spectrum == NULL || r->pixels == NULL ||
        (varying && r->weighted == NULL))
        return rx_error_memory(err, 0);
    RX_TRY(RX_MAKE(r->reach, (size_t)scene->n, err));
    RX_TRY(RX_MAKE(r->box, (size_t)scene->n, err));
#pragma omp parallel for schedule(static) num_threads(r->nthreads)
    for (long k = 0; k < scene->n; k++)
        r->reach[k] = rx_object_reach(&scene->objects[k], scene->templates) * r->cells;
    return RX_OK;
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

/* The half of each optical path = spectrum on pixels of the grid through it. */
static void convolve(renderer *r, const rx_fine_grid *grid)
{
    int shared = 0;
    for (int i = 0; i < r->n; i++) {
        optical_path *l = &r->optical_path[i];
        memset(l->half, 0, rx_fft_complex_size(r->native) * sizeof(float));
        for (int b = 0; b < l->optics->nbasis; b++) {
            if (!is_constant(l->optics, b))
                continue;
            if (!shared)
                rx_fft_forward_low(r->fine, r->grid, r->columns, r->spectrum);
            shared = 1;
            fold_image(r, l, b);
        }
    }
    for (int i = 0; i < r->n; i++)
        for (int b = 0; b < r->optical_path[i].optics->nbasis; b++) {
            optical_path *l = &r->optical_path[i];
            if (is_constant(l->optics, b))
                continue;
            weigh(r, l->optics, b, grid);
            rx_fft_forward_low(r->fine, r->weighted, spectrum_columns(r, l), r->spectrum);
            fold_image(r, l, b);
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
    RX_TRY(draw_objects(r, (long)x0 * r->cells, (long)y0 * r->cells, &grid, err));
    convolve(r, &grid);
    for (int i = 0; i < r->n; i++) {
        rx_fft_inverse(r->native, r->optical_path[i].half, r->pixels);
        add_pixels(r, x0, y0, r->optical_path[i].image);
    }
    return RX_OK;
}

rx_status rx_render_blocks(const rx_scene *scene, int n, const rx_optics *const *optics, float *const *images,
                           int block, int nthreads, rx_error *err)
{
    renderer r = {.scene = scene, .n = n, .nthreads = nthreads < 1 ? 1 : nthreads};
    rx_status status;
    if (n < 1 || scene->n < 1)
        return RX_OK;
    RX_TRY(RX_MAKE(r.optical_path, (size_t)n, err));
    for (int i = 0; i < n; i++)
        r.optical_path[i] = (optical_path){.optics = optics[i], .image = images[i]};
    set_geometry(&r, block);
    RX_TRY_EXIT(open_renderer(&r, err));
    for (int k = 0; k < r.nx * r.ny; k++) {
        RX_TRY_EXIT(rx_interrupt_check(err));
        RX_TRY_EXIT(render_block(&r, k, err));
    }
exit:
    close_renderer(&r);
    return status;
}

rx_status rx_render(const rx_scene *scene, int n, const rx_optics *const *optics, float *const *images,
                    int nthreads, rx_error *err)
{
    return rx_render_blocks(scene, n, optics, images, RX_RENDER_BLOCK, nthreads, err);
}
