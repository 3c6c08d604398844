/* Scenes: counts, sizes and shapes against their sources, where objects are, and that they do not know of each
 * other. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../near.h"
#include "data/table.h"
#include "io/fits_read.h"
#include "num/stats.h"
#include "simulate/scene.h"
#include "simulate/sersic.h"

static rx_scene_params plain(void)
{
    return (rx_scene_params){.width = 1024,
                             .height = 512,
                             .zeropoint = 25.0,
                             .pixel_scale = 0.4,
                             .stars = {100.0, 14.0, 22.0, 0.2},
                             .galaxies = {200.0, 16.0, 22.0, 0.4},
                             .galaxy_kind = RX_GALAXY_MIXED,
                             .galaxy_scale = 1.0,
                             .seed = 5,
                             .stream = 3};
}

static rx_scene *make(const rx_scene_params *par, const rx_templates *templates)
{
    rx_scene *scene = NULL;
    rx_error err = RX_ERROR_NONE;
    if (rx_scene_make(par, templates, &scene, &err) != RX_OK)
        fail_msg("%s", err.text);
    return scene;
}

/* Largest distance of the distribution of n sorted values in 0..1 from the uniform one. */
static double distance_to_uniform(double *values, long n)
{
    double worst = 0.0;
    rx_sort(values, (size_t)n);
    for (long i = 0; i < n; i++)
        worst = fmax(worst, fmax(fabs(values[i] - (double)i / n), fabs(values[i] - (i + 1.0) / n)));
    return worst;
}

static void assert_same(const rx_object *a, const rx_object *b, long n)
{
    for (long i = 0; i < n; i++) {
        assert_true(a[i].type == b[i].type);
        assert_true(a[i].x == b[i].x);
        assert_true(a[i].y == b[i].y);
        assert_true(a[i].mag == b[i].mag);
        assert_true(a[i].flux == b[i].flux);
        assert_true(a[i].radius == b[i].radius);
        assert_true(a[i].angle == b[i].angle);
        assert_true(a[i].bulge_share == b[i].bulge_share);
        assert_true(a[i].arm_phase == b[i].arm_phase);
    }
}

/* --- counts --- */

static void test_counts(void **state)
{
    rx_scene_params par = plain();
    par.stars.count = 20000.0;
    par.galaxies.count = 0.0;
    const double slopes[] = {0.2, 0.6, 0.0, -0.3};
    for (int k = 0; k < 4; k++) {
        par.stars.slope = slopes[k];
        rx_scene *scene = make(&par, NULL);
        double *u = calloc(20000, sizeof *u);
        assert_int_equal(scene->n, 20000);
        for (long i = 0; i < scene->n; i++) {
            const rx_object *o = &scene->objects[i];
            double s = slopes[k] * log(10.0), part = o->mag - 14.0;
            u[i] = s == 0.0 ? part / 8.0 : (exp(s * part) - 1.0) / (exp(s * 8.0) - 1.0);
            assert_int_equal(o->type, RX_OBJECT_STAR);
            assert_true(fabs(o->flux / pow(10.0, 0.4 * (25.0 - o->mag)) - 1.0) < 1e-12);
        }
        assert_true(distance_to_uniform(u, 20000) <
                    1.63 / sqrt(20000.0)); /* 1 % level of Kolmogorov's test */
        free(u);
        rx_scene_free(scene);
    }
    /* a fraction is decided by chance */
    long found = 0;
    par.stars.count = 2.3;
    for (par.stream = 0; par.stream < 1000; par.stream++) {
        rx_scene *scene = make(&par, NULL);
        assert_true(scene->n == 2 || scene->n == 3);
        found += scene->n;
        rx_scene_free(scene);
    }
    assert_true(fabs(found / 1000.0 - 2.3) < 4.0 * sqrt(0.3 * 0.7 / 1000.0));
}

/* --- independence --- */

