/* Reading templates: folders, lists, files, and GalSim's RealGalaxy layout. */
#include "simulate/templates.h"

#include <dirent.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "base/interrupt.h"
#include "base/memory.h"
#include "base/text.h"
#include "data/table.h"
#include "io/fits_read.h"
#include "io/tile.h"
#include "psf/psf.h"
#include "psf/psf_files.h"

#define PIXEL_FWHM2 0.46209812037 /* 8 ln 2 / 12: a pixel as a Gaussian of its variance */

enum { MOST_LIST_BYTES = 1 << 24, NAME = 1024, MOST_PSF = 129 };

/* What is read, and what is known of it. */
typedef struct reading {
    rx_templates *all;
    double pixel_scale, min_snr;
    rx_log *log;
    int faint, empty;
} reading;

/* --- names --- */

/* Length of a path without its FITS extension, 0 when it has none. */
static size_t stem_length(const char *path)
{
    static const char *const ends[] = {".fits", ".fit", ".fits.gz", ".fit.gz", ".fits.fz"};
    const size_t n = strlen(path);
    for (size_t i = 0; i < sizeof ends / sizeof *ends; i++) {
        const size_t m = strlen(ends[i]);
        if (n >= m && strcmp(path + n - m, ends[i]) == 0)
            return n - m;
    }
    return 0;
}

static int is_file(const char *path)
{
    struct stat about;
    return stat(path, &about) == 0 && S_ISREG(about.st_mode);
}

/* a_b_c.fits -> a_b_c_psf.fits, a_b_psf.fits or a_psf.fits, the first that there is; 0: none. */
static int psf_of(const char *path, char *dst)
{
    size_t length = stem_length(path), start = (size_t)(rx_psf_base_name(path) - path);
    while (length > start && length < NAME - 16) {
        snprintf(dst, NAME, "%.*s_psf.fits", (int)length, path);
        if (is_file(dst))
            return 1;
        do
            length--;
        while (length > start && path[length] != '_');
    }
    return 0;
}

/* No fault of a file that was only tried. */
static int is_ours(rx_status status)
{
    return status == RX_SYSTEM || status == RX_INTERRUPTED;
}

/* --- one template --- */

/* The square around the brightest pixel, as large as the image and MOST_PSF allow. */
static rx_status cut_psf(const float *pixels, int width, int height, float **dst, int *size, rx_error *err)
{
    const size_t n = (size_t)width * (size_t)height;
    size_t best = 0;
    for (size_t i = 0; i < n; i++)
        if (pixels[i] > pixels[best] || !isfinite(pixels[best]))
            best = i;
    int x = (int)(best % (size_t)width), y = (int)(best / (size_t)width), half = MOST_PSF / 2;
    int sides[4] = {x, y, width - 1 - x, height - 1 - y};
    for (int i = 0; i < 4; i++)
        half = sides[i] < half ? sides[i] : half;
    *size = 2 * half + 1;
    RX_TRY(RX_MAKE(*dst, (size_t)*size * (size_t)*size, err));
    for (int i = 0; i < *size * *size; i++) {
        float value = pixels[(size_t)(y - half + i / *size) * (size_t)width + (size_t)(x - half + i % *size)];
        (*dst)[i] = isfinite(value) ? value : 0.0f;
    }
    return RX_OK;
}

/* FWHM in pixels, their own width included, of a PSF image; 0 when there is none that a profile fits. */
static rx_status psf_fwhm(const char *name, rx_log *log, double *dst, rx_error *err)
{
    float *pixels = NULL, *stamp = NULL;
    int width = 0, height = 0, size = 0;
    double fwhm = 0.0, ellipticity;
    rx_error error = rx_error_part(err);
    rx_status status;
    RX_TRY_EXIT(rx_fits_read_image(name, &pixels, &width, &height, &error));
    RX_TRY_EXIT(cut_psf(pixels, width, height, &stamp, &size, &error));
    status = rx_psf_shape(stamp, size, &fwhm, &ellipticity, NULL, &error);
exit:
    free(stamp);
    free(pixels);
    *dst = status == RX_OK && fwhm > 0.0 ? sqrt(fwhm * fwhm + PIXEL_FWHM2) : 0.0;
    if (is_ours(status))
        return rx_error_take(err, &error);
    if (status != RX_OK)
        rx_log_warning(log, "%s: no width can be measured on this PSF of a template; it counts as unknown",
                       name);
    return RX_OK;
}

/* *source joins the list, or is freed when there is nothing in it or too little; after an error it is still the caller's. */
static rx_status keep(reading *to, rx_template *source, rx_error *err)
{
    if (source->pixels == NULL || !(source->snr >= to->min_snr)) {
        to->empty += source->pixels == NULL;
        to->faint += source->pixels != NULL;
        free(source->pixels);
        return RX_OK;
    }
    RX_TRY(RX_GROW(to->all->list, (size_t)to->all->n + 1, err));
    to->all->list[to->all->n++] = *source;
    return RX_OK;
}

