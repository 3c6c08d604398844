/* Reading the reference catalogue's columns. */
#include "stage/reference.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/memory.h"
#include "catalog/catalog.h"
#include "io/wcs.h"

/* Names that other programs give to what we look for, tried in this order. */
static const char *const value_names[] = {"MAG",     "MAG_TRUE", "MAG_AUTO",  "MAG_BEST",
                                          "MAG_PSF", "PSFMAG_R", "MAG_ISO",   "R",
                                          "RMAG",    "FLUX",     "FLUX_TRUE", "FLUX_AUTO"};
static const char *const error_names[] = {"MAGERR", "MAGERR_AUTO", "MAG_ERR",
                                          "E_MAG",  "FLUXERR",     "FLUXERR_AUTO"};

#define COUNT(a) (sizeof(a) / sizeof((a)[0]))

typedef struct chosen {
    int x, y, value, error; /* column indices, error -1 when there is none */
    int sky, flux;
} chosen;

static int find_first(const rx_table *table, const char *const *names, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        int column = rx_table_find(table, names[i]);
        if (column >= 0)
            return column;
    }
    return -1;
}

static int looks_like_sky(const char *name)
{
    return strncasecmp(name, "ALPHA", 5) == 0 || strncasecmp(name, "RA", 2) == 0 ||
           strstr(name, "_ra") != NULL;
}

static rx_status choose_named(const rx_reference_params *par, const rx_table *table, chosen *dst,
                              rx_error *err)
{
    int found[4] = {-1, -1, -1, -1};
    if (par->ncolumns < 3 || par->ncolumns > 4)
        return rx_error_set(err, RX_USAGE,
                            "REFERENCE_COLUMNS has %d names; give x, y, magnitude or flux[, error]",
                            par->ncolumns);
    for (int i = 0; i < par->ncolumns; i++) {
        found[i] = rx_table_find(table, par->columns[i]);
        if (found[i] < 0)
            return rx_error_at(err, RX_INPUT, par->name, -1, 0,
                               "the reference has no column '%s'; name existing ones in REFERENCE_COLUMNS",
                               par->columns[i]);
    }
    *dst = (chosen){.x = found[0], .y = found[1], .value = found[2], .error = found[3]};
    dst->sky = looks_like_sky(par->columns[0]);
    return RX_OK;
}

static rx_status choose_columns(const rx_reference_params *par, const rx_table *table, const rx_tile *tile,
                                chosen *dst, rx_error *err)
{
    int want_sky = strcmp(par->coords, "SKY") == 0, want_pixel = strcmp(par->coords, "PIXEL") == 0;
    *dst = (chosen){-1, -1, -1, -1, 0, 0};
    if (par->ncolumns > 0) {
        rx_status status = choose_named(par, table, dst, err);
        if (status != RX_OK)
            return status;
        if (want_sky || want_pixel)
            dst->sky = want_sky;
    } else {
        if (!want_pixel && (tile->wcs != NULL || want_sky))
            dst->sky = rx_catalog_find_positions(table, true, &dst->x, &dst->y);
        if (!dst->sky && (want_sky || !rx_catalog_find_positions(table, false, &dst->x, &dst->y)))
            return rx_error_at(err, RX_INPUT, par->name, -1, 0,
                               "no position columns were recognised; name them in REFERENCE_COLUMNS");
        dst->value = find_first(table, value_names, COUNT(value_names));
        dst->error = find_first(table, error_names, COUNT(error_names));
        if (dst->value < 0)
            return rx_error_at(err, RX_INPUT, par->name, -1, 0,
                               "no magnitude or flux column was recognised; name it in REFERENCE_COLUMNS");
    }
    dst->flux = strcmp(par->photometry, "FLUX") == 0 ||
                (strcmp(par->photometry, "AUTO") == 0 &&
                 strncasecmp(table->columns[dst->value].name, "FLUX", 4) == 0);
    const int numbers[4] = {dst->x, dst->y, dst->value, dst->error};
    for (int i = 0; i < 4; i++)
        if (numbers[i] >= 0) {
            rx_status status = rx_catalog_need_numbers(par->name, table, numbers[i], err);
            if (status != RX_OK)
                return status;
        }
    if (dst->sky && tile->wcs == NULL)
        return rx_error_at(err, RX_INPUT, tile->name, tile->hdu, 0,
                           "has no celestial coordinates, so the reference's sky positions cannot be used; "
                           "give REFERENCE_COORDS PIXEL and pixel columns");
    return RX_OK;
}

