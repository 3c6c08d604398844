/* rextract-survey: records of tiles in; the report of a survey out. */
#include "config/config_fields.h"
#include "programs/program.h"
#include "survey/rollup.h"

static const char usage[] = "usage: rextract-survey RECORDS... [-c FILE] [-KEYWORD VALUE]...\n"
                            "       rextract-survey @LIST [-c FILE] [-KEYWORD VALUE]...\n"
                            "       rextract-survey -d | -dd | -v | -h\n";

static const char help[] =
    "\n"
    "Put the records of tiles (RECORD_NAME of rextract) together to the report of a survey.\n"
    "\n"
    "  RECORDS          files of records, each any number one after the other\n"
    "  @LIST            a file that lists such files, one a line\n"
    "  -c FILE          configuration file\n"
    "  -KEYWORD VALUE   overrides the file, any number of times\n"
    "  -d, -dd          print a default configuration file\n"
    "  -v, --version    print the version\n"
    "  -h, --help       print this\n"
    "\n"
    "Exit status: 0 fine, whatever became of the tiles, 2 usage or configuration, 3 records\n"
    "that cannot be used, 4 system or resources, 7 interrupted.\n"
    "More, and all keywords, in rextract-survey(1).\n";

static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    return rx_rollup_files((const rx_survey_config *)settings, image, log, err);
}

int main(int argc, char **argv)
{
    const rx_program program = {
        .name = "rextract-survey",
        .usage = usage,
        .help = help,
        .table = rx_keytable_survey(),
        .run = run,
    };
    return rx_program_main(&program, argc, argv);
}
