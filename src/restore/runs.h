/* What does each restorer of the table: the function of its row. */
#ifndef RX_RESTORE_RUNS_H
#define RX_RESTORE_RUNS_H

#include "base/error.h"
#include "base/log.h"
#include "data/image.h"
#include "data/restored.h"
#include "data/restorers.h"
#include "restore/params.h"

/* clang-format off */
#define RX_RESTORER_RUN(name, run, ...)                                                                     \
    rx_status run(const rx_restore_params *par, const rx_image *image, rx_log *log, rx_restored **dst,      \
                  rx_error *err);
RX_RESTORERS(RX_RESTORER_RUN)
/* clang-format on */
#undef RX_RESTORER_RUN

#endif
