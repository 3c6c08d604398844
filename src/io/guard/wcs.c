/* Headers that do not say what they mean, mended for wcslib. */
#include "io/guard/guard.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/text.h"
#include "io/cards.h"
#include "io/fits_read.h"
#include "io/fits_write.h"

enum { CARD = 80 };

void rx_wcs_note(rx_text *note, const char *text)
{
    if (note != NULL)
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

static void set_ctype(char *cards, size_t ncards, int axis, const char *value)
{
    const char *key = axis == 1 ? "CTYPE1" : "CTYPE2";
    long i = rx_cards_find(cards, ncards, key);
    rx_text text = {0};
    rx_card_text(&text, key, value, "");
    if (i >= 0 && !text.failed)
        memcpy(cards + i * CARD, text.data, CARD);
    rx_text_free(&text);
}

/* wcslib 7.12 stops reading a number at the D of a Fortran exponent (1.0D-6 becomes 1.0). */
static void repair_exponents(char *cards, size_t ncards)
{
    for (size_t i = 0; i < ncards; i++) {
        char *card = cards + i * CARD;
        if (strncmp(card + 8, "= ", 2) != 0)
            continue;
        for (int j = 11; j < CARD && card[j] != '\'' && card[j] != '/'; j++)
            if ((card[j] == 'D' || card[j] == 'd') &&
                (isdigit((unsigned char)card[j - 1]) || card[j - 1] == '.'))
                card[j] = 'E';
    }
}

/* A number of axes behind the key of 8 characters and '=': indices of FITS keywords have at most two digits
 * (FITS 4.0, section 8.2). -1: it is none. */
static int axes_of(const char *card)
{
    const char *c = card + 9, *end = card + CARD;
    int axes = 0, digits = 0;
    while (c < end && *c == ' ')
        c++;
    for (; c < end && isdigit((unsigned char)*c) && digits < 3; c++, digits++)
        axes = 10 * axes + (*c - '0');
    return digits >= 1 && digits <= 2 && (c == end || *c == ' ' || *c == '/') ? axes : -1;
}

/* wcslib 7.12 makes arrays of WCSAXES x WCSAXES numbers, or of NAXIS x NAXIS, whatever they say, and
 * multiplies as int. */
static void drop_absurd_axes(char *cards, size_t ncards, rx_text *note)
{
    for (size_t i = 0; i < ncards; i++) {
        char *card = cards + i * CARD;
        const int wcsaxes = strncmp(card, "WCSAXES", 7) == 0;
        if (card[8] != '=' || (!wcsaxes && strncmp(card, "NAXIS   ", 8) != 0) || axes_of(card) >= 0)
            continue;
        memset(card, ' ', CARD);
        rx_wcs_note(note, wcsaxes ? "WCSAXES is no number of axes and is ignored"
                                  : "NAXIS is no number of axes and is ignored");
    }
}

/* End of the number that begins at `c`; NULL where there is none. */
static const char *end_of_number(const char *c, const char *end)
{
    int digits = 0, points = 0;
    c += *c == '+' || *c == '-';
    for (; c < end && (isdigit((unsigned char)*c) || (*c == '.' && points == 0)); c++) {
        points += *c == '.';
        digits += *c != '.';
    }
    if (digits > 0 && c < end && (*c == 'E' || *c == 'e')) {
        c += 1 + (c + 1 < end && (c[1] == '+' || c[1] == '-'));
        for (digits = 0; c < end && isdigit((unsigned char)*c); c++)
            digits++;
    }
    return digits > 0 ? c : NULL;
}

/* Order or coefficient of SIP. */
static int is_sip(const char *card)
{
    return (card[0] == 'A' || card[0] == 'B') && (card[1] == '_' || (card[1] == 'P' && card[2] == '_'));
}

/* Of the solution of a digitized plate (DSS), which does without CTYPE. */
static int is_plate(const char *card)
{
    static const char *const keys[] = {"CNPIX",    "PPO",      "AMDX",  "AMDY",
                                       "XPIXELSZ", "YPIXELSZ", "PLTRA", "PLTDEC"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (strncmp(card, keys[i], strlen(keys[i])) == 0)
            return 1;
    return 0;
}

/* NAXIS, wherever it stands, says two axes or more. */
static int is_plane(const char *cards, size_t ncards)
{
    int plane = 0;
    for (size_t i = 0; i < ncards; i++) {
        if (strncmp(cards + i * CARD, "NAXIS   =", 9) != 0)
            continue;
        if (axes_of(cards + i * CARD) < 2)
            return 0;
        plane = 1;
    }
    return plane;
}

/* A WATi_nnn whose type (wtype=tnx) is longer than any, or may go on in the next card: wcslib 7.12 puts the
 * cards together and copies the type over its stack. */
static int is_long_type(const char *card)
{
    enum { LONGEST = 8 };
    static const char word[] = "type";
    const char *c = memchr(card, '\'', CARD), *end = c != NULL ? memrchr(card, '\'', CARD) : NULL;
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

/* wcslib takes them for numbers, whatever they are. */
static int wants_number(const char *card)
{
    return is_sip(card) || (is_plate(card) && strncmp(card, "PLTDECSN", 8) != 0);
}

/* `KEYWORD = value / comment`. */
static int is_whole_card(const char *card)
{
    static const char allowed[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-_";
    const char *c = card, *end = card + CARD;
    const int number = wants_number(card);
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
        c = c < end ? end_of_number(c, end) : NULL;
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
            const int number = wat_number(cards + k * CARD, i);
            n += number > 0 && !seen[number];
            seen[number] = 1;
            highest = number > highest ? number : highest;
        }
        for (size_t k = 0; k < ncards && n < highest; k++)
            if (wat_number(cards + k * CARD, i) > 0)
                memset(cards + k * CARD, ' ', CARD);
    }
}

/* wcslib 7.12 shall see no cards but whole ones, in printable ASCII (FITS standard 4.0, sections 4.1
 * and 4.2): its lexer runs through null pointers on some others, and takes a text without a closing quote to
 * go on in the next cards, which it then writes into 80 bytes on its stack, and WATi_000 (they count from 1)
 * before its memory. SIP and the solution of a plate beside fewer than two axes make it write behind it. All
 * these become blank. */
static void keep_whole_cards(char *cards, size_t ncards)
{
    for (size_t i = 0; i < ncards; i++) {
        char *card = cards + i * CARD;
        for (int j = 0; j < CARD; j++)
            if (card[j] < ' ' || card[j] > '~')
                card[j] = '?';
        if (!is_whole_card(card))
            memset(card, ' ', CARD);
    }
    keep_whole_wats(cards, ncards);
    if (rx_cards_find(cards, ncards, "CTYPE1") >= 0 && rx_cards_find(cards, ncards, "CTYPE2") >= 0)
        return;
    const int plane = is_plane(cards, ncards);
    for (size_t i = 0; i < ncards; i++)
        if (is_sip(cards + i * CARD) || (!plane && is_plate(cards + i * CARD)))
            memset(cards + i * CARD, ' ', CARD);
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
 * would move positions by more: 0, and there are no world coordinates. */
static int drop_distortions(char *cards, size_t ncards, rx_text *note)
{
    int dropped = 0;
    for (size_t i = 0; i < ncards; i++) {
        char *card = cards + i * CARD, key[9], kind[32];
        if (!is_distortion(card))
            continue;
        snprintf(key, sizeof key, "%.*s", (int)strcspn(card, " ="), card);
        if (card[0] == 'C' &&
            (!rx_cards_text(card, 1, key, kind, sizeof kind) || strcasecmp(kind, "LOOKUP") != 0))
            return 0;
        memset(card, ' ', CARD);
        dropped = 1;
    }
    if (dropped)
        rx_wcs_note(note, "tables of distortions (CPDIS, CQDIS) are ignored");
    return 1;
}

/* SCAMP and others write polynomial coefficients PVi_m with plain TAN; as SExtractor does, they are
 * read as TPV (a native TAN knows PVi_0..4 of the longitude axis only, and hardly anyone gives them).
 * Where SIP is there too, SIP counts. SIP coefficients without "-SIP" in CTYPE are SIP as well. */
static void repair_distortion(char *cards, size_t ncards, rx_text *note)
{
    char ctype[2][32];
    int tan = 1, suffix = 0, high = 0, pv2 = 0, axis = 0;
    double order;
    for (int i = 0; i < 2; i++) {
        rx_cards_text(cards, (long)ncards, i == 0 ? "CTYPE1" : "CTYPE2", ctype[i], sizeof ctype[i]);
        tan = tan && strlen(ctype[i]) >= 8 && strncmp(ctype[i] + 5, "TAN", 3) == 0;
        suffix += strlen(ctype[i]) >= 12 && strncmp(ctype[i] + 8, "-SIP", 4) == 0;
    }
    for (size_t i = 0; i < ncards; i++) {
        int m = pv_number(cards + i * CARD, &axis);
        high += m > 4;
        pv2 += m >= 0 && axis == 2;
    }
    int sip = rx_cards_number(cards, (long)ncards, "A_ORDER", &order) &&
              rx_cards_number(cards, (long)ncards, "B_ORDER", &order);
    if (!tan || (!sip && high == 0 && pv2 == 0))
        return;
    for (int i = 0; i < 2; i++) {
        char value[32];
        snprintf(value, sizeof value, "%.5s%s", ctype[i], sip ? "TAN-SIP" : "TPV");
        if (!sip || suffix < 2)
            set_ctype(cards, ncards, i + 1, value);
    }
    if (!sip) {
        rx_wcs_note(note, "TAN with PV coefficients is read as TPV");
        return;
    }
    if (suffix < 2)
        rx_wcs_note(note, "SIP coefficients are used although CTYPE lacks -SIP");
    for (size_t i = 0; i < ncards && (high > 0 || pv2 > 0); i++)
        if (pv_number(cards + i * CARD, &axis) >= 0)
            memset(cards + i * CARD, ' ', CARD);
    if (high > 0 || pv2 > 0)
        rx_wcs_note(note, "PV coefficients beside SIP are ignored");
}

int rx_wcs_guard(char *cards, size_t ncards, rx_text *note)
{
    repair_exponents(cards, ncards);
    keep_whole_cards(cards, ncards);
    drop_absurd_axes(cards, ncards, note);
    repair_distortion(cards, ncards, note);
    return drop_distortions(cards, ncards, note);
}
