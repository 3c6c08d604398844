check_PROGRAMS += tests/unit/stage/test_reference tests/unit/stage/test_record
tests_unit_stage_test_reference_SOURCES = tests/unit/stage/test_reference.c
tests_unit_stage_test_record_SOURCES = tests/unit/stage/test_record.c
check_PROGRAMS += tests/unit/stage/test_stage
tests_unit_stage_test_stage_SOURCES = tests/unit/stage/test_stage.c tests/unit/stage/place.h tests/unit/stage/scene.c tests/unit/stage/scene.h
check_PROGRAMS += tests/unit/stage/test_fluxcheck
tests_unit_stage_test_fluxcheck_SOURCES = tests/unit/stage/test_fluxcheck.c tests/unit/stage/scene.c tests/unit/stage/scene.h
check_PROGRAMS += tests/unit/stage/test_options
tests_unit_stage_test_options_SOURCES = tests/unit/stage/test_options.c
check_PROGRAMS += tests/unit/stage/test_simulation
tests_unit_stage_test_simulation_SOURCES = tests/unit/stage/test_simulation.c tests/unit/stage/place.h
check_PROGRAMS += tests/unit/stage/test_probe tests/unit/stage/test_selfcheck
tests_unit_stage_test_probe_SOURCES = tests/unit/stage/test_probe.c tests/unit/stage/scene.c tests/unit/stage/scene.h \
	tests/unit/stage/bench.c tests/unit/stage/bench.h
tests_unit_stage_test_selfcheck_SOURCES = tests/unit/stage/test_selfcheck.c tests/unit/stage/place.h tests/unit/stage/scene.c \
	tests/unit/stage/scene.h tests/unit/stage/bench.c tests/unit/stage/bench.h
check_PROGRAMS += tests/unit/stage/test_domain
tests_unit_stage_test_domain_SOURCES = tests/unit/stage/test_domain.c tests/unit/stage/place.h tests/unit/stage/scene.c tests/unit/stage/scene.h \
	tests/unit/stage/bench.c tests/unit/stage/bench.h
check_PROGRAMS += tests/unit/stage/test_template_fit tests/unit/stage/test_template_bytes
desk = tests/unit/stage/desk.c tests/unit/stage/desk.h tests/unit/stage/scene.c tests/unit/stage/scene.h \
	tests/unit/stage/bench.c tests/unit/stage/bench.h
tests_unit_stage_test_template_fit_SOURCES = tests/unit/stage/test_template_fit.c $(desk)
tests_unit_stage_test_template_bytes_SOURCES = tests/unit/stage/test_template_bytes.c $(desk)
check_PROGRAMS += tests/unit/stage/test_saturated
tests_unit_stage_test_saturated_SOURCES = tests/unit/stage/test_saturated.c tests/unit/stage/scene.c tests/unit/stage/scene.h \
	tests/unit/stage/bench.c tests/unit/stage/bench.h
