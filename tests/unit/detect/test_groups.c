/* Groups of pixels above the threshold, what may fall apart, and the images they are packed into, against plain
 * searches. */
#include <float.h>

#include "../near.h"
#include "data/map.h"
#include "detect/batches.h"
#include "detect/cutouts.h"
#include "detect/deblendable.h"
#include "detect/filter.h"
#include "detect/groups.h"
#include "detect/sep_extract.h"
#include "detect/threshold_noise.h"
#include "field.h"

enum { W = 150, H = 140, N = W * H };

/* A field of its own noise, filtered, with hidden pixels. */
typedef struct scene {
    field f;
    rx_filter kernel;
    rx_map noise;
    rx_threshold_noise varying;
    rx_threshold image;
    float *filtered, *lines; /* of the noise after the filter */
} scene;

/* relative: 0 one threshold, 1 that of each pixel, 2 one threshold, and noise for others. On the heap, for it points to itself. */
static scene *make_scene(int relative, const float *kernel, int width, int height)
{
    scene *s = RX_NEW(scene, 1);
    double sums[W];
    assert_non_null(s);
    s->f = field_new(W, H, 1.0, 5);
    field_crowd(&s->f, 40, 900.0, 6);
    s->filtered = RX_NEW(float, N);
    s->lines = RX_NEW(float, N);
    assert_non_null(s->filtered);
    assert_non_null(s->lines);
    for (int k = 0; k < N; k++) {
        s->f.sigma[k] = (float)(0.7 + 0.6 * rx_random_uniform(7, 1, (uint64_t)k));
        s->f.mask[k] = k % 53 == 0;
        if (k % 59 == 0)
            s->f.pixels[k] = NAN;
    }
    uint8_t *hidden = RX_NEW(uint8_t, N);
    float *open = RX_NEW(float, N);
    assert_non_null(hidden);
    assert_non_null(open);
    for (int k = 0; k < N; k++) {
        hidden[k] = s->f.mask[k] != 0 || isnan(s->f.pixels[k]);
        open[k] = hidden[k] ? 0.0f : s->f.pixels[k];
    }
    assert_int_equal(rx_filter_new(kernel, width, height, &s->kernel, NULL), RX_OK);
    rx_filter_plane(&s->kernel, open, W, H, 1, s->filtered);
    const rx_noise_rows rows = {.width = W, .height = H, .sigma = s->f.sigma, .hidden = hidden};
    for (int y = 0; y < H; y++)
        rx_filter_sigma(&s->kernel, &rows, y, sums, s->lines + (size_t)y * W);
    free(hidden);
    free(open);
    for (int k = 0; k < 36; k++) /* a group one pixel off the corner */
        s->filtered[k / 6 * W + k % 6] = k / 6 > 0 && k % 6 > 0 && k / 6 < 4 && k % 6 < 4 ? 50.0f : 0.0f;
    s->noise = rx_map_plane(s->f.sigma, W);
    s->varying = (rx_threshold_noise){.width = W,
                                      .height = H,
                                      .noise = &s->noise,
                                      .pixels = s->f.pixels,
                                      .mask = s->f.mask,
                                      .mask_bits = 1,
                                      .kernel = &s->kernel};
    s->image = (rx_threshold){.width = W,
                              .height = H,
                              .filtered = s->filtered,
                              .limit = 1.1f,
                              .noise = relative != 0 ? &s->varying : NULL,
                              .relative = relative == 1};
    return s;
}

static void free_scene(scene *s)
{
    field_free(&s->f);
    rx_filter_free(&s->kernel);
    free(s->filtered);
    free(s->lines);
    free(s);
}

static float threshold_at(const scene *s, int k)
{
    return s->image.relative ? s->image.limit * s->lines[k] : s->image.limit;
}

