/* What made an output: program, version, machine, inputs, every keyword, and the facts of one extension
 * (PSF, restorer, noise law). Goes into catalogue headers, image headers and the report.
 *
 * From RECORD to END it is all that rextract -c OUTPUT needs to repeat the run:
 *
 *   RECORD      version of this list, and the digests' algorithm
 *   VERSION     of rextract
 *   MACHINE     class of machines
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

/* Program, version, machine, image names, then every keyword, to SET. */
void rx_record_run(rx_record *record, const rx_config *config, const char *images);

/* The files that were read; measure may be NULL. Errors: RX_INPUT (a file cannot be read), RX_SYSTEM. */
rx_status rx_record_inputs(rx_record *record, const rx_config *config, const rx_options *options,
                           const char *detect, const char *measure, rx_error *err);

/* One more file, unless it is there already. Errors: as above. */
rx_status rx_record_file(rx_record *record, const char *key, const char *name, rx_error *err);

/* A run whose configuration is an output of an earlier one (settings->repeated) compared with that; of other settings there is
 * nothing to compare. Before the work: another version or class of machines is a warning, a file in the record of this run
 * that is not, by keyword and digest, one that the earlier run read is RX_INPUT. After it, with what was made: the same is a
 * line of the log, else RX_DIFFERENT, with all that differs, and keywords that do. */
rx_status rx_repeat_check(const rx_settings *settings, const rx_record *now, rx_log *log, rx_error *err);
rx_status rx_repeat_compare(const rx_settings *settings, const rx_record *now, const rx_record *made,
                            rx_log *log, rx_error *err);

#endif
