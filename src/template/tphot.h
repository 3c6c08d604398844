/* What template photometry is given. */
#ifndef RX_TEMPLATE_TPHOT_H
#define RX_TEMPLATE_TPHOT_H

#include "base/error.h"
#include "template/template.h"

/* Whether its parts fit together. Errors: RX_INPUT. */
rx_status rx_tphot_check(const rx_tphot_input *input, rx_error *err);

#endif
