/* Detection: positions and shapes of known sources, masks, fragments, cleaning, limits. */
#include "../near.h"
#include "detect/deblendable.h"
#include "detect/filter.h"
#include "field.h"

#include <float.h>
#include <sep.h>

enum { W = 160, H = 120 };

static void finds_known_sources(void **state)
{
    (void)state;
    field f = field_new(W, H, 0.0, 1);
    field_add(&f, 40.3, 60.8, 3.0, 2.0, 20000.0);
    field_add(&f, 110.0, 30.0, 2.0, 2.0, 5000.0);
    rx_detect_params par = field_params();
    rx_sources *s = field_detect(&f, &par);
    assert_int_equal(s->n, 2);
    const rx_source *a = field_find(s, 40.3, 60.8);
    assert_non_null(a);
    assert_near(a->x, 40.3, 0.005);
    assert_near(a->y, 60.8, 0.005);
    /* the filter adds a variance of 0.5 pixel^2, the threshold cuts the wings */
    assert_near(a->a, sqrt(9.5), 0.06);
    assert_near(a->b, sqrt(4.5), 0.04);
    assert_near(a->theta, 0.0, 0.01);
    assert_int_equal(a->flags, 0);
    int inside = 0;
    for (size_t i = 0; i < f.n; i++)
        inside += s->segments[i] == a->segment;
    assert_int_equal(inside, a->npix);
    rx_sources_free(s);
    field_free(&f);
}

/* The same image in other units: the same sources, to the last bit, though sep squares in single precision. */
static void units_change_nothing(void **state)
{
    (void)state;
    static const int powers[] = {-110, -70, -40, 40, 50};
    field f = field_new(W, H, 1.0, 2), g = field_new(W, H, 0.0, 2);
    field_crowd(&f, 40, 800.0, 3);
    rx_detect_params par = field_params();
    rx_image image = field_image(&f);
    image.gain = 2.0;
    image.variable_noise = 1;
    rx_sources *a = NULL;
    assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &a, NULL), RX_OK);
    assert_true(a->n > 20);
    for (size_t i = 0; i < sizeof powers / sizeof *powers; i++) {
        for (size_t k = 0; k < f.n; k++) {
            g.pixels[k] = ldexpf(f.pixels[k], powers[i]);
            g.sigma[k] = ldexpf(1.0f, powers[i]);
        }
        rx_image scaled = field_image(&g);
        scaled.gain = ldexp(2.0, -powers[i]);
        scaled.variable_noise = 1;
        scaled.global_noise = ldexp(1.0, powers[i]);
        rx_sources *b = NULL;
        assert_int_equal(rx_detect_run(&par, &scaled, NULL, NULL, &b, NULL), RX_OK);
        assert_int_equal(a->n, b->n);
        assert_memory_equal(a->segments, b->segments, f.n * sizeof *a->segments);
        for (int k = 0; k < a->n; k++) {
            const rx_source *s = &a->list[k], *t = &b->list[k];
            assert_near(t->x, s->x, 1e-12);
            assert_near(t->a, s->a, 1e-12);
            assert_near(t->errx2, s->errx2, 1e-12 * s->errx2);
            assert_near(ldexp(t->peak, -powers[i]), s->peak, 1e-6 * s->peak);
            assert_near(ldexp(t->flux_iso, -powers[i]), s->flux_iso, 1e-6 * fabs(s->flux_iso));
            assert_near(ldexp(t->threshold, -powers[i]), s->threshold, 1e-6 * s->threshold);
        }
        rx_sources_free(b);
    }
    rx_sources_free(a);
    field_free(&f);
    field_free(&g);
}

static void empty_sky_has_no_source(void **state)
{
    (void)state;
    field f = field_new(W, H, 0.0, 1);
    rx_detect_params par = field_params();
    rx_sources *s = field_detect(&f, &par);
    assert_int_equal(s->n, 0);
    assert_non_null(s->segments);
    rx_sources_free(s);
    field_free(&f);
}

static void is_blind_to_masked_values(void **state)
{
    (void)state;
    field f = field_new(W, H, 1.0, 2);
    field_crowd(&f, 60, 800.0, 3);
    for (size_t i = 0; i < f.n; i++)
        f.mask[i] = i % 23 == 0;
    rx_detect_params par = field_params();
    field_scramble(&f, 1);
    rx_sources *a = field_detect(&f, &par);
    field_scramble(&f, 2);
    rx_sources *b = field_detect(&f, &par);
    assert_true(a->n > 20);
    assert_int_equal(a->n, b->n);
    assert_memory_equal(a->list, b->list, (size_t)a->n * sizeof *a->list);
    assert_memory_equal(a->segments, b->segments, f.n * sizeof *a->segments);
    assert_memory_equal(a->fragments, b->fragments, f.n);
    rx_sources_free(b);
    for (size_t i = 0; i < f.n; i++) /* what is no number is hidden without a mask */
        f.pixels[i] = f.mask[i] != 0 ? NAN : f.pixels[i];
    memset(f.mask, 0, f.n);
    b = field_detect(&f, &par);
    assert_int_equal(a->n, b->n);
    assert_memory_equal(a->list, b->list, (size_t)a->n * sizeof *a->list);
    assert_memory_equal(a->segments, b->segments, f.n * sizeof *a->segments);
    rx_sources_free(a);
    rx_sources_free(b);
    field_free(&f);
}

