check_PROGRAMS += tests/unit/fit/test_artefacts
tests_unit_fit_test_artefacts_SOURCES = tests/unit/fit/test_artefacts.c
check_PROGRAMS += tests/unit/fit/test_significance
tests_unit_fit_test_significance_SOURCES = tests/unit/fit/test_significance.c
check_PROGRAMS += tests/unit/fit/test_structure
tests_unit_fit_test_structure_SOURCES = tests/unit/fit/test_structure.c