/* Number of the group of each pixel, from 1, by spreading to the eight neighbours; 0 below the threshold. */
static int spread(const scene *s, int *label)
{
    static int todo[N];
    int found = 0;
    memset(label, 0, N * sizeof *label);
    for (int start = 0; start < N; start++) {
        int n = 0;
        if (label[start] != 0 || !(s->filtered[start] > threshold_at(s, start)))
            continue;
        label[start] = ++found;
        todo[n++] = start;
        while (n > 0) {
            const int at = todo[--n];
            for (int j = 0; j < 9; j++) {
                const int u = at % W + j % 3 - 1, v = at / W + j / 3 - 1, next = v * W + u;
                if (u < 0 || v < 0 || u >= W || v >= H || label[next] != 0 ||
                    !(s->filtered[next] > threshold_at(s, next)))
                    continue;
                label[next] = found;
                todo[n++] = next;
            }
        }
    }
    return found;
}

/* The group of the list is that of the labels. */
static void check_group(const scene *s, const int *label, int wanted, const rx_group *g)
{
    rx_group own = {.xmin = W, .ymin = H, .xmax = -1, .ymax = -1, .lowest = 1e30f};
    for (int k = 0; k < N; k++) {
        if (label[k] != wanted)
            continue;
        const int x = k % W, y = k / W;
        own.size++;
        own.xmin = x < own.xmin ? x : own.xmin;
        own.xmax = x > own.xmax ? x : own.xmax;
        own.ymin = y < own.ymin ? y : own.ymin;
        own.ymax = y;
        own.end = x + 1;
        own.lowest = fminf(own.lowest, threshold_at(s, k));
    }
    assert_int_equal(g->size, own.size);
    assert_int_equal(g->xmin, own.xmin);
    assert_int_equal(g->xmax, own.xmax);
    assert_int_equal(g->ymin, own.ymin);
    assert_int_equal(g->ymax, own.ymax);
    assert_int_equal(g->end, own.end);
    assert_near(g->lowest, own.lowest, 0.0);
}

/* Every pixel is found in its group with its values, and in no other. */
static void check_pixels(const scene *s, const int *label, const rx_groups *groups, const int *label_of)
{
    const rx_levels levels = {.width = W, .groups = groups, .varies = s->image.noise != NULL};
    const rx_levels planes = {.width = W, .filtered = s->filtered, .sigma = s->lines};
    for (int g = 0; g < groups->n; g++) {
        const rx_span *last = NULL;
        const rx_group *box = &groups->list[g];
        for (int y = box->ymin - 1; y <= box->ymax + 1; y++)
            for (int x = box->xmin - 1; x <= box->xmax + 1; x++) {
                const int k = y * W + x;
                const bool inside = x >= 0 && y >= 0 && x < W && y < H && label[k] == label_of[g];
                const rx_span *span = rx_groups_span(groups, g, last, x, y);
                float filtered = -1.0f, sigma = -1.0f;
                assert_int_equal(span != NULL, inside);
                if (span == NULL)
                    continue;
                assert_int_equal(span->group, g);
                assert_near(rx_span_filtered(span, x), s->filtered[k], 0.0);
                assert_true(rx_levels_at(&levels, g, k, &last, &filtered, &sigma));
                assert_ptr_equal(last, span);
                assert_near(filtered, s->filtered[k], 0.0);
                assert_near(sigma, levels.varies ? s->lines[k] : 0.0f, 0.0);
                if (levels.varies)
                    assert_near(rx_span_noise(span, x), s->f.sigma[k], 0.0);
                assert_true(rx_levels_at(&planes, g, k, NULL, &filtered, &sigma));
                assert_near(filtered, s->filtered[k], 0.0);
                assert_near(sigma, s->lines[k], 0.0);
            }
    }
}

