/* Reading the reference catalogue's columns. */
#include "stage/reference.h"

#include <ctype.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "base/constants.h"
#include "catalog/catalog.h"
#include "io/header_numbers.h"
#include "io/wcs.h"

/* Names that other programs give to what we look for, tried in this order. */
static const char *const value_names[] = {"MAG",     "MAG_TRUE", "MAG_AUTO",  "MAG_BEST",
                                          "MAG_PSF", "PSFMAG_R", "MAG_ISO",   "R",
                                          "RMAG",    "FLUX",     "FLUX_TRUE", "FLUX_AUTO"};
static const char *const error_names[] = {"MAGERR", "MAGERR_AUTO", "MAG_ERR",
                                          "E_MAG",  "FLUXERR",     "FLUXERR_AUTO"};

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

/* Catalogues of surveys as their archives and VizieR give them. A magnitude is `mag` with a band of `bands` in place of %s;
 * a catalogue is taken for what the first row says whose columns `mark`, x and y it has. Motions in mas/yr, that
 * along x times cos(delta); the epoch is that of a column (Julian years), or `year`. */
typedef struct survey {
    const char *title, *mark, *x, *y, *mag, *error, *bands;
    const char *motion_x, *motion_y, *epoch;
    double year;
} survey;

#define GAIA_MOTIONS "pmra", "pmdec", "ref_epoch", 2016.0
#define NO_MOTIONS NULL, NULL, NULL, NAN
static const survey surveys[] = {
    {"Gaia", "phot_g_mean_mag", "ra", "dec", "phot_%s_mean_mag", "phot_%s_mean_flux_over_error", "G,BP,RP",
     GAIA_MOTIONS},
    {"Gaia (VizieR)", "BPmag", "RA_ICRS", "DE_ICRS", "%smag", "e_%smag", "G,BP,RP", "pmRA", "pmDE", "Epoch",
     2016.0},
    {"Pan-STARRS1, means", "rMeanPSFMag", "raMean", "decMean", "%sMeanPSFMag", "%sMeanPSFMagErr", "r,g,i,z,y",
     NO_MOTIONS},
    {"Pan-STARRS1, stacks", "rPSFMag", "raStack", "decStack", "%sPSFMag", "%sPSFMagErr", "r,g,i,z,y",
     NO_MOTIONS},
    {"Pan-STARRS1 (VizieR)", "ymag", "RAJ2000", "DEJ2000", "%smag", "e_%smag", "r,g,i,z,y", NO_MOTIONS},
    {"SDSS", "psfMag_r", "ra", "dec", "psfMag_%s", "psfMagErr_%s", "r,u,g,i,z", "pmRa", "pmDec", NULL, NAN},
    {"SDSS, models", "modelMag_r", "ra", "dec", "modelMag_%s", "modelMagErr_%s", "r,u,g,i,z", NO_MOTIONS},
    {"SDSS (VizieR)", "umag", "RA_ICRS", "DE_ICRS", "%smag", "e_%smag", "r,u,g,i,z", NO_MOTIONS},
    {"DES", "WAVG_MAG_PSF_R", "RA", "DEC", "WAVG_MAG_PSF_%s", "WAVG_MAGERR_PSF_%s", "R,G,I,Z,Y", NO_MOTIONS},
    {"DES", "MAG_AUTO_R", "RA", "DEC", "MAG_AUTO_%s", "MAGERR_AUTO_%s", "R,G,I,Z,Y", NO_MOTIONS},
};

/* COLOUR and the one behind it: magnitudes whose difference, times the colour term, is added. */
enum { X, Y, VALUE, ERROR, MOTION_X, MOTION_Y, EPOCH, COLOUR, NCOLUMNS = COLOUR + 2 };

typedef struct chosen {
    int of[NCOLUMNS]; /* indices of columns, -1: none */
    int sky, flux;
    int over_error; /* ERROR is flux over error */
    double year;    /* without EPOCH */
    const survey *survey;
    char band[8];
} chosen;

