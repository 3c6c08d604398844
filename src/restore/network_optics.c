/* The PSF around the network, by FFT on blocks. */
#include "restore/network_optics.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "base/simd.h"
#include "nn/rl_step.h"
#include "num/convolve.h"
#include "restore/stamp.h"

struct rx_network_optics_work {
    rx_blur_domain domain;
    float *a, *b;    /* real planes */
    float *spectrum; /* complex, of a node's filter, for a PSF that varies */
};

/* ---- making ---- */

static void clear_tiling(rx_network_tiling *tiling)
{
    for (int i = 0; i < tiling->nthreads && tiling->work != NULL; i++) {
        rx_blur_domain_clear(&tiling->work[i].domain);
        free(tiling->work[i].a);
        free(tiling->work[i].b);
        free(tiling->work[i].spectrum);
    }
    free(tiling->work);
}

void rx_network_optics_free(rx_network_optics *optics)
{
    if (optics == NULL)
        return;
    clear_tiling(&optics->far);
    clear_tiling(&optics->near);
    rx_blur_kernel_clear(&optics->relative);
    rx_blur_kernel_clear(&optics->tikhonov);
    rx_otf_grid_clear(&optics->grid);
    free(optics->inside);
    free(optics);
}

/* What a thread failed with; all of them can only lack memory. */
static void take_error(rx_status why, const rx_error *error, rx_status *status, rx_error *err)
{
#pragma omp critical(rx_network_optics_failure)
    {
        *status = why;
        rx_error_take(err, error);
    }
}

/* Of the threads those that have work do it, rx_blocks.team says why. */
static int team_of(const rx_network_tiling *tiling)
{
    const int team = tiling->blocks.team;
    return tiling->nthreads > 1 && team > tiling->nthreads ? team : tiling->nthreads;
}

/* Threads' planes on a domain that holds a block and its halo: of K', or of what is filtered once. */
static rx_status make_work(const rx_network_optics *optics, rx_network_tiling *tiling, rx_error *err)
{
    const rx_blocks *blocks = &tiling->blocks;
    const int varies = rx_psf_varies(optics->psf), steps = tiling == &optics->near,
              filters = !steps && varies && optics->grid.filters != NULL;
    rx_status status = RX_OK;
    const int w = rx_fft_good_size(blocks->width + 2 * tiling->halo),
              h = rx_fft_good_size(blocks->height + 2 * tiling->halo);
    RX_TRY(RX_MAKE(tiling->work, (size_t)tiling->nthreads, err));
#pragma omp parallel for schedule(static, 1) num_threads(team_of(tiling))
    for (int i = 0; i < tiling->nthreads; i++) {
        rx_network_optics_work *work = &tiling->work[i];
        rx_error why = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
        rx_status made = rx_blur_domain_make(w, h, 1, varies, &work->domain, &why);
        if (made == RX_OK) {
            work->a = steps ? rx_fft_real(work->domain.fft) : NULL;
            work->b = steps ? rx_fft_real(work->domain.fft) : NULL;
            work->spectrum = filters ? rx_fft_complex(work->domain.fft) : NULL;
            if ((steps && (work->a == NULL || work->b == NULL)) || (filters && work->spectrum == NULL))
                made = rx_error_memory(&why, 3 * (size_t)w * (size_t)h * sizeof(float));
        }
        if (made != RX_OK)
            take_error(made, &why, &status, err);
    }
    return status;
}

/* Blocks of both kinds. */
static void set_tilings(rx_network_optics *optics, const rx_blocks *blocks, int step_radius, int nthreads)
{
    rx_network_tiling *far = &optics->far, *near = &optics->near;
    far->blocks = *blocks;
    far->halo = rx_max_int(optics->psf->size / 2, optics->grid.filters != NULL ? RX_TIKHONOV_REACH : 0);
    near->halo = 2 * step_radius;
    near->blocks = rx_blocks_make(
        optics->width, optics->height, rx_blur_side(optics->width, near->halo) - 2 * near->halo,
        rx_blur_side(optics->height, near->halo) - 2 * near->halo, 1, -blocks->x, -blocks->y);
    near->blocks.team = blocks->team;
    far->nthreads = rx_blocks_threads(&far->blocks, nthreads);
    near->nthreads = rx_blocks_threads(&near->blocks, nthreads);
}

