check_PROGRAMS += \
	tests/unit/quality/test_completeness \
	tests/unit/quality/test_gates \
	tests/unit/quality/test_image_metrics \
	tests/unit/quality/test_match \
	tests/unit/quality/test_metrics \
	tests/unit/quality/test_rho \
	tests/unit/quality/test_statistics \
	tests/unit/quality/test_tally
tests_unit_quality_test_completeness_SOURCES = tests/unit/quality/test_completeness.c
tests_unit_quality_test_gates_SOURCES = tests/unit/quality/test_gates.c
tests_unit_quality_test_image_metrics_SOURCES = tests/unit/quality/test_image_metrics.c
tests_unit_quality_test_match_SOURCES = tests/unit/quality/test_match.c
tests_unit_quality_test_metrics_SOURCES = tests/unit/quality/test_metrics.c
tests_unit_quality_test_rho_SOURCES = tests/unit/quality/test_rho.c
tests_unit_quality_test_statistics_SOURCES = tests/unit/quality/test_statistics.c
tests_unit_quality_test_tally_SOURCES = tests/unit/quality/test_tally.c
