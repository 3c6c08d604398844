librextract_la_SOURCES += \
	src/report/ecsv.c src/report/ecsv.h \
	src/report/escape.c src/report/escape.h \
	src/report/figure.c src/report/figure.h \
	src/report/gnuplot.c src/report/gnuplot.h \
	src/report/json.c src/report/json.h \
	src/report/plot.c \
	src/report/qa_figures.c \
	src/report/qa_page.c src/report/qa_page.h \
	src/report/qa_tables.c src/report/qa_tables.h \
	src/report/report.c src/report/report.h \
	src/report/report_table.c src/report/report_table.h \
	src/report/tile_figures.c \
	src/report/tile_page.c src/report/tile_page.h
