/* Isolated point-like sources in the present image of a Richardson-Lucy iteration. */
#include "restore/points.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "num/stats.h"

static const double PEAK_SIGMA = 10;
static const double NEIGHBOUR = 0.1;
static const double SIZE_QUANTILE = 0.2, SIZE_RATIO = 1.3;
static const double SHARPEST = 0.6;
enum { PEAK_RADIUS = 2 };

static float object_at(const rx_rl *rl, int x, int y)
{
    return rl->object[rx_blur_row(rl->blur, y) + (size_t)x];
}

/* Highest within the square of PEAK_RADIUS; of equals the first one. */
static int is_peak(const rx_rl *rl, int x, int y)
{
    const float f = object_at(rl, x, y);
    for (int j = -PEAK_RADIUS; j <= PEAK_RADIUS; j++)
        for (int i = -PEAK_RADIUS; i <= PEAK_RADIUS; i++) {
            const float other = object_at(rl, x + i, y + j);
            const int before = j < 0 || (j == 0 && i < 0);
            if (before ? other >= f : other > f)
                return 0;
        }
    return 1;
}

/* No masked pixel within r, nothing comparable between the peak's own square and 2 r. */
static int is_isolated(const rx_rl *rl, int x, int y, int r)
{
    const double height = object_at(rl, x, y) - 1;
    for (int j = -2 * r; j <= 2 * r; j++)
        for (int i = -2 * r; i <= 2 * r; i++) {
            const int d2 = i * i + j * j;
            if (d2 <= r * r && rl->prepared->mask[(size_t)(y + j) * rl->prepared->width + (x + i)] != 0)
                return 0;
            if (d2 <= r * r || d2 > 4 * r * r)
                continue;
            if (object_at(rl, x + i, y + j) - 1 > NEIGHBOUR * height)
                return 0;
        }
    return 1;
}

/* Mean of the eight neighbours above the sky in the data, in units of the peak. */
static double data_bluntness(const rx_prepared *prepared, int x, int y)
{
    double sum = 0, peak = 0;
    for (int j = -1; j <= 1; j++)
        for (int i = -1; i <= 1; i++) {
            const double v = prepared->data[(size_t)(y + j) * prepared->width + (x + i)] - 1.0;
            if (i == 0 && j == 0)
                peak = v;
            else
                sum += v;
        }
    return sum / 8 / peak;
}

double rx_points_bluntness(const float *stamp, int size)
{
    double sum = 0;
    for (int j = -1; j <= 1 && size > 1; j++)
        for (int i = -1; i <= 1; i++)
            if (i != 0 || j != 0)
                sum += stamp[(size / 2 + j) * size + size / 2 + i];
    return sum / 8 / stamp[size / 2 * size + size / 2];
}

static rx_point measure(const rx_rl *rl, int x, int y, int r)
{
    double sum = 0, sx = 0, sy = 0, ss = 0;
    for (int j = -r; j <= r; j++)
        for (int i = -r; i <= r; i++) {
            if (i * i + j * j > r * r)
                continue;
            const double v = object_at(rl, x + i, y + j) - 1.0;
            sum += v;
            sx += v * i;
            sy += v * j;
            ss += v * (i * i + j * j);
        }
    const double dx = sx / sum, dy = sy / sum;
    return (rx_point){x, y, x + dx, y + dy, sum, ss / sum - dx * dx - dy * dy};
}

/* Brighter first; then by position, so that the order is one. */
static int brighter(const void *a, const void *b)
{
    const rx_point *p = a, *q = b;
    if (p->flux != q->flux)
        return p->flux < q->flux ? 1 : -1;
    return p->y != q->y ? (p->y > q->y) - (p->y < q->y) : (p->x > q->x) - (p->x < q->x);
}

/* Those no larger than the smallest fifth of them, nearly; returns how many. */
static rx_status keep_points(rx_point *list, size_t count, rx_point *points, int *n, rx_error *err)
{
    *n = 0;
    if (count == 0)
        return RX_OK;
    double *squares = RX_NEW(double, count);
    if (squares == NULL)
        return rx_error_memory(err, count * sizeof *squares);
    for (size_t i = 0; i < count; i++)
        squares[i] = list[i].square;
    const double limit = SIZE_RATIO * rx_quantile(squares, count, SIZE_QUANTILE);
    free(squares);
    qsort(list, count, sizeof *list, brighter);
    for (size_t i = 0; i < count && *n < RX_POINTS_MAX; i++)
        if (list[i].square <= limit)
            points[(*n)++] = list[i];
    return RX_OK;
}

rx_status rx_points_find(const rx_rl *rl, double fwhm, double bluntness, rx_point *points, int *n,
                         int *radius, rx_error *err)
{
    const rx_prepared *prepared = rl->prepared;
    const int r = *radius = (int)fmax(PEAK_RADIUS, ceil(fwhm));
    const float level = (float)(1 + PEAK_SIGMA * prepared->sigma);
    rx_point *list = NULL;
    size_t count = 0, room = 0;
    for (int y = 2 * r; y < prepared->height - 2 * r; y++)
        for (int x = 2 * r; x < prepared->width - 2 * r; x++) {
            const size_t k = (size_t)y * prepared->width + x;
            if (!(prepared->data[k] > level) || !(object_at(rl, x, y) > level) || !is_peak(rl, x, y) ||
                !is_isolated(rl, x, y, r) || !(data_bluntness(prepared, x, y) > SHARPEST * bluntness))
                continue;
            const rx_point point = measure(rl, x, y, r);
            if (!(point.flux > 0) || !(fabs(point.cx - x) <= 1 && fabs(point.cy - y) <= 1))
                continue;
            if (count == room) {
                room = room > 0 ? 2 * room : 256;
                rx_point *more = rx_regrow(list, room, sizeof *list);
                if (more == NULL) {
                    free(list);
                    return rx_error_memory(err, room * sizeof *list);
                }
                list = more;
            }
            list[count++] = point;
        }
    const rx_status status = keep_points(list, count, points, n, err);
    free(list);
    return status;
}
