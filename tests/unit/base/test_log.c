/* What reaches the user at each level, and that no name from outside drives the terminal. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "base/log.h"

/* What one message of each kind, and a progress line, write at this level. */
static void say_all(rx_verbosity level, char *dst, size_t size)
{
    FILE *stream = tmpfile();
    assert_non_null(stream);
    rx_log log;
    rx_log_init(&log, "rextract", stream, level);
    rx_log_info(&log, "read %s", "a\033b\n");
    rx_log_detail(&log, "detail");
    rx_log_warning(&log, "careful");
    rx_log_progress_begin(&log);
    log.begun -= 10.0;
    log.shown -= 10.0;
    rx_log_progress(&log, "restoring", 0.5);
    rx_log_progress_end(&log);
    rewind(stream);
    size_t n = fread(dst, 1, size - 1, stream);
    dst[n] = '\0';
    fclose(stream);
}

static void levels_choose_what_is_said(void **state)
{
    (void)state;
    char text[512];
    say_all(RX_QUIET, text, sizeof text);
    assert_string_equal(text, "");
    say_all(RX_NORMAL, text, sizeof text);
    assert_string_equal(text, "rextract: read a?b?\nrextract: warning: careful\n");
    say_all(RX_FULL, text, sizeof text);
    assert_string_equal(text, "rextract: read a?b?\nrextract: detail\nrextract: warning: careful\n");
}

/* The same on what is told to be a terminal: the line comes with a share and an estimate, and goes. */
static void progress_shows_share_and_time_left(void **state)
{
    (void)state;
    char text[512];
    FILE *stream = tmpfile();
    assert_non_null(stream);
    rx_log log;
    rx_log_init(&log, "rextract", stream, RX_NORMAL);
    log.terminal = true;
    rx_log_progress_begin(&log);
    rx_log_progress(&log, "restoring", 0.1);
    assert_int_equal(ftell(stream), 0); /* not in the first two seconds */
    log.begun -= 10.0;
    log.shown -= 10.0;
    rx_log_progress(&log, "restoring", 0.5);
    rx_log_progress_end(&log);
    rewind(stream);
    size_t n = fread(text, 1, sizeof text - 1, stream);
    text[n] = '\0';
    fclose(stream);
    assert_non_null(strstr(text, "rextract: restoring  50 %, 10 s left"));
    assert_string_equal(text + n - 4, "\r\033[K");
}

/* At NORMAL no line is longer than 160 characters, and no word is lost; at FULL a message is a line. */
static void long_lines_are_folded(void **state)
{
    (void)state;
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

static void no_log_is_silent(void **state)
{
    (void)state;
    rx_log_info(NULL, "x");
    rx_log_detail(NULL, "x");
    rx_log_warning(NULL, "x");
    rx_log_progress_begin(NULL);
    rx_log_progress(NULL, "x", 0.5);
    rx_log_progress_end(NULL);
    double before = rx_seconds();
    assert_true(rx_seconds() >= before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(levels_choose_what_is_said),
        cmocka_unit_test(progress_shows_share_and_time_left),
        cmocka_unit_test(long_lines_are_folded),
        cmocka_unit_test(no_log_is_silent),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
