/* A tile and a source list with known numbers, for the tests of this folder. */
#ifndef RX_TESTS_CATALOG_SCENE_H
#define RX_TESTS_CATALOG_SCENE_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../scratch.h"
#include "base/memory.h"
#include "catalog/assoc.h"
#include "catalog/catalog.h"
#include "catalog/columns.h"

/* n sources whose numbers differ from row to row. */
static inline rx_sources *scene_sources(int n)
{
    rx_sources *sources = RX_NEW(rx_sources, 1);
    assert_non_null(sources);
    sources->n = n;
    sources->list = RX_NEW(rx_source, (size_t)n);
    assert_non_null(sources->list);
    sources->naper = 3;
    sources->nradii = 2;
    sources->nflagmaps = 1;
    for (int i = 0; i < n; i++) {
        rx_source *s = &sources->list[i];
        *s = (rx_source){.number = i + 1, .segment = i + 1, .x = 10.25 + i, .y = 20.5 + 2 * i};
        s->x2 = 2.5;
        s->y2 = 2;
        s->xy = 0.25;
        s->errx2 = 0.02;
        s->erry2 = 0.01;
        s->errxy = 0.001;
        s->a = 1.6, s->b = 1.4, s->theta = 0.5 * atan2(2 * s->xy, s->x2 - s->y2);
        s->flux_auto = 1000.0 * (i + 1);
        s->fluxerr_auto = 10;
        s->kron_radius = 3.5;
        s->imaflags[0] = 0x80000001u;
        s->xmin = 7 + i, s->xmax = 13 + i, s->xpeak = 10 + i;
        s->isoarea = 30, s->npix = 25;
        s->peak = 100, s->analysis_threshold = 5, s->threshold = 7;
        s->fwhm = 3;
        for (int k = 0; k < sources->naper; k++) {
            s->flux_aper[k] = 100.0 * (k + 1) + i;
            s->fluxerr_aper[k] = k + 1;
        }
        s->flux_radius[0] = 1.5, s->flux_radius[1] = 3;
        s->alpha_j2000 = s->alpha = 150.125 + 1e-5 * i;
        s->delta_j2000 = s->delta = -2.25;
        s->world_matrix[0] = -1e-4, s->world_matrix[3] = 1e-4;
    }
    return sources;
}

static inline rx_tile scene_tile(void)
{
    return (rx_tile){.extension = 1, .zeropoint = 25, .pixel_scale = 0.36, .width = 200, .height = 200};
}

/* Table of a .param text. */
static inline rx_table *scene_table(const char *param, const rx_sources *sources)
{
    rx_column_list *list = NULL;
    rx_table *table = NULL;
    const rx_tile tile = scene_tile();
    const rx_image image = rx_tile_image(&tile);
    write_text("scene.param", param);
    assert_int_equal(rx_columns_read("scene.param", NULL, &list, NULL), RX_OK);
    assert_int_equal(rx_catalog_table(list, &image, sources, &table, NULL), RX_OK);
    rx_columns_free(list);
    return table;
}

static inline double scene_value(const rx_table *table, const char *name, long row, long element)
{
    int i = rx_table_find(table, name);
    assert_true(i >= 0);
    return rx_column_value(&table->columns[i], row, element);
}

#endif
