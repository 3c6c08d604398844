/* The reports of all kinds of campaign: numbers, verdicts, figures, files. */
#include "campaign/campaign_report.h"

#include <stdio.h>
#include <stdlib.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "campaign/detection_page.h"
#include "campaign/fluxes_page.h"
#include "campaign/photometry_page.h"
#include "campaign/restoration_page.h"
#include "validate/report_file.h"

/* A file of a report and what writes its text. */
typedef struct part {
    const char *name;
    void (*write)(rx_text *dst, const void *page);
} part;

static rx_status write_parts(const part *parts, size_t n, const void *page, const char *folder,
                             const char *shown, rx_error *err)
{
    rx_status status = RX_OK;
    for (size_t i = 0; i < n && status == RX_OK; i++) {
        rx_text text = {0};
        status = rx_interrupt_check(err);
        if (status != RX_OK)
            break;
        parts[i].write(&text, page);
        status = rx_report_file(folder, shown, parts[i].name, &text, err);
    }
    return status;
}

/* Figures that were asked for, or the reason why there are none. */
static rx_status draw(rx_figures *figures, int wanted, const char *folder, const char *shown, rx_log *log,
                      rx_error *err)
{
    if (!wanted) {
        snprintf(figures->note, sizeof figures->note, "figures were not asked for");
        return RX_OK;
    }
    rx_status status = rx_figures_draw(figures, NULL, folder, shown, err);
    if (status == RX_OK && figures->note[0] != '\0')
        rx_log_warning(log, "report without figures: %s", figures->note);
    return status;
}

static void restoration_html(rx_text *dst, const void *page)
{
    rx_restoration_html(dst, page);
}

static void restoration_json(rx_text *dst, const void *page)
{
    rx_restoration_json(dst, page);
}

static void restoration_bins(rx_text *dst, const void *page)
{
    rx_restoration_bins_ecsv(dst, page);
}

static void restoration_duels(rx_text *dst, const void *page)
{
    rx_restoration_duels_ecsv(dst, page);
}

static void restoration_scenes(rx_text *dst, const void *page)
{
    rx_restoration_scenes_ecsv(dst, page);
}

rx_status rx_restoration_report(const rx_restoration_results *results, const rx_campaign_record *record,
                                const char *folder, const char *shown, rx_log *log, rx_text *brief,
                                rx_error *err)
{
    static const part parts[] = {{"summary.json", restoration_json},
                                 {"bins.ecsv", restoration_bins},
                                 {"duels.ecsv", restoration_duels},
                                 {"scenes.ecsv", restoration_scenes},
                                 {"report.html", restoration_html}};
    rx_restoration_numbers numbers = {0};
    rx_restoration_page *page = RX_NEW(rx_restoration_page, 1);
    rx_status status = RX_OK;
    if (page == NULL)
        return rx_error_memory(err, sizeof *page);
    page->numbers = &numbers;
    page->record = record;
    status = rx_restoration_numbers_make(results, record->seed, &numbers, err);
    if (status != RX_OK)
        goto exit;
    rx_restoration_verdicts(&numbers, page->verdict, &page->nverdicts);
    rx_restoration_figures(&page->figures, &numbers);
    status = draw(&page->figures, record->figures, folder, shown, log, err);
    if (status == RX_OK)
        status = write_parts(parts, sizeof parts / sizeof *parts, page, folder, shown, err);
    if (status == RX_OK && brief != NULL)
        rx_restoration_brief(brief, page);
exit:
    rx_figures_free(&page->figures);
    rx_claim_verdicts_free(page->nverdicts, page->verdict);
    rx_restoration_numbers_free(&numbers);
    free(page);
    return status;
}

static void photometry_html(rx_text *dst, const void *page)
{
    rx_photometry_html(dst, page);
}

static void photometry_json(rx_text *dst, const void *page)
{
    rx_photometry_json(dst, page);
}

static void photometry_sets(rx_text *dst, const void *page)
{
    rx_photometry_sets_ecsv(dst, page);
}

static void photometry_duels(rx_text *dst, const void *page)
{
    rx_photometry_duels_ecsv(dst, page);
}

static void photometry_cuts(rx_text *dst, const void *page)
{
    rx_photometry_cuts_ecsv(dst, page);
}

static void photometry_curves(rx_text *dst, const void *page)
{
    rx_photometry_curves_ecsv(dst, page);
}

