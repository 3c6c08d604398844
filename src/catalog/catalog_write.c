/* Writing a catalogue: the right writer, whole files or none. */
#include <errno.h>
#include <string.h>

#include "catalog/catalog.h"
#include "catalog/formats.h"
#include "io/fits_read.h"
#include "io/fits_write.h"

static bool is_fits(rx_catalog_type type)
{
    return type == RX_CATALOG_FITS_1_0 || type == RX_CATALOG_FITS_LDAC;
}

bool rx_table_fact(const rx_table *table, long i, char name[9], char value[512])
{
    const char *card = table->facts + 80 * i;
    snprintf(name, 9, "%.*s", (int)strcspn(card, "= "), card);
    return card[8] == '=' && rx_cards_text(card, table->nfacts - i, name, value, 512);
}

static const rx_text_format *format_of(rx_catalog_type type)
{
    return type == RX_CATALOG_VOTABLE ? rx_votable_format() : rx_ascii_format(type);
}

/* What the text holds goes into the file, NULL: nowhere, and into the sum. */
static rx_status flush(FILE *file, rx_hash *sum, rx_text *text, rx_error *err)
{
    if (text->failed)
        return rx_error_memory(err, text->capacity);
    if (file != NULL && text->length > 0)
        fwrite(text->data, 1, text->length, file);
    else if (text->length > 0)
        rx_hash_add(sum, text->data, text->length);
    text->length = 0;
    return RX_OK;
}

static rx_status put_rows(const rx_text_format *format, const rx_table *table, FILE *file, rx_hash *sum,
                          rx_text *text, rx_error *err)
{
    for (long row = 0; row < table->nrows; row++) {
        format->row(text, table, row);
        RX_TRY(flush(file, sum, text, err));
    }
    return RX_OK;
}

/* A full disk shows when the caller closes the file. */
static rx_status write_text(FILE *file, const rx_catalog *catalog, rx_error *err)
{
    const rx_text_format *format = format_of(catalog->type);
    rx_point_locale locale;
    rx_text text = {0};
    rx_status status;
    RX_TRY(rx_point_locale_begin(&locale, err));
    if (format->head != NULL)
        format->head(&text, catalog);
    RX_TRY_EXIT(flush(file, NULL, &text, err));
    for (int i = 0; i < catalog->n; i++) {
        if (format->table != NULL)
            format->table(&text, catalog, i);
        RX_TRY_EXIT(flush(file, NULL, &text, err));
        RX_TRY_EXIT(put_rows(format, catalog->tables[i], file, NULL, &text, err));
        rx_text_add(&text, format->table_end != NULL ? format->table_end : "");
    }
    rx_text_add(&text, format->end != NULL ? format->end : "");
    status = flush(file, NULL, &text, err);
exit:
    rx_text_free(&text);
    rx_point_locale_end(&locale);
    return status;
}

static rx_status write_text_file(const rx_catalog *catalog, const char *path, const char *temporary,
                                 rx_error *err)
{
    FILE *file = fopen(temporary, "wb");
    if (file == NULL)
        return rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be written: %s", strerror(errno));
    rx_status status = write_text(file, catalog, err);
    errno = 0;
    int failed = fflush(file) != 0 || ferror(file), why = errno;
    failed |= fclose(file) != 0;
    if (status == RX_OK && failed)
        status = rx_error_at(err, RX_SYSTEM, path, -1, 0, "cannot be written: %s",
                             strerror(why != 0 ? why : errno));
    return status;
}

/* What readers of FITS_LDAC look for under SExtractor's names: psfex stops without the first two. */
static void add_ldac_keys(const rx_table *table, rx_text *cards)
{
    static const char *const keys[][3] = {{"RXSIGMA", "SEXBKDEV", "noise of a pixel, ADU"},
                                          {"RXGAIN", "SEXGAIN", "gain, e-/ADU"},
                                          {"RXBACK", "SEXBKGND", "mean sky level, ADU"},
                                          {"RXZP", "SEXMGZPT", "magnitude of 1 ADU"}};
    double value;
    for (size_t i = 0; table->facts != NULL && i < sizeof keys / sizeof *keys; i++)
        if (rx_cards_number(table->facts, table->nfacts, keys[i][0], &value))
            rx_card_number(cards, keys[i][1], value, keys[i][2]);
}

