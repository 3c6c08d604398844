/* Reading VOTables by expat: TABLEDATA of one TABLE as it comes, or its BINARY or BINARY2 stream in base64 once that has ended;
 * everything else is passed over. */
#include <errno.h>
#include <expat.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/input.h"
#include "base/memory.h"
#include "base/text.h"
#include "catalog/formats.h"

enum { CHUNK = 65536, CELL_BYTES = 1 << 20 };
static const int64_t NO_INTEGER = INT64_MIN; /* a null cell until the column's type is settled */

/* What a FIELD's datatype says: its cells here, and an element in a stream. */
typedef struct datatype {
    const char *name;
    rx_cell_type cell;
    int width; /* bytes; 0: of a type that is not read from streams */
} datatype;

static const datatype datatypes[] = {
    {"boolean", RX_CELL_INT64, 1},     {"unsignedByte", RX_CELL_INT64, 1},  {"char", RX_CELL_TEXT, 1},
    {"short", RX_CELL_INT64, 2},       {"unicodeChar", RX_CELL_TEXT, 2},    {"int", RX_CELL_INT64, 4},
    {"float", RX_CELL_FLOAT, 4},       {"long", RX_CELL_INT64, 8},          {"double", RX_CELL_DOUBLE, 8},
    {"floatComplex", RX_CELL_TEXT, 8}, {"doubleComplex", RX_CELL_TEXT, 16}, {"", RX_CELL_TEXT, 0}};
enum { BOOLEAN, BYTE, CHAR, SHORT, UNICODE }; /* the first of them */

/* A FIELD and its cells; texts are offsets into votable.pool until the end. */
typedef struct field {
    rx_column column;
    const datatype *type;
    char null[32]; /* VALUES null="..." */
    bool has_null;
    size_t longest;
    long
        items; /* elements of a cell; -1: their number stands before them in a stream, 0: nothing that can be read there */
} field;

static bool is_of(const field *f, int type)
{
    return f->type == &datatypes[type];
}

typedef struct votable {
    const char *path;
    XML_Parser parser;
    int wanted, tables; /* index of the TABLE we want, number of those begun */
    bool inside, done;  /* in that TABLE, behind it */
    bool in_field, in_row, in_cell, in_description, in_stream;
    int binary;        /* 0, or of BINARY, BINARY2 */
    field *fields;     /* [RX_READ_COLUMNS] */
    int nfields, cell; /* cell: the next TD of the row */
    long nrows, capacity;
    rx_text text, pool; /* characters of the current cell; all texts, 0-terminated */
    char name[72];      /* of the TABLE */
    rx_status status;
    rx_error *err;
} votable;

static void fail(votable *in, rx_status status, const char *text)
{
    if (in->status != RX_OK)
        return;
    in->status = status == RX_SYSTEM ? rx_error_memory(in->err, 0)
                                     : rx_error_at(in->err, status, in->path, -1,
                                                   (long)XML_GetCurrentLineNumber(in->parser), "%s", text);
    XML_StopParser(in->parser, XML_FALSE);
}

/* Names may carry a namespace prefix. */
static const char *local_name(const char *name)
{
    const char *colon = strrchr(name, ':');
    return colon != NULL ? colon + 1 : name;
}

static void copy_attribute(const char **attributes, const char *name, char *dst, size_t size)
{
    for (int i = 0; attributes[i] != NULL; i += 2)
        if (strcmp(attributes[i], name) == 0)
            snprintf(dst, size, "%s", attributes[i + 1]);
}

