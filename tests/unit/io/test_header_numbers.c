/* Numbers of headers as archives and pipelines write them, and what is said of those that are none. */
#include "tile_test.h"

#include "../near.h"
#include "base/log.h"
#include "io/cards.h"

static void keep(void *user, rx_log_kind kind, const char *text)
{
    rx_text_printf(user, "%s%s\n", kind == RX_LOG_WARNING ? "warning: " : "", text);
}

/* The tile with those cards, read with the default keywords of the configuration but for *par; *said: all messages. */
static rx_tile *tile_of(void **state, const rx_tile_params *par, const char *cards, rx_text *said)
{
    rx_log log;
    rx_tile *tile = NULL;
    rx_error err = RX_ERROR_NONE;
    rx_log_calls(&log, RX_NORMAL, keep, NULL, said);
    make_ramp(in(state, "a.fits"), 16, cards);
    assert_int_equal(rx_tile_read(par, in(state, "a.fits"), 0, 1, &log, &tile, &err), RX_OK);
    rx_text_add(said, "");
    return tile;
}

static const rx_tile_params DEFAULTS = {.weight_threshold = NAN,
                                        .gain_key = "GAIN",
                                        .saturation = 50000,
                                        .saturation_key = "SATURATE",
                                        .zeropoint_key = ""};

static int count_of(const char *text, const char *word)
{
    int n = 0;
    for (const char *c = strstr(text, word); c != NULL; c = strstr(c + 1, word))
        n++;
    return n;
}

static void test_units(void **state)
{
    static const char *const units[][2] = {{"e-/ADU", "e/adu"},
                                           {"e/DN", "e/adu"},
                                           {"electrons per count", "e/adu"},
                                           {"[e-/ADU]", "e/adu"},
                                           {"ELECTRONS/S", "e/s"},
                                           {"electron s-1", "e/s"},
                                           {"e- s**-1", "e/s"},
                                           {"counts/sec", "adu/s"},
                                           {"cps", "adu/s"},
                                           {"MJy/sr", "MJy/sr"},
                                           {"mJy", "mJy"},
                                           {"nanomaggy", "nmgy"},
                                           {"(mag)", "mag"},
                                           {"ADU", "adu"},
                                           {"deg / pixel", "deg/pix"},
                                           {"", ""},
                                           {"h30m", ""},
                                           {"ADU/e-", "adu/e"},
                                           {"erg/s/cm2", ""},
                                           {"e- e-", ""},
                                           {"/", ""},
                                           {"-", ""},
                                           {"s-1-1", ""},
                                           {"1", ""},
                                           {"electronsandmuchmore", ""}};
    char spelling[RX_UNIT_TEXT];
    for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
        rx_unit_spelling(units[i][0], spelling);
        assert_string_equal(spelling, units[i][1]);
    }
}

static void test_gains(void **state)
{
    static const struct {
        const char *card;
        double gain;
        const char *said; /* "": no warning */
    } cases[] = {
        {"GAIN    = 1.7", 1.7, ""},
        {"GAIN    = '1.7     '", 1.7, ""},
        {"GAIN    = '1.7 e-/ADU'", 1.7, ""},
        {"GAIN    = 1.7 e-/ADU / conversion", 1.7, ""},
        {"GAIN    = '1.7e-/DN'", 1.7, ""},
        {"GAIN    = 1.7/e-/ADU", 1.7, ""},
        {"GAIN    = 1.7D0", 1.7, ""},
        {"GAIN    = '+.17D+01 [electron/ADU]'", 1.7, ""},
        {"HIERARCH GAIN = 1.7", 1.7, ""},
        {"GAIN    = '1.7 ADU/e-'", 0, "GAIN = '1.7 ADU/e-' is no number in e-/ADU"},
        {"GAIN    = '1.7 2.1'", 0, "GAIN = '1.7 2.1' is no number"},
        {"GAIN    = '1,7'", 0, "GAIN = '1,7' is no number"},
        {"GAIN    = 1,7", 0, "GAIN = '1,7' is no number"},
        {"GAIN    = NaN", 0, "GAIN = 'NaN' is no number"},
        {"GAIN    = Inf", 0, "GAIN = 'Inf' is no number"},
        {"GAIN    = 1E999", 0, "GAIN = '1E999' is no number"},
        {"GAIN    = 0x10", 0, "GAIN = '0x10' is no number"},
        {"GAIN    = '00:01:42'", 0, "GAIN = '00:01:42' is no number"},
        {"GAIN    = 'HIGH'", 0, "GAIN = 'HIGH' is no number"},
        {"GAIN    = T", 0, "GAIN = 'T' is no number"},
        {"GAIN    = ''", 0, "GAIN = '' is no number"},
        {"GAIN    =                      / e-/ADU", 0, "GAIN has no value"},
        {"GAIN    = 1.7\nGAIN    = 3.4", 1.7, "GAIN is there twice, 1.7 and 3.4"},
        {"GAIN    = 1.7\nGAIN    = 1.70", 1.7, ""},
        {"GAIN    = -2", 0, "GAIN = -2 is no gain"},
        {"GAINMODE= 'slow'\nGAINA   = 3.7\nGAINB   = 4.1", 3.7,
         ""}, /* the first number whose key begins so */
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        rx_text said = {0};
        rx_tile *tile = tile_of(state, &DEFAULTS, cases[i].card, &said);
        if (strstr(said.data, cases[i].said) == NULL)
            print_message("%s: %s\n", cases[i].card, said.data);
        assert_near(tile->gain, cases[i].gain, 1e-15);
        assert_int_equal(count_of(said.data, "warning: "), cases[i].said[0] != '\0');
        assert_non_null(strstr(said.data, cases[i].said));
        rx_text_free(&said);
        rx_tile_free(tile);
    }
}

