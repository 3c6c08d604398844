librextract_la_SOURCES += \
	src/quality/evaluate.c src/quality/evaluate.h \
	src/quality/gates.c src/quality/gates.h \
	src/quality/image_metrics.c src/quality/image_metrics.h \
	src/quality/match.c src/quality/match.h \
	src/quality/metrics.c src/quality/metrics.h \
	src/quality/pr.c src/quality/pr.h \
	src/quality/qa.h \
	src/quality/qa_numbers.c src/quality/qa_numbers.h \
	src/quality/rho.c src/quality/rho.h \
	src/quality/statistics.c src/quality/statistics.h \
	src/quality/tally.c src/quality/tally.h \
	src/quality/tile_quality.c src/quality/tile_quality.h
