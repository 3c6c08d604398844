check_PROGRAMS += tests/unit/config/test_arguments
tests_unit_config_test_arguments_SOURCES = tests/unit/config/test_arguments.c tests/unit/config/folder.h
check_PROGRAMS += tests/unit/config/test_config
tests_unit_config_test_config_SOURCES = tests/unit/config/test_config.c tests/unit/config/folder.h
check_PROGRAMS += tests/unit/config/test_kernel
tests_unit_config_test_kernel_SOURCES = tests/unit/config/test_kernel.c tests/unit/config/folder.h
check_PROGRAMS += tests/unit/config/test_keywords
tests_unit_config_test_keywords_SOURCES = tests/unit/config/test_keywords.c