static void test_others(void **state)
{
    rx_text said = {0};
    rx_tile_params par = DEFAULTS;
    par.zeropoint_key = "MAGZPT";
    rx_tile *tile = tile_of(
        state, &par, "SATURATE= '590 ADU'\nMAGZPT  = '25.5 mag'\nEXPTIME = '300.0 s'\nGAIN    = 1", &said);
    assert_near(tile->saturation, 590, 0);
    assert_near(tile->zeropoint, 25.5, 0);
    assert_near(tile->exptime, 300, 0);
    assert_string_equal(said.data, "");
    rx_tile_free(tile);
    tile =
        tile_of(state, &par, "SATURATE= '65 kADU'\nMAGZPT  = '25,5'\nEXPTIME = '5 min'\nGAIN    = 1", &said);
    assert_near(tile->saturation, 50000, 0);
    assert_near(tile->zeropoint, 0, 0);
    assert_near(tile->exptime, 0, 0);
    assert_int_equal(count_of(said.data, "warning: "), 3);
    rx_tile_free(tile);
    rx_text_free(&said);
}

/* A card that is named must be there; those that SExtractor's files name need not. */
static void test_named_cards(void **state)
{
    rx_text said = {0};
    rx_tile_params par = DEFAULTS;
    par.gain = 2;
    par.zeropoint = 25;
    rx_tile_free(tile_of(state, &par, "", &said));
    assert_string_equal(said.data, "");
    par.gain_key = "NONE";
    rx_tile *tile = tile_of(state, &par, "GAIN    = 4", &said);
    assert_near(tile->gain, 2, 0);
    assert_string_equal(said.data, "");
    rx_tile_free(tile);
    par.gain_key = "EGAIN";
    par.saturation_key = "WELL";
    par.zeropoint_key = "MAGZPT";
    tile = tile_of(state, &par, "GAIN    = 4", &said);
    assert_near(tile->gain, 2, 0);
    assert_int_equal(count_of(said.data, "warning: "), 3);
    assert_non_null(strstr(said.data, "no EGAIN, the card that was named; GAIN 2 is taken"));
    assert_non_null(strstr(said.data, "no WELL, the card that was named; SATUR_LEVEL 50000 is taken"));
    assert_non_null(strstr(said.data, "no MAGZPT, the card that was named; MAG_ZEROPOINT 25 is taken"));
    rx_tile_free(tile);
    rx_text_free(&said);
}