static void test_independent(void **state)
{
    rx_scene_params par = plain();
    par.clustering = 0.4;
    rx_scene *few = make(&par, NULL), *again = make(&par, NULL);
    assert_int_equal(few->n, again->n);
    assert_same(few->objects, again->objects, few->n);
    par.stars.count = 150.0;
    par.galaxies.count = 300.0;
    rx_scene *many = make(&par, NULL);
    assert_int_equal(many->n, 450);
    assert_same(many->objects, few->objects, 100);
    assert_same(many->objects + 150, few->objects + 100, 200);
    rx_scene_free(again);
    for (int k = 0; k < 2; k++) {
        rx_scene_params other = plain();
        other.seed += k == 0;
        other.stream += k == 1;
        again = make(&other, NULL);
        assert_true(again->objects[0].x != few->objects[0].x);
        assert_true(again->objects[0].mag != few->objects[0].mag);
        rx_scene_free(again);
    }
    /* two populations have nothing in common: correlation of positions, 1 sigma 0.1 */
    double sum = 0.0;
    for (int i = 0; i < 100; i++)
        sum += ((few->objects[i].x - 512.0) / 296.0) * ((few->objects[100 + i].x - 512.0) / 296.0) / 100.0;
    assert_true(fabs(sum) < 0.35);
    rx_scene_free(few);
    rx_scene_free(many);
}

/* --- galaxies --- */

static void test_galaxies(void **state)
{
    rx_scene_params par = plain();
    par.stars.count = 0.0;
    par.galaxies = (rx_population){20000.0, 20.0, 20.0, 0.4};
    rx_scene *scene = make(&par, NULL);
    double *size = calloc(20000, sizeof *size), median;
    long whole = 0, arms = 0, bars = 0, flat = 0;
    for (long i = 0; i < scene->n; i++) {
        const rx_object *o = &scene->objects[i];
        size[i] = log(o->radius * 0.4);
        assert_true(o->bulge_share >= 0.0);
        assert_true(o->bulge_share <= 1.0);
        assert_true(o->bulge_share + o->bar_share <= 1.0);
        assert_true(o->ratio > 0.15);
        assert_true(o->ratio < 1.0);
        assert_true(fabs(o->angle) < 1.571);
        whole += o->bulge_share == 1.0 && o->bulge_n >= 2.5;
        flat += o->bulge_share == 1.0 && o->bulge_n < 1.0;
        arms += o->arms > 0;
        bars += o->bar_share > 0.0;
        if (o->bulge_share == 1.0) {
            assert_true(o->bulge_radius == o->radius);
            assert_true(o->bulge_ratio == o->ratio);
            assert_true(o->arms == 0);
            continue;
        }
        /* half of the light within the radius that was asked for */
        rx_sersic inner, outer;
        rx_sersic_set(2.5, &inner);
        rx_sersic_set(1.0, &outer);
        double within = (1.0 - o->bulge_share) * rx_sersic_within(&outer, o->radius / o->disk_radius);
        for (int k = 0; k < 90 && o->bulge_share > 0.0; k++) { /* the bulge in the disk's ellipse */
            double angle = 3.14159265358979 / 180.0 * (k + 0.5), c = cos(angle),
                   d = sin(angle) * o->bulge_ratio / o->ratio;
            within +=
                o->bulge_share / 90.0 * rx_sersic_within(&inner, o->radius / o->bulge_radius / hypot(c, d));
        }
        assert_true(fabs(within - 0.5) < 1e-4);
    }
    double sigma = rx_sigma_mad(size, 20000, &median);
    assert_true(fabs(median) < 0.015);
    assert_true(fabs(sigma - 0.45) < 0.015); /* 1 arcsec at r = 20 */
    /* shares as scene.h has them, from the deciles */
    double n = 20000.0;
    assert_true(fabs(whole / n - 0.205) < 0.02);
    assert_true(fabs(arms / n - 0.6 * (1.0 - 0.205)) < 0.02);
    assert_true(fabs(flat / n - 0.4 * 0.338) < 0.02);
    assert_true(fabs((double)bars / (double)arms - 1.0 / 3.0) < 0.03);
    rx_scene_free(scene);
    par.galaxy_kind = RX_GALAXY_SPIRAL;
    par.galaxies.count = 500.0;
    par.galaxy_scale = 3.0;
    rx_scene *spirals = make(&par, NULL);
    par.galaxy_kind = RX_GALAXY_SMOOTH;
    par.galaxy_scale = 1.0;
    scene = make(&par, NULL);
    for (long i = 0; i < 500; i++) {
        assert_true(spirals->objects[i].arms >= 2);
        assert_true(spirals->objects[i].disk_radius > 0.0);
        assert_true(scene->objects[i].arms == 0);
        assert_true(scene->objects[i].bar_share == 0.0);
        assert_true(fabs(spirals->objects[i].radius / scene->objects[i].radius - 3.0) < 1e-9);
    }
    rx_scene_free(spirals);
    rx_scene_free(scene);
    free(size);
}

