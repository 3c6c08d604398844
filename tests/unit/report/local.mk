check_PROGRAMS += \
	tests/unit/report/test_escape \
	tests/unit/report/test_figures \
	tests/unit/report/test_report \
	tests/unit/report/test_tables
tests_unit_report_test_escape_SOURCES = tests/unit/report/test_escape.c
tests_unit_report_test_figures_SOURCES = tests/unit/report/test_figures.c
tests_unit_report_test_report_SOURCES = tests/unit/report/test_report.c
tests_unit_report_test_tables_SOURCES = tests/unit/report/test_tables.c
