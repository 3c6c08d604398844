/* The network's definition as plain loops in double. */
#include "reference.h"

#include <stdlib.h>
#include <string.h>

/* Every operation is linear in its source: y[...] += factor * x[...] over some list of pairs. An operation
 * lists the pairs once; forward, both gradients and the borders then follow from the same list, and a wrong
 * list shows in the forward values. */
typedef struct pass {
    ref_plane *x, *y;
    const double *weights; /* NULL: no weights */
    double *dweights;      /* NULL: forward */
} pass;

/* One pair; weight -1: the factor stands alone. Places outside of the planes hold 0. */
static void pair(const pass *p, int yy, int yx, int yc, int xy, int xx, int xc, double factor, long weight)
{
    if (yy < 0 || yy >= p->y->height || yx < 0 || yx >= p->y->width || xy < 0 || xy >= p->x->height ||
        xx < 0 || xx >= p->x->width)
        return;
    long a = ((long)yy * p->y->width + yx) * p->y->channels + yc;
    long b = ((long)xy * p->x->width + xx) * p->x->channels + xc;
    double w = weight >= 0 ? p->weights[weight] : 1;
    if (p->dweights == NULL) {
        p->y->value[a] += factor * w * p->x->value[b];
        return;
    }
    p->x->gradient[b] += factor * w * p->y->gradient[a];
    if (weight >= 0)
        p->dweights[weight] += factor * p->x->value[b] * p->y->gradient[a];
}

/* y = sum w[o][i][v][u] x[stride y + v - k/2] */
static void conv(const pass *p, int k, int stride)
{
    for (int y = 0; y < p->y->height; y++)
        for (int x = 0; x < p->y->width; x++)
            for (int o = 0; o < p->y->channels; o++)
                for (int i = 0; i < p->x->channels; i++)
                    for (int v = 0; v < k; v++)
                        for (int u = 0; u < k; u++)
                            pair(p, y, x, o, stride * y + v - k / 2, stride * x + u - k / 2, i, 1,
                                 (((long)o * p->x->channels + i) * k + v) * k + u);
}

/* The transpose of a convolution of stride 2 and padding k/2 - 1: x[m] goes to y[2 m + v - (k/2 - 1)]. */
static void transposed(const pass *p, int k)
{
    for (int m = 0; m < p->x->height; m++)
        for (int n = 0; n < p->x->width; n++)
            for (int i = 0; i < p->x->channels; i++)
                for (int o = 0; o < p->y->channels; o++)
                    for (int v = 0; v < k; v++)
                        for (int u = 0; u < k; u++)
                            pair(p, 2 * m + v - (k / 2 - 1), 2 * n + u - (k / 2 - 1), o, m, n, i, 1,
                                 (((long)i * p->y->channels + o) * k + v) * k + u);
}

/* Between the pixels (2 y + dy, 2 x + dx) of the fine plane and the channels [dy][dx][c] of the coarse one.
 */
static void shuffle(const pass *p, int to_fine)
{
    const ref_plane *coarse = to_fine ? p->x : p->y;
    int c4 = coarse->channels, c1 = c4 / 4;
    for (int y = 0; y < coarse->height; y++)
        for (int x = 0; x < coarse->width; x++)
            for (int c = 0; c < c4; c++) {
                int fy = 2 * y + c / c1 / 2, fx = 2 * x + c / c1 % 2;
                if (to_fine)
                    pair(p, fy, fx, c % c1, y, x, c, 1, -1);
                else
                    pair(p, y, x, c, fy, fx, c % c1, 1, -1);
            }
}

/* Fine pixel f lies at (f - 1/2)/2 on the coarse grid: the share of its two neighbours there. */
static void bilinear(int f, int place[2], double part[2])
{
    int m = f >= 0 ? f / 2 : -((1 - f) / 2);
    int upper = f - 2 * m;
    place[0] = m;
    place[1] = upper ? m + 1 : m - 1;
    part[0] = 0.75;
    part[1] = 0.25;
}

static int inside(int i, int n)
{
    return i < 0 ? 0 : i >= n ? n - 1 : i;
}

