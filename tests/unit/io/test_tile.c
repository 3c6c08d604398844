/* Tiles: every kind of pixel, masks, names, companions. Damaged files: test_tile_damaged.c. */
#include "tile_test.h"

#include <time.h>

#include "../near.h"
#include "base/log.h"
#include "io/cards.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "io/wcs.h"

/* --- pixels --- */

static void test_bitpix(void **state)
{
    static const int kinds[] = {8, 16, 32, 64, -32, -64};
    char checksum[32] = "";
    for (int k = 0; k < 6; k++) {
        make_ramp(in(state, "a.fits"), kinds[k], "");
        rx_tile *tile = read_tile(&PLAIN, in(state, "a.fits"), 0, 1);
        assert_int_equal(tile->width, W);
        assert_int_equal(tile->height, H);
        for (int i = 0; i < W * H; i++) {
            assert_true(tile->pixels[i] == (float)i);
            assert_int_equal(tile->mask[i], 0);
        }
        if (k > 0)
            assert_string_equal(rx_tile_checksum(tile), checksum);
        memcpy(checksum, rx_tile_checksum(tile), sizeof checksum);
        rx_tile_free(tile);
    }
    assert_int_equal(strlen(checksum), 16);
}

static void test_scaling_and_blank(void **state)
{
    make_ramp(in(state, "a.fits"), 16, "BSCALE  = 0.5\nBZERO   = 100.0\nBLANK   = 7");
    rx_tile *tile = read_tile(&PLAIN, in(state, "a.fits"), 0, 1);
    for (int i = 0; i < W * H; i++) {
        assert_true(tile->pixels[i] == (i == 7 ? 0.f : 100.f + 0.5f * (float)i));
        assert_int_equal(tile->mask[i], i == 7 ? RX_MASK_BAD : 0);
    }
    rx_tile_free(tile);
    make_ramp(in(state, "a.fits"), 16, "BSCALE  = 1\nBZERO   = 32768"); /* unsigned */
    tile = read_tile(&PLAIN, in(state, "a.fits"), 0, 1);
    assert_true(tile->pixels[3] == 32771.f);
    rx_tile_free(tile);
    make_ramp(in(state, "a.fits"), 8, "BSCALE  = 1\nBZERO   = -128"); /* signed bytes */
    tile = read_tile(&PLAIN, in(state, "a.fits"), 0, 1);
    assert_true(tile->pixels[3] == -125.f);
    rx_tile_free(tile);
}

static void test_no_numbers(void **state)
{
    float f[W * H] = {0};
    double d[W * H] = {0};
    f[0] = NAN;
    f[1] = INFINITY;
    f[2] = -INFINITY;
    f[3] = 60000;
    f[4] = 1e20f;
    f[6] = 1.1e20f; /* of no detector */
    f[7] = -3e38f;
    for (int i = 0; i < 8; i++)
        d[i] = (double)f[i];
    d[5] = 1e300;
    swap(f, W * H, 4);
    swap(d, W * H, 8);
    make_image(in(state, "f.fits"), -32, "", f);
    make_image(in(state, "d.fits"), -64, "", d);
    rx_tile *a = read_tile(&PLAIN, in(state, "f.fits"), 0, 1),
            *b = read_tile(&PLAIN, in(state, "d.fits"), 0, 1);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(a->mask[i], RX_MASK_BAD);
        assert_int_equal(b->mask[i], RX_MASK_BAD);
        assert_true(a->pixels[i] == 0);
        assert_true(b->pixels[i] == 0);
    }
    assert_int_equal(a->mask[3], RX_MASK_SATURATED);
    assert_true(a->pixels[4] == 1e20f);
    assert_true(b->pixels[4] == 1e20f);
    for (int i = 6; i < 8; i++) {
        assert_int_equal(a->mask[i], RX_MASK_BAD);
        assert_int_equal(b->mask[i], RX_MASK_BAD);
        assert_true(a->pixels[i] == 0);
        assert_true(b->pixels[i] == 0);
    }
    assert_int_equal(b->mask[5], RX_MASK_BAD); /* no float holds it */
    assert_int_equal(a->mask[5], 0);
    rx_tile_free(a);
    rx_tile_free(b);
    for (int i = 0; i < W * H; i++)
        f[i] = NAN;
    swap(f, W * H, 4);
    make_image(in(state, "f.fits"), -32, "", f);
    check_refused(&PLAIN, in(state, "f.fits"), "NaN");
}

/* The same of pixels in other units, of which a value that is of no detector is 1e20, and no data is 1e30. */
static void test_units(void **state)
{
    static const double units[] = {1e-37, 1e-17, 1, 1e16, 1e28};
    for (size_t u = 0; u < sizeof units / sizeof *units; u++)
        for (int bitpix = -64; bitpix <= -32; bitpix += 32) {
            double d[W * H], variance[W * H];
            float f[W * H];
            for (int i = 0; i < W * H; i++) {
                d[i] = (100 + 10 * sin(3.0 * i)) * units[u];
                variance[i] = 25 * units[u] * units[u];
            }
            d[3] = units[u] < 1e10 ? -2e30 : -3.4e38;
            variance[5] = 1e300;
            for (int i = 0; i < W * H; i++)
                f[i] = (float)d[i];
            swap(f, W * H, 4);
            swap(variance, W * H, 8);
            rx_tile_params par = PLAIN;
            par.saturation = 0;
            par.weight_type = RX_WEIGHT_MAP_VAR;
            par.weight_name = in(state, "variance.fits");
            make_image(par.weight_name, -64, "", variance);
            double copy[W * H];
            memcpy(copy, d, sizeof copy);
            swap(copy, W * H, 8);
            make_image(in(state, "a.fits"), bitpix, "", bitpix == -64 ? (void *)copy : (void *)f);
            if (units[u] < 1e-30 || units[u] > 1e19) {
                check_refused(&par, in(state, "a.fits"), "multiply them by 1e");
                par.weight_type = RX_WEIGHT_NONE;
            }
            rx_tile *tile = read_tile(&par, in(state, "a.fits"), 0, 1);
            for (int i = 0; i < W * H; i++) {
                assert_int_equal(tile->mask[i], (i == 3 && units[u] < 1e19 ? RX_MASK_BAD : 0) |
                                                    (i == 5 && tile->weight != NULL ? RX_MASK_WEIGHT : 0));
                if (tile->mask[i] == 0)
                    assert_near(tile->pixels[i], d[i], 1e-6 * fabs(d[i]));
            }
            rx_tile_free(tile);
        }
}