/* The only filter of a PSF that does not vary. */
static rx_status make_tikhonov(rx_network_optics *optics, const rx_fft *fft, rx_error *err)
{
    if (optics->grid.filters == NULL || optics->grid.nx > 1 || optics->grid.ny > 1)
        return RX_OK;
    optics->tikhonov.spectrum[0] = rx_fft_complex(fft);
    if (optics->tikhonov.spectrum[0] == NULL)
        return rx_error_memory(err, 0);
    optics->tikhonov.n = 1;
    rx_convolve_spectrum(fft, optics->grid.filters, 2 * RX_TIKHONOV_REACH + 1, optics->tikhonov.spectrum[0]);
    return RX_OK;
}

static rx_status make_relative(rx_network_optics *optics, const rx_fft *fft, const rx_psf *relative,
                               rx_error *err)
{
    const size_t n = (size_t)relative->size + 1;
    RX_TRY(rx_blur_kernel_make(fft, relative, optics->width, optics->height, &optics->relative, err));
    if (optics->relative.varies)
        return RX_OK;
    RX_TRY(RX_MAKE(optics->inside, n * n, err));
    rx_stamp_inside(relative->basis, relative->size, optics->inside);
    return RX_OK;
}

rx_status rx_network_optics_new(const rx_image *image, double target_fwhm, double epsilon,
                                const rx_blocks *blocks, int nthreads, rx_network_optics **dst, rx_error *err)
{
    const rx_psf *psf = image->psf;
    rx_psf relative = *psf;
    relative.basis = NULL;
    *dst = NULL;
    rx_network_optics *optics;
    RX_TRY(RX_MAKE(optics, 1, err));
    optics->width = image->width;
    optics->height = image->height;
    optics->psf = psf;
    rx_status status = rx_otf_grid_make(psf, image->width, image->height,
                                        &(rx_tikhonov){target_fwhm, epsilon, 0}, &optics->grid, err);
    if (status == RX_OK)
        status = rx_otf_relative(psf, target_fwhm, image->width, image->height, &relative.basis,
                                 &relative.size, err);
    if (status == RX_OK) {
        set_tilings(optics, blocks, relative.size / 2, nthreads);
        status = make_work(optics, &optics->far, err);
    }
    if (status == RX_OK)
        status = make_work(optics, &optics->near, err);
    if (status == RX_OK) {
        /* each by a thread where there are two */
#pragma omp parallel for schedule(static, 1) num_threads(team_of(&optics->near))
        for (int task = 0; task < 2; task++) {
            rx_error why = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
            const rx_status made =
                task == 0 ? make_tikhonov(optics, optics->far.work->domain.fft, &why)
                          : make_relative(optics, optics->near.work->domain.fft, &relative, &why);
            if (made != RX_OK)
                take_error(made, &why, &status, err);
        }
    }
    free(relative.basis);
    if (status != RX_OK) {
        rx_network_optics_free(optics);
        return status;
    }
    *dst = optics;
    return RX_OK;
}

/* ---- blocks ---- */

/* What all blocks of a task are given, and one of them. */
typedef struct task {
    const rx_network_optics *optics;
    const rx_network_tiling *tiling;
    const float *src, *x, *f; /* planes of the tile, like dst */
    const uint8_t *mask;
    float pedestal;
    const rx_blur_kernel *kernel;
    rx_fft_read read; /* of filter_block(): what is blurred, and where it goes */
    rx_fft_write write;
    float *dst;
    rx_network_optics_work *work;
    int left, right, top, bottom; /* the block's part of the tile, without right and bottom */
    long good, seen;              /* pixels of the domain: not masked, on the tile */
    int masked;                   /* K'^T W is not that of a tile without masks */
    int node;                     /* of the grid */
} task;

static task task_of(const void *user, int thread, int x, int y)
{
    task t = *(const task *)user;
    const rx_network_optics *optics = t.optics;
    t.work = &t.tiling->work[thread];
    t.work->domain.x = x - t.tiling->halo;
    t.work->domain.y = y - t.tiling->halo;
    t.left = rx_max_int(x, 0);
    t.top = rx_max_int(y, 0);
    t.right = rx_min_int(x + t.tiling->blocks.width, optics->width);
    t.bottom = rx_min_int(y + t.tiling->blocks.height, optics->height);
    return t;
}

