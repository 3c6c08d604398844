/* rextract-survey: what one keyword says about another. */
#include "config/keyword.h"
#include "config/survey_config.h"

rx_status rx_survey_relations(const rx_settings *settings, rx_error *err)
{
    const rx_survey_config *config = (const rx_survey_config *)settings;
    const double low = config->mag_range.v[0], high = config->mag_range.v[1];
    if (high < low || (high > low && (2 * low != (int)(2 * low) || 2 * high != (int)(2 * high))))
        return rx_settings_refuse(settings, "MAG_RANGE", err,
                                  "%g,%g is no range of half magnitudes; give two in order, such as 18,21.5",
                                  low, high);
    return RX_OK;
}
