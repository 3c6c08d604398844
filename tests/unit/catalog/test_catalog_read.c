/* Reference catalogues as they come, and as they should not come. */
#include "../near.h"
#include "scene.h"

static rx_status read_text(const char *text, int index, rx_table **table, rx_error *err)
{
    write_text("reference", text);
    rx_status status = rx_catalog_read("reference", index, table, err);
    return status;
}

static rx_table *good(const char *text)
{
    rx_table *table = NULL;
    rx_error err = RX_ERROR_NONE;
    assert_int_equal(read_text(text, 0, &table, &err), RX_OK);
    return table;
}

static void head_of_sextractor(void **state)
{
    rx_table *t =
        good("#   1 NUMBER                 Running object number\n"
             "#   2 FLUX_APER              Flux vector [of sorts]                   [count]\n"
             "#   5 MU_MAX                 Peak                                     [mag * arcsec**(-2)]\n"
             "         1        1.5 2.5 -3e2  99.0\r\n"
             "\n"
             "         2        1 2 3  nan\n");
    assert_int_equal(t->ncolumns, 3);
    assert_int_equal(t->nrows, 2);
    assert_string_equal(t->columns[1].unit, "count");
    assert_string_equal(t->columns[2].unit, "mag * arcsec**(-2)");
    assert_int_equal(t->columns[0].type, RX_CELL_INT64);
    assert_int_equal(rx_column_elements(&t->columns[1]), 3);
    assert_near(scene_value(t, "FLUX_APER", 0, 2), -300, 0);
    assert_true(isnan(scene_value(t, "MU_MAX", 1, 0)));
    rx_table_free(t);
}

static void names_from_a_comment_or_a_first_line(void **state)
{
    static const char *const texts[] = {"# made by hand\n# x y mag\n1 2 20.5\n3 4 21\n",
                                        "x,y,mag\n1,2,20.5\n3,4,21\n", "#x, y, mag\n1, 2, 20.5\n3, 4, 21\n",
                                        "x y mag\n1 2 20.5\n3 4 21",
                                        "\"x\" \"y\" \"mag\"\n\t1 2\t20.5\n3 4 21\n# end\n"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        rx_table *t = good(texts[i]);
        assert_int_equal(t->nrows, 2);
        assert_int_equal(t->ncolumns, 3);
        assert_near(scene_value(t, "x", 1, 0), 3, 0);
        assert_near(scene_value(t, "mag", 0, 0), 20.5, 0);
        rx_table_free(t);
    }
    rx_table *t = good("1 2\n3 4\n");
    assert_near(scene_value(t, "col2", 1, 0), 4, 0);
    rx_table_free(t);
}

/* A comment behind the line of names does not make a row of it, which had no room. */
static void a_comment_behind_the_names_changes_nothing(void **state)
{
    rx_table *t = good("name,a rather long name of a column\n# 1 NUMBER or not\nb c,1\n");
    assert_int_equal(t->nrows, 1);
    assert_int_equal(t->ncolumns, 2);
    assert_string_equal(t->columns[0].name, "name");
    assert_string_equal((char *)t->columns[0].data, "b c");
    rx_table_free(t);
}

static void cells_of_text_and_nothing(void **state)
{
    rx_table *t = good("id,name,mag,n\n1,\"M 31, the nebula\",3.4,\n2,,--,7\n");
    assert_int_equal(t->columns[1].type, RX_CELL_TEXT);
    assert_string_equal((char *)t->columns[1].data, "M 31, the nebula");
    assert_string_equal((char *)t->columns[1].data + t->columns[1].text_width, "");
    assert_true(isnan(scene_value(t, "mag", 1, 0)));
    assert_true(isnan(scene_value(t, "n", 0, 0)));
    assert_near(scene_value(t, "n", 1, 0), 7, 0);
    rx_table_free(t);
}

static void large_identifiers_keep_their_digits(void **state)
{
    rx_table *t = good("# objid\n1237678617402605705\n");
    assert_int_equal(((int64_t *)t->columns[0].data)[0], 1237678617402605705LL);
    rx_table_free(t);
}

