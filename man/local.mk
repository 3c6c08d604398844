dist_man_MANS = man/rextract.1 man/rextract-simulate.1 man/rextract-validate.1 man/rextract-train.1 man/rextract-survey.1 man/rextract.conf.5 man/rextract.3
noinst_PROGRAMS += man/make_man
man_make_man_SOURCES = man/make_man.c
script_tests += man/check-man.sh man/run-examples.sh
