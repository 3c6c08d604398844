dist_man_MANS = man/rextract.1 man/rextract-simulate.1 man/rextract-validate.1 man/rextract-train.1 man/rextract-survey.1 man/rextract.conf.5 man/rextract.3
noinst_PROGRAMS += man/make_man
man_make_man_SOURCES = man/make_man.c
script_tests += man/check-man.sh man/run-examples.sh

# make html: the pages for a browser, html/index.html first.
html-local:
	@command -v mandoc >/dev/null || { echo 'make html needs mandoc (Debian: mandoc)' >&2; exit 1; }
	$(AM_V_GEN)rm -rf html && mkdir html && top='$(srcdir)' sh '$(srcdir)'/man/html.sh $(dist_man_MANS)
clean-local:
	rm -rf html
EXTRA_DIST += man/html.sh
