check_PROGRAMS += tests/unit/lab/test_campaign tests/unit/lab/test_conditions tests/unit/lab/test_journal \
	tests/unit/lab/test_match
tests_unit_lab_test_campaign_SOURCES = tests/unit/lab/test_campaign.c tests/unit/scratch.h
tests_unit_lab_test_conditions_SOURCES = tests/unit/lab/test_conditions.c tests/unit/scratch.h
tests_unit_lab_test_journal_SOURCES = tests/unit/lab/test_journal.c tests/unit/scratch.h
tests_unit_lab_test_match_SOURCES = tests/unit/lab/test_match.c
