/* Reading plain images and tables. */
#include "io/fits_read.h"

#include <ctype.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "io/cards.h"
#include "io/fits_file.h"

#define MOST_PIXELS 268435456.0 /* of a cube: 1 GiB */

/* --- images --- */

/* Planes of an image of two axes, or of three where `cubes` are asked for and the name gives no plane; else 0. */
static LONGLONG count_planes(const rx_fits_shape *shape, const rx_fits_name *name, int cubes)
{
    rx_fits_section section = name->section;
    if (rx_fits_is_plane(shape, &section))
        return 1;
    if (cubes)
        section.plane[0] = 1;
    return rx_fits_is_plane(shape, &section) ? shape->axes[2] : 0;
}

/* Go to the image: what the name selects, else the first of planes, else the first of any shape. A 1-D image is taken as one
 * row. */
static rx_status find_image(rx_fits_source *source, const rx_fits_name *name, int cubes, rx_fits_shape *shape,
                            rx_error *err)
{
    int first = -1, count = 0;
    if (rx_fits_name_selects(name))
        RX_TRY(rx_fits_goto_name(source, name, err));
    else {
        RX_TRY(rx_fits_count(source, &count, NULL, err));
        for (int i = 0; i < count; i++) {
            RX_TRY(rx_fits_goto(source, i, err));
            if (rx_fits_shape_of(source, shape, NULL) != RX_OK)
                continue;
            if (count_planes(shape, name, cubes) > 0)
                return RX_OK;
            if (first < 0 && shape->is_image && shape->naxis > 0)
                first = i;
        }
        if (first < 0)
            return rx_error_at(err, RX_INPUT, name->path, -1, 0, "holds no image in its %d HDUs", count);
        RX_TRY(rx_fits_goto(source, first, err));
    }
    return rx_fits_shape_of(source, shape, err);
}

static rx_status check_image(const rx_fits_source *source, const rx_fits_name *name, int cubes,
                             const rx_fits_shape *shape, rx_fits_section *part, rx_error *err)
{
    int is_line = shape->is_image && shape->naxis == 1;
    const LONGLONG planes = is_line ? 1 : count_planes(shape, name, cubes);
    if (planes < 1)
        return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0, "holds no 2-D image");
    RX_TRY(rx_fits_check_size(source, shape, err));
    double pixels = (double)planes;
    *part = rx_fits_part(name, shape);
    for (int i = 0; i < 2; i++) {
        LONGLONG length = i == 1 && is_line ? 1 : shape->axes[i];
        if (length < 1 || length > 1 << 28)
            return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0,
                               "the image has %lld x %lld pixels", shape->axes[0],
                               is_line ? 1 : shape->axes[1]);
        if (part->last[i] > length)
            return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0, "the section leaves the image");
        pixels *= (double)(part->last[i] - part->first[i] + 1);
    }
    for (int i = 2; i < RX_FITS_AXES; i++)
        if (part->plane[i - 2] > (i < shape->naxis ? shape->axes[i] : 1))
            return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0, "has no plane %ld on axis %d",
                               part->plane[i - 2], i + 1);
    if (cubes && !(pixels <= MOST_PIXELS))
        return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0,
                           "%lld planes of %lld x %lld pixels are too many", planes, shape->axes[0],
                           is_line ? 1 : shape->axes[1]);
    return RX_OK;
}

/* Cubes come with their header. */
static rx_status read_image(const char *name, int cubes, rx_fits_cube *dst, rx_error *err)
{
    rx_fits_name parsed;
    rx_fits_shape shape;
    rx_fits_source source = {0};
    rx_fits_section part;
    size_t ncards = 0;
    *dst = (rx_fits_cube){0};
    rx_status status;
    RX_TRY_EXIT(rx_fits_name_parse(name, &parsed, err));
    RX_TRY_EXIT(rx_fits_open(parsed.path, &source, err));
    RX_TRY_EXIT(find_image(&source, &parsed, cubes, &shape, err));
    RX_TRY_EXIT(check_image(&source, &parsed, cubes, &shape, &part, err));
    dst->width = (int)(part.last[0] - part.first[0] + 1);
    dst->height = (int)(part.last[1] - part.first[1] + 1);
    dst->planes = shape.naxis > 1 ? (int)count_planes(&shape, &parsed, cubes) : 1;
    const size_t plane = (size_t)dst->width * (size_t)dst->height;
    dst->pixels = rx_alloc((size_t)dst->planes, plane * sizeof(float));
    if (dst->pixels == NULL)
        status = rx_error_memory(err, sizeof(float) * plane * (size_t)dst->planes);
    for (int k = 0; k < dst->planes && status == RX_OK; k++) {
        if (dst->planes > 1)
            part.plane[0] = k + 1;
        status = rx_fits_read_pixels(&source, &part, dst->pixels + (size_t)k * plane, err);
    }
    if (status == RX_OK && cubes)
        status = rx_fits_read_cards(&source, &dst->cards, &ncards, err);
    dst->ncards = (long)ncards;
exit:
    rx_fits_done(&source);
    if (status != RX_OK)
        rx_fits_cube_free(dst);
    return status;
}

