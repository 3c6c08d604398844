/* What rextract and rextract-mpi have in common: all but how a list of tiles is gone through. */
#ifndef RX_PROGRAMS_EXTRACT_H
#define RX_PROGRAMS_EXTRACT_H

#include "programs/program.h"

/* A tile, a list or a plan, by one process. */
rx_status rx_program_extract_alone(const rx_settings *settings, const char *image, rx_log *log,
                                   rx_error *err);

/* The main function of a program called `name`; the others as in rx_program. */
int rx_program_extract(const char *name,
                       rx_status (*run)(const rx_settings *settings, const char *image, rx_log *log,
                                        rx_error *err),
                       rx_status (*replay)(const rx_settings *settings, const char *path, rx_log *log,
                                           rx_error *err),
                       int (*processes)(void), void (*end)(rx_status status), int argc, char **argv);

#endif