/* --- numbers of the header --- */

static void test_inherit(void **state)
{
    rx_text file = {0};
    char data[W * H] = {0};
    static const char ext[] =
        "XTENSION= 'IMAGE   '\nBITPIX  =                    8\nNAXIS   =                    2\n"
        "NAXIS1  =                    5\nNAXIS2  =                    4\nPCOUNT  = 0\nGCOUNT  = 1\n"
        "EXTNAME = 'N1      '\nINHERIT =                    T\nFILTER  = 'r'";
    add_hdu(&file,
            "SIMPLE  =                    T\nBITPIX  =                    8\nNAXIS   =                    0\n"
            "EXTEND  =                    T\nFILTER  = 'g'\nTELESCOP= 'X'\nHIERARCH= 1\nGAIN    = 4.0",
            "", 0);
    data[0] = 1;
    add_hdu(&file, ext, data, sizeof data);
    write_bytes(in(state, "a.fits"), file.data, file.length);
    rx_tile_params par = PLAIN;
    par.gain_key = "GAIN";
    rx_tile *tile = read_tile(&par, in(state, "a.fits"), 1, 1);
    rx_text cards = {.data = tile->cards, .length = tile->ncards * 80};
    assert_string_equal(tile->extname, "N1");
    assert_true(tile->gain == 4);
    assert_int_equal(tile->ncards, 12); /* ten, TELESCOP and GAIN; no HIERARCH without a name */
    assert_non_null(strstr(cards.data, "TELESCOP= 'X'"));
    assert_null(strstr(cards.data, "FILTER  = 'g'"));
    rx_tile_free(tile);
    rx_text_free(&file);
}

/* --- compressed files, many HDUs, names --- */

static void test_compressed(void **state)
{
    float ramp[60 * 50];
    for (int i = 0; i < 3000; i++)
        ramp[i] = (float)((i * 37) % 1000);
    compress_to(in(state, "a.fits.fz"), RICE_1, ramp, 60, 50, 1);
    compress_to(in(state, "b.fits.fz"), GZIP_1, ramp, 60, 50, 0);
    compress_to(in(state, "c.fits.fz"), RICE_1, ramp, 60, 50, 0);
    static const char *const names[] = {"a.fits.fz", "b.fits.fz", "c.fits.fz"};
    for (int k = 0; k < 3; k++) {
        int *hdus = NULL, n = 0;
        assert_int_equal(rx_tile_list(in(state, names[k]), NULL, &hdus, &n, NULL), RX_OK);
        assert_int_equal(n, k == 0 ? 2 : 1);
        assert_int_equal(hdus[0], 1);
        rx_tile *tile = read_tile(&PLAIN, in(state, names[k]), hdus[n - 1], n);
        assert_string_equal(tile->extname, "");
        if (k != 1) /* floats are quantised */
            assert_memory_equal(tile->pixels, ramp, sizeof ramp);
        for (size_t i = 0; i < tile->ncards; i++) {
            assert_int_not_equal(strncmp(tile->cards + i * 80, "ZCMPTYPE", 8), 0);
            assert_int_not_equal(strncmp(tile->cards + i * 80, "TTYPE", 5), 0);
        }
        rx_tile_free(tile);
        free(hdus);
    }
}

/* Primary image, table, cube, image SCI, plane of a degenerate cube. */
static void make_many(const char *path)
{
    rx_text file = {0};
    uint8_t data[W * H * 2] = {1};
    add_hdu(&file,
            "SIMPLE  =                    T\nBITPIX  =                    8\nNAXIS   =                    2\n"
            "NAXIS1  =                    5\nNAXIS2  =                    4\nEXTEND  =                    T",
            data, W * H);
    add_hdu(&file,
            "XTENSION= 'BINTABLE'\nBITPIX  =                    8\nNAXIS   =                    2\n"
            "NAXIS1  =                    2\nNAXIS2  =                    3\nPCOUNT  =                    0\n"
            "GCOUNT  =                    1\nTFIELDS =                    1\nTFORM1  = '1I'\nTTYPE1  = "
            "'A'\nEXTNAME = 'TAB'",
            data, 6);
    data[W * H] = 9;
    add_hdu(&file,
            "XTENSION= 'IMAGE   '\nBITPIX  =                    8\nNAXIS   =                    3\n"
            "NAXIS1  =                    5\nNAXIS2  =                    4\nNAXIS3  =                    2\n"
            "PCOUNT  =                    0\nGCOUNT  =                    1\nEXTNAME = 'CUBE'",
            data, W * H * 2);
    data[0] = 2;
    add_hdu(&file,
            "XTENSION= 'IMAGE   '\nBITPIX  =                    8\nNAXIS   =                    2\n"
            "NAXIS1  =                    5\nNAXIS2  =                    4\nPCOUNT  =                    0\n"
            "GCOUNT  =                    1\nEXTNAME = 'SCI'\nEXTVER  =                    2",
            data, W * H);
    data[0] = 3;
    add_hdu(&file,
            "XTENSION= 'IMAGE   '\nBITPIX  =                    8\nNAXIS   =                    3\n"
            "NAXIS1  =                    5\nNAXIS2  =                    4\nNAXIS3  =                    1\n"
            "PCOUNT  =                    0\nGCOUNT  =                    1",
            data, W * H);
    write_bytes(path, file.data, file.length);
    rx_text_free(&file);
}

