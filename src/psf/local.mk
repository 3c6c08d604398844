librextract_la_SOURCES += src/psf/psf.c
librextract_la_SOURCES += src/psf/psf_files.c src/psf/psf_files.h src/psf/psf_images.c src/psf/psf_psfex.c src/psf/psf_psfex.h
librextract_la_SOURCES += src/psf/psf_estimate.c src/psf/psf_facts.c
librextract_la_SOURCES += src/psf/psf_stars.c src/psf/psf_stars.h
librextract_la_SOURCES += src/psf/psf_measure.c src/psf/psf_model.c src/psf/psf_model.h
librextract_la_SOURCES += src/psf/psf_fit.c src/psf/psf_fit.h src/psf/psf_rings.c src/psf/psf_rings.h
librextract_la_SOURCES += src/psf/psf_profile.c src/psf/psf_profile.h
librextract_la_SOURCES += src/psf/psf_stretch.c src/psf/psf_stretch.h
librextract_la_SOURCES += src/psf/moffat.c src/psf/moffat.h
librextract_la_SOURCES += src/psf/moffat_fit.c src/psf/moffat_fit.h
librextract_la_SOURCES += src/psf/resample.c src/psf/resample.h

rx_psfdir = $(pkgincludedir)/psf
rx_psf_HEADERS = src/psf/params.h src/psf/psf.h
installed_headers += $(rx_psf_HEADERS)
