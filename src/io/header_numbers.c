/* Numbers from header or keyword. */
#include "io/header_numbers.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "io/cards.h"

static long count(const rx_text *cards)
{
    return (long)(cards->length / RX_CARD);
}

/* The number of that card; a value that is none, or a second card with another number, is warned of. */
static bool read_card(const rx_header *header, const rx_text *cards, const char *key, const char *unit,
                      double *value)
{
    const long n = count(cards), i = rx_cards_find(cards->data, (size_t)n, key);
    char text[RX_CARD];
    double other;
    if (i < 0)
        return false;
    if (!rx_cards_quantity(cards->data, n, key, unit, value)) {
        if (rx_cards_text(cards->data, n, key, text, sizeof text))
            rx_log_warning(header->log, "%s[%d]: %s = '%s' is no number%s%s and counts as absent",
                           header->name, header->hdu, key, text, unit[0] != '\0' ? " in " : "", unit);
        else
            rx_log_warning(header->log, "%s[%d]: %s has no value and counts as absent", header->name,
                           header->hdu, key);
        return false;
    }
    if (rx_cards_quantity(cards->data + (i + 1) * RX_CARD, n - i - 1, key, unit, &other) && other != *value)
        rx_log_warning(header->log,
                       "%s[%d]: %s is there twice, %g and %g; the first is taken, as SExtractor does",
                       header->name, header->hdu, key, *value, other);
    return true;
}

/* First number whose key begins with `key`: SExtractor compares no further, so that GAIN_KEY GAIN finds the
 * GAINA of a two-amplifier detector. */
static bool number_by_prefix(const rx_text *cards, const char *key, const char *unit, double *value,
                             char found[9])
{
    size_t length = strlen(key);
    for (long i = 0; i < count(cards); i++) {
        const char *card = cards->data + i * RX_CARD;
        if (length >= 8 || strncmp(card, key, length) != 0 || strncmp(card + 8, "= ", 2) != 0)
            continue;
        memcpy(found, card, 8);
        found[8] = '\0';
        found[strcspn(found, " ")] = '\0';
        if (rx_cards_quantity(cards->data, count(cards), found, unit, value))
            return true;
    }
    return false;
}

double rx_header_number_or(const rx_header *header, const rx_header_number *wanted, bool *found)
{
    const char *key = wanted->key, *unit = wanted->unit;
    double value = wanted->otherwise;
    char other[9];
    bool there = false;
    if (key != NULL && key[0] != '\0' && strcasecmp(key, "NONE") != 0) {
        there = read_card(header, header->cards, key, unit, &value) ||
                read_card(header, header->parent, key, unit, &value);
        const bool named = there ||
                           rx_cards_find(header->cards->data, (size_t)count(header->cards), key) >= 0 ||
                           rx_cards_find(header->parent->data, (size_t)count(header->parent), key) >= 0;
        if (!named && (number_by_prefix(header->cards, key, unit, &value, other) ||
                       number_by_prefix(header->parent, key, unit, &value, other))) {
            there = true;
            rx_log_hint(header->log, "%s[%d]: the header has no %s; %s = %g is taken, as SExtractor does",
                        header->name, header->hdu, key, other, value);
        } else if (!named && strcasecmp(key, wanted->standard) != 0) {
            rx_log_warning(header->log,
                           "%s[%d]: the header has no %s, the card that was named; %s %g is taken",
                           header->name, header->hdu, key, wanted->keyword, value);
        }
    }
    if (found != NULL)
        *found = there;
    return value;
}

/* --- hints --- */

static bool number_of(const rx_header *header, const char *key, const char *unit, double *value)
{
    return rx_cards_quantity(header->cards->data, count(header->cards), key, unit, value) ||
           rx_cards_quantity(header->parent->data, count(header->parent), key, unit, value);
}

/* Zero point that follows from the physics of a card, AB magnitudes; NULL: none. */
static const char *derived_zeropoint(const rx_header *header, double exptime, const char *text,
                                     const char *unit, double *zeropoint)
{
    /* AB magnitude 0 is 3631 Jy (Oke and Gunn 1983), and 1e9 nanomaggies */
    static const struct {
        const char *unit;
        double in_jansky;
    } fluxes[] = {{"nmgy", 3631e-9}, {"mgy", 3631.}, {"Jy", 1.},     {"mJy", 1e-3},
                  {"uJy", 1e-6},     {"nJy", 1e-9},  {"MJy/sr", 1e6}};
    double value, pivot;
    if (number_of(header, "FLUXMAG0", "", &value) && value > 0) {
        *zeropoint = 2.5 * log10(value);
        return "FLUXMAG0";
    }
    if (number_of(header, "PHOTFLAM", "", &value) && value > 0) {
        /* erg/s/cm2/Angstrom; with the pivot wavelength (Angstrom) AB, without it ST magnitudes */
        const bool ab = number_of(header, "PHOTPLAM", "", &pivot) && pivot > 0;
        const bool counts = strcmp(unit, "e") == 0 || strcmp(unit, "adu") == 0;
        *zeropoint = -2.5 * log10(value) - (ab ? 5 * log10(pivot) + 2.408 : 21.1);
        if (counts && exptime > 0) /* the card is for one a second */
            *zeropoint += 2.5 * log10(exptime);
        return ab ? "PHOTFLAM and PHOTPLAM" : "PHOTFLAM";
    }
    for (size_t i = 0; i < sizeof fluxes / sizeof *fluxes; i++) {
        double jansky = fluxes[i].in_jansky;
        if (strcmp(unit, fluxes[i].unit) != 0)
            continue;
        if (strchr(unit, '/') != NULL) {
            if (!number_of(header, "PIXAR_SR", "sr", &value) || !(value > 0))
                return NULL;
            jansky *= value;
        }
        *zeropoint = -2.5 * log10(jansky / 3631);
        return text;
    }
    return NULL;
}

