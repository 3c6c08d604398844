/* The report of a restoration campaign. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "lab/report.h"
#include "lab/restoration.h"
#include "quality/statistics.h"

enum { TEST = 1 }; /* of the scenes of a bin; 0: those that methods are tuned on */
enum { PSNR, SSIM, SSIM_WANG, SSIM_OBJECT, QUALITIES };
static const char *const AXES[] = {"FWHM (pixels)", "noise sigma (peak 255)"}, *const UPPER[] = {
                                                                                   "PSNR", "SSIM",
                                                                                   "SSIM of Wang et al.",
                                                                                   "SSIM of the object"};
static const rx_quantity QUALITY[QUALITIES] = {
    [PSNR] = {.name = "psnr", .unit = "dB", .digits = 2, .help = "mean over the scenes, t interval"},
    [SSIM] = {.name = "ssim", .unit = "", .digits = 4, .help = "K1 = K2 = 0.001, as the paper"},
    [SSIM_WANG] = {.name = "ssim_wang", .unit = "", .digits = 4, .help = "K1 = 0.01, K2 = 0.03"},
    [SSIM_OBJECT] = {.name = "ssim_object", .unit = "", .digits = 4, .help = "on the pixels of the object"}};

/* --- numbers --- */

typedef struct bin {
    rx_five_numbers level; /* noise levels of its scenes */
    int inside;            /* seeing and median noise level are inside the training */
    int fainter;           /* that level is above those of all fields of it, which yet has patches so faint */
    char name[24], label[32]; /* its middle; the same below the boxes */
} bin;

/* By FWHM, and by noise: bins of the lab from `first` on. */
typedef struct results {
    const rx_lab *lab;
    rx_lab_group group;
    int first;
    bin *bin;                        /* [nconditions]; this and what follows is owned */
    rx_five_numbers *box[QUALITIES]; /* [nconditions][nruns] */
    double *work;                    /* a value for each scene of a bin */
} results;

static double centre(const rx_lab *lab, int b)
{
    return 0.5 * (lab->bin[b].low + lab->bin[b].high);
}

void rx_restoration_name_set(const rx_lab *lab, const rx_lab_unit *unit, char names[2][96])
{
    snprintf(names[0], sizeof *names, "%s", lab->bin[unit->condition].by_sigma ? "noise" : "FWHM");
    snprintf(names[1], sizeof *names, "%g", centre(lab, unit->condition));
}

static const rx_lab_table *scenes_of(const rx_lab *lab, int b)
{
    return &rx_lab_tables_of(lab, b, TEST)[RX_RESTORATION_SCENE];
}

/* Condition c of the group. */
static rx_status measure_bin(results *r, int c, rx_error *err)
{
    const rx_lab *lab = r->lab;
    const int b = r->first + c;
    const rx_lab_bin *drawn = &lab->bin[b];
    const rx_lab_table *scene = scenes_of(lab, b);
    const double fwhm = drawn->by_sigma ? 0.5 * (drawn->other_low + drawn->other_high) : centre(lab, b),
                 *trained = lab->fwhm_trained;
    bin *own = &r->bin[c];
    r->group.place[c] = centre(lab, b);
    r->group.condition[c] = own->name;
    snprintf(own->name, sizeof own->name, "%g", r->group.place[c]);
    for (long i = 0; i < scene->n; i++)
        r->work[i] = rx_lab_own(scene, i)[RX_SCENE_LEVEL];
    RX_TRY(rx_five_numbers_of(scene->n, r->work, &own->level, err));
    own->inside = trained[1] > trained[0] && fwhm >= trained[0] && fwhm <= trained[1] &&
                  !(own->level.median < lab->level_trained[0]);
    own->fainter = lab->level_trained[1] > 0.0 && own->level.median > lab->level_trained[1];
    snprintf(own->label, sizeof own->label, "%s%s", own->name, !own->inside || own->fainter ? "+" : "");
    for (int i = 0; i < QUALITIES * lab->nruns; i++) {
        const int q = i / lab->nruns, run = i % lab->nruns;
        long n = 0;
        for (long i = 0; i < scene->n; i++) {
            r->work[n] = rx_lab_each(scene, i, run)[RX_SCORE_PSNR + q];
            n += isfinite(r->work[n]) != 0;
        }
        rx_five_numbers *box = &r->box[q][c * lab->nruns + run];
        *box = (rx_five_numbers){NAN, NAN, NAN, NAN, NAN, NAN, 0};
        if (n > 0)
            RX_TRY(rx_five_numbers_of(n, r->work, box, err));
        *rx_lab_group_at(&r->group, q, c, run) =
            (rx_finding){rx_mean_estimate(n, r->work, RX_LEVEL), lab->tuned[b * lab->nruns + run].setting};
    }
    return RX_OK;
}

