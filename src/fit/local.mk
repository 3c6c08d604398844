librextract_la_SOURCES += \
	src/fit/significance.c src/fit/significance.h
