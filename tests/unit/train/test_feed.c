/* Images from generators to the trainer: what arrives follows from ids alone, memory stays bounded, failures
 * and ends hold nobody up. */
#include <setjmp.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include <cmocka.h>

#include "base/memory.h"
#include "base/random.h"
#include "scenes_test.h"
#include "train/feed_protocol.h"

enum { SIDE = 8, FIELD = 16, USES = 2, TOTAL = 20, NFWHM = 3, NSIGMA = 2, BINS = 6, EPOCHS = 8 };

/* What generators share: parameters, and what they did. */
typedef struct bench {
    rx_feed_params par;
    int slow;           /* one image in four takes a millisecond, for one rank in two */
    uint32_t fail_from; /* epoch in which making fails */
    atomic_long made[EPOCHS], all;
    rx_sample_id first; /* that was made */
    atomic_int running, failed;
} bench;

/* An image that is its id: a number for each pixel. */
static void paint(rx_sample_id id, rx_sample *dst)
{
    uint64_t stream = ((uint64_t)id.epoch << 32 | id.set << 16 | id.bin) * 64 + id.index;
    dst->fwhm = (float)id.bin;
    for (int i = 0; i < SIDE * SIDE; i++) {
        dst->x[i] = (float)rx_random_uniform(1, stream, (uint64_t)i);
        dst->w[i] = dst->x[i] + 1;
        dst->y[i] = dst->x[i] + 2;
        dst->blurred[i] = dst->x[i] + 3;
    }
    for (int i = 0; i < RX_SAMPLE_KERNEL * RX_SAMPLE_KERNEL; i++)
        dst->kernel[i] = (float)rx_random_uniform(2, stream, (uint64_t)i);
}

static void rest(long microseconds)
{
    struct timespec time = {.tv_nsec = microseconds * 1000};
    nanosleep(&time, NULL);
}

static rx_status make(void *user, rx_sample_id id, rx_sample *dst, rx_error *err)
{
    bench *own = user;
    if (atomic_fetch_add(&own->all, 1) == 0)
        own->first = id;
    if (own->fail_from && id.epoch >= own->fail_from)
        return rx_error_at(err, RX_INPUT, "galaxies.fits", 1, 0, "the table is empty; give another one");
    if (own->slow && (id.index + id.bin) % 4 == 0)
        rest(1000);
    paint(id, dst);
    atomic_fetch_add(&own->made[id.epoch], 1);
    return RX_OK;
}

static void generate(void *user, rx_ranks *ranks)
{
    bench *own = user;
    rx_error err = RX_ERROR_NONE;
    atomic_fetch_add(&own->running, 1);
    if (rx_feed_generate_with(&own->par, ranks, make, own, &err) != RX_OK)
        atomic_fetch_add(&own->failed, 1);
    atomic_fetch_sub(&own->running, 1);
}

typedef struct run {
    bench *own;
    rx_ranks *ranks;
    rx_feed *feed;
    rx_selection counts;
    rx_pick *order;
    long n, all;
} run;

static void begin_failing(run *r, int generators, int ahead, uint32_t fail_from)
{
    const double fwhm[2] = {2, 8}, sigma[2] = {1, 15};
    *r = (run){.own = RX_NEW(bench, 1)};
    assert_non_null(r->own);
    assert_int_equal(
        rx_selection_begin((const int[]){NFWHM, NSIGMA}, fwhm, sigma, TOTAL, 1, &r->counts, NULL), RX_OK);
    r->own->fail_from = fail_from;
    r->own->par.scenes.side = SIDE;
    r->own->par.scenes.field_side = FIELD;
    r->own->par.scenes.uses = USES;
    r->own->par.grid = r->counts;
    r->own->par.ahead = ahead;
    assert_int_equal(rx_ranks_start(1, generators, generate, r->own, &r->ranks, NULL), RX_OK);
    assert_int_equal(rx_feed_new(&r->own->par, r->ranks, &r->feed, NULL), RX_OK);
}

static void begin(run *r, int generators, int ahead)
{
    begin_failing(r, generators, ahead, 0);
}

static void end(run *r)
{
    rx_feed_free(r->feed);
    rx_ranks_stop(r->ranks);
    assert_int_equal(r->own->running, 0);
    free(r->order);
    free(r->own);
}

/* Counts that move from epoch to epoch as Eq. 4 moves them: train + test = TOTAL, test >= 10. */
static void move_counts(rx_selection *counts, uint32_t epoch)
{
    for (int bin = 0; bin < BINS; bin++) {
        counts->train[bin] = (int)(rx_random_uniform(3, epoch, (uint64_t)bin) * 11);
        counts->test[bin] = TOTAL - counts->train[bin];
    }
}