static void small_groups_are_fragments(void **state)
{
    (void)state;
    field f = field_new(W, H, 0.0, 1);
    rx_detect_params par = field_params();
    par.filter = NULL;
    f.pixels[50 * W + 50] = f.pixels[50 * W + 51] = f.pixels[51 * W + 52] = 10.0f;
    rx_sources *s = field_detect(&f, &par);
    assert_int_equal(s->n, 0);
    assert_int_equal(s->fragments[50 * W + 50], RX_FRAGMENT_SMALL);
    assert_int_equal(s->fragments[51 * W + 52], RX_FRAGMENT_SMALL);
    assert_int_equal(s->fragments[52 * W + 52], 0);
    rx_sources_free(s);
    f.pixels[52 * W + 53] = f.pixels[53 * W + 54] = 10.0f; /* as many as are asked for */
    s = field_detect(&f, &par);
    assert_int_equal(s->n, 1);
    for (size_t i = 0; i < f.n; i++) {
        assert_int_equal(s->fragments[i], 0);
        assert_int_equal(s->segments[i], f.pixels[i] > 0.0f);
    }
    rx_sources_free(s);
    field_free(&f);
}

/* Survivors of our cleaning against sep's own; who is eaten counts for the eater. */
static void cleans_as_sep_does(void **state)
{
    (void)state;
    field f = field_new(W, H, 1.0, 6);
    for (int i = 0; i < 4; i++) {
        field_add(&f, 25.0 + 36.0 * i, 60.0, 2.0, 2.0, 100000.0);
        field_add(&f, 25.0 + 36.0 * i, 60.0, 9.0, 9.0, 1000.0);
    }
    rx_detect_params par = field_params();
    par.threshold = 1.0; /* noise peaks in the wings */
    rx_sources *clean = field_detect(&f, &par);
    par.clean = 0;
    rx_sources *all = field_detect(&f, &par);
    sep_image image = {.data = f.pixels,
                       .dtype = SEP_TFLOAT,
                       .w = W,
                       .h = H,
                       .noiseval = 1.0,
                       .noise_type = SEP_NOISE_STDDEV};
    sep_catalog *cat = NULL;
    assert_int_equal(sep_extract(&image, 1.0f, SEP_THRESH_REL, 5, field_kernel, 3, 3, SEP_FILTER_CONV, 32,
                                 0.005, 1, 1.0, &cat),
                     0);
    assert_int_equal(clean->n, cat->nobj);
    assert_true(all->n > clean->n);
    long pixels_clean = 0, pixels_all = 0;
    for (int i = 0; i < clean->n; i++)
        pixels_clean += clean->list[i].npix;
    for (int i = 0; i < all->n; i++)
        pixels_all += all->list[i].npix;
    assert_int_equal(pixels_clean, pixels_all);
    rx_image mapped = field_image(&f);
    rx_sources *relative = NULL;
    mapped.variable_noise = 1; /* the same noise as a map */
    par.clean = 1;
    assert_int_equal(rx_detect_run(&par, &mapped, NULL, NULL, &relative, NULL), RX_OK);
    assert_true(relative->n < all->n);
    rx_sources_free(relative);
    sep_catalog_free(cat);
    rx_sources_free(clean);
    rx_sources_free(all);
    field_free(&f);
}

/* Cleaning decides as sep's does in crowds of all kinds: halos that eat, pairs that do not. */
static void cleans_crowds_as_sep_does(void **state)
{
    (void)state;
    long eaten = 0;
    for (uint64_t seed = 0; seed < 8; seed++) {
        field f = field_new(W, H, 1.0, 30 + seed);
        field_crowd(&f, 20 + 20 * (int)seed, 2000.0, 50 + seed);
        for (int i = 0; i < 4; i++) { /* noise peaks in the halos */
            field_add(&f, 25.0 + 36.0 * i, 60.0, 2.0, 2.0, 100000.0);
            field_add(&f, 25.0 + 36.0 * i, 60.0, 9.0, 9.0, 1000.0);
        }
        rx_detect_params par = field_params();
        par.threshold = 1.0;
        rx_sources *clean = field_detect(&f, &par);
        sep_image image = {.data = f.pixels,
                           .dtype = SEP_TFLOAT,
                           .w = W,
                           .h = H,
                           .noiseval = 1.0,
                           .noise_type = SEP_NOISE_STDDEV};
        sep_catalog *cat = NULL;
        assert_int_equal(sep_extract(&image, (float)par.threshold, SEP_THRESH_REL, par.min_area, field_kernel,
                                     3, 3, SEP_FILTER_CONV, par.deblend_levels, par.deblend_contrast, 1,
                                     par.clean_param, &cat),
                         0);
        assert_int_equal(clean->n, cat->nobj);
        for (int i = 0; i < clean->n; i++) {
            assert_near(clean->list[i].x, cat->x[i], 1e-9);
            assert_near(clean->list[i].y, cat->y[i], 1e-9);
        }
        for (size_t k = 0; k < f.n; k++)
            eaten += clean->fragments[k] == RX_FRAGMENT_EATEN;
        sep_catalog_free(cat);
        rx_sources_free(clean);
        field_free(&f);
    }
    assert_between(eaten, 50, 1e6);
}

