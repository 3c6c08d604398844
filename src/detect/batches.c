/* Sorting groups out, and filling batches in the order of the list. */
#include "detect/batches.h"

#include <omp.h>
#include <stdbool.h>
#include <stdlib.h>

#include "base/memory.h"
#include "detect/cutouts.h"
#include "detect/deblendable.h"

enum { SMALL, PLAIN, BLEND };
enum { PLAIN_AREA = 1 << 17, BLEND_AREA = 1 << 15 }; /* pixels of a packed image: it stays in the cache */
enum { LEAST_PART = 3 }; /* pixels: sep deblends into parts of less than min_area, too */

/* What kind each group is. */
static rx_status sort_out(const rx_detect_params *par, const rx_groups *groups, unsigned char *kind,
                          rx_error *err)
{
    rx_status status = RX_OK;
    const int part = par->min_area < LEAST_PART ? par->min_area : LEAST_PART;
#pragma omp parallel num_threads(par->nthreads > 0 ? par->nthreads : 1)
    {
        rx_deblendable work = {0};
        rx_error trouble = rx_error_part(omp_get_thread_num() == 0 ? err : NULL);
        rx_status own = RX_OK;
#pragma omp for schedule(dynamic, 64)
        for (int i = 0; i < groups->n; i++) {
            int splits = 0;
            kind[i] = SMALL;
            if (groups->list[i].size < par->min_area || own != RX_OK)
                continue;
            if (par->deblend_levels > 1)
                own = rx_deblendable_test(groups, i, part, par->deblend_contrast, &work, &splits, &trouble);
            kind[i] = splits ? BLEND : PLAIN;
        }
        rx_deblendable_free(&work);
        if (own != RX_OK) {
#pragma omp critical(rx_batches_status)
            {
                status = own;
                rx_error_take(err, &trouble);
            }
        }
    }
    return status;
}

/* Neighbours in the list into one batch until its image is full; a blend at the border by itself, for which
 * of its parts the border cuts sep must see. */
static void collect(const rx_threshold *image, const rx_groups *groups, const unsigned char *kind, int wanted,
                    rx_batches *dst, int *used)
{
    const long limit = wanted == BLEND ? BLEND_AREA : PLAIN_AREA;
    long area = 0;
    int closed = 0; /* the batch takes no more */
    rx_batch *batch = NULL;
    for (int i = 0; i < groups->n; i++) {
        if (kind[i] != wanted)
            continue;
        const rx_group *g = &groups->list[i];
        const int at_border =
            g->xmin == 0 || g->ymin == 0 || g->xmax == image->width - 1 || g->ymax == image->height - 1;
        const int alone = wanted == BLEND && at_border;
        const long own = rx_cutout_area(g);
        if (batch == NULL || alone || closed || area + own > limit) {
            batch = &dst->list[dst->n++];
            *batch = (rx_batch){.first = *used, .blended = wanted == BLEND};
            area = 0;
        }
        closed = alone;
        area += own;
        dst->members[(*used)++] = i;
        batch->n++;
        batch->pixels += g->size;
    }
}

rx_status rx_batches_make(const rx_detect_params *par, const rx_threshold *image, const rx_groups *groups,
                          rx_batches *dst, rx_error *err)
{
    const size_t n = (size_t)groups->n;
    int used = 0;
    *dst = (rx_batches){.list = RX_NEW(rx_batch, n), .members = RX_NEW(int, n)};
    unsigned char *kind = RX_NEW(unsigned char, n);
    rx_status status = RX_OK;
    if (kind == NULL || dst->list == NULL || dst->members == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof(rx_batch)));
    RX_TRY_EXIT(sort_out(par, groups, kind, err));
    collect(image, groups, kind, BLEND, dst, &used);
    collect(image, groups, kind, PLAIN, dst, &used);
exit:
    free(kind);
    return status;
}

void rx_batches_free(rx_batches *batches)
{
    free(batches->list);
    free(batches->members);
    *batches = (rx_batches){0};
}
