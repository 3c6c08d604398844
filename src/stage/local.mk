librextract_la_SOURCES += \
	src/stage/blankcheck.c src/stage/blankcheck.h \
	src/stage/checkimages.c src/stage/checkimages.h \
	src/stage/checks.c src/stage/checks.h \
	src/stage/domain.c src/stage/domain.h \
	src/stage/extract.c src/stage/extract.h \
	src/stage/field.c src/stage/field.h \
	src/stage/fluxcheck.c src/stage/fluxcheck.h \
	src/stage/inputs.c src/stage/inputs.h \
	src/stage/machine.c src/stage/machine.h \
	src/stage/options.c src/stage/options.h \
	src/stage/photometry.c src/stage/photometry.h \
	src/stage/plan.c src/stage/plan.h src/stage/plan_costs.def src/stage/plan_costs.h \
	src/stage/plan_memory.c src/stage/plan_outputs.c src/stage/plan_parts.h \
	src/stage/probe.c src/stage/probe.h \
	src/stage/saturated.c src/stage/saturated.h \
	src/stage/quality.c src/stage/quality.h \
	src/stage/record.c src/stage/record.h \
	src/stage/reference.c src/stage/reference.h \
	src/stage/replica.c src/stage/replica.h \
	src/stage/report.c src/stage/report.h \
	src/stage/selfcheck.c src/stage/selfcheck.h \
	src/stage/selfcheck_numbers.c src/stage/selfcheck_numbers.h \
	src/stage/selfcheck_plan.c \
	src/stage/template_extra.c src/stage/template_extra.h \
	src/stage/template_fit.c src/stage/template_fit.h \
	src/stage/template_table.c src/stage/template_table.h \
	src/stage/tile_facts.c src/stage/tile_facts.h \
	src/stage/coordinates.c src/stage/coordinates.h \
	src/stage/stage.c

rx_stagedir = $(pkgincludedir)/stage
rx_stage_HEADERS = src/stage/stage.h
librextract_la_SOURCES += \
	src/stage/simulation.c src/stage/simulation.h src/stage/simulation_parts.h \
	src/stage/simulation_config.c src/stage/simulation_field.c src/stage/simulation_run.c