static void limits_grow_and_the_tile_survives(void **state)
{
    (void)state;
    field f = field_new(W, H, 1.0, 7);
    field_crowd(&f, 400, 3000.0, 8);
    size_t stack = sep_get_extract_pixstack();
    int limit = sep_get_sub_object_limit();
    rx_detect_params par = field_params();
    rx_sources *plenty = field_detect(&f, &par);
    assert_int_equal(plenty->grown, 0);

    par.pixstack = 100;
    par.subobjects = 2;
    rx_sources *grown = field_detect(&f, &par);
    assert_true(grown->grown > 0);
    assert_int_equal(grown->n, plenty->n);
    for (int i = 0; i < grown->n; i++)
        assert_int_equal(grown->list[i].flags, plenty->list[i].flags);

    par = field_params();
    par.pixstack = par.pixstack_max = 3000;
    rx_sources *shallow = field_detect(&f, &par);
    assert_true(shallow->n > 10);
    assert_true((shallow->list[0].flags & RX_FLAG_EXTRACT_OVER) != 0);
    const double steps = log(shallow->list[0].threshold / par.threshold) / log(1.25);
    assert_near(steps, fmax(round(steps), 1.0), 1e-5); /* it rises by quarters */

    par = field_params();
    par.subobjects = par.subobjects_max = 1;
    rx_sources *coarse = field_detect(&f, &par);
    assert_true(coarse->n > 0);
    assert_true((coarse->list[0].flags & RX_FLAG_DEBLEND_OVER) != 0);

    assert_int_equal(sep_get_extract_pixstack(), stack);
    assert_int_equal(sep_get_sub_object_limit(), limit);
    rx_sources_free(plenty);
    rx_sources_free(grown);
    rx_sources_free(shallow);
    rx_sources_free(coarse);
    field_free(&f);
}

/* More pixels than one batch holds, with one threshold and with a noise map. */
static void threads_change_nothing(void **state)
{
    (void)state;
    enum { SIDE = 700 };
    field f = field_new(SIDE, SIDE, 1.0, 9);
    field_crowd(&f, 3000, 2000.0, 10);
    for (int variable = 0; variable < 2; variable++) {
        rx_detect_params par = field_params();
        rx_image image = field_image(&f);
        rx_sources *one = NULL, *more = NULL;
        image.variable_noise = variable;
        par.nthreads = 1;
        assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &one, NULL), RX_OK);
        assert_true(one->n > 500);
        for (par.nthreads = 2; par.nthreads < 4; par.nthreads++) {
            assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &more, NULL), RX_OK);
            assert_int_equal(one->n, more->n);
            assert_memory_equal(one->list, more->list, (size_t)one->n * sizeof *one->list);
            assert_memory_equal(one->segments, more->segments, f.n * sizeof *one->segments);
            assert_memory_equal(one->fragments, more->fragments, f.n);
            rx_sources_free(more);
        }
        rx_sources_free(one);
    }
    field_free(&f);
}