static void test_names(void **state)
{
    static const struct {
        const char *name;
        int n, hdu, width, height;
    } cases[] = {{"m.fits", 3, 0, 5, 4},
                 {"m.fits[0]", 1, 0, 5, 4},
                 {"m.fits[3]", 1, 3, 5, 4},
                 {"m.fits[SCI]", 1, 3, 5, 4},
                 {"m.fits[sci,2]", 1, 3, 5, 4},
                 {"m.fits[4]", 1, 4, 5, 4},
                 {"m.fits[3][2:4,3:4]", 1, 3, 3, 2},
                 {"m.fits[2:3,*]", 3, 0, 2, 4},
                 {"m.fits[SCI][*,2:2]", 1, 3, 5, 1},
                 {"m.fits[CUBE][*,*,2]", 1, 2, 5, 4},
                 {"m.fits[2][2:4,3:4,1]", 1, 2, 3, 2},
                 {"m.fits[2][*,*, 2:2 ,1]", 1, 2, 5, 4},
                 {"m.fits[*,*,2]", 1, 2, 5, 4},
                 {"m.fits[*,*,1]", 4, 0, 5, 4}};
    char name[1000];
    make_many(in(state, "m.fits"));
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        int *hdus = NULL, n = 0;
        snprintf(name, sizeof name, "%s", in(state, cases[i].name));
        assert_int_equal(rx_tile_list(name, NULL, &hdus, &n, NULL), RX_OK);
        assert_int_equal(n, cases[i].n);
        assert_int_equal(hdus[0], cases[i].hdu);
        rx_tile *tile = read_tile(&PLAIN, name, hdus[0], 1);
        assert_int_equal(tile->width, cases[i].width);
        assert_int_equal(tile->height, cases[i].height);
        assert_string_equal(tile->name, in(state, "m.fits"));
        rx_tile_free(tile);
        free(hdus);
    }
    /* a file whose name has brackets is that file */
    make_ramp(in(state, "odd[1].fits"), 8, "");
    rx_tile_free(read_tile(&PLAIN, in(state, "odd[1].fits"), 0, 1));
}

static void test_bad_names(void **state)
{
    static const struct {
        const char *name, *word;
    } cases[] = {{"m.fits[1]", "table"},
                 {"m.fits[TAB]", "table"},
                 {"m.fits[2]", "(5 x 4 x 2), a 2-D one was expected; name one plane"},
                 {"m.fits[CUBE]", "m.fits[2][*,*,1]'"},
                 {"m.fits[CUBE][*,*]", "3 axes"},
                 {"m.fits[CUBE][*,*,3]", "no plane 3 on axis 3; give one from 1 to 2"},
                 {"m.fits[CUBE][*,*,2,2]", "no plane 2 on axis 4"},
                 {"m.fits[0][*,*,2]", "no plane 2 on axis 3; give one from 1 to 1"},
                 {"m.fits[CUBE][*,*,0]", "of a cube with a plane"},
                 {"m.fits[CUBE][*,*,1:2]", "cannot use"},
                 {"m.fits[CUBE][*,*,*]", "cannot use"},
                 {"m.fits[CUBE][*,*,2,]", "cannot use"},
                 {"m.fits[9]", "no such HDU"},
                 {"m.fits[ERR]", "no extension"},
                 {"m.fits[SCI,7]", "no extension"},
                 {"m.fits[0][1:9,1:2]", "outside"},
                 {"m.fits[0][3:2,1:2]", "section"},
                 {"m.fits[0][0:2,1:2]", "section"},
                 {"m.fits[1:2]", "section"},
                 {"m.fits[0", "cannot use"},
                 {"m.fits[1:2,1:2:3]", "section"},
                 {"m.fits[1][x>3]", "cannot use"},
                 {"m.fits[]", "cannot use"},
                 {"m.fits[-1]", "cannot use"},
                 {"m.fits[0]x", "cannot use"},
                 {"nosuch.fits", "cannot be opened"},
                 {"", "folder"}};
    make_many(in(state, "m.fits"));
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        check_refused(&PLAIN, in(state, cases[i].name), cases[i].word);
    check_refused(&PLAIN, "-", "standard input");
    check_refused(&PLAIN, "", "empty");
    check_refused(&PLAIN, "!a.fits", "local files");
    check_refused(&PLAIN, "http://localhost/a.fits", "local files");
    check_refused(&PLAIN, "/dev/null", "regular");
}

static void test_planes_of_a_compressed_cube(void **state)
{
    const long tiles[][3] = {{W, 1, 1}, {3, 2, 1}, {2, 3, 2}};
    long axes[3] = {W, H, 3};
    float pixels[3 * W * H];
    char name[1000];
    for (int i = 0; i < 3 * W * H; i++)
        pixels[i] = (float)i;
    for (int k = 0; k < 3; k++) {
        fitsfile *file = NULL;
        int failed = 0;
        remove(in(state, "c.fits"));
        fits_create_diskfile(&file, in(state, "c.fits"), &failed);
        fits_set_compression_type(file, RICE_1, &failed);
        fits_set_tile_dim(file, 3, (long *)(uintptr_t)tiles[k], &failed);
        fits_create_img(file, LONG_IMG, 3, axes, &failed);
        fits_write_img(file, TFLOAT, 1, 3 * W * H, pixels, &failed);
        fits_close_file(file, &failed);
        assert_int_equal(failed, 0);
        snprintf(name, sizeof name, "%s[1][2:4,*,3]", in(state, "c.fits"));
        rx_tile *tile = read_tile(&PLAIN, name, 1, 1);
        assert_near(tile->pixels[0], 2 * W * H + 1, 0);
        assert_near(tile->pixels[3], 2 * W * H + W + 1, 0);
        rx_tile_free(tile);
    }
}

