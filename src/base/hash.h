/* Digests of what was read and written: XXH3 with 128 bits (xxHash 0.8, by Yann Collet), from the library's
 * header. It shows accidental change, not forgery: anyone can change a file and its digest. As
 * every input of a run is digested it must be fast, which a cryptographic one is not.
 *
 * As text a digest is what `xxh128sum` prints. */
#ifndef RX_BASE_HASH_H
#define RX_BASE_HASH_H

#include <stdalign.h>
#include <stddef.h>

#include "base/error.h"
#include "base/extern.h"

RX_BEGIN_DECLS

enum { RX_HASH_TEXT = 33 };

/* Of bytes that come in pieces; owns nothing. */
typedef struct rx_hash {
    alignas(64) unsigned char state[576]; /* of the library */
} rx_hash;

void rx_hash_begin(rx_hash *sum);
void rx_hash_add(rx_hash *sum, const void *bytes, size_t n);

/* In hexadecimal digits. */
void rx_hash_text(const rx_hash *sum, char dst[RX_HASH_TEXT]);

/* Of a whole regular file; any other, or none: *there 0, no error. Errors: RX_INPUT where it cannot be opened
 * or read to its end, and a signal. */
rx_status rx_hash_file(const char *path, char dst[RX_HASH_TEXT], int *there, rx_error *err);

RX_END_DECLS

#endif
