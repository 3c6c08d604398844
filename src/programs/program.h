/* What all programs do alike: streams, signals, arguments, printing what is asked for, the error line and the
 * exit code. */
#ifndef RX_PROGRAMS_PROGRAM_H
#define RX_PROGRAMS_PROGRAM_H

#include "config/arguments.h"

typedef struct rx_program {
    const char *name;
    const char *usage, *help; /* text of -h, above its keywords; usage alone where nothing is asked for */
    const rx_keytable *table;
    void (*columns)(rx_text *dst); /* -dp; NULL where there is none */
    /* -INFO FILE, as lines; NULL where there is none. */
    rx_status (*info)(const char *path, rx_text *dst, rx_error *err);
    /* The job. settings is the struct of the table, image NULL where the program takes none. */
    rx_status (*run)(const rx_settings *settings, const char *image, rx_log *log, rx_error *err);
    /* How many processes share the job; NULL: it is done by one alone. */
    int (*processes)(void);
    /* After all is said, before a signal that is pending takes its effect; NULL: nothing. */
    void (*end)(rx_status status);
} rx_program;

/* How many processes a launcher (mpiexec, srun) has started this one among; 1 without one. *rank, unless NULL, is
 * this one's. */
int rx_program_launched(int *rank);

/* The error line on standard error; returns the exit code. */
int rx_program_fail(const char *name, const rx_error *err);

/* The exit code of main(). */
int rx_program_main(const rx_program *program, int argc, char **argv);

#endif
