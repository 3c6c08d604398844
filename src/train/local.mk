librextract_train_la_SOURCES += src/train/sample.h