/* "5", "3x5", "*", "10*". Numbers whose cells have no shape, or more than two dimensions, are read as text. */
static void read_arraysize(field *f, const char *text)
{
    rx_column *column = &f->column;
    int ndim = 0;
    char *end;
    f->items = 1;
    for (const char *at = text; *at != '\0' && f->items > 0; at = *end == 'x' ? end + 1 : end) {
        const long n = strtol(at, &end, 10);
        if (*end == '*' && at == text)
            f->items = -1;
        else if (end == at || n < 1 || n > CELL_BYTES || f->items * n > CELL_BYTES ||
                 (*end != 'x' && *end != '\0'))
            f->items = 0;
        else
            f->items *= n;
        if (ndim < 2)
            column->dim[ndim] = (int)n;
        ndim++;
    }
    if (f->items < 1 || ndim > 2)
        column->type = RX_CELL_TEXT;
    column->ndim = column->type == RX_CELL_TEXT || (ndim == 1 && f->items == 1) ? 0 : ndim;
}

static void begin_field(votable *in, const char **attributes)
{
    char type[24] = "", arraysize[48] = "";
    if (in->nfields == RX_READ_COLUMNS || in->capacity > 0) {
        fail(in, RX_INPUT,
             in->capacity > 0 ? "a FIELD stands behind the data"
                              : "the table has more columns than can be read");
        return;
    }
    field *f = &in->fields[in->nfields++];
    rx_column *column = &f->column;
    snprintf(column->name, sizeof column->name, "col%d", in->nfields);
    copy_attribute(attributes, "ID", column->name, sizeof column->name);
    copy_attribute(attributes, "name", column->name, sizeof column->name);
    copy_attribute(attributes, "unit", column->unit, sizeof column->unit);
    copy_attribute(attributes, "ucd", column->ucd, sizeof column->ucd);
    copy_attribute(attributes, "datatype", type, sizeof type);
    copy_attribute(attributes, "arraysize", arraysize, sizeof arraysize);
    f->type = datatypes;
    while (f->type->name[0] != '\0' && strcmp(f->type->name, type) != 0)
        f->type++;
    column->type = f->type->cell;
    read_arraysize(f, arraysize);
    in->in_field = true;
}

static void begin_row(votable *in)
{
    if (in->in_row) {
        fail(in, RX_INPUT, "a row stands within a row");
        return;
    }
    in->in_row = true;
    in->cell = 0;
    if (in->nrows < in->capacity)
        return;
    long capacity = in->capacity > 0 ? 2 * in->capacity : 256;
    size_t total = in->pool.length;
    for (int i = 0; i < in->nfields; i++) {
        field *f = &in->fields[i];
        size_t bytes = (size_t)rx_column_elements(&f->column) * (f->column.type == RX_CELL_FLOAT ? 4 : 8);
        total += bytes * (size_t)capacity;
        if (total > 2 * RX_READ_BYTES) {
            fail(in, RX_INPUT, "the table is too large; give it as FITS");
            return;
        }
        void *more = rx_regrow(f->column.data, (size_t)capacity, bytes);
        if (more == NULL) {
            fail(in, RX_SYSTEM, "");
            return;
        }
        f->column.data = more;
    }
    in->capacity = capacity;
}

static bool is_word(const char *text, size_t length, const char *word)
{
    return strlen(word) == length && strncasecmp(text, word, length) == 0;
}

static int64_t truth_of(char letter)
{
    return letter == '\0'                  ? NO_INTEGER
           : strchr("tT1", letter) != NULL ? 1
           : strchr("fF0", letter) != NULL ? 0
                                           : NO_INTEGER;
}

static void put_integer(field *f, long i, int64_t value)
{
    f->has_null |= value == NO_INTEGER;
    ((int64_t *)f->column.data)[i] = value;
}

/* One number of a cell; nothing at all, NaN and the field's null are null. False when it is no number. */
static bool store_number(field *f, long i, const char *text, size_t length)
{
    char word[64], *end;
    bool null = length == 0 || is_word(text, length, "nan") || is_word(text, length, "null") ||
                (f->null[0] != '\0' && is_word(text, length, f->null));
    if (length >= sizeof word)
        return false;
    memcpy(word, text, length);
    word[length] = '\0';
    if (f->column.type == RX_CELL_INT64) {
        int64_t value = NO_INTEGER;
        errno = 0;
        if (!null && is_of(f, BOOLEAN))
            value = truth_of(word[0]);
        else if (!null)
            value = strtoll(word, &end, strncasecmp(word, "0x", 2) == 0 ? 16 : 10);
        if (!null && !is_of(f, BOOLEAN) && (end == word || *end != '\0' || errno != 0))
            return false;
        put_integer(f, i, value);
        return true;
    }
    double value = null ? NAN : strtod(word, &end);
    if (!null && (end == word || *end != '\0'))
        return false;
    if (f->column.type == RX_CELL_FLOAT)
        ((float *)f->column.data)[i] = (float)value;
    else
        ((double *)f->column.data)[i] = value;
    return true;
}

