/* Planes of a network and the convolutions between them. */
#ifndef RX_NN_PLANE_H
#define RX_NN_PLANE_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

typedef enum rx_real { RX_REAL_F32, RX_REAL_BF16 } rx_real;
static inline size_t rx_real_bytes(rx_real real)
{
    return real == RX_REAL_F32 ? 4 : 2;
}

/* bfloat16 is the upper half of a float. */
static inline float rx_bf16_widen(uint16_t half)
{
    const uint32_t bits = (uint32_t)half << 16;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* The nearest one (even); rounding carries no NaN into infinity or another sign. */
static inline uint16_t rx_bf16_narrow(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    if ((bits & 0x7fffffffU) > 0x7f800000U)
        return (uint16_t)(bits >> 16 | 0x40U);
    return (uint16_t)((bits + 0x7fffU + (bits >> 16 & 1U)) >> 16);
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

/* A convolution (nn/direct.h): packed weights, only read when it runs; and the part of a plane that it makes. */
typedef struct rx_direct rx_direct;

typedef struct rx_direct_area {
    int left, right, first, last;
} rx_direct_area;

#endif
