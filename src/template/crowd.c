/* Crowded cells. */
#include "template/crowd.h"

#include <stdlib.h>

#include "base/memory.h"

static const double COVERED = 0.05; /* share of the pixels */
static const double BEAMS = 70.0;   /* areas of FWHM^2 a source */
enum { CELL = 64 };                 /* pixels */

static int cell_of(const rx_crowding *crowd, int x, int y)
{
    return (int)((long)y * crowd->ny / crowd->height) * crowd->nx + (int)((long)x * crowd->nx / crowd->width);
}

int rx_crowding_at(const rx_crowding *crowd, int x, int y)
{
    return crowd != NULL && crowd->n > 0 && crowd->cells[cell_of(crowd, x, y)];
}

/* Visible and covered pixels and sources of every cell. */
static rx_status count(rx_canvas *canvas, const double (*at)[2], int n, const rx_crowding *crowd,
                       long (*sums)[3], rx_error *err)
{
    for (int i = 0; i < n; i++) {
        const int x = (int)(at[i][0] + 0.5), y = (int)(at[i][1] + 0.5);
        if (x >= 0 && y >= 0 && x < crowd->width && y < crowd->height)
            sums[cell_of(crowd, x, y)][2]++;
    }
    for (int from = 0, to; from < crowd->height; from = to) {
        to = from + rx_canvas_rows(canvas) < crowd->height ? from + rx_canvas_rows(canvas) : crowd->height;
        RX_TRY(rx_canvas_show_rows(canvas, from, to, err));
        for (int y = from; y < to; y++)
            for (int x = 0; x < crowd->width; x++) {
                const size_t k = rx_canvas_row(canvas, y) + (size_t)x;
                long *sum = sums[cell_of(crowd, x, y)];
                sum[0] += canvas->weight[k] > 0;
                sum[1] += canvas->weight[k] > 0 && canvas->model[k] > canvas->sigma[k];
            }
    }
    return RX_OK;
}

rx_status rx_crowding_find(rx_canvas *canvas, const double (*at)[2], int n, double fwhm, int mode,
                           rx_crowding *dst, rx_error *err)
{
    *dst = (rx_crowding){.width = canvas->width,
                         .height = canvas->height,
                         .nx = (canvas->width + CELL - 1) / CELL,
                         .ny = (canvas->height + CELL - 1) / CELL};
    const size_t cells = (size_t)dst->nx * (size_t)dst->ny;
    long(*sums)[3] = rx_alloc(cells, sizeof *sums);
    dst->cells = RX_NEW(uint8_t, cells);
    rx_status status =
        sums == NULL || dst->cells == NULL ? rx_error_memory(err, cells * (sizeof *sums + 1)) : RX_OK;
    if (status == RX_OK && mode == RX_CROWDING_AUTO)
        status = count(canvas, at, n, dst, sums, err);
    for (int y = 0; y < dst->ny && status == RX_OK; y++)
        for (int x = 0; x < dst->nx; x++) {
            long sum[3] = {0};
            for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < dst->ny; v++)
                for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < dst->nx; u++)
                    for (int j = 0; j < 3; j++)
                        sum[j] += sums[v * dst->nx + u][j];
            const double area = (double)sum[0];
            const int crowded = mode == RX_CROWDING_YES || ((double)sum[1] > COVERED * area &&
                                                            (double)sum[2] * fwhm * fwhm * BEAMS > area);
            dst->cells[y * dst->nx + x] = (uint8_t)crowded;
            dst->n += crowded;
        }
    free(sums);
    if (status != RX_OK)
        rx_crowding_clear(dst);
    return status;
}

void rx_crowding_clear(rx_crowding *crowd)
{
    free(crowd->cells);
    *crowd = (rx_crowding){0};
}
