/* Header cards in memory: finding, reading, building, choosing. */
#include "io/cards.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/point.h"
#include "base/text.h"

/* --- finding --- */

/* Where the value of a card begins (after "= "), NULL when it has none or is another key's. */
static const char *value_of(const char *card, const char *key)
{
    size_t length = strlen(key);
    if (length <= RX_CARD_KEY && strncasecmp(card, key, length) == 0) {
        size_t i = length;
        while (i < RX_CARD_KEY && card[i] == ' ')
            i++;
        if (i == RX_CARD_KEY && card[RX_CARD_KEY] == '=')
            return card + RX_CARD_KEY + 1;
    }
    if (length > RX_CARD_TEXT || strncmp(card, "HIERARCH ", 9) != 0 ||
        strncasecmp(card + 9, key, length) != 0)
        return NULL;
    const char *c = card + 9 + length;
    while (c < card + RX_CARD && *c == ' ')
        c++;
    return c < card + RX_CARD && *c == '=' ? c + 1 : NULL;
}

long rx_cards_find(const char *cards, size_t ncards, const char *key)
{
    if (key == NULL || key[0] == '\0')
        return -1;
    for (size_t i = 0; cards != NULL && i < ncards; i++)
        if (value_of(cards + i * RX_CARD, key) != NULL)
            return (long)i;
    return -1;
}

const char *rx_card_text_end(const char *c, const char *end)
{
    for (c++; c < end; c++) {
        if (*c != '\'')
            continue;
        if (c + 1 == end || c[1] != '\'')
            return c + 1;
        c++;
    }
    return NULL;
}

/* Append the text between quotes that begins at `c` (before `end`) to dst[*used]; 1 when it ends in '&'. */
static int add_quoted(const char *c, const char *end, char *dst, size_t size, size_t *used)
{
    for (c++; c < end; c++) {
        if (*c == '\'') {
            if (c + 1 >= end || c[1] != '\'')
                break;
            c++;
        }
        if (*used + 1 < size)
            dst[(*used)++] = *c;
    }
    while (*used > 0 && dst[*used - 1] == ' ')
        (*used)--;
    dst[*used] = '\0';
    return *used > 0 && dst[*used - 1] == '&';
}

int rx_cards_text(const char *cards, long ncards, const char *key, char *dst, int size)
{
    if (size > 0)
        dst[0] = '\0';
    long i = ncards > 0 ? rx_cards_find(cards, (size_t)ncards, key) : -1;
    if (i < 0 || size <= 0)
        return 0;
    const char *card = cards + i * RX_CARD, *end = card + RX_CARD, *c = value_of(card, key);
    while (c < end && *c == ' ')
        c++;
    size_t used = 0, capacity = (size_t)size;
    if (c >= end || *c != '\'') {
        for (; c < end && *c != '/'; c++)
            if (used + 1 < capacity)
                dst[used++] = *c;
        while (used > 0 && dst[used - 1] == ' ')
            used--;
        dst[used] = '\0';
        return used > 0;
    }
    int more = add_quoted(c, end, dst, capacity, &used);
    for (i++; more && i < ncards && strncmp(cards + i * RX_CARD, "CONTINUE  ", 10) == 0; i++) {
        card = cards + i * RX_CARD;
        const char *quote = memchr(card, '\'', RX_CARD);
        if (quote == NULL)
            break;
        dst[--used] = '\0';
        more = add_quoted(quote, card + RX_CARD, dst, capacity, &used);
    }
    return 1;
}

const char *rx_card_number_end(const char *c, const char *end)
{
    int digits = 0, points = 0;
    c += c < end && (*c == '+' || *c == '-');
    for (; c < end && (isdigit((unsigned char)*c) || (*c == '.' && points == 0)); c++) {
        points += *c == '.';
        digits += *c != '.';
    }
    if (digits == 0)
        return NULL;
    if (c < end && strchr("EeDd", *c) != NULL) {
        const char *power = c + 1 + (c + 1 < end && (c[1] == '+' || c[1] == '-'));
        while (power < end && isdigit((unsigned char)*power))
            c = ++power;
    }
    return c;
}

