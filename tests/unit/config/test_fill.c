/* From values of keywords to fields, whatever the kind and the type, on a struct made for it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <string.h>

#include "../near.h"
#include "config/config.h"
#include "config/fill.h"

enum { PLAIN = 7, HEAD = 11, LOW = 1, HIGH = 2 };
typedef enum tint { RED, GREEN, BLUE } tint;

typedef struct things {
    int format, low, high, width, height, third, last, not_first, not_second, naper, nflags;
    tint mask;
    long stack;
    uint64_t seed;
    double beta, threshold, least[2], apertures[3];
    bool clean;
    const char *name, *second, *unit;
} things;

#define INTO(how, field) RX_FILL(things, how, field)

/* As keys.def's rows become rows; behind each the default of the keyword. */
static const rx_fill rows[] = {
    {.keyword = "CATALOG_TYPE", .words = (const int[]){0, PLAIN, HEAD, 0, 0, 0, 0, 0}}, /* ASCII_HEAD */
    INTO(VALUE, format),
    {.keyword = "DETECT_TYPE", .words = (const int[]){LOW, LOW | HIGH}}, /* CCD */
    INTO(BIT(LOW), low),
    INTO(BIT(HIGH), high),
    {.keyword = "MASK_TYPE", .words = (const int[]){RED, GREEN, BLUE}}, /* CORRECT */
    INTO(VALUE, mask),
    {.keyword = "BACK_SIZE"}, /* 64 */
    INTO(ITEM(0), width),
    INTO(ITEM(1), height),
    {.keyword = "ASSOC_PARAMS"}, /* 2,3,4 */
    INTO(GIVEN(2), third),
    INTO(ITEM(2), last),
    {.keyword = "RESCALE_WEIGHTS"}, /* Y */
    INTO(NOT(0), not_first),
    INTO(NOT(1), not_second),
    {.keyword = "MEMORY_PIXSTACK"},
    INTO(VALUE, stack), /* 300000 */
    {.keyword = "SEED"},
    INTO(VALUE, seed), /* 1 */
    {.keyword = "PSF_BETA"},
    INTO(VALUE, beta),
    RX_FILL_NOTHING, /* 4.765 */
    {.keyword = "DETECT_THRESH"},
    INTO(ITEM(0), threshold), /* 1.5 */
    {.keyword = "WEIGHT_THRESH"},
    INTO(ITEM(0), least[0]),
    INTO(ITEM(1), least[1]), /* none */
    {.keyword = "PHOT_APERTURES"},
    INTO(ALL, apertures),
    INTO(COUNT, naper), /* 5 */
    {.keyword = "FLAG_IMAGE"},
    INTO(COUNT, nflags), /* flag.fits */
    {.keyword = "CLEAN"},
    INTO(VALUE, clean), /* Y */
    {.keyword = "CATALOG_NAME"},
    INTO(VALUE, name), /* test.cat */
    {.keyword = "PSF_NAME"},
    INTO(ITEM(1), second), /* default.psf */
    {.keyword = "MATCH_UNIT"},
    INTO(VALUE, unit), /* PIXEL */
    {.keyword = "MAG_GAMMA"},
};
enum { ROWS = sizeof rows / sizeof rows[0] };

/* What was there before is -1 or 9, so that a field left alone shows. */
static things filled(const char *const *pairs)
{
    things t;
    rx_settings *settings = NULL;
    memset(&t, -1, sizeof t);
    t.least[0] = t.least[1] = t.apertures[1] = t.apertures[2] = 9;
    assert_int_equal(rx_settings_new(rx_keytable_rextract(), &settings, NULL), RX_OK);
    for (; *pairs != NULL; pairs += 2)
        assert_int_equal(rx_settings_set(settings, pairs[0], pairs[1], NULL, NULL), RX_OK);
    rx_fill_all(rows, ROWS, settings, &t);
    assert_string_equal(t.name, "test.cat"); /* the text goes with the settings */
    assert_string_equal(t.second, "default.psf");
    assert_string_equal(t.unit, "PIXEL");
    rx_settings_free(settings);
    return t;
}

static void every_type_takes_its_value(void **state)
{
    (void)state;
    const things t = filled((const char *const[]){NULL});
    assert_int_equal(t.format, HEAD);
    assert_int_equal(t.low, 1);
    assert_int_equal(t.high, 0);
    assert_int_equal(t.mask, BLUE);
    assert_int_equal(t.stack, 300000);
    assert_int_equal(t.seed, 1);
    assert_near(t.beta, 4.765, 0);
    assert_near(t.threshold, 1.5, 0);
    assert_int_equal(t.clean, true);
    const things other = filled((const char *const[]){"DETECT_TYPE", "PHOTO", "CLEAN", "N", "SEED",
                                                      "2147483647", "CATALOG_TYPE", "ascii", NULL});
    assert_int_equal(other.format, PLAIN);
    assert_int_equal(other.high, 1);
    assert_int_equal(other.clean, false);
    assert_int_equal(other.seed, 2147483647);
}

