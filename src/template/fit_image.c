/* Data, variance and model of what is looked at. */
#include "template/fit_image.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"

/* A block, and how many neighbours of a line are made at once, by one thread. */
enum { SIDE = 16, TOGETHER = 16, MOST = SIDE * TOGETHER };

enum { KEPT = 4 }; /* times what is held: images up to that size have their data kept */

static const float EXACT = 2e-6f, ROUNDED = 0.288675f; /* 1 / sqrt(12) */

/* What a block holds: nothing, pixels and noise, the model, too. */
enum { BARE, FILLED, DRAWN };

/* Neighbouring blocks of a line that hold the same. */
typedef struct run {
    int first, count;
} run;

/* What is to be made. */
typedef struct plan {
    int n;
    run *runs;     /* [n] */
    int *slot;     /* [lines * columns] of a block: its run, -1 */
    size_t *start; /* [n + 1] into list */
    int *list;     /* layers of the runs */
} plan;

void rx_fit_image_clear(rx_fit_image *image)
{
    free(image->planes);
    free(image->kept);
    free(image->state);
    free(image->layers);
    for (int i = 0; i < image->nmeshes; i++)
        rx_sky_mesh_clear(&image->meshes[i]);
    free(image->meshes);
    rx_sky_mesh_clear(&image->scale);
    *image = (rx_fit_image){0};
}

int rx_fit_image_rows(const rx_fit_image *image)
{
    const size_t rows = image->held / (size_t)image->width;
    return rows < 1 ? 1 : rows < (size_t)image->height ? (int)rows : image->height;
}

rx_window rx_footprint_window(const rx_footprint *f)
{
    return (rx_window){f->x0, f->y0, f->x0 + f->width, f->y0 + f->height};
}

/* Whether a pixel takes part. */
static inline int is_open(int hidden, float value, float sigma)
{
    const float variance = sigma * sigma;
    return (hidden == 0) & (sigma > 0.0f) & (variance > 0.0f) & (variance <= FLT_MAX) &
           (fabsf(value) <= FLT_MAX);
}

/* Pixels of a row and what is known of them. */
typedef struct piece {
    const float *pixels, *level, *sigmas;
    const uint8_t *mask;
    int bits; /* of the mask that hide a pixel */
} piece;

/* n pixels less their level. */
RX_SIMD static void open_pixels(const piece *from, int n, float *restrict data, float *restrict noise,
                                float *restrict weight)
{
    const float *pixels = from->pixels, *level = from->level, *sigmas = from->sigmas;
    const uint8_t *mask = from->mask;
    const int bits = from->bits;
#pragma omp simd
    for (int i = 0; i < n; i++) {
        const float value = pixels[i] - level[i], sigma = sigmas[i];
        const int open = is_open(mask[i] & bits, value, sigma);
        data[i] = open ? value : 0.0f;
        noise[i] = open ? sigma : 0.0f;
        weight[i] = open ? 1.0f : 0.0f; /* until weigh() */
    }
}

static int has_level(const rx_image *image)
{
    return image->with_sky && rx_map_given(&image->level);
}

float rx_fit_image_variance(const rx_fit_image *image, int x, int y)
{
    const rx_image *given = &image->input->image;
    const size_t k = (size_t)y * (size_t)given->width + (size_t)x;
    const float level = has_level(given) ? rx_map_at(&given->level, x, y) : 0.0f;
    const float sigma = rx_map_at(&given->noise, x, y);
    const int hidden = rx_image_hides(given, k);
    const float least = fmaxf(sigma, image->floor);
    return is_open(hidden, given->pixels[k] - level, sigma) ? least * least : 0.0f;
}

double rx_fit_image_quiet(const rx_fit_image *image, size_t k, double light)
{
    const double photons = image->gain > 0.0 ? 1.0 / image->gain : 0.0, error = pow(image->psf_error, 2),
                 sky = pow((double)image->sigma[k], 2), all = fmax((double)image->model[k], 0.0),
                 rest = fmax((double)image->model[k] - light, 0.0);
    return (sky + all * (photons + all * error)) / (sky + rest * (photons + rest * error));
}

static const uint8_t unmasked[MOST] = {0};
static const float none[MOST] = {0};

/* n pixels of row y from x on, before any mesh. */
static void read_pixels(const rx_image *image, int y, int x, int n, float *data, float *noise, float *weight)
{
    const size_t at = (size_t)y * (size_t)image->width + (size_t)x;
    float levels[MOST], sigmas[MOST];
    const piece from = {.pixels = image->pixels + at,
                        .level = has_level(image) ? rx_map_row(&image->level, y, x, n, levels) : none,
                        .sigmas = rx_map_row(&image->noise, y, x, n, sigmas),
                        .mask = image->mask != NULL ? image->mask + at : unmasked,
                        .bits = image->hide};
    open_pixels(&from, n, data, noise, weight);
}

