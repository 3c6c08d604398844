/* The covariances of template fluxes as a table. */
#ifndef RX_STAGE_TEMPLATE_TABLE_H
#define RX_STAGE_TEMPLATE_TABLE_H

#include "base/error.h"
#include "data/sources.h"
#include "data/table.h"
#include "template/template.h"

/* One row for each two sources of a group, both still in the list: EXT_NUMBER, NUMBER_1, NUMBER_2, the
 * covariance of their FLUX_TEMPLATE (ADU^2) and their correlation. tphot NULL: no rows. *dst belongs to the
 * caller (rx_table_free). Errors: RX_SYSTEM. */
rx_status rx_template_table(const rx_tphot *tphot, const rx_sources *sources, int extension, rx_table **dst,
                            rx_error *err);

#endif
