/* Records of tiles as text, and back. */
#include "survey/tile_record.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/lines.h"
#include "base/memory.h"
#include "base/text.h"
#include "config/tokens.h"

static const char blanks[] = " \t\r\v\f";

/* --- the lines, whose items are fields of a struct, once for both ways --- */

/* COUNT: an INT; FLAG: one that is not written, and 1 where the line is. EXACT: 15 digits. NAME goes into reports and names
 * of files: letters, digits and '_'. OWNED: a char *. TALLY: 1 where there is one. */
typedef enum kind { NONE, INT, COUNT, FLAG, LONG, REAL, EXACT, TEXT, NAME, OWNED, TALLY } kind;

typedef struct item {
    kind kind;
    size_t offset, size;
    long low, high;
} item;

/* In the order in which they are written, those of a tile, of an image, of a run. */
typedef enum line_name {
    TILE,
    VERSION,
    STATUS,
    EXTENSION,
    STATE,
    CARD,
    PAGE,
    PSF,
    STARS,
    RHO,
    RUN,
    TOOK,
    DONE,
    OUTSIDE,
    FLUX,
    GUARD,
    SHARES,
    NLINES
} line_name;

/* It is written where its first item is something: a FLAG, COUNT or LONG above 0, a TEXT or NAME; where that is a REAL, where
 * one of them is finite. */
typedef struct line {
    const char *word;
    item items[14]; /* ends with NONE */
} line;

/* clang-format off */
#define FIELD(kind, type, field, low, high) {kind, offsetof(type, field), sizeof((type *)NULL)->field, low, high}
#define OF_T(kind, field, ...) FIELD(kind, rx_tile_record, field, __VA_ARGS__)
#define OF_E(kind, field, ...) FIELD(kind, rx_extension_facts, field, __VA_ARGS__)
#define OF_R(kind, field, ...) FIELD(kind, rx_run_facts, field, __VA_ARGS__)
#define E_REAL(field) OF_E(REAL, field, 0, 0)
#define R_REAL(field) OF_R(REAL, field, 0, 0)
static const line lines[NLINES] = {
    [TILE] = {"TILE", {OF_T(OWNED, image, 0, 0), OF_T(OWNED, name, 0, 0)}},
    [VERSION] = {"VERSION", {OF_T(OWNED, version, 0, 0)}},
    [STATUS] = {"STATUS", {OF_T(INT, status, 0, 255), OF_T(OWNED, what, 0, 0)}},
    [EXTENSION] = {"EXTENSION", {OF_E(INT, hdu, 0, 1 << 30), OF_E(INT, width, 0, 1 << 30), OF_E(INT, height, 0, 1 << 30),
                                 E_REAL(alpha), E_REAL(delta), E_REAL(fwhm), E_REAL(sky), E_REAL(noise),
                                 OF_E(INT, verdict, RX_VERDICT_NONE, RX_VERDICT_INSUFFICIENT)}},
    [STATE] = {"STATE", {OF_E(FLAG, known, 0, 0), E_REAL(state.ellipticity), E_REAL(state.depth), E_REAL(state.factor),
                         E_REAL(state.masked), E_REAL(state.saturated),
                         OF_E(INT, state.wrong, -1, INT_MAX), OF_E(INT, state.look, -1, INT_MAX)}},
    [CARD] = {"CARD", {FIELD(TEXT, rx_tile_card, name, 0, 0), FIELD(EXACT, rx_tile_card, value, 0, 0)}},
    [PAGE] = {"PAGE", {OF_E(TEXT, page, 0, 0)}},
    [PSF] = {"PSF", {OF_E(NAME, psf.how, 0, 0), OF_E(INT, psf.stars, 0, INT_MAX), OF_E(INT, psf.reserved, 0, INT_MAX),
                     E_REAL(psf.flux_error), E_REAL(psf.growth), E_REAL(psf.residual), E_REAL(psf.off[0]), E_REAL(psf.off[1]),
                     E_REAL(psf.off[2]), E_REAL(psf.error[0]), E_REAL(psf.error[1]), E_REAL(psf.error[2])}},
    [STARS] = {"STARS", {OF_E(LONG, psf.rho.n, 1, INT_MAX), OF_E(LONG, psf.rho.t, -(1L << 40), 1L << 40),
                         OF_E(LONG, psf.rho.e1, -(1L << 40), 1L << 40), OF_E(LONG, psf.rho.e2, -(1L << 40), 1L << 40),
                         E_REAL(psf.rho.reach)}},
    [RHO] = {"RHO", {OF_E(LONG, psf.rho.pairs, 1, 1L << 60), OF_E(LONG, psf.rho.tt, -(1L << 60), 1L << 60),
                     OF_E(LONG, psf.rho.ee, -(1L << 60), 1L << 60)}}, /* behind the number of the bin */
    [RUN] = {"RUN", {OF_R(NAME, name, 0, 0), OF_R(LONG, sources, 0, 1L << 40), OF_R(TALLY, tally, 0, 1)}},
    [TOOK] = {"TOOK", {OF_R(NAME, taken, 0, 0), OF_R(TEXT, why, 0, 0)}},
    [DONE] = {"DONE", {OF_R(NAME, by, 0, 0), OF_R(TEXT, why, 0, 0)}},
    [OUTSIDE] = {"OUTSIDE", {OF_R(TEXT, outside, 0, 0)}},
    [FLUX] = {"FLUX", {OF_R(COUNT, flux.n, 1, INT_MAX), R_REAL(flux.diameter), R_REAL(flux.wide), R_REAL(flux.wide_error),
                       R_REAL(flux.automatic), R_REAL(flux.automatic_error)}},
    [GUARD] = {"GUARD", {OF_R(FLAG, guard.known, 0, 0), R_REAL(guard.false_per_mpixel), R_REAL(guard.raised),
                         R_REAL(guard.unexplained)}},
    [SHARES] = {"SHARES", {R_REAL(sharp)}},
};
/* clang-format on */

