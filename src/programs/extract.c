/* Words of the program that extracts. */
#include "programs/extract.h"

#include <stdio.h>

#include "catalog/catalog.h"
#include "config/config_fields.h"
#include "stage/plan.h"
#include "survey/survey.h"

static const char usage[] = "usage: rextract IMAGE [-c FILE] [-KEYWORD VALUE]...\n"
                            "       rextract DETECT,MEASURE [-c FILE] [-KEYWORD VALUE]...\n"
                            "       rextract @LIST [-c FILE] [-KEYWORD VALUE]...\n"
                            "       rextract [IMAGE] -c OUTPUT [-KEYWORD VALUE]...\n"
                            "       rextract -PLAN IMAGE|@LIST [-c FILE] [-KEYWORD VALUE]...\n"
                            "       rextract -FLAGS [SUM]\n"
                            "       rextract -d | -dd | -dp | -v | -h\n";

static const char help[] =
    "\n"
    "Restore the image, detect and measure its sources, write their catalogue, and\n"
    "with a reference catalogue (REFERENCE_NAME) a quality report.\n"
    "\n"
    "  @LIST            a file with an image per line, and keywords of its own behind it\n"
    "  -c FILE          configuration file (default.sex where there is one)\n"
    "  -c OUTPUT        repeat the run that wrote a catalogue or image, and compare\n"
    "  -KEYWORD VALUE   overrides the file, any number of times\n"
    "  -PLAN            only print what the run will take: memory and disk\n"
    "  -FLAGS SUM       say what each bit of a sum of flags means, or of one column:\n"
    "                   -FLAGS 19, -FLAGS FLAGS_RESTORE=19; without SUM all bits\n"
    "  -d               print a default configuration file\n"
    "  -dd              the same with all keywords\n"
    "  -dp              print the columns a catalogue can have\n"
    "  -v, --version    print the version\n"
    "  -h, --help       print this\n"
    "\n"
    "Exit status: 0 fine, 2 usage or configuration, 3 input data, 4 system or\n"
    "resources, 5 a quality gate failed, 6 too few sources to decide a quality gate,\n"
    "7 interrupted, 8 some tiles of a list failed, 9 a repeated run gave something else,\n"
    "10 a tile is not for the restorer that was asked for (RESTORE_FALLBACK N, OUT_OF_DOMAIN FAIL).\n"
    "More in rextract(1), the keywords in rextract.conf(5).\n";

static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    if (((const rx_config *)settings)->plan)
        return rx_plan_run(settings, image, stdout, log, err);
    return rx_survey_run(settings, image, stdout, log, err);
}

rx_program rx_program_extract(void)
{
    return (rx_program){.name = "rextract",
                        .usage = usage,
                        .help = help,
                        .table = rx_keytable_rextract(),
                        .columns = rx_columns_dump,
                        .run = run};
}
