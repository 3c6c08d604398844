librextract_la_SOURCES += \
	src/base/error.c \
	src/base/hash.c \
	src/base/input.c src/base/input.h \
	src/base/interrupt.c \
	src/base/min_max.h \
	src/base/lines.c \
	src/base/log.c \
	src/base/arena.c src/base/arena.h src/base/constants.h \
	src/base/memory.c \
	src/base/names.c \
	src/base/point.c src/base/point.h \
	src/base/random.c \
	src/base/text.c \
	src/base/threads.c
librextract_la_SOURCES += src/base/interrupt.h src/base/lines.h src/base/memory.h src/base/names.h \
	src/base/random.h src/base/threads.h src/base/simd.h

rx_basedir = $(pkgincludedir)/base
rx_base_HEADERS = src/base/error.h src/base/extern.h src/base/hash.h src/base/log.h src/base/text.h
installed_headers += $(rx_base_HEADERS)