/* Bins of a float's exponent and first two bits, which order positive ones. */
enum { BINS = 1024, BIN_SHIFT = 21, PAIRS = 100 };

static int bin_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return (int)(bits >> BIN_SHIFT);
}

static float value_of(int bin)
{
    const uint32_t bits = (uint32_t)bin << BIN_SHIFT;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Sigma is at least EXACT of the light of the PAIRS-th brightest two neighbours (of small tiles, of a thousandth of them: a few hot
 * pixels say nothing of a tile's noise), or the noise of rounding to the steps that the pixels are in. */
static void look_through(const rx_image *given, rx_fit_image *image)
{
    float data[MOST], noise[MOST], weight[MOST], brightest = 0, step = FLT_MAX;
    long count[BINS] = {0}, pairs = 0, above = 0;
    for (int y = 0; y < given->height; y++)
        for (int x = 0; x < given->width; x += MOST) {
            const int n = rx_min_int(MOST, given->width - x);
            const float *pixels = given->pixels + (size_t)y * (size_t)given->width + (size_t)x;
            read_pixels(given, y, x, n, data, noise, weight);
#pragma omp simd reduction(max : brightest) reduction(min : step)
            for (int i = 1; i < n; i++) {
                const float by = fabsf(pixels[i] - pixels[i - 1]), both = fminf(data[i], data[i - 1]);
                step = (weight[i] * weight[i - 1] > 0) & (by > 0) & (by < step) ? by : step;
                brightest = both > brightest ? both : brightest;
            }
            for (int i = 1; i < n; i++) {
                const float both = fminf(data[i], data[i - 1]);
                if (both > 0)
                    count[bin_of(both)]++;
                pairs++;
            }
        }
    const long rank = pairs / 1000 < PAIRS ? pairs / 1000 + 1 : PAIRS;
    int bin = BINS - 1;
    while (bin > 0 && (above += count[bin]) < rank)
        bin--;
    image->brightest = brightest;
    image->floor = fmaxf(EXACT * value_of(bin), step < FLT_MAX ? step * ROUNDED : 0);
}

void rx_fit_image_open(const rx_tphot_input *input, size_t held, int nthreads, rx_fit_image *image)
{
    const rx_noise_correlation *noise = input->image.correlation;
    const double wide = rx_noise_factor_wide(noise);
    *image = (rx_fit_image){
        .width = input->image.width,
        .height = input->image.height,
        /* resampling keeps the photon noise of wide sums and lowers that of a pixel, as the sky's */
        .gain = wide * wide * input->image.gain,
        .correlation = noise != NULL && noise->correlated ? noise : NULL,
        .nthreads = nthreads,
        .input = input,
        .held = held};
    look_through(&input->image, image);
}

/* n pixels of row y from x on. */
static void fill_pixels(rx_fit_image *image, int y, int x, int n)
{
    const rx_image *given = &image->input->image;
    const size_t at = (size_t)y * (size_t)given->width + (size_t)x;
    const size_t to = rx_fit_image_row(image, y) + (size_t)x;
    if (image->kept != NULL) {
        float sigmas[MOST];
        const piece from = {.pixels = image->kept + at,
                            .level = none,
                            .sigmas = rx_map_row(&given->noise, y, x, n, sigmas),
                            .mask = unmasked};
        open_pixels(&from, n, image->data + to, image->sigma + to, image->weight + to);
        return;
    }
    read_pixels(given, y, x, n, image->data + to, image->sigma + to, image->weight + to);
    for (int i = 0; i < image->nmeshes; i++)
        rx_sky_mesh_subtract(&image->meshes[i], y, x, n, image->weight + to, image->data + to);
}

static void fill_piece(rx_fit_image *image, int y, int x, int n)
{
    float *sigma = image->sigma + rx_fit_image_row(image, y) + x;
    fill_pixels(image, y, x, n);
    if (image->scale.nx > 0)
        rx_sky_mesh_multiply(&image->scale, y, x, n, sigma);
    for (int i = 0; i < n; i++)
        sigma[i] = sigma[i] > 0 && sigma[i] < image->floor ? image->floor : sigma[i];
}

static void keep_piece(rx_fit_image *image, int y, int x, int n)
{
    float noise[MOST], weight[MOST];
    float *data = image->kept + (size_t)y * (size_t)image->width + (size_t)x;
    read_pixels(&image->input->image, y, x, n, data, noise, weight);
    for (int i = 0; i < image->nmeshes; i++)
        rx_sky_mesh_subtract(&image->meshes[i], y, x, n, weight, data);
    for (int i = 0; i < n; i++)
        data[i] = weight[i] > 0 ? data[i] : NAN;
}

static void keep_pixels(rx_fit_image *image)
{
#pragma omp parallel for schedule(static) num_threads(image->nthreads)
    for (int y = 0; y < image->height; y++)
        for (int x = 0; x < image->width; x += MOST)
            keep_piece(image, y, x, x + MOST < image->width ? MOST : image->width - x);
}

/* The data of an image that is too large to be shown as a whole, but not much. */
static rx_status keep_data(rx_fit_image *image, rx_error *err)
{
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    if (image->kept != NULL || pixels <= image->held || pixels / KEPT > image->held)
        return RX_OK;
    image->kept = rx_alloc_filled(pixels, sizeof(float), image->nthreads);
    if (image->kept == NULL)
        return rx_error_memory(err, pixels * sizeof(float));
    keep_pixels(image);
    return RX_OK;
}

RX_SIMD static void weigh(rx_fit_image *image, size_t from, size_t to)
{
    const float photons = image->gain > 0.0 ? (float)(1.0 / image->gain) : 0.0f;
    const float error = (float)(image->psf_error * image->psf_error);
    const float *sigmas = image->sigma, *models = image->model;
    float *weights = image->weight;
#pragma omp simd
    for (size_t k = from; k < to; k++) {
        const float variance = sigmas[k] * sigmas[k], model = models[k] > 0.0f ? models[k] : 0.0f;
        const float weight = 1.0f / (variance + model * (photons + model * error));
        weights[k] = weights[k] > 0.0f ? weight : 0.0f; /* hidden ones stay hidden */
    }
}

/* The part of a layer that lies in the window, which is in memory. */
static void draw_layer(rx_fit_image *image, const rx_layer *layer, const rx_window *w)
{
    const rx_footprint *f = &layer->footprint;
    const float flux = (float)layer->flux;
    const int x0 = f->x0 > w->x0 ? f->x0 : w->x0, y0 = f->y0 > w->y0 ? f->y0 : w->y0;
    const int x1 = f->x0 + f->width < w->x1 ? f->x0 + f->width : w->x1;
    const int y1 = f->y0 + f->height < w->y1 ? f->y0 + f->height : w->y1;
    for (int y = y0; y < y1; y++) {
        float *restrict dst = image->model + rx_fit_image_row(image, y) + x0;
        const float *restrict src = f->values + (size_t)(y - f->y0) * (size_t)f->width + (x0 - f->x0);
#pragma omp simd
        for (int x = 0; x < x1 - x0; x++)
            dst[x] += flux * src[x];
    }
}

static rx_window window_of(const rx_fit_image *image, const run *blocks)
{
    const int x = blocks->first % image->columns * SIDE, right = x + SIDE * blocks->count;
    const int y = image->top + blocks->first / image->columns * SIDE, end = image->top + image->rows;
    return (rx_window){x, y, right < image->width ? right : image->width, y + SIDE < end ? y + SIDE : end};
}

/* First and last lines and columns of blocks that a window in memory lies in, last ones exclusive; no line
 * where it is empty or elsewhere. */
static rx_window blocks_of(const rx_fit_image *image, const rx_window *w)
{
    const int end = image->top + image->rows;
    const int y0 = w->y0 > image->top ? w->y0 : image->top, y1 = w->y1 < end ? w->y1 : end;
    if (y1 <= y0 || w->x1 <= w->x0)
        return (rx_window){0, 0, 0, 0};
    return (rx_window){w->x0 / SIDE, (y0 - image->top) / SIDE, (w->x1 - 1) / SIDE + 1,
                       (y1 - 1 - image->top) / SIDE + 1};
}

static void make_run(rx_fit_image *image, const plan *p, int i)
{
    const rx_window w = window_of(image, &p->runs[i]);
    const size_t n = (size_t)(w.x1 - w.x0);
    uint8_t *state = image->state + p->runs[i].first;
    for (int y = w.y0; y < w.y1; y++) {
        if (*state == BARE)
            fill_piece(image, y, w.x0, w.x1 - w.x0);
        memset(image->model + rx_fit_image_row(image, y) + w.x0, 0, n * sizeof(float));
    }
    size_t k = p->start[i];
    for (; k < p->start[i + 1] && p->list[k] < image->nlayers; k++)
        draw_layer(image, &image->layers[p->list[k]], &w);
    for (int y = w.y0; y < w.y1; y++)
        weigh(image, rx_fit_image_row(image, y) + (size_t)w.x0, rx_fit_image_row(image, y) + (size_t)w.x1);
    for (; k < p->start[i + 1]; k++) /* what came later has no say in the weights */
        draw_layer(image, &image->layers[p->list[k]], &w);
    memset(state, DRAWN, (size_t)p->runs[i].count);
}

/* Rows in memory, those asked for first; nothing of them is known any more. */
static rx_status move_to(rx_fit_image *image, int from, int to, rx_error *err)
{
    const int held = rx_fit_image_rows(image), rows = to - from > held ? to - from : held;
    const size_t width = (size_t)image->width, need = (size_t)rows * width;
    if (need > image->room) {
        free(image->planes);
        image->room = 0;
        image->planes = rx_alloc_filled(4 * need, sizeof(float), image->nthreads);
        if (image->planes == NULL)
            return rx_error_memory(err, 4 * need * sizeof(float));
        image->room = need;
    }
    image->data = image->planes;
    image->sigma = image->planes + need;
    image->model = image->planes + 2 * need;
    image->weight = image->planes + 3 * need;
    image->top = from < image->height - rows ? from : image->height - rows;
    image->columns = (image->width + SIDE - 1) / SIDE;
    image->lines = (rows + SIDE - 1) / SIDE;
    image->rows = 0; /* until it is certain */
    const rx_status status = keep_data(image, err);
    if (status != RX_OK)
        return status;
    const size_t blocks = (size_t)image->columns * (size_t)image->lines;
    free(image->state);
    image->state = RX_NEW(uint8_t, blocks);
    if (image->state == NULL)
        return rx_error_memory(err, blocks);
    image->rows = rows;
    return RX_OK;
}

/* The blocks of the windows that are not drawn yet: wanted, then in runs. */
static void list_runs(rx_fit_image *image, const rx_window *windows, const int *which, int n, plan *p)
{
    const int blocks = image->columns * image->lines;
    for (int i = 0; i < blocks; i++)
        p->slot[i] = -1;
    for (int i = 0; i < n; i++) {
        const rx_window at = blocks_of(image, &windows[which != NULL ? which[i] : i]);
        for (int b = at.y0 * image->columns; b < at.y1 * image->columns; b += image->columns)
            for (int x = at.x0; x < at.x1; x++)
                p->slot[b + x] = image->state[b + x] != DRAWN ? 0 : -1;
    }
    for (int b = 0; b < blocks; b++) {
        if (p->slot[b] < 0)
            continue;
        run *last = p->n > 0 ? &p->runs[p->n - 1] : NULL;
        if (last != NULL && last->first + last->count == b && last->count < TOGETHER &&
            b % image->columns != 0 && image->state[b] == image->state[last->first])
            last->count++;
        else
            p->runs[p->n++] = (run){b, 1};
        p->slot[b] = p->n - 1;
    }
}

/* The layers of each of these runs, counted, then listed in their order. */
static rx_status list_layers(const rx_fit_image *image, plan *p, rx_error *err)
{
    size_t *at = RX_NEW(size_t, (size_t)p->n + 1);
    p->start = RX_NEW(size_t, (size_t)p->n + 1);
    if (at == NULL || p->start == NULL) {
        free(at);
        return rx_error_memory(err, 2 * ((size_t)p->n + 1) * sizeof *at);
    }
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < image->nlayers + image->nadded; i++) {
            const rx_window w = rx_footprint_window(&image->layers[i].footprint);
            const rx_window in = blocks_of(image, &w);
            for (int b = in.y0 * image->columns; b < in.y1 * image->columns; b += image->columns)
                for (int x = in.x0, before = -1; x < in.x1; x++) {
                    const int slot = p->slot[b + x];
                    if (slot >= 0 && slot != before && pass == 0)
                        p->start[slot + 1]++;
                    else if (slot >= 0 && slot != before)
                        p->list[at[slot]++] = i;
                    before = slot;
                }
        }
        if (pass == 1)
            break;
        for (int i = 0; i < p->n; i++)
            p->start[i + 1] += p->start[i];
        memcpy(at, p->start, ((size_t)p->n + 1) * sizeof *at);
        p->list = RX_NEW(int, p->start[p->n]);
        if (p->list == NULL)
            break;
    }
    free(at);
    return p->list != NULL ? RX_OK : rx_error_memory(err, p->start[p->n] * sizeof *p->list);
}

