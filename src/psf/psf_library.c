/* A library of PSFs is a folder of .psf files, each of one tile, whose headers say of which. */
#include "psf/psf_library.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "io/fits_read.h"
#include "io/wcs.h"
#include "psf/psf.h"
#include "psf/psf_files.h"

enum { NEIGHBOURS = 8 };
static const double ASSUMED = 0.1; /* relative error where no neighbour says one */

/* ---- which exposure ---- */

/* The first of those keys that the header has; "" none. */
static void first_text(const rx_tile *tile, const char *const *keys, char *dst, int size)
{
    dst[0] = '\0';
    for (; *keys != NULL && dst[0] == '\0'; keys++)
        rx_cards_text(tile->cards, (long)tile->ncards, *keys, dst, size);
}

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

void rx_psf_origin_of(const rx_tile *tile, rx_psf_origin *dst)
{
    static const char *const chips[] = {"CCDNUM", "DETECTOR", "CCDNAME", "CHIPID", "CAMCOL", NULL},
                             *const filters[] = {"FILTER", "BAND", "FILTNAM", NULL},
                             *const times[] = {"MJD-OBS", "MJD", NULL};
    char instrument[36], chip[36], date[36];
    *dst =
        (rx_psf_origin){.mjd = NAN, .alpha = NAN, .delta = NAN, .width = tile->width, .height = tile->height};
    if (tile->cards != NULL) {
        const long n = (long)tile->ncards;
        rx_cards_text(tile->cards, n, "INSTRUME", instrument, sizeof instrument);
        first_text(tile, chips, chip, sizeof chip);
        if (chip[0] == '\0')
            snprintf(chip, sizeof chip, "%.35s", tile->extname != NULL ? tile->extname : "");
        snprintf(dst->ccd, sizeof dst->ccd, "%s%s%s", instrument,
                 instrument[0] != '\0' && chip[0] != '\0' ? " " : "", chip);
        first_text(tile, filters, dst->filter, sizeof dst->filter);
        for (int i = 0; times[i] != NULL && isnan(dst->mjd); i++)
            rx_cards_number(tile->cards, n, times[i], &dst->mjd);
        if (isnan(dst->mjd) && rx_cards_text(tile->cards, n, "DATE-OBS", date, sizeof date))
            dst->mjd = mjd_of(date);
    }
    const double x = 0.5 * (tile->width - 1), y = 0.5 * (tile->height - 1);
    if (tile->wcs != NULL)
        rx_wcs_to_sky(tile->wcs, 1, &x, &y, &dst->alpha, &dst->delta);
}

void rx_psf_origin_facts(const rx_psf_origin *origin, rx_record *facts)
{
    rx_record_add(facts, "RXLCCD", "CCD of this tile", "%s", origin->ccd);
    rx_record_add(facts, "RXLFILT", "its filter", "%s", origin->filter);
    if (isfinite(origin->mjd))
        rx_record_add(facts, "RXLMJD", "begin of its exposure, MJD", "%.8f", origin->mjd);
    if (isfinite(origin->alpha) && isfinite(origin->delta)) {
        rx_record_add(facts, "RXLRA", "its centre, deg J2000", "%.7f", origin->alpha);
        rx_record_add(facts, "RXLDEC", "its centre, deg J2000", "%.7f", origin->delta);
    }
    rx_record_add(facts, "RXLNX", "its width, pixels", "%d", origin->width);
    rx_record_add(facts, "RXLNY", "its height, pixels", "%d", origin->height);
}

int rx_psf_library_takes(const rx_psf *psf)
{
    const rx_psf_quality *q = &psf->quality;
    return strcmp(q->how, "PIXELS") == 0 && psf->nstars >= RX_PSF_LIBRARY_STARS && fabs(q->growth) <= 0.01 &&
           q->beyond <= 0.01 && fabs(q->trace[0]) <= fmax(0.01, 5.0 * q->trace[1]);
}

/* ---- the models of a folder ---- */

typedef struct entry {
    char *path;
    double days, degrees; /* from the tile; NAN not known */
    double far;           /* in units of the limits */
} entry;

/* Angle between two places, deg (haversines). */
static double angle(double alpha1, double delta1, double alpha2, double delta2)
{
    const double deg = M_PI / 180.0, a = sin(0.5 * deg * (alpha2 - alpha1)),
                 d = sin(0.5 * deg * (delta2 - delta1));
    return 2.0 / deg * asin(fmin(1.0, sqrt(d * d + cos(deg * delta1) * cos(deg * delta2) * a * a)));
}

