/* Template photometry in the stage: what hides, threads and saturated pixels change no byte; covariances. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "base/memory.h"
#include "base/random.h"
#include "desk.h"
#include "stage/template_table.h"

enum { SIDE = 220, AREA = SIDE * SIDE };
static const double FWHM = 3.5;

static void assert_same(const desk *a, const desk *b)
{
    const rx_tphot *one = a->fit.tphot, *two = b->fit.tphot;
    assert_int_equal(a->result.sources->n, b->result.sources->n);
    assert_memory_equal(a->result.sources->list, b->result.sources->list,
                        (size_t)a->result.sources->n * sizeof(rx_source));
    assert_memory_equal(a->result.sources->segments, b->result.sources->segments, AREA * sizeof(int32_t));
    assert_int_equal(one->n, two->n);
    assert_int_equal(one->npairs, two->npairs);
    assert_memory_equal(one->list, two->list, (size_t)one->n * sizeof *one->list);
    assert_memory_equal(one->pairs, two->pairs, (size_t)one->npairs * sizeof *one->pairs);
    assert_memory_equal(one->model, two->model, AREA * sizeof(float));
    assert_memory_equal(one->residual, two->residual, AREA * sizeof(float));
    assert_true(a->fit.chi2 == b->fit.chi2);
    assert_true(a->fit.added == b->fit.added);
}

/* A crowded tile with a masked column, a hole and a saturated core; what stands there is drawn with `seed`.
 */
static void hidden_pixels(scene *s, uint8_t *mask, uint64_t seed)
{
    scene_make(s, SIDE, SIDE, 40, 18);
    scene_star(s, 100.4, 150.2, 4e5, FWHM);
    for (size_t i = 0; i < AREA; i++) {
        const int x = (int)(i % SIDE), y = (int)(i / SIDE);
        mask[i] = x == 60                                  ? RX_MASK_BAD
                  : x > 130 && x < 150 && y > 20 && y < 31 ? RX_MASK_WEIGHT
                  : hypot(x - 100.4, y - 150.2) < 2.5      ? RX_MASK_SATURATED
                                                           : 0;
        if (mask[i] != 0)
            s->pixels[i] = (float)(1e5 * rx_random_uniform(seed, 1, i));
    }
}

static void values_under_masks_do_not_matter(void **state)
{
    (void)state;
    static const char *const kinds[] = {"NONE", "RL"};
    static const setting settings[] = {{"MASK_SATURATED", "Y"},
                                       {"TEMPLATE_COVAR_NAME", "c.cat"},
                                       {"CHECKIMAGE_TYPE", "TEMPLATE_MODEL"},
                                       {NULL, NULL}};
    static uint8_t mask[AREA];
    for (int turn = 0; turn < 2; turn++) {
        desk d[2];
        for (int k = 0; k < 2; k++) {
            scene s;
            hidden_pixels(&s, mask, 20 + (uint64_t)k);
            desk_open(&d[k], kinds[turn], &s, mask, 2, settings);
            desk_fit(&d[k], NULL);
            scene_free(&s);
        }
        assert_same(&d[0], &d[1]);
        assert_true(d[0].result.sources->n > 20);
        desk_close(&d[0]);
        desk_close(&d[1]);
    }
}

/* Where the list was made with saturated pixels, the fits still do not look at them. */
static void saturated_pixels_take_no_part(void **state)
{
    (void)state;
    static const setting settings[] = {{"MASK_SATURATED", "N"},
                                       {"TEMPLATE_COVAR_NAME", "c.cat"},
                                       {"CHECKIMAGE_TYPE", "TEMPLATE_MODEL"},
                                       {NULL, NULL}};
    static uint8_t mask[AREA];
    desk d[2];
    scene s;
    hidden_pixels(&s, mask, 20);
    for (int k = 0; k < 2; k++) {
        desk_open(&d[k], "NONE", &s, mask, 2, settings);
        for (size_t i = 0; i < AREA && k == 1; i++)
            if (mask[i] == RX_MASK_SATURATED) {
                d[k].field->tile->pixels[i] += (float)(1e4 * rx_random_normal(3, 1, i));
                d[k].result.restored->pixels[i] += (float)(1e4 * rx_random_normal(3, 2, i));
            }
        desk_fit(&d[k], NULL);
    }
    assert_same(&d[0], &d[1]);
    desk_close(&d[0]);
    desk_close(&d[1]);
    scene_free(&s);
}

