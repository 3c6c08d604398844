/* Samples as one block of memory, and the turns of the square. */
#include "train/sample.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

enum { PLANES = 4, KERNEL = RX_SAMPLE_KERNEL * RX_SAMPLE_KERNEL, ALIGN = 64 };

static size_t padded(size_t bytes)
{
    return (bytes + ALIGN - 1) / ALIGN * ALIGN;
}

static size_t plane_bytes(int side)
{
    return padded(sizeof(float) * (size_t)side * (size_t)side);
}

size_t rx_sample_bytes(int side)
{
    return padded(sizeof(rx_sample)) + PLANES * plane_bytes(side) + padded(KERNEL * sizeof(float));
}

void rx_sample_attach(rx_sample *sample)
{
    char *at = (char *)sample + padded(sizeof *sample);
    const size_t step = plane_bytes(sample->side);
    sample->x = (float *)at;
    sample->w = (float *)(at + step);
    sample->y = (float *)(at + 2 * step);
    sample->blurred = (float *)(at + 3 * step);
    sample->kernel = (float *)(at + 4 * step);
}

rx_status rx_sample_new(int side, rx_sample **dst, rx_error *err)
{
    RX_TRY(rx_make(dst, 1, rx_sample_bytes(side), err));
    (*dst)->side = side;
    rx_sample_attach(*dst);
    return RX_OK;
}

/* Bit 2 exchanges the axes, then bits 0 and 1 turn them around. */
static void turn_plane(int turn, int side, const float *src, float *dst)
{
    for (int y = 0; y < side; y++) {
        int v = turn & 2 ? side - 1 - y : y;
        for (int x = 0; x < side; x++) {
            int u = turn & 1 ? side - 1 - x : x;
            dst[(size_t)y * side + x] = turn & 4 ? src[(size_t)u * side + v] : src[(size_t)v * side + u];
        }
    }
}

rx_status rx_sample_turn(rx_sample *sample, int turn, rx_error *err)
{
    const int side = sample->side;
    const size_t n = (size_t)side * (size_t)side;
    float *planes[PLANES] = {sample->x, sample->w, sample->y, sample->blurred};
    if (turn < 0 || turn >= RX_SAMPLE_TURNS)
        return rx_error_set(err, RX_USAGE, "turn %d of a square: there are %d, from 0", turn,
                            (int)RX_SAMPLE_TURNS);
    if (turn == 0)
        return RX_OK;
    float *copy;
    RX_TRY(RX_MAKE(copy, n > KERNEL ? n : KERNEL, err));
    for (int i = 0; i < PLANES; i++) {
        memcpy(copy, planes[i], n * sizeof *copy);
        turn_plane(turn, side, copy, planes[i]);
    }
    memcpy(copy, sample->kernel, KERNEL * sizeof *copy);
    turn_plane(turn, RX_SAMPLE_KERNEL, copy, sample->kernel);
    for (int i = 0; i < sample->nstars; i++) {
        float *star = sample->star[i], u = star[turn & 4 ? 1 : 0], v = star[turn & 4 ? 0 : 1];
        star[0] = turn & 1 ? (float)(side - 1) - u : u;
        star[1] = turn & 2 ? (float)(side - 1) - v : v;
    }
    free(copy);
    return RX_OK;
}