/* Bulge and disk together are as concentrated as the Sersic profile that they stand for: indices from
 * r80 / r20 of untruncated profiles by scipy (gammainc, brentq), bulge n = 2.5 of 0.2 disk radii:
 * share 0.05 1.16, 0.1 1.36, 0.15 1.59, 0.2 1.85, 0.3 2.43. */
static void test_bulge_share(void **state)
{
    const double want[][2] = {{0.05, 1.16}, {0.1, 1.36}, {0.15, 1.59}, {0.2, 1.85}, {0.3, 2.43}};
    rx_scene_params par = plain();
    par.galaxy_kind = RX_GALAXY_SPIRAL;
    par.stars.count = 0.0;
    par.galaxies.count = 5000.0;
    rx_scene *scene = make(&par, NULL);
    double share[5000];
    for (long i = 0; i < 5000; i++)
        share[i] = scene->objects[i].bulge_share;
    rx_scene_free(scene);
    rx_sort(share, 5000);
    /* indices by the deciles of the sample: share of galaxies below n */
    const double decile[11] = {0.502, 0.702, 0.848, 0.941, 1.095, 1.286, 1.482, 1.887, 2.535, 3.113, 4.048};
    for (int k = 0; k < 5; k++) {
        int j = 0, below = 0;
        while (decile[j + 1] < want[k][1])
            j++;
        double expected = 0.1 * (j + (want[k][1] - decile[j]) / (decile[j + 1] - decile[j]));
        while (below < 5000 && share[below] < want[k][0])
            below++;
        assert_true(fabs(below / 5000.0 - expected) < 0.03);
    }
}

/* --- against the real sky --- */

static rx_table *real_table(const char *name)
{
    const char *folder = getenv("RX_SHARED_DATA");
    char path[2048];
    rx_table *table = NULL;
    if (folder == NULL)
        return NULL;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return rx_fits_read_table(path, 0, &table, NULL) == RX_OK ? table : NULL;
}

static double value_of(const rx_table *table, const char *column, long row)
{
    int i = rx_table_find(table, column);
    assert_true(i >= 0);
    return rx_column_value(&table->columns[i], row, 0);
}

/* Model radii of the coadd's galaxies lie around the relation, r 17 to 21.5. */
static void test_sizes_of_sdss(void **state)
{
    rx_table *table = real_table("sdss/94-1-12/stripe82_coadd_catalog.fit");
    if (table == NULL) {
        print_message("the coadd catalogue is absent: skipped\n");
        skip();
        return;
    }
    double residual[2000], bright[2000], median;
    size_t n = 0, nbright = 0;
    for (long i = 0; i < table->nrows && n < 2000; i++) {
        int early = value_of(table, "fracdev_r", i) > 0.5;
        double mag = value_of(table, early ? "devmag_r" : "expmag_r", i);
        double radius = value_of(table, early ? "devrad_r" : "exprad_r", i);
        if (value_of(table, "probpsf", i) != 0.0 ||
            !(mag > 17.0 && mag < 21.5 && radius > 0.05 && radius < 20.0))
            continue;
        residual[n] = log(radius / rx_population_radius(mag, 0.0));
        if (mag < 19.5)
            bright[nbright++] = residual[n];
        n++;
    }
    assert_true(n > 200);
    assert_true(nbright > 30);
    double sigma = rx_sigma_mad(residual, n, &median);
    print_message(
        "%zu galaxies of the coadd: median ln(r / relation) %.3f, scatter %.3f; brighter than 19.5 %.3f\n", n,
        median, sigma, rx_median(bright, nbright));
    assert_true(fabs(median) < 0.1);
    assert_true(fabs(sigma - 0.45) < 0.1);
    assert_true(fabs(rx_median(bright, nbright)) < 0.25); /* 44 of them: 1 sigma 0.09 */
    rx_table_free(table);
}

/* The indices and ratios drawn are the sample's: two-sample Kolmogorov distance of smooth galaxies. */
static double two_samples(double *a, long na, double *b, long nb)
{
    double worst = 0.0;
    rx_sort(a, (size_t)na);
    rx_sort(b, (size_t)nb);
    for (long i = 0, j = 0; i < na; i++) {
        while (j < nb && b[j] < a[i])
            j++;
        worst = fmax(worst, fabs((i + 0.5) / na - (double)j / nb));
    }
    return worst;
}

