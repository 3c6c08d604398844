/* The .param file: which columns, how long their vectors; its dump and its man table. */
#include <ctype.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/lines.h"
#include "base/memory.h"
#include "catalog/assoc.h"
#include "catalog/catalog.h"
#include "catalog/columns.h"

enum { NAMES_SHOWN = 12, VIGNET_LIMIT = 1024 };

/* Names met in the file that deserve one common warning. */
typedef struct names {
    rx_text text;
    int n;
} names;

static void names_add(names *dst, const char *name)
{
    if (dst->n < NAMES_SHOWN)
        rx_text_printf(&dst->text, "%s%s", dst->n > 0 ? ", " : "", name);
    else if (dst->n == NAMES_SHOWN)
        rx_text_add(&dst->text, ", ...");
    dst->n++;
}

/* A column of SExtractor's that is not offered? */
static bool is_missing(const char *name)
{
    static const char missing[] =
#include "catalog/missing.def"
        ;
    const size_t length = strlen(name);
    for (const char *at = missing; *at != '\0'; at += strcspn(at, " ") + 1)
        if (strcspn(at, " ") == length && strncasecmp(at, name, length) == 0)
            return true;
    return false;
}

static rx_status unknown_name(const char *path, long line, const char *name, rx_error *err)
{
    int n;
    const rx_column_def *defs = rx_column_defs(&n);
    const char **all = RX_NEW(const char *, (size_t)n);
    const char *near = NULL;
    for (int i = 0; all != NULL && i < n; i++)
        all[i] = defs[i].name;
    if (all != NULL)
        near = rx_text_nearest(name, all, (size_t)n);
    free(all);
    if (near != NULL)
        return rx_error_at(err, RX_USAGE, path, -1, line, "unknown column '%.60s'; did you mean %s?", name,
                           near);
    return rx_error_at(err, RX_USAGE, path, -1, line, "unknown column '%.60s'; -dp lists all columns", name);
}

/* Most elements of a vector, or of each side of an image, that may be asked of a column. */
static int limit_of(const rx_column_def *def)
{
    if (def->naxis == 2)
        return VIGNET_LIMIT;
    if (strcmp(def->name, "FLUX_RADIUS") == 0)
        return RX_MAX_RADII;
    if (strcmp(def->name, "VECTOR_ASSOC") == 0)
        return RX_ASSOC_COLUMNS;
    return strstr(def->name, "IMAFLAGS") != NULL ? RX_MAX_FLAGMAPS : RX_MAX_APERTURES;
}

/* `(5)`, `[35,35]`, `{2}` right behind the name or, as SExtractor also takes it, ` 5`. Further
 * words of the line (the description that -dp prints) mean nothing. */
static rx_status parse_dimensions(const char *path, long line, const char *text, const rx_column_def *def,
                                  int dim[2], rx_error *err)
{
    static const char brackets[] = "([{";
    bool attached = *text != '\0' && strchr(brackets, *text) != NULL;
    if (def->naxis == 0 && attached)
        return rx_error_at(err, RX_USAGE, path, -1, line, "%s holds one value; leave out '%.40s'", def->name,
                           text);
    if (def->naxis == 0)
        return RX_OK;
    int count = 0, limit = limit_of(def);
    dim[0] = 1;
    dim[1] = def->naxis == 2;
    text += strspn(text, " \t");
    bool bracket = *text != '\0' && strchr(brackets, *text) != NULL;
    if (!bracket && !isdigit((unsigned char)*text))
        return RX_OK;
    text += bracket;
    while (*(text += strspn(text, " \t,;.")) != '\0' && strchr(")]}", *text) == NULL) {
        char *end;
        long value = strtol(text, &end, 10);
        if (end == text || count >= def->naxis || value < 1 || value > limit)
            return rx_error_at(err, RX_USAGE, path, -1, line,
                               "bad dimension of %s at '%.40s'; give %s of 1 to %d, such as %s%s", def->name,
                               text, def->naxis == 2 ? "two numbers" : "one number", limit, def->name,
                               def->naxis == 2 ? "(35,35)" : "(3)");
        dim[count++] = (int)value;
        text = end;
    }
    return RX_OK;
}

