check_PROGRAMS += tests/unit/stage/test_names tests/unit/stage/test_reference tests/unit/stage/test_record
tests_unit_stage_test_names_SOURCES = tests/unit/stage/test_names.c
tests_unit_stage_test_reference_SOURCES = tests/unit/stage/test_reference.c
tests_unit_stage_test_record_SOURCES = tests/unit/stage/test_record.c
check_PROGRAMS += tests/unit/stage/test_stage
tests_unit_stage_test_stage_SOURCES = tests/unit/stage/test_stage.c tests/unit/stage/scene.c tests/unit/stage/scene.h
check_PROGRAMS += tests/unit/stage/test_fluxcheck
tests_unit_stage_test_fluxcheck_SOURCES = tests/unit/stage/test_fluxcheck.c tests/unit/stage/scene.c tests/unit/stage/scene.h
