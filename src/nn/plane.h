/* Planes of a network and the convolutions between them. */
#ifndef RX_NN_PLANE_H
#define RX_NN_PLANE_H

#include <stddef.h>

typedef enum rx_real { RX_REAL_F32, RX_REAL_BF16 } rx_real;
static inline size_t rx_real_bytes(rx_real real)
{
    return real == RX_REAL_F32 ? 4 : 2;
}

typedef struct rx_plane {
    void *data; /* [height][width][channels] */
    rx_real real;
    int height, width, channels;
} rx_plane;

static inline size_t rx_plane_size(const rx_plane *plane)
{
    return (size_t)plane->height * (size_t)plane->width * (size_t)plane->channels;
}
static inline size_t rx_plane_bytes(const rx_plane *plane)
{
    return rx_plane_size(plane) * rx_real_bytes(plane->real);
}

/* y = relu?(add? + b + sum w x), weights [out][in][k][k]. */
typedef struct rx_conv_shape {
    int height, width; /* of x; y has 1/stride of them */
    int in, out, kernel, stride;
    int before, after; /* pixels of 0 on the left and top, on the right and bottom */
    rx_real x, y;      /* of the planes; weights are bfloat16 where x is */
    int sum;           /* adds a plane */
    int relu;          /* cuts at 0, last */
} rx_conv_shape;

#endif
