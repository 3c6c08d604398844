/* Sky level and noise: truth of synthetic skies, masks, weights, odd tiles. */
#include "../near.h"
#include "data/map.h"
#include "detect/background.h"
#include "detect/mesh.h"
#include "field.h"

enum { W = 200, H = 150 };

static const rx_background_params defaults = {
    .mesh_width = 32, .mesh_height = 32, .filter_width = 3, .filter_height = 3};

static rx_background *measure(const field *f, const float *weight, rx_weight_type type, int no_rescale)
{
    rx_background_params par = defaults;
    rx_background *back = NULL;
    par.no_rescale = no_rescale;
    const rx_image image = {.width = f->width,
                            .height = f->height,
                            .pixels = f->pixels,
                            .mask = f->mask,
                            .hide = 1,
                            .weight = weight,
                            .weight_type = type};
    assert_int_equal(rx_background_measure(&par, &image, &back, NULL), RX_OK);
    return back;
}

static float level_at(const rx_background *back, size_t i)
{
    const rx_map map = rx_background_level(back);
    return rx_map_at(&map, (int)(i % (size_t)back->width), (int)(i / (size_t)back->width));
}

static float sigma_at(const rx_background *back, size_t i)
{
    const rx_map map = rx_background_noise(back);
    return rx_map_at(&map, (int)(i % (size_t)back->width), (int)(i / (size_t)back->width));
}

static void finds_level_and_noise(void **state)
{
    (void)state;
    field f = field_new(W, H, 3.0, 1);
    for (size_t i = 0; i < f.n; i++)
        f.pixels[i] += 100.0f + 0.05f * (float)(i % W);
    rx_background *back = measure(&f, NULL, RX_WEIGHT_NONE, 0);
    /* The slope adds (0.05 32)^2 / 12 to the variance, clipping at 3 sigma leaves 0.985 of sigma. A mesh of n
     * pixels knows sigma to sigma / sqrt(2 n) and its level (2.5 median - 1.5 mean) to 2.3 sigma / sqrt(n); a
     * median of nine is 1.25 / 3 as uncertain. In the middle all nine are whole, the last corner is one mesh
     * of 8 x 22 pixels. 4 sigma each. */
    const double sigma = 0.985 * sqrt(9.0 + 1.6 * 1.6 / 12.0), whole = 1.25 / 3.0 / 32.0,
                 corner = 1.0 / sqrt(8.0 * 22.0);
    assert_near(back->global_sigma, sigma, 4.0 * sigma * whole / sqrt(2.0));
    for (size_t i = 0; i < f.n; i++) {
        const size_t x = i % W, y = i / W;
        const double root = x >= 48 && x < W - 40 && y >= 48 && y < H - 54 ? whole : corner;
        assert_near(level_at(back, i), 100.0 + 0.05 * (double)x, 4.0 * 2.3 * sigma * root);
        assert_near(sigma_at(back, i), sigma, 4.0 * sigma * root / sqrt(2.0));
    }
    rx_background_free(back);
    field_free(&f);
}

static void is_blind_to_masked_values(void **state)
{
    (void)state;
    field f = field_new(W, H, 3.0, 2);
    for (size_t i = 0; i < f.n; i++)
        f.mask[i] = i % 7 == 0 || (i % W < 40 && i / W < 40);
    field_scramble(&f, 5);
    rx_background *a = measure(&f, NULL, RX_WEIGHT_NONE, 0);
    field_scramble(&f, 6);
    rx_background *b = measure(&f, NULL, RX_WEIGHT_NONE, 0);
    for (size_t i = 0; i < f.n; i++) {
        assert_true(level_at(a, i) == level_at(b, i));
        assert_true(sigma_at(a, i) == sigma_at(b, i));
    }
    assert_true(a->global_sigma == b->global_sigma);
    assert_true(a->global_level == b->global_level);
    assert_near(sigma_at(a, 0), 0.0, 0.0);
    rx_background_free(a);
    rx_background_free(b);
    field_free(&f);
}