static void groups_are_connected_pixels(void **state)
{
    (void)state;
    static const float tall[15] = {1, 2, 1, 0, 3, 1, 2, 4, 5, 1, 2, 1, 1, 0, 1};
    static int label[N];
    for (int way = 0; way < 4; way++) { /* a kernel of odd and one of even height: strips reach beyond */
        scene *s = way < 2   ? make_scene(way, field_kernel, 3, 3)
                   : way < 3 ? make_scene(1, tall, 3, 5)
                             : make_scene(1, tall, 3, 4);
        rx_groups groups;
        assert_int_equal(rx_groups_find(&s->image, 2, &groups, NULL), RX_OK);
        assert_int_equal(groups.n, spread(s, label));
        assert_true(groups.n > 20);
        int *label_of = RX_NEW(int, (size_t)groups.n);
        long above = 0;
        assert_non_null(label_of);
        for (int g = 0; g < groups.n; g++) {
            const rx_group *own = &groups.list[g];
            label_of[g] = label[own->ymax * W + own->end - 1];
            check_group(s, label, label_of[g], own);
            above += own->size;
            if (g > 0) /* in the order in which a scan ends them */
                assert_true(own[-1].ymax * W + own[-1].end < own->ymax * W + own->end);
        }
        assert_int_equal(groups.above, above);
        check_pixels(s, label, &groups, label_of);
        free(label_of);
        rx_groups_free(&groups);
        free_scene(s);
    }
}

/* A pixel by the least above its threshold is above it, wherever in a row it is; one at the threshold is not. */
static void the_least_above_is_above(void **state)
{
    (void)state;
    for (int relative = 0; relative < 2; relative++) {
        scene *s = make_scene(relative, NULL, 0, 0);
        for (int k = 0; k < N; k++)
            s->filtered[k] = threshold_at(s, k);
        for (int x = 0; x < W; x += 7)
            s->filtered[x * W / 2 + x] = nextafterf(threshold_at(s, x * W / 2 + x), 1e30f);
        rx_groups groups;
        assert_int_equal(rx_groups_find(&s->image, 2, &groups, NULL), RX_OK);
        int found = 0;
        for (int x = 0; x < W; x += 7) /* a hidden one has no threshold to be above */
            found += threshold_at(s, x * W / 2 + x) < 1e30f;
        assert_int_equal(groups.above, relative ? found : (W + 6) / 7);
        rx_groups_free(&groups);
        free_scene(s);
    }
}

/* One group of n pixels as an image of width x height; at most 30 x 30. */
enum { SIDE = 30 };

static rx_groups one_group(const float *pixels)
{
    const rx_threshold image = {.width = SIDE, .height = SIDE, .filtered = pixels, .limit = 1.0f};
    rx_groups groups;
    assert_int_equal(rx_groups_find(&image, 1, &groups, NULL), RX_OK);
    return groups;
}

static double spread_above(const float *pixels, float level, int start, bool *seen, int *size)
{
    int todo[SIDE * SIDE], n = 0;
    double flux = 0.0;
    *size = 0;
    seen[start] = true;
    todo[n++] = start;
    while (n > 0) {
        const int at = todo[--n];
        flux += (double)pixels[at] - (double)level;
        ++*size;
        for (int j = 0; j < 9; j++) {
            const int u = at % SIDE + j % 3 - 1, v = at / SIDE + j / 3 - 1, next = v * SIDE + u;
            if (u < 0 || v < 0 || u >= SIDE || v >= SIDE || seen[next] || !(pixels[next] > level))
                continue;
            seen[next] = true;
            todo[n++] = next;
        }
    }
    return flux;
}

/* The highest contrast at which two parts of min_area pixels stand, over all levels. */
static double highest_contrast(const float *pixels, int min_area)
{
    double total = 0.0, best = 0.0;
    for (int k = 0; k < SIDE * SIDE; k++)
        total += pixels[k] > 1.0f ? (double)pixels[k] : 0.0;
    for (int k = 0; k < SIDE * SIDE; k++) {
        bool seen[SIDE * SIDE] = {false};
        double first = 0.0, second = 0.0;
        if (!(pixels[k] > 1.0f))
            continue;
        for (int start = 0; start < SIDE * SIDE; start++) {
            int size;
            if (seen[start] || !(pixels[start] > pixels[k]))
                continue;
            const double flux = spread_above(pixels, pixels[k], start, seen, &size);
            if (size < min_area)
                continue;
            second = fmax(second, fmin(first, flux));
            first = fmax(first, flux);
        }
        best = fmax(best, second);
    }
    return best / total;
}

static int splits(const rx_groups *groups, int min_area, double contrast)
{
    rx_deblendable work = {0};
    int answer = -1;
    assert_int_equal(rx_deblendable_test(groups, 0, min_area, contrast, &work, &answer, NULL), RX_OK);
    rx_deblendable_free(&work);
    return answer;
}

