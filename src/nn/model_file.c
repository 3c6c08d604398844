/* A model as one FITS file: writing and reading. */
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "nn/model.h"

enum { VERSION = 1, TWO_STAGES = 2 }; /* of the format */
enum { OP_WIDTH = 17, MAX_BINS = 10000, MAX_HDUS = 1000 };

/* Numbers of the primary header, in their order: members of a model, and what they may be. */
typedef enum kind { INTEGER, LONG, REAL } kind;
typedef struct number {
    const char *key;
    kind kind;
    size_t offset;
    double low, high;
    const char *comment;
} number;

#define MEMBER(member) offsetof(rx_model, member)
static const number numbers[] = {
    {"RXTFWHM", REAL, MEMBER(front.target_fwhm), 0.5, 30, "[pix] FWHM of the output's Gaussian PSF"},
    {"RXTIKH", REAL, MEMBER(front.tikhonov), 1e-9, 1e3, "regularisation of the deconvolved copy"},
    {"RXRLSTEP", INTEGER, MEMBER(front.rl_steps), 0, RX_FRONT_STEPS,
     "Richardson-Lucy steps after each network"},
    {"RXPEDST", REAL, MEMBER(front.pedestal), 1e-9, 1e6, "pedestal of that step, noise sigmas"},
    {"RXNFWHM", INTEGER, MEMBER(nfwhm), 0, MAX_BINS, "bins of FWHM"},
    {"RXNSIGMA", INTEGER, MEMBER(nsigma), 0, MAX_BINS, "bins of noise"},
    {"RXEPOCHS", LONG, MEMBER(epochs), 0, INT_MAX, "epochs of training"},
    {"RXBEST", LONG, MEMBER(best), 0, INT_MAX, "epoch of these parameters, the best one"},
    {"RXENDED", INTEGER, MEMBER(ended), 0, 1, "1: the training has ended"},
    {"RXNFMAX", REAL, MEMBER(factor), 0.1, 1e3, "largest noise factor of the training"},
    {"RXTDARK", REAL, MEMBER(dark), 0, 1, "share of its images with dark structure"},
    {"RXPATCHS", LONG, MEMBER(patches), 0, 1e15, "images seen in training"},
};
enum { NUMBERS = sizeof numbers / sizeof numbers[0] };

/* Columns of a table, in order: what their cells hold, T text, I and L integers of 32 and 64 bits, F float, D double; and
 * where that is in a node or bin. */
typedef struct layout {
    const char *kinds;
    struct {
        const char *name;
        size_t offset;
    } column[10];
} layout;

#define NODE(name, member)                                                                                   \
    {                                                                                                        \
        name, offsetof(rx_node, member)                                                                      \
    }
#define BIN(name, member)                                                                                    \
    {                                                                                                        \
        name, offsetof(rx_model_bin, member)                                                                 \
    }
static const layout node_layout = {"TIIIIII",
                                   {{"OP", 0},
                                    NODE("SRC", src),
                                    NODE("ADD", add),
                                    NODE("RELU", relu),
                                    NODE("CHANNELS", channels),
                                    NODE("KERNEL", kernel),
                                    NODE("STRIDE", stride)}},
                    bin_layout = {"DDDDDDDDDL",
                                  {BIN("FWHM_LOW", fwhm[0]), BIN("FWHM_HIGH", fwhm[1]),
                                   BIN("SIGMA_LOW", sigma[0]), BIN("SIGMA_HIGH", sigma[1]), BIN("LOSS", loss),
                                   BIN("LIST", list), BIN("RECALL", recall), BIN("BIAS", bias),
                                   BIN("SCATTER", scatter), BIN("IMAGES", images)}},
                    params_layout = {"F", {{"VALUE", 0}}}, lines_layout = {"T", {{"LINE", 0}}};

static rx_cell_type type_of(char kind)
{
    return kind == 'T'   ? RX_CELL_TEXT
           : kind == 'I' ? RX_CELL_INT32
           : kind == 'L' ? RX_CELL_INT64
           : kind == 'F' ? RX_CELL_FLOAT
                         : RX_CELL_DOUBLE;
}

/* --- does it hang together --- */

static double value_of(const rx_model *model, const number *n)
{
    const char *at = (const char *)model + n->offset;
    return n->kind == REAL   ? *(const double *)(const void *)at
           : n->kind == LONG ? (double)*(const long *)(const void *)at
                             : *(const int *)(const void *)at;
}

