librextract_la_SOURCES += \
	src/template/blends.c src/template/blends.h \
	src/template/fit_image.c src/template/fit_image.h \
	src/template/crowd.c src/template/crowd.h \
	src/template/evidence.c src/template/evidence.h \
	src/template/fit.c src/template/fit.h \
	src/template/correlated.c src/template/correlated.h \
	src/template/joint.c src/template/joint.h \
	src/template/template_chi2.c src/template/template_chi2.h \
	src/template/template_residual.c src/template/template_residual.h \
	src/template/template_otf.c src/template/template_otf.h \
	src/template/patch.c src/template/patch.h \
	src/template/refine.c src/template/refine.h \
	src/template/spergel.c src/template/spergel.h \
	src/template/sersic.c src/template/sersic.h \
	src/template/models.c src/template/models.h \
	src/template/fit_source.h src/template/fit_sources.c src/template/fit_sources.h \
	src/template/substructure.c src/template/substructure.h \
	src/template/template.c \
	src/template/tphot.c \
	src/template/two.c src/template/two.h \
	src/template/windows.c src/template/windows.h \
	src/template/residual_sky.c src/template/residual_sky.h \
	src/template/unseen.c src/template/unseen.h \
	src/template/prior.c src/template/prior.h

rx_templatedir = $(pkgincludedir)/template
rx_template_HEADERS = src/template/template.h src/template/tphot.h
installed_headers += $(rx_template_HEADERS)
