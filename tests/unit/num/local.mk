check_PROGRAMS += tests/unit/num/test_stats
tests_unit_num_test_stats_SOURCES = tests/unit/num/test_stats.c