/* Positions and shapes of sep on the tile as it is, in its order. */
static void finds_what_sep_finds(void **state)
{
    (void)state;
    field f = field_new(W, H, 1.0, 11);
    field_crowd(&f, 150, 3000.0, 12);
    rx_detect_params par = field_params();
    par.clean = 0;
    rx_image given = field_image(&f);
    given.gain = 2.0;
    given.global_noise = 1.25;
    rx_sources *s = NULL;
    assert_int_equal(rx_detect_run(&par, &given, NULL, NULL, &s, NULL), RX_OK);
    sep_image image = {.data = f.pixels,
                       .dtype = SEP_TFLOAT,
                       .w = W,
                       .h = H,
                       .noiseval = 1.25,
                       .noise_type = SEP_NOISE_STDDEV,
                       .gain = 2.0};
    sep_catalog *cat = NULL;
    assert_int_equal(sep_extract(&image, (float)par.threshold, SEP_THRESH_REL, par.min_area, field_kernel, 3,
                                 3, SEP_FILTER_CONV, par.deblend_levels, par.deblend_contrast, 0, 1.0, &cat),
                     0);
    assert_int_equal(s->n, cat->nobj);
    int merged = 0;
    for (int i = 0; i < s->n; i++) {
        const rx_source *o = &s->list[i];
        assert_near(o->x, cat->x[i], 1e-9);
        assert_near(o->y, cat->y[i], 1e-9);
        assert_int_equal((o->flags & RX_FLAG_MERGED) != 0, (cat->flag[i] & SEP_OBJ_MERGED) != 0);
        assert_int_equal((o->flags & RX_FLAG_TRUNCATED) != 0, (cat->flag[i] & SEP_OBJ_TRUNC) != 0);
        merged += (o->flags & RX_FLAG_MERGED) != 0;
        if ((o->flags & RX_FLAG_MERGED) != 0) /* pixels of a blend are dealt out by lot */
            continue;
        assert_int_equal(o->npix, cat->npix[i]);
        assert_int_equal(o->xmin, cat->xmin[i]);
        assert_int_equal(o->xmax, cat->xmax[i]);
        assert_int_equal(o->ymin, cat->ymin[i]);
        assert_int_equal(o->ymax, cat->ymax[i]);
        assert_int_equal(o->xpeak, cat->xcpeak[i]);
        assert_int_equal(o->ypeak, cat->ycpeak[i]);
        assert_near(o->x2, cat->x2[i], 1e-9);
        assert_near(o->y2, cat->y2[i], 1e-9);
        assert_near(o->xy, cat->xy[i], 1e-9);
        assert_near(o->errx2, cat->errx2[i], 1e-9);
        assert_near(o->erry2, cat->erry2[i], 1e-9);
        assert_near(o->errxy, cat->errxy[i], 1e-9);
        assert_near(o->a, cat->a[i], 1e-6);
        assert_near(o->b, cat->b[i], 1e-6);
        assert_near(o->theta, cat->theta[i], 1e-6);
        assert_near(o->cxx, cat->cxx[i], 1e-6);
        assert_near(o->cyy, cat->cyy[i], 1e-6);
        assert_near(o->cxy, cat->cxy[i], 1e-6);
    }
    assert_true(merged > 5);
    assert_true(merged < s->n);
    sep_catalog_free(cat);
    rx_sources_free(s);
    field_free(&f);
}

/* Correlation of the kernel with src at (x, y), and the noise that it leaves, straight from the definitions. */
static void filter_naively(const float *values, int kw, int kh, const rx_noise_rows *rows, const float *src,
                           int x, int y, double *filtered, double *noise)
{
    double sum = 0.0, variance = 0.0, weights = 0.0, total = 0.0;
    for (int k = 0; k < kw * kh; k++) {
        const int u = x + k % kw - kw / 2, v = y + k / kw - kh / 2;
        const double weight = fabs((double)values[k]);
        const bool inside = u >= 0 && v >= 0 && u < rows->width && v < rows->height;
        const int at = v * rows->width + u;
        total += weight;
        if (inside)
            sum += (double)values[k] * src[at];
        if (inside && rows->hidden[at])
            continue;
        weights += weight;
        variance += inside ? weight * rows->sigma[at] * rows->sigma[at] : 0.0;
    }
    *filtered = sum / total;
    *noise = weights > 0.0 ? sqrt(variance / weights) : 0.0;
}

/* Random values, hidden pixels, kernels with both signs and no symmetry; also images that are narrower. */
static void filter_and_its_noise_are_plain_sums(void **state)
{
    (void)state;
    enum { MOST = 41 * 23 };
    static const float values[15] = {1, -2, 3, 4, 0.5f, 2, 5, 9, -1, 3, 1, 2, -0.5f, 1, 6};
    static const float hollow[3] = {1, 0, 2};
    static const struct {
        int width, height, kw, kh;
        const float *values;
    } cases[] = {{41, 23, 5, 3, values}, {41, 23, 3, 5, values}, {3, 9, 5, 3, values}, {1, 1, 5, 3, values},
                 {2, 4, 15, 1, values},  {41, 23, 3, 1, hollow}, {41, 23, 0, 0, NULL}};
    float src[MOST], dst[MOST], sigma[MOST], line[41];
    uint8_t hidden[MOST];
    double sums[41];
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        const int w = cases[c].width, h = cases[c].height, kw = cases[c].kw, kh = cases[c].kh, n = kw * kh;
        double total = 0.0, power = 0.0;
        rx_filter kernel;
        for (uint64_t i = 0; i < MOST; i++) {
            src[i] = (float)rx_random_normal(1, 1, i);
            sigma[i] = (float)(1.0 + rx_random_uniform(1, 2, i));
            hidden[i] = i > MOST / 2 && (i % 11 == 0 || i % 11 == 2);
        }
        for (int k = 0; k < n; k++) {
            total += fabs((double)cases[c].values[k]);
            power += (double)cases[c].values[k] * (double)cases[c].values[k];
        }
        assert_int_equal(rx_filter_new(cases[c].values, kw, kh, &kernel, NULL), RX_OK);
        assert_near(kernel.sum, n > 0 ? total : 1.0, 1e-6);
        assert_near(rx_filter_norm(cases[c].values, n), n > 0 ? sqrt(power) / total : 1.0, 1e-12);
        rx_filter_plane(&kernel, src, w, h, 2, dst);
        const rx_noise_rows rows = {.width = w, .height = h, .sigma = sigma, .hidden = hidden};
        for (int y = 0; y < h; y++) {
            rx_filter_sigma(&kernel, &rows, y, sums, line);
            for (int x = 0; x < w; x++) {
                double filtered = src[y * w + x], noise = sigma[y * w + x];
                if (n > 0)
                    filter_naively(cases[c].values, kw, kh, &rows, src, x, y, &filtered, &noise);
                assert_near(dst[y * w + x], filtered, 1e-6);
                assert_near(line[x], hidden[y * w + x] ? FLT_MAX : noise, 1e-6);
            }
        }
        rx_filter_free(&kernel);
    }
}