static void test_planes_of_a_cube(void **state)
{
    char many[900], map[1000], flags[1000];
    make_many(in(state, "m.fits"));
    snprintf(many, sizeof many, "%s[CUBE][*,*,1]", in(state, "m.fits"));
    snprintf(map, sizeof map, "%s[CUBE][*,*,2]", in(state, "m.fits")); /* its own second plane */
    make_many(in(state, "w.fits"));
    snprintf(flags, sizeof flags, "%s[2][*,*,2]", in(state, "w.fits"));
    rx_tile_params par = PLAIN;
    par.weight_type = RX_WEIGHT_MAP_WEIGHT;
    par.weight_name = map;
    par.nflags = 1;
    par.flag_names[0] = flags;
    rx_tile *tile = read_tile(&par, many, 2, 1);
    assert_near(tile->pixels[0], 1, 0);
    assert_near(tile->weight[0], 9, 0);
    assert_int_equal(tile->flagmaps[0][0], 9);
    rx_tile_free(tile);
    snprintf(many, sizeof many, "%s[CUBE][1:3,1:2,2]",
             in(state, "m.fits")); /* of whole maps the same section */
    par.weight_name = flags;
    tile = read_tile(&par, many, 2, 1);
    assert_near(tile->pixels[0], 9, 0);
    assert_near(tile->weight[0], 9, 0);
    assert_int_equal(tile->width, 3);
    rx_tile_free(tile);
    par.weight_name = map;
    check_refused(&par, many, "is the image itself");
    snprintf(map, sizeof map, "%s[2]", in(state, "w.fits"));
    check_refused(&par, many, "name one plane of it, the first by");

    float *pixels = NULL;
    int width = 0, height = 0;
    assert_int_equal(rx_fits_read_image(flags, &pixels, &width, &height, NULL), RX_OK);
    assert_int_equal(width, W);
    assert_near(pixels[0], 9, 0);
    free(pixels);
    rx_fits_cube cube;
    assert_int_equal(rx_fits_read_cube(flags, &cube, NULL), RX_OK);
    assert_int_equal(cube.planes, 1);
    assert_near(cube.pixels[0], 9, 0);
    rx_fits_cube_free(&cube);
    assert_int_equal(rx_fits_read_cube(map, &cube, NULL), RX_OK);
    assert_int_equal(cube.planes, 2);
    assert_near(cube.pixels[W * H], 9, 0);
    rx_fits_cube_free(&cube);
}

/* --- weights and flags --- */

static void test_weights(void **state)
{
    float map[W * H];
    for (int i = 0; i < W * H; i++)
        map[i] = (float)i - 1;
    map[19] = NAN;
    map[18] = 2e30f;
    swap(map, W * H, 4);
    make_ramp(in(state, "a.fits"), 16, "");
    make_image(in(state, "w.fits"), -32, "", map);
    rx_tile_params par = PLAIN;
    par.weight_name = in(state, "w.fits");
    static const struct {
        rx_weight_type type;
        double threshold;
        int masked[W * H]; /* among the first: which */
    } cases[] = {{RX_WEIGHT_MAP_WEIGHT, NAN, {1, 1, 0, 0, 0, [18] = 0, [19] = 1}},
                 {RX_WEIGHT_MAP_WEIGHT, 2, {1, 1, 1, 1, 0, [18] = 0, [19] = 1}},
                 {RX_WEIGHT_MAP_RMS, NAN, {1, 1, 0, 0, 0, [18] = 1, [19] = 1}},
                 {RX_WEIGHT_MAP_VAR, 16, {1, 1, 0, 0, 0, [17] = 1, [18] = 1, [19] = 1}}};
    for (size_t k = 0; k < sizeof cases / sizeof cases[0]; k++) {
        par.weight_type = cases[k].type;
        par.weight_threshold = cases[k].threshold;
        rx_tile *tile = read_tile(&par, in(state, "a.fits"), 0, 1);
        assert_int_equal(tile->weight_type, cases[k].type);
        assert_true(tile->weight[5] == 4.f);
        assert_true(!isnan(tile->weight[19]));
        for (int i = 0; i < W * H; i++)
            assert_int_equal(tile->mask[i], cases[k].masked[i] ? RX_MASK_WEIGHT : 0);
        rx_tile_free(tile);
    }
    par.weight_type =
        RX_WEIGHT_MAP_IVAR; /* becomes an rms; not above 0, or the threshold, or no number: no data */
    for (int k = 0; k < 2; k++) {
        par.weight_threshold = k == 0 ? NAN : 2;
        rx_tile *tile = read_tile(&par, in(state, "a.fits"), 0, 1);
        assert_int_equal(tile->weight_type, RX_WEIGHT_MAP_RMS);
        assert_near(tile->weight[5], 0.5, 1e-7);
        for (int i = 0; i < W * H; i++)
            assert_int_equal(tile->mask[i], i - 1 > (k == 0 ? 0 : 2) && i != 19 ? 0 : RX_MASK_WEIGHT);
        rx_tile_free(tile);
    }
    par.weight_type = RX_WEIGHT_BACKGROUND; /* no file is read */
    par.weight_name = "nosuch.fits";
    rx_tile *tile = read_tile(&par, in(state, "a.fits"), 0, 1);
    assert_null(tile->weight);
    assert_int_equal(tile->weight_type, RX_WEIGHT_BACKGROUND);
    rx_tile_free(tile);
}

