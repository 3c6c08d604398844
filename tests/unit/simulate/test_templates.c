/* Templates: made by hand and read back, and the real ones. */
#include "../io/io_test.h"

#include <math.h>

#include "base/random.h"
#include "io/fits_write.h"
#include "simulate/templates.h"

#define PI 3.14159265358979323846

enum { SIDE = 101 };

/* --- files --- */

/* An elliptical Gaussian of total flux 1000 at (52.3, 48.6), sigma 6 and 3 along 0.5 rad, a neighbour in the
 * corner, sky 7 and white noise of 0.05. */
static void fill_galaxy(float *pixels, double noise)
{
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            double dx = x - 52.3, dy = y - 48.6, u = dx * cos(0.5) + dy * sin(0.5),
                   v = dy * cos(0.5) - dx * sin(0.5);
            double value = 1000.0 / (2.0 * PI * 18.0) * exp(-0.5 * (u * u / 36.0 + v * v / 9.0));
            double ex = x - 90.0, ey = y - 12.0;
            value += 8.0 * exp(-0.5 * (ex * ex + ey * ey) / 4.0);
            pixels[y * SIDE + x] =
                (float)(7.0 + value + noise * rx_random_normal(3, 1, (uint64_t)(y * SIDE + x)));
        }
}

static void fill_psf(float *pixels, int width, int height, double sigma)
{
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            int dx = x - width / 2, dy = y - height / 2;
            pixels[y * width + x] = (float)exp(-0.5 * (dx * dx + dy * dy) / (sigma * sigma));
        }
}

static rx_fits_writer *create(const char *path)
{
    rx_fits_writer *writer = NULL;
    unlink(path);
    assert_int_equal(rx_fits_create(path, path, &writer, NULL), RX_OK);
    return writer;
}

static void append(rx_fits_writer *writer, const float *pixels, int width, int height, const char *lines)
{
    rx_text cards = {0};
    cards_from(lines, &cards);
    assert_int_equal(rx_fits_image(writer,
                                   &(rx_fits_plane){.width = width, .height = height, .floats = pixels},
                                   &cards, NULL),
                     RX_OK);
    rx_text_free(&cards);
}

static void write_image(const char *path, const float *pixels, int width, int height, const char *lines)
{
    rx_fits_writer *writer = create(path);
    append(writer, pixels, width, height, lines);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
}

static const char scale_cards[] =
    "CTYPE1  = 'RA---TAN'\nCTYPE2  = 'DEC--TAN'\nCRVAL1  = 150.0\nCRVAL2  = 2.2\n"
    "CRPIX1  = 50.0\nCRPIX2  = 50.0\nCDELT1  = -2.777777778E-05\nCDELT2  = "
    "2.777777778E-05\nCUNIT1  = 'deg'\nCUNIT2  = 'deg'\n";

static rx_templates *read_all(const char *name, double scale, double snr)
{
    rx_templates *templates = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_templates_read(name, scale, snr, NULL, &templates, &err) != RX_OK)
        fail_msg("%s: %s", err.where, err.text);
    return templates;
}

static void check_refused(const char *name, double snr, const char *where, const char *word)
{
    rx_templates *templates = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_templates_read(name, 0.03, snr, NULL, &templates, &err), RX_INPUT);
    assert_null(templates);
    if (strstr(err.text, word) == NULL || strstr(err.where, where) == NULL)
        fail_msg("'%s: %s' does not say '%s' of '%s'", err.where, err.text, word, where);
}

static double pixel_sum(const rx_template *t)
{
    double sum = 0.0;
    for (int i = 0; i < t->width * t->height; i++) {
        assert_true(t->pixels[i] >= 0.0f);
        sum += (double)t->pixels[i];
    }
    return sum;
}

/* --- reading --- */

static void check_galaxy(const rx_template *t)
{
    assert_true(fabs(pixel_sum(t) - 1.0) < 1e-5);
    assert_true(t->width < 60);
    assert_true(t->height < 60); /* without the neighbour */
    assert_true(fabs(t->angle - 0.5) < 0.02);
    assert_true(fabs(t->ratio - 0.5) < 0.03);
    /* of an ellipse in round apertures, scipy: with w(t) = cos(t)**2 / 36 + sin(t)**2 / 9,
     * brentq(lambda r: quad(lambda t: (1 - exp(-r * r / 2 * w(t))) / w(t), 0, 2 * pi)[0] / (36 * pi) - .5, 1,
     * 20) */
    assert_true(fabs(t->radius - 5.2225) < 0.08);
    /* flux / (noise sqrt(pixels)): some 800 pixels */
    assert_true(t->snr > 1000.0 / (0.05 * sqrt(1500.0)));
    assert_true(t->snr < 1000.0 / (0.05 * sqrt(500.0)));
}

