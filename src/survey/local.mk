librextract_la_SOURCES += \
	src/survey/outcome.c src/survey/outcome.h \
	src/survey/survey.c src/survey/survey.h \
	src/survey/tile_record.c src/survey/tile_record.h \
	src/survey/tile_run.c src/survey/tile_run.h
librextract_train_la_SOURCES += src/survey/survey_ranks.c src/survey/survey_ranks.h
