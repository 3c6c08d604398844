librextract_la_SOURCES += src/catalog/ascii_write.c
librextract_la_SOURCES += src/catalog/catalog.h
librextract_la_SOURCES += src/catalog/catalog_table.c
librextract_la_SOURCES += src/catalog/catalog_write.c src/catalog/writers.h
librextract_la_SOURCES += src/catalog/cell.c src/catalog/cell.h
librextract_la_SOURCES += src/catalog/columns.c src/catalog/columns.h src/catalog/columns.def src/catalog/missing.def
librextract_la_SOURCES += src/catalog/param_file.c
librextract_la_SOURCES += src/catalog/votable_write.c