/* --- to text --- */

/* In quotes; what would end them or the line is written as %XX. */
static void add_string(rx_text *dst, const char *string)
{
    rx_text_add(dst, " \"");
    for (const unsigned char *c = (const unsigned char *)string; *c != '\0'; c++)
        if (*c < 0x20 || *c == 0x7f || *c == '"' || *c == '%')
            rx_text_printf(dst, "%%%02X", *c);
        else
            rx_text_add_bytes(dst, (const char *)c, 1);
    rx_text_add(dst, "\"");
}

static void add_item(rx_text *dst, const item *i, const void *base)
{
    const void *field = (const char *)base + i->offset;
    if (i->kind == INT || i->kind == COUNT)
        rx_text_printf(dst, " %d", *(const int *)field);
    else if (i->kind == LONG)
        rx_text_printf(dst, " %ld", *(const long *)field);
    else if (i->kind == TALLY)
        rx_text_printf(dst, " %d", *(rx_tally *const *)field != NULL);
    else if (i->kind == OWNED)
        add_string(dst, *(char *const *)field);
    else if (i->kind == TEXT || i->kind == NAME)
        add_string(dst, field);
    else if (i->kind != FLAG)
        rx_text_printf(dst, i->kind == REAL ? " %.9g" : " %.15g", *(const double *)field);
}

static bool is_there(const item *i, const void *base)
{
    const void *field = (const char *)base + i->offset;
    bool known = false;
    if (i->kind == FLAG || i->kind == COUNT)
        return *(const int *)field > 0;
    if (i->kind == LONG)
        return *(const long *)field > 0;
    if (i->kind == TEXT || i->kind == NAME)
        return *(const char *)field != '\0';
    for (const item *real = i; real->kind == REAL; real++)
        known |= isfinite(*(const double *)(const void *)((const char *)base + real->offset));
    return known || i->kind != REAL;
}

