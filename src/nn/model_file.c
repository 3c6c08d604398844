/* A model as one FITS file: writing and reading. */
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "io/fits_digest.h"
#include "io/fits_read.h"
#include "io/fits_write.h"
#include "nn/model.h"

enum { VERSION = 1, TWO_STAGES = 2 }; /* of the format */

/* Columns of the tables, in order. */
static const char *const node_columns[] = {"OP", "SRC", "ADD", "RELU", "CHANNELS", "KERNEL", "STRIDE"};
enum { NNODE_COLUMNS = 7, OP_WIDTH = 17 };

static const char *const bin_columns[] = {"FWHM_LOW", "FWHM_HIGH", "SIGMA_LOW", "SIGMA_HIGH", "LOSS",
                                          "LIST",     "RECALL",    "BIAS",      "SCATTER",    "IMAGES"};
enum { NBIN_COLUMNS = 10 };

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

/* Why the numbers before the networks make no sense (into text), or NULL when they do: front parameters,
 * channels of the networks' ends. */
static const char *model_fault(const rx_model *model, char *text, size_t size)
{
    const rx_front *f = &model->front;
    if (!(f->target_fwhm >= 0.5 && f->target_fwhm <= 30))
        snprintf(text, size, "the FWHM of its output, %g pixels, is not within 0.5 to 30", f->target_fwhm);
    else if (!(f->tikhonov > 0 && f->tikhonov <= 1e3))
        snprintf(text, size, "its regularisation, %g, is not within 0 to 1000", f->tikhonov);
    else if (!(f->pedestal > 0 && f->pedestal <= 1e6))
        snprintf(text, size, "its pedestal, %g, is not within 0 to 1e6", f->pedestal);
    else if (f->rl_steps < 0 || f->rl_steps > RX_FRONT_STEPS || (f->rl_steps > 0 && f->mode == RX_MODE_BLIND))
        snprintf(text, size, "%d Richardson-Lucy steps after a network of mode %s are not possible",
                 f->rl_steps, rx_mode_name(f->mode));
    else if (model->second != NULL && f->mode != RX_MODE_INFORMED)
        snprintf(text, size, "a second stage after a network of mode %s is not possible",
                 rx_mode_name(f->mode));
    else if (net_fault(model->restore, "RESTORE", rx_front_channels(f->mode), text, size) == NULL &&
             (model->second == NULL ||
              net_fault(model->second, "SECOND", RX_SECOND_CHANNELS, text, size) == NULL) &&
             (model->psf == NULL || net_fault(model->psf, "PSF", RX_PSF_CHANNELS, text, size) == NULL))
        return NULL;
    return text;
}

/* ---- writing ---- */

enum { CARD = 80 };

static rx_status new_table(const char *name, long rows, int ncolumns, rx_table **dst, rx_error *err)
{
    rx_table *table = rx_table_new(ncolumns);
    if (table == NULL)
        return rx_error_memory(err, 0);
    free(table->name);
    table->name = rx_strdup(name);
    table->nrows = rows;
    *dst = table;
    return table->name != NULL ? RX_OK : rx_error_memory(err, 0);
}

static rx_status set_column(rx_table *table, int i, const char *name, rx_cell_type type, int text_width,
                            rx_error *err)
{
    rx_column *column = &table->columns[i];
    column->type = type;
    column->text_width = text_width;
    snprintf(column->name, sizeof column->name, "%s", name);
    size_t size = (size_t)rx_column_element_size(column);
    column->data = rx_alloc((size_t)table->nrows, size);
    return column->data != NULL ? RX_OK : rx_error_memory(err, (size_t)table->nrows * size);
}

/* --- networks --- */

