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
enum { PEAK_RADIUS = 2, PIECE = 512 /* pixels of a row at a time */ };

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
    for (int j = -1; j <= 1; j++) {
        float room[3];
        const float *data = rx_prepared_data(prepared, y + j, x - 1, 3, room);
        for (int i = 0; i < 3; i++) {
            const double v = data[i] - 1.0;
            if (i == 1 && j == 0)
                peak = v;
            else
                sum += v;
        }
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
    double *squares;
    RX_TRY(RX_MAKE(squares, count, err));
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

typedef struct finder {
    const rx_rl *rl;
    int radius; /* of the disk */
    double bluntness;
    rx_point *list;
    size_t count, room;
} finder;

static rx_status add_point(finder *f, const rx_point *point, rx_error *err)
{
    if (f->count == f->room) {
        f->room = f->room > 0 ? 2 * f->room : 256;
        RX_TRY(RX_GROW(f->list, f->room, err));
    }
    f->list[f->count++] = *point;
    return RX_OK;
}

/* Those of n pixels from (x, y) on. */
static rx_status find_in_piece(finder *f, int y, int x, int n, rx_error *err)
{
    const rx_rl *rl = f->rl;
    const int r = f->radius;
    const rx_prepared *prepared = rl->prepared;
    const float level = (float)(1 + PEAK_SIGMA * prepared->sigma);
    float room[PIECE];
    const float *data = rx_prepared_data(prepared, y, x, n, room);
    rx_status status = RX_OK;
    for (int i = 0; i < n && status == RX_OK; i++) {
        const int at = x + i;
        if (!(data[i] > level) || !(object_at(rl, at, y) > level) || !is_peak(rl, at, y) ||
            !is_isolated(rl, at, y, r) || !(data_bluntness(prepared, at, y) > SHARPEST * f->bluntness))
            continue;
        const rx_point point = measure(rl, at, y, r);
        if (point.flux > 0 && fabs(point.cx - at) <= 1 && fabs(point.cy - y) <= 1)
            status = add_point(f, &point, err);
    }
    return status;
}

rx_status rx_points_find(const rx_rl *rl, double fwhm, double bluntness, rx_point *points, int *n,
                         int *radius, rx_error *err)
{
    const rx_prepared *prepared = rl->prepared;
    const int r = *radius = (int)fmax(PEAK_RADIUS, ceil(fwhm)), end = prepared->width - 2 * r;
    finder f = {.rl = rl, .radius = r, .bluntness = bluntness};
    rx_status status = RX_OK;
    for (int y = 2 * r; y < prepared->height - 2 * r && status == RX_OK; y++)
        for (int x = 2 * r; x < end && status == RX_OK; x += PIECE)
            status = find_in_piece(&f, y, x, end - x < PIECE ? end - x : PIECE, err);
    if (status == RX_OK)
        status = keep_points(f.list, f.count, points, n, err);
    free(f.list);
    return status;
}