rx_status rx_fits_read_image(const char *name, float **pixels, int *width, int *height, rx_error *err)
{
    rx_fits_cube image;
    const rx_status status = read_image(name, 0, &image, err);
    *pixels = image.pixels;
    *width = image.width;
    *height = image.height;
    return status;
}

rx_status rx_fits_read_cube(const char *name, rx_fits_cube *dst, rx_error *err)
{
    return read_image(name, 1, dst, err);
}

void rx_fits_cube_free(rx_fits_cube *cube)
{
    free(cube->pixels);
    free(cube->cards);
    *cube = (rx_fits_cube){0};
}

/* --- which tables --- */

/* What a table counts as: of the best kind that there is all are listed. A catalogue without a source is a catalogue. */
typedef enum rank { EMPTY, FILLED, LDAC } rank;

/* HDU numbers of the tables that count; *hdus to be freed in any case. */
static rx_status list_tables(rx_fits_source *source, const rx_fits_name *name, int **hdus, int *n,
                             rx_error *err)
{
    const bool selected = rx_fits_name_selects(name);
    int count = 1;
    rank best = EMPTY;
    *n = 0;
    if (!selected)
        RX_TRY(rx_fits_count(source, &count, NULL, err));
    RX_TRY(RX_MAKE(*hdus, (size_t)count, err));
    if (selected) {
        RX_TRY(rx_fits_goto_name(source, name, err));
        (*hdus)[(*n)++] = source->hdu;
        return RX_OK;
    }
    for (int i = 0; i < count; i++) {
        rx_fits_shape shape;
        char extname[FLEN_VALUE] = "";
        int absent = 0, failed = 0, columns = 0;
        long rows = 0;
        RX_TRY(rx_fits_goto(source, i, err));
        if (rx_fits_shape_of(source, &shape, NULL) != RX_OK || shape.is_image)
            continue;
        fits_read_key(source->file, TSTRING, "EXTNAME", extname, NULL, &absent);
        fits_get_num_rows(source->file, &rows, &failed);
        fits_get_num_cols(source->file, &columns, &failed);
        fits_clear_errmsg();
        if (failed || columns < 1)
            continue;
        const rank this = strcmp(extname, "LDAC_OBJECTS") == 0 ? LDAC : rows > 0 ? FILLED : EMPTY;
        if (this > best) {
            best = this;
            *n = 0;
        }
        if (this == best)
            (*hdus)[(*n)++] = i;
    }
    return RX_OK;
}

/* --- columns --- */

/* How a column of the file is read: the type to ask cfitsio for. */
typedef struct plan {
    int number; /* in the file, from 1 */
    int ask;    /* cfitsio's type */
    int exact;  /* floating in a binary table: cells come as they are, where looking for nulls loses -0 and
                   subnormal numbers */
} plan;

/* Where a table's header has what is said of each column, found in one pass: cfitsio looks for each from card to card,
 * which is quadratic where headers are long. */
enum { TNULL, TDIM, TTYPE, TUNIT, TUCD, TCOMM, STEMS };
static const char *const stems[STEMS] = {"TNULL", "TDIM", "TTYPE", "TUNIT", "TUCD", "TCOMM"};

typedef struct heading {
    const rx_table *table;
    int32_t card[STEMS][RX_FITS_FIELDS + 1]; /* index from 1 of the first of its kind; 0: none */
} heading;

static void find_cards(const rx_table *table, heading *dst)
{
    dst->table = table;
    for (long i = 0; i < table->ncards; i++) {
        const char *card = table->cards + 80 * i;
        for (int s = 0; s < STEMS && *card == 'T'; s++) {
            const size_t length = strlen(stems[s]);
            int number = 0;
            const char *c = card + length;
            if (strncmp(card, stems[s], length) != 0)
                continue;
            for (; c < card + 8 && isdigit((unsigned char)*c); c++)
                number = 10 * number + *c - '0';
            if (c + strspn(c, " ") >= card + 8 && number <= RX_FITS_FIELDS && dst->card[s][number] == 0)
                dst->card[s][number] = (int32_t)i + 1;
        }
    }
}

