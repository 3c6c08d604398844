/* The paper's printed numbers. */
#include "lab/paper.h"

#include <math.h>

#include "num/special.h"

const rx_paper_table rx_paper_tables[RX_PAPER_TABLES] = {
    {1,
     0,
     1,
     138,
     7,
     {2, 4, 6, 8, 10, 12, 14},
     {17.97, 20.46, 17.57, 20.27, 20.76, 18.79, 24.56},
     {5.96e-38, 1.23e-43, 5.08e-37, 3.40e-43, 2.72e-44, 7.41e-40, 3.21e-52}},
    {2,
     0,
     0,
     138,
     7,
     {2, 4, 6, 8, 10, 12, 14},
     {49.69, 73.94, 56.31, 75.21, 76.49, 68.05, 110.96},
     {6.02e-90, 6.82e-113, 4.29e-97, 6.88e-114, 7.09e-115, 4.77e-108, 8.31e-137}},
    {3,
     1,
     1,
     78,
     8,
     {2, 9, 12, 15, 18, 21, 23, 25},
     {1.70, 17.81, 26.46, 32.40, 32.12, 40.43, 40.60, 43.98},
     {4.88e-02, 3.25e-29, 1.05e-40, 5.35e-47, 1.00e-46, 4.40e-54, 3.24e-54, 1.63e-54}},
    {4,
     1,
     0,
     78,
     8,
     {2, 9, 12, 15, 18, 21, 23, 25},
     {6.66, 34.76, 42.52, 39.62, 43.38, 50.09, 47.96, 59.78},
     {3.52e-09, 3.11e-49, 1.02e-55, 1.98e-53, 2.27e-56, 4.52e-61, 1.19e-59, 6.52e-67}},
};

int rx_paper_column_fits(const rx_paper_table *table, int column, double *p, double *ln_p)
{
    const double digits = log1p(0.005), printed = log(table->p[column]); /* 1.00 may stand for 1.005 */
    double most, least;
    *p = rx_student_p(table->t[column], table->dof, ln_p);
    rx_student_p(table->t[column] - 0.005, table->dof, &most);
    rx_student_p(table->t[column] + 0.005, table->dof, &least);
    return printed >= least - digits && printed <= most + digits;
}
