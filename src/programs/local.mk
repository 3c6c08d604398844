bin_PROGRAMS += rextract
rextract_SOURCES = src/programs/rextract.c src/programs/program.c src/programs/program.h
rextract_LDADD = librextract.la $(RX_LIBS)
