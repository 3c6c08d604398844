/* Photometry and shapes of Gaussians against formulas; masks, neighbours, threads, flags. */
#include "../detect/field.h"
#include "../near.h"
#include "measure/measure.h"

enum { W = 160, H = 120 };

static rx_measure_params params(void)
{
    return (rx_measure_params){.naper = 2,
                               .aperture_diameter = {10.0, 24.0},
                               .auto_factor = 2.5,
                               .auto_min_radius = 3.5,
                               .petro_factor = 2.0,
                               .petro_min_radius = 3.5,
                               .nradii = 2,
                               .flux_fraction = {0.5, 0.8},
                               .neighbours = RX_NEIGHBOURS_CORRECT,
                               .nthreads = 1};
}

static rx_image image_of(const field *f)
{
    return (rx_image){.width = f->width,
                      .height = f->height,
                      .pixels = f->pixels,
                      .noise = rx_map_plane(f->sigma, f->width),
                      .mask = f->mask,
                      .hide = 1,
                      .saturated = f->mask,
                      .global_noise = 1.0};
}

static rx_sources *detect_and_measure(const field *f, const rx_measure_params *par)
{
    rx_detect_params detect = field_params();
    rx_sources *s = field_detect(f, &detect);
    rx_image image = image_of(f);
    assert_int_equal(rx_measure_run(par, &image, NULL, NULL, s, NULL), RX_OK);
    return s;
}

/* Pixels with their sky give what those above it give, to the bit, and hidden ones nothing. */
static void takes_the_sky_off(void **state)
{
    field f = field_new(W, H, 1.0, 3);
    field_add(&f, 80.0, 60.0, 3.0, 3.0, 100000.0);
    field_add(&f, 95.0, 60.0, 3.0, 3.0, 30000.0);
    float *with_sky = calloc(f.n, sizeof *with_sky), *level = calloc(f.n, sizeof *level);
    assert_true(with_sky != NULL);
    assert_true(level != NULL);
    f.mask[60 * W + 81] = 1;
    for (size_t k = 0; k < f.n; k++) {
        level[k] = 300.0f + 0.1f * (float)(k % W);
        with_sky[k] = f.pixels[k] + level[k];
        f.pixels[k] = f.mask[k] != 0 ? 0.0f : with_sky[k] - level[k];
    }
    rx_detect_params detect = field_params();
    rx_sources *a = field_detect(&f, &detect), *b = field_detect(&f, &detect);
    rx_measure_params par = params();
    par.local_background = 1;
    par.local_thickness = 24;
    rx_image image = image_of(&f);
    image.level = rx_map_plane(level, W);
    assert_int_equal(rx_measure_run(&par, &image, NULL, NULL, a, NULL), RX_OK);
    image.pixels = with_sky;
    image.with_sky = 1;
    assert_int_equal(rx_measure_run(&par, &image, NULL, NULL, b, NULL), RX_OK);
    assert_true(a->n >= 2);
    assert_true(a->n == b->n);
    for (int i = 0; i < a->n; i++) {
        assert_true(a->list[i].flux_auto > 0);
        assert_true(a->list[i].flux_auto == b->list[i].flux_auto);
        assert_true(a->list[i].flux_aper[0] == b->list[i].flux_aper[0]);
        assert_true(a->list[i].fwhm == b->list[i].fwhm);
        assert_true(a->list[i].background == b->list[i].background);
        assert_memory_equal(a->list[i].iso, b->list[i].iso, sizeof a->list[i].iso);
    }
    rx_sources_free(a);
    rx_sources_free(b);
    free(with_sky);
    free(level);
    field_free(&f);
}

static void hides_neighbours(void **state)
{
    field f = field_new(W, H, 0.0, 1);
    field_add(&f, 70.0, 60.0, 3.0, 3.0, 50000.0);
    field_add(&f, 88.0, 60.0, 3.0, 3.0, 50000.0);
    rx_measure_params par = params();
    par.aperture_diameter[0] = 40.0;
    double flux[3];
    for (int i = 0; i < 3; i++) {
        par.neighbours = (rx_mask_type)i;
        rx_sources *s = detect_and_measure(&f, &par);
        assert_int_equal(s->n, 2);
        flux[i] = field_find(s, 70.0, 60.0)->flux_aper[0];
        assert_int_equal((field_find(s, 70.0, 60.0)->flags & RX_FLAG_CROWDED) != 0, i != 0);
        rx_sources_free(s);
    }
    assert_true(flux[RX_NEIGHBOURS_NONE] > 60000.0);
    assert_near(flux[RX_NEIGHBOURS_BLANK], 50000.0, 250);
    assert_near(flux[RX_NEIGHBOURS_CORRECT], 50000.0, 250);
    field_free(&f);
}

static void same_for_any_threads_and_masked_values(void **state)
{
    field f = field_new(W, H, 1.0, 3);
    field_crowd(&f, 120, 1500.0, 4);
    for (size_t i = 0; i < f.n; i++)
        f.mask[i] = i % 31 == 0;
    rx_measure_params par = params();
    par.vignet_width = par.vignet_height = 7;
    par.local_background = 1;
    par.local_thickness = 8;
    field_scramble(&f, 1);
    rx_sources *a = detect_and_measure(&f, &par);
    field_scramble(&f, 2);
    par.nthreads = 5;
    rx_sources *b = detect_and_measure(&f, &par);
    assert_true(a->n > 40);
    assert_int_equal(a->n, b->n);
    assert_memory_equal(a->list, b->list, (size_t)a->n * sizeof *a->list);
    assert_memory_equal(a->vignets, b->vignets, (size_t)a->n * 49 * sizeof(float));
    for (int i = 0; i < a->n; i++) {
        assert_true(isfinite(a->list[i].flux_auto));
        assert_true(isfinite(a->list[i].xwin));
        assert_true(isfinite(a->list[i].awin));
        assert_true(isfinite(a->list[i].flux_radius[0]));
        assert_true(isfinite(a->list[i].flux_petro));
    }
    rx_sources_free(a);
    rx_sources_free(b);
    field_free(&f);
}

