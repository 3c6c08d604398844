/* Convolutions of a band of rows by the definition, on the vectors of the file that includes it, which also
 * has fine_pixels(). */
#ifndef RX_NN_DIRECT_ROWS_H
#define RX_NN_DIRECT_ROWS_H

/* Adds, cuts and stores a vector of outputs of the plane y, which begin `at` numbers after its first; add
 * NULL: none. */
PART void finish(const rx_direct *d, const rx_plane *add, void *y, size_t at, vector value)
{
    if (add != NULL)
        value = v_add(value, load_reals(add->real, add->data, at));
    if (d->shape.relu)
        value = v_max(value, v_zero());
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
} run;

/* One word of each pixel that n outputs of a kernel of 3 columns read, from x on: each is loaded once. */
PART void three_columns(const word *x, const float *w, size_t column, int n, int blocks, int step, int bf16,
                        vector *sum)
{
    vector weight[6];
#pragma GCC unroll 6
    for (int k = 0; k < 3 * blocks; k++)
        weight[k] = v_load(w + (size_t)(k / blocks) * column + LANES * (k % blocks));
#pragma GCC unroll 26
    for (int q = 0; q < n + 2; q++) {
        const vector same = v_same(x[q * step]);
#pragma GCC unroll 3
        for (int u = 0; u < 3; u++)
            if (q >= u && q - u < n)
#pragma GCC unroll 2
                for (int b = 0; b < blocks; b++)
                    sum[(q - u) * blocks + b] =
                        multiply_add(bf16, same, weight[u * blocks + b], sum[(q - u) * blocks + b]);
    }
}

/* n pixels, `blocks` vectors of outputs; n blocks <= ACCUMULATORS, so that all sums stay in registers. */
PART void wide_pixels(const rx_direct *d, const run *r, size_t pixel, int n, int blocks, int step, int bf16)
{
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
                three_columns(x + i, w, (size_t)(words * LANES * blocks), n, blocks, step, bf16, sum);
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
               sum[k]);
}

/* The last pixels of a row are made with some before them once more: the same bits. */
PART void wide_row(const rx_direct *d, const run *r, int left, int right, int blocks, int step, int bf16)
{
    const int most = ACCUMULATORS / blocks, half = most / 2;
    int x = left;
    for (; x + most <= right; x += most)
        wide_pixels(d, r, (size_t)x, most, blocks, step, bf16);
    if (right - x > half && right - left >= most) {
        wide_pixels(d, r, (size_t)(right - most), most, blocks, step, bf16);
    } else if (right > x && right - left >= half) {
        for (; right - x > half; x += half)
            wide_pixels(d, r, (size_t)x, half, blocks, step, bf16);
        wide_pixels(d, r, (size_t)(right - half), half, blocks, step, bf16);
    } else {
        for (; x < right; x++)
            wide_pixels(d, r, (size_t)x, 1, blocks, step, bf16);
    }
}

typedef void row_function(const rx_direct *d, const run *r, int left, int right);

/* One function for each way to step through the words of a pixel. */
#define ROW(name, blocks, step, bf16)                                                                        \
    WIDE static void name(const rx_direct *d, const run *r, int left, int right)                             \
    {                                                                                                        \
        wide_row(d, r, left, right, blocks, step, bf16);                                                     \
    }
#if WITH_BF16
#define ROWS(step)                                                                                           \
    ROW(row_f32_1_##step, 1, step, 0)                                                                        \
    ROW(row_f32_2_##step, 2, step, 0)                                                                        \
    ROW(row_bf16_1_##step, 1, step, 1)                                                                       \
    ROW(row_bf16_2_##step, 2, step, 1)
#define CHOICE(step)                                                                                         \
    {                                                                                                        \
        step, {row_f32_1_##step, row_f32_2_##step},                                                          \
        {                                                                                                    \
            row_bf16_1_##step, row_bf16_2_##step                                                             \
        }                                                                                                    \
    }
#else
#define ROWS(step)                                                                                           \
    ROW(row_f32_1_##step, 1, step, 0)                                                                        \
    ROW(row_f32_2_##step, 2, step, 0)
#define CHOICE(step)                                                                                         \
    {                                                                                                        \
        step, {row_f32_1_##step, row_f32_2_##step},                                                          \
        {                                                                                                    \
            NULL, NULL                                                                                       \
        }                                                                                                    \
    }
#endif
ROWS(8)
ROWS(12)
ROWS(16)
ROWS(32)
ROWS(64)

/* By the number of blocks less 1. */
typedef struct choice {
    int step;
    row_function *f32[2], *bf16[2];
} choice;

static const choice choices[] = {CHOICE(8), CHOICE(12), CHOICE(16), CHOICE(32), CHOICE(64)};
enum { CHOICES = sizeof choices / sizeof choices[0] };

static row_function *row_of(const rx_direct *d)
{
    for (int i = 0; i < CHOICES; i++)
        if (choices[i].step == d->step)
            return (d->shape.x == RX_REAL_F32 ? choices[i].f32 : choices[i].bf16)[d->blocks - 1];
    return NULL;
}

static int has_rows(const rx_direct *d)
{
    return row_of(d) != NULL;
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
            const run r = {.x = (const word *)x->data + (size_t)(v * s->stride) * line,
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

/* near, far: where rows of src begin, at: where one of dst does, in numbers. */
PART void up2_row(const rx_plane *src, size_t near, size_t far, const rx_plane *add, int relu,
                  const rx_plane *dst, size_t at, rx_direct_area area)
{
    const size_t channels = (size_t)src->channels;
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

WIDE static void run_up2(const rx_plane *src, const rx_plane *add, int relu, const rx_plane *dst,
                         rx_direct_area area)
{
    const size_t line = (size_t)src->width * (size_t)src->channels;
    for (int y = area.first; y < area.last; y++) {
        const size_t near = (size_t)(y / 2 + 1) * line, far = y % 2 == 0 ? near - line : near + line;
        up2_row(src, near, far, add, relu, dst, (size_t)y * 2 * line, area);
    }
}

#endif