/* Text and, where it is asked for, comment of a column's card; false where there is none. */
static bool heading_text(const heading *h, int stem, int number, char *dst, int size, char *comment)
{
    char key[FLEN_KEYWORD];
    const long i = h->card[stem][number] - 1;
    dst[0] = '\0';
    if (i < 0)
        return false;
    snprintf(key, sizeof key, "%s%d", stems[stem], number);
    if (comment != NULL)
        rx_cards_comment(h->table->cards + 80 * i, 1, key, comment, FLEN_COMMENT);
    return rx_cards_text(h->table->cards + 80 * i, h->table->ncards - i, key, dst, size) != 0;
}

/* Types of columns: the cells that hold them and what cfitsio is asked for; the same where TNULL is set, as NAN then
 * stands for no value (64-bit integers stay: a double would not hold them). */
static const struct kind {
    int type;
    rx_cell_type cell;
    int ask;
    rx_cell_type nulled_cell;
    int nulled_ask;
} kinds[] = {
    {TLOGICAL, RX_CELL_INT16, TLOGICAL, RX_CELL_INT16, TLOGICAL},
    {TBIT, RX_CELL_INT16, TBIT, RX_CELL_INT16, TBIT},
    {TBYTE, RX_CELL_INT16, TSHORT, RX_CELL_FLOAT, TFLOAT},
    {TSBYTE, RX_CELL_INT16, TSHORT, RX_CELL_FLOAT, TFLOAT},
    {TSHORT, RX_CELL_INT16, TSHORT, RX_CELL_FLOAT, TFLOAT},
    {TUSHORT, RX_CELL_INT32, TINT, RX_CELL_DOUBLE, TDOUBLE},
    {TINT, RX_CELL_INT32, TINT, RX_CELL_DOUBLE, TDOUBLE},
    {TLONG, RX_CELL_INT32, TINT, RX_CELL_DOUBLE, TDOUBLE},
    {TUINT, RX_CELL_INT64, TLONGLONG, RX_CELL_INT64, TLONGLONG},
    {TULONG, RX_CELL_INT64, TLONGLONG, RX_CELL_INT64, TLONGLONG},
    {TLONGLONG, RX_CELL_INT64, TLONGLONG, RX_CELL_INT64, TLONGLONG},
    {TULONGLONG, RX_CELL_DOUBLE, TDOUBLE, RX_CELL_DOUBLE, TDOUBLE}, /* more than an int64 holds */
    {TFLOAT, RX_CELL_FLOAT, TFLOAT, RX_CELL_FLOAT, TFLOAT},
    {TDOUBLE, RX_CELL_DOUBLE, TDOUBLE, RX_CELL_DOUBLE, TDOUBLE},
    {TCOMPLEX, RX_CELL_FLOAT, TCOMPLEX, RX_CELL_FLOAT, TCOMPLEX}, /* pairs of real and imaginary part */
    {TDBLCOMPLEX, RX_CELL_DOUBLE, TDBLCOMPLEX, RX_CELL_DOUBLE, TDBLCOMPLEX},
    {TSTRING, RX_CELL_TEXT, TSTRING, RX_CELL_TEXT, TSTRING},
};

/* Cell type for a column; 0 when the column is left out. */
static int plan_column(fitsfile *file, const heading *heading, int number, rx_column *column, plan *dst,
                       int *failed)
{
    int type = 0, stored = 0, hdu_type = 0;
    long repeat = 0, width = 0;
    size_t k = 0;
    const bool nulls = heading->card[TNULL][number] > 0;
    fits_get_hdu_type(file, &hdu_type, failed);
    fits_get_coltype(file, number, &stored, NULL, NULL, failed);
    fits_get_eqcoltype(file, number, &type, &repeat, &width, failed);
    while (k < sizeof kinds / sizeof *kinds && kinds[k].type != type)
        k++;
    if (*failed || k == sizeof kinds / sizeof *kinds || repeat < 1) /* negative: variable length */
        return 0;
    dst->number = number;
    dst->ask = nulls ? kinds[k].nulled_ask : kinds[k].ask;
    dst->exact = hdu_type == BINARY_TBL && type == stored && (type == TFLOAT || type == TDOUBLE);
    column->type = nulls ? kinds[k].nulled_cell : kinds[k].cell;
    column->ndim = repeat > 1;
    column->dim[0] = (int)repeat;
    if (type == TCOMPLEX || type == TDBLCOMPLEX) {
        column->ndim = 1 + (repeat > 1);
        column->dim[0] = 2;
        column->dim[1] = (int)repeat;
    } else if (type == TSTRING) {
        width = width < 1 ? repeat : width;
        column->text_width = (int)width + 1;
        column->ndim = repeat / width > 1;
        column->dim[0] = (int)(repeat / width);
    }
    return 1;
}

