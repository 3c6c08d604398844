check_PROGRAMS += tests/unit/nn/test_model
tests_unit_nn_test_model_SOURCES = tests/unit/nn/test_model.c
