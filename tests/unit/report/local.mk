check_PROGRAMS += tests/unit/report/test_tables
tests_unit_report_test_tables_SOURCES = tests/unit/report/test_tables.c
