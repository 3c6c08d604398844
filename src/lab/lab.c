/* The laboratory: what all kinds of campaign have in common. */
#include "lab/lab.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/memory.h"
#include "base/random.h"

/* --- opening --- */

rx_status rx_lab_add_run(rx_lab *lab, const char *word, rx_lab_run run, rx_error *err)
{
    run.restorer = rx_restorer_find(word);
    if (run.restorer == NULL)
        return rx_error_set(err, RX_USAGE, "RESTORE_TYPE %s is not made here", word);
    if (lab->nruns == lab->kind->most)
        return rx_error_set(err, RX_USAGE,
                            "RESTORE_TYPE, and what FLUXES, TUNE_NITER and TUNE_FILTER make of it, gives "
                            "more than %d runs; name fewer",
                            lab->kind->most);
    if (run.name[0] == '\0')
        snprintf(run.name, sizeof run.name, "%s", run.restorer->name);
    lab->run[lab->nruns++] = run;
    return RX_OK;
}

rx_status rx_lab_add_scene(rx_lab *lab, rx_lab_scene scene, rx_error *err)
{
    RX_TRY(RX_GROW(lab->scene, (size_t)lab->nscenes + 1, err));
    lab->scene[lab->nscenes++] = scene;
    return RX_OK;
}

long rx_lab_size(const rx_lab *lab, const rx_ints *list)
{
    return strcmp(lab->config->size, "PAPER") == 0 ? list->v[list->n - 1] : list->v[0];
}

static long tiles_of(const rx_lab *lab, int condition, int scene)
{
    if (lab->bin == NULL)
        return lab->ntiles;
    if (lab->scene[scene].id == RX_SCENE_TEST)
        return lab->bin[condition].nscenes;
    return lab->tunes ? lab->config->tune_scenes : 0;
}

static rx_status list_units(rx_lab *lab, rx_error *err)
{
    for (int c = 0; c < lab->nconditions; c++)
        for (int s = 0; s < lab->nscenes; s++)
            lab->nunits += tiles_of(lab, c, s);
    RX_TRY(RX_MAKE(lab->unit, (size_t)lab->nunits + 1, err));
    rx_lab_unit *unit = lab->unit;
    for (int c = 0; c < lab->nconditions; c++)
        for (int s = 0; s < lab->nscenes; s++)
            for (long t = 0; t < tiles_of(lab, c, s); t++)
                *unit++ = (rx_lab_unit){c, s, t};
    return RX_OK;
}

/* The stage's options for a campaign, everything on one thread; the config lies under them. */
static rx_status stage_options(rx_lab *lab, rx_log *log, rx_error *err)
{
    const rx_words *words = &lab->config->restore_type;
    rx_text restorers = {0};
    rx_status status;
    for (int i = 0; i < words->n; i++) {
        if (strcmp(words->v[i], "AUTO") == 0 || strcmp(words->v[i], "FILE") == 0)
            RX_TRY_EXIT(rx_error_set(err, RX_USAGE,
                                     "RESTORE_TYPE %s is for single tiles; name the restorers that compete",
                                     words->v[i]));
        rx_text_printf(&restorers, "%s%s", i > 0 ? "," : "", words->v[i]);
    }
    if (restorers.failed || restorers.data == NULL)
        RX_TRY_EXIT(rx_error_memory(err, 0));
    RX_TRY_EXIT(rx_config_copy(lab->config->stage, &lab->stage, err));
    RX_TRY_EXIT(rx_settings_set(&lab->stage->settings, "RESTORE_TYPE", restorers.data, log, err));
    RX_TRY_EXIT(rx_options_from_config(lab->stage, log, &lab->options, err));
    rx_pipeline_params *params = &lab->options->pipeline;
    params->nthreads = params->restore.nthreads = params->measure.nthreads = 1;
    params->detect.nthreads = params->templates.par.nthreads = 1;
exit:
    rx_text_free(&restorers);
    return status;
}

