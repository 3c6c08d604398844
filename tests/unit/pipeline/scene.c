/* A small simulated tile. */
#include "scene.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "base/memory.h"
#include "base/random.h"
#include "io/fits_write.h"
#include "psf/psf.h"

enum { SKY = 1000, NOISE = 5 };

/* A star's pixels by 5 x 5 points each: the simulation needs no better than 1e-3. */
void scene_star(scene *s, double x, double y, double flux, double fwhm)
{
    const double beta = 4.765;
    double alpha = fwhm / (2.0 * sqrt(pow(2.0, 1.0 / beta) - 1.0));
    double norm = flux * (beta - 1.0) / (M_PI * alpha * alpha);
    int reach = 25;
    for (int j = (int)y - reach; j <= (int)y + reach; j++) {
        for (int i = (int)x - reach; i <= (int)x + reach; i++) {
            double sum = 0.0;
            if (i < 0 || j < 0 || i >= s->width || j >= s->height)
                continue;
            for (int k = 0; k < 25; k++) {
                double dx = i - x + (k % 5 - 2) / 5.0, dy = j - y + (k / 5 - 2) / 5.0;
                sum += pow(1.0 + (dx * dx + dy * dy) / (alpha * alpha), -beta);
            }
            s->pixels[(size_t)j * (size_t)s->width + (size_t)i] += (float)(norm * sum / 25.0);
        }
    }
}

void scene_make(scene *dst, int width, int height, int nstars, uint64_t seed)
{
    size_t n = (size_t)width * (size_t)height;
    *dst = (scene){.width = width, .height = height, .nstars = nstars};
    dst->pixels = RX_NEW(float, n);
    dst->weights = RX_NEW(float, n);
    dst->stars = rx_alloc((size_t)nstars, sizeof *dst->stars);
    assert_true(dst->pixels != NULL);
    assert_true(dst->weights != NULL);
    assert_true(dst->stars != NULL);
    for (size_t i = 0; i < n; i++) {
        dst->pixels[i] = (float)(SKY + NOISE * rx_random_normal(seed, 0, i));
        dst->weights[i] = 1.0f;
    }
    for (int k = 0; k < nstars; k++) {
        double *star = dst->stars[k];
        star[0] = (width - 1) * rx_random_uniform(seed, 1, (uint64_t)k);
        star[1] = (height - 1) * rx_random_uniform(seed, 2, (uint64_t)k);
        star[2] = pow(10.0, 2.8 + 2.0 * rx_random_uniform(seed, 3, (uint64_t)k));
        scene_star(dst, star[0], star[1], star[2], 3.5);
    }
}

void scene_free(scene *scene)
{
    free(scene->pixels);
    free(scene->weights);
    free(scene->stars);
}

void scene_write(const char *path, const float *pixels, int width, int height)
{
    rx_text cards = {0};
    rx_fits_writer *writer = NULL;
    rx_card_number(&cards, "SATURATE", 20000.0, "ADU");
    rx_card_number(&cards, "GAIN", 2.0, "e-/ADU");
    rx_card_text(&cards, "CTYPE1", "RA---TAN", "");
    rx_card_text(&cards, "CTYPE2", "DEC--TAN", "");
    rx_card_number(&cards, "CRVAL1", 150.0, "deg");
    rx_card_number(&cards, "CRVAL2", 2.0, "deg");
    rx_card_number(&cards, "CRPIX1", 100.0, "");
    rx_card_number(&cards, "CRPIX2", 100.0, "");
    rx_card_number(&cards, "CD1_1", -1e-4, "deg");
    rx_card_number(&cards, "CD1_2", 0.0, "deg");
    rx_card_number(&cards, "CD2_1", 0.0, "deg");
    rx_card_number(&cards, "CD2_2", 1e-4, "deg");
    unlink(path);
    assert_int_equal(rx_fits_create(path, path, &writer, NULL), RX_OK);
    assert_int_equal(rx_fits_image(writer,
                                   &(rx_fits_plane){.width = width,
                                                    .height = height,
                                                    .floats = pixels,
                                                    .cards = cards.data,
                                                    .ncards = cards.length / 80},
                                   NULL, NULL),
                     RX_OK);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    rx_text_free(&cards);
}

void scene_write_truth(const char *path, const scene *scene)
{
    static const char *const names[] = {"X_IMAGE", "Y_IMAGE", "MAG"};
    rx_fits_writer *writer = NULL;
    rx_table *table = rx_table_new(3);
    assert_non_null(table);
    table->nrows = scene->nstars;
    for (int c = 0; c < 3; c++) {
        rx_column *column = &table->columns[c];
        double *data = RX_NEW(double, (size_t)scene->nstars);
        assert_non_null(data);
        strcpy(column->name, names[c]);
        column->type = RX_CELL_DOUBLE;
        column->data = data;
        for (int i = 0; i < scene->nstars; i++)
            data[i] = c < 2 ? scene->stars[i][c] + 1.0 : 25.0 - 2.5 * log10(scene->stars[i][2]);
    }
    unlink(path);
    assert_int_equal(rx_fits_create(path, path, &writer, NULL), RX_OK);
    assert_int_equal(rx_fits_table(writer, table, NULL, NULL), RX_OK);
    assert_int_equal(rx_fits_close(writer, NULL), RX_OK);
    rx_table_free(table);
}
