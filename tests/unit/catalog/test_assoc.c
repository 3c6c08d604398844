/* ASSOC: reading lists, combining entries, selecting sources. */
#include "../near.h"
#include "scene.h"

/* The list: columns x y mag id. Sources of the scene stand at (11.25+i, 21.5+2i) counting from 1. */
static const char list_text[] = "# x y mag id\n"
                                "11.50 21.50 20.0 1\n" /* 0.25 from source 1 */
                                "11.25 21.30 22.0 2\n" /* 0.20 from source 1, lower y */
                                "13.25 25.50 21.0 3\n" /* on source 3 */
                                "90 90 18 4\n";

static rx_assoc *read_list(const char *text)
{
    rx_assoc *list = NULL;
    write_text("sky.list", text);
    assert_int_equal(rx_assoc_read("sky.list", &list, NULL), RX_OK);
    return list;
}

static rx_assoc_params params(rx_assoc_type type)
{
    return (rx_assoc_params){
        .x = 1, .y = 2, .weight = 3, .ndata = 2, .data = {4, 3}, .radius = 1, .type = type};
}

/* VECTOR_ASSOC of the first source, of type `type`. */
static void first_source(rx_assoc_type type, int number, double id, double mag)
{
    rx_assoc *list = read_list(list_text);
    rx_sources *sources = scene_sources(3);
    rx_assoc_params par = params(type);
    assert_int_equal(rx_assoc_match(&par, list, NULL, NULL, sources, NULL), RX_OK);
    assert_int_equal(sources->n, 3);
    assert_int_equal(sources->nassoc, 2);
    assert_int_equal(sources->list[0].number_assoc, number);
    assert_near(sources->list[0].vector_assoc[0], id, 1e-12);
    assert_near(sources->list[0].vector_assoc[1], mag, 1e-12);
    assert_int_equal(sources->list[1].number_assoc, 0);
    assert_near(sources->list[1].vector_assoc[0], 0, 0);
    assert_near(sources->list[2].vector_assoc[0], 3.0, 1e-12);
    rx_sources_free(sources);
    rx_assoc_free(list);
}

static void every_type_combines_its_way(void **state)
{
    double w1 = pow(10, -8), w2 = pow(10, -8.8);
    first_source(RX_ASSOC_NEAREST, 2, 2, 22);
    first_source(RX_ASSOC_FIRST, 1, 2, 22);
    first_source(RX_ASSOC_MIN, 2, 1, 20);
    first_source(RX_ASSOC_MAX, 2, 2, 22);
    first_source(RX_ASSOC_SUM, 2, 3, 42);
    first_source(RX_ASSOC_MEAN, 2, (20 * 1 + 22 * 2) / 42.0, (20 * 20 + 22 * 22) / 42.0);
    first_source(RX_ASSOC_MAG_MEAN, 2, (w1 * 1 + w2 * 2) / (w1 + w2), (w1 * 20 + w2 * 22) / (w1 + w2));
    first_source(RX_ASSOC_MAG_SUM, 2, -2.5 * log10(pow(10, -0.4) + pow(10, -0.8)), -2.5 * log10(w1 + w2));
}

static void selection_renumbers_everything(void **state)
{
    for (int matched = 0; matched < 2; matched++) {
        rx_assoc *list = read_list(list_text);
        rx_sources *sources = scene_sources(3);
        sources->width = 4, sources->height = 1;
        sources->segments = RX_NEW(int32_t, 4);
        sources->vignet_width = sources->vignet_height = 1;
        sources->vignets = RX_NEW(float, 3);
        assert_true(sources->segments != NULL);
        assert_true(sources->vignets != NULL);
        for (int i = 0; i < 3; i++) {
            sources->segments[i + 1] = i + 1;
            sources->vignets[i] = (float)(i + 1);
        }
        rx_assoc_params par = params(RX_ASSOC_NEAREST);
        par.select = matched ? RX_ASSOC_MATCHED : RX_ASSOC_UNMATCHED;
        assert_int_equal(rx_assoc_match(&par, list, NULL, NULL, sources, NULL), RX_OK);
        const int32_t expected[2][4] = {{0, 0, 1, 0}, {0, 1, 0, 2}};
        assert_int_equal(sources->n, matched ? 2 : 1);
        assert_memory_equal(sources->segments, expected[matched], sizeof expected[0]);
        for (int i = 0; i < sources->n; i++) {
            assert_int_equal(sources->list[i].number, i + 1);
            assert_int_equal(sources->list[i].segment, i + 1);
        }
        assert_near(sources->vignets[0], matched ? 1 : 2, 0);
        assert_near(sources->list[sources->n - 1].x, matched ? 12.25 : 11.25, 0);
        if (matched)
            assert_near(sources->list[1].vector_assoc[0], 3, 0);
        rx_sources_free(sources);
        rx_assoc_free(list);
    }
}

