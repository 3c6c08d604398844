/* Levenberg and Marquardt by GSL. */
#include "num/lsq.h"

#include <math.h>
#include <stdlib.h>

#include <gsl/gsl_blas.h>
#include <gsl/gsl_errno.h>
#include <gsl/gsl_multifit_nlinear.h>
#include <gsl/gsl_version.h>

#include "base/memory.h"

/* What GSL's callbacks carry around: our problem and plain arrays to talk to its model in. */
typedef struct bridge {
    const rx_lsq_problem *problem;
    double *parameters, *residuals, *jacobian;
    int known; /* residuals and jacobian are those of the parameters */
} bridge;

/* Both at once: GSL asks for the jacobian where it has just liked the residuals. */
static int evaluate(const gsl_vector *x, bridge *b)
{
    int same = b->known;
    for (size_t j = 0; j < b->problem->nparameters; j++) {
        same = same && b->parameters[j] == gsl_vector_get(x, j);
        b->parameters[j] = gsl_vector_get(x, j);
    }
    b->known = same || b->problem->model(b->problem->user, b->parameters, b->residuals, b->jacobian) == 0;
    return !b->known;
}

static int bridge_f(const gsl_vector *x, void *params, gsl_vector *f)
{
    bridge *b = params;
    if (evaluate(x, b) != 0)
        return GSL_EBADFUNC;
    for (size_t i = 0; i < b->problem->nresiduals; i++)
        gsl_vector_set(f, i, b->residuals[i]);
    return GSL_SUCCESS;
}

static int bridge_df(const gsl_vector *x, void *params, gsl_matrix *jacobian)
{
    bridge *b = params;
    if (evaluate(x, b) != 0)
        return GSL_EBADFUNC;
    size_t n = b->problem->nresiduals, p = b->problem->nparameters;
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < p; j++)
            gsl_matrix_set(jacobian, i, j, b->jacobian[i * p + j]);
    return GSL_SUCCESS;
}

/* Square roots of the diagonal of (J^T J)^-1. */
static rx_status fit_errors(gsl_multifit_nlinear_workspace *work, size_t p, double *errors, rx_error *err)
{
    gsl_matrix *cov = gsl_matrix_alloc(p, p);
    if (cov == NULL)
        return rx_error_memory(err, p * p * sizeof(double));
    int code = gsl_multifit_nlinear_covar(gsl_multifit_nlinear_jac(work), 1e-12, cov);
    for (size_t j = 0; j < p; j++) {
        double variance = code == GSL_SUCCESS ? gsl_matrix_get(cov, j, j) : 0.0;
        errors[j] = variance > 0.0 && isfinite(variance) ? sqrt(variance) : HUGE_VAL;
    }
    gsl_matrix_free(cov);
    return RX_OK;
}

/* Step until the relative step falls below the tolerance. A step that fails ends the fit without
 * convergence: the position of the last good one stands. */
static void iterate(const rx_lsq_problem *problem, gsl_multifit_nlinear_workspace *work,
                    rx_lsq_result *result)
{
    const double tolerance = problem->tolerance;
    double chi2;
    gsl_blas_ddot(gsl_multifit_nlinear_residual(work), gsl_multifit_nlinear_residual(work), &chi2);
    *result = (rx_lsq_result){.converged = chi2 == 0.0, .chi2 = chi2};
    int still = 0; /* steps in a row that hardly changed chi2: parameters near 0 never pass the step test */
    while (result->iterations < problem->max_iterations && !result->converged) {
        double before = chi2;
        int code = gsl_multifit_nlinear_iterate(work);
        result->iterations++;
        gsl_blas_ddot(gsl_multifit_nlinear_residual(work), gsl_multifit_nlinear_residual(work), &chi2);
        still = fabs(before - chi2) <= tolerance * chi2 ? still + 1 : 0;
        int info = 0;
        int test = gsl_multifit_nlinear_test(tolerance, tolerance * tolerance, 0.0, &info, work);
        /* GSL_ENOPROG: no step lowers chi2 any more, which at the bottom of the valley is rounding */
        if (code == GSL_ENOPROG)
            result->converged = test == GSL_SUCCESS || fabs(before - chi2) <= 1e-10 * before;
        else if (code == GSL_SUCCESS)
            result->converged = test == GSL_SUCCESS || chi2 == 0.0 || still >= 2;
        if (code != GSL_SUCCESS)
            break;
    }
    result->chi2 = chi2;
}

rx_status rx_lsq_fit(const rx_lsq_problem *problem, double *parameters, double *errors, rx_lsq_result *result,
                     rx_error *err)
{
    size_t n = problem->nresiduals, p = problem->nparameters;
    rx_status status = RX_OK;
    if (p == 0 || n < p)
        return rx_error_set(err, RX_INPUT, "%zu values cannot fix %zu parameters", n, p);
    gsl_set_error_handler_off();
    gsl_multifit_nlinear_parameters settings = gsl_multifit_nlinear_default_parameters();
    gsl_multifit_nlinear_workspace *work =
        gsl_multifit_nlinear_alloc(gsl_multifit_nlinear_trust, &settings, n, p);
    bridge b = {.problem = problem,
                .parameters = RX_NEW(double, p),
                .residuals = RX_NEW(double, n),
                .jacobian = rx_alloc(n, p * sizeof(double))};
    rx_lsq_result local;
    if (work == NULL || b.parameters == NULL || b.residuals == NULL || b.jacobian == NULL)
        RX_TRY_EXIT(rx_error_memory(err, n * p * sizeof(double)));
    gsl_multifit_nlinear_fdf fdf = {.f = bridge_f, .df = bridge_df, .n = n, .p = p, .params = &b};
    gsl_vector_view start = gsl_vector_view_array(parameters, p);
    int code = gsl_multifit_nlinear_init(&start.vector, &fdf, work);
    if (code != GSL_SUCCESS)
        RX_TRY_EXIT(rx_error_set(err, RX_INPUT, "the fit cannot start: %s", gsl_strerror(code)));
    iterate(problem, work, result != NULL ? result : &local);
    for (size_t j = 0; j < p; j++)
        parameters[j] = gsl_vector_get(gsl_multifit_nlinear_position(work), j);
    if (errors != NULL)
        status = fit_errors(work, p, errors, err);
exit:
    free(b.parameters);
    free(b.residuals);
    free(b.jacobian);
    gsl_multifit_nlinear_free(work);
    return status;
}

const char *rx_lsq_library(void)
{
    return gsl_version;
}
