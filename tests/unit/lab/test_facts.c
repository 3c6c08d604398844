/* What makes a campaign what it is: settings and contents of files, not where or how it runs. */
#include "settings.h"

#include "lab/facts.h"

static const char *const NONE[] = {NULL};

static char *facts_of(const rx_campaign_config *config)
{
    rx_journal_facts facts = {0};
    assert_int_equal(rx_facts_collect(config, &facts, NULL), RX_OK);
    char *text = strdup(facts.lines.data);
    rx_journal_facts_free(&facts);
    return text;
}

static void check_changes(const char *name, const char *value, int changes)
{
    const char *const pairs[] = {name, value, NULL};
    rx_campaign_config *a = make_settings(NONE), *b = make_settings(pairs);
    char *before = facts_of(a), *after = facts_of(b);
    assert_int_equal(strcmp(before, after) != 0, changes);
    free(before);
    free(after);
    rx_campaign_config_free(a);
    rx_campaign_config_free(b);
}

static void what_decides_results(void **state)
{
    (void)state;
    check_changes("SEED", "2", 1);
    check_changes("SIZE", "PAPER", 1);
    check_changes("TUNE_NITER", "3,4", 1);
    check_changes("SIM.PSF_FWHM", "3", 1);
    check_changes("STAGE.RL_NITER", "7", 1);
    check_changes("NTHREADS", "2", 0);
    check_changes("VERBOSE_TYPE", "QUIET", 0);
    check_changes("SHARD", "2/3", 0);
    check_changes("MERGE", "Y", 0);
    check_changes("OUTPUT_NAME", "elsewhere", 0);
    check_changes("JOURNAL_NAME", "elsewhere", 0);
    check_changes("QA_FIGURES", "N", 0);
    check_changes("EXAMPLES", "2", 0);
    check_changes("PRECISIONS", "0.5", 0);
    check_changes("STAGE.NTHREADS", "3", 0);
    check_changes("SIM.IMAGE_NAME", "other.fits", 0);
    check_changes("STAGE.CATALOG_NAME", "other.cat", 0);
}

/* A tile of another name is the same campaign, one of other content is not. */
static void files_count_by_content(void **state)
{
    char named[1100];
    const char *one = in(state, "one");
    const char *two = in(state, "two");
    write_bytes(one, "abc", 3);
    write_bytes(two, "abc", 3);
    const char *const first[] = {"TILE_NAME", one, NULL}, *const second[] = {"TILE_NAME", two, NULL};
    rx_campaign_config *a = make_settings(first), *b = make_settings(second);
    char *x = facts_of(a), *y = facts_of(b);
    assert_string_equal(x, y);
    assert_null(strstr(x, one));                                                  /* no path in the journal */
    assert_non_null(strstr(x, "= TILE_NAME 06b05ab6733a618578af5f94892f3950\n")); /* xxh128sum of "abc" */
    free(y);
    write_bytes(two, "abd", 3);
    y = facts_of(b);
    assert_string_not_equal(x, y);
    free(y);
    snprintf(named, sizeof named, "%s[2]", one);
    const char *const third[] = {"TILE_NAME", named, NULL};
    rx_campaign_config *c = make_settings(third);
    y = facts_of(c);
    assert_non_null(strstr(y, "= TILE_NAME 06b05ab6733a618578af5f94892f3950 2\n"));
    free(x);
    free(y);
    rx_campaign_config_free(a);
    rx_campaign_config_free(b);
    rx_campaign_config_free(c);
}

static const char *value_of(const rx_campaign_record *record, const char *name)
{
    for (int i = 0; i < record->keywords.n; i++)
        if (strcmp(record->keywords.pairs[i][0], name) == 0)
            return record->keywords.pairs[i][1];
    return NULL;
}

static void the_record_repeats_the_campaign(void **state)
{
    (void)state;
    const char *const pairs[] = {"SEED",  "5",   "STAGE.RL_NITER", "7", "TILE_NAME", "my tile.fits",
                                 "SHARD", "1/2", "NTHREADS",       "3", NULL};
    rx_campaign_config *config = make_settings(pairs);
    rx_campaign_record record = {0};
    assert_int_equal(rx_campaign_record_make(config, "A title", &record, NULL), RX_OK);
    assert_string_equal(record.title, "A title");
    assert_int_equal(record.seed, 5);
    assert_string_equal(record.command.data,
                        "rextract-validate -SEED 5 -TILE_NAME 'my tile.fits' -STAGE.RL_NITER 7");
    assert_string_equal(value_of(&record, "STAGE.RL_NITER"), "7");
    assert_string_equal(value_of(&record, "TILE_NAME"), "my tile.fits");
    assert_string_equal(value_of(&record, "version"), RX_VERSION);
    assert_null(value_of(&record, "SHARD"));
    assert_null(value_of(&record, "NTHREADS"));
    assert_null(value_of(&record, "STAGE.NTHREADS"));
    rx_campaign_record_free(&record);
    rx_campaign_config_free(config);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_decides_results),
        cmocka_unit_test(files_count_by_content),
        cmocka_unit_test(the_record_repeats_the_campaign),
    };
    return cmocka_run_group_tests(tests, make_scratch, remove_scratch);
}