static const char *net_fault(const rx_net *net, const char *name, int inputs, char *text, size_t size)
{
    const rx_node *first = &net->node[0], *last = &net->node[net->nnodes - 1];
    if (first->channels != inputs)
        snprintf(text, size, "its %s network takes %d channels, the mode gives %d", name, first->channels,
                 inputs);
    else if (last->channels != 1 || last->level != 0)
        snprintf(text, size,
                 "its %s network ends in %d channels at 1/%d of the resolution, one at full is needed", name,
                 last->channels, 1 << last->level);
    else
        return NULL;
    return text;
}

/* Why the model makes no sense (into text), or NULL when it does: numbers, channels of the networks' ends. */
static const char *model_fault(const rx_model *model, char *text, size_t size)
{
    static const char *const names[RX_MODEL_NETS] = {
        [RX_NET_RESTORE] = "RESTORE", [RX_NET_PSF] = "PSF", [RX_NET_SECOND] = "SECOND"};
    const rx_front *f = &model->front;
    const int inputs[RX_MODEL_NETS] = {[RX_NET_RESTORE] = rx_front_channels(f->mode),
                                       [RX_NET_PSF] = RX_PSF_CHANNELS,
                                       [RX_NET_SECOND] = RX_SECOND_CHANNELS};
    rx_net *nets[RX_MODEL_NETS];
    for (int i = 0; i < NUMBERS; i++) {
        const number *n = &numbers[i];
        const double value = value_of(model, n);
        if (!(value >= n->low && value <= n->high)) {
            snprintf(text, size, "%s, %s, is %g, not within %g to %g", n->key, n->comment, value, n->low,
                     n->high);
            return text;
        }
    }
    if (model->best > model->epochs) {
        snprintf(text, size, "RXBEST, the best epoch, is %ld of %ld", model->best, model->epochs);
        return text;
    }
    if (f->mode == RX_MODE_BLIND && (f->rl_steps > 0 || model->second != NULL)) {
        snprintf(text, size,
                 f->rl_steps > 0 ? "%d Richardson-Lucy steps after a network of mode BLIND are not possible"
                                 : "a second stage after a network of mode BLIND is not possible",
                 f->rl_steps);
        return text;
    }
    rx_model_nets(model, nets);
    for (int k = 0; k < RX_MODEL_NETS; k++)
        if (nets[k] != NULL && net_fault(nets[k], names[k], inputs[k], text, size) != NULL)
            return text;
    return NULL;
}

/* ---- writing ---- */

static rx_status new_table(const char *name, long rows, const layout *of, int text_width, rx_table **dst,
                           rx_error *err)
{
    rx_column like[sizeof of->column / sizeof *of->column] = {0};
    int n = 0;
    for (; of->kinds[n] != '\0'; n++) {
        like[n].type = type_of(of->kinds[n]);
        like[n].text_width = of->kinds[n] == 'T' ? text_width : 0;
        snprintf(like[n].name, sizeof like[n].name, "%s", of->column[n].name);
    }
    return rx_table_make(name, like, n, rows, dst, err);
}

static rx_status write_net(rx_fits_writer *writer, const rx_net *net, const char *name, rx_error *err)
{
    char extname[40];
    rx_table *nodes = NULL, *params = NULL;
    snprintf(extname, sizeof extname, "%s_NODES", name);
    rx_status status;
    RX_TRY_EXIT(new_table(extname, net->nnodes, &node_layout, OP_WIDTH, &nodes, err));
    for (int i = 0; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        rx_column_set(&nodes->columns[0], i, 0, rx_op_name(n->op));
        for (int c = 1; c < nodes->ncolumns; c++)
            memcpy((int32_t *)nodes->columns[c].data + i, (const char *)n + node_layout.column[c].offset,
                   sizeof(int32_t));
    }
    RX_TRY_EXIT(rx_fits_table(writer, nodes, NULL, err));
    snprintf(extname, sizeof extname, "%s_PARAMS", name);
    RX_TRY_EXIT(new_table(extname, net->nparams, &params_layout, 0, &params, err));
    memcpy(params->columns[0].data, net->params, (size_t)net->nparams * sizeof(float));
    status = rx_fits_table(writer, params, NULL, err);
exit:
    rx_table_free(nodes);
    rx_table_free(params);
    return status;
}

