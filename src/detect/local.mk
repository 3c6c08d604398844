librextract_la_SOURCES += \
	src/detect/background.c src/detect/background.h \
	src/detect/clean.c src/detect/clean.h \
	src/detect/detect.c src/detect/detect.h \
	src/detect/sep_extract.c src/detect/sep_extract.h \
	src/detect/filter.c src/detect/filter.h \
	src/detect/groups.c src/detect/groups.h \
	src/detect/noise_planes.c src/detect/noise_planes.h \
	src/detect/libsep.h
