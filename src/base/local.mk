librextract_la_SOURCES += src/base/error.c src/base/error.h
librextract_la_SOURCES += src/base/interrupt.c src/base/interrupt.h
librextract_la_SOURCES += src/base/log.c src/base/log.h
librextract_la_SOURCES += src/base/memory.c src/base/memory.h
librextract_la_SOURCES += src/base/random.c src/base/random.h
librextract_la_SOURCES += src/base/text.c src/base/text.h
