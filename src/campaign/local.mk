librextract_la_SOURCES += src/campaign/results.c src/campaign/results.h
librextract_la_SOURCES += src/campaign/journal.c src/campaign/journal.h
