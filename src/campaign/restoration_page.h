/* The parts of the restoration report as text; memory trouble shows in dst->failed. */
#ifndef RX_CAMPAIGN_RESTORATION_PAGE_H
#define RX_CAMPAIGN_RESTORATION_PAGE_H

#include "campaign/report_parts.h"
#include "campaign/restoration_numbers.h"

typedef struct rx_restoration_page {
    const rx_restoration_numbers *numbers;
    const rx_campaign_record *record;
    int nverdicts;
    rx_claim_verdict verdict[RX_CLAIM_COUNT];
    rx_figures figures;
} rx_restoration_page;

void rx_restoration_figures(rx_figures *dst, const rx_restoration_numbers *numbers);
void rx_restoration_html(rx_text *dst, const rx_restoration_page *page);
void rx_restoration_json(rx_text *dst, const rx_restoration_page *page);
void rx_restoration_bins_ecsv(rx_text *dst, const rx_restoration_page *page);
void rx_restoration_duels_ecsv(rx_text *dst, const rx_restoration_page *page);
void rx_restoration_scenes_ecsv(rx_text *dst, const rx_restoration_page *page);
void rx_restoration_brief(rx_text *dst, const rx_restoration_page *page);

#endif
