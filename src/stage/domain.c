/* A tile against the dictionary of the network's model. */
#include "stage/domain.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/map.h"

rx_status rx_domain_noise(const rx_field *field, double *noise, rx_error *err)
{
    const rx_tile *tile = field->tile;
    const rx_background *sky = field->restored;
    size_t n = (size_t)tile->width * (size_t)tile->height, good = 0;
    *noise = field->model_noise;
    if (field->model_noise > 0.0)
        return RX_OK;
    const rx_map level = rx_background_level(sky), deviation = rx_background_noise(sky);
    const size_t width = (size_t)tile->width;
    float *above = RX_NEW(float, n), *rows = RX_NEW(float, 2 * width);
    rx_status status = RX_OK;
    if (above == NULL || rows == NULL) {
        status = rx_error_memory(err, (n + 2 * width) * sizeof(float));
        goto exit;
    }
    for (int y = 0; y < tile->height; y++) {
        const size_t row = (size_t)y * width;
        const float *sigma = rx_map_row(&deviation, y, 0, tile->width, rows),
                    *base = rx_map_row(&level, y, 0, tile->width, rows + width);
        for (size_t x = 0; x < width; x++)
            if ((tile->mask[row + x] & RX_HIDE_RESTORED) == 0 && sigma[x] > 0.0f)
                above[good++] = (tile->pixels[row + x] - base[x]) / sigma[x];
    }
    *noise = rx_model_noise(above, good);
exit:
    free(above);
    free(rows);
    return status;
}

/* "the network was trained for FWHM 2 to 8 pixels and noise 1 to 15", or that the model does not say. */
static void add_grid(const rx_model *model, rx_text *dst)
{
    if (model->bins == NULL) {
        rx_text_add(dst, "the model does not say what it was trained for");
        return;
    }
    const rx_model_bin *first = model->bins, *last = first + (long)model->nfwhm * model->nsigma - 1;
    rx_text_printf(dst, "the network was trained for FWHM %.4g to %.4g pixels and noise %.4g to %.4g",
                   first->fwhm[0], last->fwhm[1], first->sigma[0], last->sigma[1]);
}

/* A PSF that is narrower than the network's own output by so much leaves nothing to restore: its
 * deconvolution would be a blur, which the network and its steps turn into noise (undersampled tiles of 0.6
 * to 1.5 pixels). */
static const double NARROW = 0.9;

static rx_status leave(const rx_restore_params *par, const rx_field *field, rx_log *log,
                       const rx_restorer **kind, rx_domain *dst, rx_error *err)
{
    const rx_tile *tile = field->tile;
    rx_text grid = {0};
    rx_status status = RX_OK;
    add_grid(dst->model, &grid);
    if (grid.failed) {
        rx_text_free(&grid);
        return rx_error_memory(err, 0);
    }
    switch (par->out_of_domain) {
    case RX_DOMAIN_FAIL:
        status = rx_error_at(err, RX_NOT_RESTORED, tile->name, tile->hdu, 0,
                             "%s, %s; take RESTORE_TYPE RL, another NET_MODEL, or "
                             "OUT_OF_DOMAIN WARN or RL",
                             dst->why, grid.data);
        break;
    case RX_DOMAIN_RL:
        *kind = rx_restorer_find("RL");
        break;
    case RX_DOMAIN_WARN:
        if (dst->fwhm < NARROW * dst->model->front.target_fwhm) { /* not for what the grid lacks */
            snprintf(dst->why, sizeof dst->why,
                     "FWHM %.4g pixels is below %.4g, %.4g of the network's output", dst->fwhm,
                     NARROW * dst->model->front.target_fwhm, NARROW);
            *kind = rx_restorer_find("RL");
            break;
        }
        rx_log_warning(log, "%s[%d]: %s, %s; how well it does here is not known", tile->name, tile->hdu,
                       dst->why, grid.data);
        break;
    }
    rx_text_free(&grid);
    return status;
}