static double filtered_at(const field *f, int k)
{
    double filtered = 0.0;
    for (int j = 0; j < 9; j++) {
        const int u = k % W + j % 3 - 1, v = k / W + j / 3 - 1;
        if (u >= 0 && v >= 0 && u < W && v < H && f->mask[v * W + u] == 0)
            filtered += (double)field_kernel[j] / 16.0 * f->pixels[v * W + u];
    }
    return filtered;
}

/* What a source says of its pixels: with one noise, with a map, and with what cleaning gave it. */
static void numbers_follow_from_the_pixels(void **state)
{
    (void)state;
    enum { ONE, MAP, CLEAN, WAYS };
    for (int way = 0; way < WAYS; way++) {
        field f = field_new(W, H, 1.0, 13);
        field_crowd(&f, 60, 3000.0, 14);
        field_add(&f, 80.0, 60.0, 9.0, 9.0, 4000.0);
        for (size_t k = 0; k < f.n; k++) {
            f.sigma[k] = way == MAP ? (float)(0.9 + 0.2 * rx_random_uniform(2, 1, k)) : 1.0f;
            f.mask[k] = k % 37 == 0;
        }
        rx_detect_params par = field_params();
        par.clean = way == CLEAN;
        par.threshold = 1.2;
        par.analysis_threshold = 1.7;
        rx_image image = field_image(&f);
        image.variable_noise = way == MAP;
        rx_sources *s = NULL;
        assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &s, NULL), RX_OK);
        assert_true(s->n > 20);
        assert_near(s->law_scale, 1.0, 0.0); /* until somebody measures the noise of sums */
        assert_near(s->law_power, 0.5, 0.0);
        long eaten = 0;
        for (int i = 0; i < s->n; i++) {
            const rx_source *o = &s->list[i];
            double flux = 0.0, snr = 0.0, peak = -1e30, summit = -1e30, at_peak = 0.0;
            int n = 0, raw = 0, xmin = W, xmax = -1, ymin = H, ymax = -1, highest = -1;
            for (int k = 0; k < W * H; k++) {
                if (s->segments[k] != o->segment)
                    continue;
                const double filtered = filtered_at(&f, k), value = f.mask[k] != 0 ? 0.0 : f.pixels[k];
                n++;
                flux += value;
                /* (1 2 1) x (1 2 1) / 16 leaves 6 / 16 of the noise */
                snr = fmax(snr, filtered / (6.0 / 16.0 * f.sigma[k]));
                xmin = xmin < k % W ? xmin : k % W;
                xmax = xmax > k % W ? xmax : k % W;
                ymin = ymin < k / W ? ymin : k / W;
                ymax = k / W;
                eaten += s->fragments[k] == RX_FRAGMENT_EATEN;
                if (s->fragments[k] == RX_FRAGMENT_EATEN)
                    continue;
                raw += value > 1.2;
                peak = fmax(peak, value);
                highest = filtered > summit ? k : highest;
                summit = fmax(summit, filtered);
                if (o->xpeak == k % W && o->ypeak == k / W)
                    at_peak = f.sigma[k];
            }
            assert_int_equal(o->number, i + 1);
            assert_int_equal(o->npix, n);
            assert_int_equal(o->xmin, xmin);
            assert_int_equal(o->xmax, xmax);
            assert_int_equal(o->ymin, ymin);
            assert_int_equal(o->ymax, ymax);
            assert_near(o->flux_iso, flux, 1e-6 * fabs(flux));
            assert_near(o->peak, peak, 0);
            assert_near(o->detection_snr, snr, 1e-5 * snr);
            assert_near(o->analysis_threshold, 1.7 * at_peak, 1e-6);
            if (way != MAP) {
                assert_int_equal(o->isoarea, raw);
                assert_near(o->threshold, 1.2, 1e-6);
            }
            assert_int_equal(o->xpeak, highest % W);
            assert_int_equal(o->ypeak, highest / W);
        }
        assert_int_equal(eaten > 0, way == CLEAN);
        rx_sources_free(s);
        field_free(&f);
    }
}

