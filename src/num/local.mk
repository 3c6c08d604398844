librextract_la_SOURCES += src/num/stats.c src/num/stats.h
