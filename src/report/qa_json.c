/* summary.json: every number of the report with its interval and count. */
#include <math.h>

#include "report/json.h"
#include "report/qa_writers.h"

static void metrics(rx_json *json, const char *key, const rx_estimate *list, int whole)
{
    if (key != NULL)
        rx_json_object(json, key, false);
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_metric_row *row = rx_metric_get((rx_metric)m);
        if (whole || !row->whole)
            rx_json_estimate(json, row->name, &list[m]);
    }
    if (key != NULL)
        rx_json_end(json);
}

static const char *help_of(const rx_report *r, int metric)
{
    return metric == RX_METRIC_PRECISION && r->input->precision_is != NULL
               ? r->input->precision_is
               : rx_metric_get((rx_metric)metric)->help;
}

static void metric_table(rx_json *json, const rx_report *r)
{
    rx_json_object(json, "metrics", false);
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_metric_row *row = rx_metric_get((rx_metric)m);
        rx_json_object(json, row->name, true);
        rx_json_string(json, "unit", row->unit);
        rx_json_string(json, "meaning", help_of(r, m));
        rx_json_end(json);
    }
    rx_json_end(json);
}

static void promise(rx_json *json, const rx_qa_promise *p)
{
    rx_json_object(json, "model", false);
    rx_json_string(json, "name", p->model);
    rx_json_string(json, "digest", p->digest);
    rx_json_string(json, "outside", p->why);
    rx_json_number(json, "fwhm", p->fwhm);
    rx_json_number(json, "noise", p->noise);
    rx_json_number(json, "loss", p->loss);
    rx_json_number(json, "recall", p->recall);
    rx_json_number(json, "bias_percent", p->bias);
    rx_json_number(json, "scatter_percent", p->scatter);
    rx_json_end(json);
}

static void run_head(rx_json *json, const rx_report *r, int run)
{
    const rx_evaluation *e = &r->evaluation[run];
    rx_text matches = {0}, curve = {0};
    rx_text_printf(&matches, "matches_%s.ecsv", r->stem[run]);
    rx_text_printf(&curve, "pr_%s.ecsv", r->stem[run]);
    rx_json_string(json, "name", e->run->name);
    rx_json_string(json, "done_by", e->run->by != NULL ? e->run->by : e->run->name);
    rx_json_string(json, "why", e->run->by != NULL ? e->run->why : NULL);
    rx_json_string(json, "settings", e->run->settings);
    rx_json_string(json, "psf", e->run->psf);
    rx_json_number(json, "noise_law_scale", e->run->law_scale);
    rx_json_number(json, "noise_law_power", e->run->law_power);
    rx_json_string(json, "pull_from", e->pull_in_flux ? "flux" : "magnitude");
    rx_json_string(json, "matches", matches.data);
    rx_json_string(json, "curve", curve.data);
    rx_json_number(json, "references", (double)e->references);
    rx_json_number(json, "references_ignored", (double)e->references_ignored);
    rx_json_number(json, "detections", (double)e->detections);
    rx_json_number(json, "detections_ignored", (double)e->detections_ignored);
    rx_json_number(json, "matched", (double)e->matched);
    rx_json_number(json, "chance_matches", e->chance);
    if (e->run->tested) {
        rx_json_object(json, "made_up", true);
        rx_json_number(json, "marked", (double)e->made_up);
        rx_json_number(json, "matched", (double)e->made_up_matched);
        rx_json_number(json, "per_mpixel", e->run->made_up_per_mpixel);
        rx_json_number(json, "precision_without", rx_evaluation_precision_without(e));
        rx_json_end(json);
    }
    if (e->run->blank.n > 0) {
        const rx_qa_blank *blank = &e->run->blank;
        rx_json_object(json, "blank_check", true);
        rx_json_number(json, "realisations", (double)blank->n);
        rx_json_number(json, "mpixels", blank->mpixels);
        rx_json_estimate(json, "false_per_mpixel", &blank->rate);
        rx_json_number(json, "threshold_raised", blank->raised);
        rx_json_number(json, "false_per_mpixel_as_asked", blank->raised > 1.0 ? blank->asked : NAN);
        rx_json_end(json);
    }
    if (e->run->real.n > 0)
        rx_json_estimate(json, "no_noise_peak", &e->run->real);
    if (e->run->flux.n > 0) {
        const rx_qa_flux *flux = &e->run->flux;
        rx_json_object(json, "flux_check", true);
        rx_json_number(json, "sources", (double)flux->n);
        rx_json_number(json, "aperture_pixels", flux->diameter);
        rx_json_number(json, "aperture", flux->wide);
        rx_json_number(json, "aperture_error", flux->wide_error);
        rx_json_number(json, "flux_auto", flux->automatic);
        rx_json_number(json, "flux_auto_error", flux->automatic_error);
        rx_json_string(json, "scale", flux->off ? "off" : "right");
        rx_json_end(json);
    }
    if (e->run->promise != NULL)
        promise(json, e->run->promise);
    json->text->failed = json->text->failed || matches.failed || curve.failed;
    rx_text_free(&matches);
    rx_text_free(&curve);
}

