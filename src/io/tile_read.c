/* Reading tiles: pixels, mask, header, and the numbers that header and keywords give. */
#include "io/tile.h"

#include <ctype.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/hash.h"
#include "base/memory.h"
#include "base/simd.h"
#include "base/text.h"
#include "data/unit.h"
#include "io/cards.h"
#include "io/fits_file.h"
#include "io/header_numbers.h"
#include "io/tile_maps.h"
#include "io/wcs.h"

/* --- numbers from header or keyword --- */

static void take_numbers(const rx_tile_params *par, const rx_header *header, rx_tile *tile)
{
    const char *const gain_key = par->gain_key != NULL ? par->gain_key : "";
    const rx_header_number gain = {"GAIN", gain_key, "GAIN", "e-/ADU", par->gain};
    const rx_header_number saturation = {"SATUR_LEVEL", par->saturation_key, "SATURATE", "ADU",
                                         par->saturation};
    const rx_header_number zeropoint = {"MAG_ZEROPOINT", par->zeropoint_key, "", "mag", par->zeropoint};
    const rx_header_number exptime = {"EXPTIME", "EXPTIME", "EXPTIME", "s", 0};
    bool gain_found;
    tile->gain = rx_header_number_or(header, &gain, &gain_found);
    if (tile->gain < 0) {
        rx_log_warning(header->log, "%s[%d]: %s = %g is no gain; taken as infinite (0)", header->name,
                       header->hdu, gain_found ? gain_key : "GAIN", tile->gain);
        tile->gain = 0;
    }
    if (gain_found)
        snprintf(tile->gain_card, sizeof tile->gain_card, "%s", gain_key);
    tile->saturation = rx_header_number_or(header, &saturation, NULL);
    if (!(tile->saturation > 0) || isinf(tile->saturation))
        tile->saturation = HUGE_VAL;
    tile->zeropoint = rx_header_number_or(header, &zeropoint, NULL);
    tile->exptime = rx_header_number_or(header, &exptime, NULL);
    if (tile->exptime < 0)
        tile->exptime = 0;
    rx_header_hints(header, tile, gain_key, gain_found);
}

/* --- pixels --- */

/* Every masked pixel counts as NaN, for its value must not reach any output. */
RX_SIMD static void hide_masked(const float *pixels, const uint8_t *mask, int n, uint32_t *dst)
{
    memcpy(dst, pixels, (size_t)n * sizeof *dst);
#pragma omp simd
    for (int i = 0; i < n; i++)
        dst[i] = mask[i] == 0 ? dst[i] : UINT32_C(0x7fc00000);
}

const char *rx_tile_checksum(rx_tile *tile)
{
    enum { PIECE = 1024 }; /* pixels */
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    uint32_t room[PIECE];
    char text[RX_HASH_TEXT];
    rx_hash sum;
    if (tile->checksum[0] != '\0')
        return tile->checksum;
    rx_hash_begin(&sum);
    for (size_t k = 0; k < n; k += PIECE) {
        const int count = n - k < PIECE ? (int)(n - k) : PIECE;
        hide_masked(tile->pixels + k, tile->mask + k, count, room);
        rx_hash_add(&sum, room, (size_t)count * sizeof *room);
    }
    rx_hash_text(&sum, text);
    snprintf(tile->checksum, sizeof tile->checksum, "%.16s", text);
    return tile->checksum;
}

/* No pixel is bad or saturated, as in nearly all rows. */
RX_SIMD static bool all_good(const float *pixels, size_t n, double saturation, float limit)
{
    int bad = 0;
#pragma omp simd reduction(| : bad)
    for (size_t i = 0; i < n; i++)
        bad |= !((double)pixels[i] < saturation) | !rx_pixel_usable(pixels[i], limit);
    return bad == 0;
}

/* Number of bad pixels in row y, which become 0 unless they are lent, and of those among them that hold a number; most of
 * the mask is never touched. */