/* In which system and when the image was taken, as its header has it. */
static void add_epoch(rx_text *dst, const rx_table *table)
{
    static const char *const keys[] = {"RADESYS ", "RADECSYS", "EQUINOX ", "DATE-OBS"};
    for (size_t k = 0; k < sizeof keys / sizeof *keys; k++)
        for (long i = 0; table->cards != NULL && i < table->ncards; i++)
            if (strncmp(table->cards + 80 * i, keys[k], 8) == 0 && table->cards[80 * i + 8] == '=') {
                rx_text_add_bytes(dst, table->cards + 80 * i, 80);
                break;
            }
}

/* What made one table: its own facts first, then the record of the run. */
static rx_status table_cards(const rx_catalog *catalog, const rx_table *table, rx_text *cards, rx_error *err)
{
    cards->length = 0;
    if (catalog->type == RX_CATALOG_FITS_LDAC) /* it holds the image's header as a whole */
        add_ldac_keys(table, cards);
    else
        add_epoch(cards, table);
    if (table->facts != NULL)
        rx_text_add_bytes(cards, table->facts, (size_t)table->nfacts * 80);
    rx_record_cards(catalog->record, cards);
    return cards->failed ? rx_error_memory(err, cards->capacity) : RX_OK;
}

static rx_status write_fits(const rx_catalog *catalog, const char *path, const char *temporary, rx_error *err)
{
    rx_table *const *tables = catalog->tables;
    rx_text cards = {0};
    rx_fits_writer *writer = NULL;
    rx_point_locale locale;
    RX_TRY(rx_point_locale_begin(&locale, err));
    rx_status status;
    RX_TRY_EXIT(rx_fits_create(temporary, path, &writer, err));
    for (int i = 0; i < catalog->n; i++) {
        RX_TRY_EXIT(table_cards(catalog, tables[i], &cards, err));
        RX_TRY_EXIT(catalog->type == RX_CATALOG_FITS_LDAC ? rx_fits_ldac(writer, tables[i], &cards, err)
                                                          : rx_fits_table(writer, tables[i], &cards, err));
    }
    status = rx_fits_close(writer, err);
    writer = NULL;
exit:
    rx_fits_abort(writer);
    rx_text_free(&cards);
    rx_point_locale_end(&locale);
    return status;
}

int rx_catalog_has_record(rx_catalog_type type)
{
    return type == RX_CATALOG_ASCII_HEAD || type == RX_CATALOG_VOTABLE || type == RX_CATALOG_DS9 ||
           is_fits(type);
}

int rx_catalog_parts(rx_catalog_type type, int n)
{
    return is_fits(type) || type == RX_CATALOG_VOTABLE ? n : 1;
}

rx_status rx_catalog_digest(rx_catalog_type type, rx_table *const *tables, int n, int part,
                            char dst[RX_HASH_TEXT], rx_error *err)
{
    const int end = type == RX_CATALOG_VOTABLE ? part + 1 : n;
    rx_point_locale locale;
    rx_text text = {0};
    rx_hash sum;
    rx_status status = RX_OK;
    if (is_fits(type)) {
        rx_fits_digest_table(tables[part], dst);
        return RX_OK;
    }
    RX_TRY(rx_point_locale_begin(&locale, err));
    rx_hash_begin(&sum);
    for (int i = part; i < end && status == RX_OK; i++)
        status = put_rows(format_of(type), tables[i], NULL, &sum, &text, err);
    rx_hash_text(&sum, dst);
    rx_text_free(&text);
    rx_point_locale_end(&locale);
    return status;
}

rx_status rx_catalog_write(const rx_catalog *catalog, const char *path, const char *temporary,
                           FILE *standard_out, rx_error *err)
{
    if (catalog->type == RX_CATALOG_NONE)
        return RX_OK;
    if (temporary == NULL) {
        if (is_fits(catalog->type))
            return rx_error_set(
                err, RX_USAGE,
                "CATALOG_NAME STDOUT takes text only; name a file or choose an ASCII CATALOG_TYPE");
        rx_status status = write_text(standard_out, catalog, err);
        if (status == RX_OK && !rx_stream_end(standard_out))
            status = rx_error_set(err, RX_SYSTEM, "the catalogue cannot be written to standard output");
        return status;
    }
    return is_fits(catalog->type) ? write_fits(catalog, path, temporary, err)
                                  : write_text_file(catalog, path, temporary, err);
}