/* Columns of the domain that lie on the tile: from <= i < to; 0: row y does not. */
static int on_tile(const task *t, int y, int *from, int *to)
{
    const int x0 = t->work->domain.x, row = t->work->domain.y + y, w = rx_fft_width(t->work->domain.fft);
    *from = rx_max_int(-x0, 0);
    *to = rx_min_int(t->optics->width - x0, w);
    return row >= 0 && row < t->optics->height && *from < *to;
}

/* Where pixel i of the domain's row y lies in a plane of the tile, and in one of the domain. */
static size_t in_tile(const task *t, int y, int i)
{
    return (size_t)(t->work->domain.y + y) * (size_t)t->optics->width + (size_t)(t->work->domain.x + i);
}

static float *in_domain(const task *t, float *plane, int y, int i)
{
    return plane + (size_t)y * (size_t)rx_fft_stride_real(t->work->domain.fft) + (size_t)i;
}

static void clear_beyond(const task *t, int from, int to, float *line)
{
    memset(line, 0, (size_t)from * sizeof *line);
    memset(line + to, 0, (size_t)(rx_fft_width(t->work->domain.fft) - to) * sizeof *line);
}

/* The block's part of the tile comes of it. */
static rx_blur_rows rows_of(task *t, rx_fft_read read, rx_fft_write write)
{
    const int x = t->work->domain.x, y = t->work->domain.y;
    return (rx_blur_rows){.read = read,
                          .write = write,
                          .user = t,
                          .left = t->left - x,
                          .right = t->right - x,
                          .top = t->top - y,
                          .bottom = t->bottom - y};
}

/* ---- into the transform ---- */

static int read_tile(void *user, int y, float *line)
{
    const task *t = user;
    int from = 0, to = 0;
    if (!on_tile(t, y, &from, &to))
        return 0;
    clear_beyond(t, from, to, line);
    memcpy(line + from, t->src + in_tile(t, y, from), (size_t)(to - from) * sizeof *line);
    return 1;
}

static int read_light(void *user, int y, float *line)
{
    const task *t = user;
    int from = 0, to = 0;
    if (!on_tile(t, y, &from, &to))
        return 0;
    clear_beyond(t, from, to, line);
    const float *f = t->f + in_tile(t, y, from);
#pragma omp simd
    for (int i = from; i < to; i++)
        line[i] = rx_rl_light(f[i - from]);
    return 1;
}

static int read_good(void *user, int y, float *line)
{
    const task *t = user;
    int from = 0, to = 0;
    if (!on_tile(t, y, &from, &to))
        return 0;
    clear_beyond(t, from, to, line);
    const uint8_t *mask = t->mask + in_tile(t, y, from);
#pragma omp simd
    for (int i = from; i < to; i++)
        line[i] = mask[i - from] == 0 ? 1 : 0;
    return 1;
}

static int read_ratio(void *user, int y, float *line)
{
    const task *t = user;
    int from = 0, to = 0;
    if (!on_tile(t, y, &from, &to))
        return 0;
    memcpy(line, in_domain(t, t->work->a, y, 0), (size_t)rx_fft_width(t->work->domain.fft) * sizeof *line);
    return 1;
}

/* ---- out of it ---- */

/* One choice in a loop, and none whose other side is the neutral element of what follows: else a compiler
 * makes branches of them, not vectors. */
enum { TOGETHER = 64 };

/* r of n pixels. */
RX_SIMD static void ratios(int n, const float *restrict x, const float *restrict m,
                           const uint8_t *restrict mask, float pedestal, float *restrict r)
{
    for (int first = 0; first < n; first += TOGETHER) {
        const int count = n - first < TOGETHER ? n - first : TOGETHER;
        float ratio[TOGETHER];
#pragma omp simd
        for (int i = 0; i < count; i++)
            ratio[i] = rx_rl_ratio(x[first + i], m[first + i], 1, pedestal);
#pragma omp simd
        for (int i = 0; i < count; i++)
            r[first + i] = mask[first + i] != 0 ? 0 : ratio[i];
    }
}

static long good_pixels(int n, const uint8_t *mask)
{
    long good = 0;
    for (int i = 0; i < n; i++)
        good += mask[i] == 0;
    return good;
}