rx_status rx_lab_open(const rx_lab_kind *kind, const rx_campaign_config *config, int nthreads, rx_log *log,
                      rx_lab **dst, rx_error *err)
{
    rx_lab *lab = NULL;
    RX_TRY(RX_MAKE(lab, 1, err));
    lab->kind = kind;
    lab->config = config;
    lab->nthreads = nthreads;
    lab->ntiles = rx_lab_size(lab, &config->scene_tiles);
    for (int i = 0; i < config->precisions.n && i < RX_PRECISIONS_MAX; i++)
        lab->precision[lab->nprecisions++] = config->precisions.v[i];
    rx_status status;
    RX_TRY_EXIT(stage_options(lab, log, err));
    RX_TRY_EXIT(kind->open(lab, log, err));
    RX_TRY_EXIT(list_units(lab, err));
    *dst = lab;
    return RX_OK;
exit:
    rx_lab_close(lab);
    return status;
}

void rx_lab_close(rx_lab *lab)
{
    if (lab == NULL)
        return;
    for (int c = 0; c < lab->nskies; c++)
        rx_lab_sky_close(&lab->sky[c]);
    for (int k = 0; lab->set != NULL && k < lab->nconditions * lab->nscenes; k++)
        for (int t = 0; t < lab->kind->ntables; t++)
            free(lab->set[k][t].v);
    free(lab->set);
    free(lab->tuned);
    free(lab->sky);
    free(lab->bin);
    free(lab->scene);
    free(lab->unit);
    rx_options_free(lab->options);
    rx_config_free(lab->stage);
    free(lab);
}

uint64_t rx_lab_seed(const rx_lab *lab, uint64_t purpose)
{
    uint32_t words[4];
    rx_random_block((uint64_t)lab->config->seed, lab->kind->tag, purpose, words);
    return (uint64_t)words[0] << 32 | words[1];
}

/* What a filter leaves of the noise of independent pixels. */
static double norm(const float *filter, int n)
{
    double sum = 0, power = 0;
    for (int i = 0; i < n; i++) {
        sum += fabs((double)filter[i]);
        power += (double)filter[i] * (double)filter[i];
    }
    return n > 0 ? sqrt(power) / sum : 1;
}

rx_options rx_lab_options(const rx_lab *lab, const rx_lab_sky *sky, const rx_lab_run *run)
{
    rx_options options = *lab->options;
    rx_detect_params *detect = &options.pipeline.detect;
    if (run->matched) { /* k sigmas are those of the unfiltered noise: at the same S/N here */
        const double now = norm(detect->filter, detect->filter_width * detect->filter_height);
        const double sigmas = detect->filter_auto ? detect->significance : detect->threshold / now;
        detect->threshold = sigmas * norm(sky->kernel, sky->side * sky->side);
        detect->filter_auto = 0;
        detect->filter = sky->kernel;
        detect->filter_width = detect->filter_height = sky->side;
        detect->filter_normalise = 1;
    }
    if (lab->kind->by_width && strcmp(run->restorer->name, "NET") == 0 && !detect->filter_auto) {
        detect->threshold *= lab->config->net_depth;
        detect->analysis_threshold *= lab->config->net_depth;
    }
    if (run->tuned) {
        options.pipeline.restore.rl_niter = run->niter;
        options.pipeline.restore.rl_stop_discrepancy = 0;
        options.pipeline.restore.rl_denoise = run->filter;
        options.pipeline.restore.rl_denoise_by_psf = 1;
    }
    if (run->templates)
        options.check.quality.flux = RX_QUALITY_TEMPLATE;
    return options;
}

/* --- units --- */

static rx_lab_table new_table(const rx_lab *lab, int t)
{
    const rx_lab_schema *schema = &lab->kind->tables[t];
    return (rx_lab_table){
        .schema = schema, .nruns = lab->nruns, .width = schema->nown + lab->nruns * schema->neach};
}

