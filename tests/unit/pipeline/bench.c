/* Options and tiles in memory. */
#include "bench.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "base/memory.h"

void bench_open(bench *dst, const setting *settings)
{
    static const setting common[] = {
        {"PSF_TYPE", "MOFFAT"}, {"PSF_FWHM", "3.5"}, {"MAG_ZEROPOINT", "25"},     {"CATALOG_TYPE", "NONE"},
        {"RL_NITER", "8"},      {"QA_FIGURES", "N"}, {"CHECKIMAGE_TYPE", "NONE"}, {NULL, NULL}};
    *dst = (bench){0};
    assert_int_equal(rx_config_new(&dst->config, NULL), RX_OK);
    for (const setting *s = common; s->name != NULL; s++)
        assert_int_equal(rx_settings_set(&dst->config->settings, s->name, s->value, NULL, NULL), RX_OK);
    for (const setting *s = settings; s != NULL && s->name != NULL; s++)
        assert_int_equal(rx_settings_set(&dst->config->settings, s->name, s->value, NULL, NULL), RX_OK);
    assert_int_equal(rx_settings_complete(&dst->config->settings, NULL, NULL), RX_OK);
    assert_int_equal(rx_options_from_config(dst->config, NULL, &dst->options, NULL), RX_OK);
}

void bench_close(bench *bench)
{
    rx_options_free(bench->options);
    rx_config_free(bench->config);
}

rx_tile *bench_tile(const float *pixels, int width, int height, double gain)
{
    size_t n = (size_t)width * (size_t)height;
    rx_tile *tile = RX_NEW(rx_tile, 1);
    assert_non_null(tile);
    *tile = (rx_tile){.name = rx_strdup("bench"),
                      .extname = rx_strdup(""),
                      .width = width,
                      .height = height,
                      .pixels = RX_NEW(float, n),
                      .mask = RX_NEW(uint8_t, n),
                      .gain = gain,
                      .saturation = HUGE_VAL,
                      .zeropoint = 25.0,
                      .pixel_scale = 1.0};
    assert_true(tile->name != NULL);
    assert_true(tile->extname != NULL);
    assert_true(tile->pixels != NULL);
    assert_true(tile->mask != NULL);
    memcpy(tile->pixels, pixels, n * sizeof(float));
    return tile;
}

rx_field *bench_field(const bench *bench, const float *pixels, int width, int height, double gain)
{
    rx_field *field = NULL;
    assert_int_equal(rx_field_prepare(&bench->options->pipeline, RX_FIELD_PSF,
                                      bench_tile(pixels, width, height, gain), NULL, NULL, &field, NULL),
                     RX_OK);
    return field;
}
