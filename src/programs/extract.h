/* What rextract and rextract-mpi have in common: all but how a list of tiles is gone through. */
#ifndef RX_PROGRAMS_EXTRACT_H
#define RX_PROGRAMS_EXTRACT_H

#include "programs/program.h"

/* A tile, a list or a plan, by one process. */
rx_status rx_program_extract_alone(const rx_settings *settings, const char *image, rx_log *log,
                                   rx_error *err);

/* The program as one process does it. */
rx_program rx_program_extract(void);

#endif
