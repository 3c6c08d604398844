/* Facts of a run, by their rows. */
#include "data/facts.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

enum { HEADER = 1, RECORD = 0 };
enum { TEXT, FLAG, COUNT, FIXED, DIGITS };

typedef struct fact_row {
    const char *card; /* "RXFWHM" */
    int kind, digits;
    const char *unit, *help;
    bool in_header; /* by default */
} fact_row;

static const fact_row rows[RX_FACTS] = {
#define FACT(name, kind, digits, unit, where, help) {"RX" #name, kind, digits, unit, help, where},
#include "data/facts.def"
#undef FACT
};

static void add(rx_record *facts, const fact_row *row, const char *value)
{
    char comment[80];
    snprintf(comment, sizeof comment, row->unit[0] != '\0' ? "[%s] %s" : "%s%s", row->unit, row->help);
    rx_record_add(facts, row->card, comment, "%s", value);
}

void rx_fact_number(rx_record *facts, rx_fact fact, double value)
{
    const fact_row *row = &rows[fact];
    rx_text text = {0};
    if (!isfinite(value))
        return;
    rx_text_printf(&text, row->kind == DIGITS ? "%.*g" : "%.*f", row->digits, value);
    if (text.failed)
        facts->failed = true;
    else
        add(facts, row, text.data);
    rx_text_free(&text);
}

void rx_fact_text(rx_record *facts, rx_fact fact, const char *value)
{
    add(facts, &rows[fact], value);
}

void rx_fact_flag(rx_record *facts, rx_fact fact, bool value)
{
    add(facts, &rows[fact], value ? "T" : "F");
}

void rx_fact_warned(rx_record *facts, rx_fact fact, bool warned)
{
    static_assert(RX_FACTS <= 64 * sizeof facts->warned / sizeof *facts->warned, "a bit for every fact");
    if (warned)
        facts->warned[fact / 64] |= (uint64_t)1 << fact % 64;
}

void rx_facts_of_header(const rx_record *facts, bool all, rx_record *dst)
{
    dst->failed |= facts->failed;
    for (int i = 0; i < facts->n && !dst->failed; i++) {
        bool wanted = all;
        for (int row = 0; row < RX_FACTS && !wanted; row++)
            wanted = (rows[row].in_header || (facts->warned[row / 64] >> row % 64 & 1) != 0) &&
                     strcmp(rows[row].card, facts->pairs[i][0]) == 0;
        if (wanted)
            rx_record_add(dst, facts->pairs[i][0], facts->pairs[i][2], "%s", facts->pairs[i][1]);
    }
}

void rx_facts_man(rx_text *dst)
{
    for (int i = 0; i < RX_FACTS; i++) {
        const fact_row *row = &rows[i];
        rx_text_printf(dst, ".TP\n.BR %s%s\n%s", row->card, row->in_header ? " \" *\"" : "", row->help);
        rx_text_printf(dst, row->unit[0] != '\0' ? " [%s]\n" : "%s\n", row->unit);
    }
}
