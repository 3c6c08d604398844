/* The keyword tables themselves: every row is sound, and the structs hold what the rows say. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "../unit.h"
#include "config/config_fields.h"
#include "config/keyword.h"

enum { TABLES = 5 };

static const rx_keytable *table_of(int i)
{
    const rx_keytable *const tables[TABLES] = {rx_keytable_rextract(), rx_keytable_simulate(),
                                               rx_keytable_validate(), rx_keytable_train(),
                                               rx_keytable_survey()};
    return tables[i];
}

static void names_are_unique_and_fit_a_dump(void **state)
{
    static const int least[TABLES] = {100, 40, 20, 40, 5};
    for (int t = 0; t < TABLES; t++) {
        const rx_keytable *table = table_of(t);
        int keys = 0;
        for (int row = 0; row < table->nrows; row++) {
            const rx_keyword *key = &table->rows[row];
            if (key->kind == RX_KIND_SECTION)
                continue;
            keys++;
            assert_int_equal(rx_keyword_find(table, key->name), row); /* the first of that name is this one */
            assert_in_range(strlen(key->name), 3, 24);
            assert_int_equal(strspn(key->name, "ABCDEFGHIJKLMNOPQRSTUVWXYZ_"), strlen(key->name));
        }
        assert_true(keys > least[t]);
        assert_true(rx_keyword_find(table, "VERBOSE_TYPE") > 0);
        /* a roll-up has nothing to share out */
        assert_true(rx_keyword_find(table, "NTHREADS") > 0 || table == rx_keytable_survey());
    }
}

static void every_row_has_help_in_one_line(void **state)
{
    for (int t = 0; t < TABLES; t++)
        for (int row = 0; row < table_of(t)->nrows; row++) {
            const rx_keyword *key = &table_of(t)->rows[row];
            size_t n = strlen(key->help);
            if (key->kind == RX_KIND_SECTION)
                continue;
            assert_in_range(n, 5, 90);
            assert_null(strpbrk(key->help, "\n\t\\"));
            assert_int_not_equal(key->help[n - 1], '.');
            assert_int_not_equal(key->help[0], '.'); /* would be a request in the manual page */
        }
}

/* Conditions are made of keywords of the table, their legal words, and columns in capitals. */
static void check_needs(const rx_keytable *table, const rx_keyword *key)
{
    const rx_keyword *of = NULL;
    bool column = false;
    const char *text = key->needs;
    char word[64];
    for (size_t n = 0; text != NULL && *text != '\0'; text += n + strspn(text + n, " ,;")) {
        n = strcspn(text, " ,;");
        snprintf(word, sizeof word, "%.*s", (int)n, text);
        const int row = rx_keyword_find(table, word);
        bool legal =
            row >= 0 || strcmp(word, "or") == 0 || strcmp(word, "no") == 0 || strcmp(word, "column") == 0;
        if (row >= 0)
            of = &table->rows[row];
        if (row >= 0 || strcmp(word, "column") == 0)
            column = row < 0;
        else if (!legal && column)
            legal = strcspn(word, "abcdefghijklmnopqrstuvwxyz") == n;
        else if (!legal && of != NULL && of->words != NULL)
            for (const char *const *known = of->words; *known != NULL; known++)
                legal |= strcmp(*known, word) == 0;
        else if (!legal && of != NULL)
            legal = of->kind == RX_KIND_BOOL && strcmp(word, "Y") == 0;
        if (!legal || (row >= 0 && of == key))
            fail_msg("%s needs '%s': what is %s?", key->name, key->needs, word);
    }
}

static void needs_are_conditions_on_the_table(void **state)
{
    int n = 0;
    for (int t = 0; t < TABLES; t++)
        for (int row = 0; row < table_of(t)->nrows; row++) {
            n += table_of(t)->rows[row].needs != NULL;
            check_needs(table_of(t), &table_of(t)->rows[row]);
        }
    assert_in_range(n, 80, 500);
}

static void check_row(const rx_keyword *key)
{
    int word = key->kind == RX_KIND_WORD || key->kind == RX_KIND_WORDS;
    int number = key->kind == RX_KIND_INT || key->kind == RX_KIND_INTS || key->kind == RX_KIND_REAL ||
                 key->kind == RX_KIND_REALS;
    assert_int_equal(word, key->words != NULL);
    assert_int_equal(number, key->low < key->high);
    if (key->kind == RX_KIND_INT || key->kind == RX_KIND_INTS) {
        assert_true(key->low >= -2147483648.0);
        assert_true(key->high <= 2147483647.0);
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

static void ranges_words_and_counts_are_sound(void **state)
{
    for (int t = 0; t < TABLES; t++)
        for (int row = 0; row < table_of(t)->nrows; row++)
            if (table_of(t)->rows[row].kind != RX_KIND_SECTION)
                check_row(&table_of(t)->rows[row]);
}

/* Against SExtractor 2.25's own numbers, written down here once more. */
static void defaults_are_those_of_sextractor(void **state)
{
    rx_config *c = NULL;
    assert_int_equal(rx_config_new(&c, NULL), RX_OK);
    assert_string_equal(c->catalog_name, "test.cat");
    assert_string_equal(c->catalog_type, "ASCII_HEAD");
    assert_int_equal(c->detect_minarea, 5);
    assert_int_equal(c->detect_thresh.n, 1);
    assert_true(c->detect_thresh.v[0] == 5.0);
    assert_true(c->analysis_thresh.v[0] == 1.5);
    assert_true(c->filter);
    assert_true(c->clean);
    assert_true(c->weight_gain);
    assert_int_equal(c->filter_thresh.n, 0);
    assert_true(c->phot_autoparams.v[0] == 2.5);
    assert_true(c->phot_autoparams.v[1] == 3.5);
    assert_int_equal(c->assoc_data.n, 3);
    assert_int_equal(c->assoc_data.v[2], 4);
    assert_true(c->satur_level == 0.0);
    assert_true(c->deblend_mincont == 0.005);
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
        cmocka_unit_test(needs_are_conditions_on_the_table),
        cmocka_unit_test(every_row_has_help_in_one_line),
        cmocka_unit_test(ranges_words_and_counts_are_sound),
        cmocka_unit_test(defaults_are_those_of_sextractor),
    };
    return cmocka_run_group_tests_name("keywords", tests, NULL, NULL);
}
