/* The parts of the detection report as text; memory trouble shows in dst->failed. `page`: rx_detection_page.
 */
#ifndef RX_CAMPAIGN_DETECTION_PAGE_H
#define RX_CAMPAIGN_DETECTION_PAGE_H

#include "campaign/detection_numbers.h"
#include "campaign/report_parts.h"

typedef struct rx_detection_page {
    const rx_detection_numbers *numbers;
    const rx_campaign_record *record;
    int nverdicts;
    rx_claim_verdict verdict[RX_CLAIM_COUNT];
    rx_figures figures;
} rx_detection_page;

/* 0: a single setting of RL, which tables of the page leave out. */
int rx_detection_shown(const rx_detection_numbers *numbers, int column);
void rx_detection_condition_name(const rx_detection_results *results, int condition, char *dst, size_t size);

void rx_detection_figures(rx_figures *dst, const rx_detection_numbers *numbers);
void rx_detection_html(rx_text *dst, const void *page);
void rx_detection_json(rx_text *dst, const void *page);
void rx_detection_cells_ecsv(rx_text *dst, const void *page); /* every method, condition, scene, quantity */
void rx_detection_duels_ecsv(rx_text *dst, const void *page);
void rx_detection_brief(rx_text *dst, const rx_detection_page *page);

#endif
