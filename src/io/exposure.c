/* Filter and time of an exposure. */
#include "io/exposure.h"

#include <math.h>
#include <stdio.h>

#include "io/fits_read.h"

/* MJD of an ISO date, as DATE-OBS has it; NAN: it is none. Days by Fliegel and van Flandern (1968, CACM 11, 657). */
static double mjd_of(const char *date)
{
    int y, m, d, hour = 0, minute = 0;
    double second = 0.0;
    const int n = sscanf(date, "%4d-%2d-%2dT%2d:%2d:%lf", &y, &m, &d, &hour, &minute, &second);
    if (n < 3 || m < 1 || m > 12 || d < 1 || d > 31)
        return NAN;
    const long shift = (m - 14) / 12, day = (1461L * (y + 4800 + shift)) / 4 +
                                            (367L * (m - 2 - 12 * shift)) / 12 -
                                            (3 * ((y + 4900 + shift) / 100)) / 4 + d - 32075;
    return (double)(day - 2400001) + (hour + (minute + second / 60.0) / 60.0) / 24.0;
}

void rx_exposure_of(const rx_tile *tile, rx_exposure *dst)
{
    static const char *const filters[] = {"FILTER", "BAND", "FILTNAM", NULL}, *const times[] = {"MJD-OBS",
                                                                                                "MJD", NULL};
    const long n = (long)tile->ncards;
    char date[36];
    *dst = (rx_exposure){.mjd = NAN};
    if (tile->cards == NULL)
        return;
    for (int i = 0; filters[i] != NULL && dst->filter[0] == '\0'; i++)
        rx_cards_text(tile->cards, n, filters[i], dst->filter, sizeof dst->filter);
    for (int i = 0; times[i] != NULL && isnan(dst->mjd); i++)
        rx_cards_number(tile->cards, n, times[i], &dst->mjd);
    if (isnan(dst->mjd) && rx_cards_text(tile->cards, n, "DATE-OBS", date, sizeof date))
        dst->mjd = mjd_of(date);
}