/* r into a, and how many pixels are good. */
static void write_ratio(void *user, int y, float *line)
{
    task *t = user;
    int from = 0, to = 0;
    if (!on_tile(t, y, &from, &to))
        return;
    float *r = in_domain(t, t->work->a, y, 0);
    const float *x = t->x + in_tile(t, y, from);
    const uint8_t *mask = t->mask + in_tile(t, y, from);
    clear_beyond(t, from, to, r);
    ratios(to - from, x, line + from, mask, t->pedestal, r + from);
    t->good += good_pixels(to - from, mask);
    t->seen += to - from;
}

/* rx_rl_update() of n pixels, at most TOGETHER. */
RX_SIMD static void update_some(int n, const float *restrict f, const float *restrict c,
                                const float *restrict q, float *restrict next)
{
    float gain[TOGETHER];
#pragma omp simd
    for (int i = 0; i < n; i++)
        gain[i] = c[i] / (q[i] >= RX_RL_SHARE ? q[i] : RX_RL_SHARE);
#pragma omp simd
    for (int i = 0; i < n; i++)
        gain[i] = gain[i] > RX_RL_LEAST ? gain[i] : RX_RL_LEAST;
#pragma omp simd
    for (int i = 0; i < n; i++)
        gain[i] = c[i] < RX_RL_MOST * q[i] ? gain[i] : RX_RL_MOST;
#pragma omp simd
    for (int i = 0; i < n; i++)
        gain[i] = q[i] >= RX_RL_SHARE ? gain[i] : 1;
#pragma omp simd
    for (int i = 0; i < n; i++)
        gain[i] = f[i] > 0 ? gain[i] : 1;
#pragma omp simd
    for (int i = 0; i < n; i++)
        next[i] = f[i] * gain[i];
}

/* q: NULL for ones, as the stamp sums to 1 and so does K'^T W far from masks and borders. */
static void update(int n, const float *f, const float *c, const float *q, float *next)
{
    float ones[TOGETHER];
    for (int i = 0; i < TOGETHER; i++)
        ones[i] = 1;
    for (int i = 0; i < n; i += TOGETHER)
        update_some(n - i < TOGETHER ? n - i : TOGETHER, f + i, c + i, q != NULL ? q + i : ones, next + i);
}

static int within(int i, int least, int most)
{
    return i < least ? least : i > most ? most : i;
}

/* K'^T W of n pixels of the tile's row y from x on where nothing is masked: the part of the stamp that lies
 * on the tile. Returns 0 where that is all of it. */
static int share_on_tile(const task *t, int y, int x, int n, float *q)
{
    const rx_network_optics *o = t->optics;
    const int radius = o->relative.margin, size = 2 * radius + 1;
    const int top = within(radius - y, 0, size), bottom = within(o->height - y + radius, 0, size);
    const double *first = o->inside + (size_t)top * (size_t)(size + 1),
                 *last = o->inside + (size_t)bottom * (size_t)(size + 1);
    const int whole = bottom - top == size;
    if (whole && x >= radius && x + n + radius <= o->width)
        return 0;
    const float middle = whole ? 1 : (float)(last[size] - first[size]);
    for (int i = 0; i < n; i++)
        q[i] = middle;
    for (int i = 0; i < n; i++) {
        const int left = within(radius - (x + i), 0, size),
                  right = within(o->width - (x + i) + radius, 0, size);
        if (right - left < size)
            q[i] = (float)(last[right] - first[right] - (last[left] - first[left]));
        else /* on to where the border on the right comes near */
            i = within(o->width - radius - x - 1, i, n);
    }
    return 1;
}

static void write_update(void *user, int y, float *line)
{
    const task *t = user;
    const int from = t->left - t->work->domain.x, n = t->right - t->left;
    const size_t k = in_tile(t, y, from);
    float *q = in_domain(t, t->work->b, y, from);
    const int weighted =
        t->masked || (t->optics->inside != NULL && share_on_tile(t, t->work->domain.y + y, t->left, n, q));
    update(n, t->f + k, line + from, weighted ? q : NULL, t->dst + k);
}

static void write_tile(void *user, int y, float *line)
{
    const task *t = user;
    const int from = t->left - t->work->domain.x;
    memcpy(t->dst + in_tile(t, y, from), line + from, (size_t)(t->right - t->left) * sizeof *line);
}

