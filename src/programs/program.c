/* A program from its first to its last line: arguments, one library call, exit code. */
#include "programs/program.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "config/idle.h"
#include "data/flags.h"

#ifndef RX_VERSION
#error "RX_VERSION comes from the Makefile"
#endif

/* What is asked for on standard output. */
static rx_status print(const rx_program *program, rx_action action, const char *file, rx_error *err)
{
    rx_text text = {0};
    rx_status status = RX_OK;
    if (action == RX_ACTION_VERSION)
        rx_text_printf(&text, "Rextract version %s\n", RX_VERSION);
    else if (action == RX_ACTION_HELP) {
        rx_text_printf(&text, "%s%s", program->usage, program->help);
        rx_settings_help(&text, program->table);
    } else if (action == RX_ACTION_DUMP_COLUMNS)
        program->columns(&text);
    else if (action == RX_ACTION_FLAGS)
        status = rx_flags_decode(file, &text, err);
    else if (action == RX_ACTION_INFO)
        status = program->info(file, &text, err);
    else
        rx_settings_dump(&text, program->table, NULL, action == RX_ACTION_DUMP_ALL);
    if (status == RX_OK && text.failed)
        status = rx_error_memory(err, text.capacity);
    else if (status == RX_OK && (fputs(text.data, stdout), !rx_stream_end(stdout)))
        status = rx_error_set(err, RX_SYSTEM, "standard output cannot be written");
    rx_text_free(&text);
    return status;
}

/* A closed standard stream would lend its number to the next file that is opened, and what is said would go
 * into that file. Nothing can be written to what stands in for it. */
static void occupy_streams(void)
{
    int file;
    do
        file = open("/dev/null", O_RDONLY);
    while (file >= 0 && file <= STDERR_FILENO);
    if (file >= 0)
        close(file);
}

int rx_program_fail(const char *name, const rx_error *err)
{
    char line[RX_ERROR_WHERE + RX_ERROR_TEXT + 128];
    rx_error_format(err, name, line, sizeof line);
    fprintf(stderr, "%s\n", line);
    return (int)err->status;
}

int rx_program_launched(int *rank)
{
    static const char *const launchers[][2] = {                          /* how many, which one */
                                               {"PMI_SIZE", "PMI_RANK"}, /* MPICH, srun --mpi=pmi2 */
                                               {"MPI_LOCALNRANKS", "MPI_LOCALRANKID"},
                                               {"OMPI_COMM_WORLD_SIZE", "OMPI_COMM_WORLD_RANK"},
                                               {"SLURM_STEP_NUM_TASKS", "PMIX_RANK"}}; /* srun --mpi=pmix */
    for (size_t i = 0; i < sizeof launchers / sizeof launchers[0]; i++) {
        const char *count = getenv(launchers[i][0]), *number = getenv(launchers[i][1]);
        if (count == NULL || number == NULL || atoi(count) < 2)
            continue;
        if (rank != NULL)
            *rank = atoi(number);
        return atoi(count);
    }
    return 1;
}

/* Processes that know nothing of each other would each do the whole job, and write the same files. */
static rx_status refuse_crowd(const rx_program *program, rx_error *err)
{
    int rank = 0;
    const int count = rx_program_launched(&rank);
    if (count == 1 || (program->processes != NULL && program->processes() > 1))
        return RX_OK;
    return rank > 0 ? RX_USAGE /* one of them speaks */
                    : rx_error_set(err, RX_USAGE,
                                   "is one of %d processes that mpiexec started, each of which would do the "
                                   "whole job: it has no MPI, or that of another mpiexec; start it without",
                                   count);
}

int rx_program_main(const rx_program *program, int argc, char **argv)
{
    rx_error err = RX_ERROR_NONE;
    rx_log log;
    rx_arguments arguments;
    occupy_streams();
    rx_interrupt_block();
    signal(SIGPIPE,
           SIG_IGN); /* rx_stream_end(); elsewhere writing fails like any other, and all is cleaned up */
    signal(SIGXFSZ, SIG_IGN);
    rx_log_init(&log, program->name, stderr, RX_NORMAL);
    rx_status status = rx_arguments_read(program->table, argc, argv, &log, &arguments, &err);
    if (status == RX_OK && arguments.action == RX_ACTION_RUN)
        status = refuse_crowd(program, &err);
    if (status == RX_OK && arguments.action == RX_ACTION_NONE) {
        fputs(program->usage, stderr);
        status = RX_USAGE;
    } else if (status == RX_OK && arguments.action == RX_ACTION_RUN) {
        if (program->columns == NULL) /* rextract looks at them first: survey/survey.c */
            status = rx_settings_warn_idle(arguments.settings, (rx_idle){0}, &log, &err);
        if (status == RX_OK)
            status = program->run(arguments.settings, arguments.image, &log, &err);
    } else if (status == RX_OK) {
        status = print(program, arguments.action, arguments.image, &err);
    }
    rx_log_progress_end(&log);
    status = rx_memory_end(status, &err);
    if (err.status != RX_OK)
        rx_program_fail(program->name, &err);
    rx_arguments_free(&arguments);
    if (program->end != NULL)
        program->end(status);
    rx_interrupt_deliver();
    return (int)status;
}