static void begin_epoch(run *r, uint32_t epoch)
{
    free(r->order);
    r->order = NULL;
    assert_int_equal(rx_selection_order(&r->counts, 5, epoch, &r->order, &r->n, NULL), RX_OK);
    assert_int_equal(rx_feed_epoch(r->feed, epoch, &r->counts, r->order, r->n, NULL), RX_OK);
    r->all = r->n;
    for (int bin = 0; bin < BINS; bin++)
        r->all += r->counts.test[bin];
}

/* The id that belongs to a position. */
static rx_sample_id name_of(const run *r, uint32_t epoch, long at)
{
    if (at < r->n)
        return (rx_sample_id){epoch, RX_SET_TRAIN, r->order[at].bin, r->order[at].index};
    long index = at - r->n;
    uint32_t bin = 0;
    while (index >= r->counts.test[bin])
        index -= r->counts.test[bin++];
    return (rx_sample_id){epoch, RX_SET_TEST, bin, (uint32_t)index};
}

static void take(run *r, uint32_t epoch, long at)
{
    rx_sample *sample = NULL, *expected = rx_sample_new(SIDE);
    rx_sample_id id = name_of(r, epoch, at);
    size_t pixels = SIDE * SIDE * sizeof(float);
    assert_non_null(expected);
    paint(id, expected);
    assert_int_equal(rx_feed_next(r->feed, at, &sample, NULL), RX_OK);
    assert_memory_equal(&sample->id, &id, sizeof id);
    assert_int_equal(sample->side, SIDE);
    assert_true(sample->fwhm == expected->fwhm);
    assert_memory_equal(sample->x, expected->x, pixels);
    assert_memory_equal(sample->w, expected->w, pixels);
    assert_memory_equal(sample->y, expected->y, pixels);
    assert_memory_equal(sample->blurred, expected->blurred, pixels);
    assert_memory_equal(sample->kernel, expected->kernel,
                        RX_SAMPLE_KERNEL * RX_SAMPLE_KERNEL * sizeof(float));
    rx_sample_free(sample);
    rx_sample_free(expected);
}

static void take_all(run *r, uint32_t epoch)
{
    for (long at = 0; at < r->all; at++)
        take(r, epoch, at);
}

/* Until generators have made `count` images in all; then a while longer, in which they must not make more. */
static void made_exactly(const run *r, long count)
{
    for (int i = 0; i < 5000 && r->own->all < count; i++)
        rest(1000);
    rest(30000);
    assert_int_equal(r->own->all, count);
}

static void every_image_comes_once_and_in_order(void **state)
{
    (void)state;
    for (int generators = 1; generators <= 4; generators++) {
        run r;
        begin(&r, generators, 2 * BINS * TOTAL);
        r.own->slow = generators > 1;
        for (uint32_t epoch = 0; epoch < 5; epoch++) {
            begin_epoch(&r, epoch);
            take_all(&r, epoch);
            move_counts(&r.counts, epoch);
        }
        end(&r);
    }
}

static void any_order_of_taking_is_fine(void **state)
{
    (void)state;
    run r;
    begin(&r, 2, BINS * TOTAL); /* just one epoch: nothing ahead until images are taken */
    for (uint32_t epoch = 3; epoch < 6; epoch++) {
        begin_epoch(&r, epoch);
        for (long at = r.all - 1; at >= 0; at--)
            take(&r, epoch, at);
    }
    end(&r);
}

static void next_epoch_is_made_while_this_one_is_used(void **state)
{
    (void)state;
    run r;
    begin(&r, 2, 3 * BINS * TOTAL);
    begin_epoch(&r, 0);
    /* uniform list of 1/2: 5 training and 15 test images, and an eighth and two more of each ahead */
    assert_int_equal(r.n, BINS * 5);
    long ahead = BINS * (5 + 0 + 2) + BINS * (15 + 1 + 2);
    made_exactly(&r, r.all + ahead);
    take_all(&r, 0);
    long drawn = 0;
    double seconds = 0;
    rx_feed_drawn(r.feed, &drawn, &seconds);
    assert_int_equal(drawn, r.all); /* those ahead came after both had told */
    assert_true(seconds > 0);
    begin_epoch(&r, 1); /* the same counts: nothing is left to make for it */
    take_all(&r, 1);
    made_exactly(&r, r.all + 2 * ahead);
    assert_int_equal(r.own->made[1], ahead);
    end(&r);
}

