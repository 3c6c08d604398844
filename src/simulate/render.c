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
#include "simulate/render_parts.h"

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
    rx_star_kernel *kernel;
    rx_drawing drawing;
    rx_kernels *kernels;
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
    r->margin += RX_STAR_TAPS / 2 / r->cells + 1;
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
    rx_drawing_close(&r->drawing);
    rx_kernels_free(r->kernels);
    rx_fft_free(r->fine);
    rx_fft_free(r->native);
}

static rx_status open_renderer(renderer *r, rx_error *err)
{
    int varying = 0, missing = 0;
    rx_status status = rx_fft_new(r->cells * r->width, r->cells * r->height, r->nthreads, &r->fine, err);
    if (status == RX_OK)
        status = rx_fft_new(r->width, r->height, r->nthreads, &r->native, err);
    if (status == RX_OK)
        status = rx_kernels_new(r->n, r->optics, r->width, r->height, r->nx * r->ny > 1, r->nthreads,
                                &r->kernels, err);
    if (status != RX_OK)
        return status;
    r->half = RX_NEW(float *, (size_t)r->n);
    r->kernel = rx_star_kernel_new();
    r->grid = rx_fft_real(r->fine);
    r->spectrum = rx_fft_complex(r->fine);
    r->pixels = rx_fft_real(r->native);
    for (int i = 0; i < r->n && r->half != NULL; i++) {
        int columns = rx_kernels_columns(r->kernels, i);
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
        (rx_drawing){.scene = r->scene, .kernel = r->kernel, .cells = r->cells, .nthreads = r->nthreads};
    return rx_drawing_open(&r->drawing, err);
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
static void convolve(const renderer *r, const rx_fine_grid *grid)
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
            rx_kernels_fold(r->kernels, i, b, r->fine, r->spectrum, r->native, r->half[i]);
        }
    }
    for (int i = 0; i < r->n; i++)
        for (int b = 0; b < r->optics[i]->nbasis; b++) {
            if (is_constant(r->optics[i], b))
                continue;
            weigh(r, r->optics[i], b, grid);
            rx_fft_forward_low(r->fine, r->weighted, rx_kernels_columns(r->kernels, i), r->spectrum);
            rx_kernels_fold(r->kernels, i, b, r->fine, r->spectrum, r->native, r->half[i]);
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

static rx_status render_block(const renderer *r, int block, rx_error *err)
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
    rx_status status = rx_drawing_part(&r->drawing, (long)x0 * r->cells, (long)y0 * r->cells, &grid, err);
    if (status != RX_OK)
        return status;
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
