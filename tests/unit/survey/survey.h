/* Roll-ups of records that a test has as text, in the current folder. */
#ifndef TESTS_UNIT_SURVEY_SURVEY_H
#define TESTS_UNIT_SURVEY_SURVEY_H

#include "../scratch.h"

#include "survey/rollup.h"

/* Of the records, into the folder "survey" (and "merged"); keywords: names and values, ending with NULL. */
static inline rx_status roll_up(const char *records, const char *const *keywords, rx_error *err)
{
    rx_settings *settings = NULL;
    write_text("all.records", records);
    assert_int_equal(rx_settings_new(rx_keytable_survey(), &settings, NULL), RX_OK);
    assert_int_equal(rx_settings_set(settings, "QA_FIGURES", "N", NULL, NULL), RX_OK);
    for (; keywords != NULL && *keywords != NULL; keywords += 2)
        assert_int_equal(rx_settings_set(settings, keywords[0], keywords[1], NULL, NULL), RX_OK);
    rx_output_remove("survey");
    const rx_status status = rx_rollup_files((const rx_survey_config *)settings, "all.records", NULL, err);
    rx_settings_free(settings);
    return status;
}

/* Does a file of the report hold all words, which end with NULL? */
static inline void holds(const char *name, const char *const *words)
{
    char *text = slurp("survey", name);
    for (; *words != NULL; words++)
        if (strstr(text, *words) == NULL)
            fail_msg("%s lacks %s", name, *words);
    free(text);
}

#endif
