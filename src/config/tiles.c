/* Lists of tiles. */
#include "config/tiles.h"

#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/lines.h"
#include "base/memory.h"
#include "base/names.h"
#include "config/config_fields.h"
#include "config/keyword.h"
#include "config/overwrite.h"

/* Errors of a line's words say where it stands. */
static rx_status at_line(const rx_tiles *tiles, long line, rx_status status, rx_error *err)
{
    return status == RX_USAGE ? rx_error_where(err, status, tiles->path, -1, line) : status;
}

/* The words of a line; "." and ".." would lead a name that holds {tile} to another folder. */
static rx_status check_words(const rx_tiles *tiles, const rx_listed_tile *tile, rx_error *err)
{
    const rx_tokens *words = &tile->words;
    if (words->v[0][0] == '-' || tile->name[0] == '\0' || strcmp(tile->name, ".") == 0 ||
        strcmp(tile->name, "..") == 0)
        return rx_error_at(err, RX_USAGE, tiles->path, -1, tile->line,
                           "'%.200s' names no file; give the name of an image first", words->v[0]);
    for (int i = 1; i < words->n; i += 2)
        if (words->v[i][0] != '-' || words->v[i][1] == '\0')
            return rx_error_at(err, RX_USAGE, tiles->path, -1, tile->line,
                               "'%.200s' is no option; give IMAGE [-KEYWORD VALUE]... in each line",
                               words->v[i]);
        else if (strcasecmp(words->v[i], "-PLAN") == 0)
            return rx_error_at(err, RX_USAGE, tiles->path, -1, tile->line,
                               "%.80s is of the whole list, not of one tile; give it on the command line",
                               words->v[i]);
    if (words->n % 2 == 0)
        return rx_error_at(err, RX_USAGE, tiles->path, -1, tile->line,
                           "%.80s has no value; give one after it", words->v[words->n - 1]);
    return RX_OK;
}

static rx_status read_line(rx_tiles *tiles, long number, const char *line, rx_error *err)
{
    rx_tokens words = {0};
    rx_status status = at_line(tiles, number, rx_tokens_words(line, &words, err), err);
    if (status != RX_OK || words.n == 0)
        goto exit;
    RX_TRY_EXIT(RX_GROW(tiles->tile, (size_t)tiles->n + 1, err));
    rx_listed_tile *tile = &tiles->tile[tiles->n++];
    *tile = (rx_listed_tile){.line = number, .words = words};
    words = (rx_tokens){0};
    tile->name = rx_name_stem(tile->words.v[0]);
    status = tile->name == NULL ? rx_error_memory(err, 0) : check_words(tiles, tile, err);
exit:
    rx_tokens_free(&words);
    return status;
}

rx_status rx_tiles_read(const char *path, rx_tiles **dst, rx_error *err)
{
    *dst = NULL;
    rx_tiles *tiles = RX_NEW(rx_tiles, 1);
    if (tiles == NULL || (tiles->path = rx_strdup(path)) == NULL) {
        rx_tiles_free(tiles);
        return rx_error_memory(err, sizeof *tiles);
    }
    rx_lines lines;
    char *line = NULL;
    rx_status status = rx_lines_open(&lines, path, 0, err);
    while (status == RX_OK && (status = rx_lines_next(&lines, &line, err)) == RX_OK && line != NULL)
        status = read_line(tiles, lines.number, line, err);
    rx_lines_close(&lines);
    if (status == RX_OK && tiles->n == 0)
        status = rx_error_at(err, RX_INPUT, path, -1, 0, "lists no tile; give an image per line");
    if (status != RX_OK)
        rx_tiles_free(tiles);
    else
        *dst = tiles;
    return status;
}

void rx_tiles_free(rx_tiles *tiles)
{
    if (tiles == NULL)
        return;
    for (int i = 0; i < tiles->n; i++) {
        free(tiles->tile[i].name);
        rx_tokens_free(&tiles->tile[i].words);
    }
    free(tiles->tile);
    free(tiles->path);
    free(tiles);
}

const char *rx_tiles_image(const rx_tiles *tiles, int i)
{
    return tiles->tile[i].words.v[0];
}

rx_status rx_tiles_settings(const rx_tiles *tiles, int i, const rx_settings *common, rx_log *log,
                            rx_settings **dst, rx_error *err)
{
    const rx_listed_tile *tile = &tiles->tile[i];
    rx_settings *settings = NULL;
    *dst = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_settings_copy(common, &settings, err));
    for (int k = 1; k < tile->words.n; k += 2)
        RX_TRY_EXIT(rx_settings_set(settings, tile->words.v[k] + 1, tile->words.v[k + 1], log, err));
    RX_TRY_EXIT(rx_settings_name_tile(settings, tile->name, err));
    RX_TRY_EXIT(rx_settings_complete(settings, NULL, err));
    RX_TRY_EXIT(rx_overwrite_check(settings, tile->words.v[0], err));
    *dst = settings;
    settings = NULL;
exit:
    rx_settings_free(settings);
    return at_line(tiles, tile->line, status, err);
}

/* What a file is to a tile, in the order in which a conflict names it. */
typedef enum role { THE_LIST, IMAGE, INPUT, OUTPUT } role;