rx_status rx_photometry_report(const rx_photometry_results *results, const rx_campaign_record *record,
                               const char *folder, const char *shown, rx_log *log, rx_text *brief,
                               rx_error *err)
{
    static const part parts[] = {{"summary.json", photometry_json},  {"sets.ecsv", photometry_sets},
                                 {"duels.ecsv", photometry_duels},   {"cuts.ecsv", photometry_cuts},
                                 {"curves.ecsv", photometry_curves}, {"report.html", photometry_html}};
    rx_photometry_numbers numbers = {0};
    rx_photometry_page *page = RX_NEW(rx_photometry_page, 1);
    rx_status status = RX_OK;
    if (page == NULL)
        return rx_error_memory(err, sizeof *page);
    page->numbers = &numbers;
    page->record = record;
    status = rx_photometry_numbers_make(results, record->seed, &numbers, err);
    if (status != RX_OK)
        goto exit;
    rx_photometry_verdicts(&numbers, page->verdict, &page->nverdicts);
    rx_photometry_figures(&page->figures, &numbers);
    status = draw(&page->figures, record->figures, folder, shown, log, err);
    if (status == RX_OK)
        status = write_parts(parts, sizeof parts / sizeof *parts, page, folder, shown, err);
    if (status == RX_OK && brief != NULL)
        rx_photometry_brief(brief, page);
exit:
    rx_figures_free(&page->figures);
    rx_claim_verdicts_free(page->nverdicts, page->verdict);
    rx_photometry_numbers_free(&numbers);
    free(page);
    return status;
}

rx_status rx_detection_report(const rx_detection_results *results, const rx_campaign_record *record,
                              const char *folder, const char *shown, rx_log *log, rx_text *brief,
                              rx_error *err)
{
    static const part parts[] = {{"summary.json", rx_detection_json},
                                 {"cells.ecsv", rx_detection_cells_ecsv},
                                 {"duels.ecsv", rx_detection_duels_ecsv},
                                 {"report.html", rx_detection_html}};
    rx_detection_numbers numbers = {0};
    rx_detection_page *page = RX_NEW(rx_detection_page, 1);
    rx_status status = RX_OK;
    if (page == NULL)
        return rx_error_memory(err, sizeof *page);
    page->numbers = &numbers;
    page->record = record;
    status = rx_detection_numbers_make(results, record->seed, &numbers, err);
    if (status != RX_OK)
        goto exit;
    rx_detection_verdicts(&numbers, page->verdict, &page->nverdicts);
    rx_detection_figures(&page->figures, &numbers);
    status = draw(&page->figures, record->figures, folder, shown, log, err);
    if (status == RX_OK)
        status = write_parts(parts, sizeof parts / sizeof *parts, page, folder, shown, err);
    if (status == RX_OK && brief != NULL)
        rx_detection_brief(brief, page);
exit:
    rx_figures_free(&page->figures);
    rx_claim_verdicts_free(page->nverdicts, page->verdict);
    rx_detection_numbers_free(&numbers);
    free(page);
    return status;
}

rx_status rx_fluxes_report(const rx_fluxes_results *results, const rx_campaign_record *record,
                           const char *folder, const char *shown, rx_log *log, rx_text *brief, rx_error *err)
{
    static const part parts[] = {{"summary.json", rx_fluxes_json},
                                 {"cells.ecsv", rx_fluxes_cells_ecsv},
                                 {"pairs.ecsv", rx_fluxes_pairs_ecsv},
                                 {"invented.ecsv", rx_fluxes_invented_ecsv},
                                 {"report.html", rx_fluxes_html}};
    rx_fluxes_numbers numbers = {0};
    rx_fluxes_page *page = RX_NEW(rx_fluxes_page, 1);
    rx_status status = RX_OK;
    if (page == NULL)
        return rx_error_memory(err, sizeof *page);
    page->numbers = &numbers;
    page->record = record;
    status = rx_fluxes_numbers_make(results, &numbers, err);
    if (status != RX_OK)
        goto exit;
    page->nverdicts = RX_FLUXES_GOALS * results->nruns;
    rx_fluxes_verdicts(&numbers, page->verdict);
    rx_fluxes_figures(&page->figures, &numbers);
    status = draw(&page->figures, record->figures, folder, shown, log, err);
    if (status == RX_OK)
        status = write_parts(parts, sizeof parts / sizeof *parts, page, folder, shown, err);
    if (status == RX_OK && brief != NULL)
        rx_fluxes_brief(brief, page);
exit:
    rx_figures_free(&page->figures);
    rx_goal_verdicts_free(page->nverdicts, page->verdict);
    rx_fluxes_numbers_free(&numbers);
    free(page);
    return status;
}
