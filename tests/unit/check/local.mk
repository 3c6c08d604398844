check_PROGRAMS += tests/unit/check/test_selfcheck
tests_unit_check_test_selfcheck_SOURCES = tests/unit/check/test_selfcheck.c $(bench)
