/* Headers that do not say what they mean, mended for wcslib. */
#include "io/guard/wcs.h"

#include <ctype.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/constants.h"
#include "base/point.h"
#include "base/text.h"
#include "io/cards.h"

void rx_wcs_note(rx_text *note, const char *text)
{
    rx_text_printf(note, "%s%s", note->length > 0 ? "; " : "", text);
}

/* "PVi_m" of axis 1 or 2: m, else -1. */
static int pv_number(const char *card, int *axis)
{
    if (strncmp(card, "PV", 2) != 0 || (card[2] != '1' && card[2] != '2') || card[3] != '_' || card[8] != '=')
        return -1;
    *axis = card[2] - '0';
    char digits[5] = "";
    memcpy(digits, card + 4, 4);
    char *end;
    long m = strtol(digits, &end, 10);
    return end != digits && (*end == '\0' || *end == ' ') && m >= 0 ? (int)m : -1;
}

static int is_pv(const char *card)
{
    int axis;
    return pv_number(card, &axis) >= 0;
}

/* The card becomes KEY = 'value'. */
static void set_text(char *card, const char *key, const char *value)
{
    rx_text text = {0};
    rx_card_text(&text, key, value, "");
    if (!text.failed)
        memcpy(card, text.data, RX_CARD);
    rx_text_free(&text);
}

/* The card becomes KEY = value. */
static void set_number(char *card, const char *key, double value)
{
    rx_text text = {0};
    rx_card_number(&text, key, value, "");
    if (!text.failed)
        memcpy(card, text.data, RX_CARD);
    rx_text_free(&text);
}

/* wcslib 7.12 stops reading a number at the D of a Fortran exponent (1.0D-6 becomes 1.0). */
static void repair_exponents(char *cards, size_t ncards)
{
    for (size_t i = 0; i < ncards; i++) {
        char *card = cards + i * RX_CARD;
        if (strncmp(card + 8, "= ", 2) != 0)
            continue;
        for (int j = 11; j < RX_CARD && card[j] != '\'' && card[j] != '/'; j++)
            if ((card[j] == 'D' || card[j] == 'd') &&
                (isdigit((unsigned char)card[j - 1]) || card[j - 1] == '.'))
                card[j] = 'E';
    }
}

/* A number of axes behind the key of 8 characters and '=': indices of FITS keywords have at most two digits
 * (FITS 4.0, section 8.2). -1: it is none. */
static int axes_of(const char *card)
{
    const char *c = card + 9, *end = card + RX_CARD;
    int axes = 0, digits = 0;
    while (c < end && *c == ' ')
        c++;
    for (; c < end && isdigit((unsigned char)*c) && digits < 3; c++, digits++)
        axes = 10 * axes + (*c - '0');
    return digits >= 1 && digits <= 2 && (c == end || *c == ' ' || *c == '/') ? axes : -1;
}

/* wcslib 7.12 makes arrays of WCSAXES x WCSAXES numbers, or of NAXIS x NAXIS, whatever they say, and multiplies as
 * int; and it takes for granted that SIP, the solution of a plate and WAT come with two axes. An image has two: so
 * says a card of our own, unless NAXIS says more. */
static void set_axes(char *cards, size_t ncards, rx_wcs_notes *notes)
{
    char first[RX_CARD + 1];
    int axes = 2;
    for (size_t i = 1; i < ncards; i++) {
        char *card = cards + i * RX_CARD;
        const int wcsaxes = strncmp(card, "WCSAXES", 7) == 0;
        if (card[8] != '=' || (!wcsaxes && strncmp(card, "NAXIS   ", 8) != 0))
            continue;
        const int n = axes_of(card);
        if (n < 0)
            rx_wcs_note(&notes->details, wcsaxes ? "WCSAXES is no number of axes and is ignored"
                                                 : "NAXIS is no number of axes and is ignored");
        if (!wcsaxes && n > axes)
            axes = n;
        if (n < 0 || !wcsaxes)
            memset(card, ' ', RX_CARD);
    }
    snprintf(first, sizeof first, "NAXIS   = %20d%*s", axes, RX_CARD - 30, "");
    memcpy(cards + RX_WCS_NAXIS * RX_CARD, first, RX_CARD);
}

/* Order or coefficient of SIP. */
static int is_sip(const char *card)
{
    return (card[0] == 'A' || card[0] == 'B') && (card[1] == '_' || (card[1] == 'P' && card[2] == '_'));
}

