/* Tables of the report as ECSV 1.0 (Astropy's APE 6), which astropy opens. */
#include <math.h>
#include <stdio.h>

#include "validate/escape.h"
#include "validate/qa_writers.h"

/* Header of one table: columns one by one, then _end with the row of names. */
typedef struct header {
    rx_text *dst;
    rx_text names;
} header;

static void header_begin(header *h, rx_text *dst, const rx_report *r, const char *run)
{
    *h = (header){.dst = dst};
    rx_text_add(dst, "# %ECSV 1.0\n# ---\n# delimiter: ','\n# meta:\n#   tile: ");
    rx_escape_quoted(dst, r->input->tile);
    rx_text_add(dst, "\n#   reference: ");
    rx_escape_quoted(dst, r->input->reference);
    if (run != NULL) {
        rx_text_add(dst, "\n#   run: ");
        rx_escape_quoted(dst, run);
    }
    rx_text_printf(dst, "\n#   match_radius_pixels: %.9g\n#   interval_level: %.9g\n# datatype:\n",
                   r->par->match_radius, r->level);
}

static void header_column(header *h, const char *name, const char *type, const char *unit,
                          const char *description)
{
    rx_text_printf(h->dst, "# - {name: %s, datatype: %s", name, type);
    if (unit[0] != '\0')
        rx_text_printf(h->dst, ", unit: '%s'", unit);
    rx_text_printf(h->dst, ", description: \"%s\"}\n", description);
    rx_text_printf(&h->names, "%s%s", h->names.length > 0 ? "," : "", name);
}

static void header_end(header *h)
{
    rx_text_printf(h->dst, "# schema: astropy-2.0\n%s\n", h->names.data != NULL ? h->names.data : "");
    h->dst->failed = h->dst->failed || h->names.failed;
    rx_text_free(&h->names);
}

static void cell(rx_text *dst, double value)
{
    rx_text_add(dst, ",");
    rx_number_cell(dst, value);
}

static void estimate_cells(rx_text *dst, const rx_estimate *e)
{
    cell(dst, e->value);
    cell(dst, e->low);
    cell(dst, e->high);
    rx_text_printf(dst, ",%ld", e->n);
}

void rx_report_bins(rx_text *dst, const rx_report *r)
{
    header h;
    char name[64], text[160];
    header_begin(&h, dst, r, NULL);
    header_column(&h, "run", "string", "", "restorer");
    header_column(&h, "mag_low", "float64", "mag", "bin, inclusive; nan in both: all magnitudes");
    header_column(&h, "mag_high", "float64", "mag", "bin, exclusive");
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_metric_row *row = rx_metric_get((rx_metric)m);
        if (row->whole)
            continue;
        header_column(&h, row->name, "float64", row->unit, row->help);
        snprintf(name, sizeof name, "%s_low", row->name);
        header_column(&h, name, "float64", row->unit, "lower end of the interval");
        snprintf(name, sizeof name, "%s_high", row->name);
        header_column(&h, name, "float64", row->unit, "upper end of the interval");
        snprintf(name, sizeof name, "%s_n", row->name);
        snprintf(text, sizeof text, "sources behind %s", row->name);
        header_column(&h, name, "int64", "", text);
    }
    header_end(&h);
    for (int run = 0; run < r->input->nruns; run++)
        for (int b = -1; b < r->bins.n; b++) {
            rx_escape_cell(dst, r->input->runs[run].name);
            cell(dst, b < 0 ? NAN : r->bins.edge[b]);
            cell(dst, b < 0 ? NAN : r->bins.edge[b + 1]);
            for (int m = 0; m < RX_METRIC_COUNT; m++)
                if (!rx_metric_get((rx_metric)m)->whole)
                    estimate_cells(dst, b < 0 ? rx_report_whole(r, run, (rx_metric)m)
                                              : rx_report_bin(r, run, b, (rx_metric)m));
            rx_text_add(dst, "\n");
        }
}

/* FITS counts pixels from 1. */
static double fits_pixel(const double *column, long i)
{
    return i >= 0 ? column[i] + 1 : NAN;
}

static double at(const double *column, long i)
{
    return i >= 0 && column != NULL ? column[i] : NAN;
}