/* sky: NAN = measured; scale: arcsec, 0 = from the header, else from the key; psf: "" none. */
static rx_status add_image(reading *to, const char *path, int hdu, double sky, double scale, const char *psf,
                           rx_error *err)
{
    const rx_tile_params par = {.weight_threshold = NAN, .saturation = HUGE_VAL, .pixel_scale = scale};
    rx_tile *tile = NULL;
    rx_template source = {0};
    RX_TRY(rx_interrupt_check(err));
    RX_TRY(rx_tile_read(&par, path, hdu, 1, NULL, &tile, err));
    source.pixel_scale = tile->pixel_scale > 0.0 ? tile->pixel_scale : to->pixel_scale;
    snprintf(source.name, sizeof source.name, "%.64s[%d]", rx_psf_base_name(path), hdu);
    rx_status status;
    RX_TRY_EXIT(rx_template_isolate(tile->pixels, tile->mask, tile->width, tile->height, sky, &source, err));
    if (source.pixels != NULL && psf[0] != '\0' && source.snr >= to->min_snr)
        RX_TRY_EXIT(psf_fwhm(psf, to->log, &source.fwhm, err));
    source.fwhm *= source.pixel_scale;
    status = keep(to, &source, err);
exit:
    if (status != RX_OK)
        free(source.pixels);
    rx_tile_free(tile);
    return status;
}

/* Every image of a plain file. */
static rx_status add_file(reading *to, const char *path, rx_error *err)
{
    char psf[NAME] = "";
    int *hdus = NULL, n = 0;
    rx_status status = rx_tile_list(path, NULL, &hdus, &n, err);
    if (status == RX_OK && !psf_of(path, psf))
        psf[0] = '\0';
    for (int i = 0; status == RX_OK && i < n; i++)
        status = add_image(to, path, hdus[i], NAN, 0.0, psf, err);
    free(hdus);
    return status;
}

/* --- GalSim's RealGalaxy --- */

/* The catalogue in `path`, NULL when it is not one. */
static rx_status open_catalogue(const char *path, rx_table **dst, rx_error *err)
{
    rx_table *table = NULL;
    rx_error error = rx_error_part(err);
    rx_status status = rx_fits_read_table(path, 0, &table, &error);
    *dst = NULL;
    if (status != RX_OK)
        return is_ours(status) ? rx_error_take(err, &error) : RX_OK;
    int file = rx_table_find(table, "GAL_FILENAME"), hdu = rx_table_find(table, "GAL_HDU");
    if (file >= 0 && hdu >= 0 && table->columns[file].type == RX_CELL_TEXT &&
        table->columns[hdu].type != RX_CELL_TEXT)
        *dst = table;
    else
        rx_table_free(table);
    return RX_OK;
}

static double number_in(const rx_table *table, const char *name, long row, double otherwise)
{
    int column = rx_table_find(table, name);
    double value = column >= 0 ? rx_column_value(&table->columns[column], row, 0) : NAN;
    return isfinite(value) ? value : otherwise;
}

/* File of that column beside the catalogue; "" when there is none. */
static void file_in(const rx_table *table, const char *name, long row, const char *catalogue, char *dst)
{
    int column = rx_table_find(table, name), folder = (int)(rx_psf_base_name(catalogue) - catalogue);
    dst[0] = '\0';
    if (column < 0 || table->columns[column].type != RX_CELL_TEXT)
        return;
    const char *cell = (const char *)table->columns[column].data + row * table->columns[column].text_width;
    int length = (int)strnlen(cell, (size_t)table->columns[column].text_width);
    while (length > 0 && cell[length - 1] == ' ')
        length--;
    if (length > 0 && folder + length < NAME - 32)
        snprintf(dst, NAME, "%.*s%.*s", folder, catalogue, length, cell);
}

static rx_status add_catalogue(reading *to, const char *path, const rx_table *table, rx_error *err)
{
    for (long row = 0; row < table->nrows; row++) {
        char image[NAME], psf[NAME];
        double hdu = number_in(table, "GAL_HDU", row, -1.0), psf_hdu = number_in(table, "PSF_HDU", row, -1.0);
        file_in(table, "GAL_FILENAME", row, path, image);
        file_in(table, "PSF_FILENAME", row, path, psf);
        if (image[0] == '\0' || !(hdu >= 0.0 && hdu < 1e6))
            return rx_error_at(err, RX_INPUT, path, -1, 0, "row %ld names no image of a galaxy", row + 1);
        if (!is_file(image))
            return rx_error_at(
                err, RX_INPUT, path, -1, 0,
                "row %ld names the image file %s, which is not there; put it beside the catalogue", row + 1,
                rx_psf_base_name(image));
        if (psf[0] != '\0' && psf_hdu >= 0.0 && psf_hdu < 1e6)
            snprintf(psf + strlen(psf), NAME - strlen(psf), "[%d]", (int)psf_hdu);
        else
            psf[0] = '\0';
        RX_TRY(add_image(to, image, (int)hdu, number_in(table, "NOISE_MEAN", row, 0.0),
                         number_in(table, "PIXEL_SCALE", row, 0.0), psf, err));
    }
    return RX_OK;
}

