/* The roll-up as continuous integration shows it. */
#include <stdio.h>
#include <stdlib.h>

#include "base/memory.h"
#include "report/formats.h"
#include "survey/rollup.h"

/* kind: element of what is wrong, or NULL; notes: lines to read all the same, or NULL. */
static void junit_case(rx_text *dst, const char *image, const char *kind, const char *what, const char *notes)
{
    rx_text_add(dst, "  <testcase classname=\"rextract\" name=\"");
    rx_escape_html(dst, image);
    if (kind == NULL && notes == NULL) {
        rx_text_add(dst, "\"/>\n");
        return;
    }
    rx_text_add(dst, "\">");
    if (kind != NULL) {
        rx_text_printf(dst, "<%s message=\"", kind);
        rx_escape_html(dst, what);
        rx_text_add(dst, "\"/>");
    }
    if (notes != NULL) {
        rx_text_add(dst, "<system-out>");
        rx_escape_html(dst, notes);
        rx_text_add(dst, "</system-out>");
    }
    rx_text_add(dst, "</testcase>\n");
}

/* What the rows of every tile say beside pass and fail: notes[place of the tile], in the order of its rows. */
static void collect_notes(const rx_rollup *r, rx_text *notes)
{
    for (int i = 0; i < r->nrows; i++) {
        const rx_rollup_row *row = &r->row[i];
        rx_text *dst = &notes[row->tile->place];
        const char *run = r->run[row->run].name;
        char before[40];
        snprintf(before, sizeof before, "HDU %d: ", row->hdu);
        rx_rollup_row_notes(dst, row, before, run);
        if (row->guard.known && row->guard.raised > 1.0)
            rx_text_printf(rx_rollup_note(dst, before, run),
                           "DETECT_THRESH was raised %.3g times for false detections", row->guard.raised);
    }
}

void rx_rollup_junit(rx_text *dst, const rx_rollup *r)
{
    rx_text *notes = RX_NEW(rx_text, (size_t)r->ntiles);
    if (notes == NULL) {
        dst->failed = true;
        return;
    }
    collect_notes(r, notes);
    rx_text_printf(
        dst,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"rextract survey\" tests=\"%d\" "
        "failures=\"%d\" errors=\"%d\" skipped=\"%d\">\n",
        r->ntiles + r->nmissing, r->gates, r->failed + r->nmissing, r->undecided);
    for (int i = 0; i < r->ntiles; i++) {
        const rx_rollup_tile *tile = r->tile[i];
        junit_case(dst, tile->image,
                   tile->status == RX_OK                  ? NULL
                   : tile->status == RX_GATE_FAIL         ? "failure"
                   : tile->status == RX_GATE_INSUFFICIENT ? "skipped"
                                                          : "error",
                   tile->what, notes[i].data);
        dst->failed |= notes[i].failed;
        rx_text_free(&notes[i]);
    }
    free(notes);
    for (int i = 0; i < r->nmissing; i++)
        junit_case(dst, rx_tiles_image(r->tiles, r->missing[i]), "error",
                   "no record: it was not run, or was killed", NULL);
    rx_text_add(dst, "</testsuite>\n");
}
