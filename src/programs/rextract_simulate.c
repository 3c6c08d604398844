/* rextract-simulate: settings in; blurred tile, sharp reference and truth catalogue out. */
#include "config/config_fields.h"
#include "programs/program.h"
#include "stage/simulation.h"

static const char usage[] = "usage: rextract-simulate [-c FILE] [-KEYWORD VALUE]...\n"
                            "       rextract-simulate -d | -dd | -v | -h\n";

static const char help[] =
    "\n"
    "Simulate a tile of stars and galaxies, or add them to a real one (INJECT_IMAGE), and\n"
    "write it with its sharp reference and the truth.\n"
    "\n"
    "  -c FILE          configuration file\n"
    "  -KEYWORD VALUE   overrides the file, any number of times\n"
    "  -d               print a default configuration file\n"
    "  -dd              the same with all keywords\n"
    "  -v, --version    print the version\n"
    "  -h, --help       print this\n"
    "\n"
    "What is not set has its default: rextract-simulate -SEED 1 makes sim.fits.\n"
    "Exit status: 0 fine, 2 usage or configuration, 3 input data, 4 system or resources.\n"
    "More, and all keywords, in rextract-simulate(1).\n";

static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    (void)image;
    return rx_simulation_run((const rx_simulate_config *)settings, log, err);
}

int main(int argc, char **argv)
{
    const rx_program program = {
        .name = "rextract-simulate",
        .usage = usage,
        .help = help,
        .table = rx_keytable_simulate(),
        .run = run,
    };
    return rx_program_main(&program, argc, argv);
}
