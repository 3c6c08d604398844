librextract_la_SOURCES += \
	src/io/cards.c src/io/cards.h \
	src/io/claim.c src/io/claim.h \
	src/io/fits_digest.c src/io/fits_digest.h \
	src/io/fits_file.c src/io/fits_file.h \
	src/io/fits_read.c \
	src/io/fits_sum.c src/io/fits_sum.h \
	src/io/fits_hcompress.c src/io/fits_hcompress.h \
	src/io/fits_tiles.c src/io/fits_tiles.h \
	src/io/fits_unpack.c src/io/fits_unpack.h \
	src/io/fits_verify.c src/io/fits_verify.h \
	src/io/fits_walk.c src/io/fits_walk.h \
	src/io/fits_write.c \
	src/io/output.c \
	src/io/sky.c src/io/sky.h \
	src/io/tile.c \
	src/io/tile_weight.c src/io/tile_weight.h \
	src/io/wcs.c \
	src/io/wcs_guard.c src/io/wcs_guard.h
librextract_la_SOURCES += src/io/fits_read.h src/io/fits_write.h src/io/output.h

rx_iodir = $(pkgincludedir)/io
rx_io_HEADERS = src/io/tile.h src/io/wcs.h
installed_headers += $(rx_io_HEADERS)
