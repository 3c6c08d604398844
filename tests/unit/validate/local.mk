check_PROGRAMS += \
	tests/unit/validate/test_binomial \
	tests/unit/validate/test_completeness \
	tests/unit/validate/test_escape \
	tests/unit/validate/test_gates \
	tests/unit/validate/test_hypothesis \
	tests/unit/validate/test_image_metrics \
	tests/unit/validate/test_match \
	tests/unit/validate/test_metrics \
	tests/unit/validate/test_page \
	tests/unit/validate/test_pr \
	tests/unit/validate/test_report \
	tests/unit/validate/test_rho \
	tests/unit/validate/test_tally \
	tests/unit/validate/test_wilcoxon
tests_unit_validate_test_binomial_SOURCES = tests/unit/validate/test_binomial.c
tests_unit_validate_test_completeness_SOURCES = tests/unit/validate/test_completeness.c
tests_unit_validate_test_escape_SOURCES = tests/unit/validate/test_escape.c
tests_unit_validate_test_gates_SOURCES = tests/unit/validate/test_gates.c
tests_unit_validate_test_hypothesis_SOURCES = tests/unit/validate/test_hypothesis.c
tests_unit_validate_test_image_metrics_SOURCES = tests/unit/validate/test_image_metrics.c
tests_unit_validate_test_match_SOURCES = tests/unit/validate/test_match.c
tests_unit_validate_test_metrics_SOURCES = tests/unit/validate/test_metrics.c
tests_unit_validate_test_page_SOURCES = tests/unit/validate/test_page.c
tests_unit_validate_test_pr_SOURCES = tests/unit/validate/test_pr.c
tests_unit_validate_test_tally_SOURCES = tests/unit/validate/test_tally.c
tests_unit_validate_test_report_SOURCES = tests/unit/validate/test_report.c
tests_unit_validate_test_rho_SOURCES = tests/unit/validate/test_rho.c
tests_unit_validate_test_wilcoxon_SOURCES = tests/unit/validate/test_wilcoxon.c