/* Sums beyond single precision leave sep without moments: a circle of the same area around the peak. */
static void huge_numbers_become_circles(void **state)
{
    (void)state;
    field f = field_new(W, H, 0.0, 1);
    for (size_t i = 0; i < f.n; i++)
        f.sigma[i] = 1e-19f;
    for (int k = 0; k < 9; k++)
        f.pixels[(60 + k / 3) * W + 80 + k % 3] = 3e38f;
    rx_detect_params par = field_params();
    rx_image image = field_image(&f);
    rx_sources *s = NULL;
    image.variable_noise = 1;
    assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &s, NULL), RX_OK);
    assert_int_equal(s->n, 1);
    const rx_source *o = s->list;
    const double radius2 = o->npix / (4.0 * 3.14159265358979); /* of a disc the variance along each axis */
    assert_true((o->flags_measure & RX_FLAGM_SINGULAR) != 0);
    assert_near(o->x, o->xpeak, 0.0);
    assert_near(o->y, o->ypeak, 0.0);
    assert_near(o->x2, radius2, 1e-9);
    assert_near(o->y2, radius2, 1e-9);
    assert_near(o->xy, 0.0, 0.0);
    assert_near(o->a, sqrt(radius2), 1e-9);
    assert_near(o->b, sqrt(radius2), 1e-9);
    assert_near(o->theta, 0.0, 0.0);
    assert_near(o->cxx, 1.0 / radius2, 1e-9);
    assert_near(o->cyy, 1.0 / radius2, 1e-9);
    assert_near(o->cxy, 0.0, 0.0);
    rx_sources_free(s);
    field_free(&f);
}

/* The lowest DEBLEND_MINCONT at which a pair is one, of ours and of sep alone. */
static double critical_contrast(const field *f, bool by_sep)
{
    double low = 1e-4, high = 0.5;
    while (high - low > 1e-6) {
        const double middle = 0.5 * (low + high);
        int n;
        if (by_sep) {
            sep_image image = {.data = f->pixels,
                               .dtype = SEP_TFLOAT,
                               .w = W,
                               .h = H,
                               .noiseval = 1.0,
                               .noise_type = SEP_NOISE_STDDEV};
            sep_catalog *cat = NULL;
            assert_int_equal(sep_extract(&image, 1.5f, SEP_THRESH_REL, 5, NULL, 0, 0, SEP_FILTER_CONV, 32,
                                         middle, 0, 1.0, &cat),
                             0);
            n = cat->nobj;
            sep_catalog_free(cat);
        } else {
            rx_detect_params par = field_params();
            par.filter = NULL;
            par.clean = 0;
            par.deblend_contrast = middle;
            rx_sources *s = field_detect(f, &par);
            n = s->n;
            rx_sources_free(s);
        }
        *(n > 1 ? &low : &high) = middle;
    }
    return low;
}

static void contrast_is_seps(void **state)
{
    (void)state;
    field f = field_new(W, H, 0.0, 1);
    field_add(&f, 60.0, 60.0, 3.0, 3.0, 9000.0);
    field_add(&f, 70.0, 60.0, 2.0, 2.0, 1500.0);
    const double expected = critical_contrast(&f, true);
    assert_between(expected, 0.01, 0.3);
    assert_near(critical_contrast(&f, false), expected, 1e-5);
    field_free(&f);
}

static void same_segments(const rx_sources *a, const rx_sources *b, size_t n)
{
    assert_true(a->n > 20);
    assert_int_equal(a->n, b->n);
    assert_memory_equal(a->segments, b->segments, n * sizeof *a->segments);
    assert_memory_equal(a->fragments, b->fragments, n);
}

/* One threshold in sigmas, in ADU, and of a kernel that is not normalised. */
static void thresholds_have_units(void **state)
{
    (void)state;
    field f = field_new(W, H, 1.0, 61);
    field_crowd(&f, 60, 2000.0, 62);
    rx_detect_params par = field_params();
    rx_image image = field_image(&f);
    rx_sources *sigmas = NULL, *other = NULL;
    image.global_noise = 1.25;
    par.threshold = 2.0;
    assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &sigmas, NULL), RX_OK);
    par.absolute = 1;
    par.threshold = 2.5;
    assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &other, NULL), RX_OK);
    same_segments(sigmas, other, f.n);
    rx_sources_free(other);
    par = field_params();
    par.filter_normalise = 0;
    par.threshold = 32.0; /* of a kernel of sum 16 */
    assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &other, NULL), RX_OK);
    same_segments(sigmas, other, f.n);
    for (int i = 0; i < other->n; i++)
        assert_near(other->list[i].threshold, 16.0 * sigmas->list[i].threshold, 1e-4);
    rx_sources_free(sigmas);
    rx_sources_free(other);
    field_free(&f);
}

/* DETECT_MAXAREA and MEMORY_PIXSTACK_MAX are the most that is still allowed. */
static void limits_are_the_most_allowed(void **state)
{
    (void)state;
    field f = field_new(W, H, 0.0, 1);
    for (int y = 20; y < 30; y++)
        for (int x = 20; x < 30; x++)
            f.pixels[y * W + x] = 10.0f;
    rx_detect_params par = field_params();
    par.filter = NULL;
    for (par.clean = 0; par.clean < 2; par.clean++)
        for (int less = 0; less < 2; less++) {
            par.max_area = 100 - less;
            rx_sources *s = field_detect(&f, &par);
            assert_int_equal(s->n, 1 - less);
            assert_int_equal(s->segments[25 * W + 25], 1 - less);
            rx_sources_free(s);
            par.max_area = 0;
            par.pixstack = 10;
            par.pixstack_max = 100 - less;
            par.threshold = 9.0; /* 1.25 times as much is above everything */
            s = field_detect(&f, &par);
            assert_int_equal(s->n, 1 - less);
            rx_sources_free(s);
            par.pixstack = par.pixstack_max = 1000;
        }
    field_free(&f);
}