static void what_the_next_counts_leave_out_is_dropped(void **state)
{
    (void)state;
    run r;
    begin(&r, 3, 3 * BINS * TOTAL);
    begin_epoch(&r, 0);
    long ahead = BINS * (7 + 18);
    made_exactly(&r, r.all + ahead);
    take_all(&r, 0);
    long kept = 0;
    for (int bin = 0; bin < BINS; bin++) {
        r.counts.train[bin] = bin < 3 ? 10 : 0;
        r.counts.test[bin] = bin < 3 ? 10 : 20;
        kept += (bin < 3 ? 7 : 0) + (bin < 3 ? 10 : 18);
    }
    begin_epoch(&r, 1);
    take_all(&r, 1);
    assert_int_equal(r.own->made[1], ahead + r.all - kept);
    begin_epoch(&r, 2); /* all have said by then what they dropped */
    take_all(&r, 2);
    end(&r);
}

/* `ahead` bounds what waits at the trainer and what is made for the next epoch together. */
static void a_trainer_that_does_nothing_bounds_the_memory(void **state)
{
    (void)state;
    enum { SPARE = 30, GENERATORS = 3 };
    run r;
    begin(&r, GENERATORS, BINS * TOTAL + SPARE);
    begin_epoch(&r, 0);
    made_exactly(&r, r.all + SPARE);
    for (long at = 0; at < 48; at++)
        take(&r, 0, at);
    made_exactly(&r, r.all + SPARE + 48);
    end(&r);
}

static void less_memory_than_an_epoch_is_refused(void **state)
{
    (void)state;
    run r;
    rx_feed *feed = NULL;
    rx_error err = RX_ERROR_NONE;
    begin(&r, 1, BINS * TOTAL);
    rx_feed_params par = r.own->par;
    par.ahead--;
    assert_int_equal(rx_feed_new(&par, r.ranks, &feed, &err), RX_USAGE);
    assert_null(feed);
    assert_non_null(strstr(err.text, "IMAGES_AHEAD"));
    assert_non_null(strstr(err.text, "120"));
    end(&r);
}

/* Back to an epoch of before, as after a diverging loss; the same one again; one left in its middle. */
static void any_epoch_can_follow(void **state)
{
    (void)state;
    const uint32_t epochs[] = {4, 2, 2, 7, 3};
    run r;
    begin(&r, 2, 2 * BINS * TOTAL);
    r.own->slow = 1;
    for (size_t i = 0; i < sizeof epochs / sizeof epochs[0]; i++) {
        begin_epoch(&r, epochs[i]);
        for (long at = 0; at < (i % 2 ? r.all : r.all / 3); at++)
            take(&r, epochs[i], at);
        if (i != 1) /* and the same epoch again with the same and with other counts */
            move_counts(&r.counts, (uint32_t)i);
    }
    end(&r);
}

static void wrong_orders_are_refused(void **state)
{
    (void)state;
    run r;
    rx_error err = RX_ERROR_NONE;
    begin(&r, 1, BINS * TOTAL);
    begin_epoch(&r, 0);
    rx_pick second = r.order[1];
    r.order[1] = r.order[0]; /* twice */
    assert_int_equal(rx_feed_epoch(r.feed, 0, &r.counts, r.order, r.n, &err), RX_USAGE);
    r.order[1] = (rx_pick){0, 10}; /* not in it */
    assert_int_equal(rx_feed_epoch(r.feed, 0, &r.counts, r.order, r.n, &err), RX_USAGE);
    r.order[1] = second;
    assert_int_equal(rx_feed_epoch(r.feed, 0, &r.counts, r.order, r.n - 1, &err), RX_USAGE);
    rx_sample *sample = NULL; /* no epoch is open now */
    assert_int_equal(rx_feed_next(r.feed, 0, &sample, &err), RX_USAGE);
    r.counts.test[2] = TOTAL;
    assert_int_equal(rx_feed_epoch(r.feed, 0, &r.counts, r.order, r.n, &err), RX_USAGE);
    r.counts.test[2] = TOTAL - r.counts.train[2];
    begin_epoch(&r, 0);
    take_all(&r, 0);
    end(&r);
}

