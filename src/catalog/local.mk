librextract_la_SOURCES += \
	src/catalog/ascii_read.c \
	src/catalog/ascii_write.c \
	src/catalog/assoc.c \
	src/catalog/catalog_read.c \
	src/catalog/catalog_table.c \
	src/catalog/catalog_write.c \
	src/catalog/cell.c \
	src/catalog/columns.c src/catalog/columns.h src/catalog/columns.def src/catalog/missing.def \
	src/catalog/param_file.c \
	src/catalog/votable_read.c \
	src/catalog/votable_write.c
librextract_la_SOURCES += src/catalog/assoc.h src/catalog/formats.h

rx_catalogdir = $(pkgincludedir)/catalog
rx_catalog_HEADERS = src/catalog/catalog.h
installed_headers += $(rx_catalog_HEADERS)
