/* What reaches the user at each level, and that no name from outside drives the terminal. */
#include "../near.h"

#include <stdio.h>
#include <string.h>

#include "base/log.h"

/* On a terminal the line comes with a share and an estimate, and goes. */
static void progress_shows_share_and_time_left(void **state)
{
    char text[512];
    FILE *stream = tmpfile();
    assert_non_null(stream);
    rx_log log;
    rx_log_init(&log, "rextract", stream, RX_NORMAL);
    log.terminal = true;
    rx_log_step(&log, "sky"); /* at once, however long it takes */
    const long shown = ftell(stream);
    assert_true(shown > 0);
    rx_log_progress_begin(&log);
    rx_log_progress(&log, "restoring", 0.1);
    assert_int_equal(ftell(stream), shown); /* not in the first two seconds */
    log.begun -= 10.0;
    log.shown -= 10.0;
    rx_log_progress(&log, "restoring", 0.5);
    rx_log_progress_end(&log);
    rewind(stream);
    size_t n = fread(text, 1, sizeof text - 1, stream);
    text[n] = '\0';
    fclose(stream);
    assert_non_null(strstr(text, "\r\033[Krextract: sky\r\033[Krextract: restoring  50 %, 10 s left"));
    assert_string_equal(text + n - 4, "\r\033[K");
}

/* At NORMAL no line is longer than 160 characters, and no word is lost; at FULL a message is a line. */
static void long_lines_are_folded(void **state)
{
    char message[600] = "", text[1200], line[1200];
    for (int i = 0; i < 59; i++)
        strcat(message, i == 58 ? "last" : "word0word ");
    for (int level = RX_NORMAL; level <= RX_FULL; level++) {
        FILE *stream = tmpfile();
        assert_non_null(stream);
        rx_log log;
        rx_log_init(&log, "rextract", stream, (rx_verbosity)level);
        rx_log_warning(&log, "%s", message);
        rewind(stream);
        int lines = 0, words = 0;
        while (fgets(line, sizeof line, stream) != NULL) {
            lines++;
            assert_true(level == RX_FULL || strlen(line) <= 161);
            for (const char *at = line; (at = strstr(at, "word0word")) != NULL; at++)
                words++;
        }
        snprintf(text, sizeof text, "%s", line);
        fclose(stream);
        assert_int_equal(lines, level == RX_FULL ? 1 : 5);
        assert_int_equal(words, 58);
        assert_non_null(strstr(text, "last\n"));
    }
}

/* What a tile says at this level, begun with `before` lines: warnings of two lines each, then information of two images,
 * a hint, and `files` names. The lines; the last of them in `last`, all of it in `text`. */
static int tile_lines(rx_verbosity level, int warnings, int infos, int files, char *text, size_t size)
{
    FILE *stream = tmpfile();
    assert_non_null(stream);
    rx_log log;
    char line[2200], name[48], words[160] = "";
    for (int i = 0; i < 30; i++)
        strcat(words, " word");
    rx_log_init(&log, "rextract", stream, level);
    rx_log_warning(&log, "default.sex not found");
    rx_log_tile_begin(&log);
    rx_log_hint(&log, "tile.fits[0]: a hint");
    for (int i = 0; i < infos; i++) {
        rx_log_info(&log, "tile.fits[%d]: fact%d", i >= infos / 2, i);
        if (i < warnings)
            rx_log_warning(&log, "careful%d%s", i, words);
    }
    for (int i = 0; i < files; i++) {
        snprintf(name, sizeof name, "catalogue_with_a_name%d.cat", i);
        rx_log_written(&log, name);
    }
    rx_log_written(&log, "");
    rx_log_tile_end(&log, 1);
    rewind(stream);
    int lines = 0;
    text[0] = '\0';
    while (fgets(line, sizeof line, stream) != NULL) {
        lines++;
        assert_true(level == RX_FULL || strlen(line) <= 161);
        assert_true(strlen(text) + strlen(line) < size);
        strcat(text, line);
    }
    fclose(stream);
    return lines;
}