/* NAN without such a column. */
static double cell(const rx_table *table, const chosen *column, int which, long row)
{
    const int k = column->of[which];
    return k >= 0 ? rx_column_value(&table->columns[k], row, 0) : NAN;
}

static int find_first(const rx_table *table, const char *const *names, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        int column = rx_table_find(table, names[i]);
        if (column >= 0)
            return column;
    }
    return -1;
}

static rx_status choose_named(const rx_reference_params *par, const rx_table *table, chosen *dst,
                              rx_error *err)
{
    if (par->ncolumns < 3 || par->ncolumns > 4)
        return rx_error_set(err, RX_USAGE,
                            "REFERENCE_COLUMNS has %d names; give x, y, magnitude or flux[, error]",
                            par->ncolumns);
    for (int i = 0; i < par->ncolumns; i++) {
        dst->of[i] = rx_table_find(table, par->columns[i]); /* X, Y, VALUE, ERROR */
        if (dst->of[i] < 0)
            return rx_error_at(err, RX_INPUT, par->name, -1, 0,
                               "the reference has no column '%s'; name existing ones in REFERENCE_COLUMNS",
                               par->columns[i]);
    }
    dst->sky = strncasecmp(par->columns[0], "ALPHA", 5) == 0 || strncasecmp(par->columns[0], "RA", 2) == 0 ||
               strstr(par->columns[0], "_ra") != NULL;
    return RX_OK;
}

/* A column of `pattern` with the band in place of %s; -1 when there is none. */
static int find_band(const rx_table *table, const char *pattern, const char *band)
{
    char name[72];
    snprintf(name, sizeof name, "%.*s%s%s", (int)(strstr(pattern, "%s") - pattern), pattern, band,
             strstr(pattern, "%s") + 2);
    return rx_table_find(table, name);
}

/* The word of a list with commas that `text` is, or begins with where no letter follows ("r DECam SDSS c0002"), case
 * ignored; number < 0 and text NULL: none. */
static bool take_band(const char *bands, int number, const char *text, char dst[8])
{
    for (const char *band = bands; *band != '\0'; number--) {
        const size_t length = strcspn(band, ",");
        const bool is = text != NULL
                            ? strncasecmp(text, band, length) == 0 && !isalnum((unsigned char)text[length])
                            : number == 0;
        snprintf(dst, 8, "%.*s", (int)length, band);
        if (is)
            return true;
        band += length + (band[length] == ',');
    }
    dst[0] = '\0';
    return false;
}

/* Columns of a survey: the band of REFERENCE_BAND, that of the tile's filter, or the survey's first one that is there. */
static rx_status choose_survey(const rx_reference_params *par, const rx_table *table, const rx_tile *tile,
                               chosen *dst, rx_error *err)
{
    const survey *s = dst->survey;
    rx_exposure exposure;
    rx_exposure_of(tile, &exposure);
    dst->of[X] = rx_table_find(table, s->x);
    dst->of[Y] = rx_table_find(table, s->y);
    dst->sky = 1;
    if (par->band != NULL && par->band[0] != '\0') {
        if (take_band(s->bands, -1, par->band, dst->band))
            dst->of[VALUE] = find_band(table, s->mag, dst->band);
        if (dst->of[VALUE] < 0)
            return rx_error_at(err, RX_INPUT, par->name, -1, 0,
                               "has no magnitudes of REFERENCE_BAND %s; %s has %s", par->band, s->title,
                               s->bands);
    } else if (take_band(s->bands, -1, exposure.filter, dst->band)) {
        dst->of[VALUE] = find_band(table, s->mag, dst->band);
    }
    for (int k = 0; dst->of[VALUE] < 0 && take_band(s->bands, k, NULL, dst->band); k++)
        dst->of[VALUE] = find_band(table, s->mag, dst->band);
    dst->of[ERROR] = find_band(table, s->error, dst->band);
    dst->over_error = dst->of[ERROR] >= 0 && strstr(s->error, "over_error") != NULL;
    if (s->motion_x != NULL) {
        dst->of[MOTION_X] = rx_table_find(table, s->motion_x);
        dst->of[MOTION_Y] = rx_table_find(table, s->motion_y);
        dst->of[EPOCH] = s->epoch != NULL ? rx_table_find(table, s->epoch) : -1;
        dst->year = s->year;
    }
    return RX_OK;
}

