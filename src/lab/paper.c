/* The paper's printed numbers. */
#include "lab/paper.h"

#include <math.h>
#include <stddef.h>

#include "num/special.h"

static const rx_paper_table tables[RX_PAPER_TABLES] = {
    {.number = 1,
     .by_sigma = 0,
     .ssim = 1,
     .dof = 138,
     .n = 7,
     .column = {{2, 17.97, 5.96e-38},
                {4, 20.46, 1.23e-43},
                {6, 17.57, 5.08e-37},
                {8, 20.27, 3.40e-43},
                {10, 20.76, 2.72e-44},
                {12, 18.79, 7.41e-40},
                {14, 24.56, 3.21e-52}}},
    {.number = 2,
     .by_sigma = 0,
     .ssim = 0,
     .dof = 138,
     .n = 7,
     .column = {{2, 49.69, 6.02e-90},
                {4, 73.94, 6.82e-113},
                {6, 56.31, 4.29e-97},
                {8, 75.21, 6.88e-114},
                {10, 76.49, 7.09e-115},
                {12, 68.05, 4.77e-108},
                {14, 110.96, 8.31e-137}}},
    {.number = 3,
     .by_sigma = 1,
     .ssim = 1,
     .dof = 78,
     .n = 8,
     .column = {{2, 1.70, 4.88e-02},
                {9, 17.81, 3.25e-29},
                {12, 26.46, 1.05e-40},
                {15, 32.40, 5.35e-47},
                {18, 32.12, 1.00e-46},
                {21, 40.43, 4.40e-54},
                {23, 40.60, 3.24e-54},
                {25, 43.98, 1.63e-54}}},
    {.number = 4,
     .by_sigma = 1,
     .ssim = 0,
     .dof = 78,
     .n = 8,
     .column = {{2, 6.66, 3.52e-09},
                {9, 34.76, 3.11e-49},
                {12, 42.52, 1.02e-55},
                {15, 39.62, 1.98e-53},
                {18, 43.38, 2.27e-56},
                {21, 50.09, 4.52e-61},
                {23, 47.96, 1.19e-59},
                {25, 59.78, 6.52e-67}}},
};

const rx_paper_table *rx_paper_table_get(int i)
{
    return &tables[i];
}

const rx_paper_column *rx_paper_column_at(const rx_paper_table *table, double centre)
{
    for (int i = 0; i < table->n; i++)
        if (fabs(table->column[i].bin - centre) < 0.25)
            return &table->column[i];
    return NULL;
}

int rx_paper_column_fits(const rx_paper_table *table, const rx_paper_column *column, double *p, double *ln_p)
{
    double most, least, digits = log1p(0.005); /* 1.00 may stand for 1.005 */
    *p = rx_student_p(column->t, table->dof, ln_p);
    rx_student_p(column->t - 0.005, table->dof, &most);
    rx_student_p(column->t + 0.005, table->dof, &least);
    double printed = log(column->p);
    return printed >= least - digits && printed <= most + digits;
}
