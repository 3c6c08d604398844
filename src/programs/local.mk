bin_PROGRAMS += rextract rextract-survey rextract-simulate rextract-validate rextract-train
rx_program = src/programs/program.c src/programs/program.h src/programs/reserve.c
rx_extract = src/programs/extract.c src/programs/extract.h $(rx_program)
rextract_SOURCES = src/programs/rextract.c $(rx_extract)
rextract_LDADD = librextract-lab.la librextract-all.la $(RX_LIBS)
if HAVE_MPI
bin_PROGRAMS += rextract-mpi
rextract_mpi_SOURCES = src/programs/rextract_mpi.c $(rx_extract)
rextract_mpi_LDADD = librextract-train.la librextract-lab.la librextract-all.la $(RX_LIBS)
endif
rextract_survey_SOURCES = src/programs/rextract_survey.c $(rx_program)
rextract_survey_LDADD = librextract-lab.la librextract-all.la $(RX_LIBS)
rextract_simulate_SOURCES = src/programs/rextract_simulate.c $(rx_program)
rextract_simulate_LDADD = librextract-all.la $(RX_LIBS)
rextract_validate_SOURCES = src/programs/rextract_validate.c $(rx_program)
rextract_validate_LDADD = librextract-lab.la librextract-all.la $(RX_LIBS)
rextract_train_SOURCES = src/programs/rextract_train.c $(rx_program)
rextract_train_LDADD = librextract-train.la librextract-lab.la librextract-all.la $(RX_LIBS)