#define VOTABLE(fields, rows)                                                                                \
    "<?xml version='1.0'?>\n<!-- c --><v:VOTABLE "                                                           \
    "xmlns:v='http://www.ivoa.net/xml/VOTable/v1.3'><v:RESOURCE><v:TABLE "                                   \
    "name='t'>" fields "<v:DATA><v:TABLEDATA>" rows                                                          \
    "</v:TABLEDATA></v:DATA></v:TABLE></v:RESOURCE></v:VOTABLE>\n"
#define FIELD(name, type) "<v:FIELD name='" name "' datatype='" type "'/>"

static void votables_of_others(void **state)
{
    rx_table *t = good(VOTABLE(
        "<v:FIELD name='id' datatype='long'><v:VALUES null='-1'/></v:FIELD>"
        "<v:FIELD name='ra' datatype='double' unit='deg' ucd='pos.eq.ra'><v:DESCRIPTION>a &amp; "
        "b</v:DESCRIPTION>"
        "</v:FIELD><v:FIELD name='s' datatype='char' arraysize='*'/><v:FIELD name='m' datatype='float' "
        "arraysize='2x2'/><v:FIELD name='b' datatype='boolean'/><v:FIELD name='big' datatype='long'/>",
        "<v:TR><v:TD>-1</v:TD><v:TD> 1.5 </v:TD><v:TD>x&lt;<![CDATA[&y]]></v:TD><v:TD>1 2 "
        "3</v:TD><v:TD>T</v:TD>"
        "<v:TD>1237678617402605705</v:TD></v:TR>"
        "<v:TR><v:TD>010</v:TD><v:TD/><v:TD></v:TD><v:TD/><v:TD>false</v:TD><v:TD>0x10</v:TD></v:TR>"));
    assert_string_equal(t->name, "t");
    assert_int_equal(t->nrows, 2);
    assert_true(isnan(scene_value(t, "id", 0, 0)));
    assert_near(scene_value(t, "id", 1, 0), 10, 0);
    assert_near(scene_value(t, "ra", 0, 0), 1.5, 0);
    assert_true(isnan(scene_value(t, "ra", 1, 0)));
    assert_string_equal(t->columns[1].unit, "deg");
    assert_string_equal(t->columns[1].description, "a & b");
    assert_string_equal((char *)t->columns[2].data, "x<&y");
    assert_near(scene_value(t, "m", 0, 2), 3, 0);
    assert_true(isnan(scene_value(t, "m", 0, 3)));
    assert_near(scene_value(t, "b", 0, 0), 1, 0);
    assert_int_equal(((int64_t *)t->columns[5].data)[0], 1237678617402605705LL);
    assert_near(scene_value(t, "big", 1, 0), 16, 0);
    rx_table_free(t);
}

/* Streams of two rows that astropy reads so. */
#define STREAM(kind, stream)                                                                                 \
    "<VOTABLE><TABLE><FIELD name='id' datatype='long'/><FIELD name='ra' datatype='double'/><FIELD "          \
    "name='mag' datatype='float'/><FIELD name='n' datatype='short'><VALUES null='-99'/></FIELD><FIELD "      \
    "name='b' datatype='boolean'/><FIELD name='u' datatype='unsignedByte'/><FIELD name='s' datatype='char' " \
    "arraysize='*'/><FIELD name='w' datatype='unicodeChar' arraysize='2'/><FIELD name='v' datatype='float' " \
    "arraysize='*'/><FIELD name='m' datatype='float' arraysize='2x2'/><DATA><" kind                          \
    "><STREAM encoding='base64'>\n" stream "\n</STREAM></" kind "></DATA></TABLE></VOTABLE>"
static const char BINARY[] = STREAM(
    "BINARY",
    "ES0eJSBhAIlAYsgAAAAAAEGkAAD/+VTIAAAABE0gMzEAYQBiAAAAAz+AAABAAAAAQEAAAD+AAABAAAAAQEAAAECAAAD//////////"
    "b/gAAAAAAAAQaoAAP+dPwAAAAAAAGMAZAAAAABAoAAAQMAAAEDgAABBAAAA");