rx_status rx_fit_image_load(rx_fit_image *image, const rx_window *windows, const int *which, int n,
                            rx_error *err)
{
    int from = image->height, to = 0;
    for (int i = 0; i < n; i++) {
        const rx_window *w = &windows[which != NULL ? which[i] : i];
        if (w->y1 <= w->y0 || w->x1 <= w->x0)
            continue;
        from = w->y0 < from ? w->y0 : from;
        to = w->y1 > to ? w->y1 : to;
    }
    plan p = {0};
    rx_status status = RX_OK;
    if (to <= from)
        return RX_OK;
    if (from < image->top || to > image->top + image->rows)
        status = move_to(image, from, to, err);
    if (status != RX_OK)
        return status;
    const size_t blocks = (size_t)image->columns * (size_t)image->lines;
    p.runs = RX_NEW(run, blocks);
    p.slot = RX_NEW(int, blocks);
    if (p.runs == NULL || p.slot == NULL) {
        status = rx_error_memory(err, blocks * (sizeof(run) + sizeof(int)));
        goto exit;
    }
    list_runs(image, windows, which, n, &p);
    if (p.n > 0)
        status = list_layers(image, &p, err);
    if (status != RX_OK)
        goto exit;
#pragma omp parallel for schedule(dynamic, 8) num_threads(image->nthreads)
    for (int i = 0; i < p.n; i++)
        make_run(image, &p, i);
exit:
    free(p.runs);
    free(p.slot);
    free(p.start);
    free(p.list);
    return status;
}

