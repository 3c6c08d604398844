/* Names of outputs when one run makes several of a kind. */
#ifndef RX_BASE_NAMES_H
#define RX_BASE_NAMES_H

#include <stdbool.h>

#include "base/error.h"

/* "night/field.cat" + "RL" -> "night/field_RL.cat"; a name without extension gets "_RL" at its end;
 * `tag` empty or NULL: a plain copy. NULL without memory; the caller frees. */
char *rx_name_with_tag(const char *path, const char *tag);
#define RX_FORCED_TAG "FORCED" /* of what is found at listed positions, behind the catalogue's name */

/* "detect.fits,measure.fits" cut at the comma that is not inside [brackets]; *measure is NULL for a
 * single image. Both to be freed. false without memory. */
bool rx_name_split_images(const char *images, char **detect, char **measure);

/* What a tile is called: the file's name without folder, without what stands in [brackets], and without
 * .fits, .fit, .fts or .fz, .gz, .bz2, .Z behind it: "night/a.fits.fz[1]" -> "a". Of "detect,measure" the
 * first. NULL without memory; the caller frees. */
char *rx_name_stem(const char *image);

/* "night/a.psf" of "night/a.fits.fz": the PSF beside an image, as PSFEx leaves it there; a plain file name. NULL
 * without memory; the caller frees. */
char *rx_name_psf(const char *image);

/* The one name of a file that is there, or will be: absolute, without links (of one that leads to nothing,
 * what it leads to), "." and "..", also where folders are missing that will be made. Two names of the same file
 * give the same. NULL without memory; the caller frees. */
char *rx_name_real(const char *path);

/* RX_USAGE when the way to the output `path` goes through a symbolic link (or ends in a pipe or device) that another
 * user may have put there as a trap: it lies in a folder that others can write to (sticky, as /tmp is) and belongs
 * neither to this user nor to that folder's owner. RX_SYSTEM without memory. */
rx_status rx_name_trusted(const char *path, rx_error *err);

#endif