static void test_file(void **state)
{
    static float pixels[SIDE * SIDE], psf[25 * 31];
    fill_galaxy(pixels, 0.05);
    fill_psf(psf, 25, 31, 2.0);
    write_image(in(state, "a_b.fits"), pixels, SIDE, SIDE, scale_cards);
    write_image(in(state, "a_psf.fits"), psf, 25, 31, "");
    rx_templates *all = read_all(in(state, "a_b.fits"), 0.03, 10.0);
    assert_int_equal(all->n, 1);
    check_galaxy(&all->list[0]);
    assert_string_equal(all->list[0].name, "a_b.fits[0]");
    assert_true(fabs(all->list[0].pixel_scale - 0.1) < 1e-6);
    /* the profile that fits a Gaussian best is one of that width */
    assert_true(fabs(all->list[0].fwhm - 0.1 * 2.3548 * 2.0) < 0.01 * 0.471);
    rx_templates_free(all);
    /* a PSF that is none: its width counts as unknown */
    for (int i = 0; i < 25 * 31; i++)
        psf[i] = i == 0 ? NAN : i == 24 ? 9.0f : 0.0f;
    unlink(in(state, "a_psf.fits"));
    write_image(in(state, "a_psf.fits"), psf, 25, 31, "");
    all = read_all(in(state, "a_b.fits"), 0.03, 10.0);
    assert_true(all->n == 1);
    assert_true(all->list[0].fwhm == 0.0);
    rx_templates_free(all);
    /* neither scale nor PSF */
    write_image(in(state, "plain.fits"), pixels, SIDE, SIDE, "");
    all = read_all(in(state, "plain.fits"), 0.07, 10.0);
    assert_true(all->list[0].pixel_scale == 0.07);
    assert_true(all->list[0].fwhm == 0.0);
    rx_templates_free(all);
}

/* What is above the noise may have no light in the end: that is no template, and has no radius. */
static void test_isolate_no_light(void **state)
{
    static const char image[] = ".......-...."
                                "............"
                                "...---...--."
                                "...........-"
                                "-.-........."
                                "--.......-.."
                                "............"
                                ".........---"
                                "...-------.."
                                ".........-.."
                                "............"
                                ".......-1.-.";
    float pixels[144];
    rx_template t = {0};
    for (int i = 0; i < 144; i++)
        pixels[i] = image[i] == '-' ? NAN : image[i] == '1' ? 1.0f : 0.0f;
    assert_int_equal(rx_template_isolate(pixels, NULL, 12, 12, NAN, &t, NULL), RX_OK);
    assert_null(t.pixels);
}
/* Position: what is in the middle of the crop is where the object was. */
static void test_isolate(void **state)
{
    static float pixels[SIDE * SIDE];
    static unsigned char mask[SIDE * SIDE];
    rx_template t = {0};
    fill_galaxy(pixels, 0.0);
    for (int i = 0; i < SIDE * SIDE; i++)
        pixels[i] += 0.05f * (float)rx_random_normal(9, 1, (uint64_t)i);
    assert_int_equal(rx_template_isolate(pixels, NULL, SIDE, SIDE, NAN, &t, NULL), RX_OK);
    int best = 0, px = 0, py = 0;
    for (int i = 0; i < t.width * t.height; i++)
        best = t.pixels[i] > t.pixels[best] ? i : best;
    for (int i = 0, top = 0; i < SIDE * SIDE; i++)
        if (pixels[i] > pixels[top]) {
            top = i;
            px = i % SIDE;
            py = i / SIDE;
        }
    assert_true(fabs(px - best % t.width + t.x - 52.3) < 0.05);
    assert_true(fabs(py - best / t.width + t.y - 48.6) < 0.05);
    double radius = t.radius;
    free(t.pixels);
    /* a sky that is told; pixels that are not numbers, or masked, with a spike in them */
    t = (rx_template){0};
    pixels[48 * SIDE + 40] = NAN;
    pixels[55 * SIDE + 60] = 1e6f;
    mask[55 * SIDE + 60] = 1;
    assert_int_equal(rx_template_isolate(pixels, mask, SIDE, SIDE, 7.0, &t, NULL), RX_OK);
    assert_true(fabs(t.radius - radius) < 0.05);
    assert_true(fabs(pixel_sum(&t) - 1.0) < 1e-5);
    free(t.pixels);
    /* nothing but noise, and nothing at all */
    t = (rx_template){0};
    for (int i = 0; i < SIDE * SIDE; i++)
        pixels[i] = 0.0f;
    assert_int_equal(rx_template_isolate(pixels, NULL, SIDE, SIDE, NAN, &t, NULL), RX_OK);
    assert_null(t.pixels);
    assert_int_equal(rx_template_isolate(pixels, NULL, 1, 1, NAN, &t, NULL), RX_OK);
    assert_null(t.pixels);
}

