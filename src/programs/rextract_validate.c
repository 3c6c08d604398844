/* rextract-validate: a campaign file in; a report of what each restorer is worth out. */
#include "config/config_fields.h"
#include "lab/campaign.h"
#include "programs/program.h"

static const char usage[] = "usage: rextract-validate [-c] FILE [-KEYWORD VALUE]...\n"
                            "       rextract-validate -KEYWORD VALUE...\n"
                            "       rextract-validate -d | -dd | -v | -h\n";

static const char help[] =
    "\n"
    "Run a validation campaign: simulated or real tiles, every restorer on the same pixels,\n"
    "and one report. What is done is kept in a journal; the same command goes on after an\n"
    "interruption.\n"
    "\n"
    "  FILE, -c FILE          campaign file\n"
    "  -KEYWORD VALUE         overrides the file, any number of times\n"
    "  -SIM.KEYWORD VALUE     the same for a keyword of rextract-simulate (the tiles)\n"
    "  -STAGE.KEYWORD VALUE   the same for a keyword of rextract (the runs)\n"
    "  -d                     print a default campaign file\n"
    "  -dd                    the same with SIM. and STAGE. keywords\n"
    "  -v, --version          print the version\n"
    "  -h, --help             print this\n"
    "\n"
    "Exit status: 0 fine, 2 usage or configuration, 3 input data, 4 system or resources.\n"
    "More, and all keywords, in rextract-validate(1).\n";

static rx_status run(const rx_settings *settings, const char *image, rx_log *log, rx_error *err)
{
    (void)image;
    return rx_campaign_run((const rx_campaign_config *)settings, log, err);
}

int main(int argc, char **argv)
{
    const rx_program program = {
        .name = "rextract-validate",
        .usage = usage,
        .help = help,
        .table = rx_keytable_validate(),
        .run = run,
    };
    return rx_program_main(&program, argc, argv);
}
