# The program once more, with every request for memory of our own code led through fault.c.
noinst_PROGRAMS += tests/fault/fault
tests_fault_fault_SOURCES = tests/fault/fault.c tests/fault/program.c src/programs/program.c
tests_fault_fault_LDADD = librextract.la $(RX_LIBS)
tests_fault_fault_LDFLAGS = $(AM_LDFLAGS) -Wl,--wrap=malloc -Wl,--wrap=calloc -Wl,--wrap=realloc \
	-Wl,--wrap=strdup -Wl,--wrap=strndup -Wl,--wrap=realpath -Wl,--wrap=fftwf_malloc
script_tests += tests/fault/run.sh
