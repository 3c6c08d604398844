/* No output takes the place of an input, and no folder of a report that of a file in it. Private to config/.
 */
#ifndef RX_CONFIG_OVERWRITE_H
#define RX_CONFIG_OVERWRITE_H

#include "config/config_fields.h"

/* RX_USAGE when a file that the program of these settings writes is one that it reads, or one of the images
 * in `image` ("tile.fits" or "detect.fits,measure.fits"; what stands in brackets does not count; NULL for
 * programs that take none). Files are compared, not names. A folder that the program replaces must hold
 * none of them, and none of the other outputs. For rx_keytable.check_outputs. */
rx_status rx_overwrite_check(const rx_settings *settings, const char *image, rx_error *err);
rx_status rx_overwrite_check_simulate(const rx_settings *settings, const char *image, rx_error *err);
rx_status rx_overwrite_check_campaign(const rx_settings *settings, const char *image, rx_error *err);
rx_status rx_overwrite_check_survey(const rx_settings *settings, const char *image, rx_error *err);
rx_status rx_overwrite_check_train(const rx_settings *settings, const char *image, rx_error *err);

/* Every file and folder that a run of rextract writes, by keyword and under the name it will have: of a name
 * that several restorers share, the one of each. And every file that it reads, the images with the keyword
 * IMAGE, without what stands in brackets. The names are only lent. RX_SYSTEM without memory. */
typedef void (*rx_file_visitor)(void *user, const char *key, const char *name);
rx_status rx_overwrite_visit(const rx_config *config, rx_file_visitor visit, void *user, rx_error *err);
rx_status rx_overwrite_visit_inputs(const rx_config *config, const char *image, rx_file_visitor visit,
                                    void *user, rx_error *err);

#endif
