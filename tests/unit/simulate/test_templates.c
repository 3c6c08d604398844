/* Templates: made by hand and read back, drawn on a grid, and the real ones. */
#include "../io/io_test.h"

#include <math.h>

#include "base/random.h"
#include "io/fits_write.h"
#include "simulate/render.h"
#include "simulate/template_isolate.h"
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
    assert_int_equal(
        rx_fits_image(writer, pixels, width, height, NULL, NULL, 0, cards.data, cards.length / 80, NULL),
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
    assert_true(t->width < 60 && t->height < 60); /* without the neighbour */
    assert_true(fabs(t->angle - 0.5) < 0.02 && fabs(t->ratio - 0.5) < 0.03);
    /* of an ellipse in round apertures, scipy: with w(t) = cos(t)**2 / 36 + sin(t)**2 / 9,
     * brentq(lambda r: quad(lambda t: (1 - exp(-r * r / 2 * w(t))) / w(t), 0, 2 * pi)[0] / (36 * pi) - .5, 1,
     * 20) */
    assert_true(fabs(t->radius - 5.2225) < 0.08);
    /* flux / (noise sqrt(pixels)): some 800 pixels */
    assert_true(t->snr > 1000.0 / (0.05 * sqrt(1500.0)) && t->snr < 1000.0 / (0.05 * sqrt(500.0)));
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
    /* neither scale nor PSF */
    write_image(in(state, "plain.fits"), pixels, SIDE, SIDE, "");
    all = read_all(in(state, "plain.fits"), 0.07, 10.0);
    assert_true(all->list[0].pixel_scale == 0.07 && all->list[0].fwhm == 0.0);
    rx_templates_free(all);
}