/* TDIM: up to two axes; of more, all but the first are taken together. */
static void take_dimensions(fitsfile *file, const heading *heading, int number, rx_column *column)
{
    char text[FLEN_VALUE];
    long axes[9] = {0};
    int n = 0, failed = 0, from = column->type == RX_CELL_TEXT ? 1 : 0;
    if (column->ndim != 1 || !heading_text(heading, TDIM, number, text, sizeof text, NULL) ||
        fits_decode_tdim(file, text, number, 9, &n, axes, &failed) || n - from < 2 || n > 9) {
        fits_clear_errmsg();
        return;
    }
    double product = 1;
    for (int i = from; i < n; i++)
        product *= (double)axes[i];
    if (axes[from] < 1 || product != column->dim[0])
        return;
    column->ndim = 2;
    column->dim[1] = (int)(column->dim[0] / axes[from]);
    column->dim[0] = (int)axes[from];
}

static void take_names(const heading *heading, int number, rx_column *column)
{
    char comment[FLEN_COMMENT] = "", ignored[FLEN_VALUE];
    if (!heading_text(heading, TTYPE, number, column->name, sizeof column->name, comment))
        snprintf(column->name, sizeof column->name, "COL%d", number);
    heading_text(heading, TUNIT, number, column->unit, sizeof column->unit, NULL);
    heading_text(heading, TUCD, number, column->ucd, sizeof column->ucd, NULL);
    if (strncmp(comment, "label for field", 15) != 0) /* cfitsio's words when there is nothing to say */
        snprintf(column->description, sizeof column->description, "%s", comment);
    if (heading_text(heading, TCOMM, number, ignored, sizeof ignored, NULL))
        snprintf(column->description, sizeof column->description, "%.*s", (int)sizeof column->description - 1,
                 ignored);
}

/* --- cells --- */

static void read_logicals(fitsfile *file, int ask, int number, long first, long n, int16_t *dst, int *failed)
{
    char *flags = RX_NEW(char, (size_t)n);
    int anynul = 0;
    if (flags == NULL) {
        *failed = MEMORY_ALLOCATION;
        return;
    }
    if (ask == TBIT)
        fits_read_col_bit(file, number, first, 1, n, flags, failed);
    else
        fits_read_col(file, TLOGICAL, number, first, 1, n, NULL, flags, &anynul, failed);
    for (long i = 0; i < n; i++)
        dst[i] = flags[i] != 0;
    free(flags);
}

static void read_texts(fitsfile *file, int number, long first, long n, const rx_column *column, char *dst,
                       int *failed)
{
    char **list = RX_NEW(char *, (size_t)n), *null = "";
    int anynul = 0;
    if (list == NULL) {
        *failed = MEMORY_ALLOCATION;
        return;
    }
    for (long i = 0; i < n; i++)
        list[i] = dst + i * column->text_width;
    fits_read_col(file, TSTRING, number, first, 1, n, null, list, &anynul, failed);
    free(list);
}

/* Rows first.. (from 1) of one column into its place. */
static void read_cells(fitsfile *file, const plan *how, rx_column *column, long first, long rows, int *failed)
{
    float no_float = NAN;
    double no_double = NAN;
    int anynul = 0;
    long n = rx_column_elements(column);
    char *dst = (char *)column->data + (first - 1) * n * rx_column_element_size(column);
    const bool is_complex = how->ask == TCOMPLEX || how->ask == TDBLCOMPLEX;
    void *null = NULL; /* integers: whatever the file holds */
    if (!how->exact && (how->ask == TFLOAT || how->ask == TCOMPLEX))
        null = &no_float;
    else if (!how->exact && (how->ask == TDOUBLE || how->ask == TDBLCOMPLEX))
        null = &no_double;
    if (how->ask == TSTRING)
        read_texts(file, how->number, first, rows * n, column, dst, failed);
    else if (how->ask == TLOGICAL || how->ask == TBIT)
        read_logicals(file, how->ask, how->number, first, rows * n, (int16_t *)dst, failed);
    else
        fits_read_col(file, how->ask, how->number, first, 1, is_complex ? rows * n / 2 : rows * n, null, dst,
                      &anynul, failed);
    if (*failed == NUM_OVERFLOW) /* the nearest possible value stands there */
        *failed = 0;
}