static rx_status nodes_table(const rx_net *net, const char *name, rx_table **dst, rx_error *err)
{
    RX_TRY(new_table(name, net->nnodes, NNODE_COLUMNS, dst, err));
    for (int c = 0; c < NNODE_COLUMNS; c++)
        RX_TRY(set_column(*dst, c, node_columns[c], c == 0 ? RX_CELL_TEXT : RX_CELL_INT32,
                          c == 0 ? OP_WIDTH : 0, err));
    for (int i = 0; i < net->nnodes; i++) {
        const rx_node *n = &net->node[i];
        const int values[] = {0, n->src, n->add, n->relu, n->channels, n->kernel, n->stride};
        snprintf((char *)(*dst)->columns[0].data + (size_t)i * OP_WIDTH, OP_WIDTH, "%s", rx_op_name(n->op));
        for (int c = 1; c < NNODE_COLUMNS; c++)
            ((int32_t *)(*dst)->columns[c].data)[i] = values[c];
    }
    return RX_OK;
}

static rx_status write_net(rx_fits_writer *writer, const rx_net *net, const char *name, rx_error *err)
{
    char extname[40];
    rx_table *nodes = NULL, *params = NULL;
    snprintf(extname, sizeof extname, "%s_NODES", name);
    rx_status status;
    RX_TRY_EXIT(nodes_table(net, extname, &nodes, err));
    RX_TRY_EXIT(rx_fits_table(writer, nodes, NULL, err));
    snprintf(extname, sizeof extname, "%s_PARAMS", name);
    RX_TRY_EXIT(new_table(extname, net->nparams, 1, &params, err));
    RX_TRY_EXIT(set_column(params, 0, "VALUE", RX_CELL_FLOAT, 0, err));
    memcpy(params->columns[0].data, net->params, (size_t)net->nparams * sizeof(float));
    status = rx_fits_table(writer, params, NULL, err);
exit:
    rx_table_free(nodes);
    rx_table_free(params);
    return status;
}

/* --- dictionary, provenance --- */

