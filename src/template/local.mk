librextract_la_SOURCES += \
	src/template/blends.c src/template/blends.h \
	src/template/canvas.c src/template/canvas.h \
	src/template/crowd.c src/template/crowd.h \
	src/template/evidence.c src/template/evidence.h \
	src/template/fit.c src/template/fit.h \
	src/template/grain.c src/template/grain.h \
	src/template/joint.c src/template/joint.h \
	src/template/judge.c src/template/judge.h \
	src/template/leftover.c src/template/leftover.h \
	src/template/lens.c src/template/lens.h \
	src/template/patch.c src/template/patch.h \
	src/template/refine.c src/template/refine.h \
	src/template/sheet.c src/template/sheet.h \
	src/template/spergel.c src/template/spergel.h \
	src/template/subjects.c src/template/subjects.h \
	src/template/substructure.c src/template/substructure.h \
	src/template/template.c \
	src/template/tphot.c src/template/tphot.h \
	src/template/turns.c src/template/turns.h \
	src/template/undersky.c src/template/undersky.h \
	src/template/unseen.c src/template/unseen.h \
	src/template/usual.c src/template/usual.h

rx_templatedir = $(pkgincludedir)/template
rx_template_HEADERS = src/template/template.h
installed_headers += $(rx_template_HEADERS)
