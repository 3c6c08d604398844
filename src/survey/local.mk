librextract_lab_la_SOURCES += \
	src/survey/file_names.c src/survey/file_names.h \
	src/survey/outcome.c src/survey/outcome.h \
	src/survey/replay.c src/survey/replay.h \
	src/survey/rollup.c src/survey/rollup.h \
	src/survey/rollup_figures.c \
	src/survey/rollup_junit.c \
	src/survey/rollup_quality.c src/survey/rollup_quality.h \
	src/survey/rollup_report.c src/survey/rollup_report.h \
	src/survey/rollup_run.c src/survey/rollup_run.h \
	src/survey/rollup_sky.c \
	src/survey/survey.c src/survey/survey.h \
	src/survey/tile_record.c src/survey/tile_record.h \
	src/survey/tile_run.c src/survey/tile_run.h
librextract_train_la_SOURCES += src/survey/survey_ranks.c src/survey/survey_ranks.h