static rx_status write_bins(rx_fits_writer *writer, const rx_model *model, rx_error *err)
{
    const long n = (long)model->nfwhm * model->nsigma;
    rx_table *table = NULL;
    rx_status status = new_table("DICTIONARY", n, &bin_layout, 0, &table, err);
    for (long i = 0; i < n && status == RX_OK; i++) {
        for (int c = 0; c + 1 < table->ncolumns; c++)
            memcpy((double *)table->columns[c].data + i,
                   (const char *)&model->bins[i] + bin_layout.column[c].offset, sizeof(double));
        ((int64_t *)table->columns[table->ncolumns - 1].data)[i] = model->bins[i].images;
    }
    if (status == RX_OK)
        status = rx_fits_table(writer, table, NULL, err);
    rx_table_free(table);
    return status;
}

/* One row for each line, printable ASCII. */
static rx_status write_provenance(rx_fits_writer *writer, const char *text, rx_error *err)
{
    size_t longest = 1;
    long lines = 0;
    rx_table *table = NULL;
    for (const char *c = text; *c != '\0'; lines++) {
        size_t n = strcspn(c, "\n");
        longest = n > longest ? n : longest;
        c += n + (c[n] == '\n');
    }
    rx_status status = new_table("PROVENANCE", lines, &lines_layout, (int)longest + 1, &table, err);
    for (long i = 0; i < lines && status == RX_OK; i++) {
        char *cell = (char *)table->columns[0].data + (size_t)i * (longest + 1);
        size_t n = strcspn(text, "\n");
        for (size_t k = 0; k < n; k++)
            cell[k] = text[k] >= 0x20 && text[k] <= 0x7e ? text[k] : '?';
        text += n + (text[n] == '\n');
    }
    if (status == RX_OK)
        status = rx_fits_table(writer, table, NULL, err);
    rx_table_free(table);
    return status;
}

static int has_provenance(const rx_model *model)
{
    return model->provenance != NULL && model->provenance[0] != '\0';
}

static void add_cards(const rx_model *model, rx_text *dst)
{
    char digest[RX_MODEL_DIGEST], seed[24];
    int tables = 2 + 2 * (model->second != NULL) + 2 * (model->psf != NULL) + (model->bins != NULL) +
                 has_provenance(model);
    rx_model_digest(model, digest);
    snprintf(seed, sizeof seed, "%" PRIu64, model->seed);
    rx_card_integer(dst, "RXMODEL", model->second != NULL ? TWO_STAGES : VERSION,
                    "version of the model format");
    rx_card_integer(dst, "NEXTEND", tables, "number of tables that follow");
    rx_card_text(dst, "RXNAME", model->name, "name");
    rx_card_text(dst, "RXDIGEST", digest, "of front, nodes and parameters");
    rx_card_text(dst, "RXMODE", rx_mode_name(model->front.mode), "what the network is given");
    for (int i = 0; i < NUMBERS; i++)
        if (numbers[i].kind == REAL)
            rx_card_number(dst, numbers[i].key, value_of(model, &numbers[i]), numbers[i].comment);
        else
            rx_card_integer(dst, numbers[i].key, (long)value_of(model, &numbers[i]), numbers[i].comment);
    rx_card_text(dst, "RXSEED", seed, "seed of the training");
}

rx_status rx_model_write(const rx_model *model, const char *path, const char *shown, rx_error *err)
{
    rx_fits_writer *writer = NULL;
    rx_text cards = {0};
    char fault[200];
    if (model->restore == NULL || model_fault(model, fault, sizeof fault) != NULL)
        return rx_error_at(err, RX_SYSTEM, shown, -1, 0, "the model cannot be written: %s",
                           model->restore == NULL ? "it has no network" : fault);
    add_cards(model, &cards);
    rx_status status;
    RX_TRY_EXIT(cards.failed ? rx_error_memory(err, cards.length) : RX_OK);
    RX_TRY_EXIT(rx_fits_create(path, shown, &writer, err));
    RX_TRY_EXIT(rx_fits_primary(writer, &cards, err));
    RX_TRY_EXIT(write_net(writer, model->restore, "RESTORE", err));
    if (model->second != NULL)
        RX_TRY_EXIT(write_net(writer, model->second, "SECOND", err));
    if (model->psf != NULL)
        RX_TRY_EXIT(write_net(writer, model->psf, "PSF", err));
    if (model->bins != NULL)
        RX_TRY_EXIT(write_bins(writer, model, err));
    if (has_provenance(model))
        RX_TRY_EXIT(write_provenance(writer, model->provenance, err));
exit:
    rx_text_free(&cards);
    if (status != RX_OK) {
        rx_fits_abort(writer);
        return status;
    }
    return rx_fits_close(writer, err);
}

