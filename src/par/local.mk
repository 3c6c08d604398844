librextract_train_la_SOURCES += src/par/ranks.c src/par/ranks.h