/* The number that `text` begins with; *end behind it and its blanks. 0: there is none, or none that is finite. */
static int leading_number(const char *text, const char **end, double *value)
{
    char number[RX_CARD];
    text += strspn(text, " ");
    *end = rx_card_number_end(text, text + strlen(text));
    if (*end == NULL)
        return 0;
    snprintf(number, sizeof number, "%.*s", (int)(*end - text), text);
    for (char *c = number; *c != '\0'; c++)
        if (*c == 'd' || *c == 'D')
            *c = 'E';
    const double found = rx_point_number(number, NULL);
    *end += strspn(*end, " ");
    if (!isfinite(found))
        return 0;
    *value = found;
    return 1;
}

int rx_cards_number(const char *cards, long ncards, const char *key, double *value)
{
    return rx_cards_quantity(cards, ncards, key, NULL, value);
}

int rx_cards_quantity(const char *cards, long ncards, const char *key, const char *unit, double *value)
{
    char text[RX_CARD + 1], spelling[RX_UNIT_TEXT], expected[RX_UNIT_TEXT];
    const char *end;
    double number;
    const long i = ncards > 0 ? rx_cards_find(cards, (size_t)ncards, key) : -1;
    if (i < 0 || !rx_cards_text(cards, ncards, key, text, sizeof text) ||
        !leading_number(text, &end, &number))
        return 0;
    if (*end != '\0' && unit == NULL)
        return 0;
    if (*end != '\0') {
        const char *c = value_of(cards + i * RX_CARD, key);
        c += strspn(c, " ");
        if (*c != '\'') { /* the slash of a unit is not that of the comment, which follows a blank */
            snprintf(text, sizeof text, "%.*s", (int)(cards + (i + 1) * RX_CARD - c), c);
            char *comment = strstr(text, " /");
            if (comment != NULL)
                *comment = '\0';
            (void)leading_number(text, &end, &number);
        }
        rx_unit_spelling(end, spelling);
        rx_unit_spelling(unit, expected);
        if (spelling[0] == '\0' || strcmp(spelling, expected) != 0)
            return 0;
    }
    *value = number;
    return 1;
}

int rx_cards_comment(const char *cards, long ncards, const char *key, char *dst, int size)
{
    const long i = ncards > 0 ? rx_cards_find(cards, (size_t)ncards, key) : -1;
    const char *end = cards + (i + 1) * RX_CARD, *c = i >= 0 ? value_of(cards + i * RX_CARD, key) : NULL;
    dst[0] = '\0';
    while (c != NULL && c < end && *c != '/')
        c++;
    if (c == NULL || c == end)
        return 0;
    for (c++; c < end && *c == ' ';)
        c++;
    while (end > c && end[-1] == ' ')
        end--;
    snprintf(dst, (size_t)size, "%.*s", (int)(end - c), c);
    return dst[0] != '\0';
}

/* --- units --- */

/* Only in Jy do capitals matter: mJy is no MJy. */
static const char *spelling_of(const char *word)
{
    static const char *const exact[] = {"Jy", "mJy", "uJy", "nJy", "MJy"};
    static const char *const others[][2] = {
        {"e", "e"},         {"e-", "e"},       {"el", "e"},           {"electron", "e"},
        {"electrons", "e"}, {"adu", "adu"},    {"dn", "adu"},         {"ct", "adu"},
        {"cts", "adu"},     {"count", "adu"},  {"counts", "adu"},     {"s", "s"},
        {"sec", "s"},       {"second", "s"},   {"seconds", "s"},      {"mag", "mag"},
        {"mags", "mag"},    {"deg", "deg"},    {"degree", "deg"},     {"degrees", "deg"},
        {"pix", "pix"},     {"pixel", "pix"},  {"pixels", "pix"},     {"sr", "sr"},
        {"nmgy", "nmgy"},   {"nmgys", "nmgy"}, {"nanomaggy", "nmgy"}, {"nanomaggies", "nmgy"},
        {"mgy", "mgy"},     {"maggy", "mgy"},  {"maggies", "mgy"},    {"microJy", "uJy"}};
    for (size_t i = 0; i < sizeof exact / sizeof *exact; i++)
        if (strcmp(word, exact[i]) == 0)
            return exact[i];
    for (size_t i = 0; i < sizeof others / sizeof *others; i++)
        if (strcasecmp(word, others[i][0]) == 0)
            return others[i][1];
    return NULL;
}

