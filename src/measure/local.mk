librextract_la_SOURCES += \
	src/measure/aperture.c \
	src/measure/growth.c \
	src/measure/isophote.c \
	src/measure/noise_law.c \
	src/measure/run.c \
	src/measure/starclass.c src/measure/starclass.h \
	src/measure/view.c src/measure/view.h \
	src/measure/window.c

rx_measuredir = $(pkgincludedir)/measure
rx_measure_HEADERS = src/measure/measure.h src/measure/noise.h
installed_headers += $(rx_measure_HEADERS)
