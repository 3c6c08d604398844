/* rextract-mpi: what rextract becomes under mpiexec, a list of tiles shared out among the processes. */

#include "par/ranks.h"
#include "programs/extract.h"
#include "survey/survey_ranks.h"

static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    if (image[0] != '@')
        return rx_par_rank() > 0
                   ? RX_OK
                   : rx_error_set(err, RX_USAGE,
                                  "'%.200s' is one tile, and mpiexec started several processes; "
                                  "give a list of tiles, @FILE",
                                  image);
    return rx_survey_run_ranks(settings, image + 1, log, err);
}

int main(int argc, char **argv)
{
    rx_error err = RX_ERROR_NONE;
    if (rx_par_begin(&argc, &argv, &err) != RX_OK)
        return rx_program_fail("rextract", &err);
    return rx_program_extract("rextract", run, rx_par_end, argc, argv);
}
