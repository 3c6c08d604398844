librextract_la_SOURCES += src/psf/psf.c src/psf/psf.h src/psf/psf_parts.h
librextract_la_SOURCES += src/psf/moffat.c src/psf/moffat.h
librextract_la_SOURCES += src/psf/moffat_fit.c src/psf/moffat_fit.h
librextract_la_SOURCES += src/psf/psf_image.c src/psf/psfex.c
librextract_la_SOURCES += src/psf/psf_stars.c src/psf/psf_stars.h src/psf/psf_estimate.c src/psf/psf_make.c
