bin_PROGRAMS += rextract
rextract_SOURCES = src/programs/rextract.c
rextract_LDADD = librextract.la $(RX_LIBS)
