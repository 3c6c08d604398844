/* One cell as text, the same on every machine and in every locale. */
#ifndef RX_CATALOG_CELL_H
#define RX_CATALOG_CELL_H

#include "base/error.h"
#include "base/point.h"
#include "base/text.h"
#include "data/table.h"

/* Element of a cell in the column's printf format (width, precision and one of d u f e g; a
 * sensible one when it has none). Text that holds blanks is put in double quotes. */
void rx_cell_format(rx_text *dst, const rx_column *column, long row, long element);

/* The same with no padding and all digits: the shortest text that reads back as the same number. */
void rx_cell_exact(rx_text *dst, const rx_column *column, long row, long element);

#endif