/* Position: what is in the middle of the crop is where the object was. */
static void test_isolate(void **state)
{
    (void)state;
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
    assert_true(fabs(px - best % t.width + t.x - 52.3) < 0.05 &&
                fabs(py - best / t.width + t.y - 48.6) < 0.05);
    double radius = t.radius;
    free(t.pixels);
    /* a sky that is told; pixels that are not numbers, or masked, with a spike in them */
    t = (rx_template){0};
    pixels[48 * SIDE + 40] = NAN;
    pixels[55 * SIDE + 60] = 1e6f;
    mask[55 * SIDE + 60] = 1;
    assert_int_equal(rx_template_isolate(pixels, mask, SIDE, SIDE, 7.0, &t, NULL), RX_OK);
    assert_true(fabs(t.radius - radius) < 0.05 && fabs(pixel_sum(&t) - 1.0) < 1e-5);
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
    dump(in(state, "notes.txt"), "no FITS", 7);
    rx_templates *all = read_all(in(state, "."), 0.05, 20.0);
    assert_int_equal(all->n, 3); /* by name, the empty image left out, the PSF no template */
    assert_string_equal(all->list[0].name, "m.fits[0]");
    assert_string_equal(all->list[1].name, "m.fits[2]");
    assert_string_equal(all->list[2].name, "z.fits[0]");
    assert_true(all->list[0].pixel_scale == 0.05 && fabs(all->list[1].pixel_scale - 0.1) < 1e-6);
    assert_true(all->list[2].fwhm > 0.0 && all->list[0].fwhm == 0.0);
    rx_templates_free(all);
    snprintf(list, sizeof list, "# comment\n\n  %s  # the second\r\n%s\n", in(state, "z.fits"),
             in(state, "m.fits"));
    dump(in(state, "names.txt"), list, strlen(list));
    snprintf(list, sizeof list, "@%s", in(state, "names.txt"));
    all = read_all(list, 0.05, 20.0);
    assert_int_equal(all->n, 3);
    assert_string_equal(all->list[0].name, "z.fits[0]");
    rx_templates_free(all);
    /* all too faint */
    check_refused(in(state, "."), 1e6, "", "S/N");
    /* a damaged file is named */
    dump(in(state, "q.fits"), "SIMPLE  = nonsense", 18);
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
    assert_int_equal(rx_fits_table(writer, table, NULL, 0, NULL), RX_OK);
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
        assert_true(all->list[0].pixel_scale == 0.03 && all->list[1].pixel_scale == 0.04);
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

/* --- drawing --- */

/* A smooth lopsided template: an elliptical Gaussian with a blob at one end. */
static rx_template synthetic(void)
{
    rx_template t = {.name = "made", .width = 41, .height = 37, .pixel_scale = 0.03, .fwhm = 0.09};
    double sum = 0.0, x1 = 0.0, y1 = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
    t.pixels = calloc(41 * 37, sizeof(float));
    for (int pass = 0; pass < 2; pass++)
        for (int y = 0; y < 37; y++)
            for (int x = 0; x < 41; x++) {
                double dx = x - 20.0, dy = y - 18.0, u = dx * cos(0.4) + dy * sin(0.4),
                       v = dy * cos(0.4) - dx * sin(0.4);
                double ex = u - 6.0,
                       value = exp(-0.5 * (u * u / 16.0 + v * v / 4.0)) + exp(-0.25 * (ex * ex + v * v));
                if (pass == 0)
                    sum += value;
                else
                    t.pixels[y * 41 + x] = (float)(value / sum);
                double w = value / (pass == 0 ? 1.0 : sum);
                if (pass == 1) {
                    x1 += w * x;
                    y1 += w * y;
                    xx += w * x * x;
                    yy += w * y * y;
                    xy += w * x * y;
                }
            }
    t.x = x1;
    t.y = y1;
    xx -= x1 * x1;
    yy -= y1 * y1;
    xy -= x1 * y1;
    t.angle = 0.5 * atan2(2.0 * xy, xx - yy);
    double half = 0.5 * (xx + yy), root = hypot(0.5 * (xx - yy), xy);
    t.ratio = sqrt((half - root) / (half + root));
    t.radius = 4.0;
    return t;
}

typedef struct moments {
    double sum, x, y, xx, yy, xy, skew; /* skew: third moment along `along` */
} moments;

static moments measure(const rx_fine_grid *grid, double along)
{
    moments m = {0};
    for (int pass = 0; pass < 2; pass++)
        for (int j = 0; j < grid->height; j++)
            for (int i = 0; i < grid->width; i++) {
                double x = grid->x0 + i * grid->step, y = grid->y0 + j * grid->step;
                double value = (double)grid->cells[(size_t)j * grid->stride + (size_t)i];
                assert_true(value >= 0.0);
                if (pass == 0) {
                    m.sum += value;
                    m.x += value * x;
                    m.y += value * y;
                    continue;
                }
                double dx = x - m.x / m.sum, dy = y - m.y / m.sum, u = dx * cos(along) + dy * sin(along);
                m.xx += value * dx * dx / m.sum;
                m.yy += value * dy * dy / m.sum;
                m.xy += value * dx * dy / m.sum;
                m.skew += value * u * u * u / m.sum;
            }
    m.x /= m.sum;
    m.y /= m.sum;
    return m;
}

static rx_fine_grid make_grid(int n)
{
    rx_fine_grid grid = {.width = n, .height = n, .step = 1.0 / 3.0, .stride = (size_t)n};
    grid.x0 = grid.y0 = -(n - 1) / 6.0;
    grid.cells = calloc((size_t)n * (size_t)n, sizeof(float));
    assert_non_null(grid.cells);
    return grid;
}

static double trace_of(const rx_template *t)
{
    double sum = 0.0;
    for (int y = 0; y < t->height; y++)
        for (int x = 0; x < t->width; x++)
            sum += (double)t->pixels[y * t->width + x] * ((x - t->x) * (x - t->x) + (y - t->y) * (y - t->y));
    return sum;
}

/* Flux, centroid, angle and size at any stretch, turn and flip. */
static void test_draw(void **state)
{
    (void)state;
    rx_template t = synthetic();
    const double stretches[] = {0.03, 0.1, 0.2, 0.33, 0.7, 2.5};
    for (int k = 0; k < 6; k++)
        for (int flip = 0; flip < 2; flip++) {
            rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 500.0, .x = 0.4, .y = -1.3, .flip = flip};
            o.stretch = stretches[k];
            o.angle = 0.9 * k - 2.0;
            rx_fine_grid grid = make_grid(401);
            rx_template_draw(&o, &t, &grid);
            moments got = measure(&grid, o.angle);
            assert_true(fabs(got.sum / 500.0 - 1.0) < 1e-3);
            /* what is smaller than a cell lies in its middle */
            double error = k == 0 ? 0.15 * grid.step : 5e-3;
            assert_true(fabs(got.x - o.x) < error && fabs(got.y - o.y) < error);
            if (k == 0) {
                free(grid.cells);
                continue;
            }
            double angle = 0.5 * atan2(2.0 * got.xy, got.xx - got.yy);
            assert_true(fabs(remainder(angle - o.angle, PI)) < 0.02);
            /* size: the template's and the spline's 1/3 pixel^2 per axis; cells that are means of points add
             * up to their own 2 / 12 of a cell */
            double want = (trace_of(&t) + 2.0 / 3.0) * o.stretch * o.stretch, cell = 2.0 / 12.0 / 9.0;
            assert_true(got.xx + got.yy > want * 0.998 && got.xx + got.yy < want * 1.002 + cell);
            /* everything is in the reach, and the blob is at the far end: a flip turns its handedness only */
            rx_templates all = {1, &t};
            double reach = rx_object_reach(&o, &all), beyond = 0.0;
            for (int j = 0; j < 401; j++)
                for (int i = 0; i < 401; i++)
                    if (fmax(fabs(grid.x0 + i * grid.step - o.x), fabs(grid.y0 + j * grid.step - o.y)) >
                        reach)
                        beyond += (double)grid.cells[j * 401 + i];
            assert_true(beyond < 0.5);
            free(grid.cells);
        }
    free(t.pixels);
}

