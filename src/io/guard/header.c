/* cfitsio looks for a keyword in ways of its own: capitals or not, behind HIERARCH, up to the first blank or '='
 * wherever '=' stands, and of two it takes the first here and the last there. A second reader that does all of
 * that the same cannot be kept right. So its ways are followed only as far as to see which cards it could take for
 * a keyword that counts; what such a card says is read by the standard's grammar (FITS 4.0, section 4) and written
 * anew from what was read, in one form that leaves nothing to be read in two ways. */
#include "io/guard/guard.h"

#include <stdarg.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "io/cards.h"

/* MOST_DIGITS: of a whole number that an int64 holds; LONGEST: values of such that cfitsio's messages have room for. */
enum { MOST_DIGITS = 18, LONGEST = 24 };

typedef enum kind { WHOLE, NUMBER, LOGICAL, TEXT } kind;
enum { IMAGE = 1, TABLE = 2, COMPRESSED = 4 };

/* The keywords by which cfitsio asks for memory, finds its way, or makes pixels and cells of bytes. '#': numbered
 * from 1. is_optional: it does without one that it cannot read, and so it always has. */
static const struct rule {
    const char *name;
    kind kind;
    int where;
    bool is_optional;
} rules[] = {
    {"BITPIX", WHOLE, IMAGE | TABLE, false},
    {"NAXIS", WHOLE, IMAGE | TABLE, false},
    {"NAXIS#", WHOLE, IMAGE | TABLE, false},
    {"PCOUNT", WHOLE, IMAGE | TABLE, false},
    {"GCOUNT", WHOLE, IMAGE | TABLE, false},
    {"GROUPS", LOGICAL, IMAGE, false},
    {"BSCALE", NUMBER, IMAGE | COMPRESSED, true},
    {"BZERO", NUMBER, IMAGE | COMPRESSED, true},
    {"BLANK", WHOLE, IMAGE | COMPRESSED, true},
    {"TFIELDS", WHOLE, TABLE, false},
    {"THEAP", WHOLE, TABLE, false},
    {"TFORM#", TEXT, TABLE, false},
    {"TBCOL#", WHOLE, TABLE, false},
    {"TTYPE#", TEXT, TABLE, true},
    {"TDIM#", TEXT, TABLE, true},
    {"TSCAL#", NUMBER, TABLE, true},
    {"TZERO#", NUMBER, TABLE, true},
    {"TNULL#", WHOLE, TABLE, true},
    {"ZIMAGE", LOGICAL, TABLE, false},
    {"ZTENSION", TEXT, COMPRESSED, false},
    {"ZBITPIX", WHOLE, COMPRESSED, false},
    {"ZNAXIS", WHOLE, COMPRESSED, false},
    {"ZNAXIS#", WHOLE, COMPRESSED, false},
    {"ZPCOUNT", WHOLE, COMPRESSED, false},
    {"ZGCOUNT", WHOLE, COMPRESSED, false},
    {"ZTILE#", WHOLE, COMPRESSED, false},
    {"ZCMPTYPE", TEXT, COMPRESSED, false},
    {"ZNAME#", TEXT, COMPRESSED, false},
    {"ZVAL#", NUMBER, COMPRESSED, false},
    {"ZQUANTIZ", TEXT, COMPRESSED, false},
    {"ZDITHER0", WHOLE, COMPRESSED, false},
    {"ZBLANK", WHOLE, COMPRESSED, false},
    {"ZSCALE", NUMBER, COMPRESSED, false},
    {"ZZERO", NUMBER, COMPRESSED, false},
};
enum { RULES = sizeof rules / sizeof *rules, NUMBERS = RX_FITS_FIELDS + 1 };

static void set_fault(rx_fits_header *header, const char *format, ...)
{
    va_list list;
    va_start(list, format);
    vsnprintf(header->fault, sizeof header->fault, format, list);
    va_end(list);
}

/* --- what cfitsio sees in a card --- */

/* A card as C sees it. `name`: the keyword that cfitsio finds, in capitals; `value`: where it takes the value
 * from, blanks skipped; NULL: there is none. */
