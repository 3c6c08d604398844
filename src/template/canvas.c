/* Data, variance and model of the tile to be fitted. */
#include "template/canvas.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/wide.h"

enum { BAND = 64 }; /* rows that one thread draws */

/* n pixels of row y from x on. */
static void fill_piece(const rx_tphot_input *input, int y, int x, int n, rx_canvas *canvas)
{
    const size_t at = (size_t)y * (size_t)input->width + (size_t)x;
    const float *sigmas = canvas->sigma + at, *pixels = input->pixels + at;
    float room[RX_MAP_PIECE];
    const float *level = rx_map_given(&input->level) ? rx_map_row(&input->level, y, x, n, room) : NULL;
    for (int i = 0; i < n; i++) {
        if (input->mask != NULL && (input->mask[at + (size_t)i] & input->mask_bits) != 0)
            continue;
        const float value = pixels[i] - (level != NULL ? level[i] : 0.0f);
        const float sigma = sigmas[i], variance = sigma * sigma;
        if (!(sigma > 0.0f) || !(variance > 0.0f) || !isfinite(variance) || !isfinite(value))
            continue;
        canvas->data[at + (size_t)i] = value;
        canvas->weight[at + (size_t)i] = 1.0f / variance;
    }
}

rx_status rx_canvas_fill(const rx_tphot_input *input, int nthreads, rx_canvas *canvas, rx_error *err)
{
    const size_t n = (size_t)input->width * (size_t)input->height;
    const int known = input->sigma.plane != NULL;
    *canvas = (rx_canvas){.width = input->width,
                          .height = input->height,
                          .data = RX_NEW(float, n),
                          .own_sigma = known ? NULL : RX_NEW(float, n),
                          .model = RX_NEW(float, n),
                          .weight = RX_NEW(float, n),
                          .gain = input->gain};
    if (canvas->data == NULL || canvas->model == NULL || canvas->weight == NULL ||
        (!known && canvas->own_sigma == NULL)) {
        rx_canvas_clear(canvas);
        return rx_error_memory(err, 4 * n * sizeof(float));
    }
    if (!known)
        rx_map_fill(&input->sigma, input->height, nthreads, canvas->own_sigma);
    canvas->sigma = known ? input->sigma.plane : canvas->own_sigma;
#pragma omp parallel for schedule(static) num_threads(nthreads)
    for (int y = 0; y < input->height; y++)
        for (int x = 0; x < input->width; x += RX_MAP_PIECE)
            fill_piece(input, y, x, rx_map_piece(x, input->width), canvas);
    return RX_OK;
}

void rx_canvas_clear(rx_canvas *canvas)
{
    free(canvas->data);
    free(canvas->own_sigma);
    free(canvas->model);
    free(canvas->weight);
    *canvas = (rx_canvas){0};
}

RX_WIDE static void weigh(rx_canvas *canvas, size_t from, size_t to)
{
    const float photons = canvas->gain > 0.0 ? (float)(1.0 / canvas->gain) : 0.0f;
    const float error = (float)(canvas->psf_error * canvas->psf_error);
    const float *sigmas = canvas->sigma, *models = canvas->model;
    float *weights = canvas->weight;
#pragma omp simd
    for (size_t k = from; k < to; k++) {
        const float variance = sigmas[k] * sigmas[k], model = models[k] > 0.0f ? models[k] : 0.0f;
        const float weight = 1.0f / (variance + model * (photons + model * error));
        weights[k] = weights[k] > 0.0f ? weight : 0.0f; /* hidden ones stay hidden */
    }
}

static void draw_rows(rx_canvas *canvas, const rx_layer *layer, int from, int to)
{
    const rx_footprint *f = layer->footprint;
    const float flux = (float)layer->flux;
    const int first = f->y0 > from ? f->y0 : from;
    const int last = f->y0 + f->height < to ? f->y0 + f->height : to;
    for (int y = first; y < last; y++) {
        float *restrict dst = canvas->model + (size_t)y * (size_t)canvas->width + f->x0;
        const float *restrict src = f->values + (size_t)(y - f->y0) * (size_t)f->width;
#pragma omp simd
        for (int x = 0; x < f->width; x++)
            dst[x] += flux * src[x];
    }
}

void rx_canvas_add(rx_canvas *canvas, const rx_footprint *footprint, double flux)
{
    draw_rows(canvas, &(rx_layer){footprint, flux}, 0, canvas->height);
}

rx_status rx_canvas_draw(rx_canvas *canvas, const rx_layer *layers, int n, int nthreads, rx_error *err)
{
    const int bands = (canvas->height + BAND - 1) / BAND;
    /* which layers reach into a band: counted, then listed in order */
    size_t *start = RX_NEW(size_t, bands + 1), *at = RX_NEW(size_t, bands + 1);
    int *list = NULL;
    rx_status status = RX_OK;
    if (start == NULL || at == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    for (int pass = 0; pass < 2; pass++) {
        for (int i = 0; i < n; i++) {
            const rx_footprint *f = layers[i].footprint;
            for (int b = f->y0 / BAND; f->width > 0 && b <= (f->y0 + f->height - 1) / BAND; b++) {
                if (pass == 0)
                    start[b + 1]++;
                else
                    list[at[b]++] = i;
            }
        }
        if (pass == 1)
            break;
        for (int b = 0; b < bands; b++)
            start[b + 1] += start[b];
        memcpy(at, start, (size_t)(bands + 1) * sizeof *at);
        list = RX_NEW(int, start[bands]);
        if (list == NULL) {
            status = rx_error_memory(err, start[bands] * sizeof *list);
            goto exit;
        }
    }
#pragma omp parallel for schedule(dynamic) num_threads(nthreads)
    for (int b = 0; b < bands; b++) {
        const int from = b * BAND, to = from + BAND < canvas->height ? from + BAND : canvas->height;
        memset(canvas->model + (size_t)from * (size_t)canvas->width, 0,
               (size_t)(to - from) * (size_t)canvas->width * sizeof(float));
        for (size_t i = start[b]; i < start[b + 1]; i++)
            draw_rows(canvas, &layers[list[i]], from, to);
        weigh(canvas, (size_t)from * (size_t)canvas->width, (size_t)to * (size_t)canvas->width);
    }
exit:
    free(start);
    free(at);
    free(list);
    return status;
}