static void copes_with_odd_tiles(void **state)
{
    (void)state;
    field f = field_new(20, 9, 0.0, 3); /* smaller than a mesh, constant */
    for (size_t i = 0; i < f.n; i++)
        f.pixels[i] = 7.0f;
    rx_background *back = measure(&f, NULL, RX_WEIGHT_NONE, 0);
    assert_near(back->global_sigma, 1.0, 0.0);
    assert_true(back->constant);
    for (size_t i = 0; i < f.n; i++) {
        assert_near(level_at(back, i), 7.0, 1e-5);
        assert_near(sigma_at(back, i), 1.0, 0.0);
    }
    rx_background_free(back);
    memset(f.mask, 1, f.n); /* nothing left */
    back = measure(&f, NULL, RX_WEIGHT_NONE, 0);
    assert_near(level_at(back, 5), 0.0, 0.0);
    assert_near(sigma_at(back, 5), 0.0, 0.0);
    assert_near(back->global_sigma, 1.0, 0.0);
    assert_true(back->constant);
    rx_background_free(back);
    field_free(&f);
}

static void scales_weights_to_the_noise(void **state)
{
    (void)state;
    field f = field_new(W, H, 1.0, 4);
    float *weight = RX_NEW(float, f.n), *variance = RX_NEW(float, f.n);
    for (size_t i = 0; i < f.n; i++) {
        float sigma = i % W < W / 2 ? 2.0f : 4.0f;
        f.pixels[i] *= sigma;
        variance[i] = sigma * sigma * 25.0f;
        weight[i] = 1.0f / variance[i];
    }
    weight[3] = 0.0f;
    f.mask[3] = 1;
    rx_background *back = measure(&f, weight, RX_WEIGHT_MAP_WEIGHT, 0);
    assert_near(sigma_at(back, 10), 2.0, 0.05);
    assert_near(sigma_at(back, W - 10), 4.0, 0.1);
    assert_near(sigma_at(back, 3), 0.0, 0.0);
    rx_background_free(back);
    back = measure(&f, variance, RX_WEIGHT_MAP_VAR, 1);
    assert_near(sigma_at(back, 10), 10.0, 1e-4);
    rx_background_free(back);
    back = measure(&f, variance, RX_WEIGHT_MAP_RMS, 0);
    assert_near(sigma_at(back, 10), 100.0, 0.0);
    rx_background_free(back);
    back = measure(&f, NULL, RX_WEIGHT_BACKGROUND, 0);
    assert_near(sigma_at(back, 10), 0.985 * 2.0,
                4.0 * 2.0 / 32.0 / sqrt(2.0)); /* one mesh of 32 x 32, clipped */
    rx_background_free(back);
    free(weight);
    free(variance);
    field_free(&f);
}

static void takes_a_manual_level_and_refuses_nonsense(void **state)
{
    (void)state;
    field f = field_new(W, H, 1.0, 5);
    rx_background_params par = defaults;
    rx_background *back = NULL;
    par.manual = 1;
    par.manual_value = 12.5;
    const rx_image image = {.width = W, .height = H, .pixels = f.pixels};
    assert_int_equal(rx_background_measure(&par, &image, &back, NULL), RX_OK);
    assert_near(level_at(back, 77), 12.5, 0.0);
    assert_near(back->global_level, 12.5, 0.0);
    assert_near(sigma_at(back, 77), 0.985, 4.0 / 32.0 / sqrt(2.0)); /* meshes of 32 x 32, clipped */
    rx_background_free(back);
    memset(f.mask, 1, f.n); /* nothing to measure */
    const rx_image hidden = {.width = W, .height = H, .pixels = f.pixels, .mask = f.mask, .hide = 1};
    assert_int_equal(rx_background_measure(&par, &hidden, &back, NULL), RX_OK);
    assert_near(level_at(back, 77), 12.5, 0.0);
    assert_near(back->global_level, 12.5, 0.0);
    rx_background_free(back);
    par.mesh_width = 0;
    assert_int_equal(rx_background_measure(&par, &image, &back, NULL), RX_USAGE);
    assert_null(back);
    field_free(&f);
}

/* A field with sources, and holes in which nothing is seen. */
static field make_patchy(int width, int height)
{
    field f = field_new(width, height, 3.0, 21);
    field_crowd(&f, 60, 900.0, 22);
    for (size_t i = 0; i < f.n; i++) {
        const size_t x = i % (size_t)width, y = i / (size_t)width;
        f.mask[i] = (x > 40 && x < 110 && y > 30 && y < 100) || i % 17 == 0;
        if (f.mask[i] != 0)
            f.pixels[i] = 0.0f;
    }
    return f;
}

static sep_bkg *measure_by_sep(const field *f, int mesh_width, int mesh_height, double threshold)
{
    sep_image image = {.data = f->pixels,
                       .mask = f->mask,
                       .dtype = SEP_TFLOAT,
                       .mdtype = SEP_TBYTE,
                       .w = f->width,
                       .h = f->height,
                       .noise_type = SEP_NOISE_NONE};
    sep_bkg *back = NULL;
    assert_int_equal(sep_background(&image, mesh_width, mesh_height, 3, 3, threshold, &back), 0);
    return back;
}