/* Zero points of archives, and gains of pixels that are not in ADU. */
static void test_hints(void **state)
{
    static const struct {
        const char *cards, *said;
    } cases[] = {
        {"GAIN    = 4\nMAGZERO = 31.2", "header's MAGZERO 31.2; MAG_ZEROPOINT_KEY MAGZERO takes it"},
        {"GAIN    = 4\nMAGZPT  = 23.9", "header's MAGZPT 23.9; MAG_ZEROPOINT_KEY"},
        {"GAIN    = 4\nPHOTZP  = '25.1 mag'", "header's PHOTZP 25.1; MAG_ZEROPOINT_KEY"},
        {"GAIN    = 4\nHIERARCH FPA.ZP = 24.5", "header's FPA.ZP 24.5; MAG_ZEROPOINT_KEY"},
        {"GAIN    = 4\nFLUXMAG0= 63095734448.0194", "by the header's FLUXMAG0 it is 27.0000"},
        /* ACS F814W: AB 25.94 (for one electron a second) */
        {"PHOTFLAM= 7.0331885E-20\nPHOTPLAM= 8047.4707\nPHOTZPT = -21.1\nBUNIT   = 'ELECTRONS/S'",
         "by the header's PHOTFLAM and PHOTPLAM it is 25.945"},
        {"PHOTFLAM= 7.0331885E-20\nPHOTPLAM= 8047.4707\nEXPTIME = 100\nBUNIT   = 'ELECTRONS'",
         "by the header's PHOTFLAM and PHOTPLAM it is 30.945"},
        {"BUNIT   = 'nanomaggy'", "by the header's nanomaggy it is 22.5000"},
        {"BUNIT   = 'nJy     '", "by the header's nJy it is 31.4001"},
        {"BUNIT   = 'MJy/sr  '\nPIXAR_SR= 2.29E-14", "by the header's MJy/sr it is 28.000"},
        {"", "no gain: errors leave out the photon noise of sources; give GAIN"},
        {"EGAIN   = 1.3", "give GAIN 1.3 (EGAIN)"},
        {"HIERARCH ESO DET OUT1 CONAD = 2.2", "give GAIN 2.2 (ESO DET OUT1 CONAD)"},
        {"HIERARCH CELL.GAIN = 1.1", "give GAIN 1.1 (CELL.GAIN)"},
        {"BUNIT   = 'electron'", "give GAIN 1"},
        {"BUNIT   = 'electron/s'\nEXPTIME = 900", "give GAIN 900 (EXPTIME)"},
        {"BUNIT   = 'electron/s'\nEXPTIME = 900\nGAIN    = 1.5",
         "a.fits[0]: GAIN = 1.5 is per ADU, the pixels are in electron/s; give GAIN_KEY NONE and GAIN 900"},
        {"BUNIT   = 'electrons'\nGAIN    = 4.4", "pixels are in electrons; give GAIN_KEY NONE and GAIN 1"},
        {"BUNIT   = 'ADU/s'\nEXPTIME = 10\nGAIN    = 2", "give GAIN_KEY NONE and GAIN 20 (GAIN x EXPTIME)"},
        {"BUNIT   = 'nanomaggy'\nGAIN    = 4.7", "give GAIN_KEY NONE and GAIN in electrons per that unit"},
    };
    static const char *const silent[] = {"BUNIT   = 'ADU'\nGAIN    = 2",
                                         "BUNIT   = 'electrons'\nGAIN    = 1.0",
                                         "BUNIT   = 'e-/s'\nGAIN    = 90\nEXPTIME = 90.0",
                                         "BUNIT   = 'counts/s'\nGAIN    = 2\nEXPTIME = 1",
                                         "BUNIT   = 'furlong'\nGAIN    = 2",
                                         "GAIN    = 2\nPHOTZP  = 0\nMAGZPT  = 'none'"};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        rx_text said = {0};
        rx_tile_free(tile_of(state, &DEFAULTS, cases[i].cards, &said));
        if (strstr(said.data, cases[i].said) == NULL)
            print_message("%s: %s\n", cases[i].cards, said.data);
        assert_non_null(strstr(said.data, cases[i].said));
        rx_text_free(&said);
    }
    for (size_t i = 0; i < sizeof silent / sizeof *silent; i++) {
        rx_text said = {0};
        rx_tile_free(tile_of(state, &DEFAULTS, silent[i], &said));
        assert_string_equal(said.data, "");
        rx_text_free(&said);
    }
    rx_tile_params par = DEFAULTS; /* what is given needs no hint */
    rx_text said = {0};
    par.gain = 2;
    par.zeropoint = 25;
    rx_tile_free(tile_of(state, &par, "MAGZERO = 31.2\nEGAIN   = 1", &said));
    assert_string_equal(said.data, "");
    rx_text_free(&said);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_units), cmocka_unit_test(test_gains),
                                       cmocka_unit_test(test_others), cmocka_unit_test(test_named_cards),
                                       cmocka_unit_test(test_hints)};
    return cmocka_run_group_tests_name("header numbers", tests, make_scratch, remove_scratch);
}
