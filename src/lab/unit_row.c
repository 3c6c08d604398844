/* A list of floats that grows. */
#include "lab/unit_row.h"

#include "base/memory.h"

void rx_unit_row_add(rx_unit_row *r, double value)
{
    if (r->values->n == r->capacity) {
        const long capacity = r->capacity > 0 ? 2 * r->capacity : 1024;
        double *v = rx_regrow(r->values->v, (size_t)capacity, sizeof *v);
        if (v == NULL) {
            r->failed = 1;
            return;
        }
        r->values->v = v;
        r->capacity = capacity;
    }
    r->values->v[r->values->n++] = (float)value;
}

rx_status rx_unit_row_status(const rx_unit_row *r, rx_error *err)
{
    return r->failed ? rx_error_memory(err, (size_t)r->capacity * sizeof(double)) : RX_OK;
}
