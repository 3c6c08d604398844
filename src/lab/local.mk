librextract_lab_la_SOURCES += \
	src/lab/campaign.c src/lab/campaign.h src/lab/journal.c src/lab/journal.h src/lab/facts.c \
	src/lab/lab.c src/lab/lab.h src/lab/sky.c \
	src/lab/report.c src/lab/report.h \
	src/lab/restoration.c src/lab/restoration.h \
	src/lab/restoration_report.c \
	src/lab/sources.c src/lab/sources.h src/lab/sources_report.c src/lab/photometry.c src/lab/detection.c
