/* Crowded cells. */
#include "template/crowd.h"

#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"

static const double COVERED = 0.05; /* share of the pixels */
static const double BEAMS = 70.0;   /* areas of FWHM^2 a source */
static const double EXTENDED = 0.8; /* share of the light */
enum { CELL = 64 };                 /* pixels */

static int cell_of(const rx_crowding *crowd, int x, int y)
{
    return (int)((long)y * crowd->ny / crowd->height) * crowd->nx + (int)((long)x * crowd->nx / crowd->width);
}

/* Fits may take a source over the border: it stays in the cell that it left. */
int rx_crowding_at(const rx_crowding *crowd, int x, int y)
{
    if (crowd == NULL || crowd->n == 0)
        return 0;
    const int u = rx_min_int(rx_max_int(x, 0), crowd->width - 1),
              v = rx_min_int(rx_max_int(y, 0), crowd->height - 1);
    return crowd->cells[cell_of(crowd, u, v)];
}

/* Visible and covered pixels and sources of every cell. */
static rx_status count(rx_fit_image *canvas, const double (*at)[2], int n, const rx_crowding *crowd,
                       long (*sums)[3], rx_error *err)
{
    for (int i = 0; i < n; i++) {
        const int x = (int)(at[i][0] + 0.5), y = (int)(at[i][1] + 0.5);
        if (x >= 0 && y >= 0 && x < crowd->width && y < crowd->height)
            sums[cell_of(crowd, x, y)][2]++;
    }
    for (int from = 0, to; from < crowd->height; from = to) {
        to = from + rx_fit_image_rows(canvas) < crowd->height ? from + rx_fit_image_rows(canvas)
                                                              : crowd->height;
        RX_TRY(rx_fit_image_load_rows(canvas, from, to, err));
        for (int y = from; y < to; y++)
            for (int x = 0; x < crowd->width; x++) {
                const size_t k = rx_fit_image_row(canvas, y) + (size_t)x;
                long *sum = sums[cell_of(crowd, x, y)];
                sum[0] += canvas->weight[k] > 0;
                sum[1] += canvas->weight[k] > 0 && canvas->model[k] > canvas->sigma[k];
            }
    }
    return RX_OK;
}

rx_status rx_crowding_find(rx_fit_image *canvas, const double (*at)[2], int n, double fwhm, int mode,
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
            for (int v = rx_max_int(y - 1, 0); v <= rx_min_int(y + 1, dst->ny - 1); v++)
                for (int u = rx_max_int(x - 1, 0); u <= rx_min_int(x + 1, dst->nx - 1); u++)
                    for (int j = 0; j < 3; j++)
                        sum[j] += sums[v * dst->nx + u][j];
            const double area = (double)sum[0];
            const int crowded = mode == RX_CROWDING_YES || ((double)sum[1] > COVERED * area &&
                                                            (double)sum[2] * fwhm * fwhm * BEAMS > area);
            dst->cells[y * dst->nx + x] = (uint8_t)crowded;
            dst->n += crowded;
            dst->seen += mode != RX_CROWDING_AUTO || area > 0;
        }
    free(sums);
    if (status != RX_OK)
        rx_crowding_clear(dst);
    return status;
}

rx_status rx_crowding_spare(const double (*at)[2], const double (*light)[2], int n, rx_crowding *crowd,
                            rx_error *err)
{
    const size_t cells = (size_t)crowd->nx * (size_t)crowd->ny;
    double(*sums)[2] = rx_alloc(cells, sizeof *sums);
    if (sums == NULL)
        return rx_error_memory(err, cells * sizeof *sums);
    for (int i = 0; i < n; i++) {
        const int x = (int)(at[i][0] + 0.5), y = (int)(at[i][1] + 0.5);
        for (int j = 0; j < 2 && x >= 0 && y >= 0 && x < crowd->width && y < crowd->height; j++)
            sums[cell_of(crowd, x, y)][j] += light[i][j] > 0 ? light[i][j] : 0;
    }
    for (int y = 0; y < crowd->ny; y++)
        for (int x = 0; x < crowd->nx; x++) {
            double sum[2] = {0};
            for (int v = rx_max_int(y - 1, 0); v <= rx_min_int(y + 1, crowd->ny - 1); v++)
                for (int u = rx_max_int(x - 1, 0); u <= rx_min_int(x + 1, crowd->nx - 1); u++)
                    for (int j = 0; j < 2; j++)
                        sum[j] += sums[v * crowd->nx + u][j];
            uint8_t *cell = &crowd->cells[y * crowd->nx + x];
            if (*cell && sum[1] > EXTENDED * (sum[0] + sum[1])) {
                *cell = 0;
                crowd->n--;
            }
        }
    free(sums);
    return RX_OK;
}

void rx_crowding_clear(rx_crowding *crowd)
{
    free(crowd->cells);
    *crowd = (rx_crowding){0};
}
