/* Targets: FITS files, and catalogues of all kinds. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <zlib.h>

#include "catalog/assoc.h"
#include "catalog/catalog.h"
#include "config/config_fields.h"
#include "fuzz.h"
#include "io/fits_read.h"
#include "io/tile.h"
#include "io/wcs.h"
#include "nn/model.h"
#include "psf/psf.h"
#include "simulate/templates.h"
#include "stage/reference.h"

enum { CARD = 80 };

static const char *file_of(const uint8_t *data, size_t size)
{
    rx_text file = {0};
    fuzz_expand(data, size, &file);
    const char *path = fuzz_file(0, file.data != NULL ? file.data : "", file.length);
    rx_text_free(&file);
    return path;
}

/* The same; what begins with "GZIP\n" is packed, for a mutation of a packed file hardly ever has the right
 * sum at its end. */
static const char *packed_file_of(const uint8_t *data, size_t size)
{
    static const char magic[] = "GZIP\n";
    const size_t n = sizeof magic - 1;
    if (size < n || memcmp(data, magic, n) != 0)
        return file_of(data, size);
    rx_text file = {0};
    fuzz_expand(data + n, size - n, &file);
    const char *path = fuzz_file(0, "", 0);
    gzFile packed = gzopen(path, "wb1");
    fuzz_require(packed != NULL && gzwrite(packed, file.data, (unsigned)file.length) == (int)file.length &&
                     gzclose(packed) == Z_OK,
                 "a file can be packed");
    rx_text_free(&file);
    return path;
}

/* --- catalogues --- */

static void read_catalogue(const char *path)
{
    rx_tile tile = {.name = "tile", .width = 64, .height = 48, .zeropoint = 25};
    const rx_reference_params par = {.name = "reference", .flux_zeropoint = NAN};
    rx_assoc *assoc = NULL;
    for (int index = 0; index < 2; index++) {
        rx_qa_list list = {0};
        rx_table *table = NULL;
        rx_reference_note note = {0};
        if (rx_catalog_read(path, index, &table, NULL) != RX_OK)
            continue;
        if (rx_reference_list(&par, table, &tile, NULL, &list, &note, NULL) == RX_OK)
            rx_qa_list_free(&list);
        rx_text_free(&note.shown);
        fuzz_look(table);
    }
    if (rx_assoc_read(path, &assoc, NULL) == RX_OK)
        rx_assoc_free(assoc);
}

void fuzz_catalog(const uint8_t *data, size_t size)
{
    read_catalogue(fuzz_file(0, data, size));
}

void fuzz_table(const uint8_t *data, size_t size)
{
    const char *path = file_of(data, size);
    char *cards = NULL, name[80];
    long n = 0;
    read_catalogue(path);
    if (rx_fits_read_header(path, 1, &cards, &n, NULL) == RX_OK)
        free(cards);
    rx_table *table = NULL;
    snprintf(name, sizeof name, "%s[1]", path);
    if (rx_catalog_read(name, 0, &table, NULL) == RX_OK)
        fuzz_look(table);
}

/* --- records of runs --- */

/* An error is one line; without one there are settings, which are checked as those of any file. */
void fuzz_repeated(const uint8_t *data, size_t size)
{
    const char *path = file_of(data, size);
    rx_config *config = NULL;
    rx_error err = RX_ERROR_NONE;
    char line[RX_ERROR_WHERE + RX_ERROR_TEXT + 100] = "";
    fuzz_require(rx_config_new(&config, NULL) == RX_OK, "settings can be made");
    if (rx_settings_read(&config->settings, path, NULL, &err) == RX_OK)
        (void)rx_settings_complete(&config->settings, NULL, &err);
    rx_error_format(&err, "rextract", line, sizeof line);
    for (const char *c = line; *c != '\0'; c++)
        fuzz_require((unsigned char)*c >= ' ' && *c != 127, "an error is one line without controls");
    rx_config_free(config);
}

/* --- PSFs and models --- */

static void look_at_psf(rx_psf *psf)
{
    float *stamp = malloc((size_t)psf->size * (size_t)psf->size * sizeof *stamp);
    double sum = 0;
    fuzz_require(stamp != NULL, "there is memory");
    rx_psf_at(psf, 10, 50, stamp);
    for (int i = 0; i < psf->size * psf->size; i++)
        sum += (double)stamp[i];
    fuzz_require(fabs(sum - 1) < 1e-2, "a PSF sums to 1");
    fuzz_require(isfinite(psf->fwhm) && psf->fwhm > 0, "a PSF has a width");
    free(stamp);
    rx_psf_free(psf);
}

void fuzz_psf(const uint8_t *data, size_t size)
{
    const char *path = file_of(data, size);
    rx_psf *psf = NULL;
    for (int cut = 0; cut <= 7; cut += 7)
        for (int extension = 1; extension <= 2; extension++) {
            const rx_psf_params par = {.file = path, .size = cut, .extension = extension};
            if (rx_psf_file(&par, 64, 64, NULL, &psf, NULL) == RX_OK)
                look_at_psf(psf);
            if (cut == 0 && rx_psf_psfex(&par, 64, 64, NULL, &psf, NULL) == RX_OK)
                look_at_psf(psf);
        }
}

void fuzz_model(const uint8_t *data, size_t size)
{
    rx_text file = {0}, words = {0};
    rx_model *model = NULL;
    char outside[200];
    if (rx_model_read(file_of(data, size), &model, NULL) == RX_OK)
        rx_model_free(model);
    fuzz_expand(data, size, &file);
    fuzz_checksums(file.data, file.length);
    if (rx_model_read(fuzz_file(0, file.data != NULL ? file.data : "", file.length), &model, NULL) == RX_OK) {
        rx_model_describe(model, &words);
        rx_model_find(model, 3, 5, outside, sizeof outside);
        rx_model_free(model);
    }
    rx_text_free(&file);
    rx_text_free(&words);
}

