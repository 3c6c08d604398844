/* rextract: a tile in; restored image, catalogue and report out. */
#include <stdio.h>

#include "catalog/catalog.h"
#include "config/config.h"
#include "programs/program.h"
#include "stage/stage.h"

static const char usage[] = "usage: rextract IMAGE [-c FILE] [-KEYWORD VALUE]...\n"
                            "       rextract DETECT,MEASURE [-c FILE] [-KEYWORD VALUE]...\n"
                            "       rextract -d | -dd | -dp | -v | -h\n";

static const char help[] = "\n"
                           "Restore the image, detect and measure its sources, write their catalogue, and\n"
                           "with a reference catalogue (REFERENCE_NAME) a quality report.\n"
                           "\n"
                           "  -c FILE          configuration file (default.sex where there is one)\n"
                           "  -KEYWORD VALUE   overrides the file, any number of times\n"
                           "  -d               print a default configuration file\n"
                           "  -dd              the same with all keywords\n"
                           "  -dp              print the columns a catalogue can have\n"
                           "  -v, --version    print the version\n"
                           "  -h, --help       print this\n"
                           "\n"
                           "Exit status: 0 fine, 2 usage or configuration, 3 input data, 4 system or\n"
                           "resources, 5 a quality gate failed, 6 too few sources to decide a quality gate.\n"
                           "More in rextract(1), the keywords in rextract.conf(5).\n";

static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    return rx_stage_run((const rx_config *)settings, image, stdout, log, err);
}

int main(int argc, char **argv)
{
    const rx_program program = {
        .name = "rextract",
        .usage = usage,
        .help = help,
        .table = rx_keytable_rextract(),
        .columns = rx_columns_dump,
        .run = run,
    };
    return rx_program_main(&program, argc, argv);
}