/* ---- reading ---- */

typedef struct reader {
    const char *path;
    char *cards; /* of the primary header */
    long ncards;
    int version;
    rx_model *model;
} reader;

/* --- header --- */

static rx_status take_number(const reader *r, const number *n, rx_error *err)
{
    char *at = (char *)r->model + n->offset;
    double value;
    if (!rx_cards_number(r->cards, r->ncards, n->key, &value))
        return rx_error_at(err, RX_INPUT, r->path, 0, 0, "%s is missing or no number; make the model again",
                           n->key);
    if (!(value >= n->low && value <= n->high) || (n->kind != REAL && value != floor(value)))
        return rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "%s is %g, %s from %g to %g was expected (%s); make the model again", n->key,
                           value, n->kind == REAL ? "a number" : "an integer", n->low, n->high, n->comment);
    if (n->kind == REAL)
        *(double *)(void *)at = value;
    else if (n->kind == LONG)
        *(long *)(void *)at = (long)value;
    else
        *(int *)(void *)at = (int)value;
    return RX_OK;
}

static rx_status take_header(const reader *r, rx_error *err)
{
    rx_model *m = r->model;
    char mode[32], seed[32], *end;
    rx_cards_text(r->cards, r->ncards, "RXNAME", m->name, sizeof m->name);
    rx_cards_text(r->cards, r->ncards, "RXMODE", mode, sizeof mode);
    m->front.mode = strcmp(mode, rx_mode_name(RX_MODE_BLIND)) == 0 ? RX_MODE_BLIND : RX_MODE_INFORMED;
    if (strcmp(mode, rx_mode_name(m->front.mode)) != 0)
        return rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "RXMODE is '%s', BLIND or INFORMED was expected; make the model again", mode);
    for (int i = 0; i < NUMBERS; i++)
        RX_TRY(take_number(r, &numbers[i], err));
    rx_cards_text(r->cards, r->ncards, "RXSEED", seed, sizeof seed);
    m->seed = strtoull(seed, &end, 10);
    if (end == seed || *end != '\0')
        return rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "RXSEED is missing or no number; make the model again");
    return RX_OK;
}

/* Is it a model of this version, and is the file as it was written? */
static rx_status check_file(reader *r, rx_error *err)
{
    double version = 0, tables = 0;
    RX_TRY(rx_fits_read_header(r->path, 0, &r->cards, &r->ncards, err));
    if (!rx_cards_number(r->cards, r->ncards, "RXMODEL", &version))
        return rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "is no model: its header has no RXMODEL; give a file made by rextract-train");
    int known = rx_cards_number(r->cards, r->ncards, "NEXTEND", &tables) && tables >= 0 && tables < MAX_HDUS;
    RX_TRY(rx_fits_verify(r->path, known ? (int)tables + 1 : 0, err));
    if (version != VERSION && version != TWO_STAGES)
        RX_TRY(rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "is a model of format version %g, this program reads %d and %d; use the "
                           "program that belongs to it, or train again",
                           version, VERSION, TWO_STAGES));
    r->version = (int)version;
    if (!known)
        RX_TRY(rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "NEXTEND, the number of its tables, is missing; make the model again"));
    return RX_OK;
}

/* --- tables --- */

/* *dst NULL when it is not there and need not be. */
static rx_status read_columns(const reader *r, const char *extname, const layout *of, int needed,
                              rx_table **dst, int *hdu, rx_error *err)
{
    RX_TRY(rx_fits_read_named(r->path, extname, dst, hdu, err));
    if (*dst == NULL)
        return needed ? rx_error_at(err, RX_INPUT, r->path, -1, 0, "has no table %s; make the model again",
                                    extname)
                      : RX_OK;
    for (int i = 0; of->kinds[i] != '\0'; i++) {
        const rx_column *column = i < (*dst)->ncolumns ? &(*dst)->columns[i] : NULL;
        if (column == NULL || strcmp(column->name, of->column[i].name) != 0 || column->ndim != 0 ||
            column->type != type_of(of->kinds[i]))
            return rx_error_at(err, RX_INPUT, r->path, *hdu, 0,
                               "column %d of %s is not what a model has there (%s); make the model again",
                               i + 1, extname, of->column[i].name);
    }
    return RX_OK;
}

