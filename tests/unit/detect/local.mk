check_PROGRAMS += tests/unit/detect/test_correlation
tests_unit_detect_test_correlation_SOURCES = tests/unit/detect/test_correlation.c
check_PROGRAMS += tests/unit/detect/test_background tests/unit/detect/test_detect
tests_unit_detect_test_background_SOURCES = tests/unit/detect/test_background.c tests/unit/detect/field.h
tests_unit_detect_test_detect_SOURCES = tests/unit/detect/test_detect.c tests/unit/detect/field.h
check_PROGRAMS += tests/unit/detect/test_no_data
tests_unit_detect_test_no_data_SOURCES = tests/unit/detect/test_no_data.c


check_PROGRAMS += tests/unit/detect/test_saturation
tests_unit_detect_test_saturation_SOURCES = tests/unit/detect/test_saturation.c

check_PROGRAMS += tests/unit/detect/test_photons
tests_unit_detect_test_photons_SOURCES = tests/unit/detect/test_photons.c

check_PROGRAMS += tests/unit/detect/test_hollow
tests_unit_detect_test_hollow_SOURCES = tests/unit/detect/test_hollow.c
