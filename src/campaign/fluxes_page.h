/* The parts of the report on fluxes as text; memory trouble shows in dst->failed. `page`: rx_fluxes_page. */
#ifndef RX_CAMPAIGN_FLUXES_PAGE_H
#define RX_CAMPAIGN_FLUXES_PAGE_H

#include "campaign/fluxes_numbers.h"
#include "campaign/report_parts.h"

typedef struct rx_fluxes_page {
    const rx_fluxes_numbers *numbers;
    const rx_campaign_record *record;
    int nverdicts;
    rx_goal_verdict verdict[RX_FLUXES_GOALS * RX_FLUXES_RUNS];
    rx_figures figures;
} rx_fluxes_page;

/* A number of a cell: its name, how to read it, digits on the page. */
enum { RX_FLUX_QUANTITIES = 6 };
typedef struct rx_flux_quantity {
    const char *name, *unit, *help;
    int digits;
} rx_flux_quantity;
const rx_flux_quantity *rx_flux_quantity_get(int q);
const rx_estimate *rx_flux_quantity_of(const rx_fluxes_cell *cell, int q);

/* Is there anything on that scene. */
int rx_fluxes_has_objects(rx_fluxes_scene scene);

/* Is any object in one of the cells of that scene, kind, company and sample. */
int rx_fluxes_any_objects(const rx_fluxes_numbers *numbers, rx_fluxes_place place);

void rx_fluxes_figures(rx_figures *dst, const rx_fluxes_numbers *numbers);
void rx_fluxes_html(rx_text *dst, const void *page);
void rx_fluxes_json(rx_text *dst, const void *page);
void rx_fluxes_cells_ecsv(rx_text *dst, const void *page);
void rx_fluxes_pairs_ecsv(rx_text *dst, const void *page);
void rx_fluxes_invented_ecsv(rx_text *dst, const void *page);
void rx_fluxes_brief(rx_text *dst, const rx_fluxes_page *page);

#endif