/* A coefficient: A_p_q, B_p_q, AP_p_q, BP_p_q, by which wcslib knows that there is SIP. */
static int is_sip_term(const char *card)
{
    const char *c = card + (card[1] == 'P' ? 3 : 2);
    return is_sip(card) && isdigit((unsigned char)c[0]) && c[1] == '_' && isdigit((unsigned char)c[2]);
}

/* Of the solution of a digitized plate (DSS), which does without CTYPE: its number in the list, -1 for any other
 * card. All of the first PLATE_CARDS are needed; wcslib takes the place of one that is missing for a number. */
enum { PLATE_CARDS = 19 };
static int plate_card(const char *card)
{
    static const char *const keys[] = {"CNPIX1  ", "CNPIX2  ", "PPO3    ", "PPO6    ", "XPIXELSZ", "YPIXELSZ",
                                       "PLTRAH  ", "PLTRAM  ", "PLTRAS  ", "PLTDECSN", "PLTDECD ", "PLTDECM ",
                                       "PLTDECS ", "AMDX1   ", "AMDX2   ", "AMDX3   ", "AMDY1   ", "AMDY2   ",
                                       "AMDY3   ", "CNPIX",    "PPO",      "PLTRA",    "PLTDEC",   "AMDX",
                                       "AMDY",     "PLATEID"};
    for (int i = 0; i < (int)(sizeof keys / sizeof *keys); i++)
        if (strncmp(card, keys[i], strlen(keys[i])) == 0)
            return i;
    return -1;
}

static int is_plate(const char *card)
{
    return plate_card(card) >= 0;
}

/* A coefficient of its polynomials. */
static int is_plate_term(const char *card)
{
    return strncmp(card, "AMD", 3) == 0;
}

/* A WATi_nnn whose type (wtype=tnx) is longer than any, or may go on in the next card: wcslib 7.12 puts the
 * cards together and copies the type over its stack. */
static int is_long_type(const char *card)
{
    enum { LONGEST = 8 };
    static const char word[] = "type";
    const char *c = memchr(card, '\'', RX_CARD), *end = c != NULL ? memrchr(card, '\'', RX_CARD) : NULL;
    if (strncmp(card, "WAT", 3) != 0 || c == end)
        return 0;
    for (c++; c < end;) {
        size_t same = 0;
        while (same < 4 && c + same < end && c[same] == word[same])
            same++;
        if (c + same == end && same > 0)
            return 1;
        if (same < 4) {
            c++;
            continue;
        }
        c += same;
        c += strspn(c, " ");
        c += c < end && *c == '=';
        c += strspn(c, " ");
        const size_t length = strcspn(c, " '");
        if (c >= end || c + length >= end || length > LONGEST)
            return 1;
    }
    return 0;
}

