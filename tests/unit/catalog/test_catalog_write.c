/* Every catalogue type: bytes of the text ones, what readers get back; what other programs make of them: tests/formats.sh. */
#include "../near.h"
#include "scene.h"

#include <locale.h>
#include <sys/stat.h>

#include "data/record.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "io/output.h"
#include "stage/pipeline.h"

static char *pairs[][3] = {{"RXVERS", "Rextract <&> \"test\"", "program"},
                           {"DETECT_MINAREA", "5", "pixels above threshold"},
                           {"FILTER", "Y", ""}};
static const rx_record record = {.n = 3, .pairs = pairs};

static const char param[] =
    "NUMBER\nX_IMAGE\nALPHA_J2000\nDELTA_J2000\nFLUX_APER(3)\nMAG_AUTO\nFLAGS\nVIGNET(3,2)\n";

static rx_catalog catalog_of(rx_catalog_type type, rx_table **tables, int n)
{
    return (rx_catalog){.type = type, .n = n, .tables = tables, .record = &record};
}

static rx_status write_all(rx_catalog_type type, const char *path, rx_table **tables, int n, rx_error *err)
{
    rx_outputs *outputs = NULL;
    const char *temporary = NULL;
    const rx_catalog catalog = catalog_of(type, tables, n);
    rx_status status = rx_outputs_new(&outputs, err);
    if (status == RX_OK)
        status = rx_outputs_file(outputs, path, &temporary, err);
    if (status == RX_OK)
        status = rx_catalog_write(&catalog, path, temporary, NULL, err);
    if (status == RX_OK)
        status = rx_outputs_commit(outputs, err);
    rx_outputs_free(outputs);
    return status;
}

/* Two extensions of three and two rows. */
typedef struct scene {
    rx_table *tables[2];
} scene;

static void begin(scene *s, int first, int second)
{
    for (int i = 0; i < 2; i++) {
        rx_sources *sources = scene_sources(i == 0 ? first : second);
        s->tables[i] = scene_table(param, sources);
        rx_sources_free(sources);
    }
}

static void end(scene *s)
{
    rx_table_free(s->tables[0]);
    rx_table_free(s->tables[1]);
}

static void ascii_head_is_laid_out_as_sextractors(void **state)
{
    scene s;
    begin(&s, 1, 2);
    assert_int_equal(write_all(RX_CATALOG_ASCII_HEAD, "out.cat", s.tables, 2, NULL), RX_OK);
    char *text = file_bytes("out.cat", NULL);
    const char *expected =
        "#   1 NUMBER                 Number of the source, from 1 in each extension            \n"
        "#   2 X_IMAGE                Barycentre, x                                              [pixel]\n"
        "#   3 ALPHA_J2000            Right ascension of the barycentre (J2000)                  [deg]\n"
        "#   4 DELTA_J2000            Declination of the barycentre (J2000)                      [deg]\n"
        "#   5 FLUX_APER              Flux in the circles of PHOT_APERTURES                      [count]\n"
        "#   8 MAG_AUTO               Magnitude in the elliptical Kron aperture                  [mag]\n"
        "#   9 FLAGS                  Extraction flags (sum of 1 to 128)                        \n"
        "#  10 VIGNET                 Pixels around the source, -1e30 where masked               [count]\n"
        "# RXVERS = Rextract <&> \"test\"\n"
        "# DETECT_MINAREA = 5\n"
        "# FILTER = Y\n"
        "         1     11.2500 150.1250000  -2.2500000          100          200          300  17.5000   0"
        "       -1e+30       -1e+30       -1e+30       -1e+30       -1e+30       -1e+30\n";
    assert_memory_equal(text, expected, strlen(expected));
    const char *rest = text + strlen(expected);
    int lines = 0;
    for (const char *c = rest; *c != '\0'; c++)
        lines += *c == '\n';
    assert_int_equal(lines, 2); /* the other extension, no second head */
    assert_memory_equal(rest, "         1 ", 11);
    free(text);
    end(&s);
}

static void skycat_has_its_frame(void **state)
{
    scene s;
    begin(&s, 2, 0);
    assert_int_equal(write_all(RX_CATALOG_ASCII_SKYCAT, "out.cat", s.tables, 1, NULL), RX_OK);
    char *text = file_bytes("out.cat", NULL);
    assert_memory_equal(text, "QueryResult\n\n# Config", 21);
    assert_non_null(strstr(text, "\nid\tra\tdec\tmag\tFLUX_APER\tMAG_AUTO\tFLAGS\tVIGNET\n---"));
    assert_non_null(strstr(text, "\n         1 \t    11.2500 \t"));
    assert_string_equal(text + strlen(text) - 6, "\n[EOD]");
    free(text);
    end(&s);
}