static void test_shapes_of_cosmos(void **state)
{
    const char *folder = getenv("RX_SHARED_DATA");
    char path[2048], line[1024];
    snprintf(path, sizeof path, "%s/templates/cosmos_sersics_sample_N300_cleaned.asc",
             folder != NULL ? folder : "");
    FILE *file = fopen(path, "r");
    if (file == NULL) {
        print_message("the COSMOS sample is absent: skipped\n");
        skip();
        return;
    }
    double index[400], ratio[400], radius[400], drawn[5000];
    long n = 0;
    while (n < 400 && fgets(line, sizeof line, file) != NULL) {
        double ident, shear;
        if (line[0] == '#' || sscanf(line, "%lf %lf %lf %lf", &ident, &index[n], &radius[n], &shear) != 4)
            continue;
        ratio[n++] = (1.0 - shear) / (1.0 + shear);
    }
    fclose(file);
    assert_true(n > 270);
    rx_scene_params par = plain();
    par.stars.count = 0.0;
    par.galaxies.count = 5000.0;
    rx_scene *scene = make(&par, NULL);
    for (long i = 0; i < 5000; i++)
        drawn[i] = scene->objects[i].ratio;
    rx_scene_free(scene);
    double by_ratio = two_samples(ratio, n, drawn, 5000);
    /* in SMOOTH scenes indices below 1 and from 2.5 are those of single profiles */
    par.galaxy_kind = RX_GALAXY_SMOOTH;
    scene = make(&par, NULL);
    for (long i = 0; i < 5000; i++) {
        double b = scene->objects[i].bulge_share; /* the relation of scene.h turned around */
        drawn[i] = b == 1.0 ? scene->objects[i].bulge_n : b == 0.0 ? 1.0 : 1.0 + b / (0.31 - 0.34 * b);
    }
    rx_scene_free(scene);
    double by_index = two_samples(index, n, drawn, 5000);
    print_message("COSMOS sample of %ld: distance of ratios %.3f, of indices %.3f\n", n, by_ratio, by_index);
    assert_true(by_ratio < 0.05);
    assert_true(by_index < 0.05);
}

/* --- templates --- */

static void test_template_sizes(void **state)
{
    rx_template list[2] = {{.name = "a",
                            .width = 9,
                            .height = 9,
                            .pixel_scale = 0.03,
                            .fwhm = 0.12,
                            .radius = 5.0,
                            .ratio = 0.64},
                           {.name = "b",
                            .width = 9,
                            .height = 9,
                            .pixel_scale = 0.05,
                            .fwhm = 0.0,
                            .radius = 8.0,
                            .ratio = 1.0}};
    rx_templates templates = {2, list};
    rx_scene_params par = plain();
    par.stars.count = par.galaxies.count = 0.0;
    par.templates = (rx_population){2000.0, 18.0, 22.0, 0.3};
    rx_scene *scene = make(&par, &templates);
    long counts[2][2] = {{0}};
    assert_ptr_equal(scene->templates, &templates);
    for (long i = 0; i < scene->n; i++) {
        const rx_object *o = &scene->objects[i];
        const rx_template *t = &list[o->template_index];
        counts[o->template_index][o->flip != 0]++;
        /* the size of galaxies of this magnitude, within the scatter's cut */
        double want = rx_population_radius(o->mag, 0.0) / 0.4;
        assert_true(fabs(log(o->radius / want)) < 0.45 * 2.5 + 1e-9);
        assert_true(fabs(o->radius * sqrt(t->ratio) / (o->stretch * t->radius) - 1.0) < 1e-12);
    }
    assert_int_equal(scene->shrunk, 0);
    for (int k = 0; k < 4; k++)
        assert_true(abs((int)counts[k / 2][k % 2] - 500) < 100);
    /* held below a PSF */
    par.template_blur = 2.0;
    rx_scene *sharp = make(&par, &templates);
    long smaller = 0;
    for (long i = 0; i < sharp->n; i++) {
        const rx_object *o = &sharp->objects[i];
        assert_true(o->stretch * rx_template_blur(&list[o->template_index]) <= 2.0 * (1.0 + 1e-12));
        smaller += o->stretch < scene->objects[i].stretch;
        assert_true(o->stretch <= scene->objects[i].stretch);
    }
    assert_true(smaller > 0);
    assert_true(smaller == sharp->shrunk);
    rx_scene_free(scene);
    rx_scene_free(sharp);
}