typedef struct place_taken {
    size_t name, real; /* where it is among the names, and its real one */
    const char *at;    /* the real one, once all names are there */
    long line;
    role role;
} place_taken;

/* All names in one piece: small ones between the settings that come and go would leave holes, 8 kB for each
 * tile. */
typedef struct places_taken {
    int n;
    rx_text names;
    place_taken *of;
    long line; /* of the tile whose files are added */
} places_taken;

enum { RECENT = 64 }; /* the files of the last tiles: what many of them read is looked up once */

static rx_status take(places_taken *taken, const char *name, role role, rx_error *err)
{
    place_taken place = {.name = taken->names.length, .line = taken->line, .role = role};
    int same = taken->n - 1;
    while (same >= 0 && strcmp(taken->names.data + taken->of[same].name, name) != 0)
        same = same > taken->n - RECENT ? same - 1 : -1;
    if (same >= 0) {
        place.name = taken->of[same].name;
        place.real = taken->of[same].real;
    } else {
        char *real = rx_name_real(name);
        rx_text_add_bytes(&taken->names, name, strlen(name) + 1);
        place.real = taken->names.length;
        if (real != NULL)
            rx_text_add_bytes(&taken->names, real, strlen(real) + 1);
        taken->names.failed |= real == NULL;
        free(real);
    }
    if (taken->names.failed)
        return rx_error_memory(err, taken->names.length);
    RX_TRY(RX_GROW(taken->of, (size_t)taken->n + 1, err));
    taken->of[taken->n++] = place;
    return RX_OK;
}

static int by_real_name(const void *a, const void *b)
{
    const place_taken *x = a, *y = b;
    const int order = strcmp(x->at, y->at);
    return order != 0           ? order
           : x->role != y->role ? (int)x->role - (int)y->role
                                : (x->line > y->line) - (x->line < y->line);
}

/* `other` is read, or written by an earlier line, under the name that `place` is written to. */
static rx_status refuse(const rx_tiles *tiles, const char *name, const place_taken *place,
                        const place_taken *other, rx_error *err)
{
    if (other->role == THE_LIST)
        return rx_error_at(err, RX_USAGE, tiles->path, -1, place->line,
                           "would write %.200s, this list itself; give the output another name", name);
    return rx_error_at(err, RX_USAGE, tiles->path, -1, place->line,
                       "would write %.200s, %s line %ld; put {tile} into the names of outputs, and name "
                       "tiles differently",
                       name,
                       other->role == OUTPUT  ? "as would"
                       : other->role == IMAGE ? "the tile of"
                                              : "which is read by",
                       other->line);
}

/* Sorted, what is read stands before what is written under the same name. */
static rx_status find_conflict(const rx_tiles *tiles, places_taken *taken, rx_error *err)
{
    int first = 0; /* of those with the same name */
    for (int i = 0; i < taken->n; i++)
        taken->of[i].at = taken->names.data + taken->of[i].real;
    qsort(taken->of, (size_t)taken->n, sizeof *taken->of, by_real_name);
    for (int i = 0; i < taken->n; i++) {
        const place_taken *place = &taken->of[i];
        if (strcmp(taken->of[first].at, place->at) != 0)
            first = i;
        for (int k = first; place->role == OUTPUT && k < i; k++)
            if (taken->of[k].line != place->line)
                return refuse(tiles, taken->names.data + place->name, place, &taken->of[k], err);
    }
    return RX_OK;
}

/* Files of tile i, with its settings checked. */
static rx_status take_tile(const rx_tiles *tiles, int i, const rx_settings *common, places_taken *taken,
                           rx_idle *idle, rx_log *log, rx_error *err)
{
    rx_settings *settings = NULL;
    rx_run_files files = {0};
    rx_status status;
    taken->line = tiles->tile[i].line;
    RX_TRY(rx_tiles_settings(tiles, i, common, log, &settings, err));
    RX_TRY_EXIT(rx_run_files_of(settings, rx_tiles_image(tiles, i), &files, err));
    for (int k = 0; k < files.n; k++)
        RX_TRY_EXIT(take(taken, files.of[k].path,
                         files.of[k].role != RX_FILE_READS       ? OUTPUT
                         : strcmp(files.of[k].key, "IMAGE") == 0 ? IMAGE
                                                                 : INPUT,
                         err));
    if (idle != NULL) {
        rx_idle of_tile = *idle;
        if (strcmp(((const rx_config *)settings)->parameters_name,
                   ((const rx_config *)common)->parameters_name) != 0)
            of_tile.has_column = NULL; /* columns of its own */
        status = rx_idle_add(&of_tile, settings, err);
        of_tile.has_column = idle->has_column;
        *idle = of_tile;
    }
exit:
    rx_run_files_free(&files);
    rx_settings_free(settings);
    return status;
}

rx_status rx_tiles_check(const rx_tiles *tiles, const rx_settings *common, rx_idle *idle, rx_log *log,
                         rx_error *err)
{
    places_taken taken = {0};
    rx_status status = take(&taken, tiles->path, THE_LIST, err);
    for (int i = 0; i < tiles->n && status == RX_OK; i++)
        status = take_tile(tiles, i, common, &taken, idle, log, err);
    if (status == RX_OK)
        status = find_conflict(tiles, &taken, err);
    rx_text_free(&taken.names);
    free(taken.of);
    return status;
}
