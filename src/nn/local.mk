librextract_la_SOURCES += src/nn/front.h
librextract_la_SOURCES += src/nn/model.c src/nn/model.h src/nn/model_parts.h
librextract_la_SOURCES += src/nn/model_describe.c
librextract_la_SOURCES += src/nn/model_read.c
librextract_la_SOURCES += src/nn/model_write.c
librextract_la_SOURCES += src/nn/deblur.c src/nn/deblur.h
librextract_la_SOURCES += src/nn/rl_step.c src/nn/rl_step.h