static void test_companions(void **state)
{
    char tile_name[1000], map_name[900];
    char many[900];
    make_many(in(state, "m.fits"));
    snprintf(many, sizeof many, "%s", in(state, "m.fits"));
    make_many(in(state, "w.fits"));
    snprintf(map_name, sizeof map_name, "%s", in(state, "w.fits"));
    rx_tile_params par = PLAIN;
    par.weight_type = RX_WEIGHT_MAP_WEIGHT;
    par.weight_name = map_name;
    par.nflags = 1;
    par.flag_names[0] = map_name;
    rx_tile *tile = read_tile(&par, many, 3, 2); /* second of those processed */
    assert_true(tile->weight[0] == 2.f);
    assert_int_equal(tile->nflagmaps, 1);
    assert_int_equal(tile->flagmaps[0][0], 2);
    rx_tile_free(tile);
    snprintf(tile_name, sizeof tile_name, "%s[4][1:3,1:2]", many); /* same HDU, same section */
    tile = read_tile(&par, tile_name, 4, 1);
    assert_true(tile->weight[0] == 3.f);
    assert_true(tile->weight[1] == 0.f);
    rx_tile_free(tile);
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_tile_read(&par, many, 4, 7, NULL, &tile, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "belongs"));
    par.weight_name = many;
    err = RX_ERROR_NONE;
    assert_int_equal(rx_tile_read(&par, many, 4, 3, NULL, &tile, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "is the image itself"));
}

/* Image extensions of these names, each of one value, in integers where `bits` says so. */
typedef struct plane {
    const char *name;
    float value;
    int bits; /* 0 = an image of the value; else the value in one pixel, 1 = bits that the header names, -1 = floats */
} plane;

static void make_planes(const char *path, const plane *planes, int n)
{
    fitsfile *file = NULL;
    int failed = 0;
    long axes[2] = {W, H};
    remove(path);
    fits_create_diskfile(&file, path, &failed);
    fits_create_img(file, BYTE_IMG, 0, NULL, &failed);
    for (int i = 0; i < n; i++) {
        float pixels[W * H];
        for (int k = 0; k < W * H; k++)
            pixels[k] = k == 7 || planes[i].bits == 0 ? planes[i].value : 0;
        fits_create_img(file, planes[i].bits > 0 ? LONG_IMG : FLOAT_IMG, 2, axes, &failed);
        char name[72];
        const int length = (int)strcspn(planes[i].name, ",");
        snprintf(name, sizeof name, "%.*s", length, planes[i].name);
        if (length > 0)
            fits_write_key_str(file, "EXTNAME", name, NULL, &failed);
        if (planes[i].name[length] == ',')
            fits_write_key_lng(file, "EXTVER", atol(planes[i].name + length + 1), NULL, &failed);
        if (planes[i].bits > 0) {
            fits_write_key_lng(file, "MP_SAT", 1, NULL, &failed);
            fits_write_key_lng(file, "HIERARCH MP_NO_DATA", 8, NULL, &failed);
            fits_write_key_lng(file, "HIERARCH MP_DETECTED", 5, NULL, &failed);
        }
        fits_write_img(file, TFLOAT, 1, W * H, pixels, &failed);
    }
    fits_close_file(file, &failed);
    assert_int_equal(failed, 0);
}

/* The map of an image is the one of its name, whatever its place; one of fewer images is refused. */
static void companions_go_by_their_names(void **state)
{
    static const plane images[] = {{"A", 1, 0}, {"B", 2, 0}}, swapped[] = {{"b", 20, 0}, {"a", 10, 0}},
                       one[] = {{"A", 10, 0}}, nameless[] = {{"", 7, 0}};
    char path[900];
    rx_tile_params par = PLAIN;
    rx_error err = RX_ERROR_NONE;
    rx_tile *tile = NULL;
    make_planes(in(state, "ab.fits"), images, 2);
    snprintf(path, sizeof path, "%s", in(state, "ab.fits"));
    par.weight_type = RX_WEIGHT_MAP_WEIGHT;
    par.weight_name = in(state, "map.fits");
    make_planes(par.weight_name, swapped, 2);
    for (int i = 0; i < 2; i++) {
        tile = read_tile(&par, path, i + 1, i + 1);
        assert_near(tile->weight[0], 10 * tile->pixels[0], 0);
        rx_tile_free(tile);
    }
    make_planes(par.weight_name, one, 1);
    tile = read_tile(&par, path, 1, 1);
    rx_tile_free(tile);
    assert_int_equal(rx_tile_read(&par, path, 2, 2, NULL, &tile, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "belongs to HDU 2, B"));
    make_planes(par.weight_name, nameless, 1);
    err = RX_ERROR_NONE;
    assert_int_equal(rx_tile_read(&par, path, 2, 2, NULL, &tile, &err), RX_INPUT);
    char named[910];
    snprintf(named, sizeof named, "%s[2]", path); /* one tile, one map */
    tile = read_tile(&par, named, 2, 1);
    assert_near(tile->weight[0], 7, 0);
    rx_tile_free(tile);
}

