/* The kernels of direct.h on vectors of RX_LANES floats. Compiled once for each width (local.mk): 16, AVX-512 with its
 * instructions for bfloat16; 8, AVX2 with fused multiply-add; 4, what every processor of today has (NEON, SSE2). The
 * code is one, by GCC's vector extensions; of a width are only loads of a part, the multiply-add and bfloat16. */
#include "nn/direct_kernels.h"

#if RX_LANES == 16
#define THIS_WIDTH rx_direct_avx512
#elif RX_LANES == 8
#define THIS_WIDTH rx_direct_avx2
#else
#define THIS_WIDTH rx_direct_vector
#endif

#if defined(__GNUC__) && RX_LANES == 4
#define HAS_KERNELS 1
#elif defined(__x86_64__) && defined(__GNUC__) && defined(__has_include)
#if RX_LANES == 8 || __has_include(<avx512bf16intrin.h>)
#define HAS_KERNELS 1
#endif
#endif

#ifdef HAS_KERNELS
#include <string.h>

#if RX_LANES > 4
#include <immintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

/* ACCUMULATORS: sums that stay in registers; FINE_PIXELS: made at a time. */
#if RX_LANES == 16
enum { LANES = 16, ACCUMULATORS = 24, FINE_PIXELS = 4 };
#define WIDE __attribute__((target("avx512f,avx512bw,avx512vl,avx512bf16")))
#elif RX_LANES == 8
enum { LANES = 8, ACCUMULATORS = 12, FINE_PIXELS = 2 };
#define WIDE __attribute__((target("avx2,fma")))
#else
#ifdef __aarch64__
enum { ACCUMULATORS = 24 };
#else
enum { ACCUMULATORS = 12 };
#endif
enum { LANES = 4, FINE_PIXELS = 2 };
#define WIDE
#endif
#define PART static inline __attribute__((always_inline)) WIDE

typedef float vector __attribute__((vector_size(4 * RX_LANES)));
typedef int32_t ints __attribute__((vector_size(4 * RX_LANES)));
typedef float in_memory __attribute__((vector_size(4 * RX_LANES), aligned(4), may_alias));
typedef float quad __attribute__((vector_size(16)));
typedef float __attribute__((may_alias)) word; /* one float or two bfloat16 */

PART vector v_same(word value)
{
    return value - (vector){0};
}

PART vector v_load(const float *from)
{
    return *(const in_memory *)from;
}

PART void v_store(float *to, vector value)
{
    *(in_memory *)to = value;
}

PART vector v_cut(vector value)
{
    return (vector)((ints)value & (value > (vector){0}));
}

/* ---- what differs by width: the first n numbers, then zeros (all where n is that many); multiply-add ---- */

#if RX_LANES == 16

PART vector v_load_first(int n, const float *from)
{
    return _mm512_maskz_loadu_ps((__mmask16)(n < LANES ? (1 << n) - 1 : 0xffff), from);
}

PART void v_store_first(int n, float *to, vector value)
{
    _mm512_mask_storeu_ps(to, (__mmask16)(n < LANES ? (1 << n) - 1 : 0xffff), value);
}

PART vector multiply_add(int bf16, vector x, vector w, vector sum)
{
    if (bf16)
        return _mm512_dpbf16_ps(sum, (__m512bh)x, (__m512bh)w);
    return _mm512_fmadd_ps(x, w, sum);
}

PART vector load_bf16(const uint16_t *from)
{
    const __m256i half = _mm256_loadu_si256((const __m256i *)(const void *)from);
    return _mm512_castsi512_ps(_mm512_slli_epi32(_mm512_cvtepu16_epi32(half), 16));
}

PART void store_bf16(uint16_t *to, vector value)
{
    _mm256_storeu_si256((__m256i *)(void *)to, (__m256i)_mm512_cvtneps_pbh(value));
}

#elif RX_LANES == 8

PART __m256i mask_of(int n)
{
    static const int32_t masks[2 * LANES] = {-1, -1, -1, -1, -1, -1, -1, -1};
    return _mm256_loadu_si256((const __m256i *)(const void *)(masks + LANES - n));
}

