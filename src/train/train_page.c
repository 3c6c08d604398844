/* The report of a training. */
#include "train/train_page.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "data/record.h"
#include "report/report.h"

enum { EPOCHS_SHOWN = 50 };

static const char RECALL[] = "of test stars of S/N above 5",
                  BIAS[] = "median relative error of the flux of isolated test stars of S/N above 12",
                  SCATTER[] = "1.4826 MAD of the same";

RX_COLUMNS(LOG, RX_COUNT("epoch", "from 1"), RX_NUMBER("steps", 0, "", "steps of the optimiser so far"),
           RX_NUMBER("patches", 0, "", "training images so far", "images"),
           RX_NUMBER("rate", 6, "", "learning rate of the last step"),
           RX_NUMBER("gradient", 3, "", "mean norm of the gradient before clipping"),
           RX_NUMBER("loss", 5, "", "weighted sum of the terms, mean over the training images"),
           RX_NUMBER("idt_restore", 5, "", "RESTORE(blurred) against sharp"),
           RX_NUMBER("idt_psf", 5, "", "PSF(sharp) against blurred"),
           RX_NUMBER("rec_restore", 5, "", "RESTORE(PSF(sharp)) against sharp"),
           RX_NUMBER("rec_psf", 5, "", "PSF(RESTORE(blurred)) against blurred"),
           RX_NUMBER("light", 5, "", "RESTORE(blurred) against sharp, both smoothed"),
           RX_NUMBER("ffl", 5, "", "focal frequency loss"),
           RX_NUMBER("test_loss", 5, "", "RESTORE(blurred) against sharp, test images, mean over the bins",
                     "test loss"),
           RX_NUMBER("input_loss", 5, "", "the blurred test images themselves against sharp", "unrestored"),
           RX_NUMBER("recall", 3, "", RECALL), RX_NUMBER("bias", 4, "", BIAS, "error of fluxes"),
           RX_NUMBER("scatter", 4, "", SCATTER),
           RX_NUMBER("validation", 5, "",
                     "RESTORE(blurred) against sharp, validation images, the same in every epoch"));

RX_COLUMNS(DICTIONARY, RX_COUNT("epoch", "from 1"), RX_NUMBER("fwhm_low", 2, "pix", "bin, from"),
           RX_NUMBER("fwhm_high", 2, "pix", "bin, to"),
           RX_NUMBER("sigma_low", 2, "",
                     "bin, from: noise where the brightest 0.1 % of the blurred pixels begin at 255"),
           RX_NUMBER("sigma_high", 2, "", "bin, to"), RX_NUMBER("loss", 5, "", "mean test loss"),
           RX_NUMBER("list", 5, "", "the same normalised, which decides the counts of the next epoch"),
           RX_NUMBER("train", 0, "", "training images of this epoch"),
           RX_NUMBER("test", 0, "", "test images of this epoch"), RX_NUMBER("recall", 3, "", RECALL),
           RX_NUMBER("bias", 4, "", BIAS), RX_NUMBER("scatter", 4, "", SCATTER));

static rx_report_table *add_log(rx_report *report, const rx_history *h)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "log", LOG, RX_REPORT_EVERYWHERE);
    for (long e = 0; e < h->n; e++) {
        const rx_epoch *x = &h->epoch[e];
        rx_report_put(t, (double)e + 1, x->steps, x->patches, x->rate, x->norm, x->losses.total,
                      x->losses.idt_restore, x->losses.idt_psf, x->losses.rec_restore, x->losses.rec_psf,
                      x->losses.light, x->losses.ffl, x->test_loss, x->input_loss, x->recall, x->bias,
                      x->scatter, x->validation);
    }
    return t;
}

static rx_report_table *add_dictionary(rx_report *report, const rx_history *h, const rx_selection *grid)
{
    rx_report_table *t = RX_REPORT_TABLE(report, "dictionary", DICTIONARY, RX_REPORT_IN_FILE);
    for (long e = 0; e < h->n; e++)
        for (int b = 0; b < h->nbins; b++) {
            const rx_epoch_bin *x = &h->bin[e * h->nbins + b];
            double fwhm[2], sigma[2];
            rx_selection_bin(grid, b, fwhm, sigma);
            rx_report_put(t, (double)e + 1, fwhm[0], fwhm[1], sigma[0], sigma[1], x->loss, x->list, x->train,
                          x->test, x->recall, x->bias, x->scatter);
        }
    return t;
}

/* Numbers of every epoch against the epoch. */
typedef struct chart {
    const char *id, *title, *reading;
    struct {
        const char *name;
        size_t offset; /* in rx_epoch */
    } curve[4];
} chart;

static const chart CHARTS[] = {
    {"curve-loss",
     "Loss",
     "Means of an epoch. Training: weighted sum of all terms. Test: RESTORE(blurred) against sharp, mean "
     "over the bins; unrestored: the blurred test images themselves. Validation: as test, on the same images "
     "in every epoch; the lowest is the model.",
     {{"training", offsetof(rx_epoch, losses.total)},
      {"test", offsetof(rx_epoch, test_loss)},
      {"test unrestored", offsetof(rx_epoch, input_loss)},
      {"validation", offsetof(rx_epoch, validation)}}},
    {"curve-stars",
     "Test stars",
     "Recall: share of those of S/N above 5 with a peak above 1.7 sky sigmas within 1.5 pixels. Fluxes: "
     "isolated stars of S/N above 12, sum within 2 FWHM of the target PSF, relative to the truth's.",
     {{"recall", offsetof(rx_epoch, recall)},
      {"error of fluxes", offsetof(rx_epoch, bias)},
      {"scatter of fluxes", offsetof(rx_epoch, scatter)}}},
};

