/* Records of tiles as text, and back. */
#include "survey/tile_record.h"

#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/lines.h"
#include "base/memory.h"
#include "config/tokens.h"

static const char blanks[] = " \t\r\v\f";

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

static void add_psf(rx_text *dst, const rx_psf_account *psf)
{
    const rx_rho *rho = &psf->rho;
    if (psf->how[0] == '\0')
        return;
    rx_text_add(dst, "PSF");
    add_string(dst, psf->how);
    rx_text_printf(dst, " %d %d %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n", psf->stars, psf->reserved,
                   psf->flux_error, psf->growth, psf->residual, psf->off[0], psf->off[1], psf->off[2],
                   psf->error[0], psf->error[1], psf->error[2]);
    if (rho->n > 0)
        rx_text_printf(dst, "STARS %ld %ld %ld %ld %.9g\n", rho->n, rho->t, rho->e1, rho->e2, rho->reach);
    for (int k = 0; k < RX_RHO_BINS; k++)
        if (rho->pairs[k] > 0)
            rx_text_printf(dst, "RHO %d %ld %ld %ld\n", k, rho->pairs[k], rho->tt[k], rho->ee[k]);
}

static void add_extension(rx_text *dst, const rx_extension_facts *e)
{
    rx_text_printf(dst, "EXTENSION %d %d %d %.9g %.9g %.9g %.9g %.9g %d\n", e->hdu, e->width, e->height,
                   e->alpha, e->delta, e->fwhm, e->sky, e->noise, (int)e->verdict);
    if (e->known)
        rx_text_printf(dst, "STATE %.9g %.9g %.9g %.9g %.9g %.9g %d %d\n", e->state.ellipticity,
                       e->state.depth, e->state.factor, e->state.masked, e->state.saturated, e->state.chi2,
                       e->state.wrong, e->state.look);
    if (e->known && (isfinite(e->state.rows) || isfinite(e->state.columns) || isfinite(e->state.light)))
        rx_text_printf(dst, "ANOMALIES %.9g %.9g %.9g\n", e->state.rows, e->state.columns, e->state.light);
    for (int i = 0; i < e->ncards; i++) {
        rx_text_add(dst, "CARD");
        add_string(dst, e->card[i].name);
        rx_text_printf(dst, " %.15g\n", e->card[i].value);
    }
    if (e->page[0] != '\0') {
        rx_text_add(dst, "PAGE");
        add_string(dst, e->page);
        rx_text_add(dst, "\n");
    }
    add_psf(dst, &e->psf);
    for (int i = 0; i < e->nruns; i++) {
        const rx_run_facts *run = &e->run[i];
        rx_text_add(dst, "RUN");
        add_string(dst, run->name);
        rx_text_printf(dst, " %ld %d\n", run->sources, run->tally != NULL);
        const char *const others[][2] = {{"TOOK", run->taken}, {"DONE", run->by}};
        for (int k = 0; k < 2; k++) {
            if (others[k][1][0] == '\0')
                continue;
            rx_text_add(dst, others[k][0]);
            add_string(dst, others[k][1]);
            add_string(dst, run->why);
            rx_text_add(dst, "\n");
        }
        if (run->outside[0] != '\0') {
            rx_text_add(dst, "OUTSIDE");
            add_string(dst, run->outside);
            rx_text_add(dst, "\n");
        }
        if (run->flux.n > 0)
            rx_text_printf(dst, "FLUX %d %.9g %.9g %.9g %.9g %.9g\n", run->flux.n, run->flux.diameter,
                           run->flux.wide, run->flux.wide_error, run->flux.automatic,
                           run->flux.automatic_error);
        if (run->guard.known)
            rx_text_printf(dst, "GUARD %.9g %.9g %.9g\n", run->guard.false_per_mpixel, run->guard.raised,
                           run->guard.unexplained);
        if (isfinite(run->lit))
            rx_text_printf(dst, "SHARES %.9g %.9g\n", run->sharp, run->lit);
        for (int k = 0; k < run->facts.n; k++) {
            rx_text_printf(dst, "FACT %s", run->facts.pairs[k][0]);
            add_string(dst, run->facts.pairs[k][1]);
            rx_text_add(dst, "\n");
        }
        for (int b = 0; run->tally != NULL && b < RX_TALLY_BINS; b++)
            add_bin(dst, b, &run->tally->bin[b]);
    }
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

static rx_status read_extension(reader *r)
{
    long v[4] = {0};
    double x[5] = {0};
    for (int i = 0; i < 3; i++)
        RX_TRY(take_whole(r, 1 + i, 0, 1L << 30, &v[i]));
    for (int i = 0; i < 5; i++)
        RX_TRY(take_real(r, 4 + i, &x[i]));
    RX_TRY(take_whole(r, 9, RX_VERDICT_NONE, RX_VERDICT_INSUFFICIENT, &v[3]));
    rx_tile_facts *facts = &r->record.facts;
    RX_TRY(RX_GROW(facts->extension, (size_t)facts->n + 1, r->err));
    r->extension = &facts->extension[facts->n++];
    r->run = NULL;
    *r->extension = (rx_extension_facts){.hdu = (int)v[0],
                                         .width = (int)v[1],
                                         .height = (int)v[2],
                                         .alpha = x[0],
                                         .delta = x[1],
                                         .fwhm = x[2],
                                         .sky = x[3],
                                         .noise = x[4],
                                         .verdict = (rx_verdict)v[3]};
    return RX_OK;
}

/* Of a restorer: into reports and names of files, so nothing but letters, digits and '_'. */
static int is_run_name(const char *name)
{
    const size_t n = strspn(name, "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_");
    return n > 0 && name[n] == '\0' && n < sizeof((rx_run_facts *)NULL)->name;
}

static rx_status read_run(reader *r)
{
    long sources, reference;
    if (r->extension == NULL || r->extension->nruns == RX_MAX_RUNS)
        return refuse(r, "a run is out of place");
    RX_TRY(take_whole(r, 2, 0, 1L << 40, &sources));
    RX_TRY(take_whole(r, 3, 0, 1, &reference));
    if (!is_run_name(r->words.v[1]))
        RX_TRY(refuse(r, "a run has no name of a restorer"));
    r->run = &r->extension->run[r->extension->nruns++];
    *r->run = (rx_run_facts){.sources = sources, .sharp = NAN, .lit = NAN};
    snprintf(r->run->name, sizeof r->run->name, "%s", r->words.v[1]);
    return reference ? RX_MAKE(r->run->tally, 1, r->err) : RX_OK;
}

/* Which restorer, in a field of that size, and why. */
static rx_status read_restorer(reader *r, char *dst, size_t size)
{
    char *why = NULL;
    rx_status status = take_string(r, 2, &why);
    if (status == RX_OK) {
        snprintf(dst, size, "%s", r->words.v[1]);
        snprintf(r->run->why, sizeof r->run->why, "%s", why);
    }
    free(why);
    return status;
}

static rx_status read_done(reader *r)
{
    if (r->run == NULL || r->words.n < 3 || !is_run_name(r->words.v[1]))
        return refuse(r, "DONE is out of place");
    return read_restorer(r, r->run->by, sizeof r->run->by);
}

static rx_status read_took(reader *r)
{
    if (r->run == NULL || r->words.n < 3 || !is_run_name(r->words.v[1]))
        return refuse(r, "TOOK is out of place");
    return read_restorer(r, r->run->taken, sizeof r->run->taken);
}

static rx_status read_outside(reader *r)
{
    char *what = NULL;
    if (r->run == NULL || r->words.n < 2)
        return refuse(r, "OUTSIDE is out of place");
    rx_status status = take_string(r, 1, &what);
    if (status == RX_OK)
        snprintf(r->run->outside, sizeof r->run->outside, "%s", what);
    free(what);
    return status;
}

static rx_status read_flux(reader *r)
{
    long n;
    if (r->run == NULL)
        return refuse(r, "FLUX is out of place");
    rx_fluxcheck *flux = &r->run->flux;
    double *const values[] = {&flux->diameter, &flux->wide, &flux->wide_error, &flux->automatic,
                              &flux->automatic_error};
    rx_status status = take_whole(r, 1, 1, INT_MAX, &n);
    for (int i = 0; i < 5 && status == RX_OK; i++)
        status = take_real(r, 2 + i, values[i]);
    flux->n = status == RX_OK ? (int)n : 0;
    return status;
}

static rx_status read_guard(reader *r)
{
    if (r->run == NULL)
        return refuse(r, "GUARD is out of place");
    rx_run_guard *guard = &r->run->guard;
    guard->known = 1;
    RX_TRY(take_real(r, 1, &guard->false_per_mpixel));
    RX_TRY(take_real(r, 2, &guard->raised));
    return take_real(r, 3, &guard->unexplained);
}

static rx_status read_state(reader *r)
{
    long wrong = 0, look = 0;
    if (r->extension == NULL)
        return refuse(r, "STATE is out of place");
    rx_tile_state *s = &r->extension->state;
    double *const values[] = {&s->ellipticity, &s->depth, &s->factor, &s->masked, &s->saturated, &s->chi2};
    rx_status status = RX_OK;
    for (int i = 0; i < 6 && status == RX_OK; i++)
        status = take_real(r, 1 + i, values[i]);
    if (status == RX_OK)
        status = take_whole(r, 7, -1, INT_MAX, &wrong);
    if (status == RX_OK)
        status = take_whole(r, 8, -1, INT_MAX, &look);
    s->wrong = (int)wrong;
    s->look = (int)look;
    s->rows = s->columns = s->light = NAN;
    r->extension->known = 1;
    return status;
}

static rx_status read_anomalies(reader *r)
{
    if (r->extension == NULL || !r->extension->known)
        return refuse(r, "ANOMALIES is out of place");
    rx_tile_state *s = &r->extension->state;
    RX_TRY(take_real(r, 1, &s->rows));
    RX_TRY(take_real(r, 2, &s->columns));
    return take_real(r, 3, &s->light);
}

static rx_status read_shares(reader *r)
{
    if (r->run == NULL)
        return refuse(r, "SHARES is out of place");
    RX_TRY(take_real(r, 1, &r->run->sharp));
    return take_real(r, 2, &r->run->lit);
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

/* Into a field of a fixed size, cut where it is longer. */
static rx_status take_name(reader *r, int word, char *dst, size_t size)
{
    char *own = NULL;
    const rx_status status = take_string(r, word, &own);
    if (status == RX_OK)
        snprintf(dst, size, "%s", own);
    free(own);
    return status;
}

static rx_status read_card(reader *r)
{
    if (r->extension == NULL || r->extension->ncards == RX_RECORD_CARDS)
        return refuse(r, "CARD is out of place");
    rx_tile_card *card = &r->extension->card[r->extension->ncards];
    RX_TRY(take_name(r, 1, card->name, sizeof card->name));
    RX_TRY(take_real(r, 2, &card->value));
    r->extension->ncards++;
    return RX_OK;
}

static rx_status read_page(reader *r)
{
    if (r->extension == NULL)
        return refuse(r, "PAGE is out of place");
    return take_name(r, 1, r->extension->page, sizeof r->extension->page);
}

static rx_status read_psf(reader *r)
{
    char *how = NULL;
    long stars = 0, reserved = 0;
    if (r->extension == NULL || r->extension->psf.how[0] != '\0')
        return refuse(r, "PSF is out of place");
    rx_psf_account *psf = &r->extension->psf;
    double *const values[] = {&psf->flux_error, &psf->growth,   &psf->residual, &psf->off[0],  &psf->off[1],
                              &psf->off[2],     &psf->error[0], &psf->error[1], &psf->error[2]};
    rx_status status;
    RX_TRY_EXIT(take_string(r, 1, &how));
    if (!is_run_name(how))
        RX_TRY_EXIT(refuse(r, "a PSF has no word of RXPSFHOW"));
    RX_TRY_EXIT(take_whole(r, 2, 0, INT_MAX, &stars));
    RX_TRY_EXIT(take_whole(r, 3, 0, INT_MAX, &reserved));
    for (int i = 0; i < 9; i++)
        RX_TRY_EXIT(take_real(r, 4 + i, values[i]));
    snprintf(psf->how, sizeof psf->how, "%s", how);
    psf->stars = (int)stars;
    psf->reserved = (int)reserved;
    psf->rho.alpha = r->extension->alpha;
    psf->rho.delta = r->extension->delta;
exit:
    free(how);
    return status;
}

static rx_status read_stars(reader *r)
{
    const long most = 1L << 40;
    if (r->extension == NULL || r->extension->psf.how[0] == '\0')
        return refuse(r, "STARS is out of place");
    rx_rho *rho = &r->extension->psf.rho;
    long *const values[] = {&rho->t, &rho->e1, &rho->e2};
    RX_TRY(take_whole(r, 1, 1, INT_MAX, &rho->n));
    for (int i = 0; i < 3; i++)
        RX_TRY(take_whole(r, 2 + i, -most, most, values[i]));
    return take_real(r, 5, &rho->reach);
}

static rx_status read_rho(reader *r)
{
    const long most = 1L << 60;
    long k = 0;
    if (r->extension == NULL || r->extension->psf.rho.n == 0)
        return refuse(r, "RHO is out of place");
    rx_rho *rho = &r->extension->psf.rho;
    RX_TRY(take_whole(r, 1, 0, RX_RHO_BINS - 1, &k));
    RX_TRY(take_whole(r, 2, 1, most, &rho->pairs[k]));
    RX_TRY(take_whole(r, 3, -most, most, &rho->tt[k]));
    return take_whole(r, 4, -most, most, &rho->ee[k]);
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

static rx_status read_words(reader *r)
{
    static const struct {
        const char *kind;
        rx_status (*read)(reader *r);
    } lines[] = {{"EXTENSION", read_extension}, {"STATE", read_state}, {"ANOMALIES", read_anomalies},
                 {"CARD", read_card},           {"PAGE", read_page},   {"PSF", read_psf},
                 {"STARS", read_stars},         {"RHO", read_rho},     {"RUN", read_run},
                 {"DONE", read_done},           {"TOOK", read_took},   {"OUTSIDE", read_outside},
                 {"FLUX", read_flux},           {"GUARD", read_guard}, {"SHARES", read_shares},
                 {"FACT", read_fact},           {"END", end_record}};
    const char *kind = r->words.v[0];
    if (strcmp(kind, "TILE") == 0)
        return begin_record(r);
    if (!r->open)
        return refuse(r, "TILE does not come first");
    if (strcmp(kind, "VERSION") == 0 && r->record.version == NULL)
        return take_string(r, 1, &r->record.version);
    if (strcmp(kind, "STATUS") == 0 && r->record.what == NULL) {
        long code;
        rx_status status = take_whole(r, 1, 0, 255, &code);
        r->record.status = (int)code;
        return status == RX_OK ? take_string(r, 2, &r->record.what) : status;
    }
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++)
        if (strcmp(kind, lines[i].kind) == 0)
            return lines[i].read(r);
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