rx_status rx_domain_obey(const rx_restore_params *par, const rx_field *field, rx_log *log,
                         const rx_restorer **kind, rx_domain *dst, rx_error *err)
{
    *dst = (rx_domain){.fwhm = NAN, .noise = NAN};
    if (strcmp((*kind)->name, "NET") != 0 || par->model == NULL)
        return RX_OK;
    dst->model = par->model;
    dst->place = RX_DOMAIN_UNKNOWN;
    rx_status status = rx_domain_noise(field, &dst->noise, err);
    if (status != RX_OK)
        return status;
    if (field->psf == NULL) {
        snprintf(dst->why, sizeof dst->why, "the FWHM of the tile is not known");
        return RX_OK;
    }
    dst->fwhm = field->psf->fwhm;
    dst->bin = rx_model_find(par->model, dst->fwhm, dst->noise, dst->why, sizeof dst->why);
    dst->place = dst->bin != NULL ? RX_DOMAIN_INSIDE : RX_DOMAIN_OUTSIDE;
    return dst->bin != NULL ? RX_OK : leave(par, field, log, kind, dst, err);
}

/* --- telling --- */

static void add_fact(rx_record *facts, const char *name, const char *comment, const char *format,
                     double value)
{
    char text[40];
    if (!isfinite(value))
        return;
    snprintf(text, sizeof text, format, value);
    rx_record_add(facts, name, comment, "%s", text);
}

void rx_domain_facts(const rx_domain *domain, rx_record *facts)
{
    const rx_model_bin *bin = domain->bin;
    if (domain->place == RX_DOMAIN_NONE)
        return;
    rx_record_add(facts, "RXNETMOD", "model of the network", "%s", domain->model->name);
    rx_record_add(facts, "RXNETSUM", "its digest", "%s", domain->model->digest);
    if (!domain->model->ended)
        rx_record_add(facts, "RXNETEND", "has its training ended?", "F");
    add_fact(facts, "RXNETFW", "FWHM of this tile, pixels", "%.4f", domain->fwhm);
    add_fact(facts, "RXNETNOI", "its noise on the scale of the model", "%.4f", domain->noise);
    if (domain->place != RX_DOMAIN_UNKNOWN)
        rx_record_add(facts, "RXNETIN", "the model was trained for these", "%s", bin != NULL ? "T" : "F");
    if (bin == NULL) {
        rx_record_add(facts, "RXNETWHY", "why nothing is promised", "%s", domain->why);
        return;
    }
    add_fact(facts, "RXNETLOS", "its mean test loss there", "%.6g", bin->loss);
    add_fact(facts, "RXNETREC", "recall of test stars, S/N > 5", "%.4f", bin->recall);
    add_fact(facts, "RXNETBIA", "flux bias of test stars, S/N > 12", "%.5f", bin->bias);
    add_fact(facts, "RXNETSCA", "flux scatter of test stars, S/N > 12", "%.5f", bin->scatter);
}

static void add_promise(rx_text *dst, const char *what, double value, double factor, const char *unit)
{
    if (isfinite(value))
        rx_text_printf(dst, ", %s %.3g%s", what, factor * value, unit);
}

void rx_domain_text(const rx_domain *domain, rx_text *dst)
{
    const rx_model_bin *bin = domain->bin;
    if (domain->place == RX_DOMAIN_NONE)
        return;
    rx_text_printf(dst, "model %s (%s%s)", domain->model->name, domain->model->digest,
                   domain->model->ended ? "" : ", training not ended");
    if (bin == NULL) {
        rx_text_printf(dst, " promises nothing here: %s", domain->why);
        return;
    }
    rx_text_printf(dst, " at FWHM %.2f pixels and noise %.2f promises a loss of %.4g", domain->fwhm,
                   domain->noise, bin->loss);
    add_promise(dst, "recall", bin->recall, 1, "");
    add_promise(dst, "flux bias", bin->bias, 100, " %");
    add_promise(dst, "scatter", bin->scatter, 100, " %");
}

const rx_qa_promise *rx_domain_promise(const rx_domain *domain, rx_qa_promise *dst)
{
    const rx_model_bin *bin = domain->bin;
    if (domain->place == RX_DOMAIN_NONE)
        return NULL;
    *dst = (rx_qa_promise){.model = domain->model->name,
                           .digest = domain->model->digest,
                           .why = domain->why,
                           .unfinished = !domain->model->ended,
                           .fwhm = domain->fwhm,
                           .noise = domain->noise,
                           .inside = bin != NULL,
                           .loss = bin != NULL ? bin->loss : NAN,
                           .recall = bin != NULL ? bin->recall : NAN,
                           .bias = bin != NULL ? 100 * bin->bias : NAN,
                           .scatter = bin != NULL ? 100 * bin->scatter : NAN};
    if (bin != NULL) {
        memcpy(dst->fwhm_bin, bin->fwhm, sizeof dst->fwhm_bin);
        memcpy(dst->noise_bin, bin->sigma, sizeof dst->noise_bin);
    }
    return dst;
}
