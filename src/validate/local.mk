librextract_la_SOURCES += \
	src/validate/binomial.c src/validate/binomial.h \
	src/validate/bootstrap.c src/validate/bootstrap.h \
	src/validate/brief.c \
	src/validate/completeness.c src/validate/completeness.h \
	src/validate/ecsv.c src/validate/ecsv.h \
	src/validate/escape.c src/validate/escape.h \
	src/validate/evaluate.c src/validate/evaluate.h \
	src/validate/figure.c src/validate/figure.h \
	src/validate/gates.c src/validate/gates.h \
	src/validate/gnuplot.c src/validate/gnuplot.h \
	src/validate/hypothesis.c src/validate/hypothesis.h \
	src/validate/image_metrics.c src/validate/image_metrics.h \
	src/validate/json.c src/validate/json.h \
	src/validate/match.c src/validate/match.h \
	src/validate/metrics.c src/validate/metrics.h \
	src/validate/page.c src/validate/page.h \
	src/validate/plot.c \
	src/validate/pr.c src/validate/pr.h \
	src/validate/qa.c src/validate/qa.h src/validate/qa_writers.h \
	src/validate/qa_figures.c \
	src/validate/qa_json.c \
	src/validate/qa_page.c \
	src/validate/qa_psf.c \
	src/validate/qa_tables.c \
	src/validate/report_file.c src/validate/report_file.h \
	src/validate/rho.c src/validate/rho.h \
	src/validate/sample.c src/validate/sample.h \
	src/validate/tally.c src/validate/tally.h \
	src/validate/wilcoxon.c