static void draw_chart(rx_figures *dst, const rx_history *h, const chart *what)
{
    rx_axes axes = {.xlabel = "epoch", .ylabel = what->title, .x1 = (double)h->n};
    rx_curves c = {0};
    for (int k = 0; k < RX_LENGTH(what->curve) && what->curve[k].name != NULL; k++) {
        rx_curves_add(&c, RX_CURVE_JOINED, k, what->curve[k].name);
        for (int e = 0; e < h->n; e++) {
            const double y = *(const double *)((const char *)&h->epoch[e] + what->curve[k].offset);
            rx_curves_put(&c, e + 1, y, NAN, NAN);
            if (isfinite(y)) {
                axes.y0 = fmin(axes.y0, 1.05 * y);
                axes.y1 = fmax(axes.y1, 1.05 * y);
            }
        }
    }
    rx_curves_figure(dst, what->id, what->title, what->reading, &axes, &c);
}

/* Do the parameters that are kept beat the images as they are? */
static void add_verdict(rx_report *report, const rx_model *model, const rx_history *h)
{
    char sentence[200];
    const long best = model->best >= 1 && model->best <= h->n ? model->best : h->n;
    const rx_epoch *x = &h->epoch[best - 1];
    const bool better = x->test_loss < x->input_loss;
    snprintf(sentence, sizeof sentence,
             "Test loss %.4g against %.4g, epoch %ld of %ld, the lowest in validation; the training %s.",
             x->test_loss, x->input_loss, best, h->n, model->ended ? "has ended" : "has not ended");
    rx_report_verdict(report, better ? RX_MARK_GOOD : RX_MARK_BAD,
                      better ? "Better than unrestored images." : "No better than unrestored images.",
                      sentence);
}

rx_status rx_train_page_write(const rx_train_state *state, const rx_model *model, const char *settings,
                              int figures, const char *folder, const char *shown, rx_error *err)
{
    static const char *const columns[] = {"epoch",      "patches", "loss", "test_loss", "input_loss",
                                          "validation", "recall",  "bias", "scatter"},
                             *const bins[] = {"fwhm_low", "fwhm_high", "sigma_low", "sigma_high", "loss",
                                              "list",     "recall",    "bias",      "scatter"};
    const rx_report_files files = {
        .folder = folder, .shown = shown, .figures = figures, .page = "training.html"};
    const rx_history *h = &state->history;
    rx_report *report = rx_report_new("Training: ", model->name);
    rx_text words = {0};
    char *copy = rx_strdup(settings), *rest = NULL;
    rx_record record = {0};
    const char *(*pairs)[2] = NULL;
    rx_status status;
    if (report == NULL || copy == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    for (char *line = strtok_r(copy, "\n", &rest); line != NULL; line = strtok_r(NULL, "\n", &rest)) {
        char *value = line + strcspn(line, " ");
        if (*value != '\0')
            *value++ = '\0';
        rx_record_add(&record, line, "", "%s", value);
    }
    rx_model_describe(model, &words);
    if (words.failed || record.failed)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(rx_record_list(&record, &pairs, err));
    rx_report_fact(report, "format", "rextract training 1");
    rx_report_fact(report, "model", model->name);
    rx_report_fact_number(report, "best_epoch", (double)model->best);
    rx_report_fact(report, "ended", model->ended ? "yes" : "no");
    add_verdict(report, model, h);
    if (figures) {
        for (int i = 0; i < RX_LENGTH(CHARTS); i++)
            draw_chart(rx_report_figures_of(report), h, &CHARTS[i]);
        rx_report_section(report, "curves", "Curves");
        rx_report_place(report, "curve-");
    }
    rx_report_section(report, "epochs", "Epochs");
    rx_report_show(report, add_log(report, h),
                   RX_VIEW(.from = h->n > EPOCHS_SHOWN ? h->n - EPOCHS_SHOWN : 0, .to = h->n,
                           .ncolumns = RX_LENGTH(columns), .columns = columns));
    rx_report_note(report,
                   "All epochs with all terms are in log.ecsv, every bin of every epoch in dictionary.ecsv.");
    rx_report_section(report, "dictionary", "Dictionary of the last epoch");
    rx_report_show(report, add_dictionary(report, h, &state->selection),
                   RX_VIEW(.from = (h->n - 1) * h->nbins, .ncolumns = RX_LENGTH(bins), .columns = bins));
    /* the words of -INFO, but for their first line: the digest is that of the file */
    const char *line = words.data + strcspn(words.data, "\n");
    rx_report_section(report, "model", "Model");
    rx_report_lines(report, *line != '\0' ? line + 1 : line);
    rx_report_record(report, record.n, (const char *const(*)[2])pairs);
    status = rx_report_write(report, &files, NULL, err);
exit:
    rx_report_free(report);
    rx_text_free(&words);
    rx_record_free(&record);
    free(pairs);
    free(copy);
    return status;
}
