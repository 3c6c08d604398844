/* What a run reads: every file that decides its results, with a digest of its bytes. */
#ifndef RX_STAGE_INPUTS_H
#define RX_STAGE_INPUTS_H

#include "base/error.h"
#include "base/hash.h"
#include "base/text.h"
#include "config/config.h"
#include "stage/options.h"

/* To `user`: the keyword that names the file ("IMAGE" for the tile), the name as it was given, and the digest
 * of the file, "-" where it is no regular file, NULL where none was wanted. */
typedef void (*rx_input_visitor)(void *user, const char *key, const char *name, const char *digest);

/* The files that a run with these options reads, in a fixed order: the images (the second, of dual-image mode, or
 * NULL), model, PSF, maps, columns, filter, lists, gates. With digests != 0 they are read, and one that is not there
 * is left out: what needs it refuses it. Errors: RX_INPUT (cannot be read), RX_SYSTEM. */
rx_status rx_inputs_visit(const rx_config *config, const rx_options *options, const char *const images[2],
                          int digests, rx_input_visitor visit, void *user, rx_error *err);

/* The digest of the file behind a name of that keyword: what stands in brackets is cut off where no file has
 * that name, a bare name of NET_MODEL may be one of the installed data. *there 0: there is none; "-" as
 * above. Errors: as above. */
rx_status rx_input_digest(const char *key, const char *name, char dst[RX_HASH_TEXT], int *there,
                          rx_error *err);

/* Where the model of that name lies. A name with a slash is a path. One without is that of an installed model
 * where there is one, else of a file in the current folder, so that what a training leaves there is not taken
 * for the installed model by default; a NET_MODEL that was set and is here has got its ./ from the configuration. `installed`: the folder of installed data, RX_DATA_FOLDER. */
void rx_input_model(const char *name, const char *installed, rx_text *dst);

#endif
