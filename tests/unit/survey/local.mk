check_PROGRAMS += tests/unit/survey/test_tile_record tests/unit/survey/test_rollup \
	tests/unit/survey/test_rollup_quality
tests_unit_survey_test_tile_record_SOURCES = tests/unit/survey/test_tile_record.c tests/unit/scratch.h
tests_unit_survey_test_rollup_SOURCES = tests/unit/survey/test_rollup.c tests/unit/survey/survey.h tests/unit/scratch.h
tests_unit_survey_test_rollup_quality_SOURCES = tests/unit/survey/test_rollup_quality.c tests/unit/survey/survey.h tests/unit/scratch.h
