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
#include "config/tokens.h"

static const char blanks[] = " \t\r\v\f";

/* --- the lines that hold fields of a struct, once for both ways --- */

/* NAME goes into reports and names of files: letters, digits and '_'. EXACT: 15 digits. */
typedef enum kind { NONE, INT, LONG, REAL, EXACT, TEXT, NAME } kind;

typedef struct item {
    kind kind;
    size_t offset, size;
    long low, high;
} item;

typedef enum line_name {
    EXTENSION,
    STATE,
    ANOMALIES,
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

typedef struct line {
    const char *word;
    item items[14]; /* ends with NONE */
} line;

#define FIELD(kind, type, field, low, high)                                                                  \
    {                                                                                                        \
        kind, offsetof(type, field), sizeof((type *)NULL)->field, low, high                                  \
    }
#define OF_E(kind, field, ...) FIELD(kind, rx_extension_facts, field, __VA_ARGS__)
#define OF_R(kind, field, ...) FIELD(kind, rx_run_facts, field, __VA_ARGS__)
#define E_REAL(field) OF_E(REAL, field, 0, 0)
#define R_REAL(field) OF_R(REAL, field, 0, 0)
/* clang-format off */
static const line lines[NLINES] = {
    [EXTENSION] = {"EXTENSION", {OF_E(INT, hdu, 0, 1 << 30), OF_E(INT, width, 0, 1 << 30), OF_E(INT, height, 0, 1 << 30),
                                 E_REAL(alpha), E_REAL(delta), E_REAL(fwhm), E_REAL(sky), E_REAL(noise),
                                 OF_E(INT, verdict, RX_VERDICT_NONE, RX_VERDICT_INSUFFICIENT)}},
    [STATE] = {"STATE", {E_REAL(state.ellipticity), E_REAL(state.depth), E_REAL(state.factor), E_REAL(state.masked),
                         E_REAL(state.saturated), E_REAL(state.chi2), OF_E(INT, state.wrong, -1, INT_MAX),
                         OF_E(INT, state.look, -1, INT_MAX)}},
    [ANOMALIES] = {"ANOMALIES", {E_REAL(state.rows), E_REAL(state.columns), E_REAL(state.light)}},
    [CARD] = {"CARD", {FIELD(TEXT, rx_tile_card, name, 0, 0), FIELD(EXACT, rx_tile_card, value, 0, 0)}},
    [PAGE] = {"PAGE", {OF_E(TEXT, page, 0, 0)}},
    [PSF] = {"PSF", {OF_E(NAME, psf.how, 0, 0), OF_E(INT, psf.stars, 0, INT_MAX),
                     OF_E(INT, psf.reserved, 0, INT_MAX), E_REAL(psf.flux_error), E_REAL(psf.growth), E_REAL(psf.residual),
                     E_REAL(psf.off[0]), E_REAL(psf.off[1]), E_REAL(psf.off[2]), E_REAL(psf.error[0]),
                     E_REAL(psf.error[1]), E_REAL(psf.error[2])}},
    [STARS] = {"STARS", {OF_E(LONG, psf.rho.n, 1, INT_MAX), OF_E(LONG, psf.rho.t, -(1L << 40), 1L << 40),
                         OF_E(LONG, psf.rho.e1, -(1L << 40), 1L << 40), OF_E(LONG, psf.rho.e2, -(1L << 40), 1L << 40),
                         E_REAL(psf.rho.reach)}},
    [RHO] = {"RHO", {OF_E(LONG, psf.rho.pairs, 1, 1L << 60), OF_E(LONG, psf.rho.tt, -(1L << 60), 1L << 60),
                     OF_E(LONG, psf.rho.ee, -(1L << 60), 1L << 60)}}, /* behind the number of the bin */
    [RUN] = {"RUN", {OF_R(NAME, name, 0, 0), OF_R(LONG, sources, 0, 1L << 40)}}, /* and whether there are bins */
    [TOOK] = {"TOOK", {OF_R(NAME, taken, 0, 0), OF_R(TEXT, why, 0, 0)}},
    [DONE] = {"DONE", {OF_R(NAME, by, 0, 0), OF_R(TEXT, why, 0, 0)}},
    [OUTSIDE] = {"OUTSIDE", {OF_R(TEXT, outside, 0, 0)}},
    [FLUX] = {"FLUX", {OF_R(INT, flux.n, 1, INT_MAX), R_REAL(flux.diameter), R_REAL(flux.wide), R_REAL(flux.wide_error),
                       R_REAL(flux.automatic), R_REAL(flux.automatic_error)}},
    [GUARD] = {"GUARD", {R_REAL(guard.false_per_mpixel), R_REAL(guard.raised), R_REAL(guard.unexplained)}},
    [SHARES] = {"SHARES", {R_REAL(sharp), R_REAL(lit)}},
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

/* The items of a line, from the struct at `base`. */
static void add_items(rx_text *dst, line_name name, const void *base)
{
    for (const item *i = lines[name].items; i->kind != NONE; i++) {
        const void *field = (const char *)base + i->offset;
        if (i->kind == INT)
            rx_text_printf(dst, " %d", *(const int *)field);
        else if (i->kind == LONG)
            rx_text_printf(dst, " %ld", *(const long *)field);
        else if (i->kind == TEXT || i->kind == NAME)
            add_string(dst, field);
        else
            rx_text_printf(dst, i->kind == REAL ? " %.9g" : " %.15g", *(const double *)field);
    }
}

static void add_line(rx_text *dst, line_name name, const void *base)
{
    rx_text_add(dst, lines[name].word);
    add_items(dst, name, base);
    rx_text_add(dst, "\n");
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
    rx_text_add(dst, lines[RUN].word);
    add_items(dst, RUN, run);
    rx_text_printf(dst, " %d\n", run->tally != NULL);
    const struct {
        line_name name;
        bool is_there;
    } of[] = {{TOOK, run->taken[0] != '\0'}, {DONE, run->by[0] != '\0'}, {OUTSIDE, run->outside[0] != '\0'},
              {FLUX, run->flux.n > 0},       {GUARD, run->guard.known},  {SHARES, isfinite(run->lit)}};
    for (size_t i = 0; i < sizeof of / sizeof *of; i++)
        if (of[i].is_there)
            add_line(dst, of[i].name, run);
    for (int k = 0; k < run->facts.n; k++) {
        rx_text_printf(dst, "FACT %s", run->facts.pairs[k][0]);
        add_string(dst, run->facts.pairs[k][1]);
        rx_text_add(dst, "\n");
    }
    for (int b = 0; run->tally != NULL && b < RX_TALLY_BINS; b++)
        add_bin(dst, b, &run->tally->bin[b]);
}

static void add_extension(rx_text *dst, const rx_extension_facts *e)
{
    const rx_tile_state *s = &e->state;
    const bool measured = e->psf.how[0] != '\0';
    add_line(dst, EXTENSION, e);
    if (e->known)
        add_line(dst, STATE, e);
    if (e->known && (isfinite(s->rows) || isfinite(s->columns) || isfinite(s->light)))
        add_line(dst, ANOMALIES, e);
    for (int i = 0; i < e->ncards; i++)
        add_line(dst, CARD, &e->card[i]);
    if (e->page[0] != '\0')
        add_line(dst, PAGE, e);
    if (measured)
        add_line(dst, PSF, e);
    if (measured && e->psf.rho.n > 0)
        add_line(dst, STARS, e);
    for (int k = 0; k < RX_RHO_BINS && measured; k++) {
        if (e->psf.rho.pairs[k] == 0)
            continue;
        rx_text_printf(dst, "%s %d", lines[RHO].word, k);
        add_items(dst, RHO, (const long *)(const void *)e + k);
        rx_text_add(dst, "\n");
    }
    for (int i = 0; i < e->nruns; i++)
        add_run(dst, &e->run[i]);
}

void rx_tile_record_print(rx_text *dst, const rx_tile_record *record)
{
    rx_text_add(dst, "TILE");
    add_string(dst, record->image);
    add_string(dst, record->name);
    rx_text_add(dst, "\nVERSION");
    add_string(dst, record->version);
    rx_text_printf(dst, "\nSTATUS %d", record->status);
    add_string(dst, record->what);
    rx_text_add(dst, "\n");
    for (int i = 0; i < record->facts.n; i++)
        add_extension(dst, &record->facts.extension[i]);
    rx_text_add(dst, "END\n");
}

struct rx_record_reader {
    rx_lines lines;
    rx_tokens words; /* of the line */
    rx_tile_record record;
    int64_t at; /* where it begins */
    bool open;  /* TILE was read, END was not */
    rx_extension_facts *extension;
    rx_run_facts *run;
    rx_error *err;
};
typedef struct rx_record_reader reader;

static rx_status refuse(const reader *r, const char *why)
{
    return rx_error_at(r->err, RX_INPUT, r->lines.path, -1, r->lines.number,
                       "%s; is it the record of a tile, whole?", why);
}

static int hex(char c)
{
    return c >= '0' && c <= '9' ? c - '0' : c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

/* A string's own copy, %XX resolved. */
static rx_status take_string(const reader *r, int word, char **dst)
{
    if (word >= r->words.n)
        return refuse(r, "a word is missing");
    char *to = *dst = rx_strdup(r->words.v[word]);
    if (to == NULL)
        return rx_error_memory(r->err, 0);
    for (const char *from = to; *from != '\0';)
        if (*from == '%' && hex(from[1]) >= 0 && hex(from[2]) >= 0) {
            *to++ = (char)(16 * hex(from[1]) + hex(from[2]));
            from += 3;
        } else {
            *to++ = *from++;
        }
    *to = '\0';
    return RX_OK;
}

static rx_status take_real(const reader *r, int word, double *dst)
{
    char *end = NULL;
    *dst = word < r->words.n ? strtod(r->words.v[word], &end) : NAN;
    return end != NULL && *end == '\0' && end != r->words.v[word] ? RX_OK : refuse(r, "a number is missing");
}

static rx_status whole(const reader *r, const char *text, char **end, long low, long high, long *dst)
{
    errno = 0;
    *dst = strtol(text, end, 10);
    return *end != text && errno == 0 && *dst >= low && *dst <= high ? RX_OK
                                                                     : refuse(r, "a number is out of place");
}

static rx_status take_whole(const reader *r, int word, long low, long high, long *dst)
{
    char *end = NULL;
    if (word >= r->words.n)
        return refuse(r, "a number is missing");
    rx_status status = whole(r, r->words.v[word], &end, low, high, dst);
    return status == RX_OK && *end != '\0' ? refuse(r, "a number is out of place") : status;
}

/* Of a restorer or a PSF. */
static bool is_name(const char *name, size_t size)
{
    const size_t n = strspn(name, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_");
    return n > 0 && name[n] == '\0' && n < size;
}

/* A text is cut where it is longer than its field. */
static rx_status take_item(const reader *r, int word, const item *i, void *field)
{
    char *text = NULL;
    long value = 0;
    if (i->kind == REAL || i->kind == EXACT)
        return take_real(r, word, field);
    if (i->kind == INT || i->kind == LONG) {
        RX_TRY(take_whole(r, word, i->low, i->high, &value));
        if (i->kind == INT)
            *(int *)field = (int)value;
        else
            *(long *)field = value;
        return RX_OK;
    }
    RX_TRY(take_string(r, word, &text));
    const bool wrong = i->kind == NAME && !is_name(text, i->size);
    if (!wrong)
        snprintf(field, i->size, "%s", text);
    free(text);
    return wrong ? refuse(r, "a restorer or a PSF has no name") : RX_OK;
}

/* Words from `first` on into the struct at `base`. */
static rx_status take_items(const reader *r, line_name name, int first, void *base)
{
    for (const item *i = lines[name].items; i->kind != NONE; i++)
        RX_TRY(take_item(r, first++, i, (char *)base + i->offset));
    return RX_OK;
}

static rx_status begin_extension(reader *r)
{
    rx_tile_facts *facts = &r->record.facts;
    RX_TRY(RX_GROW(facts->extension, (size_t)facts->n + 1, r->err));
    r->extension = &facts->extension[facts->n++];
    r->run = NULL;
    *r->extension = (rx_extension_facts){.state = {.rows = NAN, .columns = NAN, .light = NAN}};
    return take_items(r, EXTENSION, 1, r->extension);
}

static rx_status begin_run(reader *r)
{
    long reference;
    r->run = &r->extension->run[r->extension->nruns++];
    *r->run = (rx_run_facts){.sharp = NAN, .lit = NAN};
    RX_TRY(take_items(r, RUN, 1, r->run));
    RX_TRY(take_whole(r, 3, 0, 1, &reference));
    return reference ? RX_MAKE(r->run->tally, 1, r->err) : RX_OK;
}

/* A line may come where what it belongs to has come. */
static bool is_in_place(const reader *r, line_name name)
{
    const rx_extension_facts *e = r->extension;
    switch (name) {
    case EXTENSION:
        return true;
    case ANOMALIES:
        return e != NULL && e->known;
    case CARD:
        return e != NULL && e->ncards < RX_RECORD_CARDS;
    case PSF:
        return e != NULL && e->psf.how[0] == '\0';
    case STARS:
        return e != NULL && e->psf.how[0] != '\0';
    case RHO:
        return e != NULL && e->psf.rho.n > 0;
    case RUN:
        return e != NULL && e->nruns < RX_MAX_RUNS;
    default:
        return name < RUN ? e != NULL : r->run != NULL;
    }
}

static rx_status read_fields(reader *r, line_name name)
{
    rx_extension_facts *e = r->extension;
    char why[40];
    long k = 0;
    snprintf(why, sizeof why, "%s is out of place", lines[name].word);
    if (!is_in_place(r, name))
        return refuse(r, why);
    switch (name) {
    case EXTENSION:
        return begin_extension(r);
    case RUN:
        return begin_run(r);
    case CARD:
        RX_TRY(take_items(r, name, 1, &e->card[e->ncards]));
        e->ncards++;
        return RX_OK;
    case RHO:
        RX_TRY(take_whole(r, 1, 0, RX_RHO_BINS - 1, &k));
        return take_items(r, name, 2, (long *)(void *)e + k);
    case STATE:
        e->known = 1;
        break;
    case PSF:
        e->psf.rho.alpha = e->alpha;
        e->psf.rho.delta = e->delta;
        break;
    case GUARD:
        r->run->guard.known = 1;
        break;
    default:
        break;
    }
    return take_items(r, name, 1, name < RUN ? (void *)e : r->run);
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

static void forget_record(rx_tile_record *record)
{
    free(record->image);
    free(record->name);
    free(record->version);
    free(record->what);
    rx_tile_facts_free(&record->facts);
    *record = (rx_tile_record){0};
}

static rx_status begin_record(reader *r)
{
    if (r->open)
        return refuse(r, "the record before has no END");
    forget_record(&r->record);
    r->open = true;
    r->at = r->lines.at;
    r->extension = NULL;
    r->run = NULL;
    r->record.status = -1;
    RX_TRY(take_string(r, 1, &r->record.image));
    return take_string(r, 2, &r->record.name);
}

static rx_status end_record(reader *r)
{
    r->open = false;
    if (r->record.version == NULL || r->record.what == NULL)
        return refuse(r, "VERSION or STATUS is missing");
    return RX_OK;
}

static rx_status read_fact(reader *r)
{
    char *value = NULL;
    if (r->run == NULL || r->words.n < 2)
        return refuse(r, "FACT is out of place");
    RX_TRY(take_string(r, 2, &value));
    rx_record_add(&r->run->facts, r->words.v[1], "", "%s", value);
    free(value);
    return r->run->facts.failed ? rx_error_memory(r->err, 0) : RX_OK;
}

static rx_status read_words(reader *r)
{
    const char *word = r->words.v[0];
    if (strcmp(word, "TILE") == 0)
        return begin_record(r);
    if (!r->open)
        return refuse(r, "TILE does not come first");
    if (strcmp(word, "VERSION") == 0 && r->record.version == NULL)
        return take_string(r, 1, &r->record.version);
    if (strcmp(word, "STATUS") == 0 && r->record.what == NULL) {
        long code;
        rx_status status = take_whole(r, 1, 0, 255, &code);
        r->record.status = (int)code;
        return status == RX_OK ? take_string(r, 2, &r->record.what) : status;
    }
    if (strcmp(word, "FACT") == 0)
        return read_fact(r);
    if (strcmp(word, "END") == 0)
        return end_record(r);
    for (int i = 0; i < NLINES; i++)
        if (strcmp(word, lines[i].word) == 0)
            return read_fields(r, (line_name)i);
    return refuse(r, "this is no line of a record");
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

rx_status rx_record_reader_open(const char *path, int64_t from, rx_record_reader **dst, rx_error *err)
{
    *dst = RX_NEW(rx_record_reader, 1);
    if (*dst == NULL)
        return rx_error_memory(err, sizeof **dst);
    rx_status status = rx_lines_open(&(*dst)->lines, path, from, err);
    if (status != RX_OK) {
        rx_record_reader_close(*dst);
        *dst = NULL;
    }
    return status;
}

void rx_record_reader_close(rx_record_reader *r)
{
    if (r == NULL)
        return;
    rx_lines_close(&r->lines);
    forget_record(&r->record);
    free(r);
}

rx_status rx_record_reader_next(rx_record_reader *r, const rx_tile_record **record, int64_t *at,
                                rx_error *err)
{
    char *line = NULL;
    bool begun = false; /* a record, and with END it is whole */
    r->err = err;
    *record = NULL;
    do {
        rx_status status = rx_lines_next(&r->lines, &line, err);
        if (status == RX_OK && line != NULL)
            status = read_line(r, line);
        if (status != RX_OK)
            return status;
        begun |= r->open;
    } while (line != NULL && (r->open || !begun));
    if (r->open)
        return refuse(r, "the last record has no END");
    if (begun) {
        *record = &r->record;
        *at = r->at;
    }
    return RX_OK;
}
