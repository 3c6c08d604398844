/* What stands between convolutions: plain loops over NHWC planes; planes and convolutions of nodes. */
#include "nn/layers.h"

#include <string.h>

/* ---- rows of planes ---- */

static void load(const rx_plane *src, size_t at, size_t n, float *restrict dst)
{
    if (src->real == RX_REAL_F32) {
        memcpy(dst, (const float *)src->data + at, n * sizeof(float));
        return;
    }
    const uint16_t *from = (const uint16_t *)src->data + at;
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        dst[i] = rx_bf16_widen(from[i]);
}

static void store(const float *restrict src, size_t n, rx_plane *dst, size_t at)
{
    if (dst->real == RX_REAL_F32) {
        memcpy((float *)dst->data + at, src, n * sizeof(float));
        return;
    }
    uint16_t *to = (uint16_t *)dst->data + at;
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        to[i] = rx_bf16_narrow(src[i]);
}

static void add_from(const rx_plane *src, size_t at, size_t n, float *restrict dst)
{
    if (src->real == RX_REAL_F32) {
        const float *from = (const float *)src->data + at;
#pragma omp simd
        for (size_t i = 0; i < n; i++)
            dst[i] += from[i];
        return;
    }
    const uint16_t *from = (const uint16_t *)src->data + at;
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        dst[i] += rx_bf16_widen(from[i]);
}

static void cut(float *values, size_t n)
{
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        values[i] = values[i] > 0 ? values[i] : 0;
}

/* ---- forward ---- */

void rx_layer_finish(rx_plane *dst, const rx_plane *add, int relu, float *row)
{
    size_t n = (size_t)dst->width * (size_t)dst->channels;
    for (int y = 0; y < dst->height; y++) {
        size_t at = (size_t)y * n;
        load(dst, at, n, row);
        if (add != NULL)
            add_from(add, at, n, row);
        if (relu)
            cut(row, n);
        store(row, n, dst, at);
    }
}

/* n pieces of so many bytes, at distances of `from_step` and `to_step`. */
static inline void move(const char *restrict from, size_t from_step, char *restrict to, size_t to_step,
                        size_t n, size_t bytes)
{
    for (size_t x = 0; x < n; x++)
        memcpy(to + x * to_step, from + x * from_step, bytes);
}

/* The usual pieces (one or three floats a pixel) are moved without a call. */
static void move_any(const char *from, size_t from_step, char *to, size_t to_step, size_t n, size_t bytes)
{
    if (bytes == 2 * sizeof(float))
        move(from, from_step, to, to_step, n, 2 * sizeof(float));
    else if (bytes == 6 * sizeof(float))
        move(from, from_step, to, to_step, n, 6 * sizeof(float));
    else
        move(from, from_step, to, to_step, n, bytes);
}

/* Between the pixel (2 y + dy, 2 x + dx) of the fine plane and the group [dy][dx] of the coarse pixel (y, x):
 * both are runs of the fine plane's channels. */
static void regroup(const rx_plane *src, rx_plane *dst, int to_fine)
{
    const rx_plane *fine = to_fine ? dst : src, *coarse = to_fine ? src : dst;
    /* The two pixels side by side in the fine plane are neighbours in the group, too. */
    const size_t pair = 2 * (size_t)fine->channels * rx_real_bytes(fine->real);
    const size_t width = (size_t)coarse->width;
    const char *from = src->data;
    char *to = dst->data;
    for (int y = 0; y < coarse->height; y++)
        for (size_t dy = 0; dy < 2; dy++) {
            const size_t a = (2 * (size_t)y + dy) * width * pair, b = (2 * (size_t)y * width + dy) * pair;
            if (to_fine)
                move_any(from + b, 2 * pair, to + a, pair, width, pair);
            else
                move_any(from + a, pair, to + b, 2 * pair, width, pair);
        }
}

void rx_layer_unshuffle(const rx_plane *src, rx_plane *dst)
{
    regroup(src, dst, 0);
}

void rx_layer_shuffle(const rx_plane *src, rx_plane *dst)
{
    regroup(src, dst, 1);
}

static int clamp(int i, int n)
{
    return i < 0 ? 0 : i >= n ? n - 1 : i;
}

/* Output row y takes 3/4 of row y/2 and 1/4 of the one on the other side; rows of the source count from the
 * one that the first two output rows are in, and there are `more` before that. */
static int other_row(int y, int height, int more)
{
    return clamp(y / 2 + (y % 2 != 0 ? 1 : -1) + more, height);
}