/* The line, where it is there; k: number that comes first, -1: none. */
static void add_line(rx_text *dst, line_name name, int k, const void *base)
{
    const line *l = &lines[name];
    if (!is_there(l->items, base))
        return;
    rx_text_add(dst, l->word);
    if (k >= 0)
        rx_text_printf(dst, " %d", k);
    for (const item *i = l->items; i->kind != NONE; i++)
        add_item(dst, i, base);
    rx_text_add(dst, "\n");
}

static void add_lines(rx_text *dst, line_name first, line_name last, const void *base)
{
    for (int name = first; name <= (int)last; name++)
        add_line(dst, (line_name)name, -1, base);
}

static void add_bin(rx_text *dst, int k, const rx_tally_bin *bin)
{
    if (bin->references == 0 && bin->detections == 0 && bin->dmag == NULL)
        return;
    rx_text_printf(dst, "BIN %d %ld %ld %ld %ld", k, bin->references, bin->found, bin->detections,
                   bin->right);
    for (int s = 0; bin->dmag != NULL && s < RX_TALLY_STEPS; s++)
        if (bin->dmag[s] > 0)
            rx_text_printf(dst, " %d:%" PRIu32, s, bin->dmag[s]);
    rx_text_add(dst, "\n");
}

static void add_run(rx_text *dst, const rx_run_facts *run)
{
    add_lines(dst, RUN, SHARES, run);
    for (int k = 0; k < run->facts.n; k++) {
        rx_text_printf(dst, "FACT %s", run->facts.pairs[k][0]);
        add_string(dst, run->facts.pairs[k][1]);
        rx_text_add(dst, "\n");
    }
    for (int b = 0; run->tally != NULL && b < RX_TALLY_BINS; b++)
        add_bin(dst, b, &run->tally->bin[b]);
}

void rx_tile_record_print(rx_text *dst, const rx_tile_record *record)
{
    add_lines(dst, TILE, STATUS, record);
    for (int k = 0; k < record->facts.n; k++) {
        const rx_extension_facts *e = &record->facts.extension[k];
        add_lines(dst, EXTENSION, STATE, e);
        for (int i = 0; i < e->ncards; i++)
            add_line(dst, CARD, -1, &e->card[i]);
        add_lines(dst, PAGE, STARS, e);
        for (int b = 0; b < RX_RHO_BINS; b++)
            add_line(dst, RHO, b, (const long *)(const void *)e + b);
        for (int i = 0; i < e->nruns; i++)
            add_run(dst, &e->run[i]);
    }
    rx_text_add(dst, "END\n");
}

/* --- from text --- */

typedef struct reader {
    rx_lines lines;
    rx_tokens words; /* of the line */
    rx_tile_record record;
    int64_t at;            /* where it begins */
    bool open;             /* TILE was read, END was not */
    rx_extension_facts *e; /* the last one; NULL: none yet */
    rx_run_facts *run;     /* its last one */
    rx_error *err;
} reader;

static rx_status refuse(const reader *r, const char *why)
{
    return rx_error_at(r->err, RX_INPUT, r->lines.path, -1, r->lines.number,
                       "%s; is it the record of a tile, whole?", why);
}

static rx_status whole(const reader *r, const char *text, char **end, long low, long high, long *dst)
{
    errno = 0;
    *dst = strtol(text, end, 10);
    return *end != text && errno == 0 && *dst >= low && *dst <= high ? RX_OK
                                                                     : refuse(r, "a number is out of place");
}

static rx_status take_whole(const reader *r, const char *word, long low, long high, long *dst)
{
    char *end = NULL;
    RX_TRY(whole(r, word, &end, low, high, dst));
    return *end == '\0' ? RX_OK : refuse(r, "a number is out of place");
}

