/* Numbers as text have a decimal point, whatever the locale of the program is. */
#ifndef RX_BASE_POINT_H
#define RX_BASE_POINT_H

#include <locale.h>

#include "base/error.h"

/* So for this thread, from begin to end. */
typedef struct rx_point_locale {
    locale_t point, before;
} rx_point_locale;

rx_status rx_point_locale_begin(rx_point_locale *locale, rx_error *err);
void rx_point_locale_end(rx_point_locale *locale); /* harmless when begin failed or was not called */

/* strtod() */
double rx_point_number(const char *text, char **end);

#endif
