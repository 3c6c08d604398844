/* Convolutions of a band of rows by the definition, on the vectors of the file that includes it, which also
 * has fine_pixels(). */
#ifndef RX_NN_DIRECT_ROWS_H
#define RX_NN_DIRECT_ROWS_H

/* Adds, cuts and stores the first `lanes` of a vector of outputs of the plane y, which begin `at` numbers after its
 * first; add NULL: none. Fewer than all lanes only of floats. */
PART void finish(const rx_direct *d, const rx_plane *add, void *y, size_t at, vector value, int lanes)
{
    if (add != NULL)
        value = v_add(value, lanes < LANES ? v_load_first(lanes, (const float *)add->data + at)
                                           : load_reals(add->real, add->data, at));
    if (d->shape.relu)
        value = v_max(value, v_zero());
    if (lanes < LANES)
        v_store_first(lanes, (float *)y + at, value);
    else
        store_reals(d->shape.y, value, y, at);
}

/* ---- wide ---- */

/* Outputs side by side: where the words that they read, they and their weights begin. */
typedef struct run {
    const word *x;
    size_t row, before;  /* words of x: from a row to the next, that are read on the left of a pixel */
    const rx_plane *add; /* NULL: none */
    void *y;
    size_t at; /* of the first one in the planes y and add */
    const float *weights, *bias;
    int last; /* lanes of the last vector */
} run;

/* How a row is made: vectors of outputs side by side, words from one output's input to the next one's, reals of x.
 * Constants to the compiler. */
typedef struct way {
    int blocks, step, bf16;
} way;

/* One word of each pixel that n outputs of a kernel of 3 columns read, from x on: each is loaded once. */
PART void three_columns(const word *x, const float *w, size_t column, int n, way how, vector *sum)
{
    const int blocks = how.blocks;
    vector weight[6];
#pragma GCC unroll 6
    for (int k = 0; k < 3 * blocks; k++)
        weight[k] = v_load(w + (size_t)(k / blocks) * column + LANES * (k % blocks));
#pragma GCC unroll 26
    for (int q = 0; q < n + 2; q++) {
        const vector same = v_same(x[q * how.step]);
#pragma GCC unroll 3
        for (int u = 0; u < 3; u++)
            if (q >= u && q - u < n)
#pragma GCC unroll 2
                for (int b = 0; b < blocks; b++)
                    sum[(q - u) * blocks + b] =
                        multiply_add(how.bf16, same, weight[u * blocks + b], sum[(q - u) * blocks + b]);
    }
}

/* n pixels, `blocks` vectors of outputs; n blocks <= ACCUMULATORS, so that all sums stay in registers. */
PART void wide_pixels(const rx_direct *d, const run *r, size_t pixel, int n, way how)
{
    const int blocks = how.blocks, step = how.step, bf16 = how.bf16;
    const int kernel = d->shape.kernel, stride = d->shape.stride, words = d->words;
    const float *w = r->weights;
    const word *x = r->x + (pixel * (size_t)step - r->before);
    vector sum[ACCUMULATORS];
#pragma GCC unroll 24
    for (int k = 0; k < n * blocks; k++)
        sum[k] = v_load(r->bias + LANES * (k % blocks));
    if (kernel == 3 && stride == 1)
        for (int v = 0; v < 3; v++, x += r->row, w += 2 * words * LANES * blocks)
            for (int i = 0; i < words; i++, w += LANES * blocks)
                three_columns(x + i, w, (size_t)(words * LANES * blocks), n, how, sum);
    else
        for (int v = 0; v < kernel; v++, x += r->row) {
            const word *from = x;
            for (int word = 0; word < kernel * words; word++, from++, w += LANES * blocks) {
                const vector w0 = v_load(w), w1 = v_load(w + LANES * (blocks - 1));
#pragma GCC unroll 24
                for (int p = 0; p < n; p++) {
                    const vector same = v_same(from[p * step]);
                    sum[p * blocks] = multiply_add(bf16, same, w0, sum[p * blocks]);
                    if (blocks == 2)
                        sum[p * blocks + 1] = multiply_add(bf16, same, w1, sum[p * blocks + 1]);
                }
            }
        }
    const size_t out = (size_t)d->shape.out;
#pragma GCC unroll 24
    for (int k = 0; k < n * blocks; k++)
        finish(d, r->add, r->y, r->at + (pixel + (size_t)(k / blocks)) * out + (size_t)(LANES * (k % blocks)),
               sum[k], k % blocks == blocks - 1 ? r->last : LANES);
}

/* The last pixels of a row are made with some before them once more: the same bits. */
PART void wide_row(const rx_direct *d, const run *r, int left, int right, way how)
{
    const int most = ACCUMULATORS / how.blocks, half = most / 2;
    int x = left;
    for (; x + most <= right; x += most)
        wide_pixels(d, r, (size_t)x, most, how);
    if (right - x > half && right - left >= most) {
        wide_pixels(d, r, (size_t)(right - most), most, how);
    } else if (right > x && right - left >= half) {
        for (; right - x > half; x += half)
            wide_pixels(d, r, (size_t)x, half, how);
        wide_pixels(d, r, (size_t)(right - half), half, how);
    } else {
        for (; x < right; x++)
            wide_pixels(d, r, (size_t)x, 1, how);
    }
}

