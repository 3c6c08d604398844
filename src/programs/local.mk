bin_PROGRAMS += rextract rextract-simulate rextract-validate
rx_program = src/programs/program.c src/programs/program.h
rextract_SOURCES = src/programs/rextract.c $(rx_program)
rextract_LDADD = librextract.la $(RX_LIBS)
rextract_simulate_SOURCES = src/programs/rextract_simulate.c $(rx_program)
rextract_simulate_LDADD = librextract.la $(RX_LIBS)
rextract_validate_SOURCES = src/programs/rextract_validate.c $(rx_program)
rextract_validate_LDADD = librextract.la $(RX_LIBS)
