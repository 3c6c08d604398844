/* The parts of the photometry report as text; memory trouble shows in dst->failed. */
#ifndef RX_CAMPAIGN_PHOTOMETRY_PAGE_H
#define RX_CAMPAIGN_PHOTOMETRY_PAGE_H

#include "campaign/photometry_numbers.h"
#include "campaign/report_parts.h"

typedef struct rx_photometry_page {
    const rx_photometry_numbers *numbers;
    const rx_campaign_record *record;
    int nverdicts;
    rx_claim_verdict verdict[RX_CLAIM_COUNT];
    rx_figures figures;
} rx_photometry_page;

/* One quantity of a cell. */
typedef enum rx_cell_quantity {
    RX_CELL_RECALL,
    RX_CELL_PRECISION,
    RX_CELL_AP,
    RX_CELL_MAGERR,
    RX_CELL_MAGERR_CLEAN,
    RX_CELL_CROWDED,
    RX_CELL_BIAS_PERCENT,
    RX_CELL_SCATTER_PERCENT,
    RX_CELL_BIAS_MAG,
    RX_CELL_SCATTER_MAG,
    RX_CELL_PULL_MEDIAN,
    RX_CELL_PULL_WIDTH,
    RX_CELL_QUANTITIES
} rx_cell_quantity;

typedef struct rx_cell_row {
    const char *name, *unit, *help;
    int digits;
} rx_cell_row;

const rx_cell_row *rx_cell_row_of(rx_cell_quantity quantity);
const rx_estimate *rx_cell_get(const rx_photometry_cell *cell, rx_cell_quantity quantity);

void rx_photometry_figures(rx_figures *dst, const rx_photometry_numbers *numbers);
void rx_photometry_html(rx_text *dst, const rx_photometry_page *page);
void rx_photometry_json(rx_text *dst, const rx_photometry_page *page);
void rx_photometry_sets_ecsv(rx_text *dst, const rx_photometry_page *page);
void rx_photometry_duels_ecsv(rx_text *dst, const rx_photometry_page *page);
void rx_photometry_cuts_ecsv(rx_text *dst, const rx_photometry_page *page);
void rx_photometry_curves_ecsv(rx_text *dst, const rx_photometry_page *page);
void rx_photometry_brief(rx_text *dst, const rx_photometry_page *page);

#endif
