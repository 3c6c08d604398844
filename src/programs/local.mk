bin_PROGRAMS += rextract
rextract_SOURCES = src/programs/rextract.c
