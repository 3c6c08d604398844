/* Meshes one by one in threads; then the grid as a whole. */
#include "detect/mesh.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"

enum { MAX_LEVELS = 4096, MAX_ROUNDS = 100, PART = 64 };
static const double LEAST_GOOD = 0.5;             /* of a mesh's pixels */
static const double FIRST_CLIP = 2.0, CLIP = 3.0; /* sigmas */
static const double REACH = 5.0;                  /* of the histogram to each side, sigmas */
static const double FILLING = 4.0;                /* pixels in a level at the top of a Gaussian */
static const double LEAST_SIGMA = 0.1;            /* levels */
static const double SETTLED = 1e-4;               /* relative change of sigma */
static const double CROWDED = 0.3;                /* median - mean, sigmas */
static const float NONE = -FLT_MAX;               /* of a mesh without enough pixels */

/* Memory of one thread. count[i], first[i], second[i]: sums over levels below i of the pixels in a level,
 * times its number and its square. */
typedef struct workspace {
    float *values;      /* good pixels of a mesh */
    int32_t *histogram; /* one more for what is in no level */
    int64_t *count, *first, *second;
    int levels; /* of width `scale` from `zero` */
    float zero, scale;
} workspace;

static bool make_workspace(size_t area, workspace *work)
{
    work->values = RX_NEW(float, area);
    work->histogram = RX_NEW(int32_t, MAX_LEVELS + 1);
    work->count = RX_NEW(int64_t, MAX_LEVELS + 1);
    work->first = RX_NEW(int64_t, MAX_LEVELS + 1);
    work->second = RX_NEW(int64_t, MAX_LEVELS + 1);
    return work->values != NULL && work->histogram != NULL && work->count != NULL && work->first != NULL &&
           work->second != NULL;
}

static void free_workspace(workspace *work)
{
    free(work->values);
    free(work->histogram);
    free(work->count);
    free(work->first);
    free(work->second);
}

typedef struct moments {
    double mean, sigma;
    int n;
} moments;

/* Of the values from low to high. What is outside adds 0: no branch depends on noise, and vectors do it. */
RX_SIMD static moments measure_moments(const float *values, int n, float low, float high)
{
    moments m = {0};
    double sum = 0.0, squares = 0.0;
    int count = 0;
#pragma omp simd reduction(+ : sum, squares, count)
    for (int i = 0; i < n; i++) {
        const float here = values[i];
        const int inside = (here >= low) & (here <= high);
        const double value = inside * (double)here;
        sum += value;
        squares += value * value;
        count += inside;
    }
    m.n = count;
    m.mean = sum / m.n;
    const double variance = squares / m.n - m.mean * m.mean;
    m.sigma = variance > 0.0 ? sqrt(variance) : 0.0;
    return m;
}

/* The histogram of n values and its running sums. */
RX_SIMD static void fill_histogram(workspace *work, int n)
{
    const int levels = work->levels;
    const float zero = work->zero, scale = work->scale;
    const float shift = (float)(0.499999 - (double)(zero / scale));
    memset(work->histogram, 0, ((size_t)levels + 1) * sizeof *work->histogram);
    for (int i = 0; i < n; i += PART) {
        const int part = n - i < PART ? n - i : PART;
        int32_t place[PART];
#pragma omp simd
        for (int k = 0; k < part; k++) {
            const float at = work->values[i + k] / scale + shift;
            place[k] = (int32_t)((at > -1.0f) & (at < (float)levels) ? at : (float)levels);
        }
        for (int k = 0; k < part; k++)
            work->histogram[place[k]]++;
    }
    int64_t count = 0, first = 0, second = 0;
    for (int64_t i = 0; i < levels; i++) {
        const int64_t here = work->histogram[i];
        work->count[i] = count;
        work->first[i] = first;
        work->second[i] = second;
        count += here;
        first += here * i;
        second += here * i * i;
    }
    work->count[levels] = count;
    work->first[levels] = first;
    work->second[levels] = second;
}

/* Median, in levels, between low and high: the level in which half of the pixels is passed, shared out
 * between it and the one before. */
static double find_median(const workspace *work, int low, int high)
{
    const int64_t *count = work->count, base = count[low], all = count[high + 1] - base;
    int from = low, to = high;
    while (from < to) { /* first level with as many pixels up to it, and before it, as all */
        const int middle = (from + to) / 2;
        if (count[middle] - base + count[middle + 1] - base >= all)
            to = middle;
        else
            from = middle + 1;
    }
    if (from == 0)
        return 0.0;
    const int32_t here = work->histogram[from], before = work->histogram[from - 1];
    const int64_t below = count[from] - base;
    return from - 1 + 0.5 + (double)(all - 2 * below) / (2.0 * (here > before ? here : before));
}