static const char BINARY2[] =
    STREAM("BINARY2", "AAARLR4lIGEAiUBiyAAAAAAAQaQAAP/5VMgAAAAETSAzMQBhAGIAAAADP4AAAEAAAABAQAAAP4AAAEAAAABA\n"
                      "QAAAQIAAALAA//////////2/4AAAAAAAAEGqAAD/nT8AAAAAAABjAGQAAAAAQKAAAEDAAABA4AAAQQAAAA==");

static void binary_streams(void **state)
{
    for (int nulls = 0; nulls < 2; nulls++) {
        rx_table *t = good(nulls ? BINARY2 : BINARY);
        assert_int_equal(t->nrows, 2);
        if (nulls) {
            assert_true(isnan(scene_value(t, "id", 1, 0)));
            assert_true(isnan(scene_value(t, "mag", 1, 0)));
        } else {
            assert_int_equal(((int64_t *)t->columns[0].data)[0], 1237678617402605705LL);
            assert_int_equal(((int64_t *)t->columns[0].data)[1], -3);
            assert_near(scene_value(t, "mag", 1, 0), 21.25, 0);
        }
        assert_near(scene_value(t, "ra", 0, 0), 150.25, 0);
        assert_near(scene_value(t, "ra", 1, 0), -0.5, 0);
        assert_near(scene_value(t, "n", 0, 0), -7, 0);
        assert_true(isnan(scene_value(t, "n", 1, 0)));
        assert_near(scene_value(t, "b", 0, 0), 1, 0);
        assert_true(isnan(scene_value(t, "b", 1, 0)));
        assert_near(scene_value(t, "u", 0, 0), 200, 0);
        assert_string_equal((char *)t->columns[6].data, "M 31");
        assert_string_equal((char *)t->columns[6].data + t->columns[6].text_width, "");
        assert_string_equal((char *)t->columns[7].data + t->columns[7].text_width, "cd");
        assert_string_equal((char *)t->columns[8].data, ""); /* its length varies */
        assert_near(scene_value(t, "m", 1, 3), 8, 0);
        rx_table_free(t);
    }
}

/* Every stream that ends early is refused, or ends with a row. */
static void binary_streams_cut_short(void **state)
{
    const size_t begin = (size_t)(strstr(BINARY2, "\nAAAR") - BINARY2) + 1,
                 end = (size_t)(strstr(BINARY2, "==") - BINARY2);
    for (size_t cut = begin; cut < end; cut++) {
        char text[sizeof BINARY2];
        rx_table *t = NULL;
        snprintf(text, sizeof text, "%.*s%s", (int)cut, BINARY2, strstr(BINARY2, "</STREAM>"));
        const rx_status status = read_text(text, 0, &t, NULL);
        if (status == RX_OK)
            assert_in_range(t->nrows, 0, 1);
        else
            assert_int_equal(status, RX_INPUT);
        rx_table_free(t);
    }
}

static void many_rows_of_a_votable(void **state)
{
    rx_text text = {0};
    rx_text_add(&text, "<VOTABLE><TABLE><FIELD name='other' datatype='int'/></TABLE><TABLE><FIELD name='n' "
                       "datatype='int'/><FIELD name='s' datatype='char' arraysize='*'/><DATA><TABLEDATA>");
    for (int i = 0; i < 5000; i++)
        rx_text_printf(&text, "<TR><TD>%d</TD><TD>name %d</TD></TR>\n", i, i);
    rx_text_add(&text, "</TABLEDATA></DATA></TABLE></VOTABLE>");
    rx_table *t = NULL;
    assert_int_equal(read_text(text.data, 1, &t, NULL), RX_OK);
    assert_int_equal(t->nrows, 5000);
    assert_near(scene_value(t, "n", 4321, 0), 4321, 0);
    assert_string_equal((char *)t->columns[1].data + 4321 * t->columns[1].text_width, "name 4321");
    rx_table_free(t);
    rx_text_free(&text);
}