static rx_status read_rows(const rx_fits_source *source, const plan *plans, rx_table *table, rx_error *err)
{
    int failed = 0;
    long row_bytes = 1;
    for (int i = 0; i < table->ncolumns; i++) {
        rx_column *column = &table->columns[i];
        long bytes = rx_column_elements(column) * rx_column_element_size(column);
        row_bytes += bytes;
        column->data = rx_alloc((size_t)table->nrows, (size_t)bytes);
        if (column->data == NULL)
            return rx_error_memory(err, (size_t)table->nrows * (size_t)bytes);
    }
    long block = RX_FITS_ROWS / row_bytes + 1;
    for (long first = 1; first <= table->nrows && !failed; first += block)
        for (int i = 0; i < table->ncolumns && !failed; i++) {
            long rows = table->nrows - first + 1 < block ? table->nrows - first + 1 : block;
            read_cells(source->file, &plans[i], &table->columns[i], first, rows, &failed);
        }
    return rx_fits_check(source, RX_INPUT, failed, "the table cannot be read", err);
}

/* --- tables --- */

static rx_status read_table(rx_fits_source *source, int hdu, rx_table **dst, rx_error *err)
{
    fitsfile *file = source->file;
    rx_fits_shape shape;
    int failed = 0, ncolumns = 0, kept = 0;
    char extname[FLEN_VALUE] = "";
    size_t ncards = 0;
    long rows = 0;
    rx_table *table = NULL;
    plan *plans = NULL;
    heading *columns = NULL;
    RX_TRY(rx_fits_goto(source, hdu, err));
    RX_TRY(rx_fits_shape_of(source, &shape, err));
    if (shape.is_image)
        return rx_error_at(err, RX_INPUT, source->path, hdu, 0, "holds an image, a table was expected");
    fits_get_num_cols(file, &ncolumns, &failed);
    fits_get_num_rows(file, &rows, &failed);
    RX_TRY(rx_fits_check(source, RX_INPUT, failed, "this HDU cannot be read", err));
    rx_status status = RX_OK;
    RX_TRY(rx_fits_check_size(source, &shape, err));
    table = rx_table_new(ncolumns);
    plans = RX_NEW(plan, (size_t)ncolumns);
    columns = RX_NEW(heading, 1);
    if (table == NULL || plans == NULL || columns == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    table->nrows = rows;
    RX_TRY_EXIT(rx_fits_read_cards(source, &table->cards, &ncards, err));
    table->ncards = (long)ncards;
    rx_cards_text(table->cards, table->ncards, "EXTNAME", extname, sizeof extname);
    free(table->name);
    table->name = rx_strdup(extname);
    if (table->name == NULL)
        RX_TRY_EXIT(rx_error_memory(err, sizeof extname));
    find_cards(table, columns);
    for (int i = 1; i <= ncolumns && !failed; i++) {
        rx_column *column = &table->columns[kept];
        *column = (rx_column){0};
        if (!plan_column(file, columns, i, column, &plans[kept], &failed))
            continue;
        take_dimensions(file, columns, i, column);
        take_names(columns, i, column);
        kept++;
    }
    table->ncolumns = kept;
    RX_TRY_EXIT(rx_fits_check(source, RX_INPUT, failed, "its columns cannot be understood", err));
    RX_TRY_EXIT(read_rows(source, plans, table, err));
    *dst = table;
    table = NULL;
exit:
    rx_table_free(table);
    free(plans);
    free(columns);
    return status;
}

rx_status rx_fits_read_table(const char *name, int index, rx_table **dst, rx_error *err)
{
    rx_fits_name parsed;
    rx_fits_source source = {0};
    int *hdus = NULL, n = 0;
    *dst = NULL;
    rx_status status;
    RX_TRY_EXIT(rx_fits_name_parse(name, &parsed, err));
    if (parsed.has_section)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, name, -1, 0,
                                "a section of a table cannot be read; name its HDU alone"));
    RX_TRY_EXIT(rx_fits_open(parsed.path, &source, err));
    RX_TRY_EXIT(list_tables(&source, &parsed, &hdus, &n, err));
    if (index < 0 || index >= n)
        RX_TRY_EXIT(n == 0 ? rx_error_at(err, RX_INPUT, name, -1, 0, "holds no table")
                           : rx_error_at(err, RX_INPUT, name, -1, 0,
                                         "holds %d tables, number %d was asked for", n, index + 1));
    status = read_table(&source, hdus[index], dst, err);