/* The two magnitudes of REFERENCE_COLOR_TERM: bands of the survey, or columns. */
static rx_status choose_colour(const rx_reference_params *par, const rx_table *table, chosen *dst,
                               rx_error *err)
{
    for (int i = 0; i < 2 && par->ncolour > 0; i++) {
        const char *word = par->colour[1 + i];
        char band[8];
        if (dst->survey != NULL && take_band(dst->survey->bands, -1, word, band))
            dst->of[COLOUR + i] = find_band(table, dst->survey->mag, band);
        else
            dst->of[COLOUR + i] = rx_table_find(table, word);
        if (dst->of[COLOUR + i] < 0)
            return rx_error_at(
                err, RX_INPUT, par->name, -1, 0,
                "has no magnitude '%s' for the colour; name a band or a column in REFERENCE_COLOR_TERM",
                word);
    }
    return RX_OK;
}

static rx_status choose_columns(const rx_reference_params *par, const rx_table *table, const rx_tile *tile,
                                chosen *dst, rx_error *err)
{
    *dst = (chosen){0};
    /* the survey that the columns show; without celestial coordinates pixels may stand beside */
    for (const survey *s = surveys; s < surveys + COUNT(surveys) && par->ncolumns == 0 && tile->wcs != NULL;
         s++)
        if (dst->survey == NULL && rx_table_find(table, s->x) >= 0 && rx_table_find(table, s->y) >= 0 &&
            rx_table_find(table, s->mark) >= 0)
            dst->survey = s;
    for (int i = 0; i < NCOLUMNS; i++)
        dst->of[i] = -1;
    if (par->ncolumns > 0) {
        RX_TRY(choose_named(par, table, dst, err));
    } else if (dst->survey != NULL) {
        RX_TRY(choose_survey(par, table, tile, dst, err));
    } else {
        dst->sky = tile->wcs != NULL && rx_catalog_find_positions(table, true, &dst->of[X], &dst->of[Y]);
        if (!dst->sky && !rx_catalog_find_positions(table, false, &dst->of[X], &dst->of[Y]))
            return rx_error_at(err, RX_INPUT, par->name, -1, 0,
                               "no position columns were recognised; name them in REFERENCE_COLUMNS");
        dst->of[VALUE] = find_first(table, value_names, COUNT(value_names));
        dst->of[ERROR] = find_first(table, error_names, COUNT(error_names));
        if (dst->of[VALUE] < 0)
            return rx_error_at(err, RX_INPUT, par->name, -1, 0,
                               "no magnitude or flux column was recognised; name it in REFERENCE_COLUMNS");
    }
    dst->flux = strcasestr(table->columns[dst->of[VALUE]].name, "FLUX") != NULL;
    RX_TRY(choose_colour(par, table, dst, err));
    for (int i = 0; i < NCOLUMNS; i++)
        if (dst->of[i] >= 0)
            RX_TRY(rx_catalog_need_numbers(par->name, table, dst->of[i], err));
    if (dst->sky && tile->wcs == NULL)
        return rx_error_at(err, RX_INPUT, tile->name, tile->hdu, 0,
                           "has no celestial coordinates, so the reference's sky positions cannot be used; "
                           "give pixel columns in REFERENCE_COLUMNS");
    return RX_OK;
}

