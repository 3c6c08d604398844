check_PROGRAMS += tests/unit/psf/test_psf
tests_unit_psf_test_psf_SOURCES = tests/unit/psf/test_psf.c
check_PROGRAMS += tests/unit/psf/test_psf_files
tests_unit_psf_test_psf_files_SOURCES = tests/unit/psf/test_psf_files.c
check_PROGRAMS += tests/unit/psf/test_psf_estimate
tests_unit_psf_test_psf_estimate_SOURCES = tests/unit/psf/test_psf_estimate.c
