librextract_la_SOURCES += \
	src/measure/aperture.c src/measure/aperture.h \
	src/measure/growth.c src/measure/growth.h \
	src/measure/imaflags.c src/measure/imaflags.h \
	src/measure/isophote.c src/measure/isophote.h \
	src/measure/localsky.c src/measure/localsky.h \
	src/measure/measure.c \
	src/measure/noise.c \
	src/measure/starclass.c src/measure/starclass.h \
	src/measure/view.c src/measure/view.h \
	src/measure/window.c src/measure/window.h

rx_measuredir = $(pkgincludedir)/measure
rx_measure_HEADERS = src/measure/measure.h src/measure/noise.h
installed_headers += $(rx_measure_HEADERS)
