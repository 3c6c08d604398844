/* What is left of the pixels. */
#include "template/template_chi2.h"

#include <stdlib.h>

#include "base/memory.h"

/* chi2 and number of the visible pixels of row y. */
static void judge_row(const rx_fit_image *c, int y, double sums[2])
{
    const size_t first = rx_fit_image_row(c, y);
    for (size_t k = first; k < first + (size_t)c->width; k++) {
        if (!(c->weight[k] > 0))
            continue;
        const double sigma = (double)c->sigma[k], r = c->data[k] - c->model[k];
        const double photons = c->gain > 0.0 && c->model[k] > 0 ? (double)c->model[k] / c->gain : 0.0;
        sums[0] += r * r / (sigma * sigma + photons);
        sums[1]++;
    }
}

static void keep_row(const rx_fit_image *c, int y, rx_tphot *dst)
{
    const size_t first = rx_fit_image_row(c, y), to = (size_t)y * (size_t)c->width;
    for (size_t x = 0; x < (size_t)c->width; x++) {
        dst->model[to + x] = c->model[first + x];
        dst->residual[to + x] = c->weight[first + x] > 0 ? c->data[first + x] - c->model[first + x] : 0;
    }
}

/* Rows are added up in their order. */
rx_status rx_template_chi2(rx_fit_image *image, int keep, rx_tphot *dst, rx_error *err)
{
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    double(*rows)[2] = rx_alloc((size_t)image->height, sizeof *rows);
    rx_status status = RX_OK;
    if (keep) {
        dst->model = RX_NEW(float, pixels);
        dst->residual = RX_NEW(float, pixels);
    }
    if (rows == NULL || (keep && (dst->model == NULL || dst->residual == NULL)))
        status = rx_error_memory(err, (size_t)image->height * sizeof *rows + 2 * pixels * sizeof(float));
    for (int from = 0, to; from < image->height && status == RX_OK; from = to) {
        to = from + rx_fit_image_rows(image);
        to = to < image->height ? to : image->height;
        status = rx_fit_image_load_rows(image, from, to, err);
#pragma omp parallel for schedule(static) num_threads(image->nthreads)
        for (int y = from; y < to; y++) {
            if (status != RX_OK)
                continue;
            judge_row(image, y, rows[y]);
            if (keep)
                keep_row(image, y, dst);
        }
    }
    for (int y = 0; y < image->height && status == RX_OK; y++) {
        dst->chi2 += rows[y][0];
        dst->visible += rows[y][1];
    }
    free(rows);
    return status;
}