static rx_status add_any(reading *to, const char *path, rx_error *err)
{
    rx_table *table = NULL;
    RX_TRY(open_catalogue(path, &table, err));
    const rx_status status = table != NULL ? add_catalogue(to, path, table, err) : add_file(to, path, err);
    rx_table_free(table);
    return status;
}

/* --- many files --- */

static int visible_fits(const struct dirent *entry)
{
    return entry->d_name[0] != '.' && stem_length(entry->d_name) > 0;
}

static int by_name(const struct dirent **a, const struct dirent **b)
{
    return strcmp((*a)->d_name, (*b)->d_name); /* not alphasort(): that goes by the user's language */
}

/* A catalogue speaks for its whole folder; without one every image counts but PSFs. */
static rx_status add_folder(reading *to, const char *folder, rx_error *err)
{
    struct dirent **entries = NULL;
    char path[NAME];
    int n = scandir(folder, &entries, visible_fits, by_name);
    if (n < 0)
        return rx_error_at(err, RX_INPUT, folder, -1, 0, "this folder of templates cannot be read");
    rx_table *table = NULL;
    rx_status status = RX_OK;
    for (int i = 0; i < n && table == NULL && status == RX_OK; i++) {
        snprintf(path, NAME, "%.700s/%.255s", folder, entries[i]->d_name);
        status = open_catalogue(path, &table, err);
    }
    if (status == RX_OK && table != NULL)
        status = add_catalogue(to, path, table, err);
    for (int i = 0; status == RX_OK && table == NULL && i < n; i++) {
        snprintf(path, NAME, "%.700s/%.255s", folder, entries[i]->d_name);
        const size_t stem = stem_length(path);
        if (stem < 4 || strncmp(path + stem - 4, "_psf", 4) != 0)
            status = add_file(to, path, err);
    }
    rx_table_free(table);
    for (int i = 0; i < n; i++)
        free(entries[i]);
    free(entries);
    return status;
}

static rx_status add_list(reading *to, const char *path, rx_error *err)
{
    char *text = NULL;
    size_t length = 0;
    rx_status status = rx_text_read_file(path, MOST_LIST_BYTES, &text, &length, err);
    for (char *line = text, *next = NULL; status == RX_OK && line != NULL; line = next) {
        next = strchr(line, '\n');
        if (next != NULL)
            *next++ = '\0';
        line += strspn(line, " \t\r");
        line[strcspn(line, "#\r")] = '\0';
        for (size_t n = strlen(line); n > 0 && strchr(" \t", line[n - 1]) != NULL; n--)
            line[n - 1] = '\0';
        if (line[0] != '\0')
            status = add_any(to, line, err);
    }
    free(text);
    return status;
}

rx_status rx_templates_read(const char *name, double pixel_scale, double min_snr, rx_log *log,
                            rx_templates **dst, rx_error *err)
{
    struct stat about;
    reading to = {.pixel_scale = pixel_scale, .min_snr = min_snr, .log = log};
    rx_status status;
    *dst = NULL;
    RX_TRY(RX_MAKE(to.all, 1, err));
    if (name[0] == '@')
        RX_TRY_EXIT(add_list(&to, name + 1, err));
    else if (stat(name, &about) == 0 && S_ISDIR(about.st_mode))
        RX_TRY_EXIT(add_folder(&to, name, err));
    else
        RX_TRY_EXIT(add_any(&to, name, err));
    if (to.all->n == 0)
        RX_TRY_EXIT(
            rx_error_at(err, RX_INPUT, name, -1, 0,
                        "no template is left: %d without an object, %d below S/N %g; lower TEMPLATE_SNR",
                        to.empty, to.faint, min_snr));
    rx_log_info(log, "%s: %d templates; left out: %d below S/N %g, %d without an object", name, to.all->n,
                to.faint, min_snr, to.empty);
    *dst = to.all;
    to.all = NULL;
exit:
    rx_templates_free(to.all);
    return status;
}

void rx_templates_free(rx_templates *templates)
{
    if (templates == NULL)
        return;
    for (int i = 0; i < templates->n; i++)
        free(templates->list[i].pixels);
    free(templates->list);
    free(templates);
}
