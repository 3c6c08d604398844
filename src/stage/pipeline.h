/* The pipeline for a program that has an image in memory: its params by keywords, one call for all of it, and columns by
 * their names. */
#ifndef RX_STAGE_PIPELINE_H
#define RX_STAGE_PIPELINE_H

#include "data/table.h"
#include "pipeline/pipeline.h"

RX_BEGIN_DECLS

/* The defaults of all keywords of config/keys.def that are the pipeline's, RESTORE_TYPE, the built-in FILTER and
 * NTHREADS among them. There are no names of files and no model, and everything is measured. */
rx_status rx_pipeline_defaults(rx_pipeline_params *dst, rx_error *err);

/* One of these keywords, its value as on the command line: "DETECT_THRESH", "2.0". Names of files and the model of
 * RESTORE_TYPE NET are fields; the mag/arcsec2 of DETECT_THRESH, and relations between keywords, are the stage's.
 * Errors: RX_USAGE (unknown, not its value, or not the pipeline's), RX_SYSTEM; params is then as it was. */
rx_status rx_pipeline_set(rx_pipeline_params *params, const char *name, const char *value, rx_error *err);

struct rx_settings; /* config/settings.h */

/* The same keywords from settings of rextract, so many threads for every stage; *dst was zeroed. What depends on more
 * than one keyword is left. */
void rx_pipeline_fill(rx_pipeline_params *dst, const struct rx_settings *settings, int nthreads);

/* An image as the caller has it: pixels with their sky, mask and what hides, gain, saturation, zero point, and
 * weights or flag maps where there are any; its sky and noise are measured here. Its PSF is that of the image, or
 * where that is NULL what params->psf says. By params->restorer, Richardson-Lucy where that is NULL. The caller's
 * arrays and params->restore.model must live as long as the result. Runs in several threads at once do not know of
 * each other. Errors: those of the parts; RX_INTERRUPTED where the caller stops it. Free with rx_result_free();
 * nothing is left after an error. */
rx_status rx_pipeline_run(const rx_pipeline_params *params, const rx_image *image, rx_log *log,
                          rx_result *dst, rx_error *err);

/* A table of the sources with any columns of SExtractor's or ours (rextract -dp lists them), vectors with one element.
 * Errors: RX_USAGE (no such column), RX_SYSTEM. Free with rx_table_free(). */
rx_status rx_result_table(const rx_result *result, const char *const *columns, int n, rx_table **dst,
                          rx_error *err);

RX_END_DECLS

#endif
