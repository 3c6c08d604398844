check_PROGRAMS += tests/unit/num/test_stats
tests_unit_num_test_stats_SOURCES = tests/unit/num/test_stats.c
check_PROGRAMS += tests/unit/num/test_fft tests/unit/num/test_convolve
tests_unit_num_test_fft_SOURCES = tests/unit/num/test_fft.c
tests_unit_num_test_convolve_SOURCES = tests/unit/num/test_convolve.c
check_PROGRAMS += tests/unit/num/test_lsq
tests_unit_num_test_lsq_SOURCES = tests/unit/num/test_lsq.c
