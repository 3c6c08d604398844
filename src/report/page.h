/* Pieces of a self-contained HTML page without scripts, in the house style: what every report is built of.
 *
 * `text` is any string and is escaped here; `html` is a constant of ours, or was put together with
 * rx_escape_html(), and goes in as it is. Memory trouble shows in dst->failed.
 *
 *   rx_page_begin(&page, "Campaign: ", title);        head, style, <h1>
 *   rx_page_link(&page, 1, "tables", "Tables"); ...   a line of links between rx_page_links_begin and _end
 *   rx_page_section(&page, "tables", "Tables");       <h2 id="tables">
 *   rx_page_table_begin(&page);                       a table that scrolls sideways when it is wide
 *   rx_page_row(&page, NULL);
 *   rx_page_head(&page, RX_LEFT, "method", NULL); rx_page_head(&page, RX_RIGHT, "PSNR", "dB");
 *   rx_page_row_end(&page); ... rx_page_row(), rx_page_cell_text(), rx_page_cell_number(), rx_page_row_end()
 *   rx_page_table_end(&page);
 *   rx_page_note(&page, "how to read it");
 *   rx_page_end(&page);
 */
#ifndef RX_REPORT_PAGE_H
#define RX_REPORT_PAGE_H

#include <stdbool.h>

#include "base/text.h"
#include "quality/binomial.h"
#include "report/figure.h"

/* Text stands left and may wrap, numbers right and on one line. */
typedef enum rx_align { RX_RIGHT, RX_LEFT } rx_align;

/* <html> to <h1>: kind and title together are the heading and the title of the window ("QA report: ", name). The
 * header of the page goes on to the end of the links, what follows is its main part. */
void rx_page_begin(rx_text *dst, const char *kind, const char *title);
void rx_page_end(rx_text *dst);

void rx_page_links_begin(rx_text *dst);
void rx_page_link(rx_text *dst, bool there, const char *id, const char *text); /* nothing unless `there` */
void rx_page_links_end(rx_text *dst);

void rx_page_section(rx_text *dst, const char *id, const char *text); /* <h2>, target of rx_page_link */
void rx_page_heading(rx_text *dst, const char *text,
                     const char *unit);                 /* <h3>, "text [unit]"; unit may be NULL */
void rx_page_unit(rx_text *dst, const char *unit);      /* " [unit]", nothing for NULL and "" */
void rx_page_paragraph(rx_text *dst, const char *html); /* body text */
void rx_page_note(rx_text *dst, const char *html);      /* small and grey: how to read it */

void rx_page_table_begin(rx_text *dst);
void rx_page_table_end(rx_text *dst);
void rx_page_row(rx_text *dst, const char *mark); /* mark: class of the row, RX_MARK_... or NULL */
void rx_page_row_end(rx_text *dst);
void rx_page_head(rx_text *dst, rx_align align, const char *text, const char *unit); /* "text [unit]" */
/* Cells; NULL, "" and NAN are shown as a dash, infinities as such. */
void rx_page_cell_text(rx_text *dst, const char *text);
void rx_page_cell_file(rx_text *dst, const char *name); /* a link to a file beside the page */
void rx_page_cell_title(rx_text *dst, const char *text, const char *unit); /* of the row, "text [unit]" */
void rx_page_cell_number(rx_text *dst, double value,
                         int digits); /* after the point; below 0: significant ones */
/* value +- error, or the value alone where the error is not known */
void rx_page_cell_measured(rx_text *dst, double value, double error, int digits);
void rx_page_cell_count(rx_text *dst, long n);
/* value [low, high] n=...; a dash alone where there is no value and n is 0. */
void rx_page_cell_estimate(rx_text *dst, const rx_estimate *e, int digits);
/* A p-value, 2 digits: 0.031, 5.2 x 10^-38; ln_p serves where p is below the smallest double, and where that
 * is infinite, too, p is said to be below 10^-307. */
void rx_page_cell_p(rx_text *dst, double p, double ln_p);
/* A word in bold and in its colour: PASS, FAIL, INSUFFICIENT (and what else is a class of the style). */
void rx_page_cell_verdict(rx_text *dst, const char *mark, const char *text);

/* The same without the cell around them, for sentences. */
void rx_page_number(rx_text *dst, double value, int digits);
void rx_page_estimate(rx_text *dst, const rx_estimate *e, int digits);
void rx_page_p(rx_text *dst, double p, double ln_p);

/* Classes: green, red, amber, grey. */
#define RX_MARK_GOOD "PASS"
#define RX_MARK_BAD "FAIL"
#define RX_MARK_OPEN "INSUFFICIENT"
#define RX_MARK_PALE "pale"

/* All figures whose id begins with `prefix` ("" = all) side by side, or why there are none. */
void rx_page_figures(rx_text *dst, const rx_figures *figures, const char *prefix);

/* Configuration and provenance: name and value, folded away. */
void rx_page_record(rx_text *dst, int n, const char *const (*pairs)[2]);

#endif