/* --- errors --- */

static void check_refused(rx_scene_params par, const char *word)
{
    rx_scene *scene = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_scene_make(&par, NULL, &scene, &err), RX_USAGE);
    assert_null(scene);
    if (strstr(err.text, word) == NULL)
        fail_msg("'%s' does not say '%s'", err.text, word);
}

static void test_refused(void **state)
{
    rx_scene_params par;
#define REFUSED(change, word)                                                                                \
    par = plain();                                                                                           \
    change;                                                                                                  \
    check_refused(par, word)
    REFUSED(par.stars.count = 1e12, "stars");
    REFUSED(par.zeropoint = 80.0, "no pixel");
#undef REFUSED
    /* nothing asked for is no error */
    par = plain();
    par.stars.count = par.galaxies.count = 0.0;
    rx_scene *scene = make(&par, NULL);
    assert_int_equal(scene->n, 0);
    rx_scene_free(scene);
    rx_scene_free(NULL);
}

/* --- places --- */

static void test_uniform_places(void **state)
{
    rx_scene_params par = plain();
    par.galaxies.count = 0.0;
    par.stars.count = 10000.0;
    const double margins[] = {0.0, 30.0, -100.0};
    for (int k = 0; k < 3; k++) {
        par.margin = margins[k];
        rx_scene *scene = make(&par, NULL);
        double *u = calloc(10000, sizeof *u), *v = calloc(10000, sizeof *v);
        for (long i = 0; i < 10000; i++) {
            u[i] = (scene->objects[i].x + 0.5 + par.margin) / (1024.0 + 2.0 * par.margin);
            v[i] = (scene->objects[i].y + 0.5 + par.margin) / (512.0 + 2.0 * par.margin);
        }
        assert_true(distance_to_uniform(u, 10000) < 0.0163);
        assert_true(distance_to_uniform(v, 10000) < 0.0163);
        free(u);
        free(v);
        rx_scene_free(scene);
    }
}

/* Pairs of objects within r: those of a Thomas process of one clump per 65536 pixels, sigma 20:
 * K(r) = pi r^2 + 65536 (1 - exp(-r^2 / 1600)). */
static void test_clumps(void **state)
{
    rx_scene_params par = plain();
    par.width = par.height = 1024;
    par.stars.count = 300.0;
    par.galaxies.count = 300.0;
    for (int clumped = 0; clumped < 2; clumped++) {
        double pairs = 0.0;
        par.clustering = clumped;
        for (par.stream = 0; par.stream < 40; par.stream++) {
            rx_scene *scene = make(&par, NULL);
            for (long i = 0; i < scene->n; i++)
                for (long j = 0; j < i; j++)
                    pairs += hypot(scene->objects[i].x - scene->objects[j].x,
                                   scene->objects[i].y - scene->objects[j].y) < 30.0;
            rx_scene_free(scene);
        }
        double area = 1024.0 * 1024.0, k = 3.14159265 * 900.0;
        double expected = 40.0 * 0.5 * 600.0 * 600.0 / area;
        if (clumped)
            k += 65536.0 * (1.0 - exp(-900.0 / 1600.0));
        /* the border takes 2 % of the pairs; the 16 clumps of a scene are more or less apart */
        assert_true(fabs(pairs / (expected * k) - 1.0) < (clumped ? 0.15 : 0.05));
    }
}

static void test_pairs(void **state)
{
    rx_scene_params par = plain();
    par.stars.count = 5000.0;
    par.galaxies.count = 0.0;
    par.pair_share = 0.3;
    par.pair_low = 2.0;
    par.pair_high = 4.0;
    rx_scene *scene = make(&par, NULL);
    rx_scene_params single = par;
    single.pair_share = 0.0;
    rx_scene *alone = make(&single, NULL);
    double separation[5000];
    long pairs = 0, at = 0;
    for (long i = 0; i < 5000; i++) {
        const rx_object *o = &scene->objects[at++];
        assert_same(o, &alone->objects[i], 1);
        if (at == scene->n || (i + 1 < 5000 && scene->objects[at].x == alone->objects[i + 1].x))
            continue;
        const rx_object *other = &scene->objects[at++];
        double distance = hypot(other->x - o->x, other->y - o->y);
        assert_true(distance >= 2.0);
        assert_true(distance <= 4.0);
        assert_true(fabs(other->mag - o->mag) <= 0.5);
        assert_true(fabs(other->flux / o->flux - pow(10.0, 0.4 * (o->mag - other->mag))) < 1e-12);
        separation[pairs++] = (distance - 2.0) / 2.0;
    }
    assert_int_equal(at, scene->n);
    assert_true(fabs(pairs / 5000.0 - 0.3) < 4.0 * sqrt(0.21 / 5000.0));
    assert_true(distance_to_uniform(separation, pairs) < 1.63 / sqrt((double)pairs));
    rx_scene_free(scene);
    rx_scene_free(alone);
}