static size_t mask_row(rx_tile *tile, int y, float limit, size_t *beyond)
{
    const size_t width = (size_t)tile->width;
    float *pixels = tile->pixels + (size_t)y * width;
    uint8_t *mask = tile->mask + (size_t)y * width;
    size_t bad = 0;
    *beyond = 0;
    if (all_good(pixels, width, tile->saturation, limit))
        return 0;
    for (size_t i = 0; i < width; i++) {
        if (!rx_pixel_usable(pixels[i], limit)) {
            *beyond += !isnan(pixels[i]);
            if (!tile->lent)
                pixels[i] = 0.f;
            mask[i] = RX_MASK_BAD;
            bad++;
        } else if (pixels[i] >= tile->saturation) {
            mask[i] = RX_MASK_SATURATED;
        }
    }
    return bad;
}

static rx_status mask_pixels(rx_tile *tile, int nthreads, rx_log *log, size_t *bad, rx_error *err)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    const float limit = rx_pixel_limit(tile->pixels, tile->width, tile->height);
    size_t found = 0, beyond = 0;
#pragma omp parallel for schedule(static) num_threads(nthreads > 0 ? nthreads : 1) reduction(+ : found, beyond)
    for (int y = 0; y < tile->height; y++) {
        size_t in_row;
        found += mask_row(tile, y, limit, &in_row);
        beyond += in_row;
    }
    *bad = found;
    if (found == n)
        return rx_error_at(err, RX_INPUT, tile->name, tile->hdu, 0,
                           "all %zu pixels are NaN, BLANK or beyond 1e20; there is nothing to measure", n);
    if (beyond > 0)
        rx_log_warning(
            log,
            "%s[%d]: %zu pixels hold values beyond %.3g, which no detector has: they are left out, as NaN is",
            tile->name, tile->hdu, beyond, (double)limit);
    return RX_OK;
}

/* --- header --- */

/* Cards whose keywords the standard does not allow, which no output could hold, are left out. */
static void drop_illegal(rx_text *cards, const char *name, int hdu, rx_log *log)
{
    enum { SHOWN = 60 };
    rx_text illegal = {0};
    size_t kept = 0;
    bool dropping = false; /* CONTINUE follows what its first card did */
    for (size_t i = 0; i < cards->length / RX_CARD; i++) {
        const char *card = cards->data + i * RX_CARD;
        const size_t n = strspn(card, "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_");
        if (strncmp(card, "CONTINUE", RX_CARD_KEY) != 0) {
            dropping = n < RX_CARD_KEY && n + strspn(card + n, " ") < RX_CARD_KEY;
            if (dropping)
                rx_text_printf(&illegal, "%s'%.*s'", illegal.length > 0 ? ", " : "", RX_CARD_KEY, card);
        }
        if (!dropping)
            memmove(cards->data + RX_CARD * kept++, card, RX_CARD);
    }
    cards->length = kept * RX_CARD;
    if (illegal.length > 0)
        rx_log_warning(log,
                       "%s[%d]: header cards with keywords that FITS does not allow are left out: %.*s%s",
                       name, hdu, SHOWN, illegal.data, illegal.length > SHOWN ? "..." : "");
    rx_text_free(&illegal);
}

typedef struct keyword {
    char text[RX_CARD + 1];
} keyword;

/* "" without one. */
static keyword keyword_of(const char *card)
{
    keyword key = {""};
    memcpy(key.text, card, RX_CARD_KEY);
    key.text[strcspn(key.text, " ")] = '\0';
    if (strcmp(key.text, "HIERARCH") == 0) {
        const char *equals = memchr(card, '=', RX_CARD);
        size_t n = equals != NULL && equals > card + 9 ? (size_t)(equals - card) - 9 : 0;
        memcpy(key.text, card + 9, n);
        while (n > 0 && key.text[n - 1] == ' ')
            n--;
        key.text[n] = '\0';
    }
    return key;
}

static int compare_keywords(const void *a, const void *b)
{
    return strcasecmp(((const keyword *)a)->text, ((const keyword *)b)->text);
}

