librextract_la_SOURCES += \
	src/data/data.c \
	src/data/facts.c src/data/facts.def src/data/facts.h \
	src/data/flags.c \
	src/data/gaps.c \
	src/data/gaps.h \
	src/data/image.c \
	src/data/map.c \
	src/data/noise_correlation.c \
	src/data/psf.c \
	src/data/record.c \
	src/data/restorers.h \
	src/data/sources.c \
	src/data/splines.c \
	src/data/table.c \
	src/data/unit.c

rx_datadir = $(pkgincludedir)/data
rx_data_HEADERS = src/data/flags.h src/data/image.h src/data/map.h src/data/noise_correlation.h src/data/psf.h src/data/record.h src/data/restored.h src/data/sources.h src/data/splines.h src/data/table.h src/data/tile.h src/data/unit.h
dist_rx_data_DATA = src/data/flags.def
installed_headers += $(rx_data_HEADERS)