/* The same of its batch, for detections of at least 50 pixels. */
static int is_blend(const rx_groups *groups, double contrast)
{
    const rx_threshold image = {.width = SIDE, .height = SIDE};
    const rx_detect_params par = {
        .min_area = 50, .deblend_levels = 2, .deblend_contrast = contrast, .nthreads = 1};
    rx_batches batches;
    assert_int_equal(rx_batches_make(&par, &image, groups, &batches, NULL), RX_OK);
    assert_int_equal(batches.n, 1);
    const int blended = batches.list[0].blended;
    rx_batches_free(&batches);
    return blended;
}

/* Groups split up to that contrast of theirs and not beyond, but for the margin of single precision. The pixel
 * at which parts meet may count to one of them, so parts of one pixel less are the limit. */
static void splits_up_to_the_contrast(void **state)
{
    (void)state;
    int tried = 0;
    for (uint64_t seed = 0; seed < 40; seed++) {
        float pixels[SIDE * SIDE] = {0};
        for (int v = 6; v < 24; v++)
            for (int u = 4; u < 26; u++)
                pixels[v * SIDE + u] =
                    (float)(2.0 + 3.0 * rx_random_uniform(seed, 1, (uint64_t)(v * SIDE + u)) +
                            40.0 * exp(-0.05 * (pow(u - 9.3, 2) + pow(v - 15.1, 2))) +
                            (double)seed * exp(-0.05 * (pow(u - 19.2, 2) + pow(v - 14.4, 2))));
        if (seed % 2 == 1)
            pixels[14 * SIDE + 19] += 70.0f; /* the highest of all is in the lesser part */
        rx_groups groups = one_group(pixels);
        assert_int_equal(groups.n, 1);
        const double limit = highest_contrast(pixels, 3), beyond = highest_contrast(pixels, 2);
        if (limit > 0.0) {
            tried++;
            assert_int_equal(splits(&groups, 3, 0.9997 * limit), 1);
            assert_int_equal(splits(&groups, 3, 1.0003 * beyond), 0);
            assert_int_equal(is_blend(&groups, 0.9997 * limit), 1);
            assert_int_equal(is_blend(&groups, 1.0003 * beyond), 0);
        }
        rx_groups_free(&groups);
    }
    assert_true(tried > 20);
}

/* Images of 2^17 pixels take 32 groups of 64 x 64 with their rings. */
static void batches_are_filled(void **state)
{
    (void)state;
    enum { COUNT = 100 };
    const rx_threshold image = {.width = 100000, .height = 100000};
    rx_detect_params par = {.min_area = 62, .deblend_levels = 1, .deblend_contrast = 1.0, .nthreads = 1};
    rx_group list[COUNT];
    rx_batches batches;
    for (int i = 0; i < COUNT; i++)
        list[i] = (rx_group){.size = 62, .xmin = 100, .xmax = 161, .ymin = 100 * i + 1, .ymax = 100 * i + 62};
    const rx_groups groups = {.n = COUNT, .list = list};
    assert_int_equal(rx_batches_make(&par, &image, &groups, &batches, NULL), RX_OK);
    assert_int_equal(batches.n, 4);
    for (int b = 0; b < 4; b++) {
        assert_int_equal(batches.list[b].n, b < 3 ? 32 : 4);
        assert_int_equal(batches.list[b].pixels, 62 * batches.list[b].n);
    }
    rx_batches_free(&batches);
    par.min_area = 63;
    assert_int_equal(rx_batches_make(&par, &image, &groups, &batches, NULL), RX_OK);
    assert_int_equal(batches.n, 0);
    rx_batches_free(&batches);
}

