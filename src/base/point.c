/* The C locale for a while. */
#include "base/point.h"

#include <stdlib.h>

rx_status rx_point_locale_begin(rx_point_locale *locale, rx_error *err)
{
    locale->before = (locale_t)0;
    locale->point = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    if (locale->point == (locale_t)0)
        return rx_error_memory(err, 0);
    locale->before = uselocale(locale->point);
    return RX_OK;
}

void rx_point_locale_end(rx_point_locale *locale)
{
    if (locale->point == (locale_t)0)
        return;
    uselocale(locale->before);
    freelocale(locale->point);
    locale->point = (locale_t)0;
}

double rx_point_number(const char *text, char **end)
{
    rx_point_locale locale;
    (void)rx_point_locale_begin(&locale, NULL);
    const double number = strtod(text, end);
    rx_point_locale_end(&locale);
    return number;
}
