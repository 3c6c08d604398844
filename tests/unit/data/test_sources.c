/* Choosing among sources: list, segments, vignets and ASSOC rows stay in step. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/sources.h"

enum { N = 5, WIDTH = 6, HEIGHT = 2, VIGNET = 3 * 2, ASSOC = 2 };

/* Source k: x = 10 k, segment k + 1 but for source 1, which has none; vignet and ASSOC row hold 10 k + index.
 * The map: one pixel of each segment, a stranger's (9), and what is no segment. */
static rx_sources *five(int with_planes)
{
    static const int32_t map[WIDTH * HEIGHT] = {0, 1, 3, 4, 5, 0, 9, 5, 4, 3, 1, -1};
    rx_sources *s = RX_NEW(rx_sources, 1);
    assert_non_null(s);
    *s = (rx_sources){.n = N, .list = RX_NEW(rx_source, N), .width = WIDTH, .height = HEIGHT};
    assert_non_null(s->list);
    for (int k = 0; k < N; k++)
        s->list[k] = (rx_source){.number = k + 1, .x = 10 * k, .segment = k == 1 ? 0 : k + 1};
    if (!with_planes)
        return s;
    s->segments = RX_NEW(int32_t, WIDTH * HEIGHT);
    s->vignet_width = 3, s->vignet_height = 2;
    s->vignets = RX_NEW(float, N *VIGNET);
    s->nassoc = ASSOC;
    s->assoc = RX_NEW(double, N *ASSOC);
    assert_true(s->segments != NULL);
    assert_true(s->vignets != NULL);
    assert_true(s->assoc != NULL);
    memcpy(s->segments, map, sizeof map);
    for (int k = 0; k < N; k++) {
        s->list[k].vector_assoc = s->assoc + (size_t)k * ASSOC;
        for (int i = 0; i < VIGNET; i++)
            s->vignets[k * VIGNET + i] = (float)(10 * k + i);
        for (int i = 0; i < ASSOC; i++)
            s->assoc[k * ASSOC + i] = 10 * k + i;
    }
    return s;
}

static void check(const unsigned char *keep, const int32_t *map)
{
    rx_sources *s = five(1);
    int kept = 0;
    assert_int_equal(rx_sources_select(s, keep, NULL), RX_OK);
    for (int k = 0; k < N; k++) {
        if (!keep[k])
            continue;
        const rx_source *one = &s->list[kept];
        assert_true(one->x == 10 * k);
        assert_int_equal(one->number, kept + 1);
        assert_int_equal(one->segment, kept + 1);
        assert_ptr_equal(one->vector_assoc, s->assoc + (size_t)kept * ASSOC);
        for (int i = 0; i < ASSOC; i++)
            assert_true(one->vector_assoc[i] == 10 * k + i);
        for (int i = 0; i < VIGNET; i++)
            assert_true(s->vignets[kept * VIGNET + i] == (float)(10 * k + i));
        kept++;
    }
    assert_int_equal(s->n, kept);
    assert_memory_equal(s->segments, map, WIDTH * HEIGHT * sizeof *map);
    rx_sources_free(s);
}

static void planes_follow_the_list(void **state)
{
    static const unsigned char all[N] = {1, 1, 1, 1, 1}, none[N] = {0}, some[N] = {0, 1, 0, 1, 1},
                               first[N] = {1, 0, 0, 0, 0};
    static const int32_t map_all[] = {0, 1, 3, 4, 5, 0, 0, 5, 4, 3, 1, -1};
    static const int32_t map_none[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -1};
    static const int32_t map_some[] = {0, 0, 0, 2, 3, 0, 0, 3, 2, 0, 0, -1};
    static const int32_t map_first[] = {0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 1, -1};
    check(all, map_all);
    check(none, map_none);
    check(some, map_some);
    check(first, map_first);
}

static void a_list_alone_and_an_empty_one(void **state)
{
    static const unsigned char keep[N] = {0, 1, 0, 0, 1};
    rx_sources *s = five(0);
    assert_int_equal(rx_sources_select(s, keep, NULL), RX_OK);
    assert_int_equal(s->n, 2);
    assert_true(s->list[0].x == 10);
    assert_true(s->list[1].x == 40);
    assert_null(s->list[0].vector_assoc);
    s->n = 0;
    assert_int_equal(rx_sources_select(s, keep, NULL), RX_OK);
    assert_int_equal(s->n, 0);
    rx_sources_free(s);
}

static void what_counts_as_made_up(void **state)
{
    static const struct {
        int flags, made_up;
    } cases[] = {{0, 0},
                 {RX_RESTORE_SPURIOUS, 1},
                 {RX_RESTORE_SHRED, 1},
                 {RX_RESTORE_UNTESTED, 0},
                 {RX_RESTORE_ADDED, 0},
                 {RX_RESTORE_ADDED | RX_RESTORE_SPURIOUS, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const rx_source source = {.fit.restore = cases[i].flags};
        assert_int_equal(rx_source_is_spurious(&source), cases[i].made_up);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(planes_follow_the_list),
                                       cmocka_unit_test(a_list_alone_and_an_empty_one),
                                       cmocka_unit_test(what_counts_as_made_up)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