static void write_left(void *user, int y, float *line)
{
    const task *t = user;
    const int from = t->left - t->work->domain.x, n = t->right - t->left;
    const float *x = t->x + in_tile(t, y, from);
    float *dst = t->dst + in_tile(t, y, from);
    for (int i = 0; i < n; i++)
        dst[i] = x[i] - line[from + i];
}

static void write_domain(void *user, int y, float *line)
{
    const task *t = user;
    const int from = t->left - t->work->domain.x;
    memcpy(in_domain(t, t->work->b, y, from), line + from, (size_t)(t->right - t->left) * sizeof *line);
}

static void write_support(void *user, int y, float *line)
{
    const task *t = user;
    const int from = t->left - t->work->domain.x, n = t->right - t->left;
    float *dst = t->dst + in_tile(t, y, from);
    for (int i = 0; i < n; i++) {
        const float share = 1 - line[from + i];
        dst[i] = share < RX_SUPPORT_FLOOR ? 0 : share > 1 ? 1 : share;
    }
}

/* The node's filter, whose weight falls from 1 at the node to 0 at the next ones. */
static void write_node(void *user, int y, float *line)
{
    const task *t = user;
    const rx_otf_grid *grid = &t->optics->grid;
    const int row = t->work->domain.y + y, nx = t->node % grid->nx, ny = t->node / grid->nx;
    const double hat_y = grid->ny == 1 ? 1 : 1 - fabs(row / grid->step_y - ny);
    const float *src = line - t->work->domain.x;
    float *dst = t->dst + (size_t)row * (size_t)t->optics->width;
    for (int x = t->left; x < t->right && hat_y > 0; x++) {
        const double hat_x = grid->nx == 1 ? 1 : 1 - fabs(x / grid->step_x - nx);
        if (hat_x > 0)
            dst[x] += (float)(hat_x * hat_y) * src[x];
    }
}

/* ---- tasks ---- */

static int node_below(double v, double step, int n)
{
    const int i = (int)floor(v / step);
    return i < n - 1 ? i : n - 1;
}

static rx_status filter_block(void *user, int thread, int bx, int by, rx_error *err)
{
    task t = task_of(user, thread, bx, by);
    const rx_blur_rows rows = rows_of(&t, t.read, t.write);
    (void)err;
    rx_blur_domain_apply(t.kernel, &t.work->domain, &rows);
    return RX_OK;
}

static rx_status tikhonov_block(void *user, int thread, int bx, int by, rx_error *err)
{
    task t = task_of(user, thread, bx, by);
    const rx_otf_grid *grid = &t.optics->grid;
    const rx_blur_domain *domain = &t.work->domain;
    const rx_blur_rows rows = rows_of(&t, read_tile, write_node);
    const int side = 2 * RX_TIKHONOV_REACH + 1;
    (void)err;
    rx_fft_forward_rows(domain->fft, read_tile, &t, domain->sum);
    for (int y = t.top; y < t.bottom; y++)
        memset(t.dst + (size_t)y * (size_t)t.optics->width + t.left, 0,
               (size_t)(t.right - t.left) * sizeof(float));
    const int last_x = node_below(t.right - 1, grid->step_x, grid->nx) + 1,
              last_y = node_below(t.bottom - 1, grid->step_y, grid->ny) + 1;
    for (int ny = node_below(t.top, grid->step_y, grid->ny); ny <= last_y && ny < grid->ny; ny++)
        for (int nx = node_below(t.left, grid->step_x, grid->nx); nx <= last_x && nx < grid->nx; nx++) {
            t.node = ny * grid->nx + nx;
            rx_convolve_spectrum(domain->fft, grid->filters + (size_t)t.node * side * side, side,
                                 t.work->spectrum);
            rx_convolve_multiply(domain->fft, t.work->spectrum, domain->sum, false, false, domain->half);
            rx_fft_inverse_rows(domain->fft, domain->half, rows.top, rows.bottom, write_node, &t);
        }
    return RX_OK;
}

rx_status rx_network_optics_tikhonov(const rx_network_optics *optics, const float *x, float *w,
                                     const rx_blocks_progress *progress, rx_error *err)
{
    task t = {.optics = optics,
              .tiling = &optics->far,
              .src = x,
              .dst = w,
              .kernel = &optics->tikhonov,
              .read = read_tile,
              .write = write_tile};
    return rx_blocks_run(&optics->far.blocks, optics->far.nthreads,
                         optics->tikhonov.n > 0 ? filter_block : tikhonov_block, &t, progress, err);
}