static void read_row(const rx_reference_params *par, const rx_table *table, const chosen *column, long i,
                     double zeropoint, rx_qa_list *dst)
{
    double value = cell(table, column, VALUE, i), error = cell(table, column, ERROR, i);
    if (column->over_error)
        error = error > 0.0 ? RX_MAG_ERROR / error : NAN;
    if (column->flux) {
        double reference_zeropoint = isfinite(par->flux_zeropoint) ? par->flux_zeropoint : zeropoint;
        dst->mag[i] = value > 0.0 ? reference_zeropoint - 2.5 * log10(value) : NAN;
        dst->mag_error[i] = value > 0.0 ? RX_MAG_ERROR * error / value : NAN;
    } else {
        dst->mag[i] = value > -90.0 && value < 90.0 ? value : NAN;
        dst->mag_error[i] = error;
    }
    if (column->of[COLOUR] >= 0) {
        const double first = cell(table, column, COLOUR, i), second = cell(table, column, COLOUR + 1, i);
        const bool known = fabs(first) < 90.0 && fabs(second) < 90.0;
        dst->mag[i] = known ? dst->mag[i] + par->colour_term * (first - second) : NAN;
    }
    dst->flux[i] = pow(10.0, 0.4 * (zeropoint - dst->mag[i]));
    dst->flux_error[i] = dst->flux[i] * dst->mag_error[i] / RX_MAG_ERROR;
}

/* Where a star stands `years` later: along the tangent at its place, without parallax and radial velocity (The Hipparcos
 * and Tycho Catalogues, ESA SP-1200, 1997, vol. 1, eq. 1.5.19). Motions in mas/yr, places in degrees. */
static void move(double motion_x, double motion_y, double years, double *alpha, double *delta)
{
    const double degree = acos(-1.0) / 180.0, mas = degree / 3.6e6;
    const double a = *alpha * degree, d = *delta * degree;
    const double east = motion_x * mas * years, north = motion_y * mas * years;
    const double x = cos(d) * cos(a) - sin(a) * east - sin(d) * cos(a) * north;
    const double y = cos(d) * sin(a) + cos(a) * east - sin(d) * sin(a) * north;
    const double z = sin(d) + cos(d) * north;
    *alpha = atan2(y, x) / degree;
    *alpha += *alpha < 0.0 ? 360.0 : 0.0;
    *delta = atan2(z, hypot(x, y)) / degree;
}

/* Julian year of the tile's exposure, NAN when its header has no date. */
static double tile_year(const rx_tile *tile)
{
    rx_exposure exposure;
    rx_exposure_of(tile, &exposure);
    return 2000.0 + (exposure.mjd - 51544.5) / 365.25;
}

/* Rows whose motion or epoch is not known stay where they are. */
static long apply_motions(const rx_table *table, const chosen *column, double year, rx_qa_list *dst)
{
    long moved = 0;
    for (long i = 0; i < table->nrows; i++) {
        const double mx = cell(table, column, MOTION_X, i), my = cell(table, column, MOTION_Y, i);
        const double years = year - (column->of[EPOCH] >= 0 ? cell(table, column, EPOCH, i) : column->year);
        if (!(fabs(mx) < 1e5) || !(fabs(my) < 1e5) || !isfinite(years) || !isfinite(dst->alpha[i]))
            continue;
        move(mx, my, years, &dst->alpha[i], &dst->delta[i]);
        moved++;
    }
    return moved;
}

static long read_positions(const rx_table *table, const chosen *column, const rx_tile *tile, rx_qa_list *dst)
{
    for (long i = 0; i < table->nrows; i++) {
        const double first = cell(table, column, X, i), second = cell(table, column, Y, i);
        dst->alpha[i] = column->sky ? first : NAN;
        dst->delta[i] = column->sky ? second : NAN;
        dst->x[i] = column->sky ? NAN : first - 1.0; /* FITS counts from 1 */
        dst->y[i] = column->sky ? NAN : second - 1.0;
    }
    const long moved = apply_motions(table, column, tile_year(tile), dst);
    if (column->sky)
        rx_wcs_to_pixel(tile->wcs, (int)table->nrows, dst->alpha, dst->delta, dst->x, dst->y);
    else if (tile->wcs != NULL)
        rx_wcs_to_sky(tile->wcs, (int)table->nrows, dst->x, dst->y, dst->alpha, dst->delta);
    return moved;
}