static void positions_are_given_once(void **state)
{
    (void)state;
    run r;
    rx_sample *sample = NULL;
    begin(&r, 1, BINS * TOTAL);
    begin_epoch(&r, 0);
    take(&r, 0, 5);
    assert_int_equal(rx_feed_next(r.feed, 5, &sample, NULL), RX_USAGE);
    assert_int_equal(rx_feed_next(r.feed, -1, &sample, NULL), RX_USAGE);
    assert_int_equal(rx_feed_next(r.feed, r.all, &sample, NULL), RX_USAGE);
    assert_null(sample);
    end(&r);
}

static void the_first_image_needed_is_made_first(void **state)
{
    (void)state;
    run r;
    begin(&r, 1, BINS * TOTAL);
    begin_epoch(&r, 0);
    take(&r, 0, 0);
    assert_int_equal(r.own->first.set, RX_SET_TRAIN);
    assert_int_equal(r.own->first.bin, r.order[0].bin);
    end(&r);
}

static void images_of_one_field_are_made_by_one_generator(void **state)
{
    (void)state;
    rx_feed_params par = {.scenes = {.side = SIDE, .field_side = FIELD, .uses = USES, .seed = 3}};
    for (int generators = 1; generators <= 5; generators++) {
        long load[5] = {0};
        for (uint32_t epoch = 0; epoch < 4; epoch++)
            for (uint32_t set = 0; set < 2; set++)
                for (uint32_t bin = 0; bin < 25; bin++)
                    for (uint32_t index = 0; index < 16; index++) {
                        rx_sample_id id = {epoch, set, bin, index},
                                     first = {epoch / USES * USES, set, bin, index / 4 * 4};
                        int owner = rx_feed_owner(&par, id, generators);
                        assert_in_range(owner, 0, generators - 1);
                        assert_true(rx_scenes_field(&par.scenes, id) == rx_scenes_field(&par.scenes, first));
                        assert_int_equal(owner, rx_feed_owner(&par, first, generators));
                        load[owner]++;
                    }
        for (int i = 0; i < generators; i++) /* and all have as much to do */
            assert_in_range(load[i], 3200 / generators * 95 / 100, 3200 / generators * 105 / 100);
    }
}

static void a_failed_generator_ends_the_epoch_with_its_words(void **state)
{
    (void)state;
    run r;
    rx_error err = RX_ERROR_NONE;
    rx_sample *sample = NULL;
    rx_status status = RX_OK;
    begin_failing(&r, 2, BINS * TOTAL, 3);
    uint32_t epoch = 0;
    for (; status == RX_OK && epoch < EPOCHS; epoch++) {
        begin_epoch(&r, epoch);
        for (long at = 0; at < r.all && status == RX_OK; at++) {
            status = rx_feed_next(r.feed, at, &sample, &err);
            rx_sample_free(sample);
        }
    }
    assert_in_range(epoch, 2, 4); /* it may be noticed while images are made ahead */
    assert_int_equal(status, RX_INPUT);
    assert_string_equal(err.where, "galaxies.fits");
    assert_string_equal(err.text, "the table is empty; give another one");
    rx_feed_free(r.feed);
    r.feed = NULL;
    rx_ranks_stop(r.ranks);
    assert_int_equal(r.own->running, 0);
    assert_true(r.own->failed >= 1);
    free(r.order);
    free(r.own);
}

static void a_trainer_may_leave_at_any_time(void **state)
{
    (void)state;
    for (int taken = 0; taken < 40; taken += 13) {
        run r;
        begin(&r, 3, 2 * BINS * TOTAL);
        r.own->slow = 1;
        if (taken > 0)
            begin_epoch(&r, 0);
        for (long at = 0; at < taken; at++)
            take(&r, 0, at);
        end(&r);
    }
}

static void waiting_is_counted(void **state)
{
    (void)state;
    run r;
    begin(&r, 1, 2 * BINS * TOTAL);
    assert_true(rx_feed_waited(r.feed) == 0);
    begin_epoch(&r, 0);
    take_all(&r, 0);
    double waited = rx_feed_waited(r.feed);
    assert_true(waited > 0);
    made_exactly(&r, r.all + BINS * (7 + 18));
    begin_epoch(&r, 1); /* all of it is there, so that there is room for as many images ahead */
    made_exactly(&r, r.all + BINS * (7 + 18) + r.all);
    take(&r, 1, 0); /* and is read with the first one */
    waited = rx_feed_waited(r.feed);
    for (long at = 1; at < r.all; at++)
        take(&r, 1, at);
    assert_true(rx_feed_waited(r.feed) == waited);
    end(&r);
}

/* --- with the simulator --- */

static void simulate(void *user, rx_ranks *ranks)
{
    rx_feed_generate(user, ranks, NULL, NULL);
}

