/* The class of machines on which a run gives the same bits. */
#ifndef RX_STAGE_MACHINE_H
#define RX_STAGE_MACHINE_H

#include "base/text.h"

/* One line: the processor's instruction sets that kernels are chosen by, compiler, and versions of the
 * libraries that compute or read. Nothing that names the machine. */
void rx_machine_describe(rx_text *dst);

#endif