/* Ten, one of them left to the caller: warnings and the last line stay, information gives way, and that is told. */
static void a_tile_has_ten_lines(void **state)
{
    char text[8192];
    assert_int_equal(tile_lines(RX_QUIET, 3, 8, 4, text, sizeof text), 0);
    assert_int_equal(tile_lines(RX_FULL, 3, 8, 4, text, sizeof text), 1 + 1 + 8 + 3 + 1);
    /* all of it where there is room, in its order */
    assert_int_equal(tile_lines(RX_NORMAL, 0, 4, 1, text, sizeof text), 7);
    assert_non_null(strstr(text, "rextract: tile.fits[0]: a hint\nrextract: tile.fits[0]: fact0\n"));
    assert_non_null(strstr(text, "\nrextract: written: catalogue_with_a_name0.cat\n"));
    /* information on one image in one line, but for hints */
    assert_int_equal(tile_lines(RX_NORMAL, 2, 8, 1, text, sizeof text), 1 + 4 + 3 + 1);
    assert_non_null(strstr(text, "rextract: tile.fits[0]: a hint\n"
                                 "rextract: tile.fits[0]: fact0; fact1; fact2; fact3\n"
                                 "rextract: tile.fits[1]: fact4; fact5; fact6; fact7\nrextract: written: "));
    /* more than fits */
    assert_int_equal(tile_lines(RX_NORMAL, 2, 60, 1, text, sizeof text), 9);
    assert_null(strstr(text, "fact0"));
    assert_non_null(strstr(text, "fact59\n"));
    assert_non_null(strstr(text, "more lines of information with VERBOSE_TYPE FULL\nrextract: written: "));
    /* one line is left: what was said last */
    assert_int_equal(tile_lines(RX_NORMAL, 3, 60, 1, text, sizeof text), 9);
    assert_non_null(strstr(text, "fact59\nrextract: written: "));
    /* many files: the first of them and the number of the others */
    assert_int_equal(tile_lines(RX_NORMAL, 3, 2, 60, text, sizeof text), 9);
    assert_non_null(strstr(text, "written: catalogue_with_a_name0.cat, "));
    const char *and = strstr(text, " and ");
    assert_non_null(and);
    int shown = 0, more = 0;
    for (const char *at = text; (at = strstr(at, ".cat")) != NULL; at++)
        shown++;
    assert_int_equal(sscanf(and, " and %d more", &more), 1);
    assert_int_equal(shown + more, 60);
    /* no warning is lost where they alone take more than there is, nor what was said last */
    assert_int_equal(tile_lines(RX_NORMAL, 7, 8, 9, text, sizeof text), 1 + 14 + 1 + 1);
    assert_non_null(strstr(text, "fact7"));
    for (int i = 0; i < 7; i++) {
        char warning[32];
        snprintf(warning, sizeof warning, "warning: careful%d", i);
        assert_non_null(strstr(text, warning));
    }
    assert_non_null(strstr(text, "rextract: written: catalogue_with_a_name0.cat"));
}

/* Each image of a file has lines of its own, and no tile those of the one before. */
static void lines_are_counted_anew(void **state)
{
    FILE *stream = tmpfile();
    assert_non_null(stream);
    rx_log log;
    char line[256];
    rx_log_init(&log, "rextract", stream, RX_NORMAL);
    for (int tile = 0; tile < 2; tile++) {
        rx_log_tile_begin(&log);
        for (int i = 0; i < 7; i++)
            rx_log_warning(&log, "careful");
        rx_log_info(&log, "fact of the first");
        rx_log_tile_next(&log);
        for (int i = 0; i < 7; i++)
            rx_log_warning(&log, "careful");
        rx_log_info(&log, "fact of the second");
        rx_log_written(&log, "a.cat");
        rx_log_tile_end(&log, 0);
    }
    rx_log_info(&log, "at once");
    rewind(stream);
    int lines = 0, facts = 0;
    while (fgets(line, sizeof line, stream) != NULL) {
        lines++;
        facts += strstr(line, "fact of") != NULL;
    }
    fclose(stream);
    assert_int_equal(facts, 4);
    assert_int_equal(lines, 2 * (7 + 1 + 7 + 1 + 1) + 1);
}

/* What the caller's functions were given. */
typedef struct heard {
    char text[512];
    int n, kinds[8];
    double done[16];
    int shares;
} heard;

static void hear(void *user, rx_log_kind kind, const char *text)
{
    heard *h = user;
    h->kinds[h->n++] = (int)kind;
    strcat(strcat(h->text, text), "|");
}

static void see(void *user, const char *what, double done)
{
    heard *h = user;
    assert_string_equal(what, "restoring");
    h->done[h->shares++] = done;
}

