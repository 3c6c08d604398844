check_PROGRAMS += tests/unit/data/test_table
tests_unit_data_test_table_SOURCES = tests/unit/data/test_table.c
