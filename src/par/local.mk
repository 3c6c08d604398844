librextract_train_la_SOURCES += src/par/ranks.h
