/* Where two outputs differ. */
#ifndef RX_SURVEY_REPLAY_COMPARE_H
#define RX_SURVEY_REPLAY_COMPARE_H

#include "base/text.h"
#include "survey/replay_record.h"

/* ": first in ..." of part `part` (from 1) of two outputs of one kind, in words, appended to dst: row and
 * column, pixel, or line. Nothing where they cannot be read or do not differ. */
void rx_replay_difference(const char *here, const rx_replay_record *here_record, const char *again,
                          const rx_replay_record *again_record, int part, rx_text *dst);

#endif
