check_PROGRAMS += tests/unit/campaign/test_journal
tests_unit_campaign_test_journal_SOURCES = tests/unit/campaign/test_journal.c tests/unit/scratch.h
check_PROGRAMS += tests/unit/campaign/test_units
tests_unit_campaign_test_units_SOURCES = tests/unit/campaign/test_units.c tests/unit/scratch.h
check_PROGRAMS += tests/unit/campaign/test_photometry_match
tests_unit_campaign_test_photometry_match_SOURCES = tests/unit/campaign/test_photometry_match.c
check_PROGRAMS += tests/unit/campaign/test_photometry_unit
tests_unit_campaign_test_photometry_unit_SOURCES = tests/unit/campaign/test_photometry_unit.c \
	tests/unit/campaign/settings.h tests/unit/scratch.h
check_PROGRAMS += tests/unit/campaign/test_restoration
tests_unit_campaign_test_restoration_SOURCES = tests/unit/campaign/test_restoration.c \
	tests/unit/campaign/settings.h tests/unit/scratch.h
check_PROGRAMS += tests/unit/campaign/test_facts
tests_unit_campaign_test_facts_SOURCES = tests/unit/campaign/test_facts.c \
	tests/unit/campaign/settings.h tests/unit/scratch.h
check_PROGRAMS += tests/unit/campaign/test_campaign_report
tests_unit_campaign_test_campaign_report_SOURCES = tests/unit/campaign/test_campaign_report.c \
	tests/unit/campaign/made_results.h tests/unit/campaign/check_restoration.py \
	tests/unit/campaign/check_photometry.py
check_PROGRAMS += tests/unit/campaign/test_conditions
tests_unit_campaign_test_conditions_SOURCES = tests/unit/campaign/test_conditions.c \
	tests/unit/campaign/settings.h tests/unit/scratch.h
check_PROGRAMS += tests/unit/campaign/test_detection
tests_unit_campaign_test_detection_SOURCES = tests/unit/campaign/test_detection.c \
	tests/unit/campaign/settings.h tests/unit/scratch.h
check_PROGRAMS += tests/unit/campaign/test_fluxes
tests_unit_campaign_test_fluxes_SOURCES = tests/unit/campaign/test_fluxes.c \
	tests/unit/campaign/settings.h tests/unit/scratch.h
