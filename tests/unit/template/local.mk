check_PROGRAMS += tests/unit/template/test_template tests/unit/template/test_template_pulls \
	tests/unit/template/test_template_faint tests/unit/template/test_template_shapes \
	tests/unit/template/test_template_correlated tests/unit/template/test_template_crowd \
	tests/unit/template/test_template_models
tests_unit_template_test_template_SOURCES = tests/unit/template/test_template.c tests/unit/template/field.c \
	tests/unit/template/field.h
tests_unit_template_test_template_pulls_SOURCES = tests/unit/template/test_template_pulls.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_faint_SOURCES = tests/unit/template/test_template_faint.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_shapes_SOURCES = tests/unit/template/test_template_shapes.c
tests_unit_template_test_template_crowd_SOURCES = tests/unit/template/test_template_crowd.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_correlated_SOURCES = tests/unit/template/test_template_correlated.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_models_SOURCES = tests/unit/template/test_template_models.c \
	tests/unit/template/field.c tests/unit/template/field.h
