/* summary.json: every number of the report with its interval and count. */
#include <math.h>

#include "validate/escape.h"
#include "validate/qa_writers.h"

/* "key": with a comma before all but the first of an object. */
static void key(rx_text *dst, const char *name, int *first)
{
    rx_text_add(dst, *first ? "" : ", ");
    *first = 0;
    rx_escape_quoted(dst, name);
    rx_text_add(dst, ": ");
}

static void number(rx_text *dst, const char *name, double value, int *first)
{
    key(dst, name, first);
    rx_number_json(dst, value);
}

static void string(rx_text *dst, const char *name, const char *value, int *first)
{
    key(dst, name, first);
    if (value != NULL)
        rx_escape_quoted(dst, value);
    else
        rx_text_add(dst, "null");
}

/* An infinite end of an interval is null: not bounded. */
static void estimate(rx_text *dst, const rx_estimate *e)
{
    int first = 1;
    rx_text_add(dst, "{");
    number(dst, "value", e->value, &first);
    number(dst, "low", e->low, &first);
    number(dst, "high", e->high, &first);
    number(dst, "n", (double)e->n, &first);
    rx_text_add(dst, "}");
}

static void metrics(rx_text *dst, const rx_estimate *list, int whole, const char *indent)
{
    const char *between = "";
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_metric_row *row = rx_metric_get((rx_metric)m);
        if (row->whole && !whole)
            continue;
        rx_text_printf(dst, "%s\n%s\"%s\": ", between, indent, row->name);
        estimate(dst, &list[m]);
        between = ",";
    }
}

static void metric_table(rx_text *dst)
{
    rx_text_add(dst, "  \"metrics\": {");
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_metric_row *row = rx_metric_get((rx_metric)m);
        int first = 1;
        rx_text_printf(dst, "%s\n    \"%s\": {", m > 0 ? "," : "", row->name);
        string(dst, "unit", row->unit, &first);
        string(dst, "meaning", row->help, &first);
        rx_text_add(dst, "}");
    }
    rx_text_add(dst, "\n  },\n");
}

static void run_head(rx_text *dst, const rx_report *r, int run)
{
    const rx_evaluation *e = &r->evaluation[run];
    int first = 1;
    rx_text_add(dst, "{");
    string(dst, "name", e->run->name, &first);
    string(dst, "settings", e->run->settings, &first);
    string(dst, "psf", e->run->psf, &first);
    number(dst, "noise_law_scale", e->run->law_scale, &first);
    number(dst, "noise_law_power", e->run->law_power, &first);
    string(dst, "pull_from", e->pull_in_flux ? "flux" : "magnitude", &first);
    rx_text_printf(dst, ",\n     \"matches\": \"matches_%s.ecsv\", \"curve\": \"pr_%s.ecsv\",\n     ",
                   r->stem[run], r->stem[run]);
    first = 1;
    number(dst, "references", (double)e->references, &first);
    number(dst, "references_ignored", (double)e->references_ignored, &first);
    number(dst, "detections", (double)e->detections, &first);
    number(dst, "detections_ignored", (double)e->detections_ignored, &first);
    number(dst, "matched", (double)e->matched, &first);
    number(dst, "chance_matches", e->chance, &first);
}

static void run_object(rx_text *dst, const rx_report *r, int run)
{
    run_head(dst, r, run);
    rx_text_add(dst, ",\n     \"all\": {");
    metrics(dst, rx_report_whole(r, run, RX_METRIC_RECALL), 1, "      ");
    rx_text_add(dst, "},\n     \"bins\": [");
    for (int b = 0; b < r->bins.n; b++) {
        int first = 1;
        rx_text_add(dst, b > 0 ? ",\n      {" : "\n      {");
        number(dst, "mag_low", r->bins.edge[b], &first);
        number(dst, "mag_high", r->bins.edge[b + 1], &first);
        rx_text_add(dst, ",");
        metrics(dst, rx_report_bin(r, run, b, RX_METRIC_RECALL), 0, "       ");
        rx_text_add(dst, "}");
    }
    rx_text_add(dst, "]}");
}