static void test_least_distance(void **state)
{
    rx_scene_params par = plain();
    par.clustering = 0.5;
    par.least_distance = 12.0;
    /* a companion may be near its star, but near no other */
    par.pair_share = 1.0;
    par.pair_low = 3.0;
    par.pair_high = 5.0;
    par.galaxies.count = 0.0;
    rx_scene *scene = make(&par, NULL);
    assert_true(scene->n > 150);
    for (long i = 0; i < scene->n; i++) {
        int near = 0;
        for (long j = 0; j < scene->n; j++)
            near += j != i && hypot(scene->objects[i].x - scene->objects[j].x,
                                    scene->objects[i].y - scene->objects[j].y) < 12.0;
        assert_true(near <= 1);
    }
    rx_scene_free(scene);
    /* no room: what finds no place is left out and counted */
    par = plain();
    par.width = par.height = 30;
    par.least_distance = 20.0;
    scene = make(&par, NULL);
    assert_true(scene->n >= 2);
    assert_true(scene->n < 8);
    assert_true(scene->left_out == 300 - scene->n);
    rx_scene_free(scene);
}

/* Distances that the field is no multiple of, small and large against it, on both axes. */
static void test_any_least_distance(void **state)
{
    rx_scene_params par = plain();
    par.stars.count = 400.0;
    par.galaxies.count = 0.0;
    const double distances[] = {9.7, 15.1, 26.0, 34.0, 51.0, 99.0};
    for (par.stream = 0; par.stream < 20; par.stream++)
        for (size_t k = 0; k < sizeof distances / sizeof *distances; k++) {
            par.width = 101;
            par.height = 68 + (int)par.stream;
            par.least_distance = distances[k];
            rx_scene *scene = make(&par, NULL);
            assert_true(scene->n >= 1);
            for (long i = 0; i < scene->n; i++)
                for (long j = 0; j < i; j++)
                    assert_true(hypot(scene->objects[i].x - scene->objects[j].x,
                                      scene->objects[i].y - scene->objects[j].y) >= distances[k]);
            rx_scene_free(scene);
        }
}

static void test_allowed(void **state)
{
    rx_scene_params par = plain();
    unsigned char *map = calloc((size_t)par.width * (size_t)par.height, 1);
    for (int y = 100; y < 140; y++)
        for (int x = 700; x < 800; x++)
            map[y * par.width + x] = 1;
    par.allowed = map;
    par.margin = 50.0;
    par.pair_share = 0.5;
    par.pair_low = 1.0;
    par.pair_high = 20.0;
    rx_scene *scene = make(&par, NULL);
    assert_true(scene->n > 250);
    for (long i = 0; i < scene->n; i++) {
        long x = lround(scene->objects[i].x), y = lround(scene->objects[i].y);
        assert_true(x >= 700);
        assert_true(x < 800);
        assert_true(y >= 100);
        assert_true(y < 140);
    }
    rx_scene_free(scene);
    memset(map, 0, (size_t)par.width * (size_t)par.height);
    par.pair_share = 0.0;
    scene = make(&par, NULL);
    assert_true(scene->n == 0);
    assert_true(scene->left_out == 300);
    rx_scene_free(scene);
    free(map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_counts),
        cmocka_unit_test(test_independent),
        cmocka_unit_test(test_galaxies),
        cmocka_unit_test(test_bulge_share),
        cmocka_unit_test(test_sizes_of_sdss),
        cmocka_unit_test(test_shapes_of_cosmos),
        cmocka_unit_test(test_template_sizes),
        cmocka_unit_test(test_refused),
        cmocka_unit_test(test_uniform_places),
        cmocka_unit_test(test_clumps),
        cmocka_unit_test(test_pairs),
        cmocka_unit_test(test_least_distance),
        cmocka_unit_test(test_any_least_distance),
        cmocka_unit_test(test_allowed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
