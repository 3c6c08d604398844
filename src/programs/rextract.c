/* rextract: a tile in; restored image, catalogue and report out. Arguments, one library call, exit code. */
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

#include "base/error.h"
#include "base/interrupt.h"
#include "base/log.h"
#include "base/text.h"
#include "catalog/catalog.h"
#include "config/arguments.h"
#include "stage/stage.h"

#ifndef RX_VERSION
#error "RX_VERSION comes from the Makefile"
#endif

static const char program[] = "rextract";

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

/* What is asked for on standard output. */
static rx_status print(rx_action action, rx_error *err)
{
    rx_text text = {0};
    rx_status status = RX_OK;
    if (action == RX_ACTION_VERSION)
        rx_text_printf(&text, "Rextract version %s\n", RX_VERSION);
    else if (action == RX_ACTION_HELP)
        rx_text_printf(&text, "%s%s", usage, help);
    else if (action == RX_ACTION_DUMP_COLUMNS)
        rx_columns_dump(&text);
    else
        rx_config_dump(&text, NULL, action == RX_ACTION_DUMP_ALL);
    if (text.failed)
        status = rx_error_memory(err, text.capacity);
    else if (fputs(text.data, stdout) == EOF || fflush(stdout) != 0)
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

int main(int argc, char **argv)
{
    rx_error err = RX_ERROR_NONE;
    rx_log log;
    rx_arguments arguments;
    occupy_streams();
    rx_interrupt_block();
    /* writing then fails like any other, and everything is cleaned up */
    void (*at_broken_pipe)(int) = signal(SIGPIPE, SIG_IGN);
    signal(SIGXFSZ, SIG_IGN);
    rx_log_init(&log, program, stderr, RX_NORMAL);
    rx_status status = rx_arguments_read(argc, argv, &log, &arguments, &err);
    if (status == RX_OK && arguments.action == RX_ACTION_NONE) {
        fputs(usage, stderr);
        status = RX_USAGE;
    } else if (status == RX_OK && arguments.action == RX_ACTION_RUN) {
        status = rx_stage_run(arguments.config, arguments.image, stdout, &log, &err);
    } else if (status == RX_OK) {
        signal(SIGPIPE, at_broken_pipe); /* rextract -dd | head: nothing to clean up, nothing to say */
        status = print(arguments.action, &err);
    }
    rx_log_progress_end(&log);
    if (err.status != RX_OK) {
        char line[RX_ERROR_WHERE + RX_ERROR_TEXT + 128];
        rx_error_format(&err, program, line, sizeof line);
        fprintf(stderr, "%s\n", line);
    }
    rx_arguments_free(&arguments);
    rx_interrupt_deliver();
    return (int)status;
}
