/* A network on a band of rows that moves down.
 *
 * All nodes make the same number of rows in a step (at their own resolution); step t makes the rows
 *
 *   t rows - delay  ..  (t + 1) rows - delay - 1
 *
 * of a node, counted from the first input row above the block, with the smallest delay for which its sources
 * have what it reads. */
#include "nn/stream.h"

#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "base/memory.h"
#include "base/min_max.h"
#include "nn/direct.h"
#include "nn/layers.h"

enum { STEP = 16 }; /* input rows */

/* What a node keeps: `history` rows and those of this step, which begin at row `at` of its memory. */
typedef struct band {
    int rows, delay, history, room, at;
    int behind, behind_add; /* the first row that it reads of src and add lies so far before their newest */
    size_t bytes;           /* of a row */
    char *data;             /* owned */
} band;

struct rx_stream {
    const rx_net *net;
    rx_precision precision;
    int step, halo, width, made;
    int margin[RX_NET_NODES]; /* of each node, beyond the block */
    rx_node_planes node[RX_NET_NODES];
    rx_direct *direct[RX_NET_NODES]; /* convolutions; owned, like all below */
    int fine[RX_NET_NODES];          /* the whole of a node that folds, in one */
    band band[RX_NET_NODES];
    void *raw;
    float *row, *folded, *scratch;
    rx_stream_cost *cost; /* the caller's; NULL: not wanted */
};

/* ---- plan ---- */

/* Rows that a kernel reads above and below its own; strided 1x1 ones run as 2x2. */
static int above(const rx_node *n)
{
    return rx_node_folds(n) ? rx_layer_folded_kernel(n) / 2 : n->kernel / 2;
}

static int below(const rx_node *n)
{
    return n->kernel == 1 && n->stride == 2 ? 1 : above(n);
}

static int half_up(int n)
{
    return (n + 1) / 2;
}

/* Delay of a node whose source has the delay d. */
static int delay_after(const rx_node *n, int d)
{
    switch (n->op) {
    case RX_OP_CONV:
        return n->stride == 1 ? d + below(n) : half_up(d + below(n) - 1);
    case RX_OP_UNSHUFFLE:
        return half_up(d);
    case RX_OP_SHUFFLE:
        return 2 * d;
    case RX_OP_UP2:
        return 2 * (d + 1);
    default: /* folded */
        return 2 * (d + below(n));
    }
}

/* How far the first source row of a step lies before that of the source's step, for delays of the two. */
static int behind(const rx_node *n, int delay, int source)
{
    switch (n->op) {
    case RX_OP_CONV:
        return n->stride * delay + above(n) - source;
    case RX_OP_UNSHUFFLE:
        return 2 * delay - source;
    case RX_OP_SHUFFLE:
        return delay / 2 - source;
    case RX_OP_UP2:
        return delay / 2 + 1 - source;
    default:
        return delay / 2 + above(n) - source;
    }
}

static void plan_bands(const rx_net *net, int step, const rx_node_planes *node, band *bands)
{
    for (int i = 0; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        const rx_plane *value = &node[i].value;
        band *b = &bands[i];
        *b = (band){.rows = step >> n->level};
        b->bytes = (size_t)value->width * (size_t)value->channels * rx_real_bytes(value->real);
        if (i == 0)
            continue;
        b->delay = delay_after(n, bands[n->src].delay);
        if (n->add >= 0)
            b->delay = rx_max_int(b->delay, bands[n->add].delay);
        if (n->op == RX_OP_SHUFFLE || n->op == RX_OP_UP2 || n->op == RX_OP_UPCONV ||
            n->op == RX_OP_TRANSPOSED) /* rows in pairs */
            b->delay += b->delay % 2;
        b->behind = behind(n, b->delay, bands[n->src].delay);
        bands[n->src].history = rx_max_int(bands[n->src].history, b->behind);
        if (n->add < 0)
            continue;
        b->behind_add = b->delay - bands[n->add].delay;
        bands[n->add].history = rx_max_int(bands[n->add].history, b->behind_add);
    }
    /* A row is moved once for two steps of its history's length at most. */
    for (int i = 0; i < net->nnodes; i++)
        bands[i].room = bands[i].history + rx_max_int(2 * bands[i].history, bands[i].rows);
}

static size_t raw_bytes(const rx_net *net, const rx_node_planes *node)
{
    size_t most = 1;
    for (int i = 0; i < net->nnodes; i++)
        if (node[i].raw.channels > 0 && rx_plane_bytes(&node[i].raw) > most)
            most = rx_plane_bytes(&node[i].raw);
    return most;
}

static int step_of(const rx_net *net)
{
    const int unit = 1 << rx_net_levels(net);
    return unit > STEP ? unit : STEP;
}

double rx_stream_bytes(const rx_net *net, int width, rx_precision precision)
{
    rx_node_planes node[RX_NET_NODES];
    band bands[RX_NET_NODES];
    const int step = step_of(net);
    rx_net_planes(net, precision, step, width + 2 * rx_net_halo(net), node);
    plan_bands(net, step, node, bands);
    double bytes = (double)raw_bytes(net, node);
    for (int i = 0; i < net->nnodes; i++)
        bytes += (double)bands[i].room * (double)bands[i].bytes;
    return bytes;
}

