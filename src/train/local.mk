librextract_train_la_SOURCES += src/train/sample.h
librextract_train_la_SOURCES += src/train/sample.c
librextract_train_la_SOURCES += src/train/selection.c src/train/selection.h
librextract_train_la_SOURCES += src/train/loss.c src/train/loss.h
librextract_train_la_SOURCES += src/train/loss_ffl.c