void rx_unit_spelling(const char *text, char dst[RX_UNIT_TEXT])
{
    const char *part[2] = {NULL, NULL}; /* it, and what it is per */
    bool per = false;
    dst[0] = '\0';
    if (strcasecmp(text, "cps") == 0)
        text = "adu/s";
    for (const char *c = text; *c != '\0';) {
        char word[RX_UNIT_TEXT] = "";
        size_t n = 0;
        if (strchr(" []()*./", *c) != NULL) {
            per = per || *c == '/';
            c++;
            continue;
        }
        while (isalpha((unsigned char)c[n]) || (n == 1 && c[n] == '-' && !isdigit((unsigned char)c[2])))
            n++;
        if (n == 0 || n >= sizeof word)
            return;
        memcpy(word, c, n);
        c += n;
        if (strcasecmp(word, "per") == 0) {
            per = true;
            continue;
        }
        for (size_t k = 0; k < 3; k++) { /* a power: only that of "s-1", "s^-1", "s**-1" */
            static const char *const powers[] = {"**-1", "^-1", "-1"};
            const size_t length = strlen(powers[k]);
            if (strncmp(c, powers[k], length) != 0)
                continue;
            per = true;
            c += length;
            break;
        }
        if (isdigit((unsigned char)*c) || part[per] != NULL || (part[per] = spelling_of(word)) == NULL)
            return;
    }
    if (part[0] != NULL)
        snprintf(dst, RX_UNIT_TEXT, "%s%s%s", part[0], per ? "/" : "", per && part[1] != NULL ? part[1] : "");
}

/* --- building --- */

/* One card of exactly 80 characters; what is not printable ASCII becomes '?'. */
static void add_card(rx_text *dst, const char *text)
{
    char card[RX_CARD];
    size_t length = strlen(text);
    for (size_t i = 0; i < RX_CARD; i++) {
        char c = i < length ? text[i] : ' ';
        card[i] = c >= 0x20 && c <= 0x7e ? c : '?';
    }
    rx_text_add_bytes(dst, card, RX_CARD);
}

/* "RX_CARD_KEY     = " or "HIERARCH some key = "; returns its length. */
static int key_part(char *dst, size_t size, const char *key)
{
    char upper[60];
    size_t n = 0;
    int simple = 1;
    for (; key[n] != '\0' && n + 1 < sizeof upper; n++) {
        upper[n] = (char)toupper((unsigned char)key[n]);
        if (!isalnum((unsigned char)key[n]) && key[n] != '-' && key[n] != '_')
            simple = 0;
    }
    upper[n] = '\0';
    return simple && n <= RX_CARD_KEY ? snprintf(dst, size, "%-8s= ", upper)
                                      : snprintf(dst, size, "HIERARCH %s = ", upper);
}

static void add_value(rx_text *dst, const char *key, const char *value, const char *comment)
{
    char text[256];
    int n = key_part(text, sizeof text, key);
    n += snprintf(text + n, sizeof text - (size_t)n, "%20s", value);
    if (comment != NULL && comment[0] != '\0')
        snprintf(text + n, sizeof text - (size_t)n, " / %.100s", comment);
    add_card(dst, text);
}