/* Append those cards of `parent` (a primary header) that `cards` lacks: what INHERIT = T asks for. */
static void inherit_cards(rx_text *cards, const char *parent, size_t nparent)
{
    const size_t ncards = cards->length / RX_CARD;
    keyword *own = RX_NEW(keyword, ncards + 1); /* sorted: a header may have 1e5 cards */
    size_t nown = 0;
    bool skipped = false; /* CONTINUE follows what its first card did */
    if (own == NULL) {
        cards->failed = true;
        return;
    }
    for (size_t i = 0; i < ncards; i++) {
        own[nown] = keyword_of(cards->data + i * RX_CARD);
        nown += rx_cards_find(cards->data + i * RX_CARD, 1, own[nown].text) >= 0;
    }
    qsort(own, nown, sizeof *own, compare_keywords);
    for (size_t i = 0; i < nparent && !cards->failed; i++) {
        const char *card = parent + i * RX_CARD;
        const keyword key = keyword_of(card);
        if (strcmp(key.text, "CONTINUE") != 0)
            skipped = !rx_card_is_useful(card) || key.text[0] == '\0' || strcmp(key.text, "COMMENT") == 0 ||
                      strcmp(key.text, "HISTORY") == 0 ||
                      bsearch(&key, own, nown, sizeof *own, compare_keywords) != NULL;
        if (!skipped)
            rx_text_add_bytes(cards, card, RX_CARD);
    }
    free(own);
}

/* Put a new number into the card, its comment kept. */
static void replace_number(char *card, const char *key, double value, int integer)
{
    char comment[RX_CARD + 1];
    rx_text text = {0};
    (void)rx_cards_comment(card, 1, key, comment, sizeof comment);
    if (integer)
        rx_card_integer(&text, key, (long)value, comment);
    else
        rx_card_number(&text, key, value, comment);
    if (!text.failed)
        memcpy(card, text.data, RX_CARD);
    rx_text_free(&text);
}

/* Header of an image after a section of it was cut out: CRPIXj (all versions) and LTVj move
 * by the section's first pixel (from 1), NAXISj become its size. In place. */
static void cut_cards(char *cards, size_t ncards, const long first[2], const long size[2])
{
    for (size_t i = 0; i < ncards; i++) {
        char *card = cards + i * RX_CARD, key[RX_CARD_KEY + 1];
        double value;
        memcpy(key, card, RX_CARD_KEY);
        key[RX_CARD_KEY] = '\0';
        key[strcspn(key, " ")] = '\0';
        int axis = -1;
        if (strncmp(key, "CRPIX", 5) == 0 && (key[6] == '\0' || isupper((unsigned char)key[6])))
            axis = key[5] - '1';
        else if (strncmp(key, "LTV", 3) == 0 && key[4] == '\0')
            axis = key[3] - '1';
        else if (strncmp(key, "NAXIS", 5) == 0 && key[5] != '\0' && key[6] == '\0' && key[5] >= '1' &&
                 key[5] <= '2')
            replace_number(card, key, (double)size[key[5] - '1'], 1);
        else if (strncmp(key, "CNPIX", 5) == 0 && key[6] == '\0' && (key[5] == '1' || key[5] == '2') &&
                 rx_cards_number(card, 1, key, &value)) /* DSS plates: corner on the plate */
            replace_number(card, key, value + (double)(first[key[5] - '1'] - 1), 1);
        if ((axis == 0 || axis == 1) && rx_cards_quantity(card, 1, key, "pix", &value))
            replace_number(card, key, value - (double)(first[axis] - 1), 0);
    }
}

/* Those of the HDU where it is. */
static rx_status add_cards(const rx_fits_source *source, rx_text *dst, rx_error *err)
{
    char *block;
    size_t n;
    RX_TRY(rx_fits_read_cards(source, &block, &n, err));
    rx_text_add_bytes(dst, block, n * RX_CARD);
    free(block);
    return RX_OK;
}

