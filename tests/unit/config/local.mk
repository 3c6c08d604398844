check_PROGRAMS += tests/unit/config/test_arguments
tests_unit_config_test_arguments_SOURCES = tests/unit/config/test_arguments.c tests/unit/scratch.h
check_PROGRAMS += tests/unit/config/test_kernel
tests_unit_config_test_kernel_SOURCES = tests/unit/config/test_kernel.c tests/unit/scratch.h
check_PROGRAMS += tests/unit/config/test_keywords
tests_unit_config_test_keywords_SOURCES = tests/unit/config/test_keywords.c
check_PROGRAMS += tests/unit/config/test_settings
tests_unit_config_test_settings_SOURCES = tests/unit/config/test_settings.c tests/unit/scratch.h
