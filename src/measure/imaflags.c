/* IMAFLAGS_ISO. */
#include "measure/imaflags.h"

#include <stdlib.h>

#include "base/memory.h"

enum { FLAGS_OR, FLAGS_AND, FLAGS_MIN, FLAGS_MAX, FLAGS_MOST };

static int compare_values(const void *a, const void *b)
{
    uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return (x > y) - (x < y);
}

/* Longest run in sorted values. */
static uint32_t most_frequent(const uint32_t *values, int n, int *count)
{
    uint32_t best = 0;
    *count = 0;
    for (int i = 0, run = 0; i < n; i++) {
        run = i > 0 && values[i] == values[i - 1] ? run + 1 : 1;
        if (run > *count) {
            *count = run;
            best = values[i];
        }
    }
    return best;
}

static int count_equal(const uint32_t *values, int n, uint32_t value)
{
    int count = 0;
    for (int i = 0; i < n; i++)
        count += values[i] == value;
    return count;
}

/* One value for all; `zeros` pixels had no flag. values is sorted, without zeros. */
static uint32_t combine(const uint32_t *values, int n, int zeros, int type, int *count)
{
    uint32_t result = type == FLAGS_AND ? UINT32_MAX : 0;
    *count = n;
    if (n == 0 || (type == FLAGS_AND && zeros > 0))
        return 0;
    switch (type) {
    case FLAGS_OR:
        for (int i = 0; i < n; i++)
            result |= values[i];
        return result;
    case FLAGS_AND:
        for (int i = 0; i < n; i++)
            result &= values[i];
        return result;
    case FLAGS_MOST:
        return most_frequent(values, n, count);
    default:
        result = type == FLAGS_MIN ? values[0] : values[n - 1];
        *count = count_equal(values, n, result);
        return result;
    }
}

rx_status rx_measure_imaflags(const rx_view *view, const int *types, rx_source *s, rx_error *err)
{
    const rx_image *image = view->image;
    if (image->nflagmaps == 0)
        return RX_OK;
    size_t area = (size_t)(s->xmax - s->xmin + 1) * (size_t)(s->ymax - s->ymin + 1);
    uint32_t *values;
    RX_TRY(RX_MAKE(values, area, err));
    for (int map = 0; map < image->nflagmaps && map < RX_MAX_FLAGMAPS; map++) {
        int n = 0, zeros = 0;
        for (int y = s->ymin; y <= s->ymax; y++)
            for (int x = s->xmin; x <= s->xmax; x++) {
                size_t k = (size_t)y * (size_t)image->width + (size_t)x;
                if (view->sources->segments[k] != view->segment)
                    continue;
                if (image->flagmaps[map][k] != 0)
                    values[n++] = image->flagmaps[map][k];
                else
                    zeros++;
            }
        qsort(values, (size_t)n, sizeof *values, compare_values);
        s->imaflags[map] = combine(values, n, zeros, types != NULL ? types[map] : 0, &s->nimaflags[map]);
    }
    free(values);
    return RX_OK;
}