rx_status rx_lab_rows_add(rx_lab_table *t, long n, double **first, rx_error *err)
{
    const size_t width = (size_t)t->width;
    if (t->v == NULL || t->n + n > t->capacity) {
        const long capacity = t->n + n > 2 * t->capacity ? t->n + n : 2 * t->capacity;
        RX_TRY(RX_GROW(t->v, (size_t)capacity * width + 1, err));
        t->capacity = capacity;
    }
    *first = t->v + t->n * t->width;
    memset(*first, 0, (size_t)n * width * sizeof **first);
    t->n += n;
    return RX_OK;
}

rx_status rx_lab_do_unit(const rx_lab *lab, long unit, const rx_unit_values *done, rx_unit_values *dst,
                         rx_error *err)
{
    rx_lab_table table[RX_LAB_TABLES];
    const int ntables = lab->kind->ntables;
    long n = ntables;
    for (int t = 0; t < ntables; t++)
        table[t] = new_table(lab, t);
    rx_status status = lab->kind->unit(lab, &lab->unit[unit], done, table, err);
    for (int t = 0; t < ntables; t++)
        n += table[t].n * table[t].width;
    if (status == RX_OK)
        status = RX_MAKE(dst->v, (size_t)n, err);
    double *v = dst->v;
    for (int t = 0; t < ntables; t++) {
        if (status == RX_OK)
            *v++ = (double)table[t].n;
        for (long i = 0; i < table[t].n * table[t].width && status == RX_OK; i++)
            *v++ = table[t].schema->exact ? table[t].v[i] : (double)(float)table[t].v[i];
        free(table[t].v);
    }
    dst->n = n;
    return status;
}

rx_lab_table rx_lab_unit_table(const rx_lab *lab, const rx_unit_values *unit, int t)
{
    double *v = unit->v, *end = unit->v + unit->n;
    rx_lab_table table = {.n = -1};
    for (int k = 0; k <= t && v < end; k++, v += table.n * table.width) {
        table = new_table(lab, k);
        table.n = (long)*v++;
        table.v = v;
        if (table.n < 0 || table.n * table.width > end - v)
            return (rx_lab_table){.n = -1};
    }
    return table;
}

/* --- results --- */

rx_lab_table *rx_lab_tables_of(const rx_lab *lab, int condition, int scene)
{
    return lab->set[condition * lab->nscenes + scene];
}

rx_status rx_lab_collect(rx_lab *lab, const rx_unit_values *all, rx_error *err)
{
    const int nsets = lab->nconditions * lab->nscenes;
    lab->values = all;
    RX_TRY(RX_MAKE(lab->set, (size_t)nsets + 1, err));
    for (int k = 0; k < nsets * lab->kind->ntables; k++)
        lab->set[k / lab->kind->ntables][k % lab->kind->ntables] = new_table(lab, k % lab->kind->ntables);
    for (long u = 0; u < lab->nunits; u++)
        for (int t = 0; t < lab->kind->ntables; t++) {
            const rx_lab_table own = rx_lab_unit_table(lab, &all[u], t);
            double *rows;
            if (own.n < 0)
                return rx_error_set(err, RX_INPUT, "the journal holds a unit without a table '%s'; delete it",
                                    lab->kind->tables[t].name);
            RX_TRY(rx_lab_rows_add(&rx_lab_tables_of(lab, lab->unit[u].condition, lab->unit[u].scene)[t],
                                   own.n, &rows, err));
            memcpy(rows, own.v, (size_t)(own.n * own.width) * sizeof *rows);
        }
    RX_TRY(lab->kind->describe(lab, err));
    const size_t used = strlen(lab->about);
    const rx_model *model = lab->options->model;
    if (model != NULL)
        snprintf(lab->about + used, sizeof lab->about - used, "; NET: model %s, digest %s", model->name,
                 model->digest);
    return RX_OK;
}