/* The version of an image counts as its name does: in another file, and of a name that several HDUs have. */
static void companions_go_by_their_versions(void **state)
{
    static const plane images[] = {{"SCI,1", 1, 0}, {"WHT,1", 10, 0}, {"SCI,2", 2, 0}, {"WHT,2", 20, 0}},
                       swapped[] = {{"SCI,2", 20, 0}, {"SCI,1", 10, 0}},
                       others[] = {{"W,2", 20, 0}, {"W,1", 10, 0}},
                       unversioned[] = {{"SCI", 10, 0}, {"SCI", 20, 0}},
                       wrong[] = {{"W,2", 20, 0}, {"X", 10, 0}};
    static const struct {
        const plane *planes;
        const char *suffix; /* of the map's name */
        int n, found;       /* 0: refused */
    } maps[] = {{swapped, "", 2, 1},     {others, "", 2, 1},      {others, "[w]", 2, 1},
                {images, "[WHT]", 4, 1}, {unversioned, "", 2, 1}, {unversioned, "[SCI]", 2, 0},
                {wrong, "", 2, 0}};
    char path[900], map[900], name[920];
    rx_tile_params par = PLAIN;
    snprintf(path, sizeof path, "%s", in(state, "images.fits"));
    snprintf(map, sizeof map, "%s", in(state, "maps.fits"));
    make_planes(path, images, 4);
    par.weight_type = RX_WEIGHT_MAP_WEIGHT;
    par.weight_name = name;
    for (size_t k = 0; k < sizeof maps / sizeof *maps; k++) {
        make_planes(map, maps[k].planes, maps[k].n);
        snprintf(name, sizeof name, "%s%s", map, maps[k].suffix);
        for (int i = 0; i < 2; i++) {
            rx_error err = RX_ERROR_NONE;
            rx_tile *tile = NULL;
            const rx_status status = rx_tile_read(&par, path, 1 + 2 * i, 1 + i, NULL, &tile, &err);
            if (maps[k].found == 0 && i == 0) {
                assert_int_equal(status, RX_INPUT);
                assert_non_null(strstr(err.text, "belongs to HDU 1, SCI"));
                assert_non_null(strstr(err.text, "maps.fits[n]"));
            } else if (maps[k].found != 0) {
                assert_int_equal(status, RX_OK);
                assert_near(tile->weight[0], 10 * tile->pixels[0], 0);
            }
            rx_tile_free(tile);
        }
    }
}

/* Maps beside their image are no tiles; those of Rubin's files are taken unless WEIGHT_TYPE is set. */
static void maps_in_the_file_of_the_image(void **state)
{
    static const plane rubin[] = {{"IMAGE", 100, 0}, {"MASK", (1 << 8) + (1 << 5), 1}, {"VARIANCE", 9, 0}},
                       webb[] = {{"SCI", 100, 0}, {"ERR", 3, 0}, {"DQ", 1, 1}},
                       only[] = {{"ERR", 3, 0}, {"DQ", 1, 1}},
                       full[] = {{"IMAGE", 100, 0}, {"MASK", 2, 1}, {"VARIANCE", 9, 0}};
    const struct {
        const plane *planes;
        int n, listed;
    } files[] = {{rubin, 3, 1}, {webb, 3, 1}, {only, 2, 2}};
    char path[900];
    snprintf(path, sizeof path, "%s", in(state, "planes.fits"));
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        int *hdus = NULL, n = 0;
        make_planes(path, files[i].planes, files[i].n);
        assert_int_equal(rx_tile_list(path, NULL, &hdus, &n, NULL), RX_OK);
        assert_int_equal(n, files[i].listed);
        assert_int_equal(hdus[0], 1);
        free(hdus);
    }
    rx_tile_params par = PLAIN;
    for (int own = 0; own < 2; own++)
        for (int k = 0; k < 2; k++) {
            par.own_maps = own;
            make_planes(path, k == 0 ? rubin : full, 3);
            rx_tile *tile = read_tile(&par, path, 1, 1);
            assert_int_equal(tile->weight_type, own ? RX_WEIGHT_MAP_VAR : RX_WEIGHT_NONE);
            assert_int_equal(tile->mask[7], !own ? 0 : k == 0 ? RX_MASK_WEIGHT : RX_MASK_SATURATED);
            assert_int_equal(tile->mask[8], 0);
            if (own)
                assert_near(tile->weight[3], 9, 0);
            rx_tile_free(tile);
        }
    make_planes(path, webb, 3);
    rx_tile *tile = read_tile(&par, path, 1, 1);
    assert_null(tile->weight);
    rx_tile_free(tile);
}

/* Names in other letters, several detectors in a file, each with its own maps. */
static void maps_of_several_images(void **state)
{
    static const plane images[] = {{"image", 1, 0}, {"Mask", 2, 1},   {"VARIANCE", 10, 0},
                                   {"IMAGE", 2, 0}, {"MASK", 256, 1}, {"VARIANCE", 20, 0}},
                       euclid[] = {{"DET11.SCI", 1, 0}, {"DET11.RMS", 2, 0}, {"DET11.FLG", 0, 1},
                                   {"DET12.SCI", 2, 0}, {"DET12.RMS", 2, 0}, {"DET12.FLG", 0, 1}},
                       hubble[] = {{"SCI,1", 1, 0}, {"D2IMARR,1", 2, 0}, {"WCSDVARR,1", 2, 0},
                                   {"SCI,2", 2, 0}, {"MASKBITS", 2, 0},  {"CHI2", 2, 0}};
    static const plane *const files[] = {images, euclid, hubble};
    char path[900];
    rx_tile_params par = PLAIN;
    snprintf(path, sizeof path, "%s", in(state, "several.fits"));
    par.own_maps = 1;
    for (size_t k = 0; k < sizeof files / sizeof *files; k++) {
        int *hdus = NULL, n = 0;
        make_planes(path, files[k], 6);
        assert_int_equal(rx_tile_list(path, NULL, &hdus, &n, NULL), RX_OK);
        assert_int_equal(n, 2);
        assert_int_equal(hdus[1], 4);
        free(hdus);
        for (int i = 0; k == 0 && i < 2; i++) {
            rx_tile *tile = read_tile(&par, path, 1 + 3 * i, 1 + i);
            assert_near(tile->weight[0], 10 * tile->pixels[0], 0);
            assert_int_equal(tile->mask[7], i == 0 ? RX_MASK_SATURATED : RX_MASK_WEIGHT);
            rx_tile_free(tile);
        }
    }
}