void rx_card_number(rx_text *dst, const char *key, double value, const char *comment)
{
    char text[40] = "";
    if (isfinite(value)) { /* otherwise the value stays undefined: FITS headers know no NaN */
        int digits = 15;
        rx_point_locale locale;
        (void)rx_point_locale_begin(&locale, NULL);
        do
            snprintf(text, sizeof text, "%.*G", digits, value);
        while (++digits <= 17 && strtod(text, NULL) != value);
        rx_point_locale_end(&locale);
        if (strpbrk(text, ".E") == NULL)
            strcat(text, ".");
    }
    add_value(dst, key, text, comment);
}

void rx_card_integer(rx_text *dst, const char *key, long value, const char *comment)
{
    char text[40];
    snprintf(text, sizeof text, "%ld", value);
    add_value(dst, key, text, comment);
}

/* Long strings go on in CONTINUE cards (FITS 4.0, 4.2.1.2); quotes are doubled. */
void rx_card_text(rx_text *dst, const char *key, const char *value, const char *comment)
{
    char text[256];
    int n = key_part(text, sizeof text, key);
    const char *c = value != NULL ? value : "";
    do {
        int room = RX_CARD - n - 2, used = 0, total = 0;
        for (const char *p = c; *p != '\0'; p++)
            total += *p == '\'' ? 2 : 1;
        int last = total <= room;
        text[n++] = '\'';
        while (*c != '\0') {
            int width = *c == '\'' ? 2 : 1;
            if (used + width > (last ? room : room - 1))
                break;
            if (width == 2)
                text[n++] = '\'';
            text[n++] = *c++;
            used += width;
        }
        for (; used < 8 && last; used++)
            text[n++] = ' ';
        if (!last)
            text[n++] = '&';
        text[n++] = '\'';
        text[n] = '\0';
        if (last && comment != NULL && comment[0] != '\0')
            snprintf(text + n, sizeof text - (size_t)n, "%*s / %.100s", n < 30 ? 30 - n : 0, "", comment);
        add_card(dst, text);
        n = snprintf(text, sizeof text, "CONTINUE  ");
    } while (*c != '\0');
}

/* `line` is printable and ends in neither a blank nor '&'. */
static void add_history(rx_text *dst, const char *line)
{
    enum { ROOM = RX_CARD - RX_CARD_KEY };
    size_t left = strlen(line);
    char text[RX_CARD + 1];
    while (left > ROOM) {
        size_t n = ROOM - 1;
        for (size_t i = n; i > n / 2; i--)
            if (line[i - 1] == ' ' || line[i - 1] == ',') {
                n = i;
                break;
            }
        snprintf(text, sizeof text, "HISTORY %.*s&", (int)n, line);
        add_card(dst, text);
        line += n;
        left -= n;
    }
    snprintf(text, sizeof text, "HISTORY %s", line);
    add_card(dst, text);
}

/* --- choosing --- */

bool rx_card_is(const char *card, const char *key)
{
    const size_t length = strcspn(key, "#");
    size_t end = length;
    while (key[length] == '#' && end < RX_CARD_KEY && isdigit((unsigned char)card[end]))
        end++;
    return strncmp(card, key, length) == 0 && (key[length] == '\0' || end > length) &&
           strspn(card + end, " ") + end >= RX_CARD_KEY;
}

