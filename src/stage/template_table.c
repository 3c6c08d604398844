/* The covariances of template fluxes as a table. */
#include "stage/template_table.h"

#include <stdlib.h>

#include "base/memory.h"

enum { EXTENSION, FIRST, SECOND, COVARIANCE, CORRELATION, NCOLUMNS };

static const rx_column columns[NCOLUMNS] = {
    [EXTENSION] = {.type = RX_CELL_INT32,
                   .name = "EXT_NUMBER",
                   .ucd = "meta.id;meta.dataset",
                   .format = "%3d",
                   .description = "Number of the image extension, from 1"},
    [FIRST] = {.type = RX_CELL_INT32,
               .name = "NUMBER_1",
               .ucd = "meta.record",
               .format = "%10d",
               .description = "NUMBER of a source"},
    [SECOND] = {.type = RX_CELL_INT32,
                .name = "NUMBER_2",
                .ucd = "meta.record",
                .format = "%10d",
                .description = "NUMBER of another one of its group"},
    [COVARIANCE] = {.type = RX_CELL_DOUBLE,
                    .name = "COVAR_TEMPLATE",
                    .unit = "count**2",
                    .ucd = "stat.covariance;phot.flux",
                    .format = "%15.8e",
                    .description = "Covariance of their FLUX_TEMPLATE"},
    [CORRELATION] = {.type = RX_CELL_DOUBLE,
                     .name = "CORREL_TEMPLATE",
                     .ucd = "stat.correlation;phot.flux",
                     .format = "%8.5f",
                     .description = "The same over both errors"},
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
        ((int32_t *)table->columns[EXTENSION].data)[row] = extension;
        ((int32_t *)table->columns[FIRST].data)[row] = a->number;
        ((int32_t *)table->columns[SECOND].data)[row] = b->number;
        ((double *)table->columns[COVARIANCE].data)[row] = covariance;
        ((double *)table->columns[CORRELATION].data)[row++] = covariance / (a->fit.fluxerr * b->fit.fluxerr);
    }
    *dst = table;
exit:
    free((void *)by_entry);
    return status;
}