static void images_of_the_simulator_arrive_as_they_are_made(void **state)
{
    (void)state;
    const double fwhm[2] = {2, 4}, sigma[2] = {1, 15};
    scenes_test t = scenes_test_open(1, 15);
    assert_int_equal(rx_selection_begin((const int[]){2, 1}, fwhm, sigma, 12, 1, &t.grid, NULL), RX_OK);
    rx_feed_params par = {.scenes = t.par, .grid = t.grid, .sim = t.config, .ahead = 24};
    rx_ranks *ranks = NULL;
    rx_feed *feed = NULL;
    rx_pick *order = NULL;
    long n = 0;
    rx_scenes *scenes[2];
    for (int set = 0; set < 2; set++) {
        t.par.set = set;
        scenes[set] = scenes_test_make(&t);
    }
    assert_int_equal(rx_ranks_start(1, 2, simulate, &par, &ranks, NULL), RX_OK);
    assert_int_equal(rx_feed_new(&par, ranks, &feed, NULL), RX_OK);
    assert_int_equal(rx_selection_order(&t.grid, 1, 6, &order, &n, NULL), RX_OK);
    assert_int_equal(rx_feed_epoch(feed, 6, &t.grid, order, n, NULL), RX_OK);
    rx_sample *expected = rx_sample_new(t.par.side);
    assert_non_null(expected);
    size_t pixels = (size_t)t.par.side * (size_t)t.par.side * sizeof(float);
    for (long at = 0; at < 24; at++) {
        rx_sample *sample = NULL;
        rx_error err = RX_ERROR_NONE;
        if (rx_feed_next(feed, at, &sample, &err) != RX_OK)
            fail_msg("%s", err.text);
        scenes_test_sample(scenes[sample->id.set], sample->id, expected);
        assert_int_equal(sample->id.set, at < n ? RX_SET_TRAIN : RX_SET_TEST);
        assert_memory_equal(sample->x, expected->x, pixels);
        assert_memory_equal(sample->w, expected->w, pixels);
        assert_memory_equal(sample->y, expected->y, pixels);
        assert_memory_equal(sample->blurred, expected->blurred, pixels);
        assert_memory_equal(sample->star, expected->star, sizeof sample->star);
        rx_sample_free(sample);
    }
    rx_sample_free(expected);
    free(order);
    rx_feed_free(feed);
    rx_ranks_stop(ranks);
    rx_scenes_free(scenes[0]);
    rx_scenes_free(scenes[1]);
    rx_simulate_config_free(t.config);
}

static void a_simulator_that_cannot_begin_is_told(void **state)
{
    (void)state;
    scenes_test t = scenes_test_open(1, 15);
    rx_feed_params par = {.scenes = t.par, .grid = t.grid, .sim = t.config, .ahead = 1000};
    rx_message message;
    rx_error err = RX_ERROR_NONE;
    rx_ranks *ranks = NULL;
    par.scenes.photon[0] = -1;
    assert_int_equal(rx_ranks_start(1, 1, simulate, &par, &ranks, NULL), RX_OK);
    assert_int_equal(rx_ranks_receive(ranks, 1, &message, &err), RX_USAGE);
    assert_true(err.text[0] != '\0');
    rx_ranks_stop(ranks);
    rx_simulate_config_free(t.config);
}

int main(void)
{
    alarm(120); /* whoever waits for ever ends the test */
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_image_comes_once_and_in_order),
        cmocka_unit_test(any_order_of_taking_is_fine),
        cmocka_unit_test(next_epoch_is_made_while_this_one_is_used),
        cmocka_unit_test(what_the_next_counts_leave_out_is_dropped),
        cmocka_unit_test(a_trainer_that_does_nothing_bounds_the_memory),
        cmocka_unit_test(less_memory_than_an_epoch_is_refused),
        cmocka_unit_test(any_epoch_can_follow),
        cmocka_unit_test(wrong_orders_are_refused),
        cmocka_unit_test(positions_are_given_once),
        cmocka_unit_test(the_first_image_needed_is_made_first),
        cmocka_unit_test(images_of_one_field_are_made_by_one_generator),
        cmocka_unit_test(a_failed_generator_ends_the_epoch_with_its_words),
        cmocka_unit_test(a_trainer_may_leave_at_any_time),
        cmocka_unit_test(waiting_is_counted),
        cmocka_unit_test(images_of_the_simulator_arrive_as_they_are_made),
        cmocka_unit_test(a_simulator_that_cannot_begin_is_told),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
