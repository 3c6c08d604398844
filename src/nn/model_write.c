/* Models into FITS files. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "io/fits_write.h"
#include "nn/model_parts.h"

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
    static const char *const names[] = RX_MODEL_NODE_COLUMNS;
    rx_status status = new_table(name, net->nnodes, RX_MODEL_NNODE_COLUMNS, dst, err);
    for (int c = 0; c < RX_MODEL_NNODE_COLUMNS && status == RX_OK; c++)
        status = set_column(*dst, c, names[c], c == 0 ? RX_CELL_TEXT : RX_CELL_INT32,
                            c == 0 ? RX_MODEL_OP_WIDTH : 0, err);
    for (int i = 0; i < net->nnodes && status == RX_OK; i++) {
        const rx_node *n = &net->node[i];
        const int values[] = {0, n->src, n->add, n->relu, n->channels, n->kernel, n->stride};
        snprintf((char *)(*dst)->columns[0].data + (size_t)i * RX_MODEL_OP_WIDTH, RX_MODEL_OP_WIDTH, "%s",
                 rx_op_name(n->op));
        for (int c = 1; c < RX_MODEL_NNODE_COLUMNS; c++)
            ((int32_t *)(*dst)->columns[c].data)[i] = values[c];
    }
    return status;
}

static rx_status write_net(rx_fits_writer *writer, const rx_net *net, const char *name, rx_error *err)
{
    char extname[40];
    rx_table *nodes = NULL, *params = NULL;
    snprintf(extname, sizeof extname, "%s_NODES", name);
    rx_status status = nodes_table(net, extname, &nodes, err);
    if (status == RX_OK)
        status = rx_fits_table(writer, nodes, NULL, 0, err);
    snprintf(extname, sizeof extname, "%s_PARAMS", name);
    if (status == RX_OK)
        status = new_table(extname, net->nparams, 1, &params, err);
    if (status == RX_OK)
        status = set_column(params, 0, "VALUE", RX_CELL_FLOAT, 0, err);
    if (status == RX_OK) {
        memcpy(params->columns[0].data, net->params, (size_t)net->nparams * sizeof(float));
        status = rx_fits_table(writer, params, NULL, 0, err);
    }
    rx_table_free(nodes);
    rx_table_free(params);
    return status;
}

/* --- dictionary, provenance --- */

static rx_status write_bins(rx_fits_writer *writer, const rx_model *model, rx_error *err)
{
    static const char *const names[] = RX_MODEL_BIN_COLUMNS;
    rx_table *table = NULL;
    long n = (long)model->nfwhm * model->nsigma;
    rx_status status = new_table("DICTIONARY", n, RX_MODEL_NBIN_COLUMNS, &table, err);
    for (int c = 0; c < RX_MODEL_NBIN_COLUMNS && status == RX_OK; c++)
        status = set_column(table, c, names[c],
                            c == RX_MODEL_NBIN_COLUMNS - 1 ? RX_CELL_INT64 : RX_CELL_DOUBLE, 0, err);
    for (long i = 0; i < n && status == RX_OK; i++) {
        const rx_model_bin *b = &model->bins[i];
        const double values[] = {b->fwhm[0], b->fwhm[1], b->sigma[0], b->sigma[1], b->loss,
                                 b->list,    b->recall,  b->bias,     b->scatter};
        for (int c = 0; c < RX_MODEL_NBIN_COLUMNS - 1; c++)
            ((double *)table->columns[c].data)[i] = values[c];
        ((int64_t *)table->columns[RX_MODEL_NBIN_COLUMNS - 1].data)[i] = b->images;
    }
    if (status == RX_OK)
        status = rx_fits_table(writer, table, NULL, 0, err);
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
        status = rx_fits_table(writer, table, NULL, 0, err);
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
    int tables = 2 + 2 * (model->psf != NULL) + (model->bins != NULL) + has_provenance(model);
    rx_model_digest(model, digest);
    snprintf(seed, sizeof seed, "%" PRIu64, model->seed);
    rx_card_integer(dst, "RXMODEL", RX_MODEL_VERSION, "version of the model format");
    rx_card_integer(dst, "NEXTEND", tables, "number of tables that follow");
    rx_card_text(dst, "RXNAME", model->name, "name");
    rx_card_text(dst, "RXDIGEST", digest, "of front, nodes and parameters");
    rx_card_text(dst, "RXMODE", rx_mode_name(f->mode), "what the network is given");
    rx_card_number(dst, "RXTFWHM", f->target_fwhm, "[pix] FWHM of the output's Gaussian PSF");
    rx_card_number(dst, "RXTIKH", f->tikhonov, "regularisation of the deconvolved copy");
    rx_card_integer(dst, "RXRLSTEP", f->rl_steps, "Richardson-Lucy steps after the network");
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
    if (model->restore == NULL || rx_model_fault(model, fault, sizeof fault) != NULL)
        return rx_error_at(err, RX_SYSTEM, shown, -1, 0, "the model cannot be written: %s",
                           model->restore == NULL ? "it has no network" : fault);
    add_cards(model, &cards);
    rx_status status = cards.failed ? rx_error_memory(err, cards.length) : RX_OK;
    if (status == RX_OK)
        status = rx_fits_create(path, shown, &writer, err);
    if (status == RX_OK)
        status = rx_fits_primary(writer, cards.data, cards.length / CARD, err);
    if (status == RX_OK)
        status = write_net(writer, model->restore, "RESTORE", err);
    if (status == RX_OK && model->psf != NULL)
        status = write_net(writer, model->psf, "PSF", err);
    if (status == RX_OK && model->bins != NULL)
        status = write_bins(writer, model, err);
    if (status == RX_OK && has_provenance(model))
        status = write_provenance(writer, model->provenance, err);
    rx_text_free(&cards);
    if (status != RX_OK) {
        rx_fits_abort(writer);
        return status;
    }
    return rx_fits_close(writer, err);
}
