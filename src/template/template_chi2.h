/* The pixels against all models. */
#ifndef RX_TEMPLATE_TEMPLATE_CHI2_H
#define RX_TEMPLATE_TEMPLATE_CHI2_H

#include "base/error.h"
#include "template/fit_image.h"

/* chi2 and visible of *dst, and with keep model and residual, too, which are planes of the whole image. The
 * same for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_template_chi2(rx_fit_image *image, int keep, rx_tphot *dst, rx_error *err);

#endif
