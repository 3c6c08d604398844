/* The keyword tables themselves: every row is sound, and the structs hold what the rows say. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include <cmocka.h>

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
    (void)state;
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

static void names_are_found(void **state)
{
    const rx_keytable *table = rx_keytable_rextract();
    (void)state;
    int row = rx_keyword_find(table, "detect_thresh");
    assert_true(row > 0);
    assert_string_equal(table->rows[row].name, "DETECT_THRESH");
    assert_int_equal(rx_keyword_find(table, "DETECT_THRES"), -1);
    assert_int_equal(rx_keyword_find(table, "Photometry"), -1); /* a section is no keyword */
    assert_int_equal(rx_keyword_find(table, "STAR_COUNT"), -1); /* nor is one of another program */
}

static void fields_are_named_like_their_keyword(void **state)
{
    (void)state;
#define SECTION(id, title)
#define KEY(kind, NAME, field, ...) assert_int_equal(strcasecmp(#NAME, #field), 0);
#include "config/campaign.def"
#include "config/keys.def"
#include "config/simulate.def"
#undef KEY
#undef SECTION
}

static void every_row_has_help_in_one_line(void **state)
{
    (void)state;
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
            legal = rx_keyword_among(of->words, word);
        else if (!legal && of != NULL)
            legal = of->kind == RX_KIND_BOOL && strcmp(word, "Y") == 0;
        if (!legal || (row >= 0 && of == key))
            fail_msg("%s needs '%s': what is %s?", key->name, key->needs, word);
    }
}

static void needs_are_conditions_on_the_table(void **state)
{
    (void)state;
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

/* -h has each keyword that has an effect once, under the title of its section, in lines of a terminal. */
static void help_groups_keywords(void **state)
{
    (void)state;
    for (int t = 0; t < TABLES; t++) {
        const rx_keytable *table = table_of(t);
        rx_text text = {0};
        const char *title = NULL;
        rx_settings_help(&text, table);
        assert_false(text.failed);
        for (int row = 0; row < table->nrows; row++) {
            const rx_keyword *key = &table->rows[row];
            char word[80];
            int times = 0;
            const char *at, *section = NULL;
            if (key->kind == RX_KIND_SECTION) {
                title = key->name;
                continue;
            }
            snprintf(word, sizeof word, "\n  %s", title);
            section = strstr(text.data, word);
            snprintf(word, sizeof word, " %s", key->name);
            for (at = text.data; (at = strstr(at, word)) != NULL; at += strlen(word))
                if (strchr(" \n", at[strlen(word)]) != NULL) {
                    times++;
                    assert_non_null(section);
                    /* no other title comes between */
                    for (const char *line = strchr(section + 1, '\n'); line < at;
                         line = strchr(line + 1, '\n'))
                        assert_memory_equal(line, "\n                        ", 25);
                }
            assert_int_equal(times, key->status == RX_STATUS_SEX || key->status == RX_STATUS_OURS);
        }
        for (const char *line = strtok(text.data, "\n"); line != NULL; line = strtok(NULL, "\n"))
            assert_in_range(strlen(line), 1, 80);
        rx_text_free(&text);
    }
}

static void ranges_words_and_counts_are_sound(void **state)
{
    (void)state;
    for (int t = 0; t < TABLES; t++)
        for (int row = 0; row < table_of(t)->nrows; row++)
            if (table_of(t)->rows[row].kind != RX_KIND_SECTION)
                check_row(&table_of(t)->rows[row]);
}

/* Printing the defaults and giving them back changes nothing. */
static void values_survive_print_and_assign(void **state)
{
    (void)state;
    for (int t = 0; t < TABLES; t++) {
        const rx_keytable *table = table_of(t);
        rx_error err = RX_ERROR_NONE;
        rx_settings *settings = NULL, *other = NULL;
        assert_int_equal(rx_settings_new(table, &settings, &err), RX_OK);
        assert_int_equal(rx_settings_new(table, &other, &err), RX_OK);
        for (int row = 0; row < table->nrows; row++) {
            rx_text text = {0}, again = {0};
            if (table->rows[row].kind == RX_KIND_SECTION)
                continue;
            rx_keyword_print(&text, settings, row, false);
            if (rx_settings_set(other, table->rows[row].name, text.data, NULL, &err) != RX_OK)
                fail_msg("%s", err.text);
            rx_keyword_print(&again, other, row, false);
            assert_string_equal(text.data, again.data);
            rx_text_free(&text);
            rx_text_free(&again);
        }
        rx_settings_free(settings);
        rx_settings_free(other);
    }
}

/* The defaults of every program pass its own checks. */
static void defaults_are_consistent(void **state)
{
    (void)state;
    for (int t = 0; t < TABLES; t++) {
        rx_error err = RX_ERROR_NONE;
        rx_settings *settings = NULL;
        assert_int_equal(rx_settings_new(table_of(t), &settings, &err), RX_OK);
        if (rx_settings_check(settings, &err) != RX_OK)
            fail_msg("%s", err.text);
        rx_settings_free(settings);
    }
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
    assert_true(c->detect_thresh.v[0] == 1.5);
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
        cmocka_unit_test(names_are_found),
        cmocka_unit_test(needs_are_conditions_on_the_table),
        cmocka_unit_test(fields_are_named_like_their_keyword),
        cmocka_unit_test(every_row_has_help_in_one_line),
        cmocka_unit_test(help_groups_keywords),
        cmocka_unit_test(ranges_words_and_counts_are_sound),
        cmocka_unit_test(values_survive_print_and_assign),
        cmocka_unit_test(defaults_are_consistent),
        cmocka_unit_test(defaults_are_those_of_sextractor),
    };
    return cmocka_run_group_tests_name("keywords", tests, NULL, NULL);
}
