check_PROGRAMS += tests/unit/template/test_template tests/unit/template/test_template_parts \
	tests/unit/template/test_template_pulls tests/unit/template/test_template_faint \
	tests/unit/template/test_template_shapes tests/unit/template/test_template_pixels \
	tests/unit/template/test_template_sources tests/unit/template/test_template_refine \
	tests/unit/template/test_template_structure tests/unit/template/test_template_chain \
	tests/unit/template/test_template_correlated tests/unit/template/test_template_crowd
tests_unit_template_test_template_SOURCES = tests/unit/template/test_template.c tests/unit/template/field.c \
	tests/unit/template/field.h
tests_unit_template_test_template_parts_SOURCES = tests/unit/template/test_template_parts.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_pulls_SOURCES = tests/unit/template/test_template_pulls.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_faint_SOURCES = tests/unit/template/test_template_faint.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_shapes_SOURCES = tests/unit/template/test_template_shapes.c
tests_unit_template_test_template_pixels_SOURCES = tests/unit/template/test_template_pixels.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_sources_SOURCES = tests/unit/template/test_template_sources.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_structure_SOURCES = tests/unit/template/test_template_structure.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_refine_SOURCES = tests/unit/template/test_template_refine.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_chain_SOURCES = tests/unit/template/test_template_chain.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_crowd_SOURCES = tests/unit/template/test_template_crowd.c \
	tests/unit/template/field.c tests/unit/template/field.h
tests_unit_template_test_template_correlated_SOURCES = tests/unit/template/test_template_correlated.c \
	tests/unit/template/field.c tests/unit/template/field.h