rx_status rx_fit_image_load_rows(rx_fit_image *image, int from, int to, rx_error *err)
{
    return rx_fit_image_load(image, &(rx_window){0, from, image->width, to}, NULL, 1, err);
}

void rx_fit_image_set(rx_fit_image *image, rx_layer *layers, int n)
{
    free(image->layers);
    image->layers = layers;
    image->nlayers = image->nroom = n;
    image->nadded = 0;
    for (int i = 0; i < image->columns * image->lines; i++)
        image->state[i] = image->state[i] == BARE ? BARE : FILLED;
}

rx_status rx_fit_image_add(rx_fit_image *image, const rx_footprint *footprint, double flux, rx_error *err)
{
    const int n = image->nlayers + image->nadded;
    const rx_window all = {0, image->top, image->width, image->top + image->rows};
    if (n >= image->nroom) {
        const size_t room = 2 * (size_t)n + 64;
        rx_layer *more = rx_regrow(image->layers, room, sizeof *more);
        if (more == NULL)
            return rx_error_memory(err, room * sizeof *more);
        image->layers = more;
        image->nroom = (int)room;
    }
    image->layers[n] = (rx_layer){*footprint, flux};
    image->nadded++;
    draw_layer(image, &image->layers[n], &all);
    return RX_OK;
}

