/* Convolutions of a band of rows by Winograd's algorithm, on the vectors of the file that includes it. */
#ifndef RX_NN_DIRECT_WINOGRAD_H
#define RX_NN_DIRECT_WINOGRAD_H

/* ---- strips ---- */

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
    t[0] = v_sub(d[0], d[2 * step]);
    t[1] = v_add(d[step], d[2 * step]);
    t[2] = v_sub(d[2 * step], d[step]);
    t[3] = v_sub(d[step], d[3 * step]);
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
        sum[k] = v_zero();
    for (int i = 0; i < s->d->shape.in; i++, w += LANES * blocks) {
        const vector w0 = v_load(w), w1 = v_load(w + LANES * (blocks - 1));
#pragma GCC unroll 24
        for (int k = 0; k < tiles; k++) {
            const vector same = v_same(from[k * room + i]);
            sum[k * blocks] = v_multiply_add(same, w0, sum[k * blocks]);
            if (blocks == 2)
                sum[k * blocks + 1] = v_multiply_add(same, w1, sum[k * blocks + 1]);
        }
    }
#pragma GCC unroll 24
    for (int k = 0; k < SUMS; k++)
        v_store(to + LANES * k, sum[k]);
}

/* A' of four vectors. */
PART void transform_out(const vector *m, int step, vector *t)
{
    t[0] = v_add(v_add(m[0], m[step]), m[2 * step]);
    t[1] = v_sub(v_sub(m[step], m[2 * step]), m[3 * step]);
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
        finish(d, s->add, s->y->data, at * (size_t)d->shape.out + (size_t)channel, v_add(out[0], bias),
               lanes);
        if (x + 1 < s->area.right)
            finish(d, s->add, s->y->data, (at + 1) * (size_t)d->shape.out + (size_t)channel,
                   v_add(out[1], bias), lanes);
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

/* All of them. */
#define KERNELS(word, with_bf16)                                                                             \
    {                                                                                                        \
        .name = (word), .lanes = LANES, .bf16 = (with_bf16), .wide = run_wide, .fine = run_fine,             \
        .winograd = run_winograd, .up2 = run_up2, .weights = run_weights                                     \
    }

#endif