/* ---- making ---- */

static rx_status check(const rx_net *net, int width, rx_precision precision, rx_error *err)
{
    enum { LARGEST = 1 << 20 };
    const int unit = 1 << rx_net_levels(net);
    if (width < unit || width % unit != 0 || width > LARGEST)
        return rx_error_set(err, RX_INPUT,
                            "the network cannot work on blocks of %d columns; these must be a positive "
                            "multiple of %d",
                            width, unit);
    if (precision == RX_BF16 && !rx_direct_has_bf16())
        return rx_error_set(err, RX_USAGE, "this processor does not multiply bfloat16; choose F32");
    return RX_OK;
}

/* The convolution with all that follows it, or, of a node that folds into no fine one, with what comes before the
 * shuffle. */
static rx_status make_conv(rx_stream *s, int i, rx_error *err)
{
    const rx_node *n = &s->net->node[i];
    const float *weights, *bias;
    rx_conv_shape shape = rx_net_conv(s->net, i, s->node);
    const int last = rx_node_folds(n) ? s->node[i].raw.height - 1 : n->stride * (s->band[i].rows - 1);
    shape.height = above(n) + last + 1 + below(n);
    if (n->op == RX_OP_UPCONV && n->add < 0) {
        rx_conv_shape whole = shape;
        whole.relu = n->relu;
        if ((s->fine[i] = rx_direct_can_fine(&whole)))
            shape = whole;
    }
    /* A folded TRANSPOSED has zeros in its kernel where it may stand beside values that depend on the block;
     * Winograd's sums would carry these into the last bit. */
    const rx_direct_options options = {.fine = s->fine[i], .winograd = n->op != RX_OP_TRANSPOSED};
    rx_net_conv_params(s->net, i, s->net->params, s->folded, &weights, &bias);
    return rx_direct_new(&shape, options, weights, bias, &s->direct[i], err);
}

static rx_status make(rx_stream *s, rx_error *err)
{
    rx_net_planes(s->net, s->precision, s->step, s->width, s->node);
    plan_bands(s->net, s->step, s->node, s->band);
    const size_t raw = raw_bytes(s->net, s->node);
    s->raw = rx_alloc(raw, 1);
    s->row = RX_NEW(float, rx_net_row(s->net, s->node));
    s->folded = RX_NEW(float, rx_net_folded(s->net));
    s->scratch = RX_NEW(float, rx_direct_scratch());
    if (s->raw == NULL || s->row == NULL || s->folded == NULL || s->scratch == NULL)
        return rx_error_memory(err, raw);
    rx_status status = RX_OK;
    for (int i = 0; i < s->net->nnodes && status == RX_OK; i++) {
        band *b = &s->band[i];
        s->node[i].raw.data = s->raw;
        /* a row of zeros before and after: a folded TRANSPOSED reads a column more, whose weights are 0 */
        char *memory = rx_alloc((size_t)b->room + 2, b->bytes);
        if (memory == NULL)
            return rx_error_memory(err, ((size_t)b->room + 2) * b->bytes);
        b->data = memory + b->bytes;
        if (s->net->node[i].weight >= 0)
            status = make_conv(s, i, err);
    }
    return status;
}

rx_status rx_stream_new(const rx_net *net, int width, rx_precision precision, rx_stream **dst, rx_error *err)
{
    *dst = NULL;
    RX_TRY(check(net, width, precision, err));
    rx_stream *s;
    RX_TRY(RX_MAKE(s, 1, err));
    s->net = net;
    s->step = step_of(net);
    s->halo = rx_net_halo(net);
    s->width = width + 2 * s->halo;
    s->precision = precision;
    rx_net_margins(net, s->margin);
    *dst = s;
    return RX_OK;
}

/* Back to a stream that has not run. */
static void clear(rx_stream *s)
{
    for (int i = 0; i < RX_NET_NODES; i++) {
        rx_direct_free(s->direct[i]);
        if (s->band[i].data != NULL)
            free(s->band[i].data - s->band[i].bytes);
        s->direct[i] = NULL;
        s->band[i].data = NULL;
    }
    free(s->raw);
    free(s->row);
    free(s->folded);
    free(s->scratch);
    s->raw = s->row = s->folded = s->scratch = NULL;
}

void rx_stream_free(rx_stream *stream)
{
    if (stream == NULL)
        return;
    clear(stream);
    free(stream);
}

void rx_stream_measure(rx_stream *stream, rx_stream_cost *cost)
{
    stream->cost = cost;
}

/* ---- work ---- */

static void move_on(band *b)
{
    if (b->at + 2 * b->rows <= b->room) {
        b->at += b->rows;
        return;
    }
    memmove(b->data, b->data + (size_t)(b->at + b->rows - b->history) * b->bytes,
            (size_t)b->history * b->bytes);
    b->at = b->history;
}