static rx_status take_nodes(const reader *r, const rx_table *table, int hdu, rx_node *nodes, rx_error *err)
{
    if (table->nrows < 1 || table->nrows > RX_NET_NODES)
        return rx_error_at(err, RX_INPUT, r->path, hdu, 0,
                           "has %ld nodes, 1 to %d are possible; make the model again", table->nrows,
                           RX_NET_NODES);
    for (long i = 0; i < table->nrows; i++) {
        const rx_column *ops = &table->columns[0];
        const char *name = (const char *)ops->data + (size_t)i * (size_t)ops->text_width;
        int op = rx_op_find(name);
        if (op < 0)
            return rx_error_at(err, RX_INPUT, r->path, hdu, 0,
                               "node %ld has the unknown operation '%.20s'; use a newer program, or make the "
                               "model again",
                               i, name);
        nodes[i] = (rx_node){.op = (rx_op)op};
        for (int c = 1; node_layout.kinds[c] != '\0'; c++)
            memcpy((char *)&nodes[i] + node_layout.column[c].offset,
                   (const int32_t *)table->columns[c].data + i, sizeof(int32_t));
    }
    return RX_OK;
}

static rx_status make_net(const reader *r, const rx_table *nodes, int hdu, const rx_table *params,
                          int params_hdu, rx_net **dst, rx_error *err)
{
    rx_node list[RX_NET_NODES];
    rx_error why = rx_error_part(err);
    const float *values = params->columns[0].data;
    RX_TRY(take_nodes(r, nodes, hdu, list, err));
    const rx_status status = rx_net_new(list, (int)nodes->nrows, params->nrows, dst, &why);
    if (status == RX_INPUT)
        return rx_error_at(err, RX_INPUT, r->path, hdu, 0,
                           "its nodes make no network: %s; make the model again", why.text);
    if (status != RX_OK)
        return rx_error_take(err, &why);
    for (long i = 0; i < params->nrows; i++) {
        if (!isfinite(values[i]))
            return rx_error_at(err, RX_INPUT, r->path, params_hdu, 0,
                               "parameter %ld is not finite; the training diverged, train again", i + 1);
        (*dst)->params[i] = values[i];
    }
    return RX_OK;
}

static rx_status read_net(const reader *r, const char *name, int needed, rx_net **dst, rx_error *err)
{
    char extname[40];
    rx_table *nodes = NULL, *params = NULL;
    int hdu = -1, params_hdu = -1;
    rx_status status;
    snprintf(extname, sizeof extname, "%s_NODES", name);
    RX_TRY_EXIT(read_columns(r, extname, &node_layout, needed, &nodes, &hdu, err));
    if (nodes != NULL) {
        snprintf(extname, sizeof extname, "%s_PARAMS", name);
        RX_TRY_EXIT(read_columns(r, extname, &params_layout, 1, &params, &params_hdu, err));
        status = make_net(r, nodes, hdu, params, params_hdu, dst, err);
    }
exit:
    rx_table_free(nodes);
    rx_table_free(params);
    return status;
}

/* The same limit, but for rounding. */
static int same(double a, double b)
{
    return fabs(a - b) <= 1e-9 * fabs(a);
}

/* The grid must be one: rising limits without gaps, the same in every row and column. */
static int is_grid(const rx_model *m)
{
    for (int k = 0; k < m->nsigma; k++)
        for (int i = 0; i < m->nfwhm; i++) {
            const rx_model_bin *b = &m->bins[(long)k * m->nfwhm + i], *top = &m->bins[i],
                               *left = &m->bins[(long)k * m->nfwhm];
            if (!(b->fwhm[0] >= 0 && b->fwhm[1] > b->fwhm[0] && b->sigma[0] >= 0 &&
                  b->sigma[1] > b->sigma[0] && isfinite(b->fwhm[1]) && isfinite(b->sigma[1])))
                return 0;
            if (!same(b->fwhm[0], top->fwhm[0]) || !same(b->fwhm[1], top->fwhm[1]) ||
                !same(b->sigma[0], left->sigma[0]) || !same(b->sigma[1], left->sigma[1]))
                return 0;
            if ((i > 0 && !same(b->fwhm[0], b[-1].fwhm[1])) ||
                (k > 0 && !same(b->sigma[0], b[-m->nfwhm].sigma[1])))
                return 0;
        }
    return 1;
}

