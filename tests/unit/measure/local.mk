check_PROGRAMS += tests/unit/measure/test_measure tests/unit/measure/test_noise tests/unit/measure/test_starclass \
	tests/unit/measure/test_sums tests/unit/measure/test_against_sep
tests_unit_measure_test_against_sep_SOURCES = tests/unit/measure/test_against_sep.c tests/unit/detect/field.h
tests_unit_measure_test_measure_SOURCES = tests/unit/measure/test_measure.c tests/unit/detect/field.h
tests_unit_measure_test_noise_SOURCES = tests/unit/measure/test_noise.c tests/unit/detect/field.h
tests_unit_measure_test_sums_SOURCES = tests/unit/measure/test_sums.c tests/unit/detect/field.h
tests_unit_measure_test_starclass_SOURCES = tests/unit/measure/test_starclass.c
tests_unit_measure_test_measure_CPPFLAGS = $(AM_CPPFLAGS) -I$(top_srcdir)/tests/unit/detect
tests_unit_measure_test_noise_CPPFLAGS = $(AM_CPPFLAGS) -I$(top_srcdir)/tests/unit/detect
