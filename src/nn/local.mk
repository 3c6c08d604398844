librextract_la_SOURCES += src/nn/front.h
