/* The model's promise in words and cards. */
#include "stage/domain_facts.h"

#include <math.h>
#include <string.h>

#include "data/facts.h"

void rx_domain_facts(const rx_domain *domain, rx_record *facts)
{
    const rx_model_bin *bin = domain->bin;
    if (domain->place == RX_DOMAIN_NONE)
        return;
    rx_fact_text(facts, RX_FACT_NETMOD, domain->model->name);
    rx_fact_text(facts, RX_FACT_NETSUM, domain->model->digest);
    if (!domain->model->ended)
        rx_fact_text(facts, RX_FACT_NETEND, "F");
    rx_fact_number(facts, RX_FACT_NETFW, domain->fwhm);
    rx_fact_number(facts, RX_FACT_NETNOI, domain->noise);
    rx_fact_number(facts, RX_FACT_NETFAC, rx_model_factor(domain->model));
    if (domain->place != RX_DOMAIN_UNKNOWN)
        rx_fact_flag(facts, RX_FACT_NETIN, bin != NULL);
    if (bin == NULL) {
        rx_fact_text(facts, RX_FACT_NETWHY, domain->why);
        return;
    }
    rx_fact_number(facts, RX_FACT_NETLOS, bin->loss);
    rx_fact_number(facts, RX_FACT_NETREC, bin->recall);
    rx_fact_number(facts, RX_FACT_NETBIA, bin->bias);
    rx_fact_number(facts, RX_FACT_NETSCA, bin->scatter);
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
