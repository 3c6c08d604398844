check_PROGRAMS += tests/unit/io/test_wcs
tests_unit_io_test_wcs_SOURCES = tests/unit/io/test_wcs.c tests/unit/io/io_test.h \
	tests/unit/io/wcs_expected.inc tests/unit/io/make_wcs_expected.py
check_PROGRAMS += tests/unit/io/test_header_numbers
tests_unit_io_test_header_numbers_SOURCES = tests/unit/io/test_header_numbers.c tests/unit/io/tile_test.h
check_PROGRAMS += tests/unit/io/test_tile
tests_unit_io_test_tile_SOURCES = tests/unit/io/test_tile.c tests/unit/io/tile_test.h
check_PROGRAMS += tests/unit/io/test_tile_damaged
tests_unit_io_test_tile_damaged_SOURCES = tests/unit/io/test_tile_damaged.c tests/unit/io/tile_test.h
check_PROGRAMS += tests/unit/io/test_output
tests_unit_io_test_output_SOURCES = tests/unit/io/test_output.c
check_PROGRAMS += tests/unit/io/test_fits
tests_unit_io_test_fits_SOURCES = tests/unit/io/test_fits.c
