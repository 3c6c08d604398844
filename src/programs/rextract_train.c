/* rextract-train: settings in; a trained model, its curves and a checkpoint to go on from out. */
#include <stdio.h>

#include "config/config_fields.h"
#include "par/ranks.h"
#include "programs/program.h"
#include "train/trainer.h"

static const char usage[] = "usage: rextract-train [-c] FILE [-KEYWORD VALUE]...\n"
                            "       rextract-train -KEYWORD VALUE...\n"
                            "       rextract-train -INFO MODEL\n"
                            "       rextract-train -d | -dd | -v | -h\n";

static const char help[] =
    "\n"
    "Train PSF-NET, the network that restores images, on simulated ones. The state is kept\n"
    "after every epoch; the same command goes on after an interruption. Under mpiexec the\n"
    "processes share images and steps.\n"
    "\n"
    "  FILE, -c FILE        training file\n"
    "  -KEYWORD VALUE       overrides the file, any number of times\n"
    "  -SIM.KEYWORD VALUE   the same for a keyword of rextract-simulate (the population)\n"
    "  -INFO MODEL          print what is in a model file\n"
    "  -d                   print a default training file\n"
    "  -dd                  the same with all keywords, SIM. ones included\n"
    "  -v, --version        print the version\n"
    "  -h, --help           print this\n"
    "\n"
    "Exit status: 0 fine, 2 usage or configuration, 3 input data or a training that does not\n"
    "converge, 4 system or resources, 7 interrupted.\n"
    "More, and all keywords, in rextract-train(1).\n";

static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    (void)image;
    return rx_train_run((const rx_train_config *)settings, log, err);
}

int main(int argc, char **argv)
{
    rx_error err = RX_ERROR_NONE;
    const rx_program program = {
        .name = "rextract-train",
        .usage = usage,
        .help = help,
        .table = rx_keytable_train(),
        .info = rx_train_describe,
        .run = run,
        .processes = rx_par_processes,
        .end = rx_par_end,
    };
    if (rx_par_begin(&argc, &argv, &err) != RX_OK)
        return rx_program_fail(program.name, &err);
    /* one process speaks for all */
    if (rx_par_rank() > 0 &&
        (freopen("/dev/null", "w", stdout) == NULL || freopen("/dev/null", "w", stderr) == NULL))
        return (int)RX_SYSTEM;
    return rx_program_main(&program, argc, argv);
}
