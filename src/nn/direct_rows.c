/* Convolutions of a band of rows on AVX-512, by the definition. */
#include "nn/direct_parts.h"

#ifdef RX_DIRECT_KERNELS

PART __m512 multiply_add(int bf16, __m512 x, __m512 w, __m512 sum)
{
    if (bf16)
        return _mm512_dpbf16_ps(sum, (__m512bh)x, (__m512bh)w);
    return _mm512_fmadd_ps(x, w, sum);
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
                        __m512 *sum)
{
    __m512 weight[6];
#pragma GCC unroll 6
    for (int k = 0; k < 3 * blocks; k++)
        weight[k] = _mm512_loadu_ps(w + (size_t)(k / blocks) * column + LANES * (k % blocks));
#pragma GCC unroll 26
    for (int q = 0; q < n + 2; q++) {
        const __m512 same = _mm512_set1_ps(x[q * step]);
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
    __m512 sum[ACCUMULATORS];
#pragma GCC unroll 24
    for (int k = 0; k < n * blocks; k++)
        sum[k] = _mm512_loadu_ps(r->bias + LANES * (k % blocks));
    if (kernel == 3 && stride == 1)
        for (int v = 0; v < 3; v++, x += r->row, w += 2 * words * LANES * blocks)
            for (int i = 0; i < words; i++, w += LANES * blocks)
                three_columns(x + i, w, (size_t)(words * LANES * blocks), n, blocks, step, bf16, sum);
    else
        for (int v = 0; v < kernel; v++, x += r->row) {
            const word *from = x;
            for (int word = 0; word < kernel * words; word++, from++, w += LANES * blocks) {
                const __m512 w0 = _mm512_loadu_ps(w), w1 = _mm512_loadu_ps(w + LANES * (blocks - 1));
#pragma GCC unroll 24
                for (int p = 0; p < n; p++) {
                    const __m512 same = _mm512_set1_ps(from[p * step]);
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
#define ROWS(step)                                                                                           \
    ROW(row_f32_1_##step, 1, step, 0)                                                                        \
    ROW(row_f32_2_##step, 2, step, 0)                                                                        \
    ROW(row_bf16_1_##step, 1, step, 1)                                                                       \
    ROW(row_bf16_2_##step, 2, step, 1)
ROWS(8)
ROWS(12)
ROWS(16)
ROWS(32)
ROWS(64)

typedef struct choice {
    int step;
    row_function *row[2][2]; /* [bfloat16][blocks - 1] */
} choice;

#define CHOICE(step)                                                                                         \
    {                                                                                                        \
        step,                                                                                                \
        {                                                                                                    \
            {row_f32_1_##step, row_f32_2_##step},                                                            \
            {                                                                                                \
                row_bf16_1_##step, row_bf16_2_##step                                                         \
            }                                                                                                \
        }                                                                                                    \
    }
static const choice choices[] = {CHOICE(8), CHOICE(12), CHOICE(16), CHOICE(32), CHOICE(64)};
enum { CHOICES = sizeof choices / sizeof choices[0] };

static row_function *row_of(int step, int bf16, int blocks)
{
    for (int i = 0; i < CHOICES; i++)
        if (choices[i].step == step)
            return choices[i].row[bf16][blocks - 1];
    return NULL;
}

void rx_direct_wide(const rx_direct *d, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                    rx_direct_area area)
{
    const rx_conv_shape *s = &d->shape;
    row_function *row = row_of(d->step, s->x == RX_REAL_BF16, d->blocks);
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

/* sum[4 p + o]: lanes to be added up. Lane 4 p + o of the result. Pairs of vectors are interleaved and added
 * until each lane holds one sum. */
PART __m512 gather_sums(const __m512 *sum)
{
    __m512 pair[8], four[4];
#pragma GCC unroll 8
    for (int k = 0; k < 8; k++)
        pair[k] = _mm512_add_ps(_mm512_unpacklo_ps(sum[2 * k], sum[2 * k + 1]),
                                _mm512_unpackhi_ps(sum[2 * k], sum[2 * k + 1]));
        /* lanes of 128 bits: even, odd, even, odd sums */
#pragma GCC unroll 4
    for (int k = 0; k < 4; k++)
        four[k] = _mm512_add_ps(_mm512_shuffle_ps(pair[2 * k], pair[2 * k + 1], 0x44),
                                _mm512_shuffle_ps(pair[2 * k], pair[2 * k + 1], 0xee));
    const __m512 a = _mm512_add_ps(_mm512_shuffle_f32x4(four[0], four[1], 0x88),
                                   _mm512_shuffle_f32x4(four[0], four[1], 0xdd));
    const __m512 b = _mm512_add_ps(_mm512_shuffle_f32x4(four[2], four[3], 0x88),
                                   _mm512_shuffle_f32x4(four[2], four[3], 0xdd));
    return _mm512_add_ps(_mm512_shuffle_f32x4(a, b, 0x88), _mm512_shuffle_f32x4(a, b, 0xdd));
}

/* n <= 4 pixels side by side, from x on; `out`: where their finer pixels begin, in a row and in the next. */
PART void fine_pixels(const rx_direct *d, const word *x, size_t row, int n, float *const out[2], int bf16)
{
    const int span = d->shape.kernel * d->words, vectors = (span + LANES - 1) / LANES;
    const __mmask16 rest = (__mmask16)(0xffff >> (LANES * vectors - span));
    const __m512i order = _mm512_setr_epi32(0, 1, 4, 5, 8, 9, 12, 13, 2, 3, 6, 7, 10, 11, 14, 15);
    const float *w = d->weights;
    __m512 sum[4 * FINE];
#pragma GCC unroll 16
    for (int k = 0; k < 4 * FINE; k++)
        sum[k] = _mm512_setzero_ps();
    for (int v = 0; v < d->shape.kernel; v++, x += row)
        for (int i = 0; i < vectors; i++, w += FINE * LANES) {
            const __mmask16 mask = i + 1 == vectors ? rest : 0xffff;
#pragma GCC unroll 4
            for (int p = 0; p < 4; p++) {
                const word *from = x + (p < n ? p : 0) * d->words + i * LANES;
                const __m512 some = _mm512_maskz_loadu_ps(mask, from);
#pragma GCC unroll 4
                for (int o = 0; o < FINE; o++)
                    sum[FINE * p + o] =
                        multiply_add(bf16, some, _mm512_loadu_ps(w + o * LANES), sum[FINE * p + o]);
            }
        }
    __m512 value = _mm512_add_ps(gather_sums(sum), _mm512_broadcast_f32x4(_mm_loadu_ps(d->bias)));
    if (d->shape.relu)
        value = _mm512_max_ps(value, _mm512_setzero_ps());
    value = _mm512_permutexvar_ps(order, value);
    const __m256 upper = _mm512_castps512_ps256(value);
    const __m256 lower = _mm256_castpd_ps(_mm512_extractf64x4_pd(_mm512_castps_pd(value), 1));
    const __mmask8 here = (__mmask8)((1 << 2 * n) - 1);
    _mm256_mask_storeu_ps(out[0], here, upper);
    _mm256_mask_storeu_ps(out[1], here, lower);
}

WIDE void rx_direct_fine(const rx_direct *d, const rx_plane *x, const rx_plane *y, rx_direct_area area)
{
    const size_t line = (size_t)x->width * (size_t)d->words;
    for (int v = area.first; v < area.last; v++) {
        const word *from = (const word *)x->data + (size_t)v * line;
        float *to = (float *)y->data + 2 * (size_t)v * (size_t)y->width;
        for (int u = area.left; u < area.right; u += 4) {
            float *const out[2] = {to + 2 * u, to + y->width + 2 * u};
            const word *begin = from + (size_t)(u - d->shape.before) * (size_t)d->words;
            const int n = area.right - u < 4 ? area.right - u : 4;
            if (d->shape.x == RX_REAL_BF16)
                fine_pixels(d, begin, line, n, out, 1);
            else
                fine_pixels(d, begin, line, n, out, 0);
        }
    }
}

/* ---- bilinear ---- */

PART __m512 near_and_far(__m512 near, __m512 far)
{
    return _mm512_add_ps(_mm512_mul_ps(_mm512_set1_ps(0.75f), near),
                         _mm512_mul_ps(_mm512_set1_ps(0.25f), far));
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
            const __m512 a = near_and_far(load_reals(src->real, src->data, near + here),
                                          load_reals(src->real, src->data, far + here));
            const __m512 b = near_and_far(load_reals(src->real, src->data, near + side),
                                          load_reals(src->real, src->data, far + side));
            __m512 value = near_and_far(a, b);
            if (add != NULL)
                value = _mm512_add_ps(value, load_reals(add->real, add->data, to));
            if (relu)
                value = _mm512_max_ps(value, _mm512_setzero_ps());
            store_reals(dst->real, value, dst->data, to);
        }
}

WIDE void rx_direct_up2(const rx_plane *src, const rx_plane *add, int relu, const rx_plane *dst,
                        rx_direct_area area)
{
    const size_t line = (size_t)src->width * (size_t)src->channels;
    for (int y = area.first; y < area.last; y++) {
        const size_t near = (size_t)(y / 2 + 1) * line, far = y % 2 == 0 ? near - line : near + line;
        up2_row(src, near, far, add, relu, dst, (size_t)y * 2 * line, area);
    }
}

int rx_direct_has_kernels(void)
{
    return 1;
}

int rx_direct_has_rows(const rx_direct *direct)
{
    return row_of(direct->step, direct->shape.x == RX_REAL_BF16, direct->blocks) != NULL;
}

#else

int rx_direct_has_kernels(void)
{
    return 0;
}

int rx_direct_has_rows(const rx_direct *direct)
{
    (void)direct;
    return 0;
}

void rx_direct_wide(const rx_direct *direct, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                    rx_direct_area area)
{
    (void)direct, (void)x, (void)add, (void)y, (void)area;
}

void rx_direct_fine(const rx_direct *direct, const rx_plane *x, const rx_plane *y, rx_direct_area area)
{
    (void)direct, (void)x, (void)y, (void)area;
}

void rx_direct_up2(const rx_plane *src, const rx_plane *add, int relu, const rx_plane *dst,
                   rx_direct_area area)
{
    (void)src, (void)add, (void)relu, (void)dst, (void)area;
}

#endif
