/* Lists of sources to compare. */
#include "quality/qa.h"

#include <stdlib.h>

#include "base/memory.h"

rx_status rx_qa_list_new(rx_qa_list *list, long n, int with_flags, rx_error *err)
{
    const size_t rows = (size_t)n;
    *list = (rx_qa_list){.n = n};
    double **const columns[] = {&list->x,         &list->y,    &list->alpha,      &list->delta, &list->mag,
                                &list->mag_error, &list->flux, &list->flux_error, &list->score};
    const size_t ncolumns = sizeof columns / sizeof *columns - (with_flags ? 0 : 1);
    int complete = 1;
    for (size_t i = 0; i < ncolumns; i++)
        complete &= (*columns[i] = RX_NEW(double, rows)) != NULL;
    if (with_flags) {
        list->flags = RX_NEW(int, rows);
        list->restore = RX_NEW(int, rows);
        list->made_up = RX_NEW(unsigned char, rows);
        complete &= list->flags != NULL && list->restore != NULL && list->made_up != NULL;
    }
    if (complete)
        return RX_OK;
    rx_qa_list_free(list);
    return rx_error_memory(err, 9 * rows * sizeof(double));
}

void rx_qa_list_free(rx_qa_list *list)
{
    free(list->x);
    free(list->y);
    free(list->alpha);
    free(list->delta);
    free(list->mag);
    free(list->mag_error);
    free(list->flux);
    free(list->flux_error);
    free(list->score);
    free(list->flags);
    free(list->restore);
    free(list->made_up);
    *list = (rx_qa_list){0};
}
