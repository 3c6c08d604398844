librextract_la_SOURCES += \
	src/config/arguments.c \
	src/config/config.c \
	src/config/fill.c src/config/fill.h src/config/fill_rows.h \
	src/config/idle.c src/config/idle.h \
	src/config/kernel.c \
	src/config/keytables.c \
	src/config/keyword.c src/config/keyword.h src/config/values.h \
	src/config/overwrite.c src/config/overwrite.h \
	src/config/settings.c \
	src/config/settings_dump.c \
	src/config/tiles.c src/config/tiles.h \
	src/config/tokens.c src/config/tokens.h
librextract_la_SOURCES += src/config/arguments.h src/config/campaign.def \
	src/config/config_fields.h src/config/gone.def src/config/kernel.h src/config/keys.def src/config/settings.h \
	src/config/simulate.def src/config/survey.def \
	src/config/train.def
