/* The model's promise in words and cards. */
#include "stage/domain_facts.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

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
    add_fact(facts, "RXNETNOI", "its noise level: 255 / brightness", "%.4f", domain->noise);
    add_fact(facts, "RXNETFAC", "largest noise factor (RXNFACT) it is known for", "%.2f",
             rx_model_factor(domain->model));
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