static rx_status write_bins(rx_fits_writer *writer, const rx_model *model, rx_error *err)
{
    rx_table *table = NULL;
    long n = (long)model->nfwhm * model->nsigma;
    rx_status status = new_table("DICTIONARY", n, NBIN_COLUMNS, &table, err);
    for (int c = 0; c < NBIN_COLUMNS && status == RX_OK; c++)
        status = set_column(table, c, bin_columns[c], c == NBIN_COLUMNS - 1 ? RX_CELL_INT64 : RX_CELL_DOUBLE,
                            0, err);
    for (long i = 0; i < n && status == RX_OK; i++) {
        const rx_model_bin *b = &model->bins[i];
        const double values[] = {b->fwhm[0], b->fwhm[1], b->sigma[0], b->sigma[1], b->loss,
                                 b->list,    b->recall,  b->bias,     b->scatter};
        for (int c = 0; c < NBIN_COLUMNS - 1; c++)
            ((double *)table->columns[c].data)[i] = values[c];
        ((int64_t *)table->columns[NBIN_COLUMNS - 1].data)[i] = b->images;
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
    rx_status status = new_table("PROVENANCE", lines, 1, &table, err);
    if (status == RX_OK)
        status = set_column(table, 0, "LINE", RX_CELL_TEXT, (int)longest + 1, err);
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

/* --- header --- */

static int has_provenance(const rx_model *model)
{
    return model->provenance != NULL && model->provenance[0] != '\0';
}

static void add_cards(const rx_model *model, rx_text *dst)
{
    const rx_front *f = &model->front;
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
    rx_card_text(dst, "RXMODE", rx_mode_name(f->mode), "what the network is given");
    rx_card_number(dst, "RXTFWHM", f->target_fwhm, "[pix] FWHM of the output's Gaussian PSF");
    rx_card_number(dst, "RXTIKH", f->tikhonov, "regularisation of the deconvolved copy");
    rx_card_integer(dst, "RXRLSTEP", f->rl_steps, "Richardson-Lucy steps after each network");
    rx_card_number(dst, "RXPEDST", f->pedestal, "pedestal of that step, noise sigmas");
    rx_card_integer(dst, "RXNFWHM", model->bins != NULL ? model->nfwhm : 0, "bins of FWHM");
    rx_card_integer(dst, "RXNSIGMA", model->bins != NULL ? model->nsigma : 0, "bins of noise");
    rx_card_integer(dst, "RXEPOCHS", model->epochs, "epochs of training");
    rx_card_integer(dst, "RXBEST", model->best, "epoch of these parameters, the best one");
    rx_card_integer(dst, "RXENDED", model->ended, "1: the training has ended");
    rx_card_number(dst, "RXNFMAX", model->factor, "largest noise factor of the training");
    rx_card_number(dst, "RXTDARK", model->dark, "share of its images with dark structure");
    rx_card_integer(dst, "RXPATCHS", model->patches, "images seen in training");
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

enum { MAX_BINS = 10000, MAX_HDUS = 1000 };

typedef struct reader {
    const char *path;
    char *cards; /* of the primary header */
    long ncards;
    int version;
    rx_model *model;
} reader;

/* --- header --- */

static rx_status take_integer(const reader *r, const char *key, long low, long high, long *dst, rx_error *err)
{
    double value = NAN;
    if (!rx_cards_number(r->cards, r->ncards, key, &value) || value != floor(value) || value < (double)low ||
        value > (double)high)
        return rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "%s is missing or no integer from %ld to %ld; make the model again", key, low,
                           high);
    *dst = (long)value;
    return RX_OK;
}

static rx_status take_number(const reader *r, const char *key, double *dst, rx_error *err)
{
    if (!rx_cards_number(r->cards, r->ncards, key, dst))
        return rx_error_at(err, RX_INPUT, r->path, 0, 0, "%s is missing or no number; make the model again",
                           key);
    return RX_OK;
}

static rx_status take_mode(const reader *r, rx_mode *dst, rx_error *err)
{
    char text[32];
    rx_cards_text(r->cards, r->ncards, "RXMODE", text, sizeof text);
    for (int mode = RX_MODE_BLIND; mode <= RX_MODE_INFORMED; mode++)
        if (strcmp(text, rx_mode_name((rx_mode)mode)) == 0) {
            *dst = (rx_mode)mode;
            return RX_OK;
        }
    return rx_error_at(err, RX_INPUT, r->path, 0, 0,
                       "RXMODE is '%s', BLIND or INFORMED was expected; make the model again", text);
}

static rx_status take_seed(const reader *r, uint64_t *dst, rx_error *err)
{
    char text[32], *end;
    rx_cards_text(r->cards, r->ncards, "RXSEED", text, sizeof text);
    *dst = strtoull(text, &end, 10);
    if (end == text || *end != '\0')
        return rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "RXSEED is missing or no number; make the model again");
    return RX_OK;
}

static rx_status take_header(const reader *r, rx_error *err)
{
    rx_model *m = r->model;
    long nfwhm = 0, nsigma = 0, steps = 0, ended = 1;
    rx_cards_text(r->cards, r->ncards, "RXNAME", m->name, sizeof m->name);
    RX_TRY(take_mode(r, &m->front.mode, err));
    RX_TRY(take_number(r, "RXTFWHM", &m->front.target_fwhm, err));
    RX_TRY(take_number(r, "RXTIKH", &m->front.tikhonov, err));
    RX_TRY(take_number(r, "RXPEDST", &m->front.pedestal, err));
    RX_TRY(take_integer(r, "RXRLSTEP", 0, RX_FRONT_STEPS, &steps, err));
    RX_TRY(take_integer(r, "RXNFWHM", 0, MAX_BINS, &nfwhm, err));
    RX_TRY(take_integer(r, "RXNSIGMA", 0, MAX_BINS, &nsigma, err));
    RX_TRY(take_integer(r, "RXEPOCHS", 0, INT_MAX, &m->epochs, err));
    const int old = !rx_cards_number(r->cards, r->ncards, "RXENDED", &(double){0});
    m->best = m->epochs;
    if (!old)
        RX_TRY(take_integer(r, "RXBEST", 0, m->epochs, &m->best, err));
    if (!old)
        RX_TRY(take_integer(r, "RXENDED", 0, 1, &ended, err));
    RX_TRY(take_integer(r, "RXPATCHS", 0, LONG_MAX / 4096, &m->patches, err));
    RX_TRY(take_seed(r, &m->seed, err));
    if (rx_cards_number(r->cards, r->ncards, "RXNFMAX", &m->factor) &&
        !(m->factor >= 0.1 && m->factor <= 1e3))
        RX_TRY(rx_error_at(
            err, RX_INPUT, r->path, 0, 0,
            "RXNFMAX is %g, a noise factor from 0.1 to 1000 was expected; make the model again", m->factor));
    if (rx_cards_number(r->cards, r->ncards, "RXTDARK", &m->dark) && !(m->dark >= 0.0 && m->dark <= 1.0))
        RX_TRY(rx_error_at(err, RX_INPUT, r->path, 0, 0,
                           "RXTDARK is %g, a share from 0 to 1 was expected; make the model again", m->dark));
    m->front.rl_steps = (int)steps;
    m->ended = (int)ended;
    m->nfwhm = (int)nfwhm;
    m->nsigma = (int)nsigma;
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

/* A table of named columns, numbers or text as each letter of `kinds` says: T, I: integer, F: float, D: any number. */
typedef struct columns {
    const char *extname;
    const char *const *names;
    const char *kinds;
    int needed; /* 0: may be absent */
} columns;

/* *dst NULL when it is not there and may be absent. */
static rx_status read_columns(const reader *r, columns c, rx_table **dst, int *hdu, rx_error *err)
{
    const char *extname = c.extname;
    rx_status status = rx_fits_read_named(r->path, extname, dst, hdu, err);
    if (status != RX_OK || (*dst == NULL && !c.needed))
        return status;
    if (*dst == NULL)
        return rx_error_at(err, RX_INPUT, r->path, -1, 0, "has no table %s; make the model again", extname);
    for (int i = 0; c.kinds[i] != '\0'; i++) {
        const rx_column *column = i < (*dst)->ncolumns ? &(*dst)->columns[i] : NULL;
        int fits = column != NULL && strcmp(column->name, c.names[i]) == 0 && column->ndim == 0;
        if (fits && c.kinds[i] == 'T')
            fits = column->type == RX_CELL_TEXT;
        else if (fits && c.kinds[i] == 'I')
            fits = column->type == RX_CELL_INT32;
        else if (fits && c.kinds[i] == 'F')
            fits = column->type == RX_CELL_FLOAT;
        else if (fits)
            fits = column->type == RX_CELL_DOUBLE || column->type == RX_CELL_INT64;
        if (!fits)
            return rx_error_at(err, RX_INPUT, r->path, *hdu, 0,
                               "column %d of %s is not what a model has there (%s); make the model again",
                               i + 1, extname, c.names[i]);
    }
    return RX_OK;
}

static int cell(const rx_table *table, int column, long row)
{
    return ((const int32_t *)table->columns[column].data)[row];
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
        nodes[i] = (rx_node){.op = (rx_op)op,
                             .src = cell(table, 1, i),
                             .add = cell(table, 2, i),
                             .relu = cell(table, 3, i),
                             .channels = cell(table, 4, i),
                             .kernel = cell(table, 5, i),
                             .stride = cell(table, 6, i)};
    }
    return RX_OK;
}

/* Weights of the convolutions alone, so that a list that asks for far more memory than the file has numbers
 * is never laid out. */
static double least_parameters(const rx_node *nodes, long n)
{
    double sum = 0;
    for (long i = 1; i < n; i++)
        if ((nodes[i].op == RX_OP_CONV || nodes[i].op == RX_OP_TRANSPOSED) && nodes[i].src >= 0 &&
            nodes[i].src < i)
            sum +=
                (double)nodes[i].kernel * nodes[i].kernel * nodes[i].channels * nodes[nodes[i].src].channels;
        else if (nodes[i].op == RX_OP_UPCONV && nodes[i].src >= 0 && nodes[i].src < i)
            sum += 9.0 * nodes[i].channels * nodes[nodes[i].src].channels;
    return sum;
}

static rx_status wrong_count(const reader *r, int hdu, double need, long found, rx_error *err)
{
    return rx_error_at(err, RX_INPUT, r->path, hdu, 0,
                       "the network needs %.0f parameters, the table has %ld; make the model again", need,
                       found);
}

static rx_status make_net(const reader *r, const rx_table *nodes, int hdu, const rx_table *params,
                          int params_hdu, rx_net **dst, rx_error *err)
{
    rx_node list[RX_NET_NODES];
    rx_error why = rx_error_part(err);
    const float *values = params->columns[0].data;
    RX_TRY(take_nodes(r, nodes, hdu, list, err));
    double least = least_parameters(list, nodes->nrows);
    if (least > (double)params->nrows)
        return wrong_count(r, params_hdu, least, params->nrows, err);
    rx_status status = rx_net_new(list, (int)nodes->nrows, dst, &why);
    if (status == RX_INPUT)
        return rx_error_at(err, RX_INPUT, r->path, hdu, 0, "its nodes make no network: %s", why.text);
    if (status != RX_OK) {
        rx_error_take(err, &why);
        return status;
    }
    if ((*dst)->nparams != params->nrows)
        return wrong_count(r, params_hdu, (double)(*dst)->nparams, params->nrows, err);
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
    static const char *const value[] = {"VALUE"};
    char extname[40];
    rx_table *nodes = NULL, *params = NULL;
    int hdu = -1, params_hdu = -1;
    snprintf(extname, sizeof extname, "%s_NODES", name);
    rx_status status =
        read_columns(r, (columns){extname, node_columns, "TIIIIII", needed}, &nodes, &hdu, err);
    if (status == RX_OK && nodes != NULL) {
        snprintf(extname, sizeof extname, "%s_PARAMS", name);
        status = read_columns(r, (columns){extname, value, "F", 1}, &params, &params_hdu, err);
        if (status == RX_OK)
            status = make_net(r, nodes, hdu, params, params_hdu, dst, err);
    }
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
    int hdu = -1, needed = m->nfwhm > 0 && m->nsigma > 0;
    rx_status status =
        read_columns(r, (columns){"DICTIONARY", bin_columns, "DDDDDDDDDD", needed}, &table, &hdu, err);
    if (status != RX_OK || table == NULL)
        goto exit;
    if (table->nrows != (long)m->nfwhm * m->nsigma) {
        status = rx_error_at(err, RX_INPUT, r->path, hdu, 0,
                             "the dictionary has %ld bins, the header says %d x %d; make the model again",
                             table->nrows, m->nfwhm, m->nsigma);
        goto exit;
    }
    RX_TRY_EXIT(RX_MAKE(m->bins, (size_t)table->nrows, err));
    for (long i = 0; i < table->nrows; i++) {
        double v[NBIN_COLUMNS];
        for (int c = 0; c < NBIN_COLUMNS; c++)
            v[c] = rx_column_value(&table->columns[c], i, 0);
        m->bins[i] = (rx_model_bin){.fwhm = {v[0], v[1]},
                                    .sigma = {v[2], v[3]},
                                    .loss = v[4],
                                    .list = v[5],
                                    .recall = v[6],
                                    .bias = v[7],
                                    .scatter = v[8],
                                    .images = v[9] >= 0 && v[9] < 1e15 ? (long)v[9] : 0};
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
    static const char *const name[] = {"LINE"};
    rx_table *table = NULL;
    rx_text text = {0};
    int hdu = -1;
    rx_status status = read_columns(r, (columns){"PROVENANCE", name, "T", 0}, &table, &hdu, err);
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