/* Level and sigma from the histogram. A mesh of one pixel has one level and no round: its
 * mean, meant in levels, is then that of the pixels, in SExtractor as in sep. */
static void settle(const workspace *work, float mean_of_pixels, rx_mesh_level how, float *level, float *sigma)
{
    const int levels = work->levels;
    int low = 0, high = levels - 1;
    double spread = 10.0 * high, last = 1.0, mean = mean_of_pixels, median = mean_of_pixels;
    for (int round = 0; round < MAX_ROUNDS && spread >= LEAST_SIGMA && fabs(spread / last - 1.0) > SETTLED;
         round++) {
        last = spread;
        median = find_median(work, low, high);
        mean = (double)(work->first[high + 1] - work->first[low]);
        spread = (double)(work->second[high + 1] - work->second[low]);
        const int64_t n = work->count[high + 1] - work->count[low];
        if (n > 0) {
            mean /= (double)n;
            spread = spread / (double)n - mean * mean;
        }
        spread = spread > 0.0 ? sqrt(spread) : 0.0;
        const double down = median - CLIP * spread, up = median + CLIP * spread;
        low = down > 0.0 ? (int)(down + 0.5) : 0;
        high = up < levels - 1 ? (int)(up + 0.5) : levels - 1;
    }
    double place = mean;
    if (how == RX_MESH_MODE && fabs(spread) > 0.0)
        place = fabs((mean - median) / spread) < CROWDED ? 2.5 * median - 1.5 * mean : median;
    *level = (float)(work->zero + place * work->scale);
    *sigma = (float)(spread * work->scale);
}

/* One mesh from its n good values. */
static void measure_mesh(workspace *work, int n, int area, rx_mesh_level how, float *level, float *sigma)
{
    *level = *sigma = NONE;
    if ((float)n < (float)(area * LEAST_GOOD))
        return;
    const moments all = measure_moments(work->values, n, -HUGE_VALF, HUGE_VALF);
    const moments kept = measure_moments(work->values, n, (float)(all.mean - FIRST_CLIP * all.sigma),
                                         (float)(all.mean + FIRST_CLIP * all.sigma));
    const double step = sqrt(2.0 / M_PI) * REACH / FILLING;
    const int levels = (int)(step * kept.n + 1.0);
    work->levels = levels < MAX_LEVELS ? levels : MAX_LEVELS;
    work->scale = kept.sigma > 0.0 ? (float)(2.0 * REACH * kept.sigma / work->levels) : 1.0f;
    work->zero = (float)(kept.mean - REACH * kept.sigma);
    fill_histogram(work, n);
    settle(work, (float)kept.mean, how, level, sigma);
}

/* The n pixels are finite and none is hidden, as nearly all rows are. */
RX_SIMD static bool all_good(const float *pixels, const uint8_t *mask, int mask_bits, int n)
{
    int bad = 0;
#pragma omp simd reduction(| : bad)
    for (int i = 0; i < n; i++)
        bad |= !(fabsf(pixels[i]) <= FLT_MAX);
    if (bad != 0 || mask == NULL)
        return bad == 0;
#pragma omp simd reduction(| : bad)
    for (int i = 0; i < n; i++)
        bad |= mask[i];
    return (bad & mask_bits) == 0;
}

/* The good values of a mesh, row by row; *area: all of its pixels. */
static int collect(const rx_image *image, const sep_bkg *mesh, int m, float *values, int *area)
{
    const int i = m % mesh->nx, j = m / mesh->nx;
    const int x0 = i * mesh->bw, width = x0 + mesh->bw < mesh->w ? mesh->bw : mesh->w - x0;
    const int y0 = j * mesh->bh, y1 = y0 + mesh->bh < mesh->h ? y0 + mesh->bh : mesh->h;
    int n = 0;
    *area = width * (y1 - y0);
    for (int y = y0; y < y1; y++) {
        const size_t k = (size_t)y * (size_t)mesh->w + (size_t)x0;
        const float *pixels = image->pixels + k;
        const uint8_t *mask = image->mask != NULL ? image->mask + k : NULL;
        if (all_good(pixels, mask, image->hide, width)) {
            memcpy(values + n, pixels, (size_t)width * sizeof *values);
            n += width;
            continue;
        }
        for (int x = 0; x < width; x++) {
            values[n] = pixels[x];
            n += isfinite(values[n]) && (mask == NULL || (mask[x] & image->hide) == 0);
        }
    }
    return n;
}

