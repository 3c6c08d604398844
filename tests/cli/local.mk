noinst_PROGRAMS += tests/cli/make_fits
tests_cli_make_fits_SOURCES = tests/cli/make_fits.c
tests_cli_make_fits_LDADD = -lm
script_tests += tests/cli/run.sh
dist_noinst_DATA += tests/cli/cases/config.sh tests/cli/cases/input.sh tests/cli/cases/output.sh \
	tests/cli/cases/selfcheck.sh tests/cli/cases/simulate.sh tests/cli/cases/system.sh tests/cli/cases/usage.sh \
	tests/cli/cases/validate.sh
