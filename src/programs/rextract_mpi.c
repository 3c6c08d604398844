/* rextract-mpi: what rextract becomes under mpiexec, a list of tiles shared out among the processes. */
#include <stdio.h>

#include "config/config_fields.h"
#include "par/ranks.h"
#include "programs/extract.h"
#include "survey/replay.h"
#include "survey/survey.h"

static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    if (rx_par_processes() == 1)
        return rx_program_extract_alone(settings, image, log, err);
    if (((const rx_config *)settings)->plan)
        return rx_survey_plan_ranks(settings, image, stdout, log, err);
    if (image[0] != '@')
        return rx_par_rank() > 0
                   ? RX_OK
                   : rx_error_set(err, RX_USAGE,
                                  "'%.200s' is one tile, and mpiexec started several processes; "
                                  "give a list of tiles, @FILE",
                                  image);
    return rx_survey_run_ranks(settings, image + 1, stdout, log, err);
}

static rx_status replay(const rx_settings *settings, const char *path, rx_log *log, rx_error *err)
{
    if (rx_par_processes() == 1)
        return rx_replay_run(settings, path, log, err);
    return rx_par_rank() > 0
               ? RX_OK
               : rx_error_at(err, RX_USAGE, path, -1, 0, "is repeated by one process; leave out mpiexec");
}

int main(int argc, char **argv)
{
    rx_error err = RX_ERROR_NONE;
    if (rx_par_begin(&argc, &argv, &err) != RX_OK)
        return rx_program_fail("rextract", &err);
    return rx_program_extract("rextract", run, replay, rx_par_processes, rx_par_end, argc, argv);
}
