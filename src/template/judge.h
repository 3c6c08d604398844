/* The pixels against all models. */
#ifndef RX_TEMPLATE_JUDGE_H
#define RX_TEMPLATE_JUDGE_H

#include "base/error.h"
#include "template/canvas.h"

/* chi2 and visible of *dst, and with keep model and residual, too, which are planes of the whole image. The
 * same for any nthreads. Errors: RX_SYSTEM. */
rx_status rx_judge(rx_canvas *canvas, int keep, rx_tphot *dst, rx_error *err);

#endif
