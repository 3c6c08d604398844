check_PROGRAMS += tests/unit/stage/test_reference tests/unit/stage/test_record
tests_unit_stage_test_reference_SOURCES = tests/unit/stage/test_reference.c
tests_unit_stage_test_record_SOURCES = tests/unit/stage/test_record.c
check_PROGRAMS += tests/unit/stage/test_stage tests/unit/stage/test_options tests/unit/stage/test_simulation
tests_unit_stage_test_stage_SOURCES = tests/unit/stage/test_stage.c tests/unit/pipeline/scene.c
tests_unit_stage_test_options_SOURCES = tests/unit/stage/test_options.c
tests_unit_stage_test_simulation_SOURCES = tests/unit/stage/test_simulation.c
