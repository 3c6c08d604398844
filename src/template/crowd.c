/* Crowded cells. */
#include "template/crowd.h"

#include <math.h>
#include <stdlib.h>

#include "base/memory.h"
#include "base/min_max.h"
#include "num/special.h"

static const double COVERED = 0.05; /* share of the pixels */
static const double BEAMS = 70.0;   /* areas of FWHM^2 a source */
static const double EXTENDED = 0.8; /* share of the light */
static const double BLEND = 1.5;    /* FWHM: what is nearer looks like one extended source */
static const double CHANCE = 4.0;   /* times the odds of chance: a field of stars stays below */
static const double ALREADY =
    5.0; /* points that count before any is seen, so that one source decides nothing */
static const double PAIR_ODDS = 4.0; /* 2 ln of the odds among stars that what is not a point is two */
enum { CELL = 64 };                  /* pixels */

static int cell_of(const rx_crowding *crowd, int x, int y)
{
    return (int)((long)y * crowd->ny / crowd->height) * crowd->nx + (int)((long)x * crowd->nx / crowd->width);
}

/* Fits may take a source over the border: it stays in the cell that it left. */
static int nearest_cell(const rx_crowding *crowd, int x, int y)
{
    return cell_of(crowd, rx_min_int(rx_max_int(x, 0), crowd->width - 1),
                   rx_min_int(rx_max_int(y, 0), crowd->height - 1));
}

int rx_crowding_at(const rx_crowding *crowd, int x, int y)
{
    return crowd != NULL && crowd->n > 0 && crowd->cells[nearest_cell(crowd, x, y)];
}

double rx_crowding_pair_odds(const rx_crowding *crowd, int x, int y)
{
    return crowd->odds[nearest_cell(crowd, x, y)];
}

/* What is in a cell. */
typedef struct tally {
    double seen, covered; /* pixels */
    double sources, hits, points, others;
    double light[2]; /* of points, extended */
} tally;

static void count_sources(const rx_crowd_source *sources, int n, const rx_crowding *crowd, tally *cells)
{
    for (int i = 0; i < n; i++) {
        const rx_crowd_source *s = &sources[i];
        const int x = (int)(s->x + 0.5), y = (int)(s->y + 0.5);
        if (x < 0 || y < 0 || x >= crowd->width || y >= crowd->height)
            continue;
        tally *cell = &cells[cell_of(crowd, x, y)];
        cell->sources += !s->hit;
        cell->hits += s->hit;
        if (s->star >= 0) {
            cell->points += s->star;
            cell->others += 1 - s->star;
        }
        for (int j = 0; j < 2; j++)
            cell->light[j] += s->light[j] > 0 ? s->light[j] : 0;
    }
}

static rx_status count_pixels(rx_fit_image *image, const rx_crowding *crowd, tally *cells, rx_error *err)
{
    for (int from = 0, to; from < crowd->height; from = to) {
        to =
            from + rx_fit_image_rows(image) < crowd->height ? from + rx_fit_image_rows(image) : crowd->height;
        RX_TRY(rx_fit_image_load_rows(image, from, to, err));
        for (int y = from; y < to; y++)
            for (int x = 0; x < crowd->width; x++) {
                const size_t k = rx_fit_image_row(image, y) + (size_t)x;
                tally *cell = &cells[cell_of(crowd, x, y)];
                cell->seen += image->weight[k] > 0;
                cell->covered += image->weight[k] > 0 && image->model[k] > image->sigma[k];
            }
    }
    return RX_OK;
}

/* The cell and the eight around it. */
static tally around(const tally *cells, const rx_crowding *crowd, int x, int y)
{
    tally sum = {0};
    for (int v = rx_max_int(y - 1, 0); v <= rx_min_int(y + 1, crowd->ny - 1); v++)
        for (int u = rx_max_int(x - 1, 0); u <= rx_min_int(x + 1, crowd->nx - 1); u++) {
            const tally *one = &cells[v * crowd->nx + u];
            sum.seen += one->seen;
            sum.covered += one->covered;
            sum.sources += one->sources;
            sum.hits += one->hits;
            sum.points += one->points;
            sum.others += one->others;
            for (int j = 0; j < 2; j++)
                sum.light[j] += one->light[j];
        }
    return sum;
}