static void say_to(rx_log *log)
{
    rx_log_tile_begin(log);
    rx_log_info(log, "read %s", "a\033b\n");
    rx_log_hint(log, "hint");
    rx_log_detail(log, "detail");
    rx_log_warning(log, "careful");
    rx_log_progress_begin(log);
    rx_log_progress(log, "restoring", 0.5);
    rx_log_progress(log, "restoring", 1.0);
    rx_log_progress_end(log);
    rx_log_written(log, "a.cat");
    rx_log_tile_end(log, 0);
}

/* All of it comes at once, as it is, each message whole. */
static void a_caller_hears_and_sees(void **state)
{
    static const int kinds[] = {RX_LOG_INFO, RX_LOG_INFO, RX_LOG_DETAIL, RX_LOG_WARNING, RX_LOG_INFO};
    heard h = {0};
    rx_log log;
    rx_log_calls(&log, RX_FULL, hear, see, &h);
    say_to(&log);
    assert_string_equal(h.text, "read a?b?|hint|detail|careful|written: a.cat|");
    assert_int_equal(h.n, 5);
    assert_memory_equal(h.kinds, kinds, sizeof kinds);
    assert_int_equal(h.shares, 2);
    assert_near(h.done[0], 0.5, 0);
    assert_near(h.done[1], 1.0, 0);
    h = (heard){0};
    rx_log_calls(&log, RX_NORMAL, hear, NULL, &h);
    say_to(&log);
    assert_string_equal(h.text, "read a?b?|hint|careful|written: a.cat|");
    assert_int_equal(h.shares, 0);
    h = (heard){0};
    rx_log_calls(&log, RX_QUIET, hear, see, &h);
    say_to(&log);
    assert_string_equal(h.text, "");
    assert_int_equal(h.shares, 2); /* progress is no message */
}

/* Parts of a job, each of which goes from 0 to 1, or twice so, or not to its end, are one that rises. */
static void shares_are_of_the_whole(void **state)
{
    static const double seen[] = {0, 0.3, 0.3, 0.6, 0.6, 0.8, 1, 0, 0.2};
    heard h = {0};
    rx_log log;
    rx_log_calls(&log, RX_QUIET, NULL, see, &h);
    rx_log_part(&log, "restoring", 0, 0.6);
    rx_log_progress(&log, "restoring", 0.5);
    rx_log_progress(&log, "restoring", 0.1);
    rx_log_progress(&log, "restoring", 1);
    rx_log_part(&log, "restoring", 0.6, 1);
    rx_log_progress(&log, "restoring", 0.5);
    rx_log_part(&log, "restoring", 1, 1);
    rx_log_part(&log, "restoring", 0, 0.2);
    rx_log_progress(&log, "restoring", 1);
    assert_int_equal(h.shares, 9);
    for (int i = 0; i < 9; i++)
        assert_near(h.done[i], seen[i], 1e-15);
    rx_log_part(NULL, "restoring", 0, 1);
}

/* What asks for warnings gets them whatever is shown, and nothing else. */
static void warnings_are_kept_when_quiet(void **state)
{
    static const rx_verbosity levels[] = {RX_QUIET, RX_NORMAL, RX_FULL};
    for (int calls = 0; calls < 2; calls++)
        for (int i = 0; i < 3; i++) {
            heard h = {0};
            rx_text kept = {0};
            rx_log log;
            FILE *stream = tmpfile();
            assert_non_null(stream);
            if (calls)
                rx_log_calls(&log, levels[i], hear, see, &h);
            else
                rx_log_init(&log, "rextract", stream, levels[i]);
            log.warnings = &kept;
            say_to(&log);
            assert_int_equal(kept.length, sizeof "careful");
            assert_string_equal(kept.data, "careful");
            if (levels[i] == RX_QUIET) {
                assert_int_equal(ftell(stream), 0);
                assert_int_equal(h.n, 0);
            }
            rx_text_free(&kept);
            fclose(stream);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(progress_shows_share_and_time_left),
        cmocka_unit_test(long_lines_are_folded),
        cmocka_unit_test(a_tile_has_ten_lines),
        cmocka_unit_test(lines_are_counted_anew),
        cmocka_unit_test(a_caller_hears_and_sees),
        cmocka_unit_test(shares_are_of_the_whole),
        cmocka_unit_test(warnings_are_kept_when_quiet),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