PART vector v_load_first(int n, const float *from)
{
    if (n >= LANES)
        return v_load(from);
    return _mm256_maskload_ps(from, mask_of(n));
}

PART void v_store_first(int n, float *to, vector value)
{
    if (n >= LANES)
        v_store(to, value);
    else
        _mm256_maskstore_ps(to, mask_of(n), value);
}

PART vector multiply_add(int bf16, vector x, vector w, vector sum)
{
    (void)bf16;
    return _mm256_fmadd_ps(x, w, sum);
}

#else

PART vector v_load_first(int n, const float *from)
{
    vector v = {0};
    memcpy(&v, from, (n < LANES ? (size_t)n : LANES) * sizeof *from);
    return v;
}

PART void v_store_first(int n, float *to, vector value)
{
    memcpy(to, &value, (n < LANES ? (size_t)n : LANES) * sizeof *to);
}

PART vector multiply_add(int bf16, vector x, vector w, vector sum)
{
    (void)bf16;
#ifdef __aarch64__
    return vfmaq_f32(sum, x, w); /* the compiler fuses nothing by itself: -ffp-contract=off */
#else
    return x * w + sum;
#endif
}

#endif

PART vector load_reals(rx_real real, const void *plane, size_t at)
{
#if RX_LANES == 16
    if (real == RX_REAL_BF16)
        return load_bf16((const uint16_t *)plane + at);
#endif
    (void)real;
    return v_load((const float *)plane + at);
}

PART void store_reals(rx_real real, vector value, void *plane, size_t at)
{
#if RX_LANES == 16
    if (real == RX_REAL_BF16) {
        store_bf16((uint16_t *)plane + at, value);
        return;
    }
#endif
    (void)real;
    v_store((float *)plane + at, value);
}

/* Adds, cuts and stores the first `count` lanes of a vector of outputs of the plane y, which begin `at` numbers after
 * its first; add NULL: none. Fewer than all lanes only of floats. */