/* Reference i (-1 none) and detection j (-1 none) as one row. */
static void match_row(rx_text *dst, const rx_evaluation *e, const char *state, long i, long j)
{
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    int sky_truth = i >= 0 && truth->alpha != NULL && truth->delta != NULL;
    rx_text_printf(dst, "%s,%ld,%ld", state, i + 1, j + 1);
    cell(dst, fits_pixel(truth->x, i));
    cell(dst, fits_pixel(truth->y, i));
    cell(dst, fits_pixel(list->x, j));
    cell(dst, fits_pixel(list->y, j));
    cell(dst, sky_truth ? truth->alpha[i] : at(list->alpha, j));
    cell(dst, sky_truth ? truth->delta[i] : at(list->delta, j));
    cell(dst, at(e->truth_mag, i));
    cell(dst, at(e->run_mag, j));
    cell(dst, at(list->mag_error, j));
    cell(dst, at(list->flux, j));
    cell(dst, at(list->flux_error, j));
    cell(dst, at(list->score, j));
    rx_text_printf(dst, ",%d", j >= 0 && list->flags != NULL ? list->flags[j] : 0);
    cell(dst, j >= 0 ? hypot(e->dx[j], e->dy[j]) : NAN);
    cell(dst, at(e->dx, j));
    cell(dst, at(e->dy, j));
    cell(dst, at(e->dmag, j));
    cell(dst, j >= 0 ? 100 * (e->ratio[j] - 1) : NAN);
    cell(dst, at(e->pull, j));
    rx_text_add(dst, "\n");
}

void rx_report_matches(rx_text *dst, const rx_report *r, int run)
{
    static const char *const truth_state[] = {"missed", "matched", "reference_ignored"};
    const rx_evaluation *e = &r->evaluation[run];
    header h;
    header_begin(&h, dst, r, e->run->name);
    header_column(&h, "state", "string", "",
                  "matched, missed, false, reference_ignored (masked or outside), detection_ignored");
    header_column(&h, "reference", "int64", "", "row of the reference from 1, 0 none");
    header_column(&h, "detection", "int64", "", "row of the catalogue from 1, 0 none");
    header_column(&h, "x_ref", "float64", "pix", "reference, first pixel is 1");
    header_column(&h, "y_ref", "float64", "pix", "reference, first pixel is 1");
    header_column(&h, "x", "float64", "pix", "detection, first pixel is 1");
    header_column(&h, "y", "float64", "pix", "detection, first pixel is 1");
    header_column(&h, "ra", "float64", "deg", "of the reference where there is one, J2000");
    header_column(&h, "dec", "float64", "deg", "of the reference where there is one, J2000");
    header_column(&h, "mag_ref", "float64", "mag", "reference");
    header_column(&h, "mag", "float64", "mag", "detection");
    header_column(&h, "mag_error", "float64", "mag", "detection");
    header_column(&h, "flux", "float64", "adu", "detection");
    header_column(&h, "flux_error", "float64", "adu", "detection");
    header_column(&h, "score", "float64", "", "ranking of the precision-recall curve");
    header_column(&h, "flags", "int32", "", "FLAGS of the detection");
    header_column(&h, "separation", "float64", "pix", "of the pair");
    header_column(&h, "dx", "float64", "pix", "detection - reference");
    header_column(&h, "dy", "float64", "pix", "detection - reference");
    header_column(&h, "dmag", "float64", "mag", "detection - reference");
    header_column(&h, "flux_error_percent", "float64", "%", "100 (F - F0) / F0");
    header_column(&h, "pull", "float64", "", "(F - F0) / error");
    header_end(&h);
    for (long i = 0; i < e->input->truth.n; i++)
        match_row(dst, e, truth_state[e->truth_role[i]], i, e->partner[i]);
    for (long j = 0; j < e->run->list.n; j++)
        if (e->run_role[j] != RX_ROLE_MATCHED)
            match_row(dst, e, e->run_role[j] == RX_ROLE_IGNORED ? "detection_ignored" : "false", -1, j);
}

void rx_report_curve(rx_text *dst, const rx_report *r, int run)
{
    const rx_evaluation *e = &r->evaluation[run];
    header h;
    header_begin(&h, dst, r, e->run->name);
    header_column(&h, "score", "float64", "", "threshold, this score and higher");
    header_column(&h, "recall", "float64", "", "matched / counted references");
    header_column(&h, "precision", "float64", "", "matched / detections");
    header_column(&h, "detections", "int64", "", "with this score or a higher one");
    header_column(&h, "matched", "int64", "", "with this score or a higher one");
    header_end(&h);
    for (long k = 0; k < e->pr.n; k++) {
        const rx_pr_point *p = &e->pr.point[k];
        rx_number_cell(dst, p->score);
        cell(dst, p->recall);
        cell(dst, p->precision);
        rx_text_printf(dst, ",%ld,%ld\n", p->detections, p->matched);
    }
}
