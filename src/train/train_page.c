/* The page of a training. */
#include "train/train_page.h"

#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "train/train_figures.h"
#include "validate/escape.h"
#include "validate/page.h"

/* The words of -INFO, but for their first line: the digest is that of the file. */
static void write_model(rx_text *dst, const rx_model *model)
{
    rx_text words = {0};
    rx_model_describe(model, &words);
    rx_page_section(dst, "model", "Model");
    rx_text_add(dst, "<pre>");
    for (char *line = words.data; line != NULL && *line != '\0';) {
        char *end = line + strcspn(line, "\n"), *next = *end != '\0' ? end + 1 : end;
        *end = '\0';
        if (line != words.data) {
            rx_escape_html(dst, line);
            rx_text_add(dst, "\n");
        }
        line = next;
    }
    rx_text_add(dst, "</pre>\n");
    dst->failed = dst->failed || words.failed;
    rx_text_free(&words);
}

static void write_epochs(rx_text *dst, const rx_history *history)
{
    static const char *const heads[] = {"epoch",      "images", "loss",     "test loss",  "unrestored",
                                        "validation", "recall", "flux [%]", "scatter [%]"};
    rx_page_section(dst, "epochs", "Epochs");
    rx_page_table_begin(dst);
    rx_page_row(dst, NULL);
    for (size_t i = 0; i < sizeof heads / sizeof *heads; i++)
        rx_page_head(dst, RX_RIGHT, heads[i]);
    rx_page_row_end(dst);
    /* the last fifty: the whole is in log.ecsv */
    for (long e = history->n > 50 ? history->n - 50 : 0; e < history->n; e++) {
        const rx_epoch *x = &history->epoch[e];
        rx_page_row(dst, NULL);
        rx_page_cell_count(dst, e + 1);
        rx_page_cell_count(dst, (long)x->patches);
        rx_page_cell_number(dst, x->losses.total, 5);
        rx_page_cell_number(dst, x->test_loss, 5);
        rx_page_cell_number(dst, x->input_loss, 5);
        rx_page_cell_number(dst, x->validation, 5);
        rx_page_cell_number(dst, x->recall, 3);
        rx_page_cell_number(dst, 100 * x->bias, 2);
        rx_page_cell_number(dst, 100 * x->scatter, 2);
        rx_page_row_end(dst);
    }
    rx_page_table_end(dst);
    rx_page_note(dst, "All epochs with all terms are in log.ecsv, every bin of every epoch in "
                      "dictionary.ecsv.");
}

/* "KEYWORD value" lines, folded away. */
static void write_settings(rx_text *dst, const char *settings)
{
    int n = 0, capacity = 1;
    char *copy = rx_strdup(settings);
    for (const char *c = settings; *c != '\0'; c++)
        capacity += *c == '\n';
    const char *(*pairs)[2] = rx_alloc((size_t)capacity, sizeof *pairs);
    if (copy == NULL || pairs == NULL) {
        dst->failed = true;
        goto exit;
    }
    for (char *line = copy; *line != '\0' && n < capacity;) {
        char *end = line + strcspn(line, "\n"), *next = *end != '\0' ? end + 1 : end;
        *end = '\0';
        char *value = line + strcspn(line, " ");
        if (*value != '\0')
            *value++ = '\0';
        pairs[n][0] = line;
        pairs[n++][1] = value;
        line = next;
    }
    rx_page_record(dst, n, (const char *const(*)[2])pairs);
exit:
    free(copy);
    free(pairs);
}

rx_status rx_train_page_write(const rx_train_page *page, const char *folder, const char *shown, rx_text *dst,
                              rx_error *err)
{
    rx_figures figures;
    rx_status status = RX_OK;
    rx_figures_begin(&figures);
    if (page->figures) {
        rx_train_figures(&figures, page->history, page->selection);
        status = rx_figures_draw(&figures, NULL, folder, shown, err);
    }
    if (status == RX_OK) {
        rx_page_begin(dst, "Training: ", page->model->name);
        rx_page_links_begin(dst);
        rx_page_link(dst, page->figures, "curves", "Curves");
        rx_page_link(dst, page->figures, "dictionary", "Dictionary");
        rx_page_link(dst, true, "epochs", "Epochs");
        rx_page_link(dst, true, "model", "Model");
        rx_page_links_end(dst);
        if (page->figures) {
            rx_page_section(dst, "curves", "Curves");
            rx_page_figures(dst, &figures, "curve-");
            rx_page_section(dst, "dictionary", "Dictionary");
            rx_page_figures(dst, &figures, "list-");
            rx_page_figures(dst, &figures, "last-");
        }
        write_epochs(dst, page->history);
        write_model(dst, page->model);
        write_settings(dst, page->settings);
        rx_page_end(dst);
        if (dst->failed)
            status = rx_error_memory(err, 0);
    }
    rx_figures_free(&figures);
    return status;
}
