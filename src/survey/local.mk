librextract_lab_la_SOURCES += \
	src/survey/rollup.c src/survey/rollup.h src/survey/rollup_facts.def \
	src/survey/rollup_figures.c src/survey/rollup_quality.c src/survey/rollup_report.c \
	src/survey/survey.c src/survey/survey.h \
	src/survey/tile_record.c src/survey/tile_record.h
librextract_train_la_SOURCES += src/survey/survey_ranks.c
