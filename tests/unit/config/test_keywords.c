/* The keyword table itself: every row is sound, and the struct holds what the rows say. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <cmocka.h>

#include "config/keyword.h"

static void names_are_unique_and_fit_a_dump(void **state)
{
    (void)state;
    int keys = 0;
    for (int row = 0; row < RX_KEY_ROWS; row++) {
        const rx_keyword *key = rx_keyword_row(row);
        if (key->kind == RX_KIND_SECTION)
            continue;
        keys++;
        assert_int_equal(rx_keyword_find(key->name), row); /* the first of that name is this one */
        assert_in_range(strlen(key->name), 3, 24);
        assert_int_equal(strspn(key->name, "ABCDEFGHIJKLMNOPQRSTUVWXYZ_"), strlen(key->name));
    }
    assert_true(keys > 100);
    assert_int_equal(rx_keyword_find("detect_thresh"), RX_KEY_DETECT_THRESH);
    assert_int_equal(rx_keyword_find("DETECT_THRES"), -1);
    assert_int_equal(rx_keyword_find("Photometry"), -1); /* a section is no keyword */
    assert_string_equal(rx_keyword_nearest("DETECT_TRESH"), "DETECT_THRESH");
    assert_null(rx_keyword_nearest("QWERTYUIOP"));
}

static void fields_are_named_like_their_keyword(void **state)
{
    (void)state;
#define SECTION(id, title)
#define KEY(kind, NAME, field, ...) assert_int_equal(strcasecmp(#NAME, #field), 0);
#include "config/keys.def"
#undef KEY
#undef SECTION
}

static void every_row_has_help_in_one_line(void **state)
{
    (void)state;
    for (int row = 0; row < RX_KEY_ROWS; row++) {
        const rx_keyword *key = rx_keyword_row(row);
        size_t n = strlen(key->help);
        if (key->kind == RX_KIND_SECTION)
            continue;
        assert_in_range(n, 5, 90);
        assert_null(strpbrk(key->help, "\n\t\\"));
        assert_int_not_equal(key->help[n - 1], '.');
        assert_int_not_equal(key->help[0], '.'); /* would be a request in the manual page */
    }
}

static void ranges_words_and_counts_are_sound(void **state)
{
    (void)state;
    for (int row = 0; row < RX_KEY_ROWS; row++) {
        const rx_keyword *key = rx_keyword_row(row);
        if (key->kind == RX_KIND_SECTION)
            continue;
        int word = key->kind == RX_KIND_WORD || key->kind == RX_KIND_WORDS;
        int number = key->kind == RX_KIND_INT || key->kind == RX_KIND_INTS || key->kind == RX_KIND_REAL ||
                     key->kind == RX_KIND_REALS;
        assert_int_equal(word, key->words != NULL);
        assert_int_equal(number, key->low < key->high);
        if (key->kind == RX_KIND_INT || key->kind == RX_KIND_INTS) {
            assert_true(key->low >= -2147483648.0 && key->high <= 2147483647.0);
        }
        assert_in_range(key->nmax, 1, key->kind >= RX_KIND_STRINGS ? RX_LIST : 1);
        assert_in_range(key->nmin, 0, key->nmax);
        if (key->nmin == 0)
            assert_true(key->kind >= RX_KIND_STRINGS || key->kind == RX_KIND_STRING);
        else
            assert_true(key->initial[0] != '\0');
        for (int i = 0; word && key->words[i] != NULL; i++)
            for (int j = 0; j < i; j++)
                assert_int_not_equal(strcasecmp(key->words[i], key->words[j]), 0);
    }
}

/* Printing the defaults and giving them back changes nothing. */
static void values_survive_print_and_assign(void **state)
{
    (void)state;
    rx_error err = RX_ERROR_NONE;
    rx_config *config = NULL, *other = NULL;
    assert_int_equal(rx_config_new(&config, &err), RX_OK);
    assert_int_equal(rx_config_new(&other, &err), RX_OK);
    for (int row = 0; row < RX_KEY_ROWS; row++) {
        rx_text text = {0}, again = {0};
        if (rx_keyword_row(row)->kind == RX_KIND_SECTION)
            continue;
        rx_keyword_print(&text, config, row, false);
        if (rx_config_set(other, rx_keyword_row(row)->name, text.data, NULL, &err) != RX_OK)
            fail_msg("%s", err.text);
        rx_keyword_print(&again, other, row, false);
        assert_string_equal(text.data, again.data);
        rx_text_free(&text);
        rx_text_free(&again);
    }
    rx_config_free(config);
    rx_config_free(other);
}

/* Against SExtractor 2.25's own numbers, written down here once more. */
static void defaults_are_those_of_sextractor(void **state)
{
    (void)state;
    rx_config *c = NULL;
    assert_int_equal(rx_config_new(&c, NULL), RX_OK);
    assert_string_equal(c->catalog_name, "test.cat");
    assert_string_equal(c->catalog_type, "ASCII_HEAD");
    assert_int_equal(c->detect_minarea, 5);
    assert_int_equal(c->detect_thresh.n, 1);
    assert_true(c->detect_thresh.v[0] == 1.5 && c->analysis_thresh.v[0] == 1.5);
    assert_true(c->filter && c->clean && c->weight_gain);
    assert_int_equal(c->filter_thresh.n, 0);
    assert_true(c->phot_autoparams.v[0] == 2.5 && c->phot_autoparams.v[1] == 3.5);
    assert_int_equal(c->assoc_data.n, 3);
    assert_int_equal(c->assoc_data.v[2], 4);
    assert_true(c->satur_level == 50000.0 && c->deblend_mincont == 0.005);
    assert_int_equal(c->back_size.v[0], 64);
    assert_string_equal(c->checkimage_type.v[0], "NONE");
    assert_string_equal(c->restore_type.v[0], "RL"); /* ours */
    assert_string_equal(c->reference_name, "");
    rx_config_free(c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_are_unique_and_fit_a_dump),
        cmocka_unit_test(fields_are_named_like_their_keyword),
        cmocka_unit_test(every_row_has_help_in_one_line),
        cmocka_unit_test(ranges_words_and_counts_are_sound),
        cmocka_unit_test(values_survive_print_and_assign),
        cmocka_unit_test(defaults_are_those_of_sextractor),
    };
    return cmocka_run_group_tests_name("keywords", tests, NULL, NULL);
}
