/* Regions of missed and false sources. */
#include "report/qa_regions.h"

#include <math.h>

#include "report/report.h"

/* On the sky where the place there is known, else in pixels from 1. */
static void add_circle(rx_text *dst, const rx_qa_numbers *q, const rx_qa_list *list, long i)
{
    const double radius = q->par->match_radius, scale = q->input->pixel_scale;
    if (scale > 0 && list->alpha != NULL && isfinite(list->alpha[i]))
        rx_text_printf(dst, "icrs;circle(%.7f,%.7f,%.3f\")", list->alpha[i], list->delta[i], radius * scale);
    else
        rx_text_printf(dst, "image;circle(%.3f,%.3f,%.3f)", list->x[i] + 1, list->y[i] + 1, radius);
}

rx_status rx_qa_regions(const rx_qa_numbers *numbers, int run, const char *stem, const char *folder,
                        const char *shown, rx_error *err)
{
    const rx_evaluation *e = &numbers->evaluation[run];
    const rx_qa_list *truth = &e->input->truth, *list = &e->run->list;
    rx_text text = {0}, name = {0};
    rx_text_add(&text, "# Region file format: DS9 version 4.1\n"
                       "# cyan: missed, magnitude of the reference; red: false, row of the catalogue\n");
    for (long i = 0; i < truth->n; i++)
        if (e->truth_role[i] == RX_ROLE_UNMATCHED) {
            add_circle(&text, numbers, truth, i);
            rx_text_printf(&text, " # color=cyan text={%.2f} tag={missed}\n", truth->mag[i]);
        }
    for (long j = 0; j < list->n; j++)
        if (e->run_role[j] == RX_ROLE_UNMATCHED) {
            add_circle(&text, numbers, list, j);
            rx_text_printf(&text, " # color=red text={%ld} tag={false}\n", j + 1);
        }
    rx_text_printf(&name, "regions_%s.reg", stem);
    rx_status status = RX_OK;
    if (name.failed) {
        rx_text_free(&text);
        status = rx_error_memory(err, 0);
    } else {
        status = rx_report_file(folder, shown, name.data, &text, err);
    }
    rx_text_free(&name);
    return status;
}