/* A mask of floats, and one whose header does not say what its bits are. */
static void masks_without_their_bits(void **state)
{
    static const plane truth[] = {{"IMAGE", 100, 0}, {"MASK", 1, -1}, {"VARIANCE", 9, 0}},
                       bits[] = {{"IMAGE", 100, 0}, {"MASK", 6, -1}, {"VARIANCE", 9, 0}},
                       half[] = {{"IMAGE", 100, 0}, {"MASK", .5F, -1}, {"VARIANCE", 9, 0}};
    char path[900];
    rx_tile_params par = PLAIN;
    rx_error err = RX_ERROR_NONE;
    snprintf(path, sizeof path, "%s", in(state, "mask.fits"));
    par.own_maps = 1;
    make_planes(path, truth, 3);
    rx_tile *tile = read_tile(&par, path, 1, 1);
    assert_int_equal(tile->mask[7], RX_MASK_WEIGHT);
    assert_int_equal(tile->mask[8], 0);
    rx_tile_free(tile);
    make_planes(path, bits, 3);
    tile = read_tile(&par, path, 1, 1);
    assert_int_equal(tile->mask[7], 0);
    rx_tile_free(tile);
    make_planes(path, half, 3);
    tile = NULL;
    assert_int_equal(rx_tile_read(&par, path, 1, 1, NULL, &tile, &err), RX_INPUT);
    assert_string_equal(err.where, path); /* the HDU once */
    assert_int_equal(err.hdu, 2);
    assert_non_null(strstr(err.text, "no integer"));
    assert_non_null(strstr(err.text, "WEIGHT_TYPE NONE"));
}

static void test_flag_bits(void **state)
{
    int32_t bits[W * H] = {0, 1, INT32_MIN, -1, 0x7fffffff};
    swap(bits, W * H, 4);
    make_ramp(in(state, "a.fits"), 16, "");
    make_image(in(state, "f.fits"), 32, "", bits);
    rx_tile_params par = PLAIN;
    par.nflags = 1;
    par.flag_names[0] = in(state, "f.fits");
    rx_tile *tile = read_tile(&par, in(state, "a.fits"), 0, 1);
    assert_true(tile->flagmaps[0][1] == 1);
    assert_true(tile->flagmaps[0][2] == UINT32_C(0x80000000));
    assert_true(tile->flagmaps[0][3] == UINT32_MAX);
    assert_true(tile->flagmaps[0][4] == 0x7fffffff);
    rx_tile_free(tile);
}

/* IMAFLAGS_ISO has 32 bits, as SExtractor's. */
static void test_flags_of_64_bits(void **state)
{
    int64_t bits[W * H] = {0, 1, INT64_C(0x80000000), UINT32_MAX};
    make_ramp(in(state, "a.fits"), 16, "");
    swap(bits, W * H, 8);
    make_image(in(state, "f.fits"), 64, "", bits);
    rx_tile_params par = PLAIN;
    par.nflags = 1;
    par.flag_names[0] = in(state, "f.fits");
    rx_tile *tile = read_tile(&par, in(state, "a.fits"), 0, 1);
    assert_int_equal(tile->flagmaps[0][1], 1);
    assert_int_equal(tile->flagmaps[0][2], UINT32_C(0x80000000));
    assert_int_equal(tile->flagmaps[0][3], UINT32_MAX);
    rx_tile_free(tile);
    static const int64_t beyond[] = {INT64_C(1) << 32, INT64_C(1) << 40, -1};
    for (size_t i = 0; i < sizeof beyond / sizeof *beyond; i++) {
        memset(bits, 0, sizeof bits);
        bits[7] = beyond[i];
        swap(bits, W * H, 8);
        make_image(in(state, "f.fits"), 64, "", bits);
        check_refused(&par, in(state, "a.fits"), "pixel (3,2) have bits beyond the 32");
    }
}

/* --- headers that cfitsio would not write --- */

/* BSCALE and BZERO before ZTENSION, as astropy 5 writes them. */
static void put_scale_first(const char *path)
{
    fitsfile *file = NULL;
    int failed = 0;
    char card[FLEN_CARD];
    fits_open_diskfile(&file, path, READWRITE, &failed);
    fits_movabs_hdu(file, 2, NULL, &failed);
    fits_update_card(file, "ZSIMPLE", "ZTENSION= 'IMAGE   '", &failed);
    static const char *const keys[] = {"BSCALE", "BZERO"};
    for (int i = 0; i < 2; i++) {
        fits_read_card(file, keys[i], card, &failed);
        fits_delete_key(file, keys[i], &failed);
        fits_insert_record(file, 9 + i, card, &failed); /* behind TFIELDS */
    }
    fits_close_file(file, &failed);
    assert_int_equal(failed, 0);
}

