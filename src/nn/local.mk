librextract_la_SOURCES += src/nn/front.h
librextract_la_SOURCES += src/nn/model.c src/nn/model.h src/nn/model_parts.h
librextract_la_SOURCES += src/nn/model_describe.c
librextract_la_SOURCES += src/nn/model_read.c
librextract_la_SOURCES += src/nn/model_write.c