static rx_status measure(const rx_lab *lab, int by_sigma, results *r, rx_error *err)
{
    int n = 0;
    size_t room = 1;
    *r = (results){.lab = lab,
                   .group = {.name = by_sigma ? "noise" : "FWHM",
                             .axis = AXES[by_sigma],
                             .nquantities = QUALITIES,
                             .open = QUALITIES}};
    for (int b = 0; b < lab->nconditions; b++) {
        n += lab->bin[b].by_sigma == by_sigma;
        r->first += lab->bin[b].by_sigma < by_sigma; /* those of FWHM come first */
        room += (size_t)scenes_of(lab, b)->n;
    }
    memcpy(r->group.quantity, QUALITY, sizeof QUALITY);
    RX_TRY(rx_lab_group_open(&r->group, lab, n, err));
    RX_TRY(RX_MAKE(r->bin, (size_t)n, err));
    RX_TRY(RX_MAKE(r->work, room, err));
    for (int i = 0; i < QUALITIES; i++)
        RX_TRY(RX_MAKE(r->box[i], (size_t)n * (size_t)lab->nruns, err));
    for (int c = 0; c < n; c++)
        RX_TRY(measure_bin(r, c, err));
    return RX_OK;
}

static void forget(results *r)
{
    rx_lab_group_free(&r->group);
    free(r->bin);
    for (int i = 0; i < QUALITIES; i++)
        free(r->box[i]);
    free(r->work);
}

/* --- figures --- */

enum { SHOWN_SIDE = 128, PICTURE_WIDTH = 200 };

/* One box per method and bin, as the paper's figure. */
static void plot_boxes(rx_figures *dst, const results *r, int quality)
{
    const rx_lab_group *group = &r->group;
    char id[RX_FIGURE_ID], title[80];
    int colors[RX_METHODS_MAX];
    const char **labels = rx_alloc((size_t)group->nconditions, sizeof *labels);
    dst->script.failed |= labels == NULL;
    for (int c = 0; c < group->nconditions && labels != NULL; c++)
        labels[c] = r->bin[c].label;
    for (int k = 0; k < group->ncolumns; k++)
        colors[k] = rx_method_color(group->column[k]);
    snprintf(id, sizeof id, "%.5s-box-%.11s", group->name, QUALITY[quality].name);
    snprintf(title, sizeof title, "%s by %s", UPPER[quality], group->name);
    rx_figure_add(
        dst, id, title,
        "Box: quartiles, bar: median, ring: mean, whiskers: last value within 1.5 box lengths; a plus: "
        "beyond the training range. As the paper's Figure 5: blurred blue, RL red, the network green.",
        RX_FIGURE_CHART);
    if (labels != NULL)
        rx_plot_boxes(
            dst, &(rx_axes){.xlabel = group->axis, .ylabel = quality == PSNR ? "PSNR (dB)" : "SSIM"},
            &(rx_boxes){group->nconditions, group->ncolumns, labels, group->column, colors, r->box[quality]});
    free(labels);
}

/* The pictures of one scene under work. */
typedef struct example {
    const rx_lab *lab;
    rx_report *report;
    int number;
} example;

/* The middle of a plane, SHOWN_SIDE pixels at most; the same grey scale for all: noise shows as noise, and faint parts are
 * seen. */
static void show_plane(void *user, const char *title, const float *plane)
{
    const example *e = user;
    rx_figures *dst = rx_report_figures_of(e->report);
    const int side = e->lab->config->scene_side, shown = side < SHOWN_SIDE ? side : SHOWN_SIDE,
              from = (side - shown) / 2;
    const double peak = e->lab->config->scene_peak;
    char id[RX_FIGURE_ID];
    if (plane == NULL) {
        rx_report_heading(e->report, title, NULL);
        return;
    }
    float *pixels = RX_NEW(float, (size_t)shown *(size_t)shown);
    dst->script.failed |= pixels == NULL;
    for (int i = 0; i < shown * shown && pixels != NULL; i++)
        pixels[i] = plane[(size_t)(from + i / shown) * (size_t)side + (size_t)(from + i % shown)];
    snprintf(id, sizeof id, "example%d-%.12s", e->number, title);
    if (pixels != NULL && dst->n < RX_FIGURES_MAX) {
        rx_figure_add(dst, id, title, "", RX_FIGURE_PICTURE);
        rx_plot_picture(dst, &(rx_grey_image){shown, shown, PICTURE_WIDTH, pixels, -0.06 * peak, 0.7 * peak,
                                              0.06 * peak});
    }
    free(pixels);
}

/* --- page --- */

RX_COLUMNS(BINS, RX_TEXT("scene", "binned quantity"), RX_TEXT("condition", "middle of the bin"),
           RX_NUMBER("low", 2, "", ""), RX_NUMBER("high", 2, "", ""),
           RX_NUMBER("other_low", 2, "", "range of the other quantity"),
           RX_NUMBER("other_high", 2, "", "range of the other quantity"), RX_COUNT("scenes", ""),
           RX_NUMBER("level_low", 3, "", "noise level on the scale of models"),
           RX_NUMBER("level_median", 3, "", ""), RX_NUMBER("level_high", 3, "", ""),
           RX_COUNT("inside_training", "1: seeing and median noise level are inside the training"),
           RX_COUNT("fainter_than_fields", "1: that level is above those of all whole fields of it"));

