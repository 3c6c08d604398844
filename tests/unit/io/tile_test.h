/* Tiles made by hand, for the tests that read them. */
#ifndef RX_TESTS_TILE_TEST_H
#define RX_TESTS_TILE_TEST_H

#include "io_test.h"

#include <fitsio.h>

#include <math.h>

#include "io/tile.h"

enum { W = 5, H = 4 };

static const rx_tile_params PLAIN = {.weight_threshold = NAN, .saturation = 50000, .zeropoint = 25};

static inline rx_tile *read_tile(const rx_tile_params *par, const char *name, int hdu, int extension)
{
    rx_tile *tile = NULL;
    rx_error err = RX_ERROR_NONE;
    rx_status status = rx_tile_read(par, name, hdu, extension, NULL, &tile, &err);
    if (status != RX_OK)
        print_message("%s: %s\n", err.where, err.text);
    assert_int_equal(status, RX_OK);
    return tile;
}

/* Reading must fail with this status and a text that holds `word`. */
static inline void check_refused(const rx_tile_params *par, const char *name, const char *word)
{
    int *hdus = NULL, n = 0;
    rx_tile *tile = NULL;
    rx_error err = RX_ERROR_NONE;
    rx_status status = rx_tile_list(name, NULL, &hdus, &n, &err);
    if (status == RX_OK)
        status = rx_tile_read(par, name, hdus[0], 1, NULL, &tile, &err);
    free(hdus);
    assert_null(tile);
    assert_int_equal(status, RX_INPUT);
    if (strstr(err.text, word) == NULL)
        print_message("%s: '%s' does not say '%s'\n", name, err.text, word);
    assert_non_null(strstr(err.text, word));
    assert_null(strchr(err.text, '\n'));
    assert_int_not_equal(err.text[strlen(err.text) - 1], '.');
}

/* An image file made by hand: W x H, `more` are further cards. */
static inline void make_image(const char *path, int bitpix, const char *more, const void *big_endian)
{
    char lines[2000];
    rx_text file = {0};
    snprintf(lines, sizeof lines,
             "SIMPLE  =                    T\nBITPIX  = %20d\nNAXIS   =                    2\n"
             "NAXIS1  =                    5\nNAXIS2  =                    4\n%s",
             bitpix, more);
    add_hdu(&file, lines, big_endian, (size_t)W * H * (size_t)abs(bitpix) / 8);
    write_bytes(path, file.data, file.length);
    rx_text_free(&file);
}

/* 0, 1, ... 19 in that type, big-endian, then an image of it. */
static inline void make_ramp(const char *path, int bitpix, const char *more)
{
    union {
        uint8_t b[W * H];
        int16_t s[W * H];
        int32_t i[W * H];
        int64_t l[W * H];
        float f[W * H];
        double d[W * H];
    } data;
    for (int i = 0; i < W * H; i++)
        switch (bitpix) {
        case 8:
            data.b[i] = (uint8_t)i;
            break;
        case 16:
            data.s[i] = (int16_t)i;
            break;
        case 32:
            data.i[i] = i;
            break;
        case 64:
            data.l[i] = i;
            break;
        case -32:
            data.f[i] = (float)i;
            break;
        default:
            data.d[i] = i;
        }
    swap(&data, W * H, (size_t)abs(bitpix) / 8);
    make_image(path, bitpix, more, &data);
}

static inline void compress_to(const char *path, int type, const float *pixels, long width, long height,
                               int twice)
{
    fitsfile *file = NULL;
    int failed = 0;
    long axes[2] = {width, height};
    int *integers = malloc((size_t)(width * height) * sizeof *integers);
    float *floats = malloc((size_t)(width * height) * sizeof *floats);
    assert_true(integers != NULL);
    assert_true(floats != NULL);
    for (long i = 0; i < width * height; i++) {
        floats[i] = pixels[i];
        integers[i] = (int)pixels[i];
    }
    remove(path);
    fits_create_diskfile(&file, path, &failed);
    fits_set_compression_type(file, type, &failed);
    for (int i = 0; i <= twice; i++) {
        fits_create_img(file, type == RICE_1 ? LONG_IMG : FLOAT_IMG, 2, axes, &failed);
        if (type == RICE_1)
            fits_write_img(file, TINT, 1, width * height, integers, &failed);
        else
            fits_write_img(file, TFLOAT, 1, width * height, floats, &failed);
    }
    fits_close_file(file, &failed);
    free(integers);
    free(floats);
    assert_int_equal(failed, 0);
}

#endif