static void flags_what_is_wrong(void **state)
{
    field f = field_new(W, H, 0.0, 1);
    field_add(&f, 3.0, 60.0, 2.0, 2.0, 20000.0);
    field_add(&f, 80.0, 60.0, 2.0, 2.0, 20000.0);
    field_add(&f, 120.0, 30.0, 2.0, 2.0, 20000.0);
    f.mask[60 * W + 80] = RX_MASK_SATURATED;
    f.mask[30 * W + 123] = RX_MASK_WEIGHT;
    rx_measure_params par = params();
    rx_sources *s = detect_and_measure(&f, &par);
    assert_int_equal(field_find(s, 3.0, 60.0)->flags, RX_FLAG_TRUNCATED | RX_FLAG_APERTURE);
    assert_int_equal(field_find(s, 80.0, 60.0)->flags, RX_FLAG_SATURATED);
    assert_int_equal(field_find(s, 120.0, 30.0)->flags_weight, RX_FLAGW_ISO | RX_FLAGW_NEIGHBOUR);
    rx_sources_free(s);
    field_free(&f);
}

/* Dual-image mode: the ellipses of AUTO and PETRO come from the detection image. */
static void takes_radii_from_the_detection_image(void **state)
{
    field wide = field_new(W, H, 0.0, 1), narrow = field_new(W, H, 0.0, 1);
    field_add(&wide, 80.3, 60.6, 4.0, 4.0, 100000.0);
    field_add(&narrow, 80.3, 60.6, 1.5, 1.5, 50000.0);
    rx_measure_params par = params();
    par.auto_min_radius = par.petro_min_radius = 0.5;
    rx_sources *s = detect_and_measure(&wide, &par);
    assert_int_equal(s->n, 1);
    const rx_source first = s->list[0];
    rx_image detection = image_of(&wide), image = image_of(&narrow);
    assert_int_equal(rx_measure_run(&par, &image, NULL, NULL, s, NULL), RX_OK);
    assert_true(s->list[0].kron_radius < 0.6 * first.kron_radius);
    assert_int_equal(rx_measure_run(&par, &image, &detection, NULL, s, NULL), RX_OK);
    assert_near(s->list[0].kron_radius, first.kron_radius, 1e-12);
    assert_near(s->list[0].petro_radius, first.petro_radius, 1e-12);
    assert_near(s->list[0].flux_auto / 50000.0, 1.0, 1e-3);
    rx_sources_free(s);
    field_free(&wide);
    field_free(&narrow);
}

static void combines_flag_maps(void **state)
{
    field f = field_new(W, H, 0.0, 1);
    f.pixels[50 * W + 50] = f.pixels[50 * W + 51] = f.pixels[51 * W + 50] = 10.0f;
    f.pixels[51 * W + 51] = f.pixels[52 * W + 50] = 10.0f;
    uint32_t *map = RX_NEW(uint32_t, f.n);
    map[50 * W + 50] = 6;
    map[50 * W + 51] = map[51 * W + 50] = 3;
    map[51 * W + 51] = 9;
    rx_detect_params detect = field_params();
    detect.filter = NULL;
    rx_sources *s = field_detect(&f, &detect);
    assert_int_equal(s->n, 1);
    rx_image image = image_of(&f);
    rx_measure_params par = params();
    image.nflagmaps = 1;
    image.flagmaps = &map;
    /* OR, AND, MIN, MAX, MOST of 6 3 3 9 0 */
    const unsigned value[5] = {15, 0, 3, 9, 3};
    const int count[5] = {4, 4, 2, 1, 2};
    int type = 0;
    par.flag_types = &type;
    for (; type < 5; type++) {
        assert_int_equal(rx_measure_run(&par, &image, NULL, NULL, s, NULL), RX_OK);
        assert_int_equal(s->list[0].imaflags[0], value[type]);
        assert_int_equal(s->list[0].nimaflags[0], count[type]);
    }
    /* a way for each map */
    uint32_t *maps[2] = {map, map};
    const int types[2] = {2, 3};
    image.nflagmaps = 2;
    image.flagmaps = maps;
    par.flag_types = types;
    assert_int_equal(rx_measure_run(&par, &image, NULL, NULL, s, NULL), RX_OK);
    assert_int_equal(s->list[0].imaflags[0], 3);
    assert_int_equal(s->list[0].imaflags[1], 9);
    free(map);
    rx_sources_free(s);
    field_free(&f);
}

static void no_source_is_fine(void **state)
{
    field f = field_new(W, H, 0.0, 1);
    rx_measure_params par = params();
    par.vignet_width = par.vignet_height = 5;
    rx_sources *s = detect_and_measure(&f, &par);
    assert_int_equal(s->n, 0);
    assert_int_equal(s->naper, 2);
    rx_sources_free(s);
    field_free(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(takes_the_sky_off),
                                       cmocka_unit_test(hides_neighbours),
                                       cmocka_unit_test(same_for_any_threads_and_masked_values),
                                       cmocka_unit_test(flags_what_is_wrong),
                                       cmocka_unit_test(takes_radii_from_the_detection_image),
                                       cmocka_unit_test(combines_flag_maps),
                                       cmocka_unit_test(no_source_is_fine)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
