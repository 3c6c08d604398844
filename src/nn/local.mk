librextract_la_SOURCES += src/nn/model.c src/nn/model_file.c
librextract_la_SOURCES += src/nn/model_describe.c
librextract_la_SOURCES += src/nn/deblur.c src/nn/deblur.h
librextract_la_SOURCES += src/nn/rl_step.c src/nn/rl_step.h
librextract_la_SOURCES += src/nn/direct.c src/nn/direct.h src/nn/direct_kernels.h
librextract_la_SOURCES += src/nn/plane.h
librextract_la_SOURCES += src/nn/net.c
librextract_la_SOURCES += src/nn/psfnet.c src/nn/psfnet.h
librextract_la_SOURCES += src/nn/layers.c src/nn/layers.h
librextract_la_SOURCES += src/nn/stream.c src/nn/stream.h
librextract_la_SOURCES += src/nn/noise_level.c

# One source, compiled for vectors of 4, 8 and 16 floats.
direct_kernels = librextract-direct4.la librextract-direct8.la librextract-direct16.la
noinst_LTLIBRARIES += $(direct_kernels)
librextract_la_LIBADD += $(direct_kernels)
librextract_all_la_LIBADD = $(direct_kernels)
librextract_direct4_la_SOURCES = src/nn/direct_kernels.c
librextract_direct8_la_SOURCES = src/nn/direct_kernels.c
librextract_direct16_la_SOURCES = src/nn/direct_kernels.c
librextract_direct4_la_CPPFLAGS = $(AM_CPPFLAGS) -DRX_LANES=4
librextract_direct8_la_CPPFLAGS = $(AM_CPPFLAGS) -DRX_LANES=8
librextract_direct16_la_CPPFLAGS = $(AM_CPPFLAGS) -DRX_LANES=16

# Of training alone.
librextract_train_la_SOURCES += src/nn/runner.c src/nn/runner.h

rx_nndir = $(pkgincludedir)/nn
rx_nn_HEADERS = src/nn/front.h src/nn/model.h src/nn/net.h src/nn/noise_level.h
installed_headers += $(rx_nn_HEADERS)
