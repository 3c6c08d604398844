/* What made an output: program, version, machine, inputs, every keyword, and the facts of one extension
 * (PSF, restorer, noise law). Goes into catalogue headers, image headers and the report.
 *
 * From RECORD to END it is all that rextract -REPLAY needs to repeat the run (survey/replay.h):
 *
 *   RECORD      version of this list, and the digests' algorithm
 *   VERSION     of rextract
 *   MACHINE     class of machines (stage/machine.h)
 *   IMAGE       image, or two, as on the command line
 *   (keywords)  each with its value as a configuration file has it
 *   SET         keywords that were set, whatever to; the others are defaults
 *   READ        digest, keyword and name of a file that was read
 *   MADE        digest of its pixels or rows, number of the part (from 1) and name of an output
 *   OUTPUT      the name of this one
 *   END         digest of the lines "NAME = value" from RECORD on, values as rx_printable_add() has them
 *
 * NTHREADS, VERBOSE_TYPE, PLAN and PLAN_DENSITY stay out: outputs do not depend on them, to the byte. */
#ifndef RX_STAGE_PROVENANCE_H
#define RX_STAGE_PROVENANCE_H

#include "base/error.h"
#include "base/hash.h"
#include "base/text.h"
#include "config/config_fields.h"
#include "data/record.h"
#include "stage/options.h"

#define RX_RECORD_VERSION "1, digests XXH3-128"

/* Program, version, machine, image names, then every keyword, to SET. */
void rx_record_run(rx_record *record, const rx_config *config, const char *images);

/* The files that were read; measure may be NULL. Errors: RX_INPUT (a file cannot be read), RX_SYSTEM. */
rx_status rx_record_inputs(rx_record *record, const rx_config *config, const rx_options *options,
                           const char *detect, const char *measure, rx_error *err);

/* One more file, unless it is there already. Errors: as above. */
rx_status rx_record_file(rx_record *record, const char *key, const char *name, rx_error *err);

/* The digest of the file behind a name of that keyword: what stands in brackets is cut off where no file has
 * that name, a bare name of NET_MODEL may be one of the installed data. *there 0: there is none; "-" where it is no regular file. Errors: RX_INPUT (cannot be read), RX_SYSTEM. */
rx_status rx_record_digest(const char *key, const char *name, char dst[RX_HASH_TEXT], int *there,
                           rx_error *err);

#endif
