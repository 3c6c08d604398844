/* The record that goes into headers: cards of 80 characters, nothing that depends on threads. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "stage/record.h"

static const char *find(const rx_record *record, const char *name)
{
    for (int i = 0; i < record->n; i++)
        if (strcmp(record->pairs[i][0], name) == 0)
            return record->pairs[i][1];
    return NULL;
}

static void the_run_is_recorded_without_threads(void **state)
{
    (void)state;
    rx_config *config = NULL;
    rx_record record = {0};
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    assert_int_equal(rx_config_set(config, "DETECT_THRESH", "2.25", NULL, NULL), RX_OK);
    rx_record_run(&record, config, "tile.fits");
    assert_false(record.failed);
    assert_string_equal(find(&record, "DETECT_THRESH"), "2.25");
    assert_string_equal(find(&record, "RXINPUT"), "tile.fits");
    assert_string_equal(find(&record, "RXVERS"), RX_VERSION);
    assert_null(find(&record, "NTHREADS"));
    assert_null(find(&record, "VERBOSE_TYPE"));
    rx_record_free(&record);
    rx_config_free(config);
}

static void cards_are_whole(void **state)
{
    (void)state;
    rx_record record = {0};
    rx_text cards = {0};
    rx_record_add(&record, "RXPSF", "PSF of the input", "%s", "a Moffat");
    rx_record_add(&record, "CATALOG_NAME", "output", "a rather long name of a catalogue, %s, %s",
                  "which does not fit into one card because there is only room for seventy-two",
                  "characters of text");
    rx_record_cards(&record, &cards);
    assert_int_equal(cards.length % 80, 0);
    assert_true(cards.length / 80 >= 3);
    assert_memory_equal(cards.data, "RXPSF   = 'a Moffat'", 20);
    assert_memory_equal(cards.data + 80, "HISTORY CATALOG_NAME = a rather", 31);
    assert_memory_equal(cards.data + 160, "HISTORY ", 8);
    rx_text_free(&cards);
    rx_record_free(&record);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_run_is_recorded_without_threads),
        cmocka_unit_test(cards_are_whole),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
