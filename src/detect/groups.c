/* Groups are walked with an explicit queue: one of them may be the whole tile. */
#include "detect/groups.h"

#include <stdlib.h>

#include "base/memory.h"

/* Label the group of `start`; returns its pixels, in queue. */
static size_t walk(const uint8_t *above, int width, int height, size_t start, int32_t label, int32_t *labels,
                   size_t *queue)
{
    size_t head = 0, tail = 0, row = (size_t)width;
    queue[tail++] = start;
    labels[start] = label;
    while (head < tail) {
        int x = (int)(queue[head] % row), y = (int)(queue[head] / row);
        head++;
        for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < height; v++)
            for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < width; u++) {
                size_t k = (size_t)v * row + (size_t)u;
                if (above[k] && labels[k] == 0) {
                    labels[k] = label;
                    queue[tail++] = k;
                }
            }
    }
    return tail;
}

static rx_group describe(const size_t *pixels, size_t n, const float *sigma, double threshold)
{
    rx_group group = {.size = (long)n, .lowest = (float)threshold};
    for (size_t i = 0; i < n && sigma != NULL; i++) {
        float own = (float)threshold * sigma[pixels[i]];
        if (i == 0 || own < group.lowest)
            group.lowest = own;
    }
    return group;
}

rx_status rx_groups_find(const uint8_t *above, const float *sigma, double threshold, int width, int height,
                         rx_groups *dst, rx_error *err)
{
    size_t n = (size_t)width * (size_t)height, room = 0;
    size_t *queue = RX_NEW(size_t, n);
    rx_status status = RX_OK;
    *dst = (rx_groups){.label = RX_NEW(int32_t, n)};
    if (queue == NULL || dst->label == NULL) {
        status = rx_error_memory(err, n * sizeof *queue);
        goto exit;
    }
    for (size_t start = 0; start < n; start++) {
        if (!above[start] || dst->label[start] != 0)
            continue;
        if ((size_t)dst->n == room) {
            room = room > 0 ? 2 * room : 256;
            rx_group *list = rx_regrow(dst->list, room, sizeof *list);
            if (list == NULL) {
                status = rx_error_memory(err, room * sizeof *list);
                goto exit;
            }
            dst->list = list;
        }
        size_t size = walk(above, width, height, start, dst->n + 1, dst->label, queue);
        dst->list[dst->n++] = describe(queue, size, sigma, threshold);
    }
exit:
    free(queue);
    return status;
}

void rx_groups_free(rx_groups *groups)
{
    free(groups->label);
    free(groups->list);
    *groups = (rx_groups){0};
}