exit:
    rx_fits_done(&source);
    free(hdus);
    return status;
}

rx_status rx_fits_read_named(const char *path, const char *extname, rx_table **dst, int *hdu, rx_error *err)
{
    rx_fits_source source = {0};
    rx_fits_name name = {.hdu = -1};
    *dst = NULL;
    *hdu = -1;
    snprintf(name.extname, sizeof name.extname, "%s", extname);
    rx_status status = RX_OK;
    RX_TRY(rx_fits_open(path, &source, err));
    if (rx_fits_goto_name(&source, &name, NULL) == RX_OK) {
        *hdu = source.hdu;
        status = read_table(&source, *hdu, dst, err);
    }
    rx_fits_done(&source);
    return status;
}

rx_status rx_fits_read_header(const char *path, int hdu, char **cards, long *ncards, rx_error *err)
{
    rx_fits_source source = {0};
    size_t n = 0;
    *cards = NULL;
    rx_status status = rx_fits_open(path, &source, err);
    if (status == RX_OK)
        status = rx_fits_goto(&source, hdu, err);
    if (status == RX_OK)
        status = rx_fits_read_cards(&source, cards, &n, err);
    *ncards = (long)n;
    rx_fits_done(&source);
    return status;
}

/* --- is a file as it was written? --- */

static rx_status damaged(const rx_fits_source *source, const char *what, rx_error *err)
{
    return rx_error_at(err, RX_INPUT, source->path, source->hdu, 0,
                       "%s: the file is damaged or was edited; fetch or make it again", what);
}

/* Where it is; *end: where the next HDU would begin. */
static rx_status verify_hdu(const rx_fits_source *source, LONGLONG *end, rx_error *err)
{
    rx_fits_shape shape;
    int data = 0, all = 0, failed = 0;
    RX_TRY(rx_fits_shape_of(source, &shape, err));
    if (!shape.is_image || shape.naxis > 0)
        RX_TRY(rx_fits_check_size(source, &shape, err));
    fits_get_hduaddrll(source->file, NULL, NULL, end, &failed);
    fits_verify_chksum(source->file, &data, &all, &failed);
    RX_TRY(rx_fits_check(source, RX_INPUT, failed, "cannot be read to its end", err));
    if (data == 0 || all == 0)
        return rx_error_at(
            err, RX_INPUT, source->path, source->hdu, 0,
            "has no %s, so that it cannot be checked whether it is whole; fetch or make it again",
            all == 0 ? "CHECKSUM" : "DATASUM");
    return data < 0  ? damaged(source, "DATASUM does not fit the data", err)
           : all < 0 ? damaged(source, "CHECKSUM does not fit the HDU", err)
                     : RX_OK;
}

rx_status rx_fits_verify(const char *path, int nhdus, rx_error *err)
{
    rx_fits_source source = {0};
    LONGLONG end = 0;
    int n = 0, broken = 0;
    rx_status status;
    RX_TRY_EXIT(rx_fits_open(path, &source, err));
    if (source.bytes > 0)
        RX_TRY_EXIT(
            damaged(&source, "is not plain FITS in whole blocks (unpack it if it is compressed)", err));
    RX_TRY_EXIT(rx_fits_count(&source, &n, &broken, err));
    for (int hdu = 0; hdu < n; hdu++) {
        RX_TRY_EXIT(rx_fits_goto(&source, hdu, err));
        RX_TRY_EXIT(verify_hdu(&source, &end, err));
    }
    source.hdu = n;
    if (broken || end != source.file->Fptr->filesize)
        RX_TRY_EXIT(damaged(&source, "no HDU begins where this one should", err));
    if (nhdus > 0 && n != nhdus)
        status = rx_error_at(err, RX_INPUT, path, -1, 0,
                             "has %d HDUs, %d were written: the file is cut off or was edited; fetch or make "
                             "it again",
                             n, nhdus);
exit:
    rx_fits_done(&source);
    return status;
}

void rx_fits_library(char *dst, size_t size)
{
    snprintf(dst, size, "%d.%d.%d", CFITSIO_MAJOR, CFITSIO_MINOR, CFITSIO_MICRO);
}
