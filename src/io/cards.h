/* Header cards in memory: blocks of 80 characters a card, without END. Keys: case ignored; those of more than 8
 * characters or with blanks are ESO's HIERARCH ones. */
#ifndef RX_IO_CARDS_H
#define RX_IO_CARDS_H

#include <stddef.h>

#include "base/text.h"
#include "data/record.h"

/* Characters of a card, of its keyword, of a text in it (between "= '" and "'"); bytes of a block of a file; columns that
 * a table can have. */
enum {
    RX_CARD = 80,
    RX_CARD_KEY = 8,
    RX_CARD_TEXT = RX_CARD - RX_CARD_KEY - 4,
    RX_FITS_BLOCK = 2880,
    RX_FITS_FIELDS = 999
};

/* --- reading --- */

/* Index of the first card of that key, -1 when absent. */
long rx_cards_find(const char *cards, size_t ncards, const char *key);

/* Value of a key as text (quotes stripped, trimmed) or number (with or without quotes, its exponent by E or D); 0 when it
 * is absent or no such value. */
int rx_cards_text(const char *cards, long ncards, const char *key, char *dst, int size);
int rx_cards_number(const char *cards, long ncards, const char *key, double *value);

/* The same of a number, or of one with its unit, which must be that one. */
int rx_cards_quantity(const char *cards, long ncards, const char *key, const char *unit, double *value);

/* What stands behind the number of a card as its comment; 0 when there is none. */
int rx_cards_comment(const char *cards, long ncards, const char *key, char *dst, int size);

/* The HISTORY as lines of rx_card_record(), in their order, to `visit`, whose status goes on to the caller. */
typedef rx_status (*rx_history_visitor)(void *user, const char *line, rx_error *err);
rx_status rx_cards_history(const char *cards, long ncards, rx_history_visitor visit, void *user,
                           rx_error *err);

/* One spelling for the many of a unit: "e" (electrons), "adu" (ADU, DN, counts), "s", "mag", "deg", "pix", "sr",
 * "nmgy" (nanomaggies), "mgy", "Jy" with its prefixes m, u, n and M, and one of them per another, "e/s". "":
 * another unit, or none. */
enum { RX_UNIT_TEXT = 16 };
void rx_unit_spelling(const char *text, char dst[RX_UNIT_TEXT]);

/* Behind the closing quote of the text whose first quote is at `c`, in which two of them stand for one; NULL
 * when there is none before `end`. */
const char *rx_card_text_end(const char *c, const char *end);

/* Behind the number that begins at `c`, its exponent by E or D; NULL when there is none before `end`. */
const char *rx_card_number_end(const char *c, const char *end);

/* --- building: a card "KEY = value / comment" is appended; values are sanitised to printable ASCII --- */

void rx_card_text(rx_text *dst, const char *key, const char *value, const char *comment);
void rx_card_number(rx_text *dst, const char *key, double value, const char *comment);
void rx_card_integer(rx_text *dst, const char *key, long value, const char *comment);

/* A line of provenance: a keyword (a number where the value is one) when the name begins with RX and FITS can hold it, else
 * HISTORY, "NAME = value" with the value as rx_printable_add() has it; a card that goes on in the next one ends in '&'. */
void rx_card_record(rx_text *dst, const char *name, const char *value, const char *comment);

/* All entries of a record, a line each. */
void rx_record_cards(const rx_record *record, rx_text *cards);

/* --- choosing --- */

/* Is it the card of that key, or of one of its numbered kin where the key ends in '#'? */
bool rx_card_is(const char *card, const char *key);

/* 1 when a card of an input's header may go into another file's header: not structural,
 * not about scaling, compression, table columns or checksums. */
int rx_card_is_useful(const char *card);

#endif
