librextract_la_SOURCES += \
	src/data/data.c \
	src/data/map.c \
	src/data/psf.c \
	src/data/sources.c \
	src/data/splines.c \
	src/data/table.c

rx_datadir = $(pkgincludedir)/data
rx_data_HEADERS = src/data/map.h src/data/psf.h src/data/restored.h src/data/sources.h src/data/splines.h src/data/table.h src/data/tile.h
