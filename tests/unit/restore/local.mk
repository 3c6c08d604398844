check_PROGRAMS += tests/unit/restore/test_blur tests/unit/restore/test_stamp
check_PROGRAMS += tests/unit/restore/test_richardson_lucy tests/unit/restore/test_rl_blind tests/unit/restore/test_rl_flux
tests_unit_restore_test_blur_SOURCES = tests/unit/restore/test_blur.c tests/unit/restore/sky.h
tests_unit_restore_test_stamp_SOURCES = tests/unit/restore/test_stamp.c tests/unit/restore/sky.h
tests_unit_restore_test_richardson_lucy_SOURCES = tests/unit/restore/test_richardson_lucy.c tests/unit/restore/sky.h
tests_unit_restore_test_rl_blind_SOURCES = tests/unit/restore/test_rl_blind.c tests/unit/restore/sky.h
tests_unit_restore_test_rl_flux_SOURCES = tests/unit/restore/test_rl_flux.c tests/unit/restore/sky.h