static void threads_change_no_byte(void **state)
{
    (void)state;
    static const char *const kinds[] = {"NONE", "RL"};
    static const char *const threads[] = {"1", "2", "3"};
    static uint8_t mask[AREA];
    scene s;
    hidden_pixels(&s, mask, 30);
    for (int turn = 0; turn < 2; turn++) {
        desk d[3];
        for (int k = 0; k < 3; k++) {
            const setting settings[] = {{"NTHREADS", threads[k]},
                                        {"TEMPLATE_COVAR_NAME", "c.cat"},
                                        {"CHECKIMAGE_TYPE", "TEMPLATE_MODEL"},
                                        {NULL, NULL}};
            desk_open(&d[k], kinds[turn], &s, mask, 2, settings);
            desk_fit(&d[k], NULL);
            if (k > 0)
                assert_same(&d[0], &d[k]);
        }
        assert_true(d[0].fit.tphot->npairs > 0);
        for (int k = 0; k < 3; k++)
            desk_close(&d[k]);
    }
    scene_free(&s);
}

static double cell(const rx_table *table, const char *name, long row)
{
    return rx_column_value(&table->columns[rx_table_find(table, name)], row, 0);
}

/* Every row against the fit; the largest correlation of a source is its BLEND. */
static void check_rows(const rx_table *table, const rx_sources *sources, int complete)
{
    double *largest = RX_NEW(double, (size_t)sources->n + 1);
    assert_non_null(largest);
    for (long row = 0; row < table->nrows; row++) {
        const long i = (long)cell(table, "NUMBER_1", row), j = (long)cell(table, "NUMBER_2", row);
        const double covariance = cell(table, "COVAR_TEMPLATE", row);
        const double correlation = cell(table, "CORREL_TEMPLATE", row);
        assert_true(i >= 1);
        assert_true(i <= sources->n);
        assert_true(j >= 1);
        assert_true(j <= sources->n);
        assert_true(i != j);
        const rx_source_template *a = &sources->list[i - 1].fit, *b = &sources->list[j - 1].fit;
        assert_int_equal(cell(table, "EXT_NUMBER", row), 3);
        assert_int_equal(a->group, b->group);
        assert_true(correlation >= -1);
        assert_true(correlation <= 1);
        assert_true(fabs(correlation * a->fluxerr * b->fluxerr - covariance) <= 1e-9 * fabs(covariance));
        largest[i] = fmax(largest[i], fabs(correlation));
        largest[j] = fmax(largest[j], fabs(correlation));
    }
    for (int i = 0; i < sources->n; i++) {
        const double blend = sources->list[i].fit.blend;
        assert_true(largest[i + 1] <= blend + 1e-6);
        if (complete)
            assert_near(largest[i + 1], blend, 1e-6);
    }
    free(largest);
}

static void covariances_as_a_table(void **state)
{
    (void)state;
    long rows[2] = {0};
    for (int dropped = 0; dropped < 2; dropped++) {
        const setting settings[] = {{"PRECISION_TARGET", dropped ? "0.5" : "0"},
                                    {"DETECT_THRESH", "0.6"},
                                    {"TEMPLATE_TYPE", "POINT"},
                                    {"TEMPLATE_COVAR_NAME", "c.cat"},
                                    {"CHECKIMAGE_TYPE", "TEMPLATE_MODEL"},
                                    {NULL, NULL}};
        scene s;
        desk d;
        rx_table *table = NULL;
        scene_make(&s, SIDE, SIDE, 100, 21);
        desk_open(&d, "NONE", &s, NULL, 0, settings);
        desk_fit(&d, NULL);
        assert_int_equal(rx_template_table(d.fit.tphot, d.result.sources, 3, &table, NULL), RX_OK);
        rows[dropped] = table->nrows;
        if (!dropped)
            assert_int_equal(table->nrows, d.fit.tphot->npairs);
        else {
            assert_true(d.fit.dropped > 10);
            assert_true(d.result.sources->n > 20);
        }
        check_rows(table, d.result.sources, !dropped);
        rx_table_free(table);
        desk_close(&d);
        scene_free(&s);
    }
    assert_true(rows[1] > 0);
    assert_true(rows[0] > rows[1]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_under_masks_do_not_matter),
        cmocka_unit_test(saturated_pixels_take_no_part),
        cmocka_unit_test(threads_change_no_byte),
        cmocka_unit_test(covariances_as_a_table),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
