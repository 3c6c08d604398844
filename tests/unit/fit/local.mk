check_PROGRAMS += tests/unit/fit/test_significance
tests_unit_fit_test_significance_SOURCES = tests/unit/fit/test_significance.c
