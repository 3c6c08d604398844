# Hundreds of runs of a millisecond, of which nothing is to be found: no sanitizers, no threads.
noinst_PROGRAMS += tests/cli/make_fits tests/cli/list_files
tests_cli_make_fits_SOURCES = tests/cli/make_fits.c
tests_cli_make_fits_CFLAGS = -std=c11 -Wall -Wextra -Wpedantic
tests_cli_make_fits_LDFLAGS =
tests_cli_make_fits_LDADD = -lm
tests_cli_list_files_SOURCES = tests/cli/list_files.c
tests_cli_list_files_CFLAGS = $(tests_cli_make_fits_CFLAGS)
tests_cli_list_files_LDFLAGS =
tests_cli_list_files_LDADD =
noinst_PROGRAMS += tests/cli/make_model
tests_cli_make_model_SOURCES = tests/cli/make_model.c
tests_cli_make_model_LDADD = librextract-all.la $(RX_LIBS)
script_tests += tests/promises.sh tests/soak.sh tests/cli/bench.sh tests/train.sh tests/trainings.sh
dist_noinst_DATA += tests/cli/cases/config.sh tests/cli/cases/input.sh tests/cli/cases/output.sh tests/cli/cases/overwrite.sh tests/cli/cases/record.sh \
	tests/cli/cases/selfcheck.sh tests/cli/cases/simulate.sh tests/cli/cases/system.sh tests/cli/cases/train.sh tests/cli/cases/usage.sh \
	tests/cli/cases/validate.sh
dist_noinst_DATA += tests/cli/cases/network.sh tests/cli/cases/template.sh tests/cli/cases/hostile.sh tests/cli/cases/psf.sh tests/cli/cases/restored.sh tests/cli/cases/list.sh
