librextract_la_SOURCES += src/restore/restore.c src/restore/restore.h
librextract_la_SOURCES += src/restore/none.c src/restore/none.h
librextract_la_SOURCES += src/restore/richardson_lucy.c src/restore/richardson_lucy.h
librextract_la_SOURCES += src/restore/rl_blind.c src/restore/rl_blind.h
librextract_la_SOURCES += src/restore/blur.c src/restore/blur.h
librextract_la_SOURCES += src/restore/prepared.c src/restore/prepared.h
librextract_la_SOURCES += src/restore/stamp.c src/restore/stamp.h
librextract_la_SOURCES += src/restore/points.c src/restore/points.h
