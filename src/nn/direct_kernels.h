/* What the kernels of direct.h for one kind of vectors share: weights, and their table. */
#ifndef RX_NN_DIRECT_KERNELS_H
#define RX_NN_DIRECT_KERNELS_H

#include "nn/plane.h"

enum {
    FINE = 4,     /* outputs of a fine one */
    POINTS = 16,  /* of Winograd's algorithm */
    SUMS = 12,    /* vectors: as many in registers leave room in the fastest cache for a strip of it */
    MOST_IN = 64, /* channels that it takes */
    MOST_LANES = 16
};

typedef struct rx_direct_kernels rx_direct_kernels;

struct rx_direct {
    const rx_direct_kernels *kernels;
    rx_conv_shape shape;
    int fine, winograd;
    int words;   /* 32-bit words of a pixel of x; plain: its channels */
    int step;    /* words from the first one of an output to that of the next */
    int padded;  /* outputs, and zeros that fill the last vector */
    int blocks;  /* vectors of outputs that run together: 2 where these are even */
    float *bias; /* [padded] */
    /* Winograd: [padded / (lanes blocks)][point][in][blocks][lanes] floats; wide: [padded / (lanes
     * blocks)][k][k][words] [blocks][lanes] words, of the plain one floats; fine: [k][vectors][4][lanes] words */
    void *weights;
};

/* What there is for one kind of vectors. */
struct rx_direct_kernels {
    const char *name;
    int lanes; /* floats of a vector */
    int bf16;  /* works on planes of them */
    void (*wide)(const rx_direct *direct, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                 rx_direct_area area);
    void (*fine)(const rx_direct *direct, const rx_plane *x, const rx_plane *y, rx_direct_area area);
    /* By Winograd's algorithm; the rows in pairs. */
    void (*winograd)(const rx_direct *direct, const rx_plane *x, const rx_plane *add, const rx_plane *y,
                     rx_direct_area area, float *scratch);
    void (*weights)(const rx_conv_shape *shape, const rx_plane *x, const rx_plane *dy, float *dweights);
    void (*up2)(const rx_plane *src, const rx_plane *add, int relu, const rx_plane *dst, rx_direct_area area);
};

/* NULL where the compiler does not make them or the processor lacks the instructions. */
const rx_direct_kernels *rx_direct_avx512(void);
const rx_direct_kernels *rx_direct_avx2(void);
const rx_direct_kernels *rx_direct_vector(void); /* of 4 floats */

#endif