/* Nothing of the pixels in memory is known any more. */
static void forget(rx_fit_image *image)
{
    if (image->state != NULL)
        memset(image->state, BARE, (size_t)image->columns * (size_t)image->lines);
}

/* The mesh in the same cells; -1: there is none. */
static int same_mesh(const rx_fit_image *image, const rx_sky_mesh *mesh)
{
    for (int i = 0; i < image->nmeshes; i++)
        if (image->meshes[i].nx == mesh->nx && image->meshes[i].ny == mesh->ny)
            return i;
    return -1;
}

rx_status rx_fit_image_subtract(rx_fit_image *image, rx_sky_mesh *mesh, rx_error *err)
{
    const int same = same_mesh(image, mesh);
    if (same >= 0) {
        for (int i = 0; i < mesh->nx * mesh->ny; i++)
            image->meshes[same].value[i] += mesh->value[i];
        rx_sky_mesh_clear(mesh);
    } else {
        const rx_status status = RX_GROW(image->meshes, (size_t)image->nmeshes + 1, err);
        if (status != RX_OK) {
            rx_sky_mesh_clear(mesh);
            return status;
        }
        image->meshes[image->nmeshes++] = *mesh;
    }
    forget(image);
    if (image->kept != NULL)
        keep_pixels(image);
    return RX_OK;
}

static const double LEAST_SCALE = 0.05; /* of the noise; at most 1 over that */

void rx_fit_image_rescale(rx_fit_image *image, rx_sky_mesh *mesh)
{
    for (int i = 0; i < image->scale.nx * image->scale.ny; i++)
        mesh->value[i] = fmax(LEAST_SCALE, fmin(mesh->value[i] * image->scale.value[i], 1 / LEAST_SCALE));
    rx_sky_mesh_clear(&image->scale);
    image->scale = *mesh;
    forget(image);
}