static void test_folder_and_list(void **state)
{
    static float pixels[SIDE * SIDE], nothing[SIDE * SIDE], psf[625];
    char list[2048];
    fill_galaxy(pixels, 0.05);
    fill_psf(psf, 25, 25, 2.0);
    write_image(in(state, "z.fits"), pixels, SIDE, SIDE, "");
    write_image(in(state, "z_psf.fits"), psf, 25, 25, "");
    for (int i = 0; i < SIDE * SIDE; i++)
        nothing[i] = (float)rx_random_normal(4, 2, (uint64_t)i);
    rx_fits_writer *writer = create(in(state, "m.fits"));
    append(writer, pixels, SIDE, SIDE, "");
    append(writer, nothing, SIDE, SIDE, "");
    append(writer, pixels, SIDE, SIDE, scale_cards);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    write_bytes(in(state, "notes.txt"), "no FITS", 7);
    rx_templates *all = read_all(in(state, "."), 0.05, 20.0);
    assert_int_equal(all->n, 3); /* by name, the empty image left out, the PSF no template */
    assert_string_equal(all->list[0].name, "m.fits[0]");
    assert_string_equal(all->list[1].name, "m.fits[2]");
    assert_string_equal(all->list[2].name, "z.fits[0]");
    assert_true(all->list[0].pixel_scale == 0.05);
    assert_true(fabs(all->list[1].pixel_scale - 0.1) < 1e-6);
    assert_true(all->list[2].fwhm > 0.0);
    assert_true(all->list[0].fwhm == 0.0);
    rx_templates_free(all);
    snprintf(list, sizeof list, "# comment\n\n  %s  # the second\r\n%s\n", in(state, "z.fits"),
             in(state, "m.fits"));
    write_bytes(in(state, "names.txt"), list, strlen(list));
    snprintf(list, sizeof list, "@%s", in(state, "names.txt"));
    all = read_all(list, 0.05, 20.0);
    assert_int_equal(all->n, 3);
    assert_string_equal(all->list[0].name, "z.fits[0]");
    rx_templates_free(all);
    /* all too faint */
    check_refused(in(state, "."), 1e6, "", "S/N");
    /* a damaged file is named */
    write_bytes(in(state, "q.fits"), "SIMPLE  = nonsense", 18);
    check_refused(in(state, "."), 20.0, "q.fits", "");
    check_refused(in(state, "absent.fits"), 20.0, "absent.fits", "");
    snprintf(list, sizeof list, "@%s", in(state, "absent.txt"));
    check_refused(list, 20.0, "absent.txt", "");
}

/* --- RealGalaxy --- */

static void add_text_column(rx_column *column, const char *name, const char *first, const char *second)
{
    snprintf(column->name, sizeof column->name, "%s", name);
    column->type = RX_CELL_TEXT;
    column->text_width = 32;
    column->data = calloc(2, 32);
    snprintf(column->data, 32, "%s", first);
    snprintf((char *)column->data + 32, 32, "%s", second);
}

static void add_number_column(rx_column *column, const char *name, double first, double second)
{
    snprintf(column->name, sizeof column->name, "%s", name);
    column->type = RX_CELL_DOUBLE;
    double *data = calloc(2, sizeof *data);
    data[0] = first;
    data[1] = second;
    column->data = data;
}