static void store_text(votable *in, field *f, const char *text)
{
    size_t length = strlen(text);
    if (length > RX_READ_TEXT)
        length = RX_READ_TEXT;
    if (in->pool.length > RX_READ_BYTES) {
        fail(in, RX_INPUT, "the table holds too much text; give it as FITS");
        return;
    }
    ((int64_t *)f->column.data)[in->nrows] = (int64_t)in->pool.length;
    rx_text_add_bytes(&in->pool, text, length);
    rx_text_add_bytes(&in->pool, "", 1);
    f->longest = length > f->longest ? length : f->longest;
    if (in->pool.failed)
        fail(in, RX_SYSTEM, "");
}

/* The bytes of a base64 text, in its own room. */
static bool decode(rx_text *text)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    unsigned bits = 0, n = 0;
    size_t used = 0;
    for (size_t i = 0; i < text->length && text->data[i] != '='; i++) {
        const char c = text->data[i], *digit = c != '\0' ? strchr(digits, c) : NULL;
        if (strchr(" \t\r\n", c) != NULL && c != '\0')
            continue;
        if (digit == NULL)
            return false;
        bits = bits << 6 | (unsigned)(digit - digits);
        n += 6;
        if (n >= 8) {
            n -= 8;
            text->data[used++] = (char)(bits >> n & 0xff);
        }
    }
    text->length = used;
    return true;
}

/* Big-endian. */
static uint64_t bytes_at(const unsigned char *at, int width)
{
    uint64_t value = 0;
    for (int i = 0; i < width; i++)
        value = value << 8 | at[i];
    return value;
}

/* Element i of all cells of a number. */
static void store_binary(field *f, long i, const unsigned char *at, bool null)
{
    const int width = f->type->width, unused = is_of(f, BYTE) ? 0 : 64 - 8 * width;
    const uint64_t bits = bytes_at(at, width);
    const uint32_t low = (uint32_t)bits;
    if (f->column.type == RX_CELL_INT64) {
        const int64_t value = is_of(f, BOOLEAN) ? truth_of((char)at[0]) : (int64_t)(bits << unused) >> unused;
        char word[32];
        snprintf(word, sizeof word, "%lld", (long long)value);
        put_integer(f, i, null || (f->null[0] != '\0' && strcmp(word, f->null) == 0) ? NO_INTEGER : value);
    } else if (f->column.type == RX_CELL_FLOAT) {
        memcpy((float *)f->column.data + i, &low, sizeof low);
        if (null)
            ((float *)f->column.data)[i] = NAN;
    } else {
        memcpy((double *)f->column.data + i, &bits, sizeof bits);
        if (null)
            ((double *)f->column.data)[i] = NAN;
    }
}