/* Turned by half a circle the image is upside down; flipped at its own axis' mirror it is mirrored. */
static void test_draw_symmetry(void **state)
{
    (void)state;
    enum { N = 101 };
    rx_template t = synthetic();
    rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 1.0, .stretch = 0.3, .angle = 0.7};
    rx_fine_grid a = make_grid(N), b = make_grid(N), c = make_grid(N);
    rx_template_draw(&o, &t, &a);
    o.angle += PI;
    rx_template_draw(&o, &t, &b);
    o.angle = -0.7;
    o.flip = 1;
    rx_template_draw(&o, &t, &c);
    assert_true(fabs(measure(&a, 0.7).skew) > 0.01);
    for (int j = 0; j < N; j++)
        for (int i = 0; i < N; i++) {
            assert_true(fabsf(a.cells[j * N + i] - b.cells[(N - 1 - j) * N + N - 1 - i]) < 1e-7f);
            assert_true(fabsf(a.cells[j * N + i] - c.cells[j * N + N - 1 - i]) < 1e-7f);
        }
    free(a.cells);
    free(b.cells);
    free(c.cells);
    free(t.pixels);
}

/* A flat template stays flat: no holes between pixels at any stretch, no beat of cells and pixels. */
static void test_draw_flat(void **state)
{
    (void)state;
    rx_template t = {.width = 200, .height = 200, .x = 99.5, .y = 99.5, .ratio = 1.0, .pixel_scale = 0.03};
    t.pixels = calloc(200 * 200, sizeof(float));
    for (int i = 0; i < 200 * 200; i++)
        t.pixels[i] = 1.0f / 40000.0f;
    const double stretches[] = {0.07, 0.31, 1.0 / 3.0, 1.7, 6.1};
    for (int k = 0; k < 5; k++) {
        rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 1.0, .stretch = stretches[k], .angle = 0.3 * k};
        rx_fine_grid grid = make_grid(41);
        rx_template_draw(&o, &t, &grid);
        double want = 1.0 / 40000.0 / 9.0 / (o.stretch * o.stretch);
        for (int i = 0; i < 41 * 41; i++)
            assert_true(fabs((double)grid.cells[i] / want - 1.0) < 1e-5);
        free(grid.cells);
    }
    free(t.pixels);
}

/* One pixel drawn is the spline: variance 1/3 pixel^2, as rx_template_blur() says. */
static void test_blur(void **state)
{
    (void)state;
    rx_template t = {.width = 1, .height = 1, .ratio = 1.0, .pixel_scale = 0.05};
    float one = 1.0f;
    t.pixels = &one;
    rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 1.0, .stretch = 5.0, .x = 0.1};
    rx_fine_grid grid = make_grid(101);
    rx_template_draw(&o, &t, &grid);
    moments got = measure(&grid, 0.0);
    assert_true(fabs(got.sum - 1.0) < 1e-4);
    assert_true(fabs(got.xx / 25.0 - 1.0 / 3.0) < 1e-3 && fabs(got.yy / 25.0 - 1.0 / 3.0) < 1e-3);
    free(grid.cells);
    t.fwhm = 0.15;
    assert_true(fabs(rx_template_blur(&t) - sqrt(9.0 + 8.0 * log(2.0) / 3.0)) < 1e-12);
    t.fwhm = 0.0;
    assert_true(fabs(rx_template_blur(&t) - sqrt(4.0 + 8.0 * log(2.0) / 3.0)) < 1e-12);
}

