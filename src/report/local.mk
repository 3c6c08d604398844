librextract_la_SOURCES += \
	src/report/figure.c src/report/figure.h \
	src/report/formats.c src/report/formats.h \
	src/report/plot.c \
	src/report/qa_figures.c \
	src/report/qa_page.c src/report/qa_page.h \
	src/report/report.c src/report/report.h src/report/table.h \
	src/report/report_table.c src/report/report_table.h \
	src/report/tile_page.c src/report/tile_page.h
