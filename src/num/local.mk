librextract_la_SOURCES += src/num/stats.c src/num/stats.h
librextract_la_SOURCES += src/num/fft.c src/num/fft.h src/num/convolve.c src/num/convolve.h
librextract_la_SOURCES += src/num/lsq.c src/num/lsq.h
librextract_la_SOURCES += src/num/normal.c src/num/normal.h
librextract_la_SOURCES += src/num/maximum_filter.c src/num/maximum_filter.h
librextract_la_SOURCES += src/num/special.c src/num/special.h