int rx_card_is_useful(const char *card)
{
    static const char *const dropped[] = {
        "SIMPLE",   "XTENSION", "BITPIX",   "NAXIS",    "EXTEND",   "PCOUNT",   "GCOUNT",   "GROUPS",
        "BLOCKED",  "END",      "BSCALE",   "BZERO",    "BLANK",    "DATASUM",  "CHECKSUM", "EXTNAME",
        "EXTVER",   "EXTLEVEL", "THEAP",    "TFIELDS",  "INHERIT",  "DATAMIN",  "DATAMAX",  "ZIMAGE",
        "ZTENSION", "ZSIMPLE",  "ZEXTEND",  "ZBITPIX",  "ZNAXIS",   "ZPCOUNT",  "ZGCOUNT",  "ZCMPTYPE",
        "ZQUANTIZ", "ZDITHER0", "ZBLANK",   "ZMASKCMP", "ZHECKSUM", "ZDATASUM", "ZSCALE",   "ZZERO",
        "FZALGOR",  "FZTILE",   "FZQMETHD", "FZQVALUE", "FZDTHRSD", "FZINT2F",  "NAXIS#",   "ZNAXIS#",
        "ZTILE#",   "ZNAME#",   "ZVAL#",    "TTYPE#",   "TFORM#",   "TUNIT#",   "TSCAL#",   "TZERO#",
        "TNULL#",   "TDISP#",   "TDIM#",    "TBCOL#",   "TCOMM#",   "ZFORM#",   "ZCTYP#"};
    static const char blank[RX_CARD - RX_CARD_KEY + 1] =
        "                                                                        ";
    if (strncmp(card, "        ", RX_CARD_KEY) == 0) /* only spaces a header out, unless it says something */
        return memcmp(card + RX_CARD_KEY, blank, RX_CARD - RX_CARD_KEY) != 0;
    for (size_t i = 0; i < sizeof dropped / sizeof dropped[0]; i++)
        if (rx_card_is(card, dropped[i]))
            return 0;
    return strncmp(card, "COMMENT   FITS (Flexible Image Transport System) format", 55) != 0 &&
           strncmp(card, "COMMENT   and Astrophysics', volume 376, page 359", 49) != 0;
}

void rx_card_record(rx_text *dst, const char *name, const char *value, const char *comment)
{
    /* marked as ours: GAIN or SEED of the configuration must not look like the tile's own keywords */
    const size_t length = strspn(name, "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_");
    if (strncmp(name, "RX", 2) == 0 && length <= RX_CARD_KEY && name[length] == '\0') {
        char *end;
        double number = rx_point_number(value, &end);
        /* longer ones are digests, whatever their digits */
        bool is_number = *value != '\0' && *end == '\0' && isfinite(number) && strlen(value) <= 14;
        if (is_number && strpbrk(value, ".eE") == NULL)
            rx_card_integer(dst, name, strtol(value, NULL, 10), comment);
        else if (is_number)
            rx_card_number(dst, name, number, comment);
        else
            rx_card_text(dst, name, value, comment);
        return;
    }
    rx_text line = {0};
    rx_text_printf(&line, "%s = ", name);
    rx_printable_add(&line, value);
    if (line.failed)
        dst->failed = true;
    else
        add_history(dst, line.data);
    rx_text_free(&line);
}

/* One line out of HISTORY cards from *card on, which is left behind the last of them; 0: there is no HISTORY left. */
static int next_history(const char *cards, long ncards, long *card, rx_text *line)
{
    int more = 1;
    line->length = 0;
    while (*card < ncards && strncmp(cards + *card * RX_CARD, "HISTORY ", RX_CARD_KEY) != 0)
        ++*card;
    if (*card == ncards)
        return 0;
    for (; more && *card < ncards && strncmp(cards + *card * RX_CARD, "HISTORY ", RX_CARD_KEY) == 0;
         ++*card) {
        const char *text = cards + *card * RX_CARD + RX_CARD_KEY;
        size_t n = RX_CARD - RX_CARD_KEY;
        while (n > 0 && text[n - 1] == ' ')
            n--;
        more = n > 0 && text[n - 1] == '&';
        rx_text_add_bytes(line, text, n - (size_t)more);
    }
    rx_text_add(line, "");
    return 1;
}

rx_status rx_cards_history(const char *cards, long ncards, rx_history_visitor visit, void *user,
                           rx_error *err)
{
    rx_text line = {0};
    rx_status status = RX_OK;
    for (long card = 0; status == RX_OK && next_history(cards, ncards, &card, &line);)
        status = line.failed ? rx_error_memory(err, line.capacity) : visit(user, line.data, err);
    rx_text_free(&line);
    return status;
}

void rx_record_cards(const rx_record *record, rx_text *cards)
{
    for (int i = 0; i < record->n; i++)
        rx_card_record(cards, record->pairs[i][0], record->pairs[i][1], record->pairs[i][2]);
}
