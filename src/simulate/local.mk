librextract_la_SOURCES += src/simulate/optics.c src/simulate/optics.h
librextract_la_SOURCES += src/simulate/render.c src/simulate/render.h
librextract_la_SOURCES += src/simulate/noise.c src/simulate/noise.h
librextract_la_SOURCES += src/simulate/scene.c src/simulate/scene.h
librextract_la_SOURCES += src/simulate/draw.c src/simulate/sersic.c src/simulate/sersic.h
librextract_la_SOURCES += src/simulate/templates.c src/simulate/templates.h
librextract_la_SOURCES += src/simulate/template_isolate.c
librextract_la_SOURCES += src/simulate/truth.c src/simulate/truth.h
librextract_la_SOURCES += src/simulate/coadd.c src/simulate/coadd.h
librextract_la_SOURCES += src/simulate/inject.c src/simulate/inject.h
librextract_la_SOURCES += src/simulate/sky_noise.c src/simulate/sky_noise.h
librextract_la_SOURCES += src/simulate/simulation.c src/simulate/simulation.h
# what only the trainer needs
librextract_train_la_SOURCES += src/simulate/sky_field.c src/simulate/sky_field.h
librextract_train_la_SOURCES += src/simulate/survey_sky.c src/simulate/survey_sky.h
