/* Outside strings made harmless for the formats of the report. Bytes that are not UTF-8 and control
 * characters become U+FFFD, as do the ends of lines U+0085, U+2028 and U+2029 where they have no code. */
#ifndef RX_REPORT_ESCAPE_H
#define RX_REPORT_ESCAPE_H

#include "base/text.h"

void rx_escape_html(rx_text *dst, const char *text); /* text and quoted attributes */
void rx_escape_quoted(rx_text *dst,
                      const char *text);             /* with its quotes: a JSON string, also valid in YAML */
void rx_escape_cell(rx_text *dst, const char *text); /* with its quotes: a text cell of ECSV */
void rx_escape_plain(char *dst, size_t size,
                     const char *text); /* letters, digits and " _-+." only, for figures */
void rx_escape_stem(char *dst, size_t size, const char *text); /* letters, digits, - and _, for file names */

#endif