/* Cards of the HDU, those of the primary header it inherits, and the section's coordinates. */
static rx_status read_header(rx_fits_source *source, const rx_tile_place *place, rx_log *log, rx_text *cards,
                             rx_text *parent, rx_error *err)
{
    char inherit[8] = "";
    RX_TRY(add_cards(source, cards, err));
    if (place->hdu > 0) {
        RX_TRY(rx_fits_goto(source, 0, err));
        RX_TRY(add_cards(source, parent, err));
        RX_TRY(rx_fits_goto(source, place->hdu, err));
    }
    rx_cards_text(cards->data, (long)(cards->length / 80), "INHERIT", inherit, sizeof inherit);
    if (inherit[0] == 'T' && parent->data != NULL)
        inherit_cards(cards, parent->data, parent->length / 80);
    drop_illegal(cards, place->name->path, place->hdu, log);
    if (cards->failed || parent->failed)
        return rx_error_memory(err, cards->length + parent->length);
    if (place->name->has_section) {
        long size[2] = {place->part.last[0] - place->part.first[0] + 1,
                        place->part.last[1] - place->part.first[1] + 1};
        cut_cards(cards->data, cards->length / 80, place->part.first, size);
    }
    return RX_OK;
}

static rx_status take_wcs(const rx_tile_params *par, rx_log *log, rx_tile *tile, rx_error *err)
{
    rx_wcs_notes notes = {0};
    tile->wcs_free = rx_wcs_free;
    rx_status status =
        rx_wcs_from_cards(tile->cards, tile->ncards, tile->width, tile->height, &tile->wcs, &notes, err);
    if (status == RX_OK && notes.warnings.length > 0)
        rx_log_warning(log, "%s[%d]: %s", tile->name, tile->hdu, notes.warnings.data);
    if (status == RX_OK && notes.details.length > 0)
        rx_log_detail(log, "%s[%d]: %s", tile->name, tile->hdu, notes.details.data);
    const bool half_read = notes.why.length > 0;
    rx_wcs_notes_free(&notes);
    if (status != RX_OK)
        return status;
    if (tile->wcs == NULL && !half_read)
        tile->linear_wcs = rx_wcs_linear(tile->cards, tile->ncards, tile->linear);
    if (par->pixel_scale > 0)
        tile->pixel_scale = par->pixel_scale;
    else if (tile->wcs != NULL)
        tile->pixel_scale = rx_wcs_pixel_scale(tile->wcs, (tile->width - 1) / 2., (tile->height - 1) / 2.);
    if (!isfinite(tile->pixel_scale))
        tile->pixel_scale = 0;
    return RX_OK;
}

/* --- all of it --- */

/* Go to the HDU, check it and say which part of it is wanted. */
static rx_status find_place(rx_fits_source *source, rx_tile_place *place, rx_error *err)
{
    const rx_fits_name *name = place->name;
    const LONGLONG *axes = place->shape.axes;
    RX_TRY(rx_fits_goto(source, place->hdu, err));
    RX_TRY(rx_fits_shape_of(source, &place->shape, err));
    RX_TRY(rx_image_check(name->path, place->hdu, &place->shape, &name->section, err));
    RX_TRY(rx_fits_check_size(source, &place->shape, err));
    place->part = rx_fits_part(name, &place->shape);
    if (place->part.last[0] > axes[0] || place->part.last[1] > axes[1])
        return rx_error_at(err, RX_INPUT, name->path, place->hdu, 0,
                           "the section ends at %ld,%ld, outside of the image of %lld x %lld pixels",
                           place->part.last[0], place->part.last[1], axes[0], axes[1]);
    return RX_OK;
}