static void hint_zeropoint(const rx_header *header, double exptime, const char *text, const char *unit)
{
    /* DECam, HSC, DES; VISTA, UKIDSS; ESO's and others' products; ZTF; Pan-STARRS1 */
    static const char *const keys[] = {
        "MAGZERO", "MAGZPT", "PHOTZP",   "MAGZP",    "ZEROPT", "ZEROPNT", "ZEROPOIN", "ZEROPOINT", "MAGZEROP",
        "MAG_ZP",  "MAG0",   "SEXMGZPT", "ZPT",      "ZP",     "ZP_AB",   "ABMAGZP",  "PHOT_C",    "FPA.ZP",
        "PHOT_ZP", "ZPAB",   "MAGZPT1",  "MAG_ZERO", "ZPTMAG", "CALMAG",  "ZMAG"};
    double value;
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        if (!number_of(header, keys[i], "mag", &value) || value == 0)
            continue;
        rx_log_hint(header->log,
                    "%s[%d]: MAG_ZEROPOINT is 0, the header's %s %g; MAG_ZEROPOINT_KEY %s takes it",
                    header->name, header->hdu, keys[i], value, keys[i]);
        return;
    }
    const char *from = derived_zeropoint(header, exptime, text, unit, &value);
    if (from != NULL && isfinite(value) && value != 0)
        rx_log_hint(header->log, "%s[%d]: MAG_ZEROPOINT is 0; by the header's %s it is %.4f, give that",
                    header->name, header->hdu, from, value);
}

/* What the gain would be, given the unit of the pixels: as a number, or "" where that does not say. */
static void gain_of_unit(const char *unit, double exptime, char dst[40])
{
    dst[0] = '\0';
    if (strcmp(unit, "e") == 0)
        snprintf(dst, 40, "1");
    else if (strcmp(unit, "e/s") == 0 && exptime > 0)
        snprintf(dst, 40, "%g (EXPTIME)", exptime);
}

static void hint_no_gain(const rx_header *header, const rx_tile *tile, const char *unit)
{
    static const char *const keys[] = {"EGAIN", "CCDGAIN", "ATODGAIN",           "ARAWGAIN", "AVGAIN",
                                       "EPADU", "CONAD",   "ESO DET OUT1 CONAD", "CELL.GAIN"};
    char value[40];
    double gain;
    gain_of_unit(unit, tile->exptime, value);
    for (size_t i = 0; i < sizeof keys / sizeof *keys && value[0] == '\0'; i++)
        if (number_of(header, keys[i], "e/adu", &gain))
            snprintf(value, sizeof value, "%g (%s)", gain, keys[i]);
    rx_log_hint(header->log, "%s[%d]: no gain: errors leave out the photon noise of sources; give GAIN%s%s",
                header->name, header->hdu, value[0] != '\0' ? " " : "", value);
}

/* GAIN is electrons per unit of the pixels, whatever that is. */
static void check_gain(const rx_header *header, const rx_tile *tile, const char *key, const char *text,
                       const char *unit)
{
    char value[40];
    gain_of_unit(unit, tile->exptime, value);
    const bool rate = strcmp(unit, "adu/s") == 0 && tile->exptime > 0;
    if (rate)
        snprintf(value, sizeof value, "%g (%s x EXPTIME)", tile->gain * tile->exptime, key);
    const double right = rate                       ? tile->gain * tile->exptime
                         : strcmp(unit, "e/s") == 0 ? tile->exptime
                         : strcmp(unit, "e") == 0   ? 1
                         : strcmp(unit, "adu") == 0 ? tile->gain
                         : unit[0] != '\0'          ? 0
                                                    : tile->gain;
    /* cards have six digits and more */
    if (tile->gain > 0 && !(fabs(tile->gain - right) <= 1e-6 * tile->gain))
        rx_log_warning(header->log,
                       "%s[%d]: %s = %g is per ADU, the pixels are in %s; give GAIN_KEY NONE and GAIN%s%s",
                       header->name, header->hdu, key, tile->gain, text,
                       value[0] != '\0' ? " " : " in electrons per that unit", value);
}

void rx_header_hints(const rx_header *header, const rx_tile *tile, const char *gain_key, bool gain_found)
{
    char text[RX_CARD] = "", unit[RX_UNIT_TEXT];
    if (!rx_cards_text(header->cards->data, count(header->cards), "BUNIT", text, RX_CARD))
        rx_cards_text(header->parent->data, count(header->parent), "BUNIT", text, RX_CARD);
    rx_unit_spelling(text, unit);
    if (tile->zeropoint == 0)
        hint_zeropoint(header, tile->exptime, text, unit);
    if (gain_found)
        check_gain(header, tile, gain_key, text, unit);
    else if (tile->gain == 0)
        hint_no_gain(header, tile, unit);
}

/* --- filter and time of an exposure --- */

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
