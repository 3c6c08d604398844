librextract_la_SOURCES += \
	src/base/error.c \
	src/base/hash.c \
	src/base/interrupt.c \
	src/base/least.h \
	src/base/lines.c \
	src/base/log.c \
	src/base/memory.c \
	src/base/names.c \
	src/base/printable.c src/base/printable.h \
	src/base/random.c \
	src/base/text.c \
	src/base/threads.c

rx_basedir = $(pkgincludedir)/base
rx_base_HEADERS = src/base/error.h src/base/hash.h src/base/interrupt.h src/base/lines.h src/base/log.h src/base/memory.h \
	src/base/wide.h src/base/names.h src/base/random.h src/base/text.h src/base/threads.h