/* All meshes as they are. */
static rx_status measure_all(const rx_background_params *par, const rx_image *image, rx_mesh_level how,
                             sep_bkg *mesh, size_t *good, rx_error *err)
{
    bool failed = false;
    size_t total = 0;
#pragma omp parallel num_threads(par->nthreads > 0 ? par->nthreads : 1) reduction(|| : failed) reduction(+ : total)
    {
        workspace work = {0};
        failed = !make_workspace((size_t)mesh->bw * (size_t)mesh->bh + 1, &work); /* one more is written to */
#pragma omp for schedule(static)
        for (int m = 0; m < mesh->n; m++) {
            if (failed)
                continue;
            int area;
            const int n = collect(image, mesh, m, work.values, &area);
            measure_mesh(&work, n, area, how, &mesh->back[m], &mesh->sigma[m]);
            total += (size_t)n;
        }
        free_workspace(&work);
    }
    *good = total;
    return failed ? rx_error_memory(err, (size_t)mesh->bw * (size_t)mesh->bh * sizeof(float)) : RX_OK;
}

/* Means of the nearest meshes that have values, for those that do not. */
static rx_status fill_gaps(sep_bkg *mesh, int *meshes, rx_error *err)
{
    const size_t size = (size_t)mesh->n * sizeof(float);
    int gaps = 0;
    for (int m = 0; m < mesh->n; m++)
        gaps += mesh->back[m] <= NONE;
    *meshes = mesh->n - gaps;
    if (gaps == 0)
        return RX_OK;
    float *level = RX_NEW(float, (size_t)mesh->n);
    if (level == NULL)
        return rx_error_memory(err, size);
    memcpy(level, mesh->back, size);
    for (int m = 0; m < mesh->n; m++) {
        if (level[m] > NONE)
            continue;
        float sum = 0.0f, sigmas = 0.0f;
        long nearest = -1;
        int n = 0;
        for (int k = 0; k < mesh->n; k++) {
            const long dx = m % mesh->nx - k % mesh->nx, dy = m / mesh->nx - k / mesh->nx;
            const long distance = dx * dx + dy * dy;
            if (level[k] <= NONE || (nearest >= 0 && distance > nearest))
                continue;
            if (distance != nearest) {
                sum = sigmas = 0.0f;
                n = 0;
            }
            nearest = distance;
            sum += level[k];
            sigmas += mesh->sigma[k];
            n++;
        }
        mesh->back[m] = n > 0 ? sum / (float)n : 0.0f;
        mesh->sigma[m] = n > 0 ? sigmas / (float)n : 1.0f;
    }
    free(level);
    return RX_OK;
}

static int ascending(const void *left, const void *right)
{
    const float a = *(const float *)left, b = *(const float *)right;
    return (a > b) - (a < b);
}

/* Sorts the values. */
static float median_of(float *values, int n)
{
    qsort(values, (size_t)n, sizeof *values, ascending);
    return n % 2 != 0 ? values[n / 2] : (float)((values[n / 2 - 1] + values[n / 2]) / 2.0);
}

/* Median of the box around a mesh, which shrinks towards the borders so that the mesh stays its middle. */
static float box_median(const sep_bkg *mesh, const float *values, int half_width, int half_height, int m,
                        float *box)
{
    const int x = m % mesh->nx, y = m / mesh->nx;
    const int rx = rx_min_int(half_width, rx_min_int(x, mesh->nx - 1 - x));
    const int ry = rx_min_int(half_height, rx_min_int(y, mesh->ny - 1 - y));
    int n = 0;
    for (int v = y - ry; v <= y + ry; v++)
        for (int u = x - rx; u <= x + rx; u++)
            box[n++] = values[v * mesh->nx + u];
    return median_of(box, n);
}