/* --- tiles --- */

static void look_at_tile(rx_tile *tile)
{
    volatile unsigned long sum = 0;
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    for (size_t i = 0; i < n; i++) {
        fuzz_require(isfinite(tile->pixels[i]), "all pixels of a tile are finite");
        sum = sum + tile->mask[i];
        fuzz_require(tile->weight == NULL || isfinite(tile->weight[i]), "all weights of a tile are finite");
    }
    rx_tile_checksum(tile);
    if (tile->wcs != NULL) {
        const double x[2] = {0, 1.5}, y[2] = {3, -1};
        double alpha[2], delta[2], back[4], matrix[4];
        rx_wcs_to_sky(tile->wcs, 2, x, y, alpha, delta);
        rx_wcs_to_pixel(tile->wcs, 2, alpha, delta, back, back + 2);
        rx_wcs_matrix(tile->wcs, 1, 1, matrix);
    }
    rx_tile_free(tile);
}

void fuzz_tile(const uint8_t *data, size_t size)
{
    const char *path = packed_file_of(data, size);
    const rx_tile_params par = {.weight_threshold = NAN,
                                .gain_key = "GAIN",
                                .saturation = 50000,
                                .saturation_key = "SATURATE",
                                .zeropoint = 25,
                                .zeropoint_key = "MAGZERO"};
    int *hdus = NULL, n = 0;
    char part[80];
    rx_tile *tile = NULL;
    if (rx_tile_list(path, NULL, &hdus, &n, NULL) == RX_OK) {
        for (int i = 0; i < n && i < 3; i++)
            if (rx_tile_read(&par, path, hdus[i], i + 1, NULL, &tile, NULL) == RX_OK)
                look_at_tile(tile);
        snprintf(part, sizeof part, "%s[%d][2:4,2:*]", path, hdus[0]);
        if (rx_tile_read(&par, part, hdus[0], 1, NULL, &tile, NULL) == RX_OK)
            look_at_tile(tile);
    }
    free(hdus);
}

/* A tile of 5 x 4 pixels, and the bytes as its weights and flags. */
void fuzz_maps(const uint8_t *data, size_t size)
{
    static const char plain[] = "FITS\nSIMPLE  =                    T\nBITPIX  =                    8\n"
                                "NAXIS   =                    2\nNAXIS1  =                    5\n"
                                "NAXIS2  =                    4\nEND\nabcdefghijklmnopqrst";
    static const rx_weight_type types[] = {RX_WEIGHT_MAP_RMS, RX_WEIGHT_MAP_VAR, RX_WEIGHT_MAP_WEIGHT};
    rx_text file = {0};
    const char *map = file_of(data, size);
    fuzz_expand((const uint8_t *)plain, sizeof plain - 1, &file);
    const char *path = fuzz_file(1, file.data, file.length);
    for (int i = 0; i < 4; i++) {
        rx_tile *tile = NULL;
        rx_tile_params par = {.weight_threshold = NAN, .saturation = 50000, .zeropoint = 25};
        if (i < 3)
            par.weight_name = map, par.weight_type = types[i];
        else
            par.nflags = 1, par.flag_names[0] = map;
        if (rx_tile_read(&par, path, 0, 1, NULL, &tile, NULL) == RX_OK)
            look_at_tile(tile);
    }
    rx_text_free(&file);
}

void fuzz_wcs(const uint8_t *data, size_t size)
{
    rx_text cards = {0};
    rx_wcs *wcs = NULL;
    char word[80];
    rx_wcs_notes notes = {0};
    double linear[6], matrix[4], alpha[3], delta[3], x[3] = {0, 31, 1e6}, y[3] = {0, 20, -1e6};
    for (const uint8_t *at = data, *end = data + size; at < end;) {
        char card[CARD];
        const uint8_t *stop = memchr(at, '\n', (size_t)(end - at));
        const size_t n = (size_t)((stop != NULL ? stop : end) - at);
        memset(card, ' ', CARD);
        memcpy(card, at, n < CARD ? n : CARD);
        rx_text_add_bytes(&cards, card, CARD);
        at += n + (stop != NULL);
    }
    const size_t n = cards.length / CARD;
    if (n == 0)
        return;
    rx_cards_text(cards.data, (long)n, "CTYPE1", word, sizeof word);
    rx_wcs_linear(cards.data, n, linear);
    if (rx_wcs_from_cards(cards.data, n, 64, 48, &wcs, &notes, NULL) == RX_OK && wcs != NULL) {
        rx_wcs_to_sky(wcs, 3, x, y, alpha, delta);
        rx_wcs_to_pixel(wcs, 3, alpha, delta, x, y);
        rx_wcs_matrix(wcs, 10, 10, matrix);
        rx_wcs_pixel_scale(wcs, 10, 10);
        rx_wcs_free(wcs);
    }
    rx_wcs_notes_free(&notes);
    rx_text_free(&cards);
}

void fuzz_templates(const uint8_t *data, size_t size)
{
    rx_templates *templates = NULL;
    if (rx_templates_read(file_of(data, size), 0.03, 5, NULL, &templates, NULL) != RX_OK)
        return;
    for (int i = 0; i < templates->n; i++)
        fuzz_require(isfinite(rx_template_blur(&templates->list[i])), "the blur of a template is finite");
    rx_templates_free(templates);
}