static rx_status read_bins(const reader *r, rx_error *err)
{
    rx_model *m = r->model;
    rx_table *table = NULL;
    int hdu = -1;
    rx_status status;
    RX_TRY_EXIT(read_columns(r, "DICTIONARY", &bin_layout, m->nfwhm > 0 && m->nsigma > 0, &table, &hdu, err));
    if (table == NULL)
        goto exit;
    if (table->nrows != (long)m->nfwhm * m->nsigma)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, r->path, hdu, 0,
                                "the dictionary has %ld bins, the header says %d x %d; make the model again",
                                table->nrows, m->nfwhm, m->nsigma));
    RX_TRY_EXIT(RX_MAKE(m->bins, (size_t)table->nrows, err));
    for (long i = 0; i < table->nrows; i++) {
        int c = 0;
        for (; bin_layout.kinds[c] == 'D'; c++)
            memcpy((char *)&m->bins[i] + bin_layout.column[c].offset,
                   (const double *)table->columns[c].data + i, sizeof(double));
        const int64_t images = ((const int64_t *)table->columns[c].data)[i];
        m->bins[i].images = images >= 0 && images < (int64_t)1e15 ? (long)images : 0;
    }
    if (!is_grid(m))
        status =
            rx_error_at(err, RX_INPUT, r->path, hdu, 0,
                        "the bins of the dictionary are no grid of FWHM and noise; make the model again");
exit:
    rx_table_free(table);
    return status;
}

static rx_status read_provenance(const reader *r, rx_error *err)
{
    rx_table *table = NULL;
    rx_text text = {0};
    int hdu = -1;
    rx_status status = read_columns(r, "PROVENANCE", &lines_layout, 0, &table, &hdu, err);
    for (long i = 0; status == RX_OK && table != NULL && i < table->nrows; i++) {
        const rx_column *column = &table->columns[0];
        const char *line = (const char *)column->data + (size_t)i * (size_t)column->text_width;
        size_t n = strlen(line);
        while (n > 0 && line[n - 1] == ' ') /* FITS knows no empty string that is not missing */
            n--;
        rx_text_add_bytes(&text, line, n);
        rx_text_add(&text, "\n");
    }
    rx_table_free(table);
    if (status == RX_OK && text.failed)
        status = rx_error_memory(err, text.length);
    if (status != RX_OK) {
        rx_text_free(&text);
        return status;
    }
    r->model->provenance = text.data;
    return RX_OK;
}

/* --- all --- */

static rx_status check_model(const reader *r, rx_error *err)
{
    char fault[200], text[RX_MODEL_DIGEST];
    if (model_fault(r->model, fault, sizeof fault) != NULL)
        return rx_error_at(err, RX_INPUT, r->path, -1, 0, "%s; make the model again", fault);
    rx_model_digest(r->model, r->model->digest);
    rx_cards_text(r->cards, r->ncards, "RXDIGEST", text, sizeof text);
    if (strcmp(text, r->model->digest) != 0)
        return rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "RXDIGEST is '%s', nodes and parameters give '%s': the file was put together from "
                           "others; make the model again",
                           text, r->model->digest);
    return RX_OK;
}

rx_status rx_model_read(const char *path, rx_model **dst, rx_error *err)
{
    reader r = {.path = path};
    *dst = NULL;
    rx_status status;
    RX_TRY_EXIT(check_file(&r, err));
    r.model = rx_model_new();
    if (r.model == NULL)
        RX_TRY_EXIT(rx_error_memory(err, sizeof *r.model));
    RX_TRY_EXIT(take_header(&r, err));
    RX_TRY_EXIT(read_net(&r, "RESTORE", 1, &r.model->restore, err));
    RX_TRY_EXIT(read_net(&r, "SECOND", r.version == TWO_STAGES, &r.model->second, err));
    RX_TRY_EXIT(read_net(&r, "PSF", 0, &r.model->psf, err));
    RX_TRY_EXIT(read_bins(&r, err));
    RX_TRY_EXIT(read_provenance(&r, err));
    RX_TRY_EXIT(check_model(&r, err));
    *dst = r.model;
    r.model = NULL;
exit:
    rx_model_free(r.model);
    free(r.cards);
    return status;
}
