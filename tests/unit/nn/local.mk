check_PROGRAMS += tests/unit/nn/test_model
tests_unit_nn_test_model_SOURCES = tests/unit/nn/test_model.c
check_PROGRAMS += tests/unit/nn/test_deblur
tests_unit_nn_test_deblur_SOURCES = tests/unit/nn/test_deblur.c
