/* Fuzz targets: one function each, which takes any bytes and returns; tests/fuzz/README.md. A target shows a
 * fault by ending the process: a sanitizer does, or fuzz_require(). */
#ifndef RX_TESTS_FUZZ_H
#define RX_TESTS_FUZZ_H

#include <stddef.h>
#include <stdint.h>

#include "base/text.h"
#include "data/table.h"

#define TARGET(name, most, what) void fuzz_##name(const uint8_t *data, size_t size);
#include "targets.def"
#undef TARGET

/* Name of a file in memory that holds the bytes. There are two, 0 and 1; their names stay the same. */
const char *fuzz_file(int which, const void *data, size_t size);

/* FITS files are mutated better as lines: where the bytes begin with "FITS\n" there follow, an HDU at a time,
 * its cards, a line each, "END", and its data up to a line "NEXT"; both parts are padded to whole blocks.
 * Other bytes stay as they are. Freed with rx_text_free(). */
void fuzz_expand(const uint8_t *data, size_t size, rx_text *dst);
/* The other way; false where a file cannot be told in lines. */
int fuzz_condense(const uint8_t *data, size_t size, rx_text *dst);

/* DATASUM and CHECKSUM of every HDU that has them become what they should be. */
void fuzz_checksums(char *data, size_t size);

/* Ends the process when something that must hold does not. */
void fuzz_require(int holds, const char *what);

/* Looks at every byte of a table that the reader has let pass, and frees it. */
void fuzz_look(rx_table *table);

#endif