static void same_numbers(const rx_table *a, const rx_table *b, double tolerance)
{
    assert_int_equal(a->nrows, b->nrows);
    assert_int_equal(a->ncolumns, b->ncolumns);
    for (int i = 0; i < a->ncolumns; i++) {
        assert_string_equal(a->columns[i].name, b->columns[i].name);
        assert_int_equal(rx_column_elements(&a->columns[i]), rx_column_elements(&b->columns[i]));
        for (long row = 0; row < a->nrows; row++)
            for (long e = 0; e < rx_column_elements(&a->columns[i]); e++) {
                /* -1e30 of VIGNET is a float in one and a decimal number in the other. */
                const double expected = rx_column_value(&b->columns[i], row, e);
                assert_near(rx_column_value(&a->columns[i], row, e), expected,
                            tolerance + 1e-7 * fabs(expected));
            }
    }
}

static void what_is_written_reads_back(void **state)
{
    static const struct {
        rx_catalog_type type;
        double tolerance;
        int tables;
    } types[] = {{RX_CATALOG_ASCII_HEAD, 6e-5, 1},
                 {RX_CATALOG_VOTABLE, 0, 2},
                 {RX_CATALOG_FITS_1_0, 0, 2},
                 {RX_CATALOG_FITS_LDAC, 0, 2}};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        scene s;
        begin(&s, 3, 2);
        assert_int_equal(write_all(types[i].type, "out.cat", s.tables, types[i].tables, NULL), RX_OK);
        for (int k = 0; k < types[i].tables; k++) {
            rx_table *back = NULL;
            rx_error err = RX_ERROR_NONE;
            assert_int_equal(rx_catalog_read("out.cat", k, &back, &err), RX_OK);
            same_numbers(s.tables[k], back, types[i].tolerance);
            rx_table_free(back);
        }
        end(&s);
    }
}

static void no_source_is_a_catalogue_too(void **state)
{
    for (int type = RX_CATALOG_ASCII; type <= RX_CATALOG_FITS_LDAC; type++) {
        scene s;
        struct stat info;
        begin(&s, 0, 0);
        assert_int_equal(write_all((rx_catalog_type)type, "out.cat", s.tables, 1, NULL), RX_OK);
        assert_int_equal(stat("out.cat", &info), 0);
        rx_table *back = NULL;
        if (type == RX_CATALOG_ASCII_HEAD || type == RX_CATALOG_VOTABLE) {
            assert_int_equal(rx_catalog_read("out.cat", 0, &back, NULL), RX_OK);
            assert_int_equal(back->nrows, 0);
            assert_int_equal(back->ncolumns, 8);
        }
        rx_table_free(back);
        end(&s);
    }
}

static void a_decimal_comma_changes_nothing(void **state)
{
    char text_of[81];
    const char *found = setlocale(LC_ALL, "de_DE.UTF-8");
    if (found == NULL) { /* make one */
        if (system("localedef -i de_DE -f UTF-8 ./de_DE.UTF-8 >/dev/null 2>&1") == 0 &&
            setenv("LOCPATH", ((scratch *)*state)->folder, 1) == 0)
            found = setlocale(LC_ALL, "de_DE.UTF-8");
    }
    if (found == NULL) {
        print_message("no locale with a decimal comma is installed or can be made\n");
        skip();
    }
    snprintf(text_of, sizeof text_of, "%.1f", 1.5);
    assert_string_equal(text_of, "1,5");
    scene s;
    begin(&s, 1, 0);
    rx_table *back = NULL;
    assert_int_equal(write_all(RX_CATALOG_ASCII_HEAD, "out.cat", s.tables, 1, NULL), RX_OK);
    char *text = file_bytes("out.cat", NULL);
    assert_non_null(strstr(text, "11.2500"));
    assert_int_equal(rx_catalog_read("out.cat", 0, &back, NULL), RX_OK);
    assert_near(scene_value(back, "X_IMAGE", 0, 0), 11.25, 0);
    rx_table_free(back);
    free(text);
    rx_pipeline_params params; /* numbers of keywords, headers and facts */
    rx_record facts = {0};
    double value = 0;
    assert_int_equal(rx_pipeline_defaults(&params, NULL), RX_OK);
    assert_int_equal(rx_pipeline_set(&params, "DETECT_THRESH", "2.25", NULL), RX_OK);
    assert_near(params.detect.threshold, 2.25, 0);
    snprintf(text_of, sizeof text_of, "%-80s", "GAIN    =                 1.25");
    assert_true(rx_cards_number(text_of, 1, "GAIN", &value));
    assert_near(value, 1.25, 0);
    rx_text card = {0};
    rx_card_number(&card, "GAIN", 1.25, "");
    assert_non_null(strstr(card.data, " 1.25 "));
    rx_text_free(&card);
    rx_record_add(&facts, "RXGAIN", "", "%.2f", 1.25);
    assert_string_equal(facts.pairs[0][1], "1.25");
    rx_record_free(&facts);
    setlocale(LC_ALL, "C");
    unsetenv("LOCPATH");
    end(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ascii_head_is_laid_out_as_sextractors),
        cmocka_unit_test(skycat_has_its_frame),
        cmocka_unit_test(what_is_written_reads_back),
        cmocka_unit_test(no_source_is_a_catalogue_too),
        cmocka_unit_test(a_decimal_comma_changes_nothing),
    };
    return cmocka_run_group_tests(tests, enter_scratch, leave_scratch);
}
