librextract_la_SOURCES += \
	src/report/report.c src/report/report.h \
	src/report/report_table.c src/report/report_table.h
