/* Files of a report. */
#include "report/report_file.h"

rx_status rx_report_file(const char *folder, const char *shown, const char *name, rx_text *text,
                         rx_error *err)
{
    rx_status status = RX_OK;
    rx_text path = {0}, shown_path = {0};
    rx_text_printf(&path, "%s/%s", folder, name);
    rx_text_printf(&shown_path, "%s/%s", shown, name);
    if (path.failed || shown_path.failed)
        status = rx_error_memory(err, 0);
    else
        status = rx_text_write_file(text, path.data, shown_path.data, err);
    rx_text_free(&path);
    rx_text_free(&shown_path);
    rx_text_free(text);
    return status;
}