/* What was taken, for the page; and what could not be done, for the log as well. */
static void describe(const rx_reference_params *par, const rx_table *table, const chosen *column,
                     const rx_tile *tile, rx_reference_note *note)
{
    const double year = tile_year(tile);
    const bool has_motions = column->of[MOTION_X] >= 0 && column->of[MOTION_Y] >= 0;
    rx_text_printf(&note->shown, "%s", par->name);
    if (column->survey != NULL)
        rx_text_printf(&note->shown, ": %s, %s", column->survey->title,
                       table->columns[column->of[VALUE]].name);
    if (par->ncolour > 0)
        rx_text_printf(&note->shown, " %+g (%s - %s)", par->colour_term, par->colour[1], par->colour[2]);
    if (note->moved > 0)
        rx_text_printf(&note->shown, ", %ld positions moved to %.3f", note->moved, year);
    else if (has_motions)
        rx_text_add(&note->shown, isfinite(year)
                                      ? ", positions not moved: no epoch or motion"
                                      : ", positions not moved: the tile has no MJD-OBS or DATE-OBS");
}

/* Keep rows on the tile or near it. Those without a magnitude stay too: a detection of one is not false. */
static long compact(rx_qa_list *list, const rx_tile *tile)
{
    const double margin = 10.0;
    double *const columns[] = {list->x,   list->y,         list->alpha, list->delta,
                               list->mag, list->mag_error, list->flux,  list->flux_error};
    long kept = 0;
    for (long i = 0; i < list->n; i++) {
        int inside = list->x[i] >= -margin && list->x[i] < tile->width + margin && list->y[i] >= -margin &&
                     list->y[i] < tile->height + margin;
        if (!inside)
            continue;
        for (size_t k = 0; k < COUNT(columns); k++)
            columns[k][kept] = columns[k][i];
        kept++;
    }
    return list->n = kept;
}

rx_status rx_reference_check(const rx_reference_params *par, const rx_table *table, const rx_tile *tile,
                             rx_error *err)
{
    chosen column;
    return choose_columns(par, table, tile, &column, err);
}

rx_status rx_reference_list(const rx_reference_params *par, const rx_table *table, const rx_tile *tile,
                            rx_log *log, rx_qa_list *dst, rx_reference_note *note, rx_error *err)
{
    chosen column;
    RX_TRY(choose_columns(par, table, tile, &column, err));
    RX_TRY(rx_qa_list_new(dst, table->nrows, 0, err));
    note->moved = read_positions(table, &column, tile, dst);
    for (long i = 0; i < table->nrows; i++)
        read_row(par, table, &column, i, tile->zeropoint, dst);
    long kept = compact(dst, tile);
    describe(par, table, &column, tile, note);
    if (note->shown.failed)
        return rx_error_memory(err, 0);
    if (column.survey != NULL)
        rx_log_info(log, "reference %s", note->shown.data);
    rx_exposure exposure;
    char band[sizeof column.band];
    rx_exposure_of(tile, &exposure);
    if (column.survey != NULL && (par->band == NULL || par->band[0] == '\0') && exposure.filter[0] != '\0' &&
        !(take_band(column.survey->bands, -1, exposure.filter, band) && strcmp(band, column.band) == 0))
        rx_log_warning(log,
                       "%s: the tile's filter is %s, its magnitudes are of %s; fluxes will look off; state "
                       "REFERENCE_BAND or REFERENCE_COLOR_TERM",
                       par->name, exposure.filter, column.band);
    if (note->moved == 0 && column.of[MOTION_X] >= 0)
        rx_log_warning(log, "%s: proper motions are not applied; matches of fast stars may be missed",
                       par->name);
    rx_log_detail(log, "%s: %ld of %ld reference sources on the tile (columns %s, %s, %s)", par->name, kept,
                  table->nrows, table->columns[column.of[X]].name, table->columns[column.of[Y]].name,
                  table->columns[column.of[VALUE]].name);
    if (kept == 0)
        rx_log_warning(log, "%s: no reference source falls on the tile; are these the right coordinates?",
                       par->name);
    return RX_OK;
}