/* Two summits of one group, the lesser of which has a share of the group's flux above the saddle or not. */
static void only_real_summits_split(void **state)
{
    (void)state;
    for (int apart = 0; apart < 2; apart++) {
        field f = field_new(W, H, 0.0, 1);
        field_add(&f, 60.0, 60.0, 3.0, 3.0, 20000.0);
        field_add(&f, 70.0, 60.0, 2.0, 2.0, apart ? 4000.0 : 40.0);
        if (!apart)
            f.pixels[60 * W + 73] *= 1.5f; /* a summit of one pixel */
        const rx_threshold image = {.width = W, .height = H, .filtered = f.pixels, .limit = 1.0f};
        rx_groups groups;
        rx_deblendable work = {0};
        int splits = -1;
        assert_int_equal(rx_groups_find(&image, 2, &groups, NULL), RX_OK);
        assert_int_equal(groups.n, 1);
        assert_int_equal(rx_deblendable_test(&groups, 0, 3, 0.005, &work, &splits, NULL), RX_OK);
        assert_int_equal(splits, apart);
        rx_deblendable_free(&work);
        rx_groups_free(&groups);
        field_free(&f);
    }
}

static void noise_map_sets_the_threshold(void **state)
{
    (void)state;
    field f = field_new(W, H, 0.0, 1);
    field_add(&f, 40.0, 60.0, 2.0, 2.0, 200.0);
    field_add(&f, 120.0, 60.0, 2.0, 2.0, 200.0);
    for (size_t i = 0; i < f.n; i++)
        f.sigma[i] = i % W < W / 2 ? 1.0f : 20.0f;
    rx_detect_params par = field_params();
    rx_image image = field_image(&f);
    image.variable_noise = 1;
    rx_sources *s = NULL;
    assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &s, NULL), RX_OK);
    assert_int_equal(s->n, 1);
    assert_non_null(field_find(s, 40.0, 60.0));
    rx_sources_free(s);
    field_free(&f);
}

/* sep alone reads the threshold of a group where its scan ends, next to it: 0 at the border, huge in a mask.
 */
static void noise_map_deblends_everywhere(void **state)
{
    (void)state;
    enum { PLACES = 3 };
    /* a pair in the open, one at the right border, one at the upper border; a fourth beside masked pixels */
    static const double at[PLACES + 1][2] = {{40, 40}, {W - 6, 40}, {90, H - 5}, {40, 90}};
    field f = field_new(W, H, 0.0, 1);
    for (size_t i = 0; i < f.n; i++)
        f.sigma[i] = 2.0f + 0.001f * (float)(i % W);
    for (int k = 0; k <= PLACES; k++)
        for (int side = 0; side < 2; side++)
            field_add(&f, at[k][0], at[k][1] - 9.0 * side, 2.0, 2.0, 3000.0);
    for (int y = 75; y < 100; y++)
        for (int x = 44; x < 50; x++)
            f.mask[y * W + x] = 1;
    rx_detect_params par = field_params();
    rx_image image = field_image(&f);
    rx_sources *s = NULL;
    image.variable_noise = 1;
    assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &s, NULL), RX_OK);
    assert_int_equal(s->n, 2 * (PLACES + 1));
    for (int i = 0; i < s->n; i++) {
        const rx_source *o = &s->list[i];
        bool border = o->xmax == W - 1 || o->ymax == H - 1;
        float lowest = 1e30f;
        for (size_t k = 0; k < f.n; k++)
            if (s->segments[k] == o->segment)
                lowest = fminf(lowest, f.sigma[k]);
        /* of the filtered noise, to which nothing beyond the border adds */
        assert_true(o->threshold < 1.5 * lowest + 0.01);
        assert_true(o->threshold > (border ? 0.8 : 0.99) * 1.5 * lowest);
        assert_true((o->flags & RX_FLAG_MERGED) != 0);
        if (border)
            assert_true((o->flags & RX_FLAG_TRUNCATED) != 0);
        assert_true(o->x < W);
        assert_true(o->y < H);
    }
    rx_sources_free(s);
    field_free(&f);
}

/* sep counts the bytes of its pixel stack as int: what the tile cannot need is not asked for. */
static void any_pixel_stack_is_legal(void **state)
{
    (void)state;
    field f = field_new(W, H, 1.0, 2);
    field_crowd(&f, 60, 800.0, 3);
    rx_detect_params par = field_params();
    rx_sources *few = field_detect(&f, &par);
    par.pixstack = 100000000;
    par.pixstack_max = 2000000000;
    rx_sources *many = field_detect(&f, &par);
    assert_true(few->n > 20);
    assert_int_equal(few->n, many->n);
    assert_memory_equal(few->segments, many->segments, f.n * sizeof(int32_t));
    assert_int_equal(many->grown, 0);
    rx_sources_free(few);
    rx_sources_free(many);
    field_free(&f);
}

