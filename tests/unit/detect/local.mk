check_PROGRAMS += tests/unit/detect/test_background tests/unit/detect/test_detect
tests_unit_detect_test_background_SOURCES = tests/unit/detect/test_background.c tests/unit/detect/field.h
tests_unit_detect_test_detect_SOURCES = tests/unit/detect/test_detect.c tests/unit/detect/field.h
