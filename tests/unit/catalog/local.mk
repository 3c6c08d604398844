check_PROGRAMS += tests/unit/catalog/test_assoc
check_PROGRAMS += tests/unit/catalog/test_catalog_read
check_PROGRAMS += tests/unit/catalog/test_catalog_write
check_PROGRAMS += tests/unit/catalog/test_columns
tests_unit_catalog_test_assoc_SOURCES = tests/unit/catalog/test_assoc.c tests/unit/catalog/scene.h
tests_unit_catalog_test_catalog_read_SOURCES = tests/unit/catalog/test_catalog_read.c tests/unit/catalog/scene.h
tests_unit_catalog_test_catalog_write_SOURCES = tests/unit/catalog/test_catalog_write.c tests/unit/catalog/scene.h
tests_unit_catalog_test_columns_SOURCES = tests/unit/catalog/test_columns.c tests/unit/catalog/scene.h
