check_PROGRAMS += tests/unit/template/test_template tests/unit/template/test_template_parts \
	tests/unit/template/test_template_pulls tests/unit/template/test_template_faint
tests_unit_template_test_template_SOURCES = tests/unit/template/test_template.c tests/unit/template/field.c \
	tests/unit/template/field.h
tests_unit_template_test_template_parts_SOURCES = tests/unit/template/test_template_parts.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_pulls_SOURCES = tests/unit/template/test_template_pulls.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_faint_SOURCES = tests/unit/template/test_template_faint.c \
	tests/unit/template/field.c tests/unit/template/field.h
