/* What rextract and rextract-mpi have in common: all but how a list of tiles is gone through. */
#ifndef RX_PROGRAMS_EXTRACT_H
#define RX_PROGRAMS_EXTRACT_H

#include "programs/program.h"

/* The program as one process does it: .run takes a tile, a list or a plan. */
rx_program rx_program_extract(void);

#endif
