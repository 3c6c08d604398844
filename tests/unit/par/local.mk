check_PROGRAMS += tests/unit/par/test_ranks
tests_unit_par_test_ranks_SOURCES = tests/unit/par/test_ranks.c
tests_unit_par_test_ranks_LDADD = librextract-train.la $(LDADD)
