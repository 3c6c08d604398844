librextract_train_la_SOURCES += src/par/ranks.c src/par/ranks.h src/par/transport.h
librextract_train_la_SOURCES += src/par/ranks_threads.c
librextract_train_la_SOURCES += src/par/ranks_mpi.c
