check_PROGRAMS += tests/unit/lab/test_rows
tests_unit_lab_test_rows_SOURCES = tests/unit/lab/test_rows.c tests/unit/scratch.h
check_PROGRAMS += tests/unit/lab/test_journal
tests_unit_lab_test_journal_SOURCES = tests/unit/lab/test_journal.c tests/unit/scratch.h
check_PROGRAMS += tests/unit/lab/test_units
tests_unit_lab_test_units_SOURCES = tests/unit/lab/test_units.c tests/unit/scratch.h
check_PROGRAMS += tests/unit/lab/test_match
tests_unit_lab_test_match_SOURCES = tests/unit/lab/test_match.c
check_PROGRAMS += tests/unit/lab/test_photometry_unit
tests_unit_lab_test_photometry_unit_SOURCES = tests/unit/lab/test_photometry_unit.c \
	tests/unit/lab/settings.h tests/unit/scratch.h
check_PROGRAMS += tests/unit/lab/test_restoration
tests_unit_lab_test_restoration_SOURCES = tests/unit/lab/test_restoration.c \
	tests/unit/lab/settings.h tests/unit/scratch.h
check_PROGRAMS += tests/unit/lab/test_facts
tests_unit_lab_test_facts_SOURCES = tests/unit/lab/test_facts.c \
	tests/unit/lab/settings.h tests/unit/scratch.h
check_PROGRAMS += tests/unit/lab/test_conditions
tests_unit_lab_test_conditions_SOURCES = tests/unit/lab/test_conditions.c \
	tests/unit/lab/settings.h tests/unit/scratch.h
check_PROGRAMS += tests/unit/lab/test_detection
tests_unit_lab_test_detection_SOURCES = tests/unit/lab/test_detection.c \
	tests/unit/lab/settings.h tests/unit/scratch.h
