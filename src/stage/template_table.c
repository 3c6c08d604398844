/* The covariances of template fluxes as a table. */
#include "stage/template_table.h"

#include <stdlib.h>

#include "base/memory.h"

enum { EXTENSION, FIRST, SECOND, COVARIANCE, CORRELATION, NCOLUMNS };

static const rx_column columns[NCOLUMNS] = {
    [EXTENSION] = {"EXT_NUMBER", "", "meta.id;meta.dataset", "Number of the image extension, from 1", "%3d",
                   .type = RX_CELL_INT32},
    [FIRST] = {"NUMBER_1", "", "meta.record", "NUMBER of a source", "%10d", .type = RX_CELL_INT32},
    [SECOND] = {"NUMBER_2", "", "meta.record", "NUMBER of another one of its group", "%10d",
                .type = RX_CELL_INT32},
    [COVARIANCE] = {"COVAR_TEMPLATE", "count**2", "stat.covariance;phot.flux",
                    "Covariance of their FLUX_TEMPLATE", "%15.8e", .type = RX_CELL_DOUBLE},
    [CORRELATION] = {"CORREL_TEMPLATE", "", "stat.correlation;phot.flux", "The same over both errors",
                     "%8.5f", .type = RX_CELL_DOUBLE},
};

rx_status rx_template_table(const rx_tphot *tphot, const rx_sources *sources, int extension, rx_table **dst,
                            rx_error *err)
{
    const int npairs = tphot != NULL ? tphot->npairs : 0;
    const rx_source **by_entry = NULL; /* sources that are still in the list, by their place in the fit */
    rx_table *table = NULL;
    rx_status status = RX_OK;
    long nrows = 0, row = 0;
    if (tphot != NULL)
        RX_TRY_EXIT(RX_MAKE(by_entry, (size_t)tphot->n, err));
    for (int i = 0; tphot != NULL && i < sources->n; i++)
        by_entry[sources->list[i].fit.entry] = &sources->list[i];
    for (int i = 0; i < npairs; i++)
        nrows += by_entry[tphot->pairs[i].i] != NULL && by_entry[tphot->pairs[i].j] != NULL;
    RX_TRY_EXIT(rx_table_make("COVARIANCES", columns, NCOLUMNS, nrows, &table, err));
    for (int i = 0; i < npairs; i++) {
        const rx_source *a = by_entry[tphot->pairs[i].i], *b = by_entry[tphot->pairs[i].j];
        const double covariance = tphot->pairs[i].covariance;
        if (a == NULL || b == NULL)
            continue;
        const double values[NCOLUMNS] = {[EXTENSION] = extension,
                                         [FIRST] = a->number,
                                         [SECOND] = b->number,
                                         [COVARIANCE] = covariance,
                                         [CORRELATION] = covariance / (a->fit.fluxerr * b->fit.fluxerr)};
        for (int c = 0; c < NCOLUMNS; c++)
            rx_column_set(&table->columns[c], row, values[c], NULL);
        row++;
    }
    *dst = table;
exit:
    free((void *)by_entry);
    return status;
}
