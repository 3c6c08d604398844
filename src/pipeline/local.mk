librextract_la_SOURCES += \
	src/pipeline/crowd_psf.c src/pipeline/crowd_psf.h \
	src/pipeline/domain.c src/pipeline/domain.h \
	src/pipeline/facts.c \
	src/pipeline/field.c src/pipeline/field.h \
	src/pipeline/field_mask.c src/pipeline/field_mask.h \
	src/pipeline/field_new.c \
	src/pipeline/field_noise.c src/pipeline/field_noise.h \
	src/pipeline/fluxcheck.c src/pipeline/fluxcheck.h \
	src/pipeline/params.h \
	src/pipeline/photometry.c src/pipeline/photometry.h \
	src/pipeline/pipeline.c src/pipeline/pipeline.h \
	src/pipeline/positions.c src/pipeline/positions.h \
	src/pipeline/proposals.c src/pipeline/proposals.h \
	src/pipeline/prepare.c src/pipeline/prepare.h \
	src/pipeline/psf_source.c src/pipeline/psf_source.h \
	src/pipeline/residual.c src/pipeline/residual.h \
	src/pipeline/saturated.c src/pipeline/saturated.h \
	src/pipeline/template_extra.c src/pipeline/template_extra.h \
	src/pipeline/template_fit.c src/pipeline/template_fit.h

rx_pipelinedir = $(pkgincludedir)/pipeline
rx_pipeline_HEADERS = src/pipeline/domain.h src/pipeline/field.h src/pipeline/fluxcheck.h src/pipeline/params.h \
	src/pipeline/photometry.h src/pipeline/pipeline.h src/pipeline/residual.h src/pipeline/template_fit.h
installed_headers += $(rx_pipeline_HEADERS)
