check_PROGRAMS += tests/unit/simulate/test_optics
tests_unit_simulate_test_optics_SOURCES = tests/unit/simulate/test_optics.c
check_PROGRAMS += tests/unit/simulate/test_render
tests_unit_simulate_test_render_SOURCES = tests/unit/simulate/test_render.c
check_PROGRAMS += tests/unit/simulate/test_noise
tests_unit_simulate_test_noise_SOURCES = tests/unit/simulate/test_noise.c