typedef struct seen {
    char text[RX_CARD + 1], name[RX_CARD + 1];
    const char *value;
    bool is_end;
} seen;

static void look(const char *card, seen *dst)
{
    memcpy(dst->text, card, RX_CARD);
    dst->text[RX_CARD] = '\0';
    const char *equals = strchr(dst->text, '='), *name = dst->text;
    size_t n = strcspn(name, " =");
    if (strncmp(name, "HIERARCH ", RX_CARD_KEY + 1) == 0 && equals != NULL) {
        name += RX_CARD_KEY + 1 + strspn(name + RX_CARD_KEY + 1, " ");
        for (n = (size_t)(equals - name); n > 0 && name[n - 1] == ' ';)
            n--;
    } else if (strncmp(name, "COMMENT ", RX_CARD_KEY) == 0 || strncmp(name, "HISTORY ", RX_CARD_KEY) == 0 ||
               strncmp(name, "CONTINUE", RX_CARD_KEY) == 0 || strncmp(name, "        ", RX_CARD_KEY) == 0) {
        equals = NULL;
    } else if (strlen(name) > RX_CARD_KEY && strncmp(name + RX_CARD_KEY, "= ", 2) == 0) {
        equals = name + RX_CARD_KEY;
    }
    dst->is_end = n == 3 && strncmp(name, "END", 3) == 0;
    for (size_t i = 0; i < n; i++)
        dst->name[i] = name[i] >= 'a' && name[i] <= 'z' ? (char)(name[i] - 'a' + 'A') : name[i];
    dst->name[n] = '\0';
    dst->value = equals != NULL ? equals + 1 + strspn(equals + 1, " ") : NULL;
}

/* KEYWORD and '=' in their columns; small letters are as good, and the blank behind '=' may be missing. */
static bool is_plain(const seen *s)
{
    const size_t n = strlen(s->name);
    return n <= RX_CARD_KEY && strncmp(s->text, "HIERARCH", RX_CARD_KEY) != 0 &&
           strcspn(s->text, " =") == n && n + strspn(s->text + n, " ") == RX_CARD_KEY &&
           s->text[RX_CARD_KEY] == '=';
}

/* Row of `rules` that the name belongs to, -1: none. *number: 0 for a name without one; -1: it is a name for
 * cfitsio alone. */
static int rule_of(const char *name, int *number)
{
    for (int r = 0; r < RULES; r++) {
        const size_t n = strcspn(rules[r].name, "#");
        if (strncmp(name, rules[r].name, n) != 0)
            continue;
        const char *rest = name + n;
        const bool is_numbered = rules[r].name[n] == '#', is_column = name[0] == 'T';
        const size_t digits = strspn(rest, "0123456789");
        if (is_numbered && rest[0] >= '1' && rest[0] <= '9' && digits <= 3 && rest[digits] == '\0') {
            *number = atoi(rest);
            return r;
        }
        char *end; /* cfitsio takes TFORM01 for a column's, too */
        (void)strtol(rest, &end, 10);
        const bool is_loose = end != rest && (*end == '\0' || *end == ' ');
        *number = is_numbered || rest[0] != '\0' ? -1 : 0;
        if (*number == 0 || (is_column && (is_numbered ? is_loose : strcmp(rules[r].name, "THEAP") == 0)))
            return r;
    }
    return -1;
}

/* --- the value of a card --- */

typedef struct token {
    const char *begin, *end;
    bool is_quoted, is_open; /* a text; one without its closing quote */
} token;

static token token_of(const char *value)
{
    token t = {.begin = value, .end = value + strcspn(value, " /")};
    if (value[0] == '\'') {
        const char *end = value + strlen(value);
        t.is_quoted = true;
        t.end = rx_card_text_end(value, end);
        t.is_open = t.end == NULL;
        if (t.is_open)
            t.end = end;
    }
    return t;
}

static bool is_whole(const char *c, const char *end)
{
    c += c < end && (*c == '+' || *c == '-');
    return c < end && end - c <= MOST_DIGITS && strspn(c, "0123456789") >= (size_t)(end - c);
}