/* A text is cut where it is longer than its field. */
static rx_status take_item(const reader *r, const item *i, char *word, void *field)
{
    char *end;
    long value = 0;
    if (!rx_printable_read(word))
        return refuse(r, "a % has no two digits");
    const size_t letters = strspn(word, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_");
    switch (i->kind) {
    case REAL:
    case EXACT:
        *(double *)field = strtod(word, &end);
        return *end == '\0' && end != word ? RX_OK : refuse(r, "a number is missing");
    case INT:
    case COUNT:
        RX_TRY(take_whole(r, word, i->low, i->high, &value));
        *(int *)field = (int)value;
        return RX_OK;
    case LONG:
        return take_whole(r, word, i->low, i->high, field);
    case TALLY:
        RX_TRY(take_whole(r, word, i->low, i->high, &value));
        return value ? RX_MAKE(*(rx_tally **)field, 1, r->err) : RX_OK;
    case OWNED:
        free(*(char **)field);
        return (*(char **)field = rx_strdup(word)) != NULL ? RX_OK : rx_error_memory(r->err, 0);
    default:
        if (i->kind == NAME && (letters == 0 || word[letters] != '\0' || letters >= i->size))
            return refuse(r, "a restorer or a PSF has no name");
        snprintf(field, i->size, "%s", word);
        return RX_OK;
    }
}

/* Words from `first` on into the struct at `base`. */
static rx_status take_items(const reader *r, line_name name, int first, void *base)
{
    for (const item *i = lines[name].items; i->kind != NONE; i++) {
        void *field = (char *)base + i->offset;
        if (i->kind == FLAG)
            *(int *)field = 1;
        else if (first < r->words.n)
            RX_TRY(take_item(r, i, r->words.v[first++], field));
        else
            return refuse(r, i->kind == TEXT || i->kind == NAME || i->kind == OWNED ? "a word is missing"
                                                                                    : "a number is missing");
    }
    return RX_OK;
}

static void forget_record(rx_tile_record *record)
{
    free(record->image);
    free(record->name);
    free(record->version);
    free(record->what);
    rx_tile_facts_free(&record->facts);
    *record = (rx_tile_record){.status = -1};
}

static rx_status begin_record(reader *r)
{
    if (r->open)
        return refuse(r, "the record before has no END");
    forget_record(&r->record);
    r->open = true;
    r->at = r->lines.at;
    r->e = NULL;
    r->run = NULL;
    return take_items(r, TILE, 1, &r->record);
}

static rx_status begin_extension(reader *r)
{
    static const rx_tile_state unknown = {NAN, NAN, NAN, NAN, NAN, -1, -1};
    rx_tile_facts *facts = &r->record.facts;
    RX_TRY(RX_GROW(facts->extension, (size_t)facts->n + 1, r->err));
    r->e = &facts->extension[facts->n++];
    r->run = NULL;
    *r->e = (rx_extension_facts){.state = unknown};
    RX_TRY(take_items(r, EXTENSION, 1, r->e));
    r->e->psf.rho.alpha = r->e->alpha;
    r->e->psf.rho.delta = r->e->delta;
    return RX_OK;
}

/* A line may come where what it belongs to has begun. */
static rx_status read_fields(reader *r, line_name name)
{
    char why[40];
    long k = 0;
    if (name == TILE)
        return begin_record(r);
    if (name <= STATUS && (name == VERSION ? r->record.version : r->record.what) != NULL)
        return refuse(r, "this line is there twice");
    if (name <= STATUS)
        return take_items(r, name, 1, &r->record);
    if (name == EXTENSION)
        return begin_extension(r);
    snprintf(why, sizeof why, "%s is out of place", lines[name].word);
    if (name > RUN ? r->run == NULL
                   : r->e == NULL || (name == CARD && r->e->ncards == RX_RECORD_CARDS) ||
                         (name == RUN && r->e->nruns == RX_MAX_RUNS))
        return refuse(r, why);
    if ((name == PSF && r->e->psf.how[0] != '\0') || (name == STARS && r->e->psf.how[0] == '\0') ||
        (name == RHO && r->e->psf.rho.n == 0))
        return refuse(r, why);
    if (name == CARD)
        return take_items(r, name, 1, &r->e->card[r->e->ncards++]);
    if (name == RUN) {
        RX_TRY(RX_GROW(r->e->run, (size_t)r->e->nruns + 1, r->err));
        r->run = &r->e->run[r->e->nruns++];
        *r->run = (rx_run_facts){.sharp = NAN};
    }
    if (name == RHO) {
        if (r->words.n < 2)
            return refuse(r, "a number is missing");
        RX_TRY(take_whole(r, r->words.v[1], 0, RX_RHO_BINS - 1, &k));
        return take_items(r, name, 2, (long *)(void *)r->e + k);
    }
    return take_items(r, name, 1, name < RUN ? (void *)r->e : r->run);
}

/* Most of a record are these lines; a survey has millions, so they are not cut into words first. */
static rx_status read_bin(reader *r, char *text)
{
    const long most = 1L << 40;
    long k, step, count;
    if (r->run == NULL || r->run->tally == NULL)
        return refuse(r, "a bin is out of place");
    RX_TRY(whole(r, text, &text, 0, RX_TALLY_BINS - 1, &k));
    rx_tally_bin *bin = &r->run->tally->bin[k];
    long *const counts[] = {&bin->references, &bin->found, &bin->detections, &bin->right};
    for (int i = 0; i < 4; i++)
        RX_TRY(whole(r, text, &text, 0, most, counts[i]));
    for (text += strspn(text, blanks); *text != '\0'; text += strspn(text, blanks)) {
        if (bin->dmag == NULL)
            RX_TRY(RX_MAKE(bin->dmag, RX_TALLY_STEPS, r->err));
        RX_TRY(whole(r, text, &text, 0, RX_TALLY_STEPS - 1, &step));
        if (*text != ':')
            return refuse(r, "a count is out of place");
        RX_TRY(whole(r, text + 1, &text, 1, UINT32_MAX, &count));
        bin->dmag[step] = (uint32_t)count;
    }
    return RX_OK;
}

static rx_status read_words(reader *r)
{
    const char *word = r->words.v[0];
    int name = 0;
    while (name < NLINES && strcmp(word, lines[name].word) != 0)
        name++;
    if (name != TILE && !r->open)
        return refuse(r, "TILE does not come first");
    if (name < NLINES)
        return read_fields(r, (line_name)name);
    if (strcmp(word, "END") == 0) {
        r->open = false;
        return r->record.version != NULL && r->record.what != NULL
                   ? RX_OK
                   : refuse(r, "VERSION or STATUS is missing");
    }
    if (strcmp(word, "FACT") != 0)
        return refuse(r, "this is no line of a record");
    if (r->run == NULL || r->words.n < 3 || !rx_printable_read(r->words.v[2]))
        return refuse(r, "FACT is out of place");
    rx_record_add(&r->run->facts, r->words.v[1], "", "%s", r->words.v[2]);
    return r->run->facts.failed ? rx_error_memory(r->err, 0) : RX_OK;
}

static rx_status read_line(reader *r, char *line)
{
    line += strspn(line, blanks);
    if (r->open && strncmp(line, "BIN", 3) == 0 && (line[3] == ' ' || line[3] == '\t'))
        return read_bin(r, line + 4);
    rx_status status = rx_tokens_words(line, &r->words, r->err);
    if (status == RX_USAGE)
        status = refuse(r, "a quote is not closed");
    if (status == RX_OK && r->words.n > 0)
        status = read_words(r);
    rx_tokens_free(&r->words);
    return status;
}

rx_status rx_tile_record_read(const char *path, int64_t from, long most, rx_tile_record_visitor visit,
                              void *user, rx_error *err)
{
    reader r = {.err = err};
    char *line = NULL;
    rx_status status = rx_lines_open(&r.lines, path, from, err);
    for (long n = 0; status == RX_OK && (most == 0 || n < most);) {
        const bool open = r.open;
        status = rx_lines_next(&r.lines, &line, err);
        if (status != RX_OK || line == NULL)
            break;
        status = read_line(&r, line);
        if (status == RX_OK && open && !r.open) {
            status = visit(user, &r.record, r.at, err);
            n++;
        }
    }
    if (status == RX_OK && r.open)
        status = refuse(&r, "the last record has no END");
    rx_lines_close(&r.lines);
    forget_record(&r.record);
    return status;
}
