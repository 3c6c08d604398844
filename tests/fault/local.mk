# The programs once more, with every request for memory of our own code led through fault.c.
noinst_PROGRAMS += tests/fault/fault tests/fault/fault_simulate tests/fault/fault_survey
fault_common = tests/fault/fault.c src/programs/program.c src/programs/reserve.c
fault_flags = $(AM_LDFLAGS) -Wl,--wrap=malloc -Wl,--wrap=calloc -Wl,--wrap=realloc -Wl,--wrap=aligned_alloc \
	-Wl,--wrap=strdup -Wl,--wrap=strndup -Wl,--wrap=realpath -Wl,--wrap=fftwf_malloc
tests_fault_fault_SOURCES = tests/fault/fault_rextract.c src/programs/extract.c $(fault_common)
tests_fault_fault_LDADD = librextract-lab.la librextract-all.la $(RX_LIBS)
tests_fault_fault_LDFLAGS = $(fault_flags)
tests_fault_fault_simulate_SOURCES = tests/fault/fault_simulate.c $(fault_common)
tests_fault_fault_simulate_LDADD = librextract-all.la $(RX_LIBS)
tests_fault_fault_simulate_LDFLAGS = $(fault_flags)
tests_fault_fault_survey_SOURCES = tests/fault/fault_survey.c $(fault_common)
tests_fault_fault_survey_LDADD = librextract-lab.la librextract-all.la $(RX_LIBS)
tests_fault_fault_survey_LDFLAGS = $(fault_flags)
EXTRA_DIST += tests/fault/refuse.c
noinst_PROGRAMS += tests/fault/trouble
tests_fault_trouble_SOURCES = tests/fault/trouble.c
script_tests += tests/fault/trouble.sh tests/fault/kill.sh
