/* The files of a survey's report. */
#include "survey/rollup_report.h"

#include <stdio.h>
#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "validate/report_file.h"

static rx_status write_files(const rx_rollup *rollup, const rx_figures *figures, const char *folder,
                             const char *shown, rx_error *err)
{
    static const struct {
        const char *name;
        void (*write)(rx_text *dst, const rx_rollup *rollup);
    } files[] = {{"summary.json", rx_rollup_json}, {"tiles.ecsv", rx_rollup_tiles},
                 {"bins.ecsv", rx_rollup_bins},    {"psfs.ecsv", rx_rollup_psfs},
                 {"psf_rho.ecsv", rx_rollup_rho},  {"junit.xml", rx_rollup_junit}};
    rx_status status = RX_OK;
    rx_text text = {0};
    for (size_t i = 0; i < sizeof files / sizeof files[0] && status == RX_OK; i++) {
        files[i].write(&text, rollup);
        status = rx_report_file(folder, shown, files[i].name, &text, err);
    }
    if (status != RX_OK)
        return status;
    rx_rollup_html(&text, rollup, figures);
    return rx_report_file(folder, shown, "report.html", &text, err);
}

rx_status rx_rollup_report(const rx_rollup *rollup, int wanted, const char *folder, const char *shown,
                           rx_log *log, rx_error *err)
{
    rx_figures *figures = RX_NEW(rx_figures, 1);
    if (figures == NULL)
        return rx_error_memory(err, sizeof *figures);
    rx_status status = RX_OK;
    if (wanted) {
        rx_rollup_figures(figures, rollup);
        if (figures->n > 0)
            status = rx_figures_draw(figures, NULL, folder, shown, err);
        if (status == RX_OK && figures->note[0] != '\0')
            rx_log_warning(log, "report without figures: %s", figures->note);
    } else {
        snprintf(figures->note, sizeof figures->note, "figures were not asked for");
    }
    if (status == RX_OK)
        status = rx_interrupt_check(err);
    if (status == RX_OK)
        status = write_files(rollup, figures, folder, shown, err);
    rx_figures_free(figures);
    free(figures);
    return status;
}