/* The cell that begins there; returns its end, NULL after fail(). Arrays of numbers whose length varies are left out. */
static const unsigned char *take_cell(votable *in, field *f, const unsigned char *at,
                                      const unsigned char *end, bool null)
{
    const int width = f->items != 0 ? f->type->width : 0;
    const bool letters = !null && (is_of(f, CHAR) || is_of(f, UNICODE));
    int64_t n = f->items;
    if (n < 0 && end - at >= 4) {
        n = (int64_t)bytes_at(at, 4);
        at += 4;
    }
    if (width == 0 || n < 0 || n > (end - at) / width) {
        fail(in, RX_INPUT,
             width == 0
                 ? "a field is of a type that is not read from a binary stream; save it as TABLEDATA or FITS"
                 : "the binary stream ends within a row, or its fields are others");
        return NULL;
    }
    if (f->column.type == RX_CELL_TEXT) {
        char word[RX_READ_TEXT + 1] = "";
        for (int64_t i = 0; i < n && i < RX_READ_TEXT && letters; i++) {
            const uint64_t c = bytes_at(at + i * width, width);
            word[i] = (char)(c < 256 ? c : '?');
        }
        store_text(in, f, word);
    } else {
        for (long i = 0; i < n; i++)
            store_binary(f, in->nrows * n + i, at + i * width, null);
    }
    return at + n * width;
}

/* All rows of a stream; BINARY2 has a bit for each null before every row. */
static void take_stream(votable *in)
{
    if (in->text.length == 0)
        return;
    if (!decode(&in->text)) {
        fail(in, RX_INPUT, "the binary stream is not in base64");
        return;
    }
    const unsigned char *at = (const unsigned char *)in->text.data, *end = at + in->text.length;
    const long bits = in->binary == 2 ? (in->nfields + 7) / 8 : 0;
    while (at < end && in->nfields > 0 && in->status == RX_OK) {
        const unsigned char *null = at;
        if (end - at < bits) {
            fail(in, RX_INPUT, "the binary stream ends within a row, or its fields are others");
            return;
        }
        begin_row(in);
        at += bits;
        for (int i = 0; i < in->nfields && in->status == RX_OK; i++)
            at = take_cell(in, &in->fields[i], at, end, bits > 0 && (null[i / 8] >> (7 - i % 8) & 1) != 0);
        in->in_row = false;
        in->nrows++;
    }
}

static void begin_stream(votable *in, const char **attributes)
{
    char encoding[24] = "", href[8] = "";
    copy_attribute(attributes, "encoding", encoding, sizeof encoding);
    copy_attribute(attributes, "href", href, sizeof href);
    if (strcmp(encoding, "base64") != 0 || href[0] != '\0')
        fail(in, RX_INPUT, "the VOTable's stream is not in base64 within it; save it as TABLEDATA or FITS");
    in->in_stream = true;
}

static void end_cell(votable *in)
{
    static const char blanks[] = " \t\r\n,";
    if (!in->in_row || in->cell >= in->nfields) {
        fail(in, RX_INPUT,
             in->in_row ? "a row has more cells than the table has fields" : "a cell has no row");
        return;
    }
    field *f = &in->fields[in->cell++];
    const char *text = in->text.data != NULL && in->text.length > 0 ? in->text.data : "";
    if (f->column.type == RX_CELL_TEXT) {
        store_text(in, f, text);
        return;
    }
    long elements = rx_column_elements(&f->column);
    for (long e = 0; e < elements; e++) {
        text += strspn(text, blanks);
        size_t length = strcspn(text, blanks);
        if (!store_number(f, in->nrows * elements + e, text, length)) {
            fail(in, RX_INPUT, "a cell that should hold a number does not");
            return;
        }
        text += length;
    }
    if (text[strspn(text, blanks)] != '\0')
        fail(in, RX_INPUT, "a cell holds more numbers than its field says");
}

