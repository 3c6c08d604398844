librextract_la_SOURCES += \
	src/check/blankcheck.c src/check/blankcheck.h \
	src/check/checks.c src/check/checks.h \
	src/check/choice.c src/check/choice.h \
	src/check/conformal.c src/check/conformal.h \
	src/check/params.h \
	src/check/quality.c src/check/quality.h \
	src/check/replica.c src/check/replica.h \
	src/check/restored_noise.c src/check/restored_noise.h \
	src/check/selfcheck.c src/check/selfcheck.h \
	src/check/selfcheck_plan.c src/check/selfcheck_plan.h
