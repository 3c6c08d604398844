/* The journal: exact numbers, torn and damaged lines, journals of other campaigns. Locks, and files that are no journals: tests/campaign.sh. */
#include "../scratch.h"

#include <math.h>

#include "lab/journal.h"

enum { UNITS = 6 };

static const double EXACT[] = {1.0 / 3.0,
                               (float)(1.0 / 3.0),
                               3.4028234663852886e38,
                               1.1754942106924411e-38f,
                               -0.0,
                               0.1f,
                               1e-300,
                               -123456789.123456789,
                               5e-324,
                               0,
                               7,
                               INFINITY,
                               -INFINITY,
                               NAN,
                               1.7976931348623157e308};
enum { NEXACT = sizeof EXACT / sizeof EXACT[0] };

static void make_facts(rx_text *facts, const char *seed)
{
    rx_journal_fact(facts, "version", "1.0");
    rx_journal_fact(facts, "SEED", seed);
    rx_journal_fact(facts, "SIM.PSF_FWHM", "4");
}

static rx_status begin(const char *path, const char *seed, rx_unit_values **values, rx_journal **journal,
                       rx_error *err)
{
    rx_text facts = {0};
    make_facts(&facts, seed);
    *journal = NULL;
    *values = calloc(UNITS, sizeof **values);
    assert_non_null(*values);
    rx_status status = rx_journal_open(path, &facts, UNITS, *values, journal, err);
    rx_text_free(&facts);
    return status;
}

static void end(rx_unit_values *values, rx_journal *journal)
{
    rx_journal_close(journal);
    rx_unit_values_free(UNITS, values);
}

static double number_of(long unit, long i)
{
    return (double)unit + 1.0 / (double)(i + 3);
}

static void append(rx_journal *journal, long unit)
{
    double v[4];
    for (long i = 0; i < 4; i++)
        v[i] = number_of(unit, i);
    assert_int_equal(rx_journal_append(journal, unit, &(rx_unit_values){4, v}, NULL), RX_OK);
}

static void check(const rx_unit_values *values, long unit)
{
    assert_non_null(values[unit].v);
    assert_int_equal(values[unit].n, 4);
    for (long i = 0; i < 4; i++)
        assert_true(values[unit].v[i] == number_of(unit, i));
}

/* A journal of units 3, 0 and 5; its bytes are returned. */
static char *three_units(const char *path, size_t *size)
{
    rx_unit_values *values;
    rx_journal *journal;
    unlink(path);
    assert_int_equal(begin(path, "1", &values, &journal, NULL), RX_OK);
    append(journal, 3);
    append(journal, 0);
    append(journal, 5);
    end(values, journal);
    return file_bytes(path, size);
}

static void numbers_read_back_exactly(void **state)
{
    rx_unit_values *values;
    rx_journal *journal;
    double v[NEXACT];
    const char *path = in(state, "exact");
    memcpy(v, EXACT, sizeof v);
    assert_int_equal(begin(path, "1", &values, &journal, NULL), RX_OK);
    assert_int_equal(rx_journal_append(journal, 2, &(rx_unit_values){NEXACT, v}, NULL), RX_OK);
    assert_int_equal(rx_journal_append(journal, 4, &(rx_unit_values){0, v}, NULL), RX_OK);
    end(values, journal);
    assert_int_equal(begin(path, "1", &values, &journal, NULL), RX_OK);
    assert_null(values[0].v);
    assert_int_equal(values[2].n, NEXACT);
    for (int i = 0; i < NEXACT; i++) {
        assert_int_equal(isnan(EXACT[i]) != 0, isnan(values[2].v[i]) != 0);
        if (!isnan(EXACT[i]))
            assert_memory_equal(&values[2].v[i], &EXACT[i], sizeof(double)); /* the sign of 0 too */
    }
    assert_non_null(values[4].v); /* done, although it has no values */
    assert_int_equal(values[4].n, 0);
    end(values, journal);
}

/* Cut at every byte: every whole line counts, no other, and the journal goes on from there. */
static void cut_anywhere(void **state)
{
    size_t size, lines[4];
    const char *path = in(state, "cut");
    char *data = three_units(path, &size);
    int n = 0;
    for (size_t i = 0; i < size; i++)
        if (data[i] == '\n' && ++n >= 5)
            lines[n - 5] = i + 1; /* behind the header, and behind each unit */
    assert_int_equal(n, 8);
    assert_int_equal(lines[3], size);
    const long order[] = {3, 0, 5};
    for (size_t cut = 0; cut <= size; cut++) {
        rx_unit_values *values;
        rx_journal *journal;
        int whole = 0;
        size_t left;
        while (whole < 3 && lines[whole + 1] <= cut)
            whole++;
        write_bytes(path, data, cut);
        assert_int_equal(begin(path, "1", &values, &journal, NULL), RX_OK);
        for (int i = 0; i < 3; i++) {
            if (i < whole)
                check(values, order[i]);
            else
                assert_null(values[order[i]].v);
        }
        for (int i = whole; i < 3; i++)
            append(journal, order[i]);
        end(values, journal);
        char *again = file_bytes(path, &left);
        assert_int_equal(left, size);
        assert_memory_equal(again, data, size);
        free(again);
    }
    free(data);
}

/* Any byte of a unit's line that changes spoils the line: the last one is cut off, another one is an error
 * that names it. */