static void XMLCALL on_begin(void *user, const char *name, const char **attributes)
{
    votable *in = user;
    name = local_name(name);
    if (in->done || in->status != RX_OK)
        return;
    if (strcmp(name, "TABLE") == 0) {
        if (in->inside)
            fail(in, RX_INPUT, "a TABLE stands within a TABLE");
        in->inside = in->tables++ == in->wanted;
        if (in->inside)
            copy_attribute(attributes, "name", in->name, sizeof in->name);
    }
    if (!in->inside)
        return;
    if (strcmp(name, "FIELD") == 0)
        begin_field(in, attributes);
    else if (strcmp(name, "DESCRIPTION") == 0)
        in->in_description = in->in_field;
    else if (strcmp(name, "VALUES") == 0 && in->in_field)
        copy_attribute(attributes, "null", in->fields[in->nfields - 1].null, sizeof in->fields->null);
    else if (strcmp(name, "TR") == 0)
        begin_row(in);
    else if (strcmp(name, "TD") == 0)
        in->in_cell = true;
    else if (strcmp(name, "BINARY") == 0 || strcmp(name, "BINARY2") == 0)
        in->binary = name[6] == '2' ? 2 : 1;
    else if (strcmp(name, "STREAM") == 0 && in->binary > 0)
        begin_stream(in, attributes);
    else if (strcmp(name, "FITS") == 0)
        fail(in, RX_INPUT, "the VOTable holds a FITS file; save it as TABLEDATA or FITS");
    if (in->in_cell || in->in_description || in->in_stream)
        in->text.length = 0;
}

static void XMLCALL on_text(void *user, const char *text, int length)
{
    votable *in = user;
    if (!in->in_cell && !in->in_description && !in->in_stream)
        return;
    if (in->in_stream && in->text.length + (size_t)length > RX_READ_BYTES)
        fail(in, RX_INPUT, "the table is too large; give it as FITS");
    else if (!in->in_stream && in->text.length + (size_t)length > CELL_BYTES)
        fail(in, RX_INPUT, "a cell is longer than a megabyte");
    else
        rx_text_add_bytes(&in->text, text, (size_t)length);
    if (in->text.failed)
        fail(in, RX_SYSTEM, "");
}

static void XMLCALL on_end(void *user, const char *name)
{
    votable *in = user;
    name = local_name(name);
    if (!in->inside || in->status != RX_OK)
        return;
    if (strcmp(name, "TD") == 0) {
        in->in_cell = false;
        end_cell(in);
    } else if (strcmp(name, "TR") == 0) {
        if (in->cell < in->nfields)
            fail(in, RX_INPUT, "a row has fewer cells than the table has fields");
        in->in_row = false;
        in->nrows++;
    } else if (strcmp(name, "STREAM") == 0 && in->in_stream) {
        in->in_stream = false;
        take_stream(in);
    } else if (strcmp(name, "FIELD") == 0) {
        in->in_field = false;
    } else if (strcmp(name, "DESCRIPTION") == 0 && in->in_description) {
        in->in_description = false;
        if (in->text.length > 0)
            snprintf(in->fields[in->nfields - 1].column.description, sizeof in->fields->column.description,
                     "%s", in->text.data);
    } else if (strcmp(name, "TABLE") == 0) {
        in->inside = false;
        in->done = true;
    }
}

/* No table needs entities of its own, and with them a small file can grow without end. */
static void XMLCALL on_entity(void *user, const XML_Char *name, int is_parameter, const XML_Char *value,
                              int value_length, const XML_Char *base, const XML_Char *system_id,
                              const XML_Char *public_id, const XML_Char *notation)
{
    (void)name, (void)is_parameter, (void)value, (void)value_length;
    (void)base, (void)system_id, (void)public_id, (void)notation;
    fail(user, RX_INPUT, "the file declares XML entities, which no VOTable needs");
}

static rx_status parse(votable *in, FILE *file)
{
    bool end = false;
    while (!end && in->status == RX_OK) {
        void *buffer = XML_GetBuffer(in->parser, CHUNK);
        if (buffer == NULL)
            return rx_error_memory(in->err, CHUNK);
        size_t n = fread(buffer, 1, CHUNK, file);
        if (ferror(file))
            return rx_error_file(in->err, in->path, "cannot be read");
        end = feof(file) != 0;
        const bool parsed = XML_ParseBuffer(in->parser, (int)n, end) == XML_STATUS_OK;
        if (!parsed && XML_GetErrorCode(in->parser) == XML_ERROR_NO_MEMORY)
            return rx_error_memory(in->err, CHUNK);
        if (!parsed && in->status == RX_OK)
            return rx_error_at(in->err, RX_INPUT, in->path, -1, (long)XML_GetCurrentLineNumber(in->parser),
                               "is not well-formed XML: %s", XML_ErrorString(XML_GetErrorCode(in->parser)));
    }
    if (in->status == RX_OK && !in->done)
        return rx_error_at(in->err, RX_INPUT, in->path, -1, 0,
                           "holds %d VOTable TABLE elements, number %d was asked", in->tables,
                           in->wanted + 1);
    return in->status;
}