/* How far the model of that header is from the tile; HUGE_VAL: it is of another CCD, or too far away. */
static double distance(const rx_psf_library *library, const rx_psf_origin *tile, const char *cards, long n,
                       double *days, double *degrees)
{
    rx_psf_origin own = {.mjd = NAN, .alpha = NAN, .delta = NAN};
    double width = 0.0, height = 0.0, terms = 0.0;
    *days = *degrees = NAN;
    rx_cards_text(cards, n, "RXLCCD", own.ccd, sizeof own.ccd);
    rx_cards_text(cards, n, "RXLFILT", own.filter, sizeof own.filter);
    if (!rx_cards_number(cards, n, "RXLNX", &width) || !rx_cards_number(cards, n, "RXLNY", &height) ||
        strcmp(own.ccd, tile->ccd) != 0 || strcmp(own.filter, tile->filter) != 0)
        return HUGE_VAL;
    /* where on the CCD a tile of another size lies is not known */
    if ((width != tile->width || height != tile->height) &&
        !(rx_cards_number(cards, n, "POLDEG1", &terms) && terms == 0.0))
        return HUGE_VAL;
    rx_cards_number(cards, n, "RXLMJD", &own.mjd);
    rx_cards_number(cards, n, "RXLRA", &own.alpha);
    rx_cards_number(cards, n, "RXLDEC", &own.delta);
    *days = own.mjd - tile->mjd;
    *degrees = angle(own.alpha, own.delta, tile->alpha, tile->delta);
    if ((isnan(*days) && isnan(*degrees)) || fabs(*days) > library->days || *degrees > library->degrees)
        return HUGE_VAL;
    return hypot(isnan(*days) ? 0.0 : *days / library->days,
                 isnan(*degrees) ? 0.0 : *degrees / library->degrees);
}

static int by_distance(const void *a, const void *b)
{
    const entry *p = a, *q = b;
    return p->far != q->far ? (p->far > q->far) - (p->far < q->far) : strcmp(p->path, q->path);
}

/* The nearest models, at most 1 + NEIGHBOURS, nearest first. */
static rx_status look_through(const rx_psf_library *library, const rx_psf_origin *tile, rx_log *log,
                              entry *list, int *n, rx_error *err)
{
    DIR *folder = opendir(library->folder);
    rx_status status = RX_OK;
    *n = 0;
    if (folder == NULL)
        return rx_error_at(err, RX_USAGE, library->folder, -1, 0,
                           "cannot be read as PSF_LIBRARY: %s; give a folder of .psf files", strerror(errno));
    for (struct dirent *file; status == RX_OK && (file = readdir(folder)) != NULL;) {
        const size_t length = strlen(file->d_name), size = strlen(library->folder) + length + 2;
        char *cards = NULL;
        long ncards = 0;
        if (file->d_name[0] == '.' || length < 5 || strcmp(file->d_name + length - 4, ".psf") != 0)
            continue;
        entry e = {.path = malloc(size)};
        if (e.path == NULL) {
            status = rx_error_memory(err, size);
            break;
        }
        snprintf(e.path, size, "%s/%s", library->folder, file->d_name);
        status = rx_interrupt_check(err);
        if (status == RX_OK && rx_fits_read_header(e.path, 1, &cards, &ncards, NULL) != RX_OK) {
            rx_log_warning(log, "%s: is no PSF of a library and left out", e.path);
            e.far = HUGE_VAL;
        } else {
            e.far = distance(library, tile, cards, ncards, &e.days, &e.degrees);
        }
        free(cards);
        list[*n] = e; /* room for one more than is kept */
        if (e.far < HUGE_VAL)
            qsort(list, (size_t)++ * n, sizeof *list, by_distance);
        else
            free(e.path);
        if (*n > 1 + NEIGHBOURS)
            free(list[--*n].path);
    }
    closedir(folder);
    return status;
}

/* The model on the tile's pixels, no larger than the tile. */
static rx_status read_model(const entry *e, const rx_psf_origin *tile, rx_log *log, rx_psf **dst,
                            rx_error *err)
{
    const int least = tile->width < tile->height ? tile->width : tile->height;
    rx_psf_params par = {.type = RX_PSF_PSFEX, .file = e->path, .extension = 1};
    double side = 0.0, step = 1.0;
    char *cards = NULL, text[80];
    long n = 0;
    RX_TRY(rx_fits_read_header(e->path, 1, &cards, &n, err));
    rx_cards_number(cards, n, "PSFAXIS1", &side);
    rx_cards_number(cards, n, "PSF_SAMP", &step);
    if (side * step > least)
        par.size = least - 1 + least % 2;
    struct {
        const char *key;
        double low, high, value;
    } card[] = {{"ACCEPTED", 0, INT_MAX, 0},
                {"RXPSFDEG", 0, RX_PSF_MAX_DEGREE, 0},
                {"RXPSFOUT", 0, 1, 0},
                {"RXLNX", 1, INT_MAX, 0},
                {"RXLNY", 1, INT_MAX, 0}};
    rx_status status = RX_OK;
    for (size_t i = 0; i < sizeof card / sizeof *card && status == RX_OK; i++)
        if (rx_cards_text(cards, n, card[i].key, text, sizeof text) &&
            !(rx_cards_number(cards, n, card[i].key, &card[i].value) && card[i].value >= card[i].low &&
              card[i].value <= card[i].high))
            status = rx_error_at(err, RX_INPUT, e->path, -1, 0,
                                 "%s = %s is not in %.10g to %.10g; make this model again", card[i].key, text,
                                 card[i].low, card[i].high);
    if (status == RX_OK)
        status = rx_psf_psfex(&par, tile->width, tile->height, log, dst, err);
    if (status == RX_OK) {
        rx_psf_quality *q = &(*dst)->quality;
        (*dst)->nstars = (int)card[0].value;
        q->degree = (int)card[1].value;
        q->beyond = card[2].value;
        q->radius = (*dst)->size / 2;
    }
    free(cards);
    return status;
}

