librextract_la_SOURCES += src/data/data.c
librextract_la_SOURCES += src/data/psf.h
librextract_la_SOURCES += src/data/restored.h
librextract_la_SOURCES += src/data/sources.h
librextract_la_SOURCES += src/data/table.c src/data/table.h
librextract_la_SOURCES += src/data/tile.h
