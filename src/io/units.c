/* Units as headers write them. */
#include "io/units.h"

#include <ctype.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

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