static void test_compressed_scale_first(void **state)
{
    static const struct {
        int bitpix, type;
        double low, high;
    } types[] = {{USHORT_IMG, TUSHORT, 0, 65535},
                 {SBYTE_IMG, TSBYTE, -128, 127},
                 {ULONG_IMG, TUINT, 2147483648.0 - 1e6, 2147483648.0 + 1e6}};
    static const int methods[] = {RICE_1, GZIP_1, GZIP_2, HCOMPRESS_1};
    enum { SIDE = 40 };
    long axes[2] = {SIDE, SIDE};
    for (size_t t = 0; t < sizeof types / sizeof *types; t++)
        for (size_t m = 0; m < sizeof methods / sizeof *methods; m++) {
            static double pixels[SIDE * SIDE];
            static uint16_t shorts[SIDE * SIDE];
            static int8_t bytes[SIDE * SIDE];
            static uint32_t words[SIDE * SIDE];
            void *const stored[] = {shorts, bytes, words};
            fitsfile *file = NULL;
            int failed = 0;
            for (int i = 0; i < SIDE * SIDE; i++) {
                pixels[i] = floor(types[t].low + (types[t].high - types[t].low) * ((i * 37) % 1000) / 999);
                shorts[i] = (uint16_t)(t == 0 ? pixels[i] : 0);
                bytes[i] = (int8_t)(t == 1 ? pixels[i] : 0);
                words[i] = (uint32_t)(t == 2 ? pixels[i] : 0);
            }
            const char *path = in(state, "scaled.fits.fz");
            remove(path);
            fits_create_diskfile(&file, path, &failed);
            fits_set_compression_type(file, methods[m], &failed);
            fits_create_img(file, types[t].bitpix, 2, axes, &failed);
            fits_write_key_str(file, "OBJECT", "field", NULL, &failed);
            fits_write_img(file, types[t].type, 1, (LONGLONG)SIDE * SIDE, stored[t], &failed);
            fits_close_file(file, &failed);
            assert_int_equal(failed, 0);
            put_scale_first(path);
            rx_tile *tile = read_tile(&PLAIN, path, 1, 1);
            for (int i = 0; i < SIDE * SIDE; i++)
                assert_near(tile->pixels[i], (float)pixels[i], 0);
            assert_memory_equal(tile->cards, "XTENSION= 'IMAGE   '", 20);
            assert_memory_equal(tile->cards + 80, "BITPIX  = ", 10);
            assert_memory_equal(tile->cards + 160, "NAXIS   =                    2", 30);
            assert_memory_equal(tile->cards + 240, "NAXIS1  =                   40", 30);
            assert_memory_equal(tile->cards + 320, "NAXIS2  =                   40", 30);
            char text[80];
            assert_true(rx_cards_text(tile->cards, (long)tile->ncards, "BZERO", text, sizeof text));
            assert_true(rx_cards_text(tile->cards, (long)tile->ncards, "OBJECT", text, sizeof text));
            assert_false(rx_cards_text(tile->cards, (long)tile->ncards, "TTYPE1", text, sizeof text));
            rx_tile_free(tile);
        }
}

/* What cfitsio reads in two ways, or not at all, is read in one: BSCALE in quotes, exponents and keywords of small
 * letters, a comment behind END. Axes that NAXIS does not count are none. */
static void test_odd_headers(void **state)
{
    static const char *const cards[] = {
        "BSCALE  = '0.5 '\nBZERO   = '0'", "BSCALE  = 5e-1",
        "bscale  =0.5 per count",          "BSCALE  = 5.D-1 / a comment\nBSCALE  = 5.D-1",
        "BSCALE  = .5\nNAXIS3  = 7",       "BSCALE  = .5\nEND / of the header"};
    for (size_t i = 0; i < sizeof cards / sizeof *cards; i++) {
        make_ramp(in(state, "odd.fits"), 16, cards[i]);
        rx_tile *tile = read_tile(&PLAIN, in(state, "odd.fits"), 0, 1);
        for (int k = 0; k < W * H; k++)
            assert_near(tile->pixels[k], 0.5 * k, 0);
        rx_tile_free(tile);
    }
}

/* What FITS does not allow is left out, and said once. */
static void test_illegal_keywords(void **state)
{
    make_ramp(in(state, "a.fits"), 16,
              "GAIN    = 2.5\nA.B     = 1\nPV1_0  = 0.1\nCONTINUE  'x'\nKEY A   = 'two&'\nCONTINUE  'x'\n"
              "naxis1  = 7\nobject  = 'm31'\nbitpix  = 8\nxtension= 'IMAGE'\nbzero   = 0\nOBSERVER= 'I'");
    FILE *stream = tmpfile();
    rx_log log;
    rx_log_init(&log, "test", stream, RX_NORMAL);
    rx_tile *tile = NULL;
    rx_tile_params par = PLAIN;
    par.gain = 2.5;
    assert_int_equal(rx_tile_read(&par, in(state, "a.fits"), 0, 1, &log, &tile, NULL), RX_OK);
    char said[400] = "", text[80];
    rewind(stream);
    assert_non_null(fgets(said, sizeof said, stream));
    assert_non_null(strstr(said, "a.fits[0]: "));
    assert_non_null(strstr(said, ": 'A.B     ', 'PV1_0  =', 'KEY A   '\n"));
    assert_null(fgets(said, sizeof said, stream));
    fclose(stream);
    static const char *const kept[] = {"OBJECT", "OBSERVER", "GAIN"}, *const never[] = {"A.B     ",
                                                                                        "CONTINUE"};
    for (size_t k = 0; k < 3; k++)
        assert_true(rx_cards_text(tile->cards, (long)tile->ncards, kept[k], text, sizeof text));
    for (size_t k = 0; k < 2 * tile->ncards; k++)
        assert_int_not_equal(strncmp(tile->cards + k / 2 * 80, never[k % 2], 8), 0);
    rx_tile_free(tile);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_bitpix),
                                       cmocka_unit_test(test_scaling_and_blank),
                                       cmocka_unit_test(test_no_numbers),
                                       cmocka_unit_test(test_units),
                                       cmocka_unit_test(test_inherit),
                                       cmocka_unit_test(test_compressed),
                                       cmocka_unit_test(test_names),
                                       cmocka_unit_test(test_bad_names),
                                       cmocka_unit_test(test_planes_of_a_cube),
                                       cmocka_unit_test(test_planes_of_a_compressed_cube),
                                       cmocka_unit_test(test_weights),
                                       cmocka_unit_test(test_companions),
                                       cmocka_unit_test(companions_go_by_their_names),
                                       cmocka_unit_test(companions_go_by_their_versions),
                                       cmocka_unit_test(maps_in_the_file_of_the_image),
                                       cmocka_unit_test(maps_of_several_images),
                                       cmocka_unit_test(masks_without_their_bits),
                                       cmocka_unit_test(test_flag_bits),

                                       cmocka_unit_test(test_flags_of_64_bits),
                                       cmocka_unit_test(test_compressed_scale_first),
                                       cmocka_unit_test(test_odd_headers),
                                       cmocka_unit_test(test_illegal_keywords)};
    return cmocka_run_group_tests_name("tiles", tests, make_scratch, remove_scratch);
}