static void write_catalogue(const char *path, const char *image)
{
    rx_table *table = rx_table_new(6);
    table->nrows = 2;
    add_text_column(&table->columns[0], "GAL_FILENAME", image, image);
    add_text_column(&table->columns[1], "PSF_FILENAME", "psfs.fits", "psfs.fits");
    add_number_column(&table->columns[2], "GAL_HDU", 1, 0);
    add_number_column(&table->columns[3], "PSF_HDU", 1, 0);
    add_number_column(&table->columns[4], "PIXEL_SCALE", 0.03, 0.04);
    add_number_column(&table->columns[5], "NOISE_MEAN", 7.0, 7.0);
    rx_fits_writer *writer = create(path);
    assert_int_equal(rx_fits_table(writer, table, NULL, NULL), RX_OK);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    rx_table_free(table);
}

static void test_catalogue(void **state)
{
    static float pixels[SIDE * SIDE], psf[625];
    rx_fits_writer *images = create(in(state, "images.fits")), *psfs = create(in(state, "psfs.fits"));
    fill_galaxy(pixels, 0.05);
    for (int k = 0; k < 2; k++) {
        append(images, pixels, SIDE, SIDE, "");
        fill_psf(psf, 25, 25, 1.5 + k);
        append(psfs, psf, 25, 25, "");
    }
    assert_int_equal(rx_fits_close(images, NULL), RX_OK);
    assert_int_equal(rx_fits_close(psfs, NULL), RX_OK);
    write_catalogue(in(state, "c.fits"), "images.fits");
    for (int k = 0; k < 2; k++) { /* the folder, and the catalogue by itself */
        rx_templates *all = read_all(in(state, k == 0 ? "." : "c.fits"), 9.0, 10.0);
        assert_int_equal(all->n, 2);
        assert_string_equal(all->list[0].name, "images.fits[1]");
        assert_string_equal(all->list[1].name, "images.fits[0]");
        assert_true(all->list[0].pixel_scale == 0.03);
        assert_true(all->list[1].pixel_scale == 0.04);
        check_galaxy(&all->list[0]);
        assert_true(fabs(all->list[0].fwhm - 0.03 * 2.3548 * 2.5) < 0.01 * 0.17);
        assert_true(fabs(all->list[1].fwhm - 0.04 * 2.3548 * 1.5) < 0.01 * 0.14);
        rx_templates_free(all);
    }
    write_catalogue(in(state, "c.fits"), "gone.fits");
    check_refused(in(state, "."), 10.0, "c.fits", "gone.fits");
    write_catalogue(in(state, "c.fits"), "");
    check_refused(in(state, "c.fits"), 10.0, "c.fits", "names no image");
}

/* --- the real ones --- */

static void test_cosmos(void **state)
{
    const char *data = real_data();
    char path[2048];
    if (data == NULL) {
        skip();
        return;
    }
    snprintf(path, sizeof path, "%s/templates/cosmos", data);
    if (access(path, R_OK) != 0) {
        print_message("no COSMOS templates: skipped\n");
        skip();
        return;
    }
    rx_templates *all = read_all(path, 1.0, 0.0), *good = read_all(path, 1.0, 50.0);
    assert_int_equal(all->n, 100);
    assert_true(good->n >= 35);
    assert_true(good->n <= 50);
    for (int i = 0; i < all->n; i++) {
        const rx_template *t = &all->list[i];
        assert_true(fabs(pixel_sum(t) - 1.0) < 1e-5);
        assert_true(t->pixel_scale == 0.03);
        assert_true(t->fwhm > 0.095);
        assert_true(t->fwhm < 0.115); /* ACS F814W: 0.1 arcsec */
        assert_true(t->radius > 2.0);
        assert_true(t->radius < 40.0);
    }
    rx_templates_free(all);
    rx_templates_free(good);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_file, make_scratch, remove_scratch),
        cmocka_unit_test(test_isolate),
        cmocka_unit_test(test_isolate_no_light),
        cmocka_unit_test_setup_teardown(test_folder_and_list, make_scratch, remove_scratch),
        cmocka_unit_test_setup_teardown(test_catalogue, make_scratch, remove_scratch),
        cmocka_unit_test(test_cosmos),

    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