static void all_columns_when_none_is_named(void **state)
{
    rx_assoc *list = read_list(list_text);
    rx_sources *sources = scene_sources(1);
    rx_assoc_params par = params(RX_ASSOC_NEAREST);
    par.ndata = 1, par.data[0] = 0;
    assert_int_equal(rx_assoc_match(&par, list, NULL, NULL, sources, NULL), RX_OK);
    assert_int_equal(sources->nassoc, 4);
    assert_near(sources->list[0].vector_assoc[3], 2, 0);
    par.ndata = 3, par.data[0] = 9, par.data[1] = 4, par.data[2] = 0;
    assert_int_equal(rx_assoc_match(&par, list, NULL, NULL, sources, NULL), RX_OK);
    assert_int_equal(sources->nassoc, 1);
    assert_near(sources->list[0].vector_assoc[0], 2, 0);
    rx_sources_free(sources);
    rx_assoc_free(list);
}

static void what_cannot_work_is_said(void **state)
{
    rx_error err = RX_ERROR_NONE;
    rx_assoc *list = read_list(list_text), *none = NULL;
    rx_sources *sources = scene_sources(1);
    rx_assoc_params par = params(RX_ASSOC_NEAREST);
    par.y = 5;
    assert_int_equal(rx_assoc_match(&par, list, NULL, NULL, sources, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "number 5"));
    par = params(RX_ASSOC_NEAREST);
    par.world = true;
    assert_int_equal(rx_assoc_match(&par, list, NULL, NULL, sources, &err), RX_INPUT);
    assert_int_equal(rx_assoc_read("/nowhere/sky.list", &none, &err), RX_INPUT);
    write_text("bad.list", "1 2\n1 2 3\n");
    assert_int_equal(rx_assoc_read("bad.list", &none, &err), RX_INPUT);
    assert_int_equal(err.line, 2);
    assert_null(none);
    rx_sources_free(sources);
    rx_assoc_free(list);
}

static void empty_lists_and_empty_catalogues(void **state)
{
    rx_assoc *empty = read_list("# x y mag id\n"), *list = read_list(list_text);
    rx_sources *sources = scene_sources(2), *nothing = scene_sources(0);
    rx_assoc_params par = params(RX_ASSOC_SUM);
    par.select = RX_ASSOC_MATCHED;
    assert_int_equal(empty->table->nrows, 0);
    assert_int_equal(rx_assoc_match(&par, list, NULL, NULL, nothing, NULL), RX_OK);
    assert_int_equal(rx_assoc_match(&par, empty, NULL, NULL, sources, NULL), RX_OK);
    assert_int_equal(sources->n, 0);
    rx_sources_free(sources);
    rx_sources_free(nothing);
    rx_assoc_free(list);
    rx_assoc_free(empty);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_type_combines_its_way),      cmocka_unit_test(selection_renumbers_everything),
        cmocka_unit_test(all_columns_when_none_is_named),   cmocka_unit_test(what_cannot_work_is_said),
        cmocka_unit_test(empty_lists_and_empty_catalogues),
    };
    return cmocka_run_group_tests(tests, enter_scratch, leave_scratch);
}