/* The value that a keyword of that kind has, into dst; false: it is no such value. A number in quotes is one, a
 * word without them a text: cfitsio takes them so. An exponent it knows by the capital alone. */
static bool read_value(kind kind, token t, char dst[RX_CARD + 2])
{
    const char *quote = "";
    if (kind == NUMBER && t.is_quoted && !t.is_open) {
        for (t.begin++, t.end--; t.begin < t.end && *t.begin == ' ';)
            t.begin++;
        while (t.end > t.begin && t.end[-1] == ' ')
            t.end--;
    } else if (kind == TEXT && !t.is_quoted) {
        quote = "'";
    }
    snprintf(dst, RX_CARD + 2, "%s%.*s%s", quote, (int)(t.end - t.begin), t.begin, quote);
    for (char *c = dst; kind == NUMBER && *c != '\0'; c++)
        *c = *c == 'e' ? 'E' : *c == 'd' ? 'D' : *c;
    if (kind == TEXT) {
        const char *c = t.begin;
        while (c < t.end && *c >= ' ' && *c <= '~')
            c++;
        return !t.is_open && t.end > t.begin && c == t.end;
    }
    return kind == WHOLE    ? is_whole(t.begin, t.end)
           : kind == NUMBER ? rx_card_number_end(t.begin, t.end) == t.end
                            : t.end == t.begin + 1 && (*t.begin == 'T' || *t.begin == 'F');
}

/* `NAME    = value / comment`, with blanks to taste before value and slash. */
static bool is_written(const seen *s, const char *value)
{
    const size_t n = strlen(s->name), length = strlen(value);
    const char *rest = s->value + length;
    rest += strncmp(s->value, value, length) == 0 ? strspn(rest, " ") : 0;
    return strncmp(s->text, s->name, n) == 0 && strncmp(s->text + RX_CARD_KEY, "= ", 2) == 0 &&
           strncmp(s->value, value, length) == 0 && (*rest == '/' || *rest == '\0');
}

/* The card anew, the comment behind `rest` with it as far as there is room. false: the value has none. */
static bool write_card(char *card, const char *name, const char *value, const char *rest)
{
    char text[3 * RX_CARD];
    rest += strspn(rest, " /");
    int n = snprintf(text, sizeof text, *value == '\'' ? "%-8s= %-20s" : "%-8s= %20s", name, value);
    if (n > RX_CARD)
        return false;
    n += snprintf(text + n, sizeof text - (size_t)n, "%s%s", *rest != '\0' ? " / " : "", rest);
    for (; n < RX_CARD; n++)
        text[n] = ' ';
    memcpy(card, text, RX_CARD);
    return true;
}

/* --- the cards --- */

/* Where the card of each keyword stands, from 1; 0: it does not. */
typedef int places[RULES][NUMBERS];

/* The value of the keyword as it now stands; empty where it has none. */
static token value_of(const rx_fits_header *h, const int *place, seen *s)
{
    static const char none[] = "";
    if (*place == 0)
        return token_of(none);
    look(h->cards.data + (size_t)(*place - 1) * RX_CARD, s);
    return token_of(s->value != NULL ? s->value : none);
}

/* Is a value longer than cfitsio has room for: what it takes for a number, a text of a column, any text? */
static bool is_too_long(const seen *s, bool is_table)
{
    static const char *const keys[] = {"BITPIX",   "NAXIS",   "PCOUNT", "GCOUNT",  "TFIELDS",
                                       "THEAP",    "TNULL",   "TBCOL",  "BLANK",   "EXTVER",
                                       "EXTLEVEL", "ZBITPIX", "ZNAXIS", "ZTILE",   "ZVAL",
                                       "ZPCOUNT",  "ZGCOUNT", "ZBLANK", "ZDITHER0"};
    bool is_count = false;
    if (s->value == NULL)
        return false;
    for (size_t i = 0; i < sizeof keys / sizeof *keys && !is_count; i++)
        is_count = strncmp(s->name, keys[i], strlen(keys[i])) == 0;
    const char *stop = strchr(s->value, s->value[0] == '(' ? ')' : '/'), *end = s->value + strlen(s->value);
    const token t = token_of(s->value);
    if (t.is_quoted)
        end = t.end;
    else if (stop != NULL)
        end = stop + (*stop == ')');
    while (end > s->value && end[-1] == ' ')
        end--;
    const ptrdiff_t length = end - s->value;
    return (is_count && length > LONGEST) || (t.is_quoted && length > RX_CARD_TEXT + 2) ||
           (is_table && !t.is_quoted && length > RX_CARD_TEXT);
}