static void damage_is_seen(void **state)
{
    size_t size, begin_of[4];
    const char *path = in(state, "damage");
    char *data = three_units(path, &size);
    int n = 0;
    for (size_t i = 0; i < size; i++)
        if (data[i] == '\n' && ++n >= 5)
            begin_of[n - 5] = i + 1;
    for (size_t i = begin_of[0]; i < size; i++) {
        rx_unit_values *values;
        rx_journal *journal;
        rx_error err = RX_ERROR_NONE;
        const char old = data[i];
        data[i] = old == '1' ? '2' : '1';
        write_bytes(path, data, size);
        const rx_status status = begin(path, "1", &values, &journal, &err);
        if (i >= begin_of[2] - 1) { /* without its end, the second line runs into the third */
            assert_int_equal(status, RX_OK);
            check(values, 3);
            assert_int_equal(values[0].v != NULL, i >= begin_of[2]);
            assert_null(values[5].v);
        } else {
            assert_int_equal(status, RX_INPUT);
            assert_int_equal(err.line, i < begin_of[1] ? 6 : 7);
            assert_non_null(strstr(err.text, "delete this line"));
        }
        end(values, journal);
        data[i] = old;
    }
    /* blocks that were never written, as a power failure leaves them, are cut off */
    rx_unit_values *values;
    rx_journal *journal;
    size_t left;
    char *longer = calloc(size + 5000, 1);
    memcpy(longer, data, size);
    longer[size + 2000] = '\n';
    write_bytes(path, longer, size + 5000);
    assert_int_equal(begin(path, "1", &values, &journal, NULL), RX_OK);
    check(values, 5);
    end(values, journal);
    free(file_bytes(path, &left));
    assert_int_equal(left, size);
    free(longer);
    free(data);
}

static void other_settings_are_named(void **state)
{
    size_t size, left;
    rx_unit_values *values;
    rx_journal *journal;
    rx_error err = RX_ERROR_NONE;
    const char *path = in(state, "settings");
    char *data = three_units(path, &size);
    assert_int_equal(begin(path, "22", &values, &journal, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "SEED 1, now it is 22"));
    assert_non_null(strstr(err.text, "JOURNAL_NAME"));
    end(values, journal);
    /* one more setting than before */
    rx_text facts = {0};
    make_facts(&facts, "1");
    rx_journal_fact(&facts, "TILES", "4");
    values = calloc(UNITS, sizeof *values);
    assert_int_equal(rx_journal_open(path, &facts, UNITS, values, &journal, &err), RX_USAGE);
    assert_non_null(strstr(err.text, "without TILES"));
    rx_unit_values_free(UNITS, values);
    rx_text_free(&facts);
    char *same = file_bytes(path, &left);
    assert_int_equal(left, size);
    assert_memory_equal(same, data, size); /* nothing was touched */
    free(same);
    free(data);
}

/* Lines of another campaign, pasted in, are none of ours. */
static void lines_belong_to_their_header(void **state)
{
    size_t size, other_size;
    rx_unit_values *values;
    rx_journal *journal;
    const char *path = in(state, "mine");
    const char *other = in(state, "theirs");
    char *data = three_units(path, &size);
    assert_int_equal(begin(other, "2", &values, &journal, NULL), RX_OK);
    append(journal, 1);
    end(values, journal);
    char *theirs = file_bytes(other, &other_size);
    const char *line = strstr(theirs, "\n1 4 ");
    assert_non_null(line);
    char *both = calloc(size + other_size + 1, 1);
    snprintf(both, size + other_size + 1, "%s%s", data, line + 1);
    write_bytes(path, both, strlen(both));
    assert_int_equal(begin(path, "1", &values, &journal, NULL), RX_OK);
    assert_null(values[1].v);
    check(values, 5);
    end(values, journal);
    free(both);
    free(theirs);
    free(data);
}

static void reading_changes_nothing(void **state)
{
    size_t size, left;
    rx_error err = RX_ERROR_NONE;
    rx_text facts = {0};
    rx_unit_values *values = calloc(UNITS, sizeof *values);
    make_facts(&facts, "1");
    assert_int_equal(rx_journal_open(in(state, "absent"), &facts, UNITS, values, NULL, NULL), RX_OK);
    assert_int_not_equal(access(in(state, "absent"), F_OK), 0);
    const char *path = in(state, "read");
    char *data = three_units(path, &size);
    write_bytes(path, data, size - 3); /* the last line is torn */
    /* twice: the same values are fine */
    for (int i = 0; i < 2; i++)
        assert_int_equal(rx_journal_open(path, &facts, UNITS, values, NULL, NULL), RX_OK);
    check(values, 3);
    check(values, 0);
    assert_null(values[5].v);
    free(file_bytes(path, &left));
    assert_int_equal(left, size - 3);
    values[3].v[1] += 1;
    assert_int_equal(rx_journal_open(path, &facts, UNITS, values, NULL, &err), RX_INPUT);
    assert_non_null(strstr(err.text, "unit 3"));
    rx_unit_values_free(UNITS, values);
    rx_text_free(&facts);
    free(data);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_read_back_exactly),
        cmocka_unit_test(cut_anywhere),
        cmocka_unit_test(damage_is_seen),
        cmocka_unit_test(other_settings_are_named),
        cmocka_unit_test(lines_belong_to_their_header),
        cmocka_unit_test(reading_changes_nothing),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
