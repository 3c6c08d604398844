/* WRITE_XML: facts, warnings and keywords of a run as a VOTable, as SExtractor's is laid out. Without dates, times, user and
 * host: the same run gives the same bytes. */
#ifndef RX_STAGE_RUN_XML_H
#define RX_STAGE_RUN_XML_H

#include "base/text.h"
#include "data/record.h"
#include "stage/options.h"
#include "stage/tile_facts.h"

typedef struct rx_run_xml_input {
    const rx_options *options;
    const rx_record *record; /* of the run: keywords, and the files that were read */
    const rx_tile_facts *facts;
    const char *image;
    const rx_text *warnings; /* each with its 0 */
} rx_run_xml_input;

rx_status rx_run_xml(const rx_run_xml_input *in, const char *temporary, const char *shown, rx_error *err);

#endif
