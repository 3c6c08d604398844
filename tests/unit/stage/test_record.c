/* The record that goes into headers: cards of 80 characters, nothing that depends on threads. */
#include "../near.h"
#include "../scratch.h"

#include <math.h>

#include "base/text.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "psf/psf.h"
#include "report/qa_page.h"
#include "stage/provenance.h"
#include "stage/tile_facts.h"

static const char *find(const rx_record *record, const char *name)
{
    for (int i = 0; i < record->n; i++)
        if (strcmp(record->pairs[i][0], name) == 0)
            return record->pairs[i][1];
    return NULL;
}

static void the_run_is_recorded_without_threads(void **state)
{
    rx_config *config = NULL;
    rx_record record = {0};
    assert_int_equal(rx_config_new(&config, NULL), RX_OK);
    assert_int_equal(rx_settings_set(&config->settings, "DETECT_THRESH", "2.25", NULL, NULL), RX_OK);
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

/* Lines of HISTORY against what went in; user: the record, its entry that comes next. */
typedef struct reading {
    const rx_record *record;
    int next;
} reading;

static rx_status compare_line(void *user, const char *line, rx_error *err)
{
    reading *r = user;
    char **pair = r->record->pairs[r->next++];
    (void)err;
    const size_t n = strlen(pair[0]);
    char value[2000];
    assert_memory_equal(line, pair[0], n);
    assert_memory_equal(line + n, " =", 2);
    snprintf(value, sizeof value, "%s", line[n + 2] != '\0' ? line + n + 3 : "");
    assert_int_equal(rx_printable_read(value), 1);
    assert_string_equal(value, pair[1]);
    return RX_OK;
}

/* Whatever stands in a value: headers give it back to the byte. */
static void history_is_lossless(void **state)
{
    rx_record record = {0};
    rx_text cards = {0};
    char value[400];
    for (int i = 0; i < 300; i++) { /* every length around the ends of cards, blanks and '&' at all places */
        for (int k = 0; k < i; k++)
            value[k] = " &,%\xc3'x \"y"[(k * 7 + i) % 11];
        value[i] = '\0';
        rx_record_add(&record, "CATALOG_NAME", "output", "%s", value);
    }
    rx_record_cards(&record, &cards);
    assert_false(cards.failed);
    for (size_t i = 0; i < cards.length; i++) {
        assert_true(cards.data[i] >= ' ');
        assert_true(cards.data[i] <= '~');
    }
    reading r = {.record = &record};
    assert_int_equal(rx_cards_history(cards.data, (long)cards.length / 80, compare_line, &r, NULL), RX_OK);
    assert_int_equal(r.next, record.n);
    rx_text_free(&cards);
    rx_record_free(&record);
}

static void cards_are_whole(void **state)
{
    rx_record record = {0};
    rx_text cards = {0};
    rx_record_add(&record, "RXPSF", "PSF of the input", "%s", "a Moffat");
    rx_record_add(&record, "CATALOG_NAME", "output", "a rather long name of a catalogue, %s, %s",
                  "which does not fit into one card because there is only room for seventy-two",
                  "characters of text");
    rx_record_cards(&record, &cards);
    assert_int_equal(cards.length % 80, 0);
    assert_int_equal(cards.length / 80, 4);
    assert_memory_equal(cards.data, "RXPSF   = 'a Moffat'", 20);
    assert_memory_equal(cards.data + 80, "HISTORY CATALOG_NAME = a rather", 31);
    assert_memory_equal(cards.data + 160, "HISTORY ", 8);
    assert_memory_equal(cards.data + 240, "HISTORY ", 8);
    rx_text_free(&cards);
    rx_record_free(&record);
}

/* Header, report, summary.json and the tile's record say the same mean error of fluxes from the PSF, local errors and all. */
static void one_error_of_the_psf(void **state)
{
    rx_psf psf = {.fwhm = 3.0,
                  .x0 = 99.5,
                  .y0 = 49.5,
                  .xs = 99.5,
                  .ys = 49.5,
                  .quality = {.how = RX_PSF_BY_PIXELS, .radius = 20.0, .flux_error = 0.003}};
    psf.quality.flux_errors[0][4] = 0.05;
    psf.quality.flux_errors[4][2] = 0.02;
    const double mean = sqrt(0.003 * 0.003 + (0.05 * 0.05 + 0.02 * 0.02) / 25.0);
    char text[60];
    rx_record cards = {0};
    rx_psf_facts(&psf, &cards);
    assert_near(strtod(find(&cards, "RXPSFERR"), NULL), mean, 5.1e-6);
    assert_near(strtod(find(&cards, "RXPSFERX"), NULL), hypot(0.003, 0.05), 5.1e-6);
    assert_near(strtod(find(&cards, "RXPSFEPX"), NULL), 200.0, 1e-9);
    assert_near(strtod(find(&cards, "RXPSFEPY"), NULL), 1.0, 1e-9);
    rx_record_free(&cards);

    const rx_qa_input input = {
        .tile = "t", .reference = "r", .width = 100, .height = 100, .psf = {.psf = &psf}};
    const rx_qa_params params = {.match_radius = 1.0};
    char *page = NULL, *summary = NULL;
    const char *path;
    /* a PSF of pixels, and one of a lower rung, which has no radius */
    for (psf.quality.radius = 20.0; psf.quality.radius >= 0.0; psf.quality.radius -= 20.0) {
        assert_int_equal(rx_qa_report(&params, &input, *state, "the report", NULL, NULL, NULL), RX_OK);
        path = in(state, "report.html");
        assert_int_equal(rx_text_read_file(path, 1 << 20, &page, NULL, NULL), RX_OK);
        snprintf(text, sizeof text, "</td><td>%.4f</td>", mean);
        if (strstr(page, text) == NULL)
            fail_msg("'%s' is not in '%s'", text, page);
        path = in(state, "summary.json");
        assert_int_equal(rx_text_read_file(path, 1 << 20, &summary, NULL, NULL), RX_OK);
        const char *said = strstr(summary, "\"flux_error\": ");
        assert_non_null(said);
        assert_near(strtod(said + strlen("\"flux_error\": "), NULL), mean, 1e-6);
        free(page);
        free(summary);
    }
    psf.quality.radius = 20.0;

    rx_tile tile = {.width = 100, .height = 100};
    rx_background plain = {0};
    const rx_field field = {.tile = &tile, .psf = &psf, .plain = &plain};
    rx_tile_facts facts = {0};
    rx_extension_facts *e;
    assert_int_equal(rx_tile_facts_add(&facts, &field, NULL, 0, 0, &e, NULL), RX_OK);
    assert_near(e->psf.flux_error, mean, 1e-12);
    rx_tile_facts_free(&facts);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_run_is_recorded_without_threads),
        cmocka_unit_test(cards_are_whole),
        cmocka_unit_test(history_is_lossless),
        cmocka_unit_test_setup_teardown(one_error_of_the_psf, make_scratch, remove_scratch),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
