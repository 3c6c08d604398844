check_PROGRAMS += tests/unit/data/test_table
tests_unit_data_test_table_SOURCES = tests/unit/data/test_table.c
check_PROGRAMS += tests/unit/data/test_sources
tests_unit_data_test_sources_SOURCES = tests/unit/data/test_sources.c
check_PROGRAMS += tests/unit/data/test_gaps
tests_unit_data_test_gaps_SOURCES = tests/unit/data/test_gaps.c