/* What sep says of groups in packed images is said of their pixels in the tile. */
static void detections_follow_from_their_pixels(void **state)
{
    (void)state;
    for (int relative = 0; relative < 2; relative++) {
        scene *s = make_scene(relative, field_kernel, 3, 3);
        rx_groups groups;
        rx_detections found;
        float *open = RX_NEW(float, N);
        assert_non_null(open);
        for (int k = 0; k < N; k++)
            open[k] = s->f.mask[k] != 0 || isnan(s->f.pixels[k]) ? 0.0f : s->f.pixels[k];
        assert_int_equal(rx_groups_find(&s->image, 2, &groups, NULL), RX_OK);
        const rx_levels levels = {.width = W, .groups = &groups, .varies = relative};
        const rx_detect_params par = {.min_area = 1, .deblend_levels = 1, .pixstack = 100000, .nthreads = 2};
        rx_extraction job = {.image = s->image,
                             .pixels = open,
                             .noise_value = 1.0,
                             .kernel = &s->kernel,
                             .groups = &groups,
                             .levels = &levels,
                             .threshold = 1.1};
        assert_int_equal(rx_extract_run(&par, &job, NULL, &found, NULL), RX_OK);
        assert_int_equal(found.n, groups.n);
        for (int i = 0; i < found.n; i++) {
            const rx_detection *d = &found.list[i];
            double x = 0.0, y = 0.0, filtered = 0.0, flux = 0.0, peak = -1e30, lowest = 1e30;
            int raw = 0;
            assert_int_equal(d->group, i);
            assert_int_equal(d->npix, groups.list[i].size);
            for (int j = 0; j < d->npix; j++) {
                const int k = d->pixels[j];
                assert_non_null(rx_groups_span(&groups, i, NULL, k % W, k / W));
                filtered += (double)s->filtered[k];
                x += (double)s->filtered[k] * (k % W);
                y += (double)s->filtered[k] * (k / W);
                flux += (double)open[k];
                peak = fmax(peak, (double)open[k]);
                lowest = fmin(lowest, (double)threshold_at(s, k));
                raw += open[k] > threshold_at(s, k);
            }
            assert_near(d->x, x / filtered, 1e-4);
            assert_near(d->y, y / filtered, 1e-4);
            assert_close(d->filtered_flux, filtered, 1e-5);
            assert_near(d->flux, flux, 1e-4);
            assert_near(d->peak, peak, 0.0);
            assert_near(d->threshold, lowest, 1e-6);
            assert_int_equal(d->npix_raw, raw);
        }
        rx_detections_free(&found);
        rx_groups_free(&groups);
        free(open);
        free_scene(s);
    }
}

/* Batches: all groups of min_area and more, once, in the order of the list; those that may split by
 * themselves; each no larger than a packed image may be, and full before the next begins. */
static void batches_hold_every_group_once(void **state)
{
    (void)state;
    enum { MIN_AREA = 4, BLEND_PIXELS = 1 << 15, PLAIN_PIXELS = 1 << 17 };
    const rx_detect_params par = {
        .min_area = MIN_AREA, .deblend_levels = 2, .deblend_contrast = 0.005, .nthreads = 2};
    scene *s = make_scene(0, field_kernel, 3, 3);
    for (int high = 0; high < 2; high++) { /* also so many pixels that groups fill several images */
        rx_groups groups;
        rx_batches batches;
        s->image.limit = high ? 1.0f : 0.2f;
        assert_int_equal(rx_groups_find(&s->image, 2, &groups, NULL), RX_OK);
        assert_int_equal(rx_batches_make(&par, &s->image, &groups, &batches, NULL), RX_OK);
        int used = 0, expected = 0;
        for (int g = 0; g < groups.n; g++)
            expected += groups.list[g].size >= MIN_AREA;
        for (int b = 0; b < batches.n; b++) {
            const rx_batch *batch = &batches.list[b];
            const bool goes_on = b > 0 && batches.list[b - 1].blended == batch->blended;
            long area = 0, pixels = 0;
            assert_int_equal(batch->first, used);
            for (int i = 0; i < batch->n; i++) {
                const int member = batches.members[used++];
                const rx_group *g = &groups.list[member];
                rx_deblendable work = {0};
                int apart = 0;
                assert_int_equal(rx_deblendable_test(&groups, member, 3, 0.005, &work, &apart, NULL), RX_OK);
                rx_deblendable_free(&work);
                assert_int_equal(batch->blended, apart);
                assert_true(g->size >= MIN_AREA);
                if (i > 0 || goes_on)
                    assert_true(batches.members[used - 2] < member);
                if (apart && (g->xmin == 0 || g->ymin == 0 || g->xmax == W - 1 || g->ymax == H - 1))
                    assert_int_equal(batch->n, 1);
                area += rx_cutout_area(g);
                assert_int_equal(rx_cutout_area(g), (g->xmax - g->xmin + 3) * (g->ymax - g->ymin + 3));
                pixels += g->size;
            }
            assert_int_equal(batch->pixels, pixels);
            if (batch->n > 1)
                assert_true(area <= (batch->blended ? BLEND_PIXELS : PLAIN_PIXELS));
        }
        assert_int_equal(used, expected);
        rx_batches_free(&batches);
        rx_groups_free(&groups);
    }
    free_scene(s);
}