/* NAME, or NAME(dimensions); index -1 for a column of SExtractor's that is not offered. Its name as it stands. */
static rx_status parse_choice(const char *path, long line, const char *text, char name[64],
                              rx_column_choice *dst, rx_error *err)
{
    const size_t length = strcspn(text, " \t{[(");
    int count;
    if (length == 0 || length >= 64)
        return unknown_name(path, line, text, err);
    memcpy(name, text, length);
    name[length] = '\0';
    *dst = (rx_column_choice){.index = rx_column_index(name)};
    if (dst->index < 0)
        return is_missing(name) ? RX_OK : unknown_name(path, line, name, err);
    return parse_dimensions(path, line, text + length, &rx_column_defs(&count)[dst->index], dst->dim, err);
}

/* One line without its comment; blank lines are fine. */
static rx_status parse_line(const char *path, long line, char *text, rx_column_list *list, names *left_out,
                            names *twice, rx_error *err)
{
    text[strcspn(text, "#")] = '\0';
    text += strspn(text, " \t\r\f\v");
    for (size_t n = strlen(text); n > 0 && isspace((unsigned char)text[n - 1]); n--)
        text[n - 1] = '\0';
    if (*text == '\0')
        return RX_OK;
    char name[64];
    rx_column_choice choice;
    RX_TRY(parse_choice(path, line, text, name, &choice, err));
    if (choice.index < 0) {
        names_add(left_out, name);
        return RX_OK;
    }
    for (int i = 0; i < list->n; i++)
        if (list->choice[i].index == choice.index) {
            names_add(twice, name);
            return RX_OK;
        }
    list->choice[list->n++] = choice;
    return RX_OK;
}

/* A list without columns that has room for n. */
static rx_status new_list(int n, rx_column_list **dst, rx_error *err)
{
    rx_column_list *list;
    RX_TRY(RX_MAKE(list, 1, err));
    const rx_status status = RX_MAKE(list->choice, (size_t)n, err);
    if (status == RX_OK)
        *dst = list;
    else
        free(list);
    return status;
}

rx_status rx_columns_read(const char *path, rx_log *log, rx_column_list **dst, rx_error *err)
{
    names left_out = {0}, twice = {0};
    rx_lines lines = {0};
    rx_column_list *list = NULL;
    char *line = NULL;
    int n;
    rx_status status;
    rx_column_defs(&n);
    *dst = NULL;
    RX_TRY_EXIT(new_list(n, &list, err));
    RX_TRY_EXIT(rx_lines_open(&lines, path, 0, err));
    while ((status = rx_lines_next(&lines, &line, err)) == RX_OK && line != NULL)
        RX_TRY_EXIT(parse_line(path, lines.number, line, list, &left_out, &twice, err));
    if (status != RX_OK)
        goto exit;
    if (left_out.n > 0 && left_out.text.data != NULL)
        rx_log_warning(log, "%s: columns of SExtractor that are not offered here are left out: %s", path,
                       left_out.text.data);
    if (twice.n > 0 && twice.text.data != NULL)
        rx_log_warning(log, "%s: columns named twice are written once: %s", path, twice.text.data);
    if (list->n == 0)
        RX_TRY_EXIT(rx_error_at(err, RX_USAGE, path, -1, 0,
                                "chooses no column; name at least one of those that -dp lists"));
    *dst = list;
    list = NULL;
exit:
    rx_lines_close(&lines);
    rx_columns_free(list);
    rx_text_free(&left_out.text);
    rx_text_free(&twice.text);
    if (status == RX_INPUT && err != NULL) /* a file of the configuration, not data */
        err->status = RX_USAGE;
    return status == RX_INPUT ? RX_USAGE : status;
}