static void add_bins(rx_report *report, const results by[2])
{
    rx_report_table *bins = RX_REPORT_TABLE(report, "bins", BINS, RX_REPORT_EVERYWHERE);
    for (const results *r = by; r < by + 2; r++)
        for (int c = 0; c < r->group.nconditions; c++) {
            const rx_lab_group *g = &r->group;
            const rx_lab_bin *drawn = &r->lab->bin[r->first + c];
            const bin *own = &r->bin[c];
            rx_report_put(bins, g->name, g->condition[c], drawn->low, drawn->high, drawn->other_low,
                          drawn->other_high, scenes_of(r->lab, r->first + c)->n, own->level.low,
                          own->level.median, own->level.high, own->inside, own->fainter);
        }
    rx_report_section(report, "bins", "Bins, and where the network's training lies");
    rx_report_show(report, bins,
                   RX_VIEW(.note = "Models know noise on a scale of their own, the noise level: 255 times "
                                   "the noise over what the brightest 0.1 % of the blurred scene exceed."));
}

const char rx_restoration_reading[] =
    "The reference is the scene without noise at the target PSF; noise and PSNR are on the scale of its "
    "brightest pixel. RL knows the true PSF; its iterations and the Gaussian filter after it are the best of "
    "TUNE_NITER and TUNE_FILTER for PSNR, bin by bin, on scenes that are not in the test. Every row is one "
    "image, on which all qualities are measured. RL_SSIM is RL tuned for SSIM instead: a heavy blur. "
    "SMOOTHED "
    "is the blurred image through such a filter alone; RL_FLAT is RL, and NET_FLAT NET, with all below a "
    "threshold, tuned too, set to the sky. <b>PSNR</b> = 20 log<sub>10</sub>(max(reference) / &radic;MSE) dB "
    "(the paper prints it without the square). <b>SSIM</b>: Wang et al. 2004, 11 x 11 Gaussian window of "
    "sigma 1.5, K1 = K2 = 0.001 as in the paper: there the noise of empty sky outweighs the object. With K1 "
    "= "
    "0.01 and K2 = 0.03 as Wang et al. have them the sky counts less, and on the pixels of the object, the "
    "brightest with 90 % of its light, it does not count at all. Pictures: the middle of the first scene of "
    "a bin, asinh(p / 6 "
    "%) of the peak from &minus;6 to 70 % of it.";

/* Facts of the head, and how many choices of tuning lie at an end of what was tried. */
static void add_facts(rx_report *report, const rx_lab *lab)
{
    int choices = 0, ends = 0;
    for (int i = 0; i < lab->nconditions * lab->nruns; i++) {
        choices += lab->tuned[i].setting[0] != '\0';
        ends += lab->tuned[i].at_end;
    }
    rx_report_fact_number(report, "scene_side", lab->config->scene_side);
    rx_report_fact_number(report, "peak", lab->config->scene_peak);
    rx_report_fact_number(report, "sharp_fwhm", lab->sky[0].simulation->sharp_fwhm);
    rx_report_fact_numbers(report, "fwhm_trained", 2, lab->fwhm_trained);
    rx_report_fact_numbers(report, "noise_level_trained", 2, lab->level_trained);
    rx_report_fact_number(report, "tune_scenes", lab->tunes ? lab->config->tune_scenes : 0);
    rx_report_fact_number(report, "tune_choices", choices);
    rx_report_fact_number(report, "tune_choices_at_end", ends);
    if (ends > 0) {
        char text[160];
        snprintf(text, sizeof text,
                 "Tuning took an end of what was tried in %d of %d choices; longer TUNE_NITER or TUNE_FILTER "
                 "may serve the tuned methods better (cells.ecsv).",
                 ends, choices);
        rx_report_sentence(report, text);
        rx_text_printf(rx_report_brief_of(report), "%s\n", text);
    }
}

rx_status rx_restoration_report(rx_lab_page *page, rx_error *err)
{
    const rx_lab *lab = page->lab;
    const int n = lab->config->examples < lab->nconditions ? lab->config->examples : lab->nconditions;
    results by[2] = {{0}};
    rx_status status;
    add_facts(page->report, lab);
    for (int g = 0; g < 2; g++) {
        RX_TRY_EXIT(measure(lab, g, &by[g], err));
        if (by[g].group.nconditions == 0)
            continue;
        for (int q = 0; q < QUALITIES; q++)
            plot_boxes(rx_report_figures_of(page->report), &by[g], q);
        rx_lab_group_show(page, &by[g].group, by[g].group.name, g == 1 ? "By noise" : "By FWHM", 1, NULL);
    }
    if (n > 0)
        rx_report_section(page->report, "examples", "Examples");
    for (int e = 0; e < n; e++) { /* of bins evenly apart */
        char id[RX_FIGURE_ID];
        RX_TRY_EXIT(rx_restoration_example(lab, (2 * e + 1) * lab->nconditions / (2 * n), show_plane,
                                           &(example){lab, page->report, e}, err));
        snprintf(id, sizeof id, "example%d-", e);
        rx_report_place(page->report, id);
    }
    add_bins(page->report, by);
exit:
    forget(&by[0]);
    forget(&by[1]);
    return status;
}
