/* Least squares of models that are not linear, through GSL; the only place where GSL's fitting is called.
 *
 * GSL's default error handler aborts the program. It is switched off at the start of each
 * call here and stays off for the whole process (a handler cannot be had per thread, and putting
 * the old one back would expose other threads); failures come back as a status instead.
 */
#ifndef RX_NUM_LSQ_H
#define RX_NUM_LSQ_H

#include <stddef.h>

#include "base/error.h"

/* residuals[i] = (model_i(parameters) - data_i) / sigma_i; jacobian [n][p] = d residuals_i / d
 * parameter_j. Returns 0, or 1 where the model cannot be evaluated. */
typedef int (*rx_lsq_model)(void *user, const double *parameters, double *residuals, double *jacobian);

typedef struct rx_lsq_problem {
    size_t nresiduals, nparameters;
    rx_lsq_model model;
    void *user;
    int max_iterations;
    double tolerance; /* relative step that counts as converged */
} rx_lsq_problem;

typedef struct rx_lsq_result {
    int converged; /* 0: ran out of iterations or could not go on; parameters are the best so far */
    int iterations;
    double chi2; /* sum of residuals^2 */
} rx_lsq_result;

/* Levenberg-Marquardt (GSL's multifit_nlinear, QR) from `parameters` on, which are replaced by the
 * best fit. errors [nparameters] (may be NULL): 1 sigma from the inverse of J^T J; HUGE_VAL where it
 * is singular. Errors: RX_SYSTEM memory, RX_INPUT when the model fails at the start or there are fewer
 * residuals than parameters. */
rx_status rx_lsq_fit(const rx_lsq_problem *problem, double *parameters, double *errors, rx_lsq_result *result,
                     rx_error *err);

/* Version of the library (GSL). */
const char *rx_lsq_library(void);

#endif
