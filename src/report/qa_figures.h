/* The figures of the QA report, "plot-...", "picture..." and "psf-...". Those without any data are left out. */
#ifndef RX_REPORT_QA_FIGURES_H
#define RX_REPORT_QA_FIGURES_H

#include "quality/qa_numbers.h"
#include "report/figure.h"

void rx_qa_figures(rx_figures *dst, const rx_qa_numbers *numbers);

/* What stars say of the PSF; nothing where none does. */
void rx_qa_psf_figures(rx_figures *dst, const rx_qa_numbers *numbers);

#endif
