check_PROGRAMS += tests/unit/psf/test_psf
tests_unit_psf_test_psf_SOURCES = tests/unit/psf/test_psf.c
