librextract_la_SOURCES += \
	src/fit/artefacts.c src/fit/artefacts.h \
	src/fit/significance.c src/fit/significance.h \
	src/fit/sky_mesh.c src/fit/sky_mesh.h \
	src/fit/structure.c src/fit/structure.h