static rx_status name_tile(const rx_tile_place *place, const rx_text *cards, rx_tile *tile, rx_error *err)
{
    char extname[72] = "";
    rx_cards_text(cards->data, (long)(cards->length / 80), "EXTNAME", extname, sizeof extname);
    if (strcmp(extname, "COMPRESSED_IMAGE") == 0)
        extname[0] = '\0';
    tile->hdu = place->hdu;
    tile->extension = place->extension;
    tile->width = (int)(place->part.last[0] - place->part.first[0] + 1);
    tile->height = (int)(place->part.last[1] - place->part.first[1] + 1);
    tile->name = rx_strdup(place->name->path);
    tile->extname = rx_strdup(extname);
    return tile->name != NULL && tile->extname != NULL ? RX_OK : rx_error_memory(err, sizeof *tile);
}

rx_status rx_tile_read(const rx_tile_params *par, const char *name, int hdu, int extension, rx_log *log,
                       rx_tile **dst, rx_error *err)
{
    rx_fits_name parsed;
    rx_fits_source source = {0};
    rx_text cards = {0}, parent = {0};
    rx_tile_place place = {.name = &parsed, .hdu = hdu, .extension = extension};
    size_t bad;
    *dst = NULL;
    rx_tile *tile = RX_NEW(rx_tile, 1);
    rx_status status;
    RX_TRY_EXIT(tile != NULL ? rx_fits_name_parse(name, &parsed, err) : rx_error_memory(err, sizeof *tile));
    RX_TRY_EXIT(rx_fits_open(parsed.path, &source, err));
    RX_TRY_EXIT(find_place(&source, &place, err));
    RX_TRY_EXIT(read_header(&source, &place, log, &cards, &parent, err));
    RX_TRY_EXIT(name_tile(&place, &cards, tile, err));
    take_numbers(par, &(rx_header){&cards, &parent, tile->name, hdu, log}, tile);
    tile->ncards = cards.length / 80;
    tile->cards = cards.data;
    cards = (rx_text){0};
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    tile->pixels = rx_alloc_filled(n, sizeof *tile->pixels, par->nthreads);
    tile->mask = RX_NEW(uint8_t, n);
    if (tile->pixels == NULL || tile->mask == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * sizeof(float)));
    RX_TRY_EXIT(rx_fits_read_pixels(&source, &place.part, tile->pixels, err));
    RX_TRY_EXIT(mask_pixels(tile, par->nthreads, log, &bad, err));
    RX_TRY_EXIT(take_wcs(par, log, tile, err));
    RX_TRY_EXIT(rx_tile_add_maps(par, &place, log, tile, err));
    *dst = tile;
    tile = NULL;
exit:
    rx_fits_done(&source);
    rx_text_free(&cards);
    rx_text_free(&parent);
    rx_tile_free(tile);
    return status;
}

/* --- from arrays --- */

/* The caller's pixels as they are, or where some are bad a copy without these; and the caller's mask. */
static rx_status lend_pixels(const rx_tile_arrays *arrays, int nthreads, rx_log *log, rx_tile *tile,
                             rx_error *err)
{
    const size_t n = (size_t)tile->width * (size_t)tile->height;
    size_t bad;
    tile->lent = true;
    tile->pixels = (float *)arrays->pixels;
    RX_TRY(RX_MAKE(tile->mask, n, err));
    RX_TRY(mask_pixels(tile, nthreads, log, &bad, err));
    if (bad > 0) {
        float *copy = rx_alloc_filled(n, sizeof *copy, nthreads);
        if (copy == NULL)
            return rx_error_memory(err, n * sizeof *copy);
        for (size_t i = 0; i < n; i++)
            copy[i] = tile->mask[i] & RX_MASK_BAD ? 0.f : arrays->pixels[i];
        tile->pixels = copy;
        tile->lent = false;
    }
    bad = 0;
    for (size_t i = 0; i < n; i++) {
        if (arrays->mask != NULL && arrays->mask[i] != 0)
            tile->mask[i] |= RX_MASK_BAD;
        bad += (tile->mask[i] & RX_MASK_BAD) != 0;
    }
    return bad < n
               ? RX_OK
               : rx_error_at(err, RX_INPUT, tile->name, -1, 0,
                             "all %zu pixels are NaN, masked or beyond 1e20; there is nothing to measure", n);
}

