librextract_la_SOURCES += \
	src/fit/hits.c src/fit/hits.h \
	src/fit/lines.c src/fit/lines.h \
	src/fit/preal.c \
	src/fit/significance.c src/fit/significance.h \
	src/fit/sky_mesh.c src/fit/sky_mesh.h \
	src/fit/structure.c src/fit/structure.h

rx_fitdir = $(pkgincludedir)/fit
rx_fit_HEADERS = src/fit/preal.h
installed_headers += $(rx_fit_HEADERS)
