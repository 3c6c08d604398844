noinst_PROGRAMS += tests/unit/par/mpi_ranks
tests_unit_par_mpi_ranks_SOURCES = tests/unit/par/mpi_ranks.c
tests_unit_par_mpi_ranks_LDADD = librextract-train.la librextract-all.la $(RX_LIBS)
tests_unit_par_mpi_ranks_CPPFLAGS = $(AM_CPPFLAGS) -include $(top_builddir)/configuration-mpi.h
