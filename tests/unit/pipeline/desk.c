/* One tile through one restorer and its template fit. */
#include "desk.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"

void desk_open(desk *d, const char *kind, const scene *s, const uint8_t *mask, double gain,
               const setting *settings)
{
    *d = (desk){0};
    bench_open(&d->bench, settings);
    d->bench.options->pipeline.templates.wanted = 0;
    rx_tile *tile = bench_tile(s->pixels, s->width, s->height, gain);
    if (mask != NULL)
        memcpy(tile->mask, mask, (size_t)s->width * (size_t)s->height);
    assert_int_equal(
        rx_field_prepare(&d->bench.options->pipeline, RX_FIELD_PSF, tile, NULL, NULL, &d->field, NULL),
        RX_OK);
    assert_int_equal(rx_field_extract(&d->bench.options->pipeline, rx_restorer_find(kind), d->field, NULL,
                                      NULL, &d->result, NULL),
                     RX_OK);
    assert_null(d->result.templates.tphot);
}

void desk_fit(desk *d, const rx_field *measure)
{
    rx_error err = RX_ERROR_NONE;
    rx_template_fit_free(&d->fit);
    if (rx_template_fit_run(&d->bench.options->pipeline,
                            (rx_fields){d->field, measure != NULL ? measure : d->field}, d->result.restored,
                            d->result.sources, NULL, &d->fit, &err) != RX_OK)
        fail_msg("%s", err.text);
}

void desk_close(desk *d)
{
    rx_template_fit_free(&d->fit);
    rx_result_free(&d->result);
    rx_field_free(d->field);
    bench_close(&d->bench);
}

rx_source *desk_fitted(const rx_sources *sources, double x, double y)
{
    for (int i = 0; i < sources->n; i++)
        if (hypot(sources->list[i].fit.x - x, sources->list[i].fit.y - y) < 1.0)
            return &sources->list[i];
    return NULL;
}

int desk_detected(const rx_sources *sources, double x, double y)
{
    for (int i = 0; i < sources->n; i++)
        if (hypot(sources->list[i].x - x, sources->list[i].y - y) < 1.0)
            return i;
    return -1;
}

void desk_forget(rx_sources *sources, int which)
{
    unsigned char *keep = RX_NEW(unsigned char, (size_t)sources->n);
    assert_non_null(keep);
    assert_in_range(which, 0, sources->n - 1);
    for (int i = 0; i < sources->n; i++)
        keep[i] = i != which;
    assert_int_equal(rx_sources_select(sources, keep, NULL), RX_OK);
    free(keep);
}
