/* Adding to a library of PSFs. */
#include "stage/library.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/names.h"
#include "io/fits_digest.h"
#include "io/fits_write.h"
#include "io/tile.h"
#include "psf/psf_library.h"
#include "psf/psf_psfex.h"
#include "stage/provenance.h"

rx_status rx_library_add(const rx_options *options, const rx_field *field, const rx_record *record,
                         rx_outputs *outputs, rx_log *log, rx_error *err)
{
    const rx_psf_library *library = &options->pipeline.psf.library;
    rx_tile *tile = field->tile;
    const char *temporary = NULL;
    char digest[RX_HASH_TEXT], *stem = NULL;
    rx_text path = {0}, cards = {0};
    rx_record facts = {0}, own = {0}, whole = {0};
    rx_table *table = NULL;
    rx_fits_writer *file = NULL;
    rx_psf_origin origin;
    if (!library->write || library->folder[0] == '\0')
        return RX_OK;
    if (field->psf == NULL || !rx_psf_library_takes(field->psf)) {
        rx_log_info(
            log,
            "%s[%d]: its PSF is not for PSF_LIBRARY, which takes pixels (RXPSFHOW) of %d stars and more "
            "without a warning",
            tile->name, tile->hdu, RX_PSF_LIBRARY_STARS);
        return RX_OK;
    }
    stem = rx_name_stem(tile->name);
    if (stem == NULL)
        return rx_error_memory(err, 0);
    rx_text_printf(&path, "%s/%s_%d-%s.psf", library->folder, stem, tile->hdu, rx_tile_checksum(tile));
    free(stem);
    rx_status status;
    RX_TRY_EXIT(path.failed ? rx_error_memory(err, 0) : RX_OK);
    RX_TRY_EXIT(rx_psf_psfex_table(field->psf, &table, &cards, err));
    rx_fits_digest_table(table, digest);
    rx_psf_origin_of(tile, &origin);
    rx_psf_origin_facts(&origin, &facts);
    rx_psf_facts(field->psf, &facts);
    rx_record_add(&facts, "RXINSUM", "digest of the input pixels", "%s", rx_tile_checksum(tile));
    rx_record_product(&own, digest, 1, path.data);
    RX_TRY_EXIT(rx_record_of(record, &own, path.data, &whole, err));
    rx_record_cards(&facts, &cards);
    rx_card_text(&cards, "RXDIGEST", digest, "");
    rx_record_cards(&whole, &cards);
    if (facts.failed || own.failed || cards.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(rx_outputs_file(outputs, path.data, &temporary, err));
    RX_TRY_EXIT(rx_fits_create(temporary, path.data, &file, err));
    RX_TRY_EXIT(rx_fits_table(file, table, &cards, err));
    status = rx_fits_close(file, err);
    file = NULL;
exit:
    rx_fits_abort(file);
    rx_table_free(table);
    rx_record_free(&facts);
    rx_record_free(&own);
    rx_record_free(&whole);
    rx_text_free(&path);
    rx_text_free(&cards);
    return status;
}
