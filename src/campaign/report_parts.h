/* What the pages of both kinds of campaign have in common. */
#ifndef RX_CAMPAIGN_REPORT_PARTS_H
#define RX_CAMPAIGN_REPORT_PARTS_H

#include "campaign/campaign_report.h"
#include "campaign/paper.h"
#include "validate/ecsv.h"
#include "validate/figure.h"
#include "validate/hypothesis.h"
#include "validate/json.h"

/* Text that is escaped, as one paragraph; empty text: nothing. */
void rx_page_said(rx_text *dst, const rx_text *said);

void rx_page_verdicts(rx_text *dst, int n, const rx_claim_verdict *verdicts);
void rx_page_campaign_record(rx_text *dst, const rx_campaign_record *record);
/* value [low, high], where the number behind it is told elsewhere. */
void rx_page_cell_interval(rx_text *dst, const rx_estimate *e, int digits);
/* "first - second": cell of a difference with its interval and a mark for the winner. */
void rx_page_cell_difference(rx_text *dst, const rx_estimate *difference, int digits, int winner);

/* Opens the outermost object: format, type, title, command, seed. */
void rx_json_campaign_begin(rx_json *json, const char *type, const rx_campaign_record *record);
/* Verdicts and record, then closes it. */
void rx_json_campaign_end(rx_json *json, const rx_campaign_record *record, int n,
                          const rx_claim_verdict *verdicts);
void rx_json_test(rx_json *json, const char *key, const rx_test *test);

void rx_ecsv_campaign(rx_ecsv *table, const char *type, const rx_campaign_record *record);

/* A line per claim for the terminal. */
void rx_brief_verdicts(rx_text *dst, int n, const rx_claim_verdict *verdicts);

#endif