/* The grid and its filter are sep's to the bit, for any number of threads. */
static void check_meshes(const field *f, double threshold)
{
    sep_bkg *expected = measure_by_sep(f, 32, 32, threshold);
    size_t open = 0;
    for (size_t i = 0; i < f->n; i++)
        open += f->mask[i] == 0;
    for (int nthreads = 1; nthreads < 4; nthreads++) {
        rx_background_params par = defaults;
        sep_bkg *mesh = NULL;
        size_t good = 0;
        int measured = 0;
        par.nthreads = nthreads;
        par.filter_threshold = threshold;
        const rx_image image = {
            .width = f->width, .height = f->height, .pixels = f->pixels, .mask = f->mask, .hide = 1};
        assert_int_equal(rx_mesh_measure(&par, &image, RX_MESH_MODE, &mesh, &good, &measured, NULL), RX_OK);
        assert_int_equal(mesh->n, expected->n);
        assert_int_equal(good, open);
        const size_t size = (size_t)mesh->n * sizeof(float);
        assert_memory_equal(mesh->back, expected->back, size);
        assert_memory_equal(mesh->sigma, expected->sigma, size);
        assert_memory_equal(mesh->dback, expected->dback, size);
        assert_memory_equal(mesh->dsigma, expected->dsigma, size);
        assert_near(mesh->global, expected->global, 0.0);
        assert_near(mesh->globalrms, expected->globalrms, 0.0);
        rx_mesh_free(mesh);
    }
    sep_bkg_free(expected);
}

/* Any span of any row says what the plane has there. */
static void check_spans(const rx_map *map, int width, int height, const float *plane)
{
    float *room = RX_NEW(float, (size_t)width);
    assert_non_null(room);
    for (uint64_t i = 0; i < 4000; i++) {
        const int y = i < (uint64_t)height ? (int)i : (int)(rx_random_uniform(9, 1, i) * height);
        const int x = i < (uint64_t)height ? 0 : (int)(rx_random_uniform(9, 2, i) * width);
        const int n = i < (uint64_t)height ? width : 1 + (int)(rx_random_uniform(9, 3, i) * (width - x));
        assert_memory_equal(rx_map_row(map, y, x, n, room), plane + (size_t)y * (size_t)width + (size_t)x,
                            (size_t)n * sizeof *plane);
    }
    free(room);
}

/* Level and noise are sep's planes to the bit; where nothing is seen there is no noise. */
static void check_maps(int width, int height, int mesh_width, int mesh_height)
{
    field f = make_patchy(width, height);
    sep_bkg *mesh = measure_by_sep(&f, mesh_width, mesh_height, 0.0);
    float *level = RX_NEW(float, f.n), *sigma = RX_NEW(float, f.n);
    rx_background_params par = defaults;
    assert_int_equal(sep_bkg_array(mesh, level, SEP_TFLOAT), 0);
    assert_int_equal(sep_bkg_rmsarray(mesh, sigma, SEP_TFLOAT), 0);
    par.mesh_width = mesh_width;
    par.mesh_height = mesh_height;
    for (size_t i = 0; i < f.n; i++)
        sigma[i] = f.mask[i] != 0 ? 0.0f : sigma[i] > 0.0f ? sigma[i] : (float)mesh->globalrms;
    for (par.nthreads = 1; par.nthreads < 4; par.nthreads++)
        for (int weighted = 0; weighted < 2; weighted++) {
            const rx_weight_type type = weighted ? RX_WEIGHT_BACKGROUND : RX_WEIGHT_NONE;
            rx_background *back = NULL;
            const rx_image image = {.width = width,
                                    .height = height,
                                    .pixels = f.pixels,
                                    .mask = f.mask,
                                    .hide = 1,
                                    .weight_type = type};
            assert_int_equal(rx_background_measure(&par, &image, &back, NULL), RX_OK);
            const rx_map levels = rx_background_level(back), noise = rx_background_noise(back);
            assert_near(back->global_level, mesh->global, 0.0);
            assert_near(back->global_sigma, mesh->globalrms, 0.0);
            assert_true(levels.plane == NULL);
            assert_true((noise.plane != NULL) == weighted);
            check_spans(&levels, width, height, level);
            check_spans(&noise, width, height, sigma);
            rx_background_free(back);
        }
    sep_bkg_free(mesh);
    free(level);
    free(sigma);
    field_free(&f);
}

