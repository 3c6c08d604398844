/* Tables of the report as ECSV 1.0 (Astropy's APE 6), which astropy opens. */
#include <math.h>

#include "report/ecsv.h"
#include "report/qa_writers.h"

static rx_ecsv table_on(rx_text *dst, const rx_report *r, const char *run)
{
    rx_ecsv table = rx_ecsv_on(dst);
    rx_ecsv_meta(&table, "tile", r->input->tile);
    rx_ecsv_meta(&table, "reference", r->input->reference);
    if (run != NULL)
        rx_ecsv_meta(&table, "run", run);
    rx_ecsv_meta_number(&table, "match_radius_pixels", r->par->match_radius);
    rx_ecsv_meta_number(&table, "interval_level", r->level);
    return table;
}

void rx_report_bins(rx_text *dst, const rx_report *r)
{
    rx_ecsv table = table_on(dst, r, NULL);
    rx_ecsv_column(&table, "run", RX_ECSV_TEXT, "", "restorer");
    rx_ecsv_column(&table, "mag_low", RX_ECSV_FLOAT, "mag", "bin, inclusive; nan in both: all magnitudes");
    rx_ecsv_column(&table, "mag_high", RX_ECSV_FLOAT, "mag", "bin, exclusive");
    for (int m = 0; m < RX_METRIC_COUNT; m++) {
        const rx_metric_row *row = rx_metric_get((rx_metric)m);
        if (!row->whole)
            rx_ecsv_estimate_columns(&table, row->name, row->unit, row->help);
    }
    rx_ecsv_columns_end(&table);
    for (int run = 0; run < r->input->nruns; run++)
        for (int b = -1; b < r->bins.n; b++) {
            rx_ecsv_text(&table, r->input->runs[run].name);
            rx_ecsv_number(&table, b < 0 ? NAN : r->bins.edge[b]);
            rx_ecsv_number(&table, b < 0 ? NAN : r->bins.edge[b + 1]);
            for (int m = 0; m < RX_METRIC_COUNT; m++)
                if (!rx_metric_get((rx_metric)m)->whole)
                    rx_ecsv_estimate(&table, b < 0 ? rx_report_whole(r, run, (rx_metric)m)
                                                   : rx_report_bin(r, run, b, (rx_metric)m));
            rx_ecsv_row_end(&table);
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
static void match_row(rx_ecsv *table, const rx_evaluation *e, const char *state, long i, long j)
{
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    int sky_truth = i >= 0 && truth->alpha != NULL && truth->delta != NULL;
    rx_ecsv_word(table, state);
    rx_ecsv_count(table, i + 1);
    rx_ecsv_count(table, j + 1);
    rx_ecsv_number(table, fits_pixel(truth->x, i));
    rx_ecsv_number(table, fits_pixel(truth->y, i));
    rx_ecsv_number(table, fits_pixel(list->x, j));
    rx_ecsv_number(table, fits_pixel(list->y, j));
    rx_ecsv_number(table, sky_truth ? truth->alpha[i] : at(list->alpha, j));
    rx_ecsv_number(table, sky_truth ? truth->delta[i] : at(list->delta, j));
    rx_ecsv_number(table, at(e->truth_mag, i));
    rx_ecsv_number(table, at(e->run_mag, j));
    rx_ecsv_number(table, at(list->mag_error, j));
    rx_ecsv_number(table, at(list->flux, j));
    rx_ecsv_number(table, at(list->flux_error, j));
    rx_ecsv_number(table, at(list->score, j));
    rx_ecsv_count(table, j >= 0 && list->flags != NULL ? list->flags[j] : 0);
    rx_ecsv_count(table, j >= 0 && list->made_up != NULL && list->made_up[j]);
    rx_ecsv_number(table, j >= 0 ? hypot(e->dx[j], e->dy[j]) : NAN);
    rx_ecsv_number(table, at(e->dx, j));
    rx_ecsv_number(table, at(e->dy, j));
    rx_ecsv_number(table, at(e->dmag, j));
    rx_ecsv_number(table, j >= 0 ? 100 * (e->ratio[j] - 1) : NAN);
    rx_ecsv_number(table, at(e->pull, j));
    rx_ecsv_row_end(table);
}

void rx_report_matches(rx_text *dst, const rx_report *r, int run)
{
    static const char *const truth_state[] = {"missed", "matched", "reference_ignored"};
    const rx_evaluation *e = &r->evaluation[run];
    rx_ecsv table = table_on(dst, r, e->run->name);
    rx_ecsv_column(&table, "state", RX_ECSV_TEXT, "",
                   "matched, missed, false, reference_ignored (masked or outside), detection_ignored");
    rx_ecsv_column(&table, "reference", RX_ECSV_LONG, "", "row of the reference from 1, 0 none");
    rx_ecsv_column(&table, "detection", RX_ECSV_LONG, "", "row of the catalogue from 1, 0 none");
    rx_ecsv_column(&table, "x_ref", RX_ECSV_FLOAT, "pix", "reference, first pixel is 1");
    rx_ecsv_column(&table, "y_ref", RX_ECSV_FLOAT, "pix", "reference, first pixel is 1");
    rx_ecsv_column(&table, "x", RX_ECSV_FLOAT, "pix", "detection, first pixel is 1");
    rx_ecsv_column(&table, "y", RX_ECSV_FLOAT, "pix", "detection, first pixel is 1");
    rx_ecsv_column(&table, "ra", RX_ECSV_FLOAT, "deg", "of the reference where there is one, J2000");
    rx_ecsv_column(&table, "dec", RX_ECSV_FLOAT, "deg", "of the reference where there is one, J2000");
    rx_ecsv_column(&table, "mag_ref", RX_ECSV_FLOAT, "mag", "reference");
    rx_ecsv_column(&table, "mag", RX_ECSV_FLOAT, "mag", "detection");
    rx_ecsv_column(&table, "mag_error", RX_ECSV_FLOAT, "mag", "detection");
    rx_ecsv_column(&table, "flux", RX_ECSV_FLOAT, "adu", "detection");
    rx_ecsv_column(&table, "flux_error", RX_ECSV_FLOAT, "adu", "detection");
    rx_ecsv_column(&table, "score", RX_ECSV_FLOAT, "", "ranking of the precision-recall curve");
    rx_ecsv_column(&table, "flags", RX_ECSV_INT, "", "FLAGS of the detection");
    rx_ecsv_column(&table, "made_up", RX_ECSV_INT, "", "1: untouched pixels do not want it (FLAGS_RESTORE)");
    rx_ecsv_column(&table, "separation", RX_ECSV_FLOAT, "pix", "of the pair");
    rx_ecsv_column(&table, "dx", RX_ECSV_FLOAT, "pix", "detection - reference");
    rx_ecsv_column(&table, "dy", RX_ECSV_FLOAT, "pix", "detection - reference");
    rx_ecsv_column(&table, "dmag", RX_ECSV_FLOAT, "mag", "detection - reference");
    rx_ecsv_column(&table, "flux_error_percent", RX_ECSV_FLOAT, "%", "100 (F - F0) / F0");
    rx_ecsv_column(&table, "pull", RX_ECSV_FLOAT, "", "(F - F0) / error");
    rx_ecsv_columns_end(&table);
    for (long i = 0; i < e->input->truth.n; i++)
        match_row(&table, e, truth_state[e->truth_role[i]], i, e->partner[i]);
    for (long j = 0; j < e->run->list.n; j++)
        if (e->run_role[j] != RX_ROLE_MATCHED)
            match_row(&table, e, e->run_role[j] == RX_ROLE_IGNORED ? "detection_ignored" : "false", -1, j);
}

void rx_report_curve(rx_text *dst, const rx_report *r, int run)
{
    const rx_evaluation *e = &r->evaluation[run];
    rx_ecsv table = table_on(dst, r, e->run->name);
    rx_ecsv_column(&table, "score", RX_ECSV_FLOAT, "", "threshold, this score and higher");
    rx_ecsv_column(&table, "recall", RX_ECSV_FLOAT, "", "matched / counted references");
    rx_ecsv_column(&table, "precision", RX_ECSV_FLOAT, "", "matched / detections");
    rx_ecsv_column(&table, "detections", RX_ECSV_LONG, "", "with this score or a higher one");
    rx_ecsv_column(&table, "matched", RX_ECSV_LONG, "", "with this score or a higher one");
    rx_ecsv_columns_end(&table);
    for (long k = 0; k < e->pr.n; k++) {
        const rx_pr_point *p = &e->pr.point[k];
        rx_ecsv_number(&table, p->score);
        rx_ecsv_number(&table, p->recall);
        rx_ecsv_number(&table, p->precision);
        rx_ecsv_count(&table, p->detections);
        rx_ecsv_count(&table, p->matched);
        rx_ecsv_row_end(&table);
    }
}