typedef void row_function(const rx_direct *d, const run *r, int left, int right);

/* One function for each usual way to step through the words of a pixel, and one for all others. */
#define ROW(name, vectors, words, reals)                                                                     \
    WIDE static void name(const rx_direct *d, const run *r, int left, int right)                             \
    {                                                                                                        \
        wide_row(d, r, left, right, (way){vectors, (words) > 0 ? (words) : d->step, reals});                 \
    }
#define ROWS(step, bf16)                                                                                     \
    ROW(row_##bf16##_1_##step, 1, step, bf16)                                                                \
    ROW(row_##bf16##_2_##step, 2, step, bf16)
#define CHOICE(step, bf16)                                                                                   \
    {                                                                                                        \
        step,                                                                                                \
        {                                                                                                    \
            row_##bf16##_1_##step, row_##bf16##_2_##step                                                     \
        }                                                                                                    \
    }
#define EACH(what, bf16)                                                                                     \
    what(8, bf16) SEPARATOR what(12, bf16)                                                                   \
    SEPARATOR what(16, bf16)                                                                                 \
    SEPARATOR what(32, bf16)                                                                                 \
    SEPARATOR what(64, bf16)                                                                                 \
    SEPARATOR what(0, bf16)

/* By the number of blocks less 1; the last one has step 0. */
typedef struct choice {
    int step;
    row_function *row[2];
} choice;

#define SEPARATOR
EACH(ROWS, 0)
#if WITH_BF16
EACH(ROWS, 1)
#endif
#undef SEPARATOR
#define SEPARATOR ,
static const choice choices[] = {EACH(CHOICE, 0)};
#if WITH_BF16
static const choice bf16_choices[] = {EACH(CHOICE, 1)};
#else
#define bf16_choices choices
#endif

static row_function *row_of(const rx_direct *d)
{
    const choice *c = d->shape.x == RX_REAL_F32 ? choices : bf16_choices;
    while (c->step != 0 && c->step != d->step)
        c++;
    return c->row[d->blocks - 1];
}

static void run_wide(const rx_direct *d, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                     rx_direct_area area)
{
    const rx_conv_shape *s = &d->shape;
    row_function *row = row_of(d);
    const size_t line = (size_t)x->width * (size_t)d->words, block = (size_t)(LANES * d->blocks);
    const size_t line_y = (size_t)y->width * (size_t)s->out;
    const size_t all = (size_t)(s->kernel * s->kernel * d->words) * block;
    for (int v = area.first; v < area.last; v++)
        for (size_t b = 0; b * block < (size_t)s->out; b++) {
            const int rest = s->out - (int)((b + 1) * block) + LANES;
            const run r = {.last = rest < LANES ? rest : LANES,
                           .x = (const word *)x->data + (size_t)(v * s->stride) * line,
                           .row = line,
                           .before = (size_t)(s->before * d->words),
                           .add = add,
                           .y = y->data,
                           .at = (size_t)v * line_y + b * block,
                           .weights = (const float *)d->weights + b * all,
                           .bias = d->bias + b * block};
            row(d, &r, area.left, area.right);
        }
}

/* ---- fine ---- */

WIDE static void run_fine(const rx_direct *d, const rx_plane *x, const rx_plane *y, rx_direct_area area)
{
    const size_t line = (size_t)x->width * (size_t)d->words;
    for (int v = area.first; v < area.last; v++) {
        const word *from = (const word *)x->data + (size_t)v * line;
        float *to = (float *)y->data + 2 * (size_t)v * (size_t)y->width;
        for (int u = area.left; u < area.right; u += FINE_PIXELS) {
            float *const out[2] = {to + 2 * u, to + y->width + 2 * u};
            const word *begin = from + (size_t)(u - d->shape.before) * (size_t)d->words;
            const int n = area.right - u < FINE_PIXELS ? area.right - u : FINE_PIXELS;
            if (d->shape.x == RX_REAL_BF16)
                fine_pixels(d, begin, line, n, out, 1);
            else
                fine_pixels(d, begin, line, n, out, 0);
        }
    }
}

/* ---- bilinear ---- */

PART vector near_and_far(vector near, vector far)
{
    return v_add(v_mul(v_same(0.75f), near), v_mul(v_same(0.25f), far));
}

WIDE static void run_up2(const rx_plane *src, const rx_plane *add, int relu, const rx_plane *dst,
                         rx_direct_area area)
{
    const size_t channels = (size_t)src->channels, line = (size_t)src->width * channels;
    for (int y = area.first; y < area.last; y++) {
        /* where rows of src and dst begin, in numbers */
        const size_t near = (size_t)(y / 2 + 1) * line, far = y % 2 == 0 ? near - line : near + line;
        const size_t at = (size_t)y * 2 * line;
        for (int x = area.left; x < area.right; x++)
            for (size_t c = 0; c < channels; c += LANES) {
                const size_t to = at + (size_t)x * channels + c, here = (size_t)(x / 2) * channels + c;
                const size_t side = x % 2 == 0 ? here - channels : here + channels;
                const vector a = near_and_far(load_reals(src->real, src->data, near + here),
                                              load_reals(src->real, src->data, far + here));
                const vector b = near_and_far(load_reals(src->real, src->data, near + side),
                                              load_reals(src->real, src->data, far + side));
                vector value = near_and_far(a, b);
                if (add != NULL)
                    value = v_add(value, load_reals(add->real, add->data, to));
                if (relu)
                    value = v_max(value, v_zero());
                store_reals(dst->real, value, dst->data, to);
            }
    }
}

/* ---- gradient by the weights ---- */

enum { INPUTS = ACCUMULATORS / 3 }; /* whose gradients by two vectors of outputs stay in registers */

/* Of one place of the kernel, from a row of n outputs: dw[inputs][out] += sum x dy. */
typedef struct gradient {
    const float *x, *dy;
    size_t step, out; /* floats from an output's x, and dy, to the next one's */
    int n, last;      /* last: lanes of the last vector */
    float *dw;
} gradient;

PART void add_gradient(gradient g, int inputs, int blocks, int last)
{
    vector sum[2 * INPUTS];
#pragma GCC unroll 16
    for (int k = 0; k < inputs * blocks; k++)
        sum[k] = v_zero();
    for (int p = 0; p < g.n; p++, g.x += g.step, g.dy += g.out) {
        const vector d1 = v_load_first(last, g.dy + LANES * (blocks - 1)),
                     d0 = blocks == 2 ? v_load(g.dy) : d1;
#pragma GCC unroll 8
        for (int i = 0; i < inputs; i++) {
            const vector same = v_same(g.x[i]);
            sum[i * blocks] = v_multiply_add(same, d0, sum[i * blocks]);
            if (blocks == 2)
                sum[i * blocks + 1] = v_multiply_add(same, d1, sum[i * blocks + 1]);
        }
    }
#pragma GCC unroll 16
    for (int k = 0; k < inputs * blocks; k++) {
        float *to = g.dw + (size_t)(k / blocks) * g.out + (size_t)(LANES * (k % blocks));
        if (k % blocks == blocks - 1)
            v_store_first(last, to, v_add(v_load_first(last, to), sum[k]));
        else
            v_store(to, v_add(v_load(to), sum[k]));
    }
}

/* Full vectors are constants to the compiler. */
#define ADD_GRADIENT(inputs, blocks)                                                                         \
    (g.last < LANES ? add_gradient(g, inputs, blocks, g.last) : add_gradient(g, inputs, blocks, LANES))

WIDE static void run_weights(const rx_conv_shape *s, const rx_plane *x, const rx_plane *dy, float *dw)
{
    const size_t in = (size_t)s->in, out = (size_t)s->out, line = (size_t)x->width * in;
    for (int v = 0; v < dy->height; v++)
        for (int place = 0; place < s->kernel * s->kernel; place++)
            for (size_t i = 0, inputs; i < in; i += inputs) {
                inputs = in - i >= INPUTS ? INPUTS : in - i >= INPUTS / 2 ? INPUTS / 2 : 1;
                for (size_t o = 0, blocks; o < out; o += blocks * LANES) {
                    blocks = out - o > LANES ? 2 : 1;
                    const size_t row = (size_t)(v * s->stride + place / s->kernel) * line,
                                 column = (size_t)(place % s->kernel) * in;
                    const gradient g = {
                        .x = (const float *)x->data + row + column + i,
                        .dy = (const float *)dy->data + (size_t)v * (size_t)dy->width * out + o,
                        .step = (size_t)s->stride * in,
                        .out = out,
                        .n = dy->width,
                        .last = (int)(out - o < blocks * LANES ? out - o - (blocks - 1) * LANES : LANES),
                        .dw = dw + ((size_t)place * in + i) * out + o};
                    if (inputs == INPUTS && blocks == 2)
                        ADD_GRADIENT(INPUTS, 2);
                    else if (inputs == INPUTS)
                        ADD_GRADIENT(INPUTS, 1);
                    else if (inputs == INPUTS / 2 && blocks == 2)
                        ADD_GRADIENT(INPUTS / 2, 2);
                    else if (inputs == INPUTS / 2)
                        ADD_GRADIENT(INPUTS / 2, 1);
                    else if (blocks == 2)
                        ADD_GRADIENT(1, 2);
                    else
                        ADD_GRADIENT(1, 1);
                }
            }
}

#endif