/* Odds with which a star has another one within BLEND, so that both look like one extended source: e^x - 1, x of them expected
 * there; of x, x e^-x are then seen. NAN where more are seen than that can be. */
static double chance_odds(double density, double fwhm)
{
    return expm1(-rx_lambert_w(-density * M_PI * BLEND * BLEND * fwhm * fwhm));
}

static int is_crowded(const tally *sum, double fwhm)
{
    return sum->covered * sum->sources > COVERED * sum->seen * (sum->sources + sum->hits) &&
           sum->sources * fwhm * fwhm * BEAMS > sum->seen;
}

/* 2 ln of the odds that what looks extended is two stars: what exceeds several times what chance makes of the points is taken for
 * galaxies. */
static double pair_odds(const tally *sum, double fwhm)
{
    const double chance = chance_odds(sum->sources / sum->seen, fwhm);
    const double galaxies = (sum->others - CHANCE * chance * sum->points) / (sum->points + ALREADY);
    return galaxies > 0 ? fmin(2 * log(chance / galaxies), PAIR_ODDS) : PAIR_ODDS;
}

rx_status rx_crowding_find(rx_fit_image *image, const rx_crowd_source *sources, int n, double fwhm, int mode,
                           rx_crowding *dst, rx_error *err)
{
    *dst = (rx_crowding){.width = image->width,
                         .height = image->height,
                         .nx = (image->width + CELL - 1) / CELL,
                         .ny = (image->height + CELL - 1) / CELL};
    const size_t cells = (size_t)dst->nx * (size_t)dst->ny;
    tally *tallies = RX_NEW(tally, cells);
    dst->cells = RX_NEW(uint8_t, cells);
    dst->odds = RX_NEW(double, cells);
    rx_status status = tallies == NULL || dst->cells == NULL || dst->odds == NULL
                           ? rx_error_memory(err, cells * (sizeof *tallies + sizeof(double) + 1))
                           : RX_OK;
    if (status == RX_OK && mode == RX_CROWDING_AUTO) {
        count_sources(sources, n, dst, tallies);
        status = count_pixels(image, dst, tallies, err);
    }
    for (int y = 0; y < dst->ny && status == RX_OK; y++)
        for (int x = 0; x < dst->nx; x++) {
            const tally sum = around(tallies, dst, x, y);
            const int crowded = mode == RX_CROWDING_YES || is_crowded(&sum, fwhm);
            dst->cells[y * dst->nx + x] = (uint8_t)crowded;
            dst->odds[y * dst->nx + x] = sum.seen > 0 ? pair_odds(&sum, fwhm) : PAIR_ODDS;
            dst->n += crowded;
            dst->seen += mode != RX_CROWDING_AUTO || sum.seen > 0;
        }
    free(tallies);
    if (status != RX_OK)
        rx_crowding_clear(dst);
    return status;
}

rx_status rx_crowding_spare(const rx_crowd_source *sources, int n, rx_crowding *crowd, rx_error *err)
{
    const size_t cells = (size_t)crowd->nx * (size_t)crowd->ny;
    tally *tallies = RX_NEW(tally, cells);
    if (tallies == NULL)
        return rx_error_memory(err, cells * sizeof *tallies);
    count_sources(sources, n, crowd, tallies);
    for (int y = 0; y < crowd->ny; y++)
        for (int x = 0; x < crowd->nx; x++) {
            const tally sum = around(tallies, crowd, x, y);
            uint8_t *cell = &crowd->cells[y * crowd->nx + x];
            if (*cell && sum.light[1] > EXTENDED * (sum.light[0] + sum.light[1])) {
                *cell = 0;
                crowd->n--;
            }
        }
    free(tallies);
    return RX_OK;
}

double rx_crowding_galaxies(const rx_crowding *crowd)
{
    int n = 0;
    for (int i = 0; i < crowd->nx * crowd->ny && crowd->cells != NULL; i++)
        n += crowd->cells[i] && crowd->odds[i] < 0;
    return (double)n / rx_max_int(crowd->n, 1);
}

void rx_crowding_clear(rx_crowding *crowd)
{
    free(crowd->cells);
    free(crowd->odds);
    *crowd = (rx_crowding){0};
}