/* Pixels of a packed image that belong to a group, and where they come from. */
static void check_cutouts(const scene *s, const rx_groups *groups, const rx_unfiltered *unfiltered,
                          const float *open, const rx_cutouts *cut)
{
    const bool noisy = cut->noise != NULL;
    float *pixels = RX_NEW(float, (size_t)cut->width *(size_t)cut->height);
    assert_non_null(pixels);
    for (int i = 0; i < cut->n; i++) {
        const rx_cutout *c = &cut->list[i];
        const rx_group *g = &groups->list[c->group];
        for (int y = g->ymin - cut->ring; y <= g->ymax + cut->ring; y++)
            for (int x = g->xmin - cut->ring; x <= g->xmax + cut->ring; x++) {
                const int u = c->x + x - g->xmin, v = c->y + y - g->ymin;
                const bool room = u >= 0 && v >= 0 && u < cut->width && v < cut->height;
                if (!room && cut->n == 1) /* at the tile's border */
                    continue;
                assert_true(room);
                const size_t k = (size_t)v * (size_t)cut->width + (size_t)u;
                const bool tile = x >= 0 && y >= 0 && x < W && y < H;
                const rx_span *span = rx_groups_span(groups, c->group, NULL, x, y);
                const float value = unfiltered != NULL && tile ? open[y * W + x]
                                    : span != NULL             ? rx_span_filtered(span, x)
                                                               : 0.0f;
                assert_ptr_equal(rx_cutouts_at(cut, u, v), c); /* nobody else's */
                assert_near(cut->pixels[k], value, 0.0);
                pixels[k] = value;
                if (noisy && span != NULL)
                    assert_near(cut->noise[k], s->image.noise != NULL ? rx_span_sigma(span, x) : 1.5f, 0.0);
                const bool beside =
                    x >= g->xmin - 1 && x <= g->xmax + 1 && y >= g->ymin - 1 && y <= g->ymax + 1;
                if (noisy && span == NULL && unfiltered == NULL && beside && s->image.relative)
                    assert_near(cut->noise[k] * s->image.limit / g->lowest, 1.0, 1e-5);
                if (noisy && span == NULL && unfiltered == NULL && !s->image.relative)
                    assert_near(cut->noise[k], FLT_MAX, 0.0);
            }
    }
    int top = 0;
    for (int i = 0; i < cut->n; i++) {
        const rx_group *g = &groups->list[cut->list[i].group];
        const int end = cut->list[i].y + g->ymax - g->ymin + 1 + cut->ring;
        top = end > top ? end : top;
    }
    assert_true(cut->n == 1 || top == cut->height);
    /* nothing between the groups */
    assert_memory_equal(cut->pixels, pixels, (size_t)cut->width * (size_t)cut->height * sizeof(float));
    free(pixels);
}

/* Around the pixels of a group the threshold is the lowest of the group, or more where the neighbour would be
 * above; farther away nothing is. */
