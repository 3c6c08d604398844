/* rextract-mpi: what rextract becomes under mpiexec, a list of tiles shared out among the processes. */
#include <stdio.h>

#include "config/config_fields.h"
#include "par/ranks.h"
#include "programs/extract.h"
#include "survey/survey.h"

/* With NTHREADS 0 each process takes one thread, as there are many. */
static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    rx_settings *own = NULL;
    const int plan = ((const rx_config *)settings)->plan, first = rx_par_rank() == 0;
    if (rx_par_processes() == 1)
        return rx_program_extract().run(settings, image, log, err);
    if (!first && (plan || image[0] != '@'))
        return RX_OK;
    if (!plan && image[0] != '@')
        return rx_error_set(err, RX_USAGE,
                            "'%.200s' is one tile, and mpiexec started several processes; "
                            "give a list of tiles, @FILE",
                            image);
    rx_status status = rx_settings_copy(settings, &own, err);
    if (status == RX_OK && ((const rx_config *)own)->nthreads == 0)
        status = rx_settings_set(own, "NTHREADS", "1", log, err);
    if (status == RX_OK)
        status = plan ? rx_program_extract().run(own, image, log, err)
                      : rx_survey_run_ranks(own, image + 1, stdout, log, err);
    rx_settings_free(own);
    return status;
}

int main(int argc, char **argv)
{
    rx_error err = RX_ERROR_NONE;
    rx_program program = rx_program_extract();
    program.run = run;
    program.processes = rx_par_processes;
    program.end = rx_par_end;
    if (rx_par_begin(&argc, &argv, &err) != RX_OK)
        return rx_program_fail(program.name, &err);
    return rx_program_main(&program, argc, argv);
}
