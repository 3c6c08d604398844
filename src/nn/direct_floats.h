/* Planes of floats, for kernels without bfloat16: included once PART, vector, v_load(), v_store() and
 * v_multiply_add() are there. */
#ifndef RX_NN_DIRECT_FLOATS_H
#define RX_NN_DIRECT_FLOATS_H

PART vector load_reals(rx_real real, const void *plane, size_t at)
{
    (void)real;
    return v_load((const float *)plane + at);
}

PART void store_reals(rx_real real, vector value, void *plane, size_t at)
{
    (void)real;
    v_store((float *)plane + at, value);
}

PART vector multiply_add(int bf16, vector x, vector w, vector sum)
{
    (void)bf16;
    return v_multiply_add(x, w, sum);
}

#endif
