/* CLEAN on sources made up: who eats whom follows from the wings. */
#include "../near.h"
#include "detect/clean.h"
#include "field.h"

enum { BIG = 40, MOST = 200, PIXELS = 4096, MIN_AREA = 5 };

/* Sources and the planes that their pixels are in. */
typedef struct scene {
    int n, used;
    rx_detection list[MOST];
    int places[PIXELS];
    float pixels[PIXELS], filtered[PIXELS], sigma[PIXELS];
    double threshold, beta; /* threshold: sigmas */
    int relative, max_area;
} scene;

static scene make_scene(int relative)
{
    scene s = {.threshold = 1.5, .beta = 1.3, .relative = relative};
    for (int k = 0; k < PIXELS; k++) {
        s.places[k] = k;
        s.sigma[k] = 2.0f;
    }
    return s;
}

/* A source of n pixels, all `height` above the threshold but for the first: the last one looked at, and as
 * many as MIN_AREA, decide. */
static rx_detection *add(scene *s, double x, double y, double flux, int n, float height)
{
    rx_detection *d = &s->list[s->n++];
    *d = (rx_detection){.npix = n,
                        .npix_raw = n - 3,
                        .x = x,
                        .y = y,
                        .threshold = 3.0f,
                        .peak = 50.0f,
                        .a = 3.0f,
                        .b = 2.0f,
                        .cxx = 0.12f,
                        .cyy = 0.24f,
                        .cxy = 0.03f,
                        .filtered_flux = (float)flux,
                        .pixels = s->places + s->used};
    for (int k = 0; k < n; k++, s->used++) {
        s->filtered[s->used] = 3.0f + height;
        s->pixels[s->used] = k < n / 4 ? 26.51f : 5.0f; /* half of a peak of 50 is 26.5 */
    }
    return d;
}

/* Who eats whom; to be freed. */
static int *clean(const scene *s)
{
    const rx_detections found = {.n = s->n, .list = (rx_detection *)s->list};
    const rx_levels levels = {
        .width = PIXELS, .filtered = s->filtered, .sigma = s->sigma, .varies = s->relative};
    const rx_clean_image image = {
        .pixels = s->pixels, .levels = &levels, .relative = s->relative, .threshold = s->threshold};
    int *eater = NULL;
    const rx_detect_params par = {
        .min_area = MIN_AREA, .max_area = s->max_area, .clean_param = s->beta, .nthreads = 2};
    assert_int_equal(rx_clean(&par, &found, &image, &eater, NULL), RX_OK);
    return eater;
}

static int eater_of(const scene *s, int i)
{
    int *eater = clean(s);
    const int who = eater[i];
    free(eater);
    return who;
}

/* A Moffat profile through the threshold at the isophote, of the source's flux: its height at (dx, dy). */
static double wing(const scene *s, const rx_detection *d, double flux, double area, double dx, double dy)
{
    const double pi = 3.14159265358979, half = 0.5 * (d->threshold + (double)d->peak),
                 ellipse = pi * d->a * d->b;
    double cut = 1.0;
    int above = 0;
    for (int k = 0; k < d->npix; k++)
        above += s->pixels[d->pixels[k]] > half;
    if (!s->relative) {
        const int lost = above < d->npix_raw ? d->npix_raw - above : 1;
        const double ratio = d->threshold < half ? d->threshold / half : 0.99;
        cut = fmin(lost / (-2.0 * log(ratio) * ellipse), 1.0);
    }
    const double amplitude = flux / (2.0 * ellipse * cut);
    const double width = (pow(amplitude / d->threshold, 1.0 / s->beta) - 1.0) * ellipse / area;
    return amplitude * pow(1.0 + width * (d->cxx * dx * dx + d->cyy * dy * dy + d->cxy * dx * dy), -s->beta);
}

/* The least height of source i, whose pixels are all as high, that saves it. */
static double critical_height(scene *s, int i)
{
    double low = 0.0, high = 1e5;
    const rx_detection *d = &s->list[i];
    while (high - low > 1e-7 * high) {
        const double middle = 0.5 * (low + high);
        for (int k = 0; k < d->npix; k++)
            s->filtered[d->pixels[k]] = (float)(3.0 + middle);
        *(eater_of(s, i) >= 0 ? &low : &high) = middle;
    }
    return low;
}

/* The faint one is eaten when the wing of the bright one is above its pixels; near and far, before and after it
 * in the list, with one threshold and with one for each pixel, where the axes are not corrected. */
static void wings_decide(void **state)
{
    (void)state;
    static const float peaks[] = {50.0f, 500.0f, 3.0f}; /* the last: all at the threshold */
    for (int relative = 0; relative < 2; relative++)
        for (int way = 0; way < 8; way++)
            for (int k = 0; k < 3; k++) {
                scene s = make_scene(relative);
                const int first = way & 1; /* the bright one */
                const double dx = (way & 2) != 0 ? 6.0 : 0.8, dy = (way & 2) != 0 ? 4.0 : 0.5;
                if (!first)
                    add(&s, 10.0 + dx, 10.0 + dy, 60.0, 8, 0.0f);
                rx_detection *big = add(&s, 10.0, 10.0, 40000.0, BIG, 20.0f);
                big->peak = peaks[k];
                big->npix_raw = (way & 4) != 0 ? BIG - 3 : 4; /* 4: fewer than are above half of the peak */
                if (k == 2) {
                    big->a = 12.0f;
                    big->b = 8.0f;
                }
                if (first)
                    add(&s, 10.0 + dx, 10.0 + dy, 60.0, 8, 0.0f);
                const double height = critical_height(&s, first);
                assert_near(height / wing(&s, big, 40000.0, BIG, dx, dy), 1.0, 1e-5);
            }
}