static void items_of_lists(void **state)
{
    (void)state;
    things t = filled((const char *const[]){NULL});
    assert_int_equal(t.width, 64);
    assert_int_equal(t.height, 64); /* the last item stands for those behind it */
    assert_int_equal(t.third, 4);
    assert_int_equal(t.not_first, 0);
    assert_near(t.least[0], 9, 0); /* none is given */
    assert_near(t.least[1], 9, 0);
    assert_int_equal(t.naper, 1);
    assert_int_equal(t.nflags, 1);
    assert_near(t.apertures[0], 5, 0);
    assert_near(t.apertures[1], 9, 0);
    t = filled((const char *const[]){"BACK_SIZE", "32,48", "ASSOC_PARAMS", "6,7", "RESCALE_WEIGHTS", "Y,N",
                                     "WEIGHT_THRESH", "3", "PHOT_APERTURES", "1,2,3,4", "FLAG_IMAGE", "",
                                     NULL});
    assert_int_equal(t.width, 32);
    assert_int_equal(t.height, 48);
    assert_int_equal(t.third, -1); /* not given, not repeated */
    assert_int_equal(t.last, 7);
    assert_int_equal(t.not_first, 0);
    assert_int_equal(t.not_second, 1);
    assert_near(t.least[1], 3, 0);
    assert_int_equal(t.naper, 4);
    assert_int_equal(t.nflags, 0);
    for (int i = 0; i < 3; i++) /* no room for the fourth, and nothing is behind it that changed */
        assert_near(t.apertures[i], i + 1, 0);
    assert_int_equal(t.clean, true);
}

static rx_status set(things *t, const char *name, const char *value, rx_error *err)
{
    rx_settings *settings = NULL;
    err->text[0] = '\0';
    assert_int_equal(rx_settings_new(rx_keytable_rextract(), &settings, NULL), RX_OK);
    assert_int_equal(rx_settings_set(settings, name, value, NULL, NULL), RX_OK);
    rx_status status = rx_fill_one(rows, ROWS, settings, name, t, err);
    rx_settings_free(settings);
    return status;
}

static void one_keyword_alone(void **state)
{
    (void)state;
    rx_error err;
    things t = {.width = 5, .height = 6, .beta = 3};
    assert_int_equal(set(&t, "detect_thresh", "2.5", &err), RX_OK);
    assert_near(t.threshold, 2.5, 0);
    assert_int_equal(t.width, 5);
    assert_near(t.beta, 3, 0);
    assert_int_equal(t.naper, 0);
    assert_int_equal(set(&t, "BACK_SIZE", "7", &err), RX_OK);
    assert_int_equal(t.height, 7);
    assert_int_equal(set(&t, "CATALOG_TYPE", "ASCII_HEAD", &err), RX_OK);
    assert_int_equal(t.format, HEAD);
}

static void what_cannot_be_set(void **state)
{
    static const struct {
        const char *name, *value, *text;
    } cases[] = {
        {"DETECT_THRESH", "22.5,25", "2 items are given, at most 1 are taken here"},
        {"PHOT_APERTURES", "1,2,3,4", "4 items are given, at most 3 are taken here"},
        {"MAG_GAMMA", "2", "MAG_GAMMA sets none of these parameters"}, /* a row without fields */
        {"CATALOG_NAME", "x", "CATALOG_NAME sets none of these"},      /* the text would not last */
        {"GAIN", "2", "GAIN sets none of these parameters"},           /* no row */
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        rx_error err;
        things t, before;
        memset(&t, 3, sizeof t);
        memcpy(&before, &t, sizeof t);
        assert_int_equal(set(&t, cases[i].name, cases[i].value, &err), RX_USAGE);
        if (strstr(err.text, cases[i].text) == NULL)
            fail_msg("%s %s: %s", cases[i].name, cases[i].value, err.text);
        assert_memory_equal(&t, &before, sizeof t);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_type_takes_its_value),
        cmocka_unit_test(items_of_lists),
        cmocka_unit_test(one_keyword_alone),
        cmocka_unit_test(what_cannot_be_set),
    };
    return cmocka_run_group_tests_name("fill", tests, NULL, NULL);
}