void rx_layer_up2(const rx_plane *src, rx_plane *dst, const rx_plane *add, int relu, float *row)
{
    size_t channels = (size_t)src->channels, n = (size_t)src->width * channels;
    const int more = (src->height - dst->height / 2) / 2;
    float *restrict mixed = row, *restrict far = row + n, *restrict out = row + 2 * n;
    for (int y = 0; y < dst->height; y++) {
        load(src, (size_t)(y / 2 + more) * n, n, mixed);
        load(src, (size_t)other_row(y, src->height, more) * n, n, far);
#pragma omp simd
        for (size_t i = 0; i < n; i++)
            mixed[i] = 0.75f * mixed[i] + 0.25f * far[i];
        for (int x = 0; x < src->width; x++) {
            const float *here = mixed + (size_t)x * channels;
            const float *left = mixed + (size_t)clamp(x - 1, src->width) * channels;
            const float *right = mixed + (size_t)clamp(x + 1, src->width) * channels;
            float *to = out + 2 * (size_t)x * channels;
#pragma omp simd
            for (size_t c = 0; c < channels; c++) {
                to[c] = 0.75f * here[c] + 0.25f * left[c];
                to[c + channels] = 0.75f * here[c] + 0.25f * right[c];
            }
        }
        size_t at = (size_t)y * 2 * n;
        if (add != NULL)
            add_from(add, at, 2 * n, out);
        if (relu)
            cut(out, 2 * n);
        store(out, 2 * n, dst, at);
    }
}

/* ---- backward ---- */

void rx_layer_up2_back(const rx_plane *ddst, rx_plane *dsrc, float *row)
{
    size_t channels = (size_t)dsrc->channels, n = (size_t)dsrc->width * channels;
    int last = 2 * dsrc->width - 1;
    float *to = dsrc->data;
    memset(to, 0, rx_plane_bytes(dsrc));
    for (int y = 0; y < ddst->height; y++) {
        const float *from = (const float *)ddst->data + (size_t)y * 2 * n;
        for (int x = 0; x < dsrc->width; x++) {
            const float *near = from + 2 * (size_t)x * channels;
            const float *left = from + (size_t)(x > 0 ? 2 * x - 1 : 0) * channels;
            const float *right = from + (size_t)(2 * x + 2 <= last ? 2 * x + 2 : last) * channels;
#pragma omp simd
            for (size_t c = 0; c < channels; c++)
                row[(size_t)x * channels + c] =
                    0.75f * (near[c] + near[c + channels]) + 0.25f * (left[c] + right[c]);
        }
        float *close = to + (size_t)(y / 2) * n, *far = to + (size_t)other_row(y, dsrc->height, 0) * n;
#pragma omp simd
        for (size_t i = 0; i < n; i++)
            close[i] += 0.75f * row[i];
#pragma omp simd
        for (size_t i = 0; i < n; i++)
            far[i] += 0.25f * row[i];
    }
}

void rx_layer_relu_back(const float *value, float *gradient, size_t n)
{
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        gradient[i] = value[i] > 0 ? gradient[i] : 0;
}

void rx_layer_add(const float *src, float *dst, size_t n)
{
#pragma omp simd
    for (size_t i = 0; i < n; i++)
        dst[i] += src[i];
}

/* ---- folds ---- */

/* share[d][v][r], see the header. */
static const float share[2][3][3] = {{{0.75f, 0.25f, 0}, {0.25f, 0.75f, 0}, {0, 0.75f, 0.25f}},
                                     {{0.25f, 0.75f, 0}, {0, 0.75f, 0.25f}, {0, 0.25f, 0.75f}}};

int rx_layer_folded_kernel(const rx_node *node)
{
    return node->op == RX_OP_UPCONV ? 3 : 2 * (node->kernel / 4) + 1;
}

/* Which elements of the node's kernel, with what shares, make up one element of the folded one. */
typedef struct recipe {
    int n;
    int element[RX_NET_KERNEL * RX_NET_KERNEL];
    float share[RX_NET_KERNEL * RX_NET_KERNEL];
} recipe;

static recipe recipe_of(const rx_node *n, int phase, int r, int s)
{
    recipe made = {.n = 0};
    int k = n->kernel, dy = phase / 2, dx = phase % 2, half = k / 2, reach = k / 4;
    for (int v = 0; v < k; v++)
        for (int u = 0; u < k; u++) {
            int meets = v == dy + half - 1 - 2 * (r - reach) && u == dx + half - 1 - 2 * (s - reach);
            float part = n->op == RX_OP_UPCONV ? share[dy][v][r] * share[dx][u][s] : (float)meets;
            if (part != 0) {
                made.element[made.n] = v * k + u;
                made.share[made.n++] = part;
            }
        }
    return made;
}