static void run_object(rx_json *json, const rx_report *r, int run)
{
    rx_json_object(json, NULL, false);
    run_head(json, r, run);
    metrics(json, "all", rx_report_whole(r, run, RX_METRIC_RECALL), 1);
    rx_json_array(json, "bins", false);
    for (int b = 0; b < r->bins.n; b++) {
        rx_json_object(json, NULL, false);
        rx_json_number(json, "mag_low", r->bins.edge[b]);
        rx_json_number(json, "mag_high", r->bins.edge[b + 1]);
        metrics(json, NULL, rx_report_bin(r, run, b, RX_METRIC_RECALL), 0);
        rx_json_end(json);
    }
    rx_json_end(json);
    rx_json_end(json);
}

static void gate_object(rx_json *json, const rx_report *r, const rx_gate_result *g)
{
    rx_json_object(json, NULL, true);
    rx_json_number(json, "line", (double)g->gate->line);
    rx_json_string(json, "gate", g->gate->text);
    rx_json_string(json, "run", g->run >= 0 ? r->input->runs[g->run].name : NULL);
    rx_json_string(json, "metric", rx_metric_get(g->gate->metric)->name);
    rx_json_number(json, "mag_low", g->gate->whole ? NAN : g->gate->low);
    rx_json_number(json, "mag_high", g->gate->whole ? NAN : g->gate->high);
    rx_json_string(json, "operator", rx_gate_operator_name(g->gate->op));
    rx_json_number(json, "limit", g->gate->value);
    rx_json_number(json, "limit_high", g->gate->op == RX_GATE_IN ? g->gate->value_high : NAN);
    rx_json_number(json, "level", g->gate->level);
    rx_json_estimate(json, "measured", &g->estimate);
    rx_json_string(json, "verdict", rx_verdict_name(g->verdict));
    rx_json_end(json);
}

static void gates(rx_json *json, const rx_report *r)
{
    rx_json_string(json, "verdict", rx_verdict_name(r->verdict));
    rx_json_string(json, "gates_file", r->par->gates != NULL ? r->par->gates->path : NULL);
    rx_json_array(json, "gates", false);
    for (long i = 0; i < r->nresults; i++)
        gate_object(json, r, &r->result[i]);
    rx_json_end(json);
}

static void comparisons(rx_json *json, const rx_report *r)
{
    rx_json_array(json, "comparisons", false);
    for (int i = 0; i < r->ncomparisons; i++) {
        const rx_comparison *c = &r->comparison[i];
        rx_json_object(json, NULL, true);
        rx_json_string(json, "first", r->input->runs[c->first].name);
        rx_json_string(json, "second", r->input->runs[c->second].name);
        rx_json_number(json, "found_by_first_only", (double)c->only_first);
        rx_json_number(json, "found_by_second_only", (double)c->only_second);
        rx_json_number(json, "mcnemar_p", c->p);
        rx_json_end(json);
    }
    rx_json_end(json);
}

static void settings(rx_json *json, const rx_report *r)
{
    const rx_qa_input *in = r->input;
    rx_json_number(json, "width", in->width);
    rx_json_number(json, "height", in->height);
    rx_json_number(json, "pixel_scale_arcsec", in->pixel_scale > 0 ? in->pixel_scale : NAN);
    rx_json_number(json, "match_radius_pixels", r->par->match_radius);
    rx_json_number(json, "match_radius_arcsec",
                   r->par->match_radius_arcsec > 0 ? r->par->match_radius_arcsec : NAN);
    rx_json_string(json, "score", in->score_name);
    rx_json_number(json, "interval_level", r->level);
    rx_json_string(json, "intervals",
                   "shares: Clopper-Pearson; medians and sigma_MAD: order statistics; means, ap and "
                   "completeness magnitudes: "
                   "bootstrap; null: not bounded or not known");
    rx_json_count(json, "seed", r->par->by.seed);
}

void rx_report_json(rx_text *dst, const rx_report *r)
{
    rx_json writer = rx_json_on(dst), *json = &writer;
    rx_json_object(json, NULL, false);
    rx_json_string(json, "format", "rextract-qa 1");
    rx_json_string(json, "tile", r->input->tile);
    rx_json_string(json, "reference", r->input->reference);
    settings(json, r);
    gates(json, r);
    metric_table(json, r);
    rx_json_array(json, "runs", false);
    for (int run = 0; run < r->input->nruns; run++)
        run_object(json, r, run);
    rx_json_end(json);
    rx_report_psf_json(json, r);
    comparisons(json, r);
    rx_json_record(json, r->input->nrecord, r->input->record);
    rx_json_end(json);
}
