/* Files of a report. */
#include "validate/report_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

rx_status rx_report_file(const char *folder, const char *shown, const char *name, rx_text *text,
                         rx_error *err)
{
    rx_status status = RX_OK;
    rx_text path = {0}, told = {0};
    rx_text_printf(&path, "%s/%s", folder, name);
    rx_text_printf(&told, "%s/%s", shown, name);
    if (path.failed || told.failed || text->failed || text->data == NULL) {
        status = rx_error_memory(err, 0);
        goto exit;
    }
    FILE *file = fopen(path.data, "wb");
    if (file == NULL) {
        status = rx_error_at(err, RX_SYSTEM, told.data, -1, 0, "cannot be made: %s", strerror(errno));
        goto exit;
    }
    int bad = fwrite(text->data, 1, text->length, file) != text->length, reason = errno;
    if (fclose(file) != 0 && !bad) {
        bad = 1;
        reason = errno;
    }
    if (bad)
        status = rx_error_at(err, RX_SYSTEM, told.data, -1, 0, "cannot be written: %s", strerror(reason));
exit:
    rx_text_free(&path);
    rx_text_free(&told);
    rx_text_free(text);
    return status;
}
