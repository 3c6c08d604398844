librextract_la_SOURCES += \
	src/io/cards.c src/io/cards.h \
	src/io/fits_file.c src/io/fits_file.h \
	src/io/fits_read.c \
	src/io/record_read.c src/io/record_read.h \
	src/io/fits_write.c \
	src/io/folders.c src/io/folders.h \
	src/io/output.c \
	src/io/tile_read.c \
	src/io/header_numbers.c src/io/header_numbers.h \
	src/io/tile_maps.c src/io/tile_maps.h \
	src/io/wcs.c \
	src/io/guard/guard.h src/io/guard/header.c src/io/guard/tiles.c src/io/guard/unpack.c src/io/guard/walk.c src/io/guard/wcs.c src/io/guard/wcs.h
librextract_la_SOURCES += src/io/fits_read.h src/io/fits_write.h src/io/output.h

rx_iodir = $(pkgincludedir)/io
rx_io_HEADERS = src/io/tile.h src/io/wcs.h src/io/wcs_notes.h
installed_headers += $(rx_io_HEADERS)
#include "io/guard/guard.h"
