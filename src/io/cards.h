/* Header cards in memory: blocks of 80 characters a card, without END. For io/ alone;
 * what others need of them is in fits_read.h and fits_write.h. */
#ifndef RX_IO_CARDS_H
#define RX_IO_CARDS_H

#include <stddef.h>

#include "base/text.h"

/* Index of the first card of that key (case ignored; keys of more than 8 characters or with
 * blanks are ESO's HIERARCH ones), -1 when absent. */
long rx_cards_find(const char *cards, size_t ncards, const char *key);

/* Behind the closing quote of the text whose first quote is at `c`, in which two of them stand for one; NULL
 * when there is none before `end`. */
const char *rx_card_text_end(const char *c, const char *end);

/* Behind the number that begins at `c`, its exponent by E or D; NULL when there is none before `end`. */
const char *rx_card_number_end(const char *c, const char *end);

/* rx_cards_number(), or a number with its unit, which must be that one (io/units.h). */
int rx_cards_quantity(const char *cards, long ncards, const char *key, const char *unit, double *value);

/* Header of an image after a section of it was cut out: CRPIXj (all versions) and LTVj move
 * by the section's first pixel (from 1), NAXISj become its size. In place. */
void rx_cards_cut(char *cards, size_t ncards, const long first[2], const long size[2]);

/* 1 when a card of an input's header may go into another file's header: not structural,
 * not about scaling, compression, table columns or checksums. */
int rx_card_is_useful(const char *card);

/* Take out the cards whose keywords the standard does not allow, which no output could hold; their names, in
 * quotes, are appended to `names`. */
void rx_cards_drop_illegal(rx_text *cards, rx_text *names);

/* Append those cards of `parent` (a primary header) that `cards` lacks: what INHERIT = T asks for. */
void rx_cards_inherit(rx_text *cards, const char *parent, size_t nparent);

#endif