static void gates(rx_text *dst, const rx_report *r)
{
    int first = 1;
    rx_text_add(dst, "  ");
    string(dst, "verdict", rx_verdict_name(r->verdict), &first);
    string(dst, "gates_file", r->par->gates != NULL ? r->par->gates->path : NULL, &first);
    rx_text_add(dst, ",\n  \"gates\": [");
    for (long i = 0; i < r->nresults; i++) {
        const rx_gate_result *g = &r->result[i];
        first = 1;
        rx_text_add(dst, i > 0 ? ",\n    {" : "\n    {");
        number(dst, "line", (double)g->gate->line, &first);
        string(dst, "gate", g->gate->text, &first);
        string(dst, "run", g->run >= 0 ? r->input->runs[g->run].name : NULL, &first);
        string(dst, "metric", rx_metric_get(g->gate->metric)->name, &first);
        number(dst, "mag_low", g->gate->whole ? NAN : g->gate->low, &first);
        number(dst, "mag_high", g->gate->whole ? NAN : g->gate->high, &first);
        string(dst, "operator", rx_gate_operator_name(g->gate->op), &first);
        number(dst, "limit", g->gate->value, &first);
        number(dst, "limit_high", g->gate->op == RX_GATE_IN ? g->gate->value_high : NAN, &first);
        number(dst, "level", g->gate->level, &first);
        key(dst, "measured", &first);
        estimate(dst, &g->estimate);
        string(dst, "verdict", rx_verdict_name(g->verdict), &first);
        rx_text_add(dst, "}");
    }
    rx_text_add(dst, "],\n");
}

static void comparisons(rx_text *dst, const rx_report *r)
{
    rx_text_add(dst, "  \"comparisons\": [");
    for (int i = 0; i < r->ncomparisons; i++) {
        const rx_comparison *c = &r->comparison[i];
        int first = 1;
        rx_text_add(dst, i > 0 ? ",\n    {" : "\n    {");
        string(dst, "first", r->input->runs[c->first].name, &first);
        string(dst, "second", r->input->runs[c->second].name, &first);
        number(dst, "found_by_first_only", (double)c->only_first, &first);
        number(dst, "found_by_second_only", (double)c->only_second, &first);
        number(dst, "mcnemar_p", c->p, &first);
        rx_text_add(dst, "}");
    }
    rx_text_add(dst, "],\n");
}

static void record(rx_text *dst, const rx_report *r)
{
    rx_text_add(dst, "  \"record\": [");
    for (int i = 0; i < r->input->nrecord; i++) {
        int first = 1;
        rx_text_add(dst, i > 0 ? ",\n    {" : "\n    {");
        string(dst, "name", r->input->record[i][0], &first);
        string(dst, "value", r->input->record[i][1], &first);
        rx_text_add(dst, "}");
    }
    rx_text_add(dst, "]\n}\n");
}

void rx_report_json(rx_text *dst, const rx_report *r)
{
    const rx_qa_input *in = r->input;
    int first = 1;
    rx_text_add(dst, "{\n  ");
    string(dst, "format", "rextract-qa 1", &first);
    string(dst, "tile", in->tile, &first);
    string(dst, "reference", in->reference, &first);
    rx_text_add(dst, ",\n  ");
    first = 1;
    number(dst, "width", in->width, &first);
    number(dst, "height", in->height, &first);
    number(dst, "pixel_scale_arcsec", in->pixel_scale > 0 ? in->pixel_scale : NAN, &first);
    number(dst, "match_radius_pixels", r->par->match_radius, &first);
    number(dst, "match_radius_arcsec", r->par->match_radius_arcsec > 0 ? r->par->match_radius_arcsec : NAN,
           &first);
    string(dst, "score", in->score_name, &first);
    rx_text_add(dst, ",\n  ");
    first = 1;
    number(dst, "interval_level", r->level, &first);
    string(dst, "intervals",
           "shares: Clopper-Pearson; medians and sigma_MAD: order statistics; means, ap and completeness "
           "magnitudes: "
           "bootstrap; null: not bounded or not known",
           &first);
    key(dst, "seed", &first);
    rx_text_printf(dst, "%lu", r->par->seed); /* whole: a double would round it */
    rx_text_add(dst, ",\n");
    gates(dst, r);
    metric_table(dst);
    rx_text_add(dst, "  \"runs\": [");
    for (int run = 0; run < in->nruns; run++) {
        rx_text_add(dst, run > 0 ? ",\n    " : "\n    ");
        run_object(dst, r, run);
    }
    rx_text_add(dst, "],\n");
    comparisons(dst, r);
    record(dst, r);
}