static void test_draw_clipped(void **state)
{
    (void)state;
    enum { N = 120, X = 40, Y = 55, PART = 30 };
    rx_template t = synthetic();
    rx_object o = {.type = RX_OBJECT_TEMPLATE, .flux = 100.0, .stretch = 0.4, .angle = 0.7, .x = -2.0};
    rx_fine_grid whole = make_grid(N), part = make_grid(N);
    part.x0 += X * part.step;
    part.y0 += Y * part.step;
    part.width = part.height = PART;
    rx_template_draw(&o, &t, &whole);
    rx_template_draw(&o, &t, &part);
    double sum = 0.0;
    for (int j = 0; j < PART; j++)
        for (int i = 0; i < N; i++) {
            double got = (double)part.cells[j * N + i];
            double want = i < PART ? (double)whole.cells[(j + Y) * N + i + X] : 0.0;
            assert_true(fabs(got - want) <= 1e-5 * want + 1e-9);
            sum += got;
        }
    assert_true(sum > 1.0);
    o.x = -1e7;
    memset(part.cells, 0, sizeof(float) * N * N);
    rx_template_draw(&o, &t, &part);
    for (int i = 0; i < N * N; i++)
        assert_true(part.cells[i] == 0.0f);
    free(whole.cells);
    free(part.cells);
    free(t.pixels);
}

/* --- the real ones --- */

static void test_cosmos(void **state)
{
    const char *data = real_data();
    char path[2048];
    (void)state;
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
    assert_true(good->n >= 35 && good->n <= 50);
    for (int i = 0; i < all->n; i++) {
        const rx_template *t = &all->list[i];
        assert_true(fabs(pixel_sum(t) - 1.0) < 1e-5);
        assert_true(t->pixel_scale == 0.03 && t->fwhm > 0.095 && t->fwhm < 0.115); /* ACS F814W: 0.1 arcsec */
        assert_true(t->radius > 2.0 && t->radius < 40.0);
        /* flux on the grid of an SDSS tile */
        rx_object o = {
            .type = RX_OBJECT_TEMPLATE, .flux = 1.0, .stretch = 0.2, .angle = 0.1 * i, .flip = i & 1};
        rx_fine_grid grid = make_grid(221);
        rx_template_draw(&o, t, &grid);
        double sum = measure(&grid, 0.0).sum;
        if (!(fabs(sum - 1.0) < 1e-3))
            print_message("%s: %g\n", t->name, sum);
        assert_true(fabs(sum - 1.0) < 1e-3);
        free(grid.cells);
    }
    rx_templates_free(all);
    rx_templates_free(good);
}

static void test_hst_spiral(void **state)
{
    const char *data = real_data();
    char path[2048];
    (void)state;
    if (data == NULL) {
        skip();
        return;
    }
    snprintf(path, sizeof path, "%s/templates/hst_147246_masknoise.fits", data);
    if (access(path, R_OK) != 0) {
        print_message("no HST spiral: skipped\n");
        skip();
        return;
    }
    rx_templates *all = read_all(path, 1.0, 10.0);
    assert_int_equal(all->n, 1);
    const rx_template *t = &all->list[0];
    assert_true(fabs(t->pixel_scale - 0.03) < 1e-4 && fabs(t->fwhm - 0.104) < 0.005);
    assert_true(t->width < 250 && t->radius > 25.0 && t->radius < 37.0 && t->ratio > 0.85); /* face on */
    rx_templates_free(all);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_file, make_scratch, drop_scratch),
        cmocka_unit_test(test_isolate),
        cmocka_unit_test_setup_teardown(test_folder_and_list, make_scratch, drop_scratch),
        cmocka_unit_test_setup_teardown(test_catalogue, make_scratch, drop_scratch),
        cmocka_unit_test(test_draw),
        cmocka_unit_test(test_draw_symmetry),
        cmocka_unit_test(test_draw_flat),
        cmocka_unit_test(test_blur),
        cmocka_unit_test(test_draw_clipped),
        cmocka_unit_test(test_cosmos),
        cmocka_unit_test(test_hst_spiral),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