rx_status rx_columns_of(const char *const *names, int n, rx_column_list **dst, rx_error *err)
{
    char name[64];
    rx_column_list *list = NULL;
    *dst = NULL;
    rx_status status = new_list(n, &list, err);
    for (int i = 0; i < n && status == RX_OK; i++) {
        rx_column_choice *choice = &list->choice[list->n++];
        status = parse_choice(NULL, 0, names[i], name, choice, err);
        if (status == RX_OK && choice->index < 0)
            status = rx_error_set(err, RX_USAGE, "column %s of SExtractor is not offered here; leave it out",
                                  name);
    }
    if (status == RX_OK)
        *dst = list;
    else
        rx_columns_free(list);
    return status;
}

rx_status rx_columns_add(rx_column_list *list, const char *const *names, int n, rx_error *err)
{
    RX_TRY(RX_GROW(list->choice, (size_t)(list->n + n), err));
    for (int i = 0; i < n; i++)
        if (!rx_columns_requested(list, names[i], NULL))
            list->choice[list->n++] = (rx_column_choice){.index = rx_column_index(names[i])};
    return RX_OK;
}

rx_status rx_columns_need(rx_column_list *list, rx_catalog_type type, rx_error *err)
{
    static const char *const names[] = {"NUMBER",      "X_IMAGE",     "Y_IMAGE",     "A_IMAGE",     "B_IMAGE",
                                        "THETA_IMAGE", "KRON_RADIUS", "ALPHA_J2000", "DELTA_J2000", "A_WORLD",
                                        "B_WORLD",     "THETA_J2000", "FLAGS"};
    return type == RX_CATALOG_DS9 ? rx_columns_add(list, names, sizeof names / sizeof *names, err) : RX_OK;
}

rx_status rx_columns_default(rx_column_list **dst, rx_error *err)
{
    static const char *const names[] = {
        "NUMBER",       "ALPHA_J2000", "DELTA_J2000", "X_IMAGE",   "Y_IMAGE",      "XWIN_IMAGE",
        "YWIN_IMAGE",   "MAG_AUTO",    "MAGERR_AUTO", "FLUX_AUTO", "FLUXERR_AUTO", "FLUX_APER",
        "FLUXERR_APER", "MAG_APER",    "MAGERR_APER", "A_IMAGE",   "B_IMAGE",      "THETA_IMAGE",
        "ELLIPTICITY",  "FWHM_IMAGE",  "FLUX_RADIUS", "SNR_WIN",   "FLAGS",        "MASKED_FRACTION"};
    return rx_columns_of(names, sizeof names / sizeof *names, dst, err);
}

void rx_columns_free(rx_column_list *list)
{
    if (list != NULL)
        free(list->choice);
    free(list);
}

int rx_columns_requested(const rx_column_list *list, const char *name, int dim[2])
{
    const int index = rx_column_index(name);
    int i = 0;
    while (i < list->n && list->choice[i].index != index)
        i++;
    for (int k = 0; dim != NULL && k < 2; k++)
        dim[k] = i < list->n ? list->choice[i].dim[k] : 0;
    return i < list->n;
}

int rx_columns_mention(const rx_column_list *list, const char *part)
{
    int n;
    const rx_column_def *defs = rx_column_defs(&n);
    for (int i = 0; i < list->n; i++)
        if (strstr(defs[list->choice[i].index].name, part) != NULL)
            return 1;
    return 0;
}

void rx_columns_clip(rx_column_list *list, const char *name, int available, const char *keyword, rx_log *log)
{
    const int index = rx_column_index(name), shown = available > 0 ? available : 1;
    for (int i = 0; i < list->n; i++)
        if (list->choice[i].index == index && list->choice[i].dim[0] > shown) {
            rx_log_warning(log, "%s(%d) is cut to %d, as %s gives no more", name, list->choice[i].dim[0],
                           shown, keyword);
            list->choice[i].dim[0] = shown;
        }
}

void rx_columns_dump(rx_text *dst)
{
    int n;
    const rx_column_def *defs = rx_column_defs(&n);
    for (int i = 0; i < n; i++) {
        rx_text_printf(dst, "#%-24s %-57s", defs[i].name, defs[i].description);
        if (defs[i].unit[0] != '\0')
            rx_text_printf(dst, " [%s]", defs[i].unit);
        rx_text_add(dst, "\n");
    }
}