static rx_status step_block(void *user, int thread, int bx, int by, rx_error *err)
{
    task t = task_of(user, thread, bx, by);
    const rx_blur_domain *domain = &t.work->domain;
    const int w = rx_fft_width(domain->fft), h = rx_fft_height(domain->fft);
    (void)err;
    rx_blur_domain_apply(t.kernel, domain, &(rx_blur_rows){read_light, write_ratio, &t, 0, w, 0, h});
    /* of a varying PSF the border counts as well */
    t.masked = t.good < (t.optics->inside != NULL ? t.seen : (long)w * h);
    if (t.masked) {
        const rx_blur_rows rows = rows_of(&t, read_good, write_domain);
        rx_blur_domain_adjoint(t.kernel, domain, &rows);
    }
    const rx_blur_rows rows = rows_of(&t, read_ratio, write_update);
    rx_blur_domain_adjoint(t.kernel, domain, &rows);
    return RX_OK;
}

rx_status rx_network_optics_step(const rx_network_optics *optics, const rx_network_input *input,
                                 double pedestal, float *f, float *next, const rx_blocks_progress *progress,
                                 rx_error *err)
{
    task t = {.optics = optics,
              .tiling = &optics->near,
              .f = f,
              .x = input->x,
              .mask = input->mask,
              .pedestal = (float)pedestal,
              .kernel = &optics->relative,
              .dst = next};
    const rx_blocks_spent spent = {f, optics->width, optics->near.halo};
    return rx_blocks_run_spending(&optics->near.blocks, optics->near.nthreads, step_block, &t, &spent,
                                  progress, err);
}

rx_status rx_network_optics_left(const rx_network_optics *optics, const float *x, const float *f, float *dst,
                                 const rx_blocks_progress *progress, rx_error *err)
{
    task t = {.optics = optics,
              .tiling = &optics->near,
              .x = x,
              .f = f,
              .dst = dst,
              .kernel = &optics->relative,
              .read = read_light,
              .write = write_left};
    return rx_blocks_run(&optics->near.blocks, optics->near.nthreads, filter_block, &t, progress, err);
}

rx_status rx_network_optics_reblur(const rx_network_optics *optics, const float *f, float *dst,
                                   const rx_blocks_progress *progress, rx_error *err)
{
    task t = {.optics = optics,
              .tiling = &optics->near,
              .src = f,
              .dst = dst,
              .kernel = &optics->relative,
              .read = read_tile,
              .write = write_tile};
    return rx_blocks_run(&optics->near.blocks, optics->near.nthreads, filter_block, &t, progress, err);
}

static rx_status support_block(void *user, int thread, int bx, int by, rx_error *err)
{
    task t = task_of(user, thread, bx, by);
    const rx_blur_domain *domain = &t.work->domain;
    const int w = rx_fft_width(domain->fft), h = rx_fft_height(domain->fft);
    const rx_blur_rows rows = rows_of(&t, read_good, write_support);
    int from = 0, to = 0;
    (void)err;
    for (int y = 0; y < h; y++)
        if (on_tile(&t, y, &from, &to))
            t.good += good_pixels(to - from, t.mask + in_tile(&t, y, from));
    if (t.good < (long)w * h)
        rx_blur_domain_adjoint(t.kernel, domain, &rows);
    else
        for (int y = t.top; y < t.bottom; y++)
            memset(t.dst + (size_t)y * (size_t)t.optics->width + t.left, 0,
                   (size_t)(t.right - t.left) * sizeof(float));
    return RX_OK;
}

rx_status rx_network_optics_support(const rx_network_optics *optics, const uint8_t *mask, float *support,
                                    const rx_blocks_progress *progress, rx_error *err)
{
    rx_blur_kernel plain = {0};
    task t = {.optics = optics, .tiling = &optics->far, .mask = mask, .dst = support, .kernel = &plain};
    rx_status status = rx_blur_kernel_make(optics->far.work->domain.fft, optics->psf, optics->width,
                                           optics->height, &plain, err);
    if (status == RX_OK)
        status = rx_blocks_run(&optics->far.blocks, optics->far.nthreads, support_block, &t, progress, err);
    rx_blur_kernel_clear(&plain);
    return status;
}