/* The card anew where it is not as it would be written. */
static void rewrite(rx_fits_header *h, char *card, const seen *s, const char *value, const char *rest)
{
    if (is_written(s, value))
        return;
    h->is_rebuilt = true;
    if (!write_card(card, s->name, value, rest))
        set_fault(h, "%s is longer than a card; the header is damaged", s->name);
}

/* Card i, which cfitsio takes for keyword `number` of a rule. */
static void take(rx_fits_header *h, size_t i, const seen *s, int r, int number, places *at)
{
    char *card = h->cards.data + i * RX_CARD, value[RX_CARD + 2];
    const bool optional = rules[r].is_optional;
    if (number < 0 || (!is_plain(s) && !(optional && s->value == NULL))) {
        size_t length = strnlen(s->text, 40);
        while (length > 0 && s->text[length - 1] == ' ')
            length--;
        set_fault(h,
                  "the card '%.*s' is %s to some programs and not to others; write '%-8s= ...', or remove it",
                  (int)length, s->text, s->name, s->name);
        return;
    }
    int *place = &(*at)[r][number];
    if (*place > 0 && strncmp(s->text, s->name, strlen(s->name)) != 0) {
        memset(card, ' ', RX_CARD); /* small letters make no keyword beside one */
        h->is_rebuilt = true;
        return;
    }
    const token t = s->value != NULL ? token_of(s->value) : (token){0};
    const bool is_read = s->value != NULL && read_value(rules[r].kind, t, value);
    if (!is_read && !optional) {
        int length = (int)(t.end - t.begin < 40 ? t.end - t.begin : 40);
        while (length > 0 && t.begin[length - 1] == ' ')
            length--;
        set_fault(h, "%s = %.*s is %s; the header is damaged, fetch the file again", s->name, length,
                  length > 0 ? t.begin : "",
                  rules[r].kind == TEXT      ? "no text in quotes"
                  : rules[r].kind == LOGICAL ? "neither T nor F"
                  : rules[r].kind == WHOLE   ? "no whole number of at most 18 digits"
                                             : "no number");
        return;
    }
    if (is_read)
        rewrite(h, card, s, value, t.end);
    const int own = (int)i + 1;
    if (*place == 0)
        *place = own;
    seen one, other;
    const token a = value_of(h, place, &one), b = value_of(h, &own, &other);
    if (a.end - a.begin != b.end - b.begin || memcmp(a.begin, b.begin, (size_t)(a.end - a.begin)) != 0)
        set_fault(h, "%s is there twice, and not the same; take one of the two out", s->name);
}

/* What cfitsio takes for a table. */
static bool is_table_type(const char *text)
{
    static const char *const types[] = {"BINTABLE", "TABLE", "A3DTABLE", "3DTABLE"};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        const size_t n = strlen(types[i]);
        const char *c = text + 1 + strspn(text + 1, " ");
        if (strncmp(c, types[i], n) == 0 && c[n + strspn(c + n, " ")] == '\'')
            return true;
    }
    return false;
}

/* The first card; IMAGE or TABLE. */
static int take_first(rx_fits_header *h)
{
    seen s;
    char value[RX_CARD + 2];
    look(h->cards.data, &s);
    if (strncmp(s.text, "XTENSION", RX_CARD_KEY) != 0)
        return IMAGE;
    const token t = s.value != NULL ? token_of(s.value) : (token){0};
    if (!is_plain(&s) || !t.is_quoted || !read_value(TEXT, t, value)) {
        set_fault(h, "XTENSION is no text in quotes; the header is damaged");
        return IMAGE;
    }
    rewrite(h, h->cards.data, &s, value, t.end);
    return is_table_type(value) ? TABLE : IMAGE;
}