static void up2(const pass *p)
{
    for (int y = 0; y < p->y->height; y++)
        for (int x = 0; x < p->y->width; x++)
            for (int j = 0; j < 4; j++) {
                int v[2], u[2];
                double a[2], b[2];
                bilinear(y, v, a);
                bilinear(x, u, b);
                for (int c = 0; c < p->y->channels; c++)
                    pair(p, y, x, c, inside(v[j / 2], p->x->height), inside(u[j % 2], p->x->width), c,
                         a[j / 2] * b[j % 2], -1);
            }
}

/* Bilinear without border (0 beyond the coarse plane), then 3x3. */
static void upconv(const pass *p)
{
    for (int y = 0; y < p->y->height; y++)
        for (int x = 0; x < p->y->width; x++)
            for (int k = 0; k < 9; k++)
                for (int j = 0; j < 4; j++) {
                    int v[2], u[2];
                    double a[2], b[2];
                    bilinear(y + k / 3 - 1, v, a);
                    bilinear(x + k % 3 - 1, u, b);
                    for (int o = 0; o < p->y->channels; o++)
                        for (int i = 0; i < p->x->channels; i++)
                            pair(p, y, x, o, v[j / 2], u[j % 2], i, a[j / 2] * b[j % 2],
                                 ((long)o * p->x->channels + i) * 9 + k);
                }
}

static void apply(const pass *p, const rx_node *n)
{
    switch (n->op) {
    case RX_OP_CONV:
        conv(p, n->kernel, n->stride);
        break;
    case RX_OP_TRANSPOSED:
        transposed(p, n->kernel);
        break;
    case RX_OP_UNSHUFFLE:
        shuffle(p, 0);
        break;
    case RX_OP_SHUFFLE:
        shuffle(p, 1);
        break;
    case RX_OP_UP2:
        up2(p);
        break;
    case RX_OP_UPCONV:
        upconv(p);
        break;
    case RX_OP_INPUT:
        break;
    }
}

reference *reference_new(const rx_net *net, int height, int width)
{
    reference *ref = calloc(1, sizeof *ref);
    ref->net = net;
    for (int i = 0; i < net->nnodes; i++) {
        ref_plane *p = &ref->node[i];
        p->height = height >> net->node[i].level;
        p->width = width >> net->node[i].level;
        p->channels = net->node[i].channels;
        p->value = calloc((size_t)ref_size(p), sizeof(double));
        p->gradient = calloc((size_t)ref_size(p), sizeof(double));
    }
    return ref;
}

void reference_free(reference *ref)
{
    for (int i = 0; ref != NULL && i < ref->net->nnodes; i++) {
        free(ref->node[i].value);
        free(ref->node[i].gradient);
    }
    free(ref);
}

void reference_forward(reference *ref, const double *params)
{
    for (int i = 1; i < ref->net->nnodes; i++) {
        const rx_node *n = &ref->net->node[i];
        ref_plane *y = &ref->node[i];
        for (long k = 0; k < ref_size(y); k++)
            y->value[k] = n->weight >= 0 ? params[n->bias + k % n->channels] : 0;
        pass p = {&ref->node[n->src], y, n->weight >= 0 ? params + n->weight : NULL, NULL};
        apply(&p, n);
        for (long k = 0; k < ref_size(y); k++) {
            y->value[k] += n->add >= 0 ? ref->node[n->add].value[k] : 0;
            if (n->relu && y->value[k] < 0)
                y->value[k] = 0;
        }
    }
}

void reference_backward(reference *ref, const double *params, double *dparams)
{
    double nothing = 0;
    memset(dparams, 0, (size_t)ref->net->nparams * sizeof *dparams);
    for (int i = 0; i < ref->net->nnodes - 1; i++)
        memset(ref->node[i].gradient, 0, (size_t)ref_size(&ref->node[i]) * sizeof(double));
    for (int i = ref->net->nnodes - 1; i > 0; i--) {
        const rx_node *n = &ref->net->node[i];
        ref_plane *y = &ref->node[i];
        for (long k = 0; k < ref_size(y); k++) {
            if (n->relu && y->value[k] <= 0)
                y->gradient[k] = 0;
            if (n->add >= 0)
                ref->node[n->add].gradient[k] += y->gradient[k];
            if (n->weight >= 0)
                dparams[n->bias + k % n->channels] += y->gradient[k];
        }
        int weighs = n->weight >= 0;
        pass p = {&ref->node[n->src], y, weighs ? params + n->weight : NULL,
                  weighs ? dparams + n->weight : &nothing};
        apply(&p, n);
    }
}
