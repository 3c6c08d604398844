librextract_la_SOURCES += \
	src/stage/checkimages.c src/stage/checkimages.h \
	src/stage/coordinates.c src/stage/coordinates.h \
	src/stage/domain_facts.c src/stage/domain_facts.h \
	src/stage/extract.c src/stage/extract.h \
	src/stage/job.c \
	src/stage/listed_objects.c src/stage/listed_objects.h \
	src/stage/open.c src/stage/open.h \
	src/stage/options.c src/stage/options.h \
	src/stage/pipeline.c src/stage/pipeline.h \
	src/stage/plan.c src/stage/plan.h \
	src/stage/positions.c src/stage/positions.h \
	src/stage/provenance.c src/stage/provenance.h \
	src/stage/psf_hints.c src/stage/psf_hints.h \
	src/stage/reference.c src/stage/reference.h \
	src/stage/report.c src/stage/report.h \
	src/stage/run_xml.c src/stage/run_xml.h \
	src/stage/template_table.c src/stage/template_table.h \
	src/stage/tile_facts.c src/stage/tile_facts.h \
	src/stage/stage.c

librextract_la_SOURCES += \
	src/stage/simulation.c src/stage/simulation.h
librextract_la_SOURCES += src/stage/stage.h

rx_stagedir = $(pkgincludedir)/stage
rx_stage_HEADERS = src/stage/job.h src/stage/pipeline.h
installed_headers += $(rx_stage_HEADERS)