static bool is_compressed(const rx_fits_header *h)
{
    seen s;
    for (size_t i = 1; i < h->cards.length / RX_CARD; i++) {
        look(h->cards.data + i * RX_CARD, &s);
        if (strcmp(s.name, "ZIMAGE") == 0 && s.value != NULL && s.value[0] == 'T')
            return true;
    }
    return false;
}

/* --- what they say together --- */

static int row(const char *name)
{
    int r = 0;
    while (strcmp(rules[r].name, name) != 0)
        r++;
    return r;
}

static bool is_positive(const rx_fits_header *h, const int *place)
{
    seen s;
    const token t = value_of(h, place, &s);
    return is_whole(t.begin, t.end) && strtoll(t.begin, NULL, 10) > 0;
}

/* How a table begins (FITS 4.0, sections 7.2.1 and 7.3.1): without these cfitsio asks for memory by a number that
 * it never read. */
static void check_table(rx_fits_header *h, places *at)
{
    static const char *const order[] = {"XTENSION", "BITPIX", "NAXIS",  "NAXIS1",
                                        "NAXIS2",   "PCOUNT", "GCOUNT", "TFIELDS"};
    enum { ALL = sizeof order / sizeof *order };
    seen s = {0};
    bool is_right = h->cards.length / RX_CARD >= ALL;
    for (size_t i = 1; i < ALL && is_right; i++) {
        look(h->cards.data + i * RX_CARD, &s);
        is_right = strcmp(s.name, order[i]) == 0 && strchr("+-", s.value[0]) == NULL;
    }
    if (!is_right || strtoll(value_of(h, &(*at)[row("TFIELDS")][0], &s).begin, NULL, 10) > RX_FITS_FIELDS)
        set_fault(h, "the table does not begin with XTENSION, BITPIX, NAXIS, NAXIS1, NAXIS2, PCOUNT, GCOUNT, "
                     "TFIELDS (999 at most); the header is damaged");
}

/* cfitsio divides by the sizes of tiles and of Rice's blocks as soon as it moves to the HDU. */
static void check_compressed(rx_fits_header *h, places *at)
{
    seen s;
    const int *tiles = (*at)[row("ZTILE#")], *values = (*at)[row("ZVAL#")];
    for (int n = 1; n < NUMBERS; n++)
        if (tiles[n] > 0 && !is_positive(h, &tiles[n]))
            set_fault(h, "ZTILE%d of the compressed image is no size of a tile; the header is damaged", n);
    const token type = value_of(h, &(*at)[row("ZCMPTYPE")][0], &s);
    if (strncmp(type.begin, "'RICE", 5) == 0 && values[1] > 0 && !is_positive(h, &values[1]))
        set_fault(h, "ZVAL1 of the compressed image is no size of a block; the header is damaged");
}

rx_status rx_fits_header_rebuild(rx_fits_header *h, rx_error *err)
{
    places *at;
    rx_status status = RX_MAKE(at, 1, err);
    if (status != RX_OK)
        return status;
    int where = take_first(h);
    if (where == TABLE && is_compressed(h))
        where |= COMPRESSED;
    for (size_t i = 1; i < h->cards.length / RX_CARD && h->fault[0] == '\0'; i++) {
        seen s;
        int number = 0;
        look(h->cards.data + i * RX_CARD, &s);
        const int r = rule_of(s.name, &number);
        if (is_too_long(&s, where != IMAGE))
            set_fault(h, "a value is longer than any of its kind; the header is damaged");
        else if (r >= 0 && (rules[r].where & where) != 0)
            take(h, i, &s, r, number, at);
    }
    if (h->fault[0] == '\0' && where != IMAGE)
        check_table(h, at);
    if (h->fault[0] == '\0' && (where & COMPRESSED) != 0)
        check_compressed(h, at);
    free(at);
    return RX_OK;
}

bool rx_fits_is_end(const char *card)
{
    seen s;
    look(card, &s);
    return s.is_end;
}