PART void finish(const rx_direct *d, const rx_plane *add, void *y, size_t at, vector value, int count)
{
    if (add != NULL)
        value += count < LANES ? v_load_first(count, (const float *)add->data + at)
                               : load_reals(add->real, add->data, at);
    if (d->shape.relu)
        value = v_cut(value);
    if (count < LANES)
        v_store_first(count, (float *)y + at, value);
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

/* One function for each common way to step through the words of a pixel, and one for all others. */
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
#if RX_LANES == 16
EACH(ROWS, 1)
#endif
#undef SEPARATOR
#define SEPARATOR ,
static const choice choices[] = {EACH(CHOICE, 0)};
#if RX_LANES == 16
static const choice bf16_choices[] = {EACH(CHOICE, 1)};
#else
#define bf16_choices choices
#endif

static void run_wide(const rx_direct *d, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                     rx_direct_area area)
{
    const rx_conv_shape *s = &d->shape;
    const choice *c = s->x == RX_REAL_F32 ? choices : bf16_choices;
    while (c->step != 0 && c->step != d->step)
        c++;
    row_function *row = c->row[d->blocks - 1];
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

/* Of two vectors by turns, within each quarter of 4 lanes: numbers p and q of a, then those of b. */
#if RX_LANES == 16
#define QUARTERS(p, q)                                                                                       \
    p, q, 16 + p, 16 + q, 4 + p, 4 + q, 20 + p, 20 + q, 8 + p, 8 + q, 24 + p, 24 + q, 12 + p, 12 + q,        \
        28 + p, 28 + q
#elif RX_LANES == 8
#define QUARTERS(p, q) p, q, 8 + p, 8 + q, 4 + p, 4 + q, 12 + p, 12 + q
#else
#define QUARTERS(p, q) p, q, 4 + p, 4 + q
#endif
#ifdef __clang__
#define BY_TURNS(a, b, p, q) __builtin_shufflevector(a, b, QUARTERS(p, q))
#else
#define BY_TURNS(a, b, p, q) __builtin_shuffle(a, b, (ints){QUARTERS(p, q)})
#endif

/* The sums of the lanes of four vectors. (The order of additions is the one that each width has had from the start: it
 * decides the last bit.) */
PART quad sums_of(const vector *s)
{
    enum { NEXT = LANES == 16 ? 1 : 2, OTHER = LANES == 16 ? 2 : 1 };
    const vector a = BY_TURNS(s[0], s[1], 0, NEXT) + BY_TURNS(s[0], s[1], OTHER, 3);
    const vector b = BY_TURNS(s[2], s[3], 0, NEXT) + BY_TURNS(s[2], s[3], OTHER, 3);
    const vector quarters = BY_TURNS(a, b, 0, 2) + BY_TURNS(a, b, 1, 3);
    quad part[LANES / 4];
    memcpy(part, &quarters, sizeof part);
#if RX_LANES == 16
    return (part[0] + part[1]) + (part[2] + part[3]);
#elif RX_LANES == 8
    return part[0] + part[1];
#else
    return part[0];
#endif
}

/* n <= FINE_PIXELS pixels side by side, from x on; `out`: where their finer pixels begin, in a row and in the next. */
PART void fine_pixels(const rx_direct *d, const word *x, size_t row, int n, float *const out[2], int bf16)
{
    const int span = d->shape.kernel * d->words, vectors = (span + LANES - 1) / LANES;
    const int rest = LANES > 8 ? span - LANES * (vectors - 1) : LANES; /* inputs are a multiple of 8 */
    const float *w = d->weights;
    vector sum[FINE_PIXELS * FINE];
    quad bias;
    memcpy(&bias, d->bias, sizeof bias);
#pragma GCC unroll 16
    for (int k = 0; k < FINE_PIXELS * FINE; k++)
        sum[k] = (vector){0};
    for (int v = 0; v < d->shape.kernel; v++, x += row)
        for (int i = 0; i < vectors; i++, w += FINE * LANES) {
            const int count = i + 1 == vectors ? rest : LANES;
#pragma GCC unroll 4
            for (int p = 0; p < FINE_PIXELS; p++) {
                const vector some = v_load_first(count, x + (p < n ? p : 0) * d->words + i * LANES);
#pragma GCC unroll 4
                for (int o = 0; o < FINE; o++)
                    sum[FINE * p + o] = multiply_add(bf16, some, v_load(w + o * LANES), sum[FINE * p + o]);
            }
        }
#pragma GCC unroll 4
    for (int p = 0; p < FINE_PIXELS; p++) {
        quad value = sums_of(sum + FINE * p) + bias;
        if (d->shape.relu)
            value = (quad)((__typeof__(value > bias))value & (value > (quad){0}));
        if (p < n) {
            memcpy(out[0] + 2 * p, &value, 2 * sizeof(float));
            memcpy(out[1] + 2 * p, (const float *)&value + 2, 2 * sizeof(float));
        }
    }
}

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
    return v_same(0.75f) * near + v_same(0.25f) * far;
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
                    value = value + load_reals(add->real, add->data, to);
                if (relu)
                    value = v_cut(value);
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
        sum[k] = (vector){0};
    for (int p = 0; p < g.n; p++, g.x += g.step, g.dy += g.out) {
        const vector d1 = v_load_first(last, g.dy + LANES * (blocks - 1)),
                     d0 = blocks == 2 ? v_load(g.dy) : d1;
#pragma GCC unroll 8
        for (int i = 0; i < inputs; i++) {
            const vector same = v_same(g.x[i]);
            sum[i * blocks] = multiply_add(0, same, d0, sum[i * blocks]);
            if (blocks == 2)
                sum[i * blocks + 1] = multiply_add(0, same, d1, sum[i * blocks + 1]);
        }
    }
#pragma GCC unroll 16
    for (int k = 0; k < inputs * blocks; k++) {
        float *to = g.dw + (size_t)(k / blocks) * g.out + (size_t)(LANES * (k % blocks));
        if (k % blocks == blocks - 1)
            v_store_first(last, to, v_load_first(last, to) + sum[k]);
        else
            v_store(to, v_load(to) + sum[k]);
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

/* ---- Winograd's algorithm ---- */

/* A strip of `tiles` squares of 2x2 outputs, whose 4x4 inputs are transformed to 16 points, multiplied there
 * by the transformed weights, and brought back: Y = A' [(G g G') * (B' d B)] A with
 *
 *   B' = 1 0 -1 0   G = 1    0   0     A' = 1 1  1  0
 *        0 1  1 0       1/2  1/2 1/2        0 1 -1 -1
 *        0 -1 1 0       1/2 -1/2 1/2
 *        0 1 0 -1       0    0   1
 *
 * (arXiv 1509.09308). In scratch memory: points [16][tiles][room], then products [16][tiles][blocks][16]. */
typedef struct strip {
    const rx_direct *d;
    const rx_plane *x, *add, *y;
    rx_direct_area area; /* rows: even numbers */
    int across;          /* squares side by side */
    int first;           /* number of its first square */
    float *points, *products;
} strip;

/* The first output of a square. */
PART void square_at(const strip *s, int k, int *x, int *y)
{
    *x = s->area.left + 2 * ((s->first + k) % s->across);
    *y = s->area.first + 2 * ((s->first + k) / s->across);
}

/* B' of four vectors. */
PART void transform_in(const vector *d, int step, vector *t)
{
    t[0] = d[0] - d[2 * step];
    t[1] = d[step] + d[2 * step];
    t[2] = d[2 * step] - d[step];
    t[3] = d[step] - d[3 * step];
}

PART void points_of(const strip *s, int k, int tiles, int room)
{
    const int in = s->d->shape.in, before = s->d->shape.before, last = s->x->width - 1;
    const size_t line = (size_t)s->x->width * (size_t)in;
    int x, y;
    square_at(s, k, &x, &y);
    for (int c = 0; c < in; c += LANES) {
        vector d[4], t[4][4], p[4];
#pragma GCC unroll 4
        for (int u = 0; u < 4; u++) {
            /* the last column may be missing where the second output is not wanted, and is not used then */
            const int column = x - before + u < last ? x - before + u : last;
            const float *from = (const float *)s->x->data + (size_t)y * line + (size_t)(column * in + c);
#pragma GCC unroll 4
            for (int v = 0; v < 4; v++)
                d[v] = v_load_first(in - c, from + (size_t)v * line);
            transform_in(d, 1, t[u]);
        }
#pragma GCC unroll 4
        for (int v = 0; v < 4; v++) {
            transform_in(&t[0][v], 4, p);
#pragma GCC unroll 4
            for (int u = 0; u < 4; u++)
                v_store(s->points + ((4 * v + u) * tiles + k) * room + c, p[u]);
        }
    }
}

/* Products of one point of all squares with `blocks` vectors of outputs. */
PART void multiply_point(const strip *s, const float *w, int point, int tiles, int blocks, int room)
{
    const float *from = s->points + point * tiles * room;
    float *to = s->products + point * SUMS * LANES;
    vector sum[SUMS];
#pragma GCC unroll 24
    for (int k = 0; k < SUMS; k++)
        sum[k] = (vector){0};
    for (int i = 0; i < s->d->shape.in; i++, w += LANES * blocks) {
        const vector w0 = v_load(w), w1 = v_load(w + LANES * (blocks - 1));
#pragma GCC unroll 24
        for (int k = 0; k < tiles; k++) {
            const vector same = v_same(from[k * room + i]);
            sum[k * blocks] = multiply_add(0, same, w0, sum[k * blocks]);
            if (blocks == 2)
                sum[k * blocks + 1] = multiply_add(0, same, w1, sum[k * blocks + 1]);
        }
    }
#pragma GCC unroll 24
    for (int k = 0; k < SUMS; k++)
        v_store(to + LANES * k, sum[k]);
}

/* A' of four vectors. */
PART void transform_out(const vector *m, int step, vector *t)
{
    t[0] = m[0] + m[step] + m[2 * step];
    t[1] = m[step] - m[2 * step] - m[3 * step];
}

/* Outputs of a square from its products; `block` of `blocks` vectors, which begin at channel `from`. */
PART void outputs_of(const strip *s, int k, int block, int blocks, int from)
{
    const rx_direct *d = s->d;
    const float *products = s->products + (k * blocks + block) * LANES;
    const int channel = from + LANES * block;
    const int lanes = d->shape.out - channel < LANES ? d->shape.out - channel : LANES;
    const vector bias = v_load(d->bias + channel);
    vector m[4], t[4][2], out[2];
    int x, y;
    square_at(s, k, &x, &y);
#pragma GCC unroll 4
    for (int u = 0; u < 4; u++) {
#pragma GCC unroll 4
        for (int v = 0; v < 4; v++)
            m[v] = v_load(products + (4 * v + u) * SUMS * LANES);
        transform_out(m, 1, t[u]);
    }
#pragma GCC unroll 2
    for (int v = 0; v < 2; v++) {
        const size_t at = (size_t)(y + v) * (size_t)s->y->width + (size_t)x;
        transform_out(&t[0][v], 2, out);
        finish(d, s->add, s->y->data, at * (size_t)d->shape.out + (size_t)channel, out[0] + bias, lanes);
        if (x + 1 < s->area.right)
            finish(d, s->add, s->y->data, (at + 1) * (size_t)d->shape.out + (size_t)channel, out[1] + bias,
                   lanes);
    }
}

PART void strip_of(const strip *s, int count, int blocks, int room)
{
    const int tiles = SUMS / blocks, group = LANES * blocks, in = s->d->shape.in;
    const float *w = s->d->weights;
    for (int k = 0; k < count; k++)
        points_of(s, k, tiles, room);
    for (int from = 0; from < s->d->shape.out; from += group) {
        for (int point = 0; point < POINTS; point++, w += in * group)
            multiply_point(s, w, point, tiles, blocks, room);
        for (int k = 0; k < count; k++)
#pragma GCC unroll 2
            for (int block = 0; block < blocks; block++)
                outputs_of(s, k, block, blocks, from);
    }
}

#define STRIP(room)                                                                                          \
    WIDE static void strip_1_##room(const strip *s, int count)                                               \
    {                                                                                                        \
        strip_of(s, count, 1, room);                                                                         \
    }                                                                                                        \
    WIDE static void strip_2_##room(const strip *s, int count)                                               \
    {                                                                                                        \
        strip_of(s, count, 2, room);                                                                         \
    }
STRIP(16)
STRIP(32)
STRIP(64)

static void run_winograd(const rx_direct *d, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                         rx_direct_area area, float *scratch)
{
    static void (*const strips[3][2])(const strip *, int) = {
        {strip_1_16, strip_2_16}, {strip_1_32, strip_2_32}, {strip_1_64, strip_2_64}};
    void (*const work)(const strip *, int) = strips[(d->shape.in > 16) + (d->shape.in > 32)][d->blocks - 1];
    const int tiles = SUMS / d->blocks;
    strip s = {.d = d, .x = x, .add = add, .y = y, .area = area, .points = scratch};
    s.products = scratch + POINTS * SUMS * MOST_IN;
    s.area.first = area.first / 2 * 2;
    s.across = (area.right - area.left + 1) / 2;
    const int all = s.across * ((area.last + 1 - s.area.first) / 2);
    for (s.first = 0; s.first < all; s.first += tiles)
        work(&s, all - s.first < tiles ? all - s.first : tiles);
}

const rx_direct_kernels *THIS_WIDTH(void)
{
#define KERNELS(word, with_bf16)                                                                             \
    {                                                                                                        \
        .name = (word), .lanes = LANES, .bf16 = (with_bf16), .wide = run_wide, .fine = run_fine,             \
        .winograd = run_winograd, .up2 = run_up2, .weights = run_weights                                     \
    }
#if RX_LANES == 16
    static const rx_direct_kernels kernels = KERNELS("AVX-512", 0),
                                   with_bf16 = KERNELS("AVX-512 with bfloat16", 1);
    if (!__builtin_cpu_supports("avx512f") || !__builtin_cpu_supports("avx512bw") ||
        !__builtin_cpu_supports("avx512vl") || !__builtin_cpu_supports("avx512dq"))
        return NULL;
    return __builtin_cpu_supports("avx512bf16") ? &with_bf16 : &kernels;
#elif RX_LANES == 8
    static const rx_direct_kernels kernels = KERNELS("AVX2", 0);
    return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") ? &kernels : NULL;
#else
    static const rx_direct_kernels kernels = KERNELS("vectors of 4 floats", 0);
    return &kernels;
#endif
}

#else

const rx_direct_kernels *THIS_WIDTH(void)
{
    return NULL;
}

#endif