static void read_row(const rx_reference_params *par, const rx_table *table, const chosen *column, long row,
                     double zeropoint, rx_qa_list *dst, long i)
{
    double value = rx_column_value(&table->columns[column->value], row, 0);
    double error = column->error >= 0 ? rx_column_value(&table->columns[column->error], row, 0) : NAN;
    if (column->flux) {
        double reference_zeropoint = isfinite(par->flux_zeropoint) ? par->flux_zeropoint : zeropoint;
        dst->mag[i] = value > 0.0 ? reference_zeropoint - 2.5 * log10(value) : NAN;
        dst->mag_error[i] = value > 0.0 ? 1.0857362 * error / value : NAN;
    } else {
        dst->mag[i] = value > -90.0 && value < 90.0 ? value : NAN;
        dst->mag_error[i] = error;
    }
    dst->flux[i] = pow(10.0, 0.4 * (zeropoint - dst->mag[i]));
    dst->flux_error[i] = dst->flux[i] * dst->mag_error[i] / 1.0857362;
}

static void read_positions(const rx_table *table, const chosen *column, const rx_tile *tile, rx_qa_list *dst)
{
    for (long i = 0; i < table->nrows; i++) {
        double first = rx_column_value(&table->columns[column->x], i, 0);
        double second = rx_column_value(&table->columns[column->y], i, 0);
        dst->alpha[i] = column->sky ? first : NAN;
        dst->delta[i] = column->sky ? second : NAN;
        dst->x[i] = column->sky ? NAN : first - 1.0; /* FITS counts from 1 */
        dst->y[i] = column->sky ? NAN : second - 1.0;
    }
    if (column->sky)
        rx_wcs_to_pixel(tile->wcs, (int)table->nrows, dst->alpha, dst->delta, dst->x, dst->y);
    else if (tile->wcs != NULL)
        rx_wcs_to_sky(tile->wcs, (int)table->nrows, dst->x, dst->y, dst->alpha, dst->delta);
}

/* Keep rows on the tile or near it. Those without a magnitude stay too: a detection of one is not false. */
static long compact(rx_qa_list *list, const rx_tile *tile)
{
    const double margin = 10.0;
    long kept = 0;
    for (long i = 0; i < list->n; i++) {
        int inside = list->x[i] >= -margin && list->x[i] < tile->width + margin && list->y[i] >= -margin &&
                     list->y[i] < tile->height + margin;
        if (!inside)
            continue;
        list->x[kept] = list->x[i];
        list->y[kept] = list->y[i];
        list->alpha[kept] = list->alpha[i];
        list->delta[kept] = list->delta[i];
        list->mag[kept] = list->mag[i];
        list->mag_error[kept] = list->mag_error[i];
        list->flux[kept] = list->flux[i];
        list->flux_error[kept] = list->flux_error[i];
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
                            rx_log *log, rx_qa_list *dst, rx_error *err)
{
    chosen column;
    RX_TRY(choose_columns(par, table, tile, &column, err));
    RX_TRY(rx_qa_list_new(dst, table->nrows, 0, err));
    read_positions(table, &column, tile, dst);
    for (long i = 0; i < table->nrows; i++)
        read_row(par, table, &column, i, tile->zeropoint, dst, i);
    long kept = compact(dst, tile);
    rx_log_detail(log, "%s: %ld of %ld reference sources on the tile (columns %s, %s, %s)", par->name, kept,
                  table->nrows, table->columns[column.x].name, table->columns[column.y].name,
                  table->columns[column.value].name);
    if (kept == 0)
        rx_log_warning(log, "%s: no reference source falls on the tile; are these the right coordinates?",
                       par->name);
    return RX_OK;
}