/* Tiles of a few pixels, with and without a noise map, nothing or everything above the threshold. */
static void survives_tiny_tiles(void **state)
{
    (void)state;
    static const int sizes[][2] = {{1, 1}, {2, 3}, {5, 5}, {40, 1}, {1, 40}, {7, 2}};
    for (size_t k = 0; k < sizeof sizes / sizeof sizes[0]; k++)
        for (int value = -1; value <= 100; value += 101)
            for (int variable = 0; variable < 2; variable++) {
                field f = field_new(sizes[k][0], sizes[k][1], 0.0, 1);
                for (size_t i = 0; i < f.n; i++)
                    f.pixels[i] = (float)value;
                rx_detect_params par = field_params();
                rx_image image = field_image(&f);
                rx_sources *s = NULL;
                image.variable_noise = variable;
                assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &s, NULL), RX_OK);
                assert_true(s->n == (value > 0 && f.n >= 5));
                for (int i = 0; i < s->n; i++) {
                    const rx_source *o = &s->list[i];
                    assert_int_equal(o->npix, (int)f.n);
                    assert_near(o->x, 0.5 * (f.width - 1), 0.01);
                    assert_near(o->y, 0.5 * (f.height - 1), 0.01);
                    assert_true(o->a >= o->b);
                    assert_true(o->b > 0.0);
                    assert_true((o->flags & RX_FLAG_TRUNCATED) != 0);
                }
                rx_sources_free(s);
                field_free(&f);
            }
}

/* The filter's orientation and sum, against the definition and against where sep sees the peak. */
static void filter_is_seps(void **state)
{
    (void)state;
    const float corner[9] = {1, 0, 0, 0, 1, 0, 0, 0, 4};
    field f = field_new(W, H, 0.0, 1);
    float *out = RX_NEW(float, f.n);
    f.pixels[60 * W + 80] = 600.0f;
    rx_filter filter;
    assert_int_equal(rx_filter_new(corner, 3, 3, &filter, NULL), RX_OK);
    rx_filter_plane(&filter, f.pixels, W, H, 1, out);
    rx_filter_free(&filter);
    int peak = 0;
    double sum = 0.0;
    for (int i = 0; i < (int)f.n; i++) {
        peak = out[i] > out[peak] ? i : peak;
        sum += out[i];
    }
    assert_near(sum, 600.0, 1e-3);
    assert_near(out[peak], 400.0, 1e-3);
    rx_detect_params par = field_params();
    par.filter = corner;
    par.min_area = 1;
    rx_sources *s = field_detect(&f, &par);
    assert_true(s->n >= 1);
    int at = -1;
    for (int i = 0; i < s->n; i++)
        if (s->list[i].npix > 0 && out[s->list[i].ypeak * W + s->list[i].xpeak] > 300.0f)
            at = s->list[i].ypeak * W + s->list[i].xpeak;
    assert_int_equal(at, peak);
    rx_sources_free(s);
    free(out);
    field_free(&f);
}

/* Places of pixels are ints: more of them are refused before any is looked at. */
static void too_large_is_refused(void **state)
{
    (void)state;
    const rx_detect_params par = {.threshold = 1.5};
    const rx_image image = {.width = 50000, .height = 42950, .global_noise = 1.0};
    rx_sources *sources = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(rx_detect_run(&par, &image, NULL, NULL, &sources, &err), RX_USAGE);
    assert_null(sources);
    assert_non_null(strstr(err.text, "50000 x 42950"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(finds_known_sources),
                                       cmocka_unit_test(empty_sky_has_no_source),
                                       cmocka_unit_test(too_large_is_refused),
                                       cmocka_unit_test(is_blind_to_masked_values),
                                       cmocka_unit_test(small_groups_are_fragments),
                                       cmocka_unit_test(cleans_as_sep_does),
                                       cmocka_unit_test(limits_grow_and_the_tile_survives),
                                       cmocka_unit_test(threads_change_nothing),
                                       cmocka_unit_test(finds_what_sep_finds),
                                       cmocka_unit_test(cleans_crowds_as_sep_does),
                                       cmocka_unit_test(huge_numbers_become_circles),
                                       cmocka_unit_test(thresholds_have_units),
                                       cmocka_unit_test(contrast_is_seps),
                                       cmocka_unit_test(limits_are_the_most_allowed),
                                       cmocka_unit_test(filter_and_its_noise_are_plain_sums),
                                       cmocka_unit_test(numbers_follow_from_the_pixels),
                                       cmocka_unit_test(only_real_summits_split),
                                       cmocka_unit_test(noise_map_sets_the_threshold),
                                       cmocka_unit_test(filter_is_seps),
                                       cmocka_unit_test(noise_map_deblends_everywhere),
                                       cmocka_unit_test(any_pixel_stack_is_legal),
                                       cmocka_unit_test(units_change_nothing),
                                       cmocka_unit_test(survives_tiny_tiles)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