/* Relative error of a star's flux that is measured with `used` where its PSF is `true_psf`: sum(PQ) / sum(PP) - 1 over
 * the pixels of both, at the middle of the tile. */
static rx_status flux_off(const rx_psf *used, const rx_psf *true_psf, const rx_psf_origin *tile, double *off,
                          rx_error *err)
{
    const int n = used->size, m = true_psf->size, half = (n < m ? n : m) / 2;
    float *p = RX_NEW(float, (size_t)n *(size_t)n), *q = RX_NEW(float, (size_t)m *(size_t)m);
    double pq = 0.0, pp = 0.0;
    if (p == NULL || q == NULL) {
        free(p);
        free(q);
        return rx_error_memory(err, 0);
    }
    rx_psf_at(used, 0.5 * (tile->width - 1), 0.5 * (tile->height - 1), p);
    rx_psf_at(true_psf, 0.5 * (tile->width - 1), 0.5 * (tile->height - 1), q);
    for (int j = -half; j <= half; j++)
        for (int i = -half; i <= half; i++) {
            const double a = (double)p[(n / 2 + j) * n + n / 2 + i];
            pp += a * a;
            pq += a * (double)q[(m / 2 + j) * m + m / 2 + i];
        }
    *off = pq / pp - 1.0;
    free(p);
    free(q);
    return RX_OK;
}

rx_status rx_psf_library_find(const rx_psf_library *library, const rx_psf_origin *tile, rx_log *log,
                              rx_record *read, rx_psf **dst, rx_error *err)
{
    entry list[NEIGHBOURS + 2];
    rx_psf *psf = NULL;
    int n = 0, compared = 0, first = 0;
    double fluxes = 0.0, widths = 0.0;
    *dst = NULL;
    rx_status status = look_through(library, tile, log, list, &n, err);
    for (int i = 0; i < n && read != NULL; i++)
        rx_record_add(read, "PSF_LIBRARY", "", "%s", list[i].path);
    for (int i = 0; i < n && status == RX_OK; i++) {
        rx_psf *other = NULL;
        rx_error why = rx_error_part(err);
        double off = 0.0;
        status = read_model(&list[i], tile, log, &other, &why);
        if (status == RX_INPUT || status == RX_USAGE) {
            rx_log_warning(log, "%s: left out of PSF_LIBRARY: %s", list[i].path, why.text);
            status = RX_OK;
            continue;
        }
        if (status != RX_OK) {
            rx_error_take(err, &why);
        } else if (psf == NULL) {
            psf = other;
            first = i;
            continue;
        } else {
            status = flux_off(psf, other, tile, &off, err);
            fluxes += off * off;
            widths += pow(other->fwhm - psf->fwhm, 2.0);
            compared++;
        }
        rx_psf_free(other);
    }
    if (status == RX_OK && psf != NULL) {
        rx_psf_quality *q = &psf->quality;
        snprintf(q->how, sizeof q->how, "LIBRARY");
        snprintf(q->library, sizeof q->library, "%.159s", rx_psf_base_name(list[first].path));
        q->library_days = list[first].days;
        q->library_degrees = list[first].degrees;
        q->library_compared = compared;
        q->flux_error = hypot(q->flux_error, compared > 0 ? sqrt(fluxes / compared) : ASSUMED);
        psf->fwhm_error = compared > 0 ? sqrt(widths / compared) : ASSUMED * psf->fwhm;
        static const char *const unstated[] = {"", "CCD", "filter", "CCD and filter"};
        const int lacks = (tile->ccd[0] == '\0') + 2 * (tile->filter[0] == '\0');
        if (lacks > 0)
            rx_log_warning(
                log,
                "%s: neither its header nor the tile's states the %s; it may be of another: state it there",
                list[first].path, unstated[lacks]);
        snprintf(psf->description, sizeof psf->description,
                 "of PSF_LIBRARY: %.50s, FWHM %.3f +- %.3f px, ellipticity %.3f, degree %d%s%s%s", q->library,
                 psf->fwhm, psf->fwhm_error, psf->ellipticity, q->degree, lacks > 0 ? ", " : "",
                 unstated[lacks], lacks > 0 ? " not stated" : "");
        *dst = psf;
        psf = NULL;
    }
    for (int i = 0; i < n; i++)
        free(list[i].path);
    rx_psf_free(psf);
    return status;
}