rx_status rx_tile_lend(const rx_tile_params *par, const rx_tile_arrays *arrays, rx_log *log, rx_tile **dst,
                       rx_error *err)
{
    const char *name = arrays->name != NULL ? arrays->name : "image";
    rx_text cards = {0};
    *dst = NULL;
    if (arrays->pixels == NULL || arrays->width < 1 || arrays->height < 1 || arrays->width > INT_MAX / 4 ||
        arrays->height > INT_MAX / 4)
        return rx_error_at(err, RX_USAGE, name, -1, 0, "has %d x %d pixels; give an image", arrays->width,
                           arrays->height);
    rx_tile *tile;
    RX_TRY(RX_MAKE(tile, 1, err));
    tile->name = rx_strdup(name);
    tile->extname = rx_strdup("");
    tile->extension = 1;
    tile->width = arrays->width;
    tile->height = arrays->height;
    rx_status status = RX_OK;
    if (arrays->ncards > 0) {
        rx_text_add_bytes(&cards, arrays->cards, arrays->ncards * 80);
        drop_illegal(&cards, name, 0, log);
    }
    if (tile->name == NULL || tile->extname == NULL || cards.failed)
        RX_TRY_EXIT(rx_error_memory(err, cards.length));
    take_numbers(par, &(rx_header){&cards, &(rx_text){0}, tile->name, tile->hdu, log}, tile);
    tile->ncards = cards.length / 80;
    tile->cards = cards.data;
    cards = (rx_text){0};
    RX_TRY_EXIT(lend_pixels(arrays, par->nthreads, log, tile, err));
    RX_TRY_EXIT(take_wcs(par, log, tile, err));
    RX_TRY_EXIT(rx_tile_take_weight(par, arrays->weight, tile, err));
    *dst = tile;
    tile = NULL;
exit:
    rx_text_free(&cards);
    rx_tile_free(tile);
    return status;
}

/* --- headers alone --- */

static rx_status shape_of(rx_fits_source *source, const rx_fits_name *name, int hdu, const rx_image_list *all,
                          rx_tile_shape *dst, rx_error *err)
{
    rx_text cards = {0}, parent = {0};
    int mask, variance;
    rx_tile_place place = {.name = name, .hdu = hdu, .extension = 1};
    rx_status status = find_place(source, &place, err);
    if (status == RX_OK)
        status = read_header(source, &place, NULL, &cards, &parent, err);
    rx_images_own_maps(all, hdu, &mask, &variance);
    if (status == RX_OK)
        *dst = (rx_tile_shape){.hdu = hdu,
                               .width = (int)(place.part.last[0] - place.part.first[0] + 1),
                               .height = (int)(place.part.last[1] - place.part.first[1] + 1),
                               .compressed = place.shape.is_compressed,
                               .own_maps = mask >= 0,
                               .ncards = cards.length / 80,
                               .held = rx_fits_held(source)};
    rx_text_free(&cards);
    rx_text_free(&parent);
    return status;
}

rx_status rx_tile_shapes(const char *name, rx_log *log, rx_tile_shape **dst, int *n, rx_error *err)
{
    rx_fits_name parsed;
    rx_fits_source source = {0};
    rx_image_list all = {0};
    rx_tile_shape *shapes = NULL;
    int *hdus = NULL;
    *dst = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_tile_list(name, log, &hdus, n, err));
    RX_TRY_EXIT(rx_fits_name_parse(name, &parsed, err));
    RX_TRY_EXIT(rx_images_of_file(&parsed, NULL, &all, err));
    RX_TRY_EXIT(rx_fits_open(parsed.path, &source, err));
    RX_TRY_EXIT(RX_MAKE(shapes, (size_t)*n, err));
    for (int i = 0; i < *n; i++)
        RX_TRY_EXIT(shape_of(&source, &parsed, hdus[i], &all, &shapes[i], err));
    *dst = shapes;
    shapes = NULL;
exit:
    rx_fits_done(&source);
    free(all.list);
    free(hdus);
    free(shapes);
    return status;
}