/* folded = of the weights, or, back, weights += of the folded ones. */
static void fold(const rx_node *node, int in, float *weights, float *folded, int back)
{
    const int big = rx_layer_folded_kernel(node), out = node->channels;
    const size_t area = (size_t)(node->kernel * node->kernel), big_area = (size_t)(big * big);
    for (int phase = 0; phase < 4; phase++)
        for (int rs = 0; rs < big * big; rs++) {
            recipe made = recipe_of(node, phase, rs / big, rs % big);
            for (int o = 0; o < out; o++)
                for (int i = 0; i < in; i++) {
                    float *own =
                        weights + (size_t)(node->op == RX_OP_UPCONV ? o * in + i : i * out + o) * area;
                    float *one = folded + (size_t)((phase * out + o) * in + i) * big_area + rs, sum = 0;
                    for (int e = 0; e < made.n; e++)
                        if (back)
                            own[made.element[e]] += made.share[e] * *one;
                        else
                            sum += made.share[e] * own[made.element[e]];
                    if (!back)
                        *one = sum;
                }
        }
}

void rx_layer_unfold(const rx_node *node, int in, const float *folded, float *weights)
{
    fold(node, in, weights, (float *)(size_t)folded, 1);
}

/* ---- planes and convolutions of nodes ---- */

static int moves_only(rx_op op)
{
    return op == RX_OP_UNSHUFFLE || op == RX_OP_SHUFFLE;
}

static void choose_reals(const rx_net *net, rx_precision precision, rx_node_planes *planes)
{
    for (int i = 0; i < net->nnodes; i++)
        planes[i].value.real =
            precision == RX_F32 || i == 0 || i == net->nnodes - 1 ? RX_REAL_F32 : RX_REAL_BF16;
    for (int changed = 1; changed;) {
        changed = 0;
        for (int i = 1; i < net->nnodes; i++) {
            const rx_node *n = &net->node[i];
            rx_real *mine = &planes[i].value.real, *source = &planes[n->src].value.real;
            if ((moves_only(n->op) || rx_node_folds(n)) && *source == RX_REAL_F32 && *mine != RX_REAL_F32) {
                *mine = RX_REAL_F32;
                changed = 1;
            }
            if (moves_only(n->op) && *mine == RX_REAL_F32 && *source != RX_REAL_F32) {
                *source = RX_REAL_F32;
                changed = 1;
            }
        }
    }
}

void rx_net_planes(const rx_net *net, rx_precision precision, int height, int width, rx_node_planes *dst)
{
    memset(dst, 0, (size_t)net->nnodes * sizeof *dst);
    choose_reals(net, precision, dst);
    for (int i = 0; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        rx_plane *value = &dst[i].value;
        value->height = height >> n->level;
        value->width = width >> n->level;
        value->channels = n->channels;
        if (!rx_node_folds(n))
            continue;
        dst[i].raw = dst[n->src].value;
        dst[i].raw.channels = 4 * n->channels;
        dst[i].raw.real = value->real;
    }
}

rx_conv_shape rx_net_conv(const rx_net *net, int i, const rx_node_planes *planes)
{
    const rx_node *n = &net->node[i];
    const rx_plane *src = &planes[n->src].value;
    const int folds = rx_node_folds(n), kernel = folds ? rx_layer_folded_kernel(n) : n->kernel,
              stride = folds ? 1 : n->stride, half = kernel / 2;
    return (rx_conv_shape){.height = src->height,
                           .width = src->width,
                           .in = src->channels,
                           .out = folds ? 4 * n->channels : n->channels,
                           .kernel = kernel,
                           .stride = stride,
                           .before = half,
                           .after = stride == 2 && half > 0 ? half - 1 : half,
                           .x = src->real,
                           .y = planes[i].value.real,
                           .sum = !folds && n->add >= 0,
                           .relu = !folds && n->relu};
}

void rx_net_conv_params(const rx_net *net, int i, const float *params, float *folded, const float **weights,
                        const float **bias)
{
    const rx_node *n = &net->node[i];
    const size_t out = (size_t)n->channels;
    *weights = params + n->weight;
    *bias = params + n->bias;
    if (!rx_node_folds(n))
        return;
    const int in = net->node[n->src].channels, k = rx_layer_folded_kernel(n);
    float *biases = folded + 4 * out * (size_t)(in * k * k);
    fold(n, in, (float *)(size_t)*weights, folded, 0);
    for (size_t phase = 0; phase < 4; phase++)
        memcpy(biases + phase * out, *bias, out * sizeof(float));
    *weights = folded;
    *bias = biases;
}

size_t rx_net_folded(const rx_net *net)
{
    size_t folded = 1;
    for (int i = 1; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        if (!rx_node_folds(n))
            continue;
        const size_t k = (size_t)rx_layer_folded_kernel(n), in = (size_t)net->node[n->src].channels;
        const size_t floats = 4 * (size_t)n->channels * (in * k * k + 1);
        folded = floats > folded ? floats : folded;
    }
    return folded;
}

size_t rx_net_row(const rx_net *net, const rx_node_planes *planes)
{
    size_t row = 1;
    for (int i = 0; i < net->nnodes; i++) {
        const size_t line = (size_t)planes[i].value.width * (size_t)planes[i].value.channels;
        row = 4 * line > row ? 4 * line : row;
    }
    return row;
}
