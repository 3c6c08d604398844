/* Parts of the campaign pages. */
#include "campaign/report_parts.h"

#include <math.h>

#include "validate/escape.h"
#include "validate/page.h"

void rx_page_said(rx_text *dst, const rx_text *said)
{
    rx_text html = {0};
    if (said->data == NULL)
        return;
    rx_escape_html(&html, said->data);
    if (html.data != NULL)
        rx_page_paragraph(dst, html.data);
    dst->failed = dst->failed || said->failed || html.failed;
    rx_text_free(&html);
}

static const char *mark_of(rx_claim_state state)
{
    static const char *const marks[] = {RX_MARK_GOOD, RX_MARK_BAD, RX_MARK_OPEN, RX_MARK_PALE};
    return marks[state];
}

void rx_page_verdicts(rx_text *dst, int n, const rx_claim_verdict *verdicts)
{
    rx_page_section(dst, "verdicts", "The paper's claims, and our goals");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    rx_page_head(dst, RX_LEFT, "claim, and where");
    rx_page_head(dst, RX_LEFT, "verdict");
    rx_page_head(dst, RX_LEFT, "what was found");
    rx_page_row_end(dst);
    for (int i = 0; i < n; i++) {
        const rx_claim *claim = rx_claim_get(verdicts[i].claim);
        rx_text cell = {0};
        rx_page_row(dst, NULL);
        rx_text_add(&cell, "<div style=\"min-width:20em\">");
        rx_escape_html(&cell, claim->words);
        rx_text_add(&cell, " <small>");
        rx_escape_html(&cell, claim->place);
        rx_text_add(&cell, "<br>Counts as reproduced: ");
        rx_escape_html(&cell, claim->test);
        rx_text_add(&cell, ".</small></div>");
        rx_page_cell_html(dst, RX_LEFT, cell.data != NULL ? cell.data : "");
        rx_page_cell_verdict(dst, mark_of(verdicts[i].state), rx_claim_state_name(verdicts[i].state));
        rx_page_cell_text(dst, verdicts[i].said.data);
        rx_page_row_end(dst);
        dst->failed = dst->failed || cell.failed || verdicts[i].said.failed;
        rx_text_free(&cell);
    }
    rx_page_table_end(dst);
    rx_page_note(dst,
                 "The paper: Jia et al. 2023, MNRAS 527, 6581 (arXiv:2311.00186). NET is its network, RL is "
                 "Richardson-Lucy with a Gaussian filter.");
}

static void record_row(rx_text *dst, const char *name, const char *value)
{
    rx_page_row(dst, NULL);
    rx_page_cell_text(dst, name);
    rx_page_cell_text(dst, value);
    rx_page_row_end(dst);
}

void rx_page_campaign_record(rx_text *dst, const rx_campaign_record *record)
{
    rx_text seed = {0};
    rx_page_section(dst, "record", "What made this page");
    rx_text_printf(&seed, "%llu", (unsigned long long)record->seed);
    rx_page_table_begin(dst);
    record_row(dst, "command", record->command);
    record_row(dst, "seed", seed.data);
    rx_page_table_end(dst);
    dst->failed = dst->failed || seed.failed;
    rx_text_free(&seed);
    rx_page_record(dst, record->n, record->pairs);
}

static void interval_of(rx_text *html, const rx_estimate *e, int digits)
{
    rx_page_number(html, e->value, digits);
    if (isnan(e->value))
        return;
    rx_text_add(html, " <small>[");
    rx_page_number(html, e->low, digits);
    rx_text_add(html, ", ");
    rx_page_number(html, e->high, digits);
    rx_text_add(html, "]</small>");
}

void rx_page_cell_interval(rx_text *dst, const rx_estimate *e, int digits)
{
    rx_text html = {0};
    interval_of(&html, e, digits);
    rx_page_cell_html(dst, RX_RIGHT, html.data != NULL ? html.data : "");
    dst->failed = dst->failed || html.failed;
    rx_text_free(&html);
}

void rx_page_cell_difference(rx_text *dst, const rx_estimate *difference, int digits, int winner)
{
    rx_text html = {0};
    const char *mark = winner > 0 ? RX_MARK_GOOD : winner < 0 ? RX_MARK_BAD : RX_MARK_PALE;
    rx_text_printf(&html, "<span class=\"%s\">", mark);
    rx_text_add(&html, difference->value > 0 ? "+" : "");
    interval_of(&html, difference, digits);
    rx_text_add(&html, "</span>");
    rx_page_cell_html(dst, RX_RIGHT, html.data != NULL ? html.data : "");
    dst->failed = dst->failed || html.failed;
    rx_text_free(&html);
}

void rx_json_campaign_begin(rx_json *json, const char *type, const rx_campaign_record *record)
{
    rx_json_object(json, NULL, false);
    rx_json_string(json, "format", "rextract-campaign 1");
    rx_json_string(json, "type", type);
    rx_json_string(json, "title", record->title);
    rx_json_string(json, "command", record->command);
    rx_json_count(json, "seed", record->seed);
    rx_json_number(json, "interval_level", 0.95);
}

void rx_json_campaign_end(rx_json *json, const rx_campaign_record *record, int n,
                          const rx_claim_verdict *verdicts)
{
    rx_json_array(json, "verdicts", false);
    for (int i = 0; i < n; i++) {
        const rx_claim *claim = rx_claim_get(verdicts[i].claim);
        rx_json_object(json, NULL, false);
        rx_json_string(json, "claim", claim->name);
        rx_json_string(json, "place", claim->place);
        rx_json_string(json, "words", claim->words);
        rx_json_string(json, "reproduced_when", claim->test);
        rx_json_string(json, "verdict", rx_claim_state_name(verdicts[i].state));
        rx_json_string(json, "found", verdicts[i].said.data);
        rx_json_end(json);
    }
    rx_json_end(json);
    rx_json_array(json, "record", false);
    for (int i = 0; i < record->n; i++) {
        rx_json_object(json, NULL, true);
        rx_json_string(json, "name", record->pairs[i][0]);
        rx_json_string(json, "value", record->pairs[i][1]);
        rx_json_end(json);
    }
    rx_json_end(json);
    rx_json_end(json);
}

void rx_json_test(rx_json *json, const char *key, const rx_test *test)
{
    rx_json_object(json, key, true);
    rx_json_number(json, "statistic", test->statistic);
    rx_json_number(json, "dof", test->dof);
    rx_json_number(json, "p", test->p);
    rx_json_number(json, "ln_p", test->ln_p);
    rx_json_number(json, "effect", test->effect);
    rx_json_estimate(json, "difference", &test->difference);
    rx_json_end(json);
}

void rx_ecsv_campaign(rx_ecsv *table, const char *type, const rx_campaign_record *record)
{
    rx_ecsv_meta(table, "type", type);
    rx_ecsv_meta(table, "title", record->title);
    rx_ecsv_meta_number(table, "seed", (double)record->seed);
    rx_ecsv_meta_number(table, "interval_level", 0.95);
}

void rx_brief_verdicts(rx_text *dst, int n, const rx_claim_verdict *verdicts)
{
    for (int i = 0; i < n; i++)
        rx_text_printf(dst, "claim: %-24s %s\n", rx_claim_get(verdicts[i].claim)->name,
                       rx_claim_state_name(verdicts[i].state));
}