static void check_fence(const rx_groups *groups, const rx_unfiltered *unfiltered, const rx_cutouts *cut)
{
    const size_t area = (size_t)cut->width * (size_t)cut->height;
    float *filtered = RX_NEW(float, area);
    assert_non_null(filtered);
    rx_filter_plane(unfiltered->kernel, cut->pixels, cut->width, cut->height, 1, filtered);
    for (int v = 0; v < cut->height; v++)
        for (int u = 0; u < cut->width; u++) {
            const size_t k = (size_t)v * (size_t)cut->width + (size_t)u;
            const rx_cutout *c = rx_cutouts_at(cut, u, v);
            const rx_group *g = &groups->list[c->group];
            const int x = u - c->x + g->xmin, y = v - c->y + g->ymin;
            int near = 0;
            for (int j = 0; j < 9; j++)
                near += rx_groups_span(groups, c->group, NULL, x + j % 3 - 1, y + j / 3 - 1) != NULL;
            if (rx_groups_span(groups, c->group, NULL, x, y) != NULL)
                continue;
            const double lowest = fmax((double)g->lowest, (double)filtered[k]) / unfiltered->threshold;
            assert_near(cut->noise[k] / (near > 0 ? lowest : (double)FLT_MAX), 1.0, 1e-5);
            assert_true(near == 0 || filtered[k] <= cut->noise[k] * (float)unfiltered->threshold);
        }
    free(filtered);
}

static void cutouts_hold_their_groups(void **state)
{
    (void)state;
    static const float wide[15] = {1, 2, 1, 1, 3, 1, 2, 4, 5, 1, 2, 1, 1, 2, 1};
    for (int relative = 0; relative < 3; relative++)
        for (int plain = relative == 2; plain < 2; plain++) /* with absolute thresholds sep filters nothing */
            for (int count = 1; count < 60; count += 29) {
                scene *s = make_scene(relative, wide, 5, 3);
                rx_groups groups;
                rx_cutouts cut;
                int wanted[60], n = 0;
                float *open = RX_NEW(float, N);
                assert_non_null(open);
                for (int k = 0; k < N; k++)
                    open[k] = s->f.mask[k] != 0 || isnan(s->f.pixels[k]) ? 0.0f : s->f.pixels[k];
                assert_int_equal(rx_groups_find(&s->image, 1, &groups, NULL), RX_OK);
                const rx_unfiltered unfiltered = {open, &s->kernel, 1.1, 1.5f};
                for (int g = 0; g < groups.n; g++) { /* each alone, and so many together */
                    wanted[n++] = g;
                    if (n < count && g < groups.n - 1)
                        continue;
                    assert_int_equal(rx_cutouts_make(&s->image, &groups, plain ? NULL : &unfiltered, wanted,
                                                     n, &cut, NULL),
                                     RX_OK);
                    assert_int_equal(cut.n, n);
                    assert_int_equal(cut.ring, plain ? 1 : 3); /* and half the kernel */
                    assert_int_equal(cut.noise != NULL, relative != 0 || !plain);
                    check_cutouts(s, &groups, plain ? NULL : &unfiltered, open, &cut);
                    if (!plain)
                        check_fence(&groups, &unfiltered, &cut);
                    if (n == 1) { /* stands at the borders at which it stands in the tile */
                        const rx_group *own = &groups.list[g];
                        const bool closed = relative == 1 || !plain;
                        assert_int_equal(cut.list[0].x, own->xmin > 0 ? cut.ring : 0);
                        assert_int_equal(cut.list[0].y, own->ymin > 0 ? cut.ring : 0);
                        assert_int_equal(cut.width - cut.list[0].x - (own->xmax - own->xmin + 1),
                                         own->xmax < W - 1 || closed ? cut.ring : 0);
                        assert_int_equal(cut.height - cut.list[0].y - (own->ymax - own->ymin + 1),
                                         own->ymax < H - 1 || closed ? cut.ring : 0);
                    }
                    rx_cutouts_free(&cut);
                    n = 0;
                }
                rx_groups_free(&groups);
                free(open);
                free_scene(s);
            }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(groups_are_connected_pixels), cmocka_unit_test(the_least_above_is_above),
        cmocka_unit_test(splits_up_to_the_contrast),   cmocka_unit_test(batches_hold_every_group_once),
        cmocka_unit_test(batches_are_filled),          cmocka_unit_test(detections_follow_from_their_pixels),
        cmocka_unit_test(cutouts_hold_their_groups)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