/* Running medians where they are at least the filter's threshold away, and the medians of all. */
static rx_status smooth(const rx_background_params *par, sep_bkg *mesh, rx_error *err)
{
    const size_t n = (size_t)mesh->n, half_width = (size_t)(rx_min_int(par->filter_width, mesh->nx * 2) / 2),
                 half_height = (size_t)(rx_min_int(par->filter_height, mesh->ny * 2) / 2);
    const size_t room = (2 * half_width + 1) * (2 * half_height + 1);
    rx_status status = RX_OK;
    float *level = RX_NEW(float, n), *sigma = RX_NEW(float, n), *box = RX_NEW(float, room);
    if (level == NULL || sigma == NULL || box == NULL)
        RX_TRY_EXIT(rx_error_memory(err, (n + room) * sizeof(float)));
    memcpy(level, mesh->back, n * sizeof *level);
    memcpy(sigma, mesh->sigma, n * sizeof *sigma);
    for (int m = 0; m < mesh->n; m++) {
        const float median = box_median(mesh, level, (int)half_width, (int)half_height, m, box);
        if (fabs((double)(median - level[m])) < par->filter_threshold)
            continue;
        mesh->back[m] = median;
        mesh->sigma[m] = box_median(mesh, sigma, (int)half_width, (int)half_height, m, box);
    }
    memcpy(level, mesh->back, n * sizeof *level);
    memcpy(sigma, mesh->sigma, n * sizeof *sigma);
    mesh->global = median_of(level, mesh->n);
    mesh->globalrms = median_of(sigma, mesh->n);
    if (mesh->globalrms <= 0.0f) { /* of those that have any noise, 1 where none has */
        int first = 0;
        while (first < mesh->n && sigma[first] <= 0.0f)
            first++;
        mesh->globalrms = first < mesh->n ? median_of(sigma + first, mesh->n - first) : 1.0f;
    }
exit:
    free(level);
    free(sigma);
    free(box);
    return status;
}

/* What stands for the second derivatives, over 6, of natural splines along y through each column of the grid:
 * d[y - 1] + 4 d[y] + d[y + 1] = 6 (v[y - 1] - 2 v[y] + v[y + 1]), eliminated forwards; backwards a value
 * that is divided by 6 already goes into the next, as in SExtractor, whose maps these are. */
static void differentiate(const sep_bkg *mesh, const float *values, float *u, float *derivatives)
{
    const int ny = mesh->ny;
    for (int x = 0; x < mesh->nx; x++) {
        const float *v = values + x;
        float *d = derivatives + x;
        const int step = mesh->nx;
        d[0] = u[0] = 0.0f;
        for (int y = 1; y < ny - 1; y++) {
            const float factor = -1.0f / (d[(y - 1) * step] + 4.0f);
            d[y * step] = factor;
            u[y] = factor * (u[y - 1] - 6.0f * (v[(y + 1) * step] + v[(y - 1) * step] - 2.0f * v[y * step]));
        }
        d[(ny - 1) * step] = 0.0f;
        for (int y = ny - 2; y > 0; y--)
            d[y * step] = (float)((d[y * step] * d[(y + 1) * step] + u[y]) / 6.0);
    }
}

rx_status rx_mesh_measure(const rx_background_params *par, const rx_image *image, rx_mesh_level level,
                          sep_bkg **dst, size_t *good, int *meshes, rx_error *err)
{
    rx_status status = RX_OK;
    float *scratch = NULL;
    sep_bkg *mesh = RX_NEW(sep_bkg, 1);
    *dst = NULL;
    if (mesh == NULL)
        return rx_error_memory(err, sizeof *mesh);
    mesh->w = image->width;
    mesh->h = image->height;
    mesh->bw = rx_min_int(par->mesh_width, mesh->w);
    mesh->bh = rx_min_int(par->mesh_height, mesh->h);
    mesh->nx = (mesh->w - 1) / mesh->bw + 1;
    mesh->ny = (mesh->h - 1) / mesh->bh + 1;
    mesh->n = mesh->nx * mesh->ny;
    const size_t n = (size_t)mesh->n;
    scratch = RX_NEW(float, (size_t)mesh->ny);
    mesh->back = RX_NEW(float, n);
    mesh->sigma = RX_NEW(float, n);
    mesh->dback = RX_NEW(float, n);
    mesh->dsigma = RX_NEW(float, n);
    if (scratch == NULL || mesh->back == NULL || mesh->sigma == NULL || mesh->dback == NULL ||
        mesh->dsigma == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof(float)));
    RX_TRY_EXIT(measure_all(par, image, level, mesh, good, err));
    RX_TRY_EXIT(fill_gaps(mesh, meshes, err));
    RX_TRY_EXIT(smooth(par, mesh, err));
    differentiate(mesh, mesh->back, scratch, mesh->dback);
    differentiate(mesh, mesh->sigma, scratch, mesh->dsigma);
    *dst = mesh;
    mesh = NULL;
exit:
    free(scratch);
    rx_mesh_free(mesh);
    return status;
}

void rx_mesh_free(sep_bkg *mesh)
{
    if (mesh == NULL)
        return;
    free(mesh->back);
    free(mesh->sigma);
    free(mesh->dback);
    free(mesh->dsigma);
    free(mesh);
}
