librextract_la_SOURCES += \
	src/template/blends.c src/template/blends.h \
	src/template/canvas.c src/template/canvas.h \
	src/template/evidence.c src/template/evidence.h \
	src/template/fit.c src/template/fit.h \
	src/template/joint.c src/template/joint.h \
	src/template/leftover.c src/template/leftover.h \
	src/template/lens.c src/template/lens.h \
	src/template/patch.c src/template/patch.h \
	src/template/refine.c src/template/refine.h \
	src/template/spergel.c src/template/spergel.h \
	src/template/subjects.c src/template/subjects.h \
	src/template/substructure.c src/template/substructure.h \
	src/template/template.c src/template/template.h \
	src/template/undersky.c src/template/undersky.h \
	src/template/usual.c src/template/usual.h