static void what_is_no_catalogue(void **state)
{
    static const struct {
        const char *text, *says;
        long line;
    } bad[] = {
        {"", "is empty", 0},
        {"\n\n", "holds no table", 0},
        {"1 2 3\n1 2\n", "2 values", 2},
        {"# 1 A a\n# 2 B b\n# 3 C c\n1 2\n", "head numbers 3", 0},
        {"# a,b\n1,2\n1,2,\n", "3 values", 3},
        {"<VOTABLE>", "XML", 1},
        {"<VOTABLE/>", "holds 0", 0},
        {"<html><body>Not found</body></html>", "holds 0", 0},
        {"<VOTABLE><TABLE></VOTABLE>", "XML", 1},
        {"<VOTABLE><TABLE></TABLE></VOTABLE>", "no FIELD", 0},
        {"<!DOCTYPE x [<!ENTITY a 'aaaaaaaa'>]><VOTABLE/>", "entities", 1},
        {VOTABLE(FIELD("a", "int"), "<v:TR><v:TD>1</v:TD><v:TD>2</v:TD></v:TR>"), "more cells", 2},
        {VOTABLE(FIELD("a", "int") FIELD("b", "int"), "<v:TR><v:TD>1</v:TD></v:TR>"), "fewer cells", 2},
        {VOTABLE(FIELD("a", "int"), "<v:TR><v:TD>one</v:TD></v:TR>"), "hold a number", 2},
        {VOTABLE(FIELD("a", "int"), "<v:TR><v:TD>99999999999999999999</v:TD></v:TR>"), "hold a number", 2},
        {VOTABLE(FIELD("a", "float"), "<v:TR><v:TD>1 2</v:TD></v:TR>"), "more numbers", 2},
        {VOTABLE(FIELD("a", "int"), "<v:TD>1</v:TD>"), "no row", 2},
        {VOTABLE(FIELD("a", "int"), "<v:TR><v:TR/></v:TR>"), "within a row", 2},
        {VOTABLE(FIELD("a", "int"), "<v:TR><v:TD>1</v:TD></v:TR>" FIELD("b", "int")), "behind the data", 2},
        {VOTABLE(FIELD("a", "int"), "<v:TABLE/>"), "within a TABLE", 2},
        {"<VOTABLE><TABLE><FIELD name='a' "
         "datatype='int'/><DATA><BINARY><STREAM/></BINARY></DATA></TABLE></VOTABLE>",
         "TABLEDATA", 1},
        {"<VOTABLE><TABLE><FIELD name='a' datatype='bit'/><DATA><BINARY><STREAM "
         "encoding='base64'>AAAA</STREAM></BINARY></DATA></TABLE></VOTABLE>",
         "TABLEDATA", 1},
        {"<VOTABLE><TABLE><FIELD name='a' datatype='int'/><DATA><BINARY><STREAM "
         "encoding='base64'>AA?A</STREAM></BINARY></DATA></TABLE></VOTABLE>",
         "base64", 1},
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        rx_table *table = NULL;
        rx_error err = RX_ERROR_NONE;
        assert_int_equal(read_text(bad[i].text, 0, &table, &err), RX_INPUT);
        assert_null(table);
        if (strstr(err.text, bad[i].says) == NULL || err.line != bad[i].line)
            fail_msg("%s: line %ld: %s", bad[i].text, err.line, err.text);
        assert_true(err.where[0] != '\0');
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(head_of_sextractor),
        cmocka_unit_test(names_from_a_comment_or_a_first_line),
        cmocka_unit_test(a_comment_behind_the_names_changes_nothing),
        cmocka_unit_test(cells_of_text_and_nothing),
        cmocka_unit_test(large_identifiers_keep_their_digits),
        cmocka_unit_test(votables_of_others),
        cmocka_unit_test(binary_streams),
        cmocka_unit_test(binary_streams_cut_short),
        cmocka_unit_test(many_rows_of_a_votable),
        cmocka_unit_test(what_is_no_catalogue),
    };
    return cmocka_run_group_tests(tests, enter_scratch, leave_scratch);
}
