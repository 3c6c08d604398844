# Fuzz targets. Everywhere: their seeds and damaged copies of them, by replay. With clang, make fuzz-programs
# in a build configured as tests/fuzz/smoke.sh does it: one program of libFuzzer for each target.
noinst_PROGRAMS += tests/fuzz/seeds tests/fuzz/replay tests/fuzz/headers
fuzz_common = tests/fuzz/fuzz.c tests/fuzz/fuzz.h tests/fuzz/targets.def
fuzz_targets = tests/fuzz/target_config.c tests/fuzz/target_records.c tests/fuzz/target_fits.c
fuzz_libs = librextract-train.la librextract-lab.la librextract-all.la $(RX_LIBS)
tests_fuzz_seeds_SOURCES = tests/fuzz/seeds.c $(fuzz_common)
tests_fuzz_seeds_LDADD = $(fuzz_libs)
tests_fuzz_replay_SOURCES = tests/fuzz/replay.c $(fuzz_common) $(fuzz_targets)
tests_fuzz_replay_LDADD = $(fuzz_libs)
tests_fuzz_headers_SOURCES = tests/fuzz/headers.c $(fuzz_common) $(fuzz_targets)
tests_fuzz_headers_LDADD = $(fuzz_libs)

script_tests += tests/fuzz/run.sh
EXTRA_DIST += tests/fuzz/README.md tests/fuzz/smoke.sh tests/fuzz/libfuzzer.c tests/fuzz/lsan.supp tests/fuzz/fits.dict tests/fuzz/text.dict tests/fuzz/texts

# In a build for clang, which tests/fuzz/smoke.sh makes: a program of libFuzzer for each target. The archive is
# there so that a program holds, and counts, no more than its target needs.
fuzz_compile = $(CC) $(DEFAULT_INCLUDES) $(AM_CPPFLAGS) $(CPPFLAGS) $(AM_CFLAGS) $(CFLAGS) -c
fuzz-programs: librextract-all.la librextract-lab.la librextract-train.la
	mkdir -p fuzz && rm -f fuzz/targets.a
	for name in fuzz target_config target_records target_fits; do \
	  $(fuzz_compile) -o fuzz/$$name.o '$(srcdir)'/tests/fuzz/$$name.c || exit 1; \
	done
	$(AR) rc fuzz/targets.a fuzz/fuzz.o fuzz/target_*.o
	for name in `$(SED) -n 's/^TARGET(\([a-z]*\),.*/\1/p' '$(srcdir)/tests/fuzz/targets.def'`; do \
	  $(fuzz_compile) -DFUZZ=fuzz_$$name -o fuzz/main.o '$(srcdir)/tests/fuzz/libfuzzer.c' && \
	  $(CC) $(CFLAGS) $(OPENMP_CFLAGS) -fsanitize=fuzzer -o fuzz/$$name fuzz/main.o fuzz/targets.a \
	    .libs/librextract-train.a .libs/librextract-lab.a .libs/librextract-all.a $(RX_LIBS) || exit 1; \
	done

# Some seconds of each, FUZZ_SECONDS; the build takes minutes, once.
FUZZ_SECONDS = 1
fuzz-smoke: tests/fuzz/seeds$(EXEEXT)
	RX_BUILD_DIR='$(abs_top_builddir)' srcdir='$(abs_top_srcdir)' sh '$(srcdir)'/tests/fuzz/smoke.sh $(FUZZ_SECONDS)
.PHONY: fuzz-programs fuzz-smoke