/* The plane of a node that begins `before` rows before those of this step. */
static rx_plane plane_at(const rx_stream *s, int i, int before)
{
    rx_plane plane = s->node[i].value;
    plane.data = s->band[i].data + (size_t)(s->band[i].at - before) * s->band[i].bytes;
    return plane;
}

/* Columns and rows of a node that the block depends on, of the rows from `first` on that a step makes. */
static rx_direct_area area_of(const rx_stream *s, int i, int first, int height)
{
    const int level = s->net->node[i].level, margin = s->margin[i], begin = s->halo >> level;
    rx_direct_area a = {.left = begin - margin,
                        .right = ((s->width - s->halo) >> level) + margin,
                        .first = begin - margin - first,
                        .last = ((s->halo + height) >> level) + margin - first};
    a.first = rx_max_int(a.first, 0);
    a.last = rx_min_int(a.last, s->band[i].rows);
    return a;
}

static double flops_of(const rx_stream *s, int i, rx_direct_area area)
{
    const rx_node *n = &s->net->node[i];
    const int folds = rx_node_folds(n), k = folds ? rx_layer_folded_kernel(n) : n->kernel;
    const double outputs =
        (double)(area.right - area.left) * (area.last - area.first) * (folds ? 4 : 1) * n->channels;
    return n->weight < 0 ? 0 : 2.0 * k * k * s->net->node[n->src].channels * outputs;
}

/* area: in which values are asked for; of a node that folds, in a plane of half the size. */
static void step_node(rx_stream *s, int i, rx_direct_area area)
{
    const rx_node *n = &s->net->node[i];
    const double begun = s->cost != NULL ? rx_seconds() : 0;
    rx_plane value = plane_at(s, i, 0), src = plane_at(s, n->src, s->band[i].behind), sum = {0};
    const rx_plane *add = n->add >= 0 ? &sum : NULL;
    if (n->op == RX_OP_UP2)
        src.height += 2;
    if (add != NULL)
        sum = plane_at(s, n->add, s->band[i].behind_add);
    if (s->direct[i] != NULL && (s->fine[i] || !rx_node_folds(n))) {
        rx_direct_run(s->direct[i], &src, add, &value, area, s->scratch);
    } else if (n->op == RX_OP_UP2) {
        if (!rx_direct_up2(&src, add, n->relu, &value, area))
            rx_layer_up2(&src, &value, add, n->relu, s->row);
    } else {
        if (s->direct[i] != NULL)
            rx_direct_run(s->direct[i], &src, NULL, &s->node[i].raw, area, s->scratch);
        if (n->op == RX_OP_UNSHUFFLE)
            rx_layer_unshuffle(&src, &value);
        else
            rx_layer_shuffle(s->direct[i] != NULL ? &s->node[i].raw : &src, &value);
        if (add != NULL || n->relu)
            rx_layer_finish(&value, add, n->relu, s->row);
    }
    if (s->cost != NULL) {
        s->cost[i].seconds += rx_seconds() - begun;
        s->cost[i].flops += flops_of(s, i, area);
    }
}

static void take_rows(const rx_stream *s, const rx_stream_ends *ends, int first, int height)
{
    const int last = s->net->nnodes - 1, rows = s->band[last].rows, level = s->net->node[last].level;
    const int y = first - (s->halo >> level), end = height >> level;
    const int from = y < 0 ? -y : 0, to = y + rows > end ? end - y : rows;
    const rx_plane value = plane_at(s, last, -from);
    if (from < to)
        ends->take(ends->user, y + from, to - from, value.data);
}

/* In the first run, by its thread: streams that run side by side are made side by side. */
static rx_status prepare(rx_stream *s, rx_error *err)
{
    if (s->made)
        return RX_OK;
    const rx_status status = make(s, err);
    s->made = status == RX_OK;
    if (!s->made)
        clear(s);
    return status;
}

rx_status rx_stream_run(rx_stream *stream, int height, const rx_stream_ends *ends, rx_error *err)
{
    const int last = stream->net->nnodes - 1;
    const int end = (stream->halo + height) >> stream->net->node[last].level;
    RX_TRY(prepare(stream, err));
    const int rows = stream->band[last].rows;
    for (int i = 0; i <= last; i++)
        stream->band[i].at = stream->band[i].history;
    for (int t = 0; t * rows - stream->band[last].delay < end; t++) {
        for (int i = 0; i <= last; i++) {
            const int first = t * stream->band[i].rows - stream->band[i].delay;
            if (t > 0)
                move_on(&stream->band[i]);
            const rx_direct_area area = area_of(stream, i, first, height);
            if (area.first >= area.last)
                continue;
            const rx_direct_area half = {area.left / 2, half_up(area.right), area.first / 2,
                                         half_up(area.last)};
            if (i > 0)
                step_node(stream, i, rx_node_folds(&stream->net->node[i]) ? half : area);
            else
                ends->give(ends->user, first - stream->halo, stream->step, plane_at(stream, 0, 0).data);
        }
        take_rows(stream, ends, t * rows - stream->band[last].delay, height);
    }
    return RX_OK;
}