static void maps_are_seps(void **state)
{
    static const int sides[][2] = {{32, 32},  {17, 64},  {64, 5}, {200, 200},
                                   {300, 20}, {100, 75}, {2, 3},  {1, 40}};
    (void)state;
    for (size_t i = 0; i < sizeof sides / sizeof *sides; i++)
        check_maps(W, H, sides[i][0], sides[i][1]);
    check_maps(161, 129, 32, 32);
}

static void meshes_are_seps(void **state)
{
    (void)state;
    static const int sides[][2] = {{W, H}, {161, 129}}; /* meshes of one column, of one row, of one pixel */
    for (int k = 0; k < 2; k++) {
        field f = make_patchy(sides[k][0], sides[k][1]);
        check_meshes(&f, 0.0);
        for (size_t i = 0; i < f.n; i++)
            f.pixels[i] = f.mask[i] != 0 ? 0.0f : f.pixels[i] + 100.0f;
        check_meshes(&f, 0.3); /* few medians are as far away as that */
        field_free(&f);
    }
}

/* Values that a histogram does not like: two in all, whole numbers, no noise but in a corner, a third of the
 * pixels of every mesh. */
static void meshes_of_odd_values_are_seps(void **state)
{
    (void)state;
    enum { TWO, WHOLE, CORNER, FLAT, SPARSE, KINDS };
    for (int kind = 0; kind < KINDS; kind++)
        for (int corner = 2; corner < 4; corner++) { /* meshes with noise along each side */
            field f = field_new(W, H, 3.0, 31);
            for (size_t i = 0; i < f.n; i++) {
                const size_t x = i % W, y = i / W;
                if (kind == TWO) /* the others are too many to be clipped, and too few for the median */
                    f.pixels[i] = i % 7 == 0 ? 27.0f : 7.0f;
                if (kind == WHOLE)
                    f.pixels[i] = roundf(f.pixels[i]);
                if (kind == FLAT || (kind == CORNER && (x >= 32 * (size_t)corner || y >= 64)))
                    f.pixels[i] = 7.0f;
                f.mask[i] = kind == SPARSE && i % 3 != 0;
            }
            check_meshes(&f, 0.0);
            field_free(&f);
        }
}

/* What is no number is hidden without a mask, and has the usual noise. */
static void not_a_number_is_hidden(void **state)
{
    (void)state;
    field f = make_patchy(W, H);
    for (size_t i = 0; i < f.n; i++)
        f.mask[i] |= i % 32 == 31 && i % 5 == 0; /* the last pixels of rows of meshes, too */
    rx_background *masked = measure(&f, NULL, RX_WEIGHT_BACKGROUND, 0);
    for (size_t i = 0; i < f.n; i++)
        f.pixels[i] = f.mask[i] != 0 ? NAN : f.pixels[i];
    uint8_t *mask = f.mask;
    f.mask = NULL;
    rx_background *bare = measure(&f, NULL, RX_WEIGHT_BACKGROUND, 0);
    f.mask = mask;
    assert_near(bare->global_sigma, masked->global_sigma, 0.0);
    for (size_t i = 0; i < f.n; i++) {
        assert_near(level_at(bare, i), level_at(masked, i), 0.0);
        if (mask[i] == 0)
            assert_near(sigma_at(bare, i), sigma_at(masked, i), 0.0);
    }
    rx_background_free(masked);
    rx_background_free(bare);
    field_free(&f);
}

