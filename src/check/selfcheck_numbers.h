/* The numbers of a self check, from its lists. */
#ifndef RX_CHECK_SELFCHECK_NUMBERS_H
#define RX_CHECK_SELFCHECK_NUMBERS_H

#include "base/error.h"
#include "check/selfcheck_plan.h"
#include "quality/qa.h"

/* Make room for n rows: positions, magnitudes and fluxes, and, when `measured` is not NULL, score, flags and
 * *measured, too. New rows are not set; alpha and delta stay NULL. */
rx_status rx_selfcheck_grow(rx_qa_list *list, rx_selfcheck_found **measured, long n, rx_error *err);

/* Fill the numbers of `check` from its lists. Errors: RX_SYSTEM. */
rx_status rx_selfcheck_measure(const rx_selfcheck_plan *plan, rx_selfcheck *check, rx_error *err);

/* The lists as quality/ takes them: truth, one run of that name; nothing is copied. */
void rx_selfcheck_input(const rx_selfcheck_plan *plan, const rx_selfcheck *check, const char *name,
                        rx_qa_input *input, rx_qa_run *run);
rx_qa_params rx_selfcheck_qa(const rx_selfcheck_plan *plan);

#endif