/* `KEYWORD = value / comment`. */
static int is_whole_card(const char *card)
{
    static const char allowed[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_";
    const char *c = card, *end = card + RX_CARD;
    /* wcslib takes these for numbers, whatever they are */
    const bool number = is_sip(card) || (is_plate(card) && strncmp(card, "PLTDECSN", 8) != 0 &&
                                         strncmp(card, "PLATEID", 7) != 0);
    c += strspn(card, allowed);
    while (c > card && c < card + 8 && *c == ' ')
        c++;
    if (c != card + 8 || c[0] != '=' || c[1] != ' ' || strncmp(card + 4, "_000", 4) == 0 ||
        is_long_type(card))
        return 0;
    for (c += 2; c < end && *c == ' '; c++)
        continue;
    if (c < end && !number && (*c == 'T' || *c == 'F'))
        c++;
    else if (c < end && !number && *c == '\'')
        c = rx_card_text_end(c, end);
    else
        c = c < end ? rx_card_number_end(c, end) : NULL;
    while (c != NULL && c < end && *c == ' ')
        c++;
    return c != NULL && (c == end || *c == '/');
}

/* nnn of a card WATi_nnn, 0 for any other. */
static int wat_number(const char *card, char i)
{
    int number = 0;
    if (strncmp(card, "WAT", 3) != 0 || card[3] != i || card[4] != '_')
        return 0;
    for (int k = 5; k < 8; k++) {
        if (!isdigit((unsigned char)card[k]))
            return 0;
        number = 10 * number + card[k] - '0';
    }
    return number;
}

/* wcslib 7.12 puts WATi_001, WATi_002 ... together, and what is on its stack in the place of one that is
 * missing: all or none. */
static void keep_whole_wats(char *cards, size_t ncards)
{
    for (char i = '1'; i <= '9'; i++) {
        char seen[1000] = {0};
        int highest = 0, n = 0;
        for (size_t k = 0; k < ncards; k++) {
            const int number = wat_number(cards + k * RX_CARD, i);
            n += number > 0 && !seen[number];
            seen[number] = 1;
            highest = number > highest ? number : highest;
        }
        for (size_t k = 0; k < ncards && n < highest; k++)
            if (wat_number(cards + k * RX_CARD, i) > 0)
                memset(cards + k * RX_CARD, ' ', RX_CARD);
    }
}

/* wcslib 7.12 shall see no cards but whole ones, in printable ASCII (FITS standard 4.0, sections 4.1
 * and 4.2): its lexer runs through null pointers on some others, and takes a text without a closing quote to
 * go on in the next cards, which it then writes into 80 bytes on its stack, and WATi_000 (they count from 1)
 * before its memory. All these become blank. */
static void keep_whole_cards(char *cards, size_t ncards)
{
    for (size_t i = 0; i < ncards; i++) {
        char *card = cards + i * RX_CARD;
        for (int j = 0; j < RX_CARD; j++)
            if (card[j] < ' ' || card[j] > '~')
                card[j] = '?';
        if (!is_whole_card(card))
            memset(card, ' ', RX_CARD);
    }
    keep_whole_wats(cards, ncards);
}

static void drop(char *cards, size_t ncards, int (*is_one)(const char *card))
{
    for (size_t i = 0; i < ncards; i++)
        if (is_one(cards + i * RX_CARD))
            memset(cards + i * RX_CARD, ' ', RX_CARD);
}

static int count(const char *cards, size_t ncards, int (*is_one)(const char *card))
{
    int n = 0;
    for (size_t i = 0; i < ncards; i++)
        n += is_one(cards + i * RX_CARD) != 0;
    return n;
}

static int is_wat(const char *card)
{
    return wat_number(card, '1') > 0 || wat_number(card, '2') > 0;
}

/* Is the solution of a plate there, each card of it once? */
static int has_plate(const char *cards, size_t ncards)
{
    int seen[PLATE_CARDS] = {0}, n = 0;
    for (size_t i = 0; i < ncards; i++) {
        const int k = plate_card(cards + i * RX_CARD);
        if (k < 0 || k >= PLATE_CARDS)
            continue;
        n += ++seen[k] == 1;
        if (seen[k] > 1)
            return 0;
    }
    return n == PLATE_CARDS;
}

/* A number and the blank behind it; what follows, NULL where there is none. */
static const char *next_number(const char *c, const char *end, double *value)
{
    const char *stop = c < end ? rx_card_number_end(c, end) : NULL;
    if (stop != NULL && strcspn(c, "Dd") < (size_t)(stop - c)) /* no exponent of wcslib's */
        stop = NULL;
    *value = stop != NULL ? rx_point_number(c, NULL) : 0;
    return stop != NULL && stop < end && *stop == ' ' ? stop + 1 : NULL;
}

/* The texts of WATi_001 ... as wcslib puts them together: to the first of fewer than 68 characters. */
static void join_wats(const char *cards, size_t ncards, char i, rx_text *dst)
{
    size_t before = RX_CARD_TEXT;
    for (int n = 1; n < 1000 && before == RX_CARD_TEXT; n++) {
        char key[20], value[RX_CARD];
        snprintf(key, sizeof key, "WAT%c_%03d", i, n);
        before = dst->length;
        const long k = rx_cards_find(cards, ncards, key);
        if (k < 0)
            break;
        const char *begin = memchr(cards + k * RX_CARD, '\'', RX_CARD), *end = cards + (k + 1) * RX_CARD;
        end = begin != NULL ? rx_card_text_end(begin, end) : NULL;
        if (end == NULL)
            break;
        size_t length = 0;
        for (const char *c = begin + 1; c < end - 1; c += 1 + (*c == '\''))
            value[length++] = *c;
        rx_text_add_bytes(dst, value, length);
        before = length;
    }
    rx_text_add(dst, "");
}

/* Does a polynomial of TNX or ZPX (Valdes 2012, fits.gsfc.nasa.gov/registry) stand there, with as many coefficients
 * as its orders ask for? wcslib 7.12 asks for memory by those, and writes what the loop over them gives. */
static int is_polynomial(const char *text)
{
    enum { HEAD = 8, MOST = 10 };
    static const int least[] = {1, 1, 1, 0},
                     most[] = {3, MOST, MOST, 2}; /* kind, orders in x and y, cross terms */
    int head[4] = {0};
    double value;
    const char *c = strchr(text, '"'), *end = text + strlen(text);
    c = c != NULL ? c + 1 : NULL;
    for (int k = 0; k < HEAD && c != NULL; k++) {
        const size_t digits = strspn(c, "0123456789."); /* wcslib reads the first four as whole numbers */
        const int is_short = c[digits] == ' ';
        c = next_number(c, end, &value);
        if (k < 4 && !(is_short && value >= least[k] && value <= most[k] && value == floor(value)))
            return 0;
        if (k < 4)
            head[k] = (int)value;
    }
    const int nx = head[1], ny = head[2], cross = head[3], order = nx > ny ? nx : ny;
    for (int y = 0; y < ny; y++)
        for (int x = 0; x < nx && c != NULL; x++)
            if (!((cross == 0 && x > 0 && y > 0) || (cross == 2 && x + y > order - 1)))
                c = next_number(c, end, &value);
    return c != NULL;
}

/* Are both axes TNX, or both ZPX, with their polynomials? */
static int has_wat(const char *cards, size_t ncards)
{
    char type[2][8] = {"", ""};
    int whole = 1;
    for (int i = 0; i < 2; i++) {
        rx_text text = {0};
        join_wats(cards, ncards, (char)('1' + i), &text);
        whole &= !text.failed && text.data != NULL && sscanf(text.data, "wtype=%7s", type[i]) == 1 &&
                 is_polynomial(text.data);
        rx_text_free(&text);
    }
    return whole && strcmp(type[0], type[1]) == 0 &&
           (strcmp(type[0], "tnx") == 0 || strcmp(type[0], "zpx") == 0);
}

/* What wcslib 7.12 makes of the cards depends on how they stand: the sign of the declination is one where blanks
 * follow it, and PLATEID, whose place has 56 bytes and is read without one, ends the solution where it stands behind
 * it. */
static void set_plate(char *cards, size_t ncards)
{
    char sign[RX_CARD];
    const long i = rx_cards_find(cards, ncards, "PLTDECSN");
    rx_cards_text(cards, (long)ncards, "PLTDECSN", sign, sizeof sign);
    set_text(cards + i * RX_CARD, "PLTDECSN", strcmp(sign, "-") == 0 ? "-" : "+");
    for (size_t k = 0; k < ncards; k++)
        if (strncmp(cards + k * RX_CARD, "PLATEID", 7) == 0)
            memset(cards + k * RX_CARD, ' ', RX_CARD);
    set_text(cards + RX_WCS_PLATEID * RX_CARD, "PLATEID", "");
}

/* wcslib 7.12 knows one distortion at a time, that of the last card of any; of another one half is left, and of
 * one that is not there as a whole it takes what is in its memory. SIP goes before WAT, which goes before the
 * solution of a plate, as CTYPE does where it names one. */
static void keep_one_distortion(char *cards, size_t ncards, rx_wcs_notes *notes)
{
    const int sip = count(cards, ncards, is_sip_term), wat = count(cards, ncards, is_wat),
              plate = count(cards, ncards, is_plate_term);
    const int use_wat = !sip && wat && has_wat(cards, ncards);
    const int use_plate = !sip && !use_wat && has_plate(cards, ncards);
    if (!use_wat)
        drop(cards, ncards, is_wat);
    if (use_plate)
        set_plate(cards, ncards);
    else
        drop(cards, ncards, is_plate);
    if (plate && !use_plate)
        rx_wcs_note(&notes->details,
                    sip || use_wat
                        ? "the solution of a plate (AMDX, AMDY) beside another distortion is ignored"
                        : "the solution of a plate (AMDX, AMDY) is not complete and is ignored");
}

/* Keywords of general distortions (Calabretta et al. 2004, draft IV of the FITS papers): CPDISj, CQDISi and
 * their records DPj, DQi, of any alternate. */
static int is_distortion(const char *card)
{
    const size_t n = strncmp(card, "CPDIS", 5) == 0 || strncmp(card, "CQDIS", 5) == 0 ? 5
                     : strncmp(card, "DP", 2) == 0 || strncmp(card, "DQ", 2) == 0     ? 2
                                                                                      : 0;
    return n > 0 && isdigit((unsigned char)card[n]);
}

/* wcslib 7.12 reads beyond its memory where their records are not what it expects. Tables of small
 * corrections (LOOKUP, as Hubble's images have them beside SIP) it cannot apply anyway: left out. Others
 * would move positions by more: false. */
static bool drop_distortions(char *cards, size_t ncards, rx_wcs_notes *notes)
{
    int dropped = 0;
    for (size_t i = 0; i < ncards; i++) {
        char *card = cards + i * RX_CARD, key[9], kind[32];
        if (!is_distortion(card))
            continue;
        snprintf(key, sizeof key, "%.*s", (int)strcspn(card, " ="), card);
        if (card[0] == 'C' &&
            (!rx_cards_text(card, 1, key, kind, sizeof kind) || strcasecmp(kind, "LOOKUP") != 0)) {
            rx_wcs_note(&notes->why, "distortions by CPDIS or CQDIS other than LOOKUP are not known here");
            return false;
        }
        memset(card, ' ', RX_CARD);
        dropped = 1;
    }
    if (dropped)
        rx_wcs_note(&notes->details, "tables of distortions (CPDIS, CQDIS) are ignored");
    return true;
}

/* --- numbers and contradictions --- */

/* The card's keyword, "" where it is no card with a value. */
static void key_of(const char *card, char key[9])
{
    key[0] = '\0';
    if (card[8] != '=')
        return;
    memcpy(key, card, 8);
    key[8] = '\0';
    key[strcspn(key, " ")] = '\0';
}

/* Keyword of a number that positions of the first two axes come from. */
static bool is_number_key(const char *key)
{
    static const char *const patterns[] = {
        "CRVAL#", "CRPIX#", "CDELT#",  "CROTA#",  "CD#_#",    "PC#_#",    "PV#_#",   "A_#_#",   "B_#_#",
        "AP_#_#", "BP_#_#", "A_ORDER", "B_ORDER", "AP_ORDER", "BP_ORDER", "LONPOLE", "LATPOLE", "EQUINOX"};
    const size_t axis = strcspn(key, "0123456789");
    char pattern[9];
    size_t n = 0;
    if ((key[0] == 'C' || key[0] == 'P') && key[axis] > '2')
        return false;
    for (const char *c = key; *c != '\0'; c++)
        if (!isdigit((unsigned char)*c))
            pattern[n++] = *c;
        else if (n == 0 || pattern[n - 1] != '#')
            pattern[n++] = '#';
    pattern[n] = '\0';
    for (size_t i = 0; i < sizeof patterns / sizeof *patterns; i++)
        if (strcmp(pattern, patterns[i]) == 0)
            return true;
    return false;
}

static bool read_number(const char *card, const char *key, double *value)
{
    static const char *const units[] = {"deg", "pix", "deg/pix"};
    for (size_t i = 0; i < sizeof units / sizeof *units; i++)
        if (rx_cards_quantity(card, 1, key, units[i], value))
            return true;
    return false;
}

static void name_card(rx_text *names, const char *card, const char *key)
{
    char text[RX_CARD];
    rx_text_printf(names, "%s%s", names->length > 0 ? ", " : "", key);
    if (rx_cards_text(card, 1, key, text, sizeof text))
        rx_text_printf(names, " = '%s'", text);
}

/* The first of several cards counts, as for SExtractor; wcslib 7.12 would take the last. Numbers in quotes or
 * with a unit, which it would take as 0, are written as it reads them. Cards that are no numbers are named in
 * *unreadable, those of SIP in *sip. */
static void settle_numbers(char *cards, size_t ncards, rx_wcs_notes *notes, rx_text *unreadable, rx_text *sip)
{
    rx_text twice = {0}, absent = {0};
    for (size_t i = 0; i < ncards; i++) {
        char *card = cards + i * RX_CARD, key[9], text[RX_CARD], other[RX_CARD];
        double value;
        key_of(card, key);
        const bool number = is_number_key(key);
        if (!number && strcmp(key, "CTYPE1") != 0 && strcmp(key, "CTYPE2") != 0)
            continue;
        const long first = rx_cards_find(cards, ncards, key);
        if (first >= 0 && (size_t)first < i) {
            rx_cards_text(cards + first * RX_CARD, 1, key, text, sizeof text);
            if (rx_cards_text(card, 1, key, other, sizeof other) && strcmp(text, other) != 0)
                name_card(&twice, card, key);
            memset(card, ' ', RX_CARD);
            continue;
        }
        if (!number) { /* a type without quotes */
            if (!is_whole_card(card) && rx_cards_text(card, 1, key, text, sizeof text))
                set_text(card, key, text);
            continue;
        }
        if (!read_number(card, key, &value)) {
            if (strcmp(key, "EQUINOX") == 0 && rx_cards_text(card, 1, key, text, sizeof text) &&
                (strncmp(text, "J2000", 5) == 0 || strncmp(text, "B1950", 5) == 0))
                value = text[0] == 'J' ? 2000 : 1950;
            else {
                name_card(is_sip(card) ? sip : strcmp(key, "EQUINOX") == 0 ? &absent : unreadable, card, key);
                continue;
            }
        }
        if (!is_whole_card(card) || card[9 + strspn(card + 9, " ")] == '\'')
            set_number(card, key, value);
    }
    if (twice.length > 0) {
        rx_wcs_note(&notes->warnings, twice.data);
        rx_text_add(&notes->warnings, ": there is one before it, which is taken, as SExtractor does");
    }
    if (absent.length > 0) {
        rx_wcs_note(&notes->warnings, absent.data);
        rx_text_add(&notes->warnings, " is no number and counts as absent");
    }
    rx_text_free(&twice);
    rx_text_free(&absent);
}

int rx_wcs_means_sky(const char *cards, size_t ncards)
{
    int n = 0;
    for (int i = 0; i < 2; i++) {
        char text[32];
        rx_cards_text(cards, (long)ncards, i == 0 ? "CTYPE1" : "CTYPE2", text, sizeof text);
        const char *type = text + strspn(text, " "); /* so written, wcslib cannot read it */
        n += strncasecmp(type, "RA--", 4) == 0 || strncasecmp(type, "DEC-", 4) == 0 ||
             (type[0] != '\0' &&
              (strncasecmp(type + 1, "LON", 3) == 0 || strncasecmp(type + 1, "LAT", 3) == 0));
    }
    return n;
}

/* The linear part by CDi_j (0) or by CDELTi with PCi_j or CROTA2 (1); false: no card of it is there. */
static bool read_matrix(const char *cards, size_t ncards, int kind, double m[4])
{
    bool there = false, pc = false;
    double step[2] = {0, 0}, rotation = 0;
    for (int k = 0; k < 4; k++) {
        char key[32];
        snprintf(key, sizeof key, "%s%d_%d", kind == 0 ? "CD" : "PC", k / 2 + 1, k % 2 + 1);
        m[k] = kind == 1 && k % 3 == 0;
        there = rx_cards_number(cards, (long)ncards, key, &m[k]) || there;
    }
    if (kind == 0)
        return there;
    pc = there;
    step[0] = step[1] = pc; /* of the standard; without PC half of CDELT is none */
    for (int k = 0; k < 2; k++)
        there = rx_cards_number(cards, (long)ncards, k == 0 ? "CDELT1" : "CDELT2", &step[k]) || there;
    if (!pc && rx_cards_number(cards, (long)ncards, "CROTA2", &rotation)) {
        m[0] = m[3] = cos(rotation * RX_DEGREE);
        m[1] = -sin(rotation * RX_DEGREE) * step[1] / step[0];
        m[2] = sin(rotation * RX_DEGREE) * step[0] / step[1];
    }
    for (int k = 0; k < 4; k++)
        m[k] *= step[k / 2];
    return there;
}

/* CD is taken where PC, CDELT or CROTA say something else, as SExtractor does; wcslib takes PC. Writers round CDELT
 * to two digits and more, and 1 is as good as none: only rows whose lengths differ by more contradict each other, or,
 * where PC or CROTA2 say how they are turned, whose elements do. */
static bool settle_matrix(char *cards, size_t ncards, rx_wcs_notes *notes)
{
    static const char *const turning[] = {"PC1_1", "PC1_2", "PC2_1", "PC2_2", "CROTA1", "CROTA2"};
    double cd[4], other[4], one[2] = {0, 0};
    const bool has_cd = read_matrix(cards, ncards, 0, cd), has_other = read_matrix(cards, ncards, 1, other);
    bool turned = false, differs = false;
    for (size_t i = 0; has_cd && i < sizeof turning / sizeof *turning; i++) {
        const long k = rx_cards_find(cards, ncards, turning[i]);
        turned = turned || k >= 0;
        if (k >= 0)
            memset(cards + k * RX_CARD, ' ', RX_CARD);
    }
    rx_cards_number(cards, (long)ncards, "CDELT1", &one[0]);
    rx_cards_number(cards, (long)ncards, "CDELT2", &one[1]);
    for (int row = 0; has_cd && has_other && row < 2; row++) {
        const double *a = cd + 2 * row, *b = other + 2 * row;
        const double length = hypot(a[0], a[1]);
        differs = differs || (turned ? !(hypot(a[0] - b[0], a[1] - b[1]) <= 0.01 * length)
                                     : one[row] != 1 && !(fabs(hypot(b[0], b[1]) - length) <= 0.01 * length));
    }
    if (differs)
        rx_wcs_note(&notes->warnings, turned ? "CDi_j and PCi_j, CROTA2 or CDELTi contradict each other; "
                                               "CDi_j is taken, as SExtractor does"
                                             : "CDi_j and CDELTi contradict each other; CDi_j is taken, as "
                                               "SExtractor does");
    const double *m = has_cd ? cd : other;
    const double det = m[0] * m[3] - m[1] * m[2];
    if ((!has_cd && !has_other) || !isfinite(det) || det == 0)
        rx_wcs_note(&notes->why, has_cd || has_other ? "the matrix of the linear transformation is singular"
                                                     : "CDi_j and CDELTi are missing");
    return notes->why.length == 0;
}

/* Both polynomials of TNX or ZPX must be there, as SExtractor has it, or keep_one_distortion() left none of them:
 * positions would be without the distortion. */
static bool has_polynomials(const char *cards, size_t ncards, rx_wcs_notes *notes)
{
    char type[32];
    rx_cards_text(cards, (long)ncards, "CTYPE1", type, sizeof type);
    if ((strstr(type, "TNX") == NULL && strstr(type, "ZPX") == NULL) || count(cards, ncards, is_wat) > 0)
        return true;
    rx_text_printf(&notes->why, "CTYPE is %.3s, but WAT1_ and WAT2_ do not hold lngcor and latcor as a whole",
                   strstr(type, "TNX") != NULL ? "TNX" : "ZPX");
    return false;
}

/* SCAMP and others write polynomial coefficients PVi_m with plain TAN; as SExtractor does, they are
 * read as TPV (a native TAN knows PVi_0..4 of the longitude axis only, and hardly anyone gives them).
 * Where SIP is there too, SIP counts. SIP counts where both types end in -SIP and both axes have its
 * coefficients: elsewhere they are leftovers of another solution, or half of one, and SExtractor, which knows
 * no SIP, takes TAN. */
static void repair_distortion(char *cards, size_t ncards, rx_wcs_notes *notes)
{
    char ctype[2][32];
    const int coefficients = count(cards, ncards, is_sip);
    int tan = 1, suffix = 0, high = 0, pv2 = 0, axis = 0;
    double order;
    for (int i = 0; i < 2; i++) {
        rx_cards_text(cards, (long)ncards, i == 0 ? "CTYPE1" : "CTYPE2", ctype[i], sizeof ctype[i]);
        tan = tan && strlen(ctype[i]) >= 8 && strncmp(ctype[i] + 5, "TAN", 3) == 0;
        suffix += strlen(ctype[i]) >= 12 && strncmp(ctype[i] + 8, "-SIP", 4) == 0;
    }
    for (size_t i = 0; i < ncards; i++) {
        int m = pv_number(cards + i * RX_CARD, &axis);
        high += m > 4;
        pv2 += m >= 0 && axis == 2;
    }
    const int orders = rx_cards_number(cards, (long)ncards, "A_ORDER", &order) +
                       rx_cards_number(cards, (long)ncards, "B_ORDER", &order);
    const bool sip = suffix == 2 && orders == 2;
    if (!tan)
        return;
    if (!sip && coefficients > 0) {
        rx_wcs_note(&notes->warnings,
                    suffix < 2 ? "SIP coefficients are not used, as CTYPE lacks -SIP"
                               : "SIP coefficients are not used, as A_ORDER or B_ORDER is missing");
        drop(cards, ncards, is_sip);
    }
    for (int i = 0; i < 2 && !sip && (high > 0 || pv2 > 0 || (coefficients > 0 && suffix > 0)); i++) {
        char value[32];
        snprintf(value, sizeof value, "%.5s%s", ctype[i], high > 0 || pv2 > 0 ? "TPV" : "TAN");
        const char *key = i == 0 ? "CTYPE1" : "CTYPE2";
        const long k = rx_cards_find(cards, ncards, key);
        if (k >= 0)
            set_text(cards + k * RX_CARD, key, value);
    }
    if (!sip && (high > 0 || pv2 > 0))
        rx_wcs_note(&notes->details, "TAN with PV coefficients is read as TPV");
    if (!sip || (high == 0 && pv2 == 0))
        return;
    drop(cards, ncards, is_pv);
    rx_wcs_note(&notes->details, "PV coefficients beside SIP are ignored");
}

/* TPV takes a PVi_1 that is not there for 1, all others for 0; wcslib 7.12 takes 0, so that a whole axis is one place. */
static void complete_tpv(char *cards, size_t ncards)
{
    for (int axis = 1; axis <= 2; axis++) {
        const char *key = axis == 1 ? "PV1_1" : "PV2_1";
        char ctype[32];
        rx_cards_text(cards, (long)ncards, axis == 1 ? "CTYPE1" : "CTYPE2", ctype, sizeof ctype);
        if (strlen(ctype) < 8 || strncmp(ctype + 5, "TPV", 3) != 0 || rx_cards_find(cards, ncards, key) >= 0)
            continue;
        set_number(cards + (axis == 1 ? RX_WCS_PV1 : RX_WCS_PV2) * RX_CARD, key, 1.0);
    }
}

/* Numbers of the sky that are not there: wcslib, as the standard, would take 0, and SExtractor 0 or 1. */
static bool is_complete(const char *cards, size_t ncards, rx_wcs_notes *notes)
{
    static const char *const keys[] = {"CRVAL1", "CRVAL2", "CRPIX1", "CRPIX2"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (rx_cards_find(cards, ncards, keys[i]) < 0) {
            rx_text_printf(&notes->why, "%s is missing", keys[i]);
            return false;
        }
    return true;
}

/* Unreadable numbers are named; false: positions would come from them. */
static bool are_numbers(const char *cards, size_t ncards, const rx_text *unreadable, const rx_text *sip,
                        rx_wcs_notes *notes)
{
    enum { SHOWN = 100 };
    char type[32];
    rx_cards_text(cards, (long)ncards, "CTYPE1", type, sizeof type);
    const rx_text *bad = unreadable->length > 0 ? unreadable : sip;
    if (unreadable->length == 0 && (sip->length == 0 || strstr(type, "-SIP") == NULL))
        return true;
    rx_text_printf(&notes->why, "%.*s%s: no number", SHOWN, bad->data, bad->length > SHOWN ? "..." : "");
    return false;
}

bool rx_wcs_guard(char *cards, size_t ncards, rx_wcs_notes *notes)
{
    rx_text unreadable = {0}, sip = {0};
    settle_numbers(cards, ncards, notes, &unreadable, &sip);
    bool good = are_numbers(cards, ncards, &unreadable, &sip, notes);
    repair_distortion(cards, ncards, notes);
    complete_tpv(cards, ncards);
    repair_exponents(cards, ncards);
    keep_whole_cards(cards, ncards);
    set_axes(cards, ncards, notes);
    keep_one_distortion(cards, ncards, notes);
    /* both axes mean the sky, and there is no solution of a plate, which does without the rest */
    if (good && count(cards, ncards, is_plate) == 0 && rx_wcs_means_sky(cards, ncards) == 2)
        good = is_complete(cards, ncards, notes) && settle_matrix(cards, ncards, notes) &&
               has_polynomials(cards, ncards, notes);
    good = good && drop_distortions(cards, ncards, notes);
    rx_text_free(&unreadable);
    rx_text_free(&sip);
    return good;
}