static int ascending(const void *left, const void *right)
{
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

/* A map whose variance is one and the same within a mesh and rises from mesh to mesh: its meshes are known. */
typedef struct weights {
    field f;
    float *variance, *weight, *root;
    double factor; /* median of noise over root of the variance */
    double sigma;  /* of the image, without a map */
} weights;

static weights make_weights(void)
{
    weights w = {.f = field_new(W, H, 1.0, 41)};
    w.variance = RX_NEW(float, w.f.n);
    w.weight = RX_NEW(float, w.f.n);
    w.root = RX_NEW(float, w.f.n);
    assert_non_null(w.variance);
    assert_non_null(w.weight);
    assert_non_null(w.root);
    for (size_t i = 0; i < w.f.n; i++) {
        w.variance[i] = 4.0f + (float)(i % W / 32) + 8.0f * (float)(i / W / 32);
        w.weight[i] = 1.0f / w.variance[i];
        w.root[i] = 2.0f + (float)(i % 97);
        w.f.mask[i] = i % 13 == 0;
    }
    sep_bkg *mesh = measure_by_sep(&w.f, 32, 32, 0.0);
    double ratio[5 * 7];
    assert_int_equal(mesh->n, 5 * 7);
    for (int m = 0; m < mesh->n; m++)
        ratio[m] = (double)mesh->sigma[m] / sqrt(4.0 + m % 7 + 8.0 * (m / 7));
    qsort(ratio, 5 * 7, sizeof *ratio, ascending);
    w.factor = ratio[5 * 7 / 2];
    w.sigma = mesh->globalrms;
    sep_bkg_free(mesh);
    return w;
}

/* The noise that a map gives to every pixel; that of the whole where it gives none. */
static void maps_give_each_pixel_its_noise(void **state)
{
    (void)state;
    weights w = make_weights();
    const struct {
        const float *map;
        rx_weight_type type;
        int no_rescale;
    } ways[] = {{w.variance, RX_WEIGHT_MAP_VAR, 0},
                {w.weight, RX_WEIGHT_MAP_WEIGHT, 0},
                {w.variance, RX_WEIGHT_MAP_VAR, 1},
                {w.weight, RX_WEIGHT_MAP_WEIGHT, 1},
                {w.root, RX_WEIGHT_MAP_RMS, 0}};
    const size_t unknown = 33, none = 5 * W + 77, nothing = 9 * W + 10; /* no pixel, no noise, no number */
    w.f.pixels[unknown] = NAN;
    w.variance[none] = w.weight[none] = w.root[none] = 0.0f;
    w.variance[nothing] = w.weight[nothing] = w.root[nothing] = NAN;
    for (size_t k = 0; k < sizeof ways / sizeof *ways; k++) {
        rx_background *back = measure(&w.f, ways[k].map, ways[k].type, ways[k].no_rescale);
        const double factor = ways[k].no_rescale ? 1.0 : w.factor;
        const double usual = ways[k].no_rescale ? w.sigma / w.factor : w.sigma;
        assert_near(back->global_sigma, usual, 1e-5);
        for (size_t i = 0; i < w.f.n; i++) {
            const bool own = ways[k].type == RX_WEIGHT_MAP_RMS;
            const bool given = i != none && i != nothing && (i != unknown || own);
            const double from_map = own ? (double)w.root[i] : factor * sqrt((double)w.variance[i]);
            assert_near(sigma_at(back, i), w.f.mask[i] != 0 ? 0.0 : given ? from_map : usual, 1e-5);
        }
        rx_background_free(back);
    }
    /* a map that says nothing leaves everything as it is */
    memset(w.variance, 0, w.f.n * sizeof *w.variance);
    rx_background *back = measure(&w.f, w.variance, RX_WEIGHT_MAP_VAR, 1);
    assert_near(back->global_sigma, w.sigma, 1e-5);
    rx_background_free(back);
    free(w.variance);
    free(w.weight);
    free(w.root);
    field_free(&w.f);
}

static rx_background *measure_passes(const field *f, int passes, int nthreads)
{
    const rx_background_params par = {.mesh_width = 64,
                                      .mesh_height = 64,
                                      .filter_width = 3,
                                      .filter_height = 3,
                                      .passes = passes,
                                      .nthreads = nthreads};
    const rx_image image = {
        .width = f->width, .height = f->height, .pixels = f->pixels, .mask = f->mask, .hide = 1};
    rx_background *back = NULL;
    assert_int_equal(rx_background_measure(&par, &image, &back, NULL), RX_OK);
    return back;
}

static double mean_level(const rx_background *back)
{
    double sum = 0;
    for (size_t i = 0; i < (size_t)back->width * (size_t)back->height; i++)
        sum += (double)level_at(back, i) / ((double)back->width * back->height);
    return sum;
}

enum { SKY = 512 };

/* Noise of 1 around 0, and sources of S/N 2 to 200 on a tenth of it. */
static field crowded(uint64_t seed, int sources)
{
    field f = field_new(SKY, SKY, 1.0, seed);
    for (uint64_t i = 0; i < (uint64_t)sources; i++)
        field_add(&f, SKY * rx_random_uniform(seed, 2, i), SKY * rx_random_uniform(seed, 3, i), 1.7, 1.7,
                  12 * pow(100, rx_random_uniform(seed, 4, i)));
    return f;
}

/* Of the light of sources in the sky the second pass leaves a third at most, of empty sky it makes no other: its
 * 64 meshes of 4096 pixels know the mean to 0.002. */
static void sources_leave_the_sky(void **state)
{
    (void)state;
    for (uint64_t seed = 20; seed < 23; seed++) {
        field f = crowded(seed, 800), empty = crowded(seed, 0);
        rx_background *first = measure_passes(&f, 1, 1), *second = measure_passes(&f, 2, 2),
                      *third = measure_passes(&f, 2, 3), *plain = measure_passes(&empty, 2, 1);
        const double before = mean_level(first), after = mean_level(second);
        print_message("sky %.4f, second pass %.4f, noise %.3f and %.3f; empty %.4f\n", before, after,
                      first->global_sigma, second->global_sigma, mean_level(plain));
        assert_true(before > 0.05);
        assert_near(after, 0, before / 3);
        assert_near(second->global_sigma, 0.98, 0.015);
        assert_near(mean_level(plain), 0, 0.006);
        assert_near(plain->global_sigma, 0.98, 0.005);
        for (size_t i = 0; i < f.n; i++) {
            assert_true(level_at(second, i) == level_at(third, i));
            assert_true(sigma_at(second, i) == sigma_at(third, i));
        }
        rx_background_free(first);
        rx_background_free(second);
        rx_background_free(third);
        rx_background_free(plain);
        field_free(&f);
        field_free(&empty);
    }
}

/* Pixels that come in steps of 0.2 sigma, as a detector's counts: a median is one step or the next, a mean is not. */
static void steps_are_no_sky(void **state)
{
    (void)state;
    field f = field_new(SKY, SKY, 1.0, 31);
    for (size_t i = 0; i < f.n; i++)
        f.pixels[i] = 0.2f * roundf((f.pixels[i] + 0.07f) / 0.2f) - 0.07f;
    rx_background *first = measure_passes(&f, 1, 1), *second = measure_passes(&f, 2, 1);
    assert_true(fabs(mean_level(first)) > 0.1);
    assert_near(mean_level(second), 0, 0.006);
    rx_background_free(first);
    rx_background_free(second);
    field_free(&f);
}

/* Values under the mask change nothing, and where sources leave no mesh enough pixels the first pass stays. */
static void second_pass_of_masks(void **state)
{
    (void)state;
    field f = crowded(41, 200);
    for (size_t i = 0; i < f.n; i++)
        f.mask[i] = i % 7 == 0 || (i % SKY < 100 && i / SKY < 100);
    field_scramble(&f, 5);
    rx_background *a = measure_passes(&f, 2, 1);
    field_scramble(&f, 6);
    rx_background *b = measure_passes(&f, 2, 2);
    for (size_t i = 0; i < f.n; i++) {
        assert_true(level_at(a, i) == level_at(b, i));
        assert_true(sigma_at(a, i) == sigma_at(b, i));
    }
    assert_near(mean_level(a), 0, 0.02);
    rx_background_free(a);
    rx_background_free(b);
    field_free(&f);
    f = crowded(42, 0);
    for (size_t i = 0; i < f.n; i++) { /* half hidden, and no mesh has half left of what the sources leave */
        f.mask[i] = i % 2 == 0;
        f.pixels[i] += i % SKY % 64 / 2 == 16 && i / SKY % 64 / 2 == 16 ? 100.0f : 0.0f;
    }
    a = measure_passes(&f, 1, 1);
    b = measure_passes(&f, 2, 1);
    for (size_t i = 0; i < f.n; i++) {
        assert_true(level_at(a, i) == level_at(b, i));
        assert_true(sigma_at(a, i) == sigma_at(b, i));
    }
    rx_background_free(a);
    rx_background_free(b);
    field_free(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(finds_level_and_noise),
                                       cmocka_unit_test(sources_leave_the_sky),
                                       cmocka_unit_test(steps_are_no_sky),
                                       cmocka_unit_test(second_pass_of_masks),
                                       cmocka_unit_test(is_blind_to_masked_values),
                                       cmocka_unit_test(copes_with_odd_tiles),
                                       cmocka_unit_test(scales_weights_to_the_noise),
                                       cmocka_unit_test(takes_a_manual_level_and_refuses_nonsense),
                                       cmocka_unit_test(meshes_are_seps),
                                       cmocka_unit_test(meshes_of_odd_values_are_seps),
                                       cmocka_unit_test(not_a_number_is_hidden),
                                       cmocka_unit_test(maps_give_each_pixel_its_noise),
                                       cmocka_unit_test(maps_are_seps)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
