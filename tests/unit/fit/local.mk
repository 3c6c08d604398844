check_PROGRAMS += tests/unit/fit/test_hits
tests_unit_fit_test_hits_SOURCES = tests/unit/fit/test_hits.c
check_PROGRAMS += tests/unit/fit/test_significance
tests_unit_fit_test_significance_SOURCES = tests/unit/fit/test_significance.c
check_PROGRAMS += tests/unit/fit/test_structure
tests_unit_fit_test_structure_SOURCES = tests/unit/fit/test_structure.c
check_PROGRAMS += tests/unit/fit/test_preal
tests_unit_fit_test_preal_SOURCES = tests/unit/fit/test_preal.c
