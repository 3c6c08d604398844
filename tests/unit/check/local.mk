check_PROGRAMS += tests/unit/check/test_selfcheck
tests_unit_check_test_selfcheck_SOURCES = tests/unit/check/test_selfcheck.c $(bench)
check_PROGRAMS += tests/unit/check/test_conformal
tests_unit_check_test_conformal_SOURCES = tests/unit/check/test_conformal.c
check_PROGRAMS += tests/unit/check/test_choice
tests_unit_check_test_choice_SOURCES = tests/unit/check/test_choice.c $(bench)
check_PROGRAMS += tests/unit/check/test_restored_noise
tests_unit_check_test_restored_noise_SOURCES = tests/unit/check/test_restored_noise.c $(bench)