/* What has been eaten adds to flux and area of the eater. */
static void eaters_grow(void **state)
{
    (void)state;
    scene s = make_scene(0);
    rx_detection *big = add(&s, 10.0, 10.0, 4000.0, BIG, 20.0f);
    add(&s, 9.0, 16.0, 3900.0, 30, 0.0f);
    add(&s, 10.8, 10.5, 60.0, 8, 0.0f);
    assert_int_equal(eater_of(&s, 1), 0);
    assert_near(critical_height(&s, 2) / wing(&s, big, 7900.0, BIG + 30, 0.8, 0.5), 1.0, 1e-5);
}

/* Of a source's pixels the MIN_AREA-th brightest counts, leaving out the one behind the first MIN_AREA; of as
 * many as MIN_AREA the first; fewer are always eaten, as are those without height. */
static void the_weakest_of_the_brightest_counts(void **state)
{
    (void)state;
    static const int order[8] = {3, 0, 7, 5, 2, 6, 1, 4}; /* rank of each pixel, 0 the lowest */
    for (int n = MIN_AREA - 1; n < 9; n++) {
        scene s = make_scene(0);
        const rx_detection *big = add(&s, 10.0, 10.0, 4000.0, BIG, 20.0f);
        const rx_detection *small = add(&s, 16.0, 14.0, 60.0, n < 8 ? n : 8, 0.0f);
        const double limit = wing(&s, big, 4000.0, BIG, 6.0, 4.0);
        n = small->npix == 8 ? 9 : n;
        for (int save = 0; save < 8; save++) { /* the `save` lowest are below the wing */
            int above = 0;
            for (int k = 0; k < small->npix; k++) {
                const bool high = order[k] >= save;
                s.filtered[small->pixels[k]] = (float)(3.0 + limit + (high ? 1e-3 : -1e-3) + 1e-5 * order[k]);
                above += high && k != MIN_AREA;
            }
            const bool first = order[0] >= save;
            const bool lives = small->npix > MIN_AREA ? above >= MIN_AREA : small->npix == MIN_AREA && first;
            assert_int_equal(eater_of(&s, 1), lives ? -1 : 0);
        }
    }
    scene s = make_scene(0); /* however low the wing */
    s.beta = 4.0;
    add(&s, 10.0, 10.0, 4000.0, BIG, 20.0f);
    add(&s, 40.0, 20.0, 60.0, MIN_AREA - 1, 100.0f);
    assert_int_equal(eater_of(&s, 1), 0);
}

/* Ten sums of the major axes, whichever way, also when whole bands of the list are passed over; at the very
 * same place nobody is in anybody's wing. */
static void reach_is_ten_axes(void **state)
{
    (void)state;
    static const double way[4][2] = {{1, 0}, {0, 1}, {0.6, -0.8}, {0, -1}};
    static const int between[] = {0, 63, 100}; /* sources far away, in y between the two */
    for (int k = 0; k < 4; k++)
        for (int b = 0; b < 3; b++)
            for (int outside = 0; outside < 2; outside++) {
                scene s = make_scene(0);
                const double reach = (outside ? 1.0001 : 0.9999) * 10.0 * (3.0 + 1.0);
                add(&s, 500.0, 500.0, 4000.0, BIG, 20.0f);
                for (int i = 0; i < between[b]; i++)
                    add(&s, 5000.0, 500.0 + 0.01 * i * way[k][1], 100.0, 8, 50.0f)->a = 0.5f;
                add(&s, 500.0 + reach * way[k][0], 500.0 + reach * way[k][1], 60.0, 8, 0.0f)->a = 1.0f;
                assert_int_equal(eater_of(&s, s.n - 1), outside ? -1 : 0);
            }
    scene s = make_scene(0); /* the first band is out of reach, the first of the second is not */
    for (int i = 0; i < 64; i++)
        add(&s, 500.0, 10.0, 100.0, 8, 50.0f);
    add(&s, 500.0, 5000.0, 4000.0, BIG, 20.0f);
    add(&s, 503.0, 5000.0, 60.0, 8, 0.0f);
    assert_int_equal(eater_of(&s, 65), 64);
    s.list[65].x = 500.01;
    assert_int_equal(eater_of(&s, 65), 64);
    s.list[65].x = 500.0;
    assert_int_equal(eater_of(&s, 65), -1);
}

/* Sources of more pixels than allowed neither eat nor are eaten; the last of a chain has eaten all. */
static void the_largest_stay_out_and_chains_end(void **state)
{
    (void)state;
    scene s = make_scene(0);
    add(&s, 16.0, 14.0, 60.0, 8, 0.0f);
    add(&s, 14.0, 12.0, 200.0, 10, 0.0f);
    add(&s, 10.0, 10.0, 4000.0, BIG, 20.0f);
    int *eater = clean(&s);
    assert_int_equal(eater[0], 2);
    assert_int_equal(eater[1], 2);
    assert_int_equal(eater[2], -1);
    free(eater);
    s.max_area = BIG;
    assert_int_equal(eater_of(&s, 1), 2);
    s.max_area = BIG - 1;
    assert_int_equal(eater_of(&s, 1), -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(wings_decide), cmocka_unit_test(eaters_grow),
                                       cmocka_unit_test(the_weakest_of_the_brightest_counts),
                                       cmocka_unit_test(reach_is_ten_axes),
                                       cmocka_unit_test(the_largest_stay_out_and_chains_end)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
