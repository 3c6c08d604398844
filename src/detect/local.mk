librextract_la_SOURCES += \
	src/detect/batches.c src/detect/batches.h \
	src/detect/background.c \
	src/detect/clean.c src/detect/clean.h \
	src/detect/correlation.c src/detect/correlation.h \
	src/detect/cutouts.c src/detect/cutouts.h \
	src/detect/detect.c src/detect/detections.h \
	src/detect/sep_extract.c src/detect/sep_extract.h \
	src/detect/filter.c src/detect/filter.h \
	src/detect/groups.c src/detect/groups.h \
	src/detect/hollow.c src/detect/hollow.h \
	src/detect/mesh.c src/detect/mesh.h \
	src/detect/no_data.c src/detect/no_data.h \
	src/detect/photons.c src/detect/photons.h \
	src/detect/saturation.c src/detect/saturation.h \
	src/detect/deblendable.c src/detect/deblendable.h \
	src/detect/threshold_noise.c src/detect/threshold_noise.h \
	src/detect/libsep.h

rx_detectdir = $(pkgincludedir)/detect
rx_detect_HEADERS = src/detect/background.h src/detect/detect.h src/detect/params.h
installed_headers += $(rx_detect_HEADERS)
