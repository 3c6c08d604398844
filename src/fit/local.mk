librextract_la_SOURCES += \
	src/fit/hits.c src/fit/hits.h \
	src/fit/significance.c src/fit/significance.h \
	src/fit/sky_mesh.c src/fit/sky_mesh.h \
	src/fit/structure.c src/fit/structure.h