/* Offsets become texts; integers with nulls become doubles, in place. */
static rx_status settle(votable *in, field *f)
{
    rx_column *column = &f->column;
    long n = in->nrows * rx_column_elements(column);
    if (column->data == NULL && (column->data = rx_alloc(1, 8)) == NULL)
        return rx_error_memory(in->err, 8);
    if (column->type == RX_CELL_TEXT) {
        column->text_width = (int)f->longest + 1;
        char *texts = NULL;
        if ((size_t)n <= 2 * RX_READ_BYTES / (size_t)column->text_width)
            texts = rx_alloc((size_t)n, (size_t)column->text_width);
        if (texts == NULL)
            return rx_error_memory(in->err, (size_t)n * (size_t)column->text_width);
        for (long i = 0; i < n; i++)
            snprintf(texts + i * column->text_width, (size_t)column->text_width, "%s",
                     in->pool.data + ((int64_t *)column->data)[i]);
        free(column->data);
        column->data = texts;
    } else if (column->type == RX_CELL_INT64 && f->has_null) {
        for (long i = 0; i < n; i++) {
            int64_t integer = ((int64_t *)column->data)[i];
            double value = integer == NO_INTEGER ? NAN : (double)integer;
            memcpy((char *)column->data + i * 8, &value, 8);
        }
        column->type = RX_CELL_DOUBLE;
    }
    return RX_OK;
}

static rx_status make_table(votable *in, rx_table **dst)
{
    for (int i = 0; i < in->nfields; i++)
        RX_TRY(settle(in, &in->fields[i]));
    rx_table *table = rx_table_new(in->nfields);
    if (table != NULL) {
        free(table->name);
        table->name = rx_strdup(in->name);
    }
    if (table == NULL || table->name == NULL) {
        rx_table_free(table);
        return rx_error_memory(in->err, (size_t)in->nfields * sizeof(rx_column));
    }
    table->nrows = in->nrows;
    for (int i = 0; i < in->nfields; i++) {
        table->columns[i] = in->fields[i].column;
        in->fields[i].column.data = NULL;
    }
    *dst = table;
    return RX_OK;
}

rx_status rx_votable_read(const char *path, int index, rx_table **dst, rx_error *err)
{
    rx_status status = RX_OK;
    votable in = {.path = path, .wanted = index, .err = err};
    FILE *file = rx_input_open(path);
    if (file == NULL)
        return rx_error_file(err, path, "cannot be opened");
    in.fields = RX_NEW(field, RX_READ_COLUMNS);
    in.parser = XML_ParserCreate(NULL);
    if (in.fields == NULL || in.parser == NULL)
        RX_TRY_EXIT(rx_error_memory(err, RX_READ_COLUMNS * sizeof(field)));
    XML_SetUserData(in.parser, &in);
    XML_SetElementHandler(in.parser, on_begin, on_end);
    XML_SetCharacterDataHandler(in.parser, on_text);
    XML_SetEntityDeclHandler(in.parser, on_entity);
    RX_TRY_EXIT(parse(&in, file));
    if (in.nfields == 0)
        RX_TRY_EXIT(rx_error_at(err, RX_INPUT, path, -1, 0, "the VOTable's TABLE has no FIELD"));
    status = make_table(&in, dst);
exit:
    if (in.parser != NULL)
        XML_ParserFree(in.parser);
    for (int i = 0; in.fields != NULL && i < in.nfields; i++)
        free(in.fields[i].column.data);
    free(in.fields);
    rx_text_free(&in.text);
    rx_text_free(&in.pool);
    fclose(file);
    return status;
}
